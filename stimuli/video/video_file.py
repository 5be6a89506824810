"""Frames of a video file of any format that FFmpeg reads, streamed; damage that can be noticed is refused.

Decoders report damage, where by default they would guess the picture.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.film_reading import Damaged, FilmReading
from evenlight.stimuli.video.colour_planes import PixelReader
from evenlight.stimuli.video.film_bytes import FilmBytes
from evenlight.stimuli.video.film_reader import GO_ON, REMEDY, RISE, FilmReader
from evenlight.stimuli.video.film_stream import SUPPORTED, field_of_view_tag, opened_container
from evenlight.stimuli.video.frame_conversion import UnsupportedColourError
from evenlight.stimuli.video.square_pixels import SQUARE, in_words, pixel_aspect_of
from evenlight.stimuli.video.video_locations import VideoPath
from evenlight.stimuli.video.video_source import FramesInALoop, FrameTimes

SEEK_BACK = (0.0, 10.0)  # [s] before a frame that is sought: from the key frame there it is decoded


@dataclass(frozen=True, slots=True)
class VideoFile(FramesInALoop):
    """A video file that has been read once, for its packets and its SHA-256.

    Attributes
    ----------
    path : Path or RemoteFile
        The file, here or at a URL.
    content : str
        SHA-256 of its bytes.
    timeline : FrameTimes
        When its pictures appear; those with a duration of 0 are never seen.
    reading : FilmReading
        How it is read.
    stamps : array of int, (frames,), or None
        Time stamps of its pictures, rising [ticks]; None where they do not tell them apart.
    held : array of bool, (frames,), or None
        In whose places the picture before is shown.
    keys : array of int
        Places of key frames, rising, where pictures can be sought; else empty.
    pixel_aspect : Fraction
        Width of the file's pixels over their height; its frames come in square ones.
    field_of_view : float or None
        Angle that the width is to span for the viewer [deg]; None if the file does not say.
    notes : tuple of str
        What of it is not taken as it is in the file, or was chosen, in lines.
    """

    path: VideoPath
    content: str
    timeline: FrameTimes = field(repr=False)
    reading: FilmReading
    stamps: NDArray[np.int64] | None = field(compare=False, repr=False)
    held: NDArray[np.bool_] | None = field(compare=False, repr=False)
    keys: NDArray[np.intp] = field(compare=False, repr=False)
    pixel_aspect: Fraction
    field_of_view: float | None
    notes: tuple[str, ...]

    @property
    def name(self) -> str:
        """Short name for titles."""
        return self.path.stem

    @property
    def n_frames(self) -> int:
        """How many frames are shown."""
        return self.timeline.shown

    def sha256(self) -> str:
        """Return the SHA-256 of the file."""
        return self.content

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in the order of their presentation, one at a time.

        Raises
        ------
        InputError
            As `frames_at`.
        """
        return self.frames_at(range(self.n_frames))

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Yield the frames of rising numbers; of those between them, no more are decoded than it takes.

        Raises
        ------
        InputError
            If a frame is damaged or missing, or differs in size from the first one.
        """
        chosen = np.asarray(numbers, dtype=np.intp)
        places = np.flatnonzero(self.timeline.durations)[chosen]
        key_between = np.diff(np.searchsorted(self.keys, places, side="right")) > 0
        for run in np.split(places, 1 + np.flatnonzero(key_between & (np.diff(chosen) > 1))):
            if len(run):
                yield from self._frames(run.tolist())

    def _frames(self, places: list[int]) -> Iterator[Frame]:
        """Yield the frames at rising places, decoded from the first to the last of them."""
        times, durations = self.timeline.times, self.timeline.durations
        reader, shape, wanted = PixelReader(self.pixel_aspect), None, set(places)
        for k, picture in self.pictures(places[0]):
            if k not in wanted:
                continue
            try:
                pixels = reader.pixels(picture)
            except UnsupportedColourError as error:
                raise InputError(
                    f"{self.path} holds {error}; convert it to gamma-encoded R, G, B or Y, Cb, Cr"
                ) from error
            if shape not in (None, pixels.shape):
                raise InputError(
                    f"{self.path} changes its size at frame {k} to {pixels.shape[1]}x{pixels.shape[0]}; "
                    "all frames of a video must be of one size"
                )
            shape = pixels.shape
            yield Frame(float(times[k]), float(durations[k]), pixels)
            # To the end of the file, so that one is noticed that ends before its time.
            if k == places[-1] and durations[k + 1 :].any():
                return

    def pictures(self, first: int = 0) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield the frames that are seen as they are decoded, each with its place in the timeline.

        Parameters
        ----------
        first : int
            Place of the first one.

        Raises
        ------
        InputError
            If a frame is damaged or missing.
        """
        seen = self.timeline.durations > 0
        with self._decoded_from(first) as (k, pictures):
            yield from ((k, one) for k, one in self._placed(k, pictures) if k >= first and seen[k])

    def _placed(self, k: int, pictures: Iterator[av.VideoFrame]) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield pictures with their places from one on, each also in those that are held after it."""
        n = len(self.timeline.times)
        for picture in pictures:
            if k == n:
                raise InputError(f"{self.path} decodes to more than the {n} frames it announces; {REMEDY}")
            if self.stamps is not None and picture.pts not in (None, self.stamps[k]):
                raise InputError(f"{self.path}: its time stamps fall back before frame {k}; {RISE}")
            yield k, picture
            k += 1
            while self.held is not None and k < n and self.held[k]:
                yield k, picture
                k += 1
        if k < n:
            raise InputError(f"{self.path} is damaged: {k} of {n} frames can be decoded; {GO_ON}")

    @contextmanager
    def _decoded_from(self, first: int) -> Iterator[tuple[int, Iterator[av.VideoFrame]]]:
        """Yield pictures from one at or before some place on, and the place of the first."""
        begins_later = np.searchsorted(self.keys, first, side="right") > 1
        for seconds in (*SEEK_BACK, None) if begins_later else (None,):
            with FilmBytes(self.path) as content, opened_container(self.path, content) as container:
                reader = FilmReader(self.path, container, self.reading, self.timeline.times)
                found = reader.pictures() if seconds is None else self._sought(reader, first, seconds)
                if found is not None:
                    yield 0 if seconds is None else first, found
                    # Of a film that was read to its end, few bytes if any are not hashed by now.
                    if seconds is None and content.sha256() != self.content:
                        raise InputError(f"{self.path} has changed since it was opened; run this again")
                    return

    def _sought(self, reader: FilmReader, first: int, seconds: float) -> Iterator[av.VideoFrame] | None:
        """Return the frames from one on, decoded from a key frame so long before it; None if it is not found.

        A decoder passes over, or reports, what it cannot show without the frames before the key frame.
        """
        assert self.stamps is not None
        if reader.decoder.pix_fmt == "pal8":  # its palette comes once, with the first
            return None
        wanted = int(self.stamps[first])
        try:
            back = 0 if reader.stream.time_base is None else round(seconds / reader.stream.time_base)
            reader.container.seek(wanted - back, stream=reader.stream)
            pictures = reader.pictures()
            for picture in pictures:
                if picture.pts == wanted:
                    reader.shown = first + 1
                    return itertools.chain([picture], pictures)
                if picture.pts is None or picture.pts > wanted:
                    return None
        except (InputError, FFmpegError):
            pass
        return None


def open_video_file(
    path: VideoPath, damaged: Damaged = Damaged.REFUSE, stream: int | None = None
) -> VideoFile:
    """Return a video file, read from end to end; it is decoded only where its packets do not tell its frames.

    Parameters
    ----------
    path : Path or RemoteFile
        The file, here or at a URL.
    damaged : Damaged
        What becomes of damage; to find it beforehand, the film is decoded.
    stream : int, optional
        Which of the file's streams is the film, as FFmpeg counts them.

    Raises
    ------
    InputError
        If it is no video, is damaged, ends before its time, or its pixels or its field of view cannot be.
    """
    how = FilmReading(stream, damaged=damaged)
    with FilmBytes(path) as content:
        if content.size == 0:
            raise InputError(f"{path} is empty; {SUPPORTED}")
        with opened_container(path, content) as container:
            reader = FilmReader(path, container, how)
            chosen, timing = reader.stream, reader.times_of_packets()
            aspect, field_of_view = pixel_aspect_of(path, chosen), field_of_view_tag(path, container)
            notes = [] if aspect == SQUARE else [f"pixels of {in_words(aspect)}; resampled to square ones"]
            if len(several := [s.index for s in container.streams.video]) > 1:
                notes.append(f"of its videos {several}, stream {chosen.index} is taken (`stream`)")
        if timing is None:
            content.seek(0)
            with opened_container(path, content) as container:
                timing = FilmReader(path, container, how).times_of_pictures()
        told = (*notes, *timing[1].notes)
        return VideoFile(path, content.sha256(), *timing, aspect, field_of_view, told)

"""Frames of a video file of any format that FFmpeg reads, streamed; damage that can be noticed is refused.

Decoders report damage, where by default they would guess the picture.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

import av
import numpy as np
from av.codec.context import CodecContext
from av.error import FFmpegError
from av.stream import Disposition
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.stimuli.sequence_format import NARROWEST, WIDEST
from evenlight.stimuli.video.colour_planes import PixelReader
from evenlight.stimuli.video.film_bytes import FilmBytes
from evenlight.stimuli.video.frame_conversion import UnsupportedColourError
from evenlight.stimuli.video.packets import REMEDY, timeline_of
from evenlight.stimuli.video.square_pixels import SQUARE, pixel_aspect_of
from evenlight.stimuli.video.video_locations import RemoteFile, VideoPath
from evenlight.stimuli.video.video_source import FrameTimes

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

SUPPORTED = "give a video file that FFmpeg plays, or a folder of images"
SEEK_BACK = (0.0, 10.0)  # [s] before a frame that is sought: from the key frame there it is decoded
ALONE = {"protocol_whitelist": "none"}  # a file from elsewhere opens no other, as playlists do
STRICT = {"err_detect": "crccheck+explode"}
# FFmpeg's TIFF decoder then refuses good files too; it reports damage of its own accord.
STRICT_ALREADY = ("tiff",)
# In 240 files damaged at random these report it at the same frame as in one thread; MPEG-4 and FFV1 do not.
DECODED_SIDE_BY_SIDE = ("h264", "hevc", "vp9")
FIELD_OF_VIEW = "FIELD_OF_VIEW"  # tag of the file: the degrees that the width was rendered to span


@dataclass(frozen=True, slots=True)
class VideoFile:
    """A video file that has been read once, for its packets and its SHA-256, without decoding it.

    Attributes
    ----------
    path : Path or RemoteFile
        The file, here or at a URL.
    timeline : FrameTimes
        When its frames appear.
    content : str
        SHA-256 of its bytes.
    pixel_aspect : Fraction
        Width of the file's pixels over their height; its frames come in square ones.
    field_of_view : float or None
        Angle that the width is to span for the viewer [deg]; None if the file does not say.
    stamps : array of int, (frames,), or None
        Time stamps of its frames, rising [ticks]; None where they do not tell them apart.
    """

    path: VideoPath
    timeline: FrameTimes
    content: str
    pixel_aspect: Fraction = SQUARE
    field_of_view: float | None = None
    stamps: NDArray[np.int64] | None = field(default=None, compare=False, repr=False)
    # Of pictures that were decoded: how their planes give their light (`PixelReader`).
    _planes: dict[object, tuple[bool, bool] | None] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

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
        return self._frames_from(0)

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Yield the frames of rising numbers; of those between them, no more are decoded than it takes.

        Raises
        ------
        InputError
            If a frame is damaged or missing, or differs in size from the first one.
        """
        for _, run in itertools.groupby(enumerate(numbers), lambda pair: pair[1] - pair[0]):
            (_, first), *others = run
            last = first + len(others)
            # To the end of the file, so that one is noticed that ends before its time.
            count = None if last == self.n_frames - 1 else len(others) + 1
            yield from itertools.islice(self._frames_from(first), count)

    def _frames_from(self, first: int) -> Iterator[Frame]:
        times, durations = self.timeline.times, self.timeline.durations
        reader, shape = PixelReader(self.pixel_aspect, self._planes), None
        for k, picture in self.pictures(first):
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

    def pictures(self, first: int = 0) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield the frames that are seen as they are decoded, each with its place in the timeline.

        Parameters
        ----------
        first : int
            Number of the first one, of those that are seen.

        Raises
        ------
        InputError
            If a frame is damaged or missing.
        """
        durations = self.timeline.durations
        k = int(np.flatnonzero(durations)[first]) if first > 0 else 0
        with self._decoded_from(k) as pictures:
            for picture in pictures:
                if k == len(durations):
                    raise InputError(
                        f"{self.path} decodes to more than the {k} frames it announces; {REMEDY}"
                    )
                if durations[k] > 0:
                    yield k, picture
                k += 1
        if k < len(durations):
            raise InputError(
                f"{self.path} is damaged: {k} of {len(durations)} frames can be decoded; {REMEDY}"
            )

    @contextmanager
    def _decoded_from(self, first: int) -> Iterator[Iterator[av.VideoFrame]]:
        for seconds in SEEK_BACK if first > 0 and self.stamps is not None else ():
            with opened_container(self.path) as container:
                pictures = self._sought(container, first, seconds)
                if pictures is not None:
                    yield pictures
                    return
        with opened_container(self.path) as container:
            yield itertools.islice(self._decoded(container), first, None)

    def _sought(
        self, container: InputContainer, first: int, seconds: float
    ) -> Iterator[av.VideoFrame] | None:
        """Return the frames from one on, decoded from a key frame so long before it; None if it is not found.

        It is found by its time stamp. A decoder passes over, or reports, what it cannot show without the
        frames before the key frame: then the search begins earlier.
        """
        assert self.stamps is not None
        stream, wanted = video_stream_of(self.path, container), int(self.stamps[first])
        try:
            back = 0 if stream.time_base is None else round(seconds / stream.time_base)
            container.seek(wanted - back, stream=stream)
            pictures = self._decoded(container, sought=True)
            for picture in pictures:
                if picture.pts == wanted:
                    return itertools.chain([picture], pictures)
                if picture.pts is None or picture.pts > wanted:
                    return None
        except (InputError, FFmpegError):
            pass
        return None

    def _decoded(self, container: InputContainer, sought: bool = False) -> Iterator[av.VideoFrame]:
        stream = video_stream_of(self.path, container)
        if stream.codec_context.name in DECODED_SIDE_BY_SIDE:
            stream.thread_type = "FRAME"
        decode_strictly(stream.codec_context)
        k = 0
        try:
            for picture in container.decode(stream):
                if sought and self.stamps is not None and picture.pts is not None:
                    k = int(np.searchsorted(self.stamps, picture.pts))
                if picture.is_corrupt:
                    raise InputError(f"{self.path} is damaged at frame {k}; {REMEDY}")
                yield picture
                k += 1
        except FFmpegError as error:
            raise InputError(f"{self.path} is damaged at frame {k}: {error.strerror}; {REMEDY}") from error


def open_video_file(path: VideoPath) -> VideoFile:
    """Return a video file, read from end to end but not decoded.

    Raises
    ------
    InputError
        If it is no video, ends before its time, or its pixels or its field of view cannot be.
    """
    with FilmBytes(path) as content:
        if content.size == 0:
            raise InputError(f"{path} is empty; {SUPPORTED}")
        with opened_container(path, content) as container:
            stream = video_stream_of(path, container)
            aspect = pixel_aspect_of(path, stream)
            timeline, stamps = timeline_of(path, container, stream)
            field_of_view = _field_of_view(path, container)
        return VideoFile(path, timeline, content.sha256(), aspect, field_of_view, stamps)


def _field_of_view(path: VideoPath, container: InputContainer) -> float | None:
    tag = container.metadata.get(FIELD_OF_VIEW)
    if tag is None:
        return None
    try:
        degrees = float(tag)
    except ValueError:
        degrees = math.nan
    if not NARROWEST <= degrees <= WIDEST:
        raise InputError(
            f"{path}: its tag {FIELD_OF_VIEW} is {tag[:40]!r}; expected {NARROWEST:g} to {WIDEST:g} degrees"
        )
    return degrees


@contextmanager
def opened_container(path: VideoPath, content: FilmBytes | None = None) -> Iterator[InputContainer]:
    """Yield an open container of a video, which is closed at the end; read from `content` if that is open."""
    with ExitStack() as stack:
        if content is None and isinstance(path, RemoteFile):
            content = stack.enter_context(FilmBytes(path))
        container = stack.enter_context(_container(path, content))
        names = container.format.name.split(",")
        # `tty` draws text files as terminal screens.
        if "tty" in names or not any(_is_moving(s) for s in container.streams.video):
            raise InputError(f"{path} holds no video; {SUPPORTED}")
        if "image2" in names or container.format.name.endswith("_pipe"):
            raise InputError(f"{path} is one image, not a video; for images give the folder that holds them")
        yield container


def _container(path: VideoPath, content: FilmBytes | None) -> InputContainer:
    """Open a container; the protocol before the path keeps FFmpeg from seeing one in its name."""
    try:
        if content is None:
            return av.open(f"file:{path}")
        return av.open(content, "r", options=ALONE if isinstance(path, RemoteFile) else {})
    except (FFmpegError, UnicodeError) as error:
        raise InputError(
            f"FFmpeg finds no video in {path} (not a video, or damaged, or cut off); {SUPPORTED}"
        ) from error


def _is_moving(stream: VideoStream) -> bool:
    """Whether a video stream is one, and not the cover picture of a sound file."""
    return not stream.disposition & Disposition.attached_pic


def video_stream_of(path: VideoPath, container: InputContainer) -> VideoStream:
    """Return the first video stream, with a decoder for it."""
    stream = next(s for s in container.streams.video if _is_moving(s))
    if stream.codec_context is None:
        raise InputError(f"{path} holds a video that FFmpeg has no decoder for; {SUPPORTED}")
    return stream


def decode_strictly(decoder: CodecContext) -> None:
    """Make a decoder that is not yet open stop at the first error, checksums included."""
    if decoder.name not in STRICT_ALREADY:
        decoder.options = STRICT

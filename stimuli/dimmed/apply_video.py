"""A video dimmed by its track, written as a file: `evenlight apply`; sound, subtitles and tags are copied."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.storage.whole_files import written_whole
from evenlight.stimuli.dimmed.apply_options import AppliedVersion, DimmedFile, DimmedVersion
from evenlight.stimuli.dimmed.dimmed_pictures import (
    DimmedPixels,
    DimmedPlanes,
    PictureKind,
    dimmed_pictures,
    picture_of,
)
from evenlight.stimuli.dimmed.dimmed_samples import Codes
from evenlight.stimuli.dimmed.dimming import pixel_scale, version_factors
from evenlight.stimuli.dimmed.encoders import ENCODERS, Encoder
from evenlight.stimuli.dimmed.matched_track import MatchedTrack
from evenlight.stimuli.dimmed.track_fit import LARGEST_DEVIATION, wrong_count, wrong_time
from evenlight.stimuli.video.film_reader import REMEDY
from evenlight.stimuli.video.film_stream import FIELD_OF_VIEW, film_stream, opened_container
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource, field_of_view_of
from evenlight.stimuli.video_writer import new_container, told_by_name

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.packet import Packet
    from av.stream import Stream
    from av.video.frame import VideoFrame
    from av.video.stream import VideoStream

    from evenlight.data_schema.arrays import Array
    from evenlight.data_schema.tracks.brightness_track import BrightnessTrack

SHOWN = {  # from the left
    AppliedVersion.OURS: (DimmedVersion.OURS,),
    AppliedVersion.CONSTANT: (DimmedVersion.CONSTANT,),
    AppliedVersion.SIDE_BY_SIDE: (DimmedVersion.OURS, DimmedVersion.CONSTANT),
}
GAP = 8  # columns of luma between two versions
CLOCK = Fraction(1, 90000)  # of videos that have none of their own; the clock of MPEG-2 systems (ISO 13818-1)

# Of the file that is read, and wrong of one that is written.
NOT_KEPT = ("major_brand", "minor_version", "compatible_brands", "encoder", FIELD_OF_VIEW)
LENGTHS = ("DURATION", "BPS", "NUMBER_OF_BYTES", "NUMBER_OF_FRAMES")
KEPT = ("audio", "subtitle", "attachment")
# Ticks at which frames appear, and at which the last one ends, (frames + 1,); what a tick lasts [s].
Stamps = tuple[NDArray[np.int64], Fraction]


def apply_track(
    video: VideoSource, matched: MatchedTrack, file: DimmedFile, watch: Callable[[int], None] = lambda _: None
) -> list[str]:
    """Write a video dimmed by its track, whole or not at all; return what of its file is left out.

    Parameters
    ----------
    video, matched : VideoSource, MatchedTrack
        The video and its track.
    file : DimmedFile
        What is written; it is replaced if it is there.
    watch : function of int
        Called with how many frames are written.

    Raises
    ------
    InputError
        If the video cannot be dimmed in a file (HDR), does not fit the track, is damaged, or the file cannot
        be written.
    """
    track, gamma, encoder = matched.loaded.track, matched.display.gamma, ENCODERS[file.codec]
    scales = [pixel_scale(version_factors(matched.loaded, one), gamma) for one in SHOWN[file.version]]
    with ExitStack() as stack:
        copied = stack.enter_context(CopiedStreams(video)) if isinstance(video, VideoFile) else None
        stream = None if copied is None else copied.video
        pictures = dimmed_pictures(video, stream, encoder, one_beside_other=len(scales) > 1)
        stamps = _frame_stamps(video, np.asarray(track.times), copied)
        stack.enter_context(told_by_name(file.path))
        partial = stack.enter_context(written_whole(file.path, wait=0.0))
        container = stack.enter_context(new_container(partial))
        target = _stream(container, pictures.kind, encoder, len(scales), stamps)
        left_out = [] if copied is None else copied.begin(container, file.path)
        if len(scales) == 1 and (seen := field_of_view_of(video)) is not None:
            container.metadata[FIELD_OF_VIEW] = f"{seen:.17g}"
        for number, picture in enumerate(_stamped(pictures, scales, stamps, track), start=1):
            container.mux(target.encode(picture))
            if copied is not None:
                copied.copy_to(container, until=float(stamps[0][number] * stamps[1]))
            watch(number)
        container.mux(target.encode())
        if copied is not None:
            copied.copy_to(container)
    return left_out


def _stamped(
    pictures: DimmedPlanes | DimmedPixels, scales: Sequence[Array], stamps: Stamps, track: BrightnessTrack
) -> Iterator[VideoFrame]:
    (ticks, tick), kind, number = stamps, pictures.kind, 0
    for number, (time, versions) in enumerate(pictures.dimmed(scales), start=1):
        k = number - 1
        if abs(time - track.times[k]) > LARGEST_DEVIATION:
            raise wrong_time(track.header.video, k, time, float(track.times[k]))
        picture = picture_of(_beside(versions, kind), kind)
        picture.pts, picture.duration, picture.time_base = int(ticks[k]), int(ticks[number] - ticks[k]), tick
        yield picture
    if number != len(track.times):
        raise wrong_count(track.header.video, number, len(track.times))


def _beside(versions: list[list[Codes]], kind: PictureKind) -> list[Codes]:
    if len(versions) == 1:
        return versions[0]
    rows = []
    for coding, (left, right) in zip(kind.codings, zip(*versions, strict=True), strict=True):
        columns = GAP * left.shape[1] // kind.width
        between = np.full((len(left), columns), round(coding.zero), left.dtype)
        rows.append(np.concatenate([left, between, right], axis=1))
    return rows


def _frame_stamps(video: VideoSource, times: Array, copied: CopiedStreams | None) -> Stamps:
    """Return the stamps of frames at some times [s]: the file's own, if it has any that tell frames apart."""
    if isinstance(video, VideoFile) and video.stamps is not None and copied is not None:
        tick, lasts = copied.video.time_base or CLOCK, float(video.timeline.durations[-1])
        ticks = np.asarray(video.stamps) - round(copied.start / tick)
    else:
        tick, lasts = CLOCK, float(np.median(np.diff(times))) if len(times) > 1 else 0.04
        begin = video.reading.picture_start if isinstance(video, VideoFile) else 0.0
        ticks = np.rint((times + begin) / float(tick)).astype(np.int64)
    return np.append(ticks, ticks[-1] + max(round(lasts / tick), 1)), tick


def _stream(
    container: OutputContainer, kind: PictureKind, encoder: Encoder, versions: int, stamps: Stamps
) -> VideoStream:
    os.environ.setdefault("SVT_LOG", "1")  # else the encoder of AV1 introduces itself on standard error
    ticks, tick = stamps
    rate = Fraction(1, int(np.median(np.diff(ticks)))) / tick
    stream = cast("VideoStream", container.add_stream(encoder.name, rate=rate, options=encoder.options))
    stream.width, stream.height = versions * kind.width + (versions - 1) * GAP, kind.height
    stream.pix_fmt = kind.pixel_format
    context = stream.codec_context
    context.time_base, context.sample_aspect_ratio = tick, kind.aspect
    context.color_range, context.colorspace, context.color_primaries, context.color_trc = kind.tags
    if encoder.tag is not None and container.format.name in ("mp4", "mov"):
        context.codec_tag = encoder.tag
    if kind.turned is not None:
        stream.set_display_matrix(kind.turned)
    return stream


class CopiedStreams(AbstractContextManager["CopiedStreams"]):
    """Streams of a file that are copied packet by packet, as far as the pictures have come.

    Parameters
    ----------
    video : VideoFile
        The video file.

    Attributes
    ----------
    video : VideoStream
        The stream of the pictures.
    start : Fraction
        When the file begins, if that is later than 0: it begins at 0 when it is copied [s].
    """

    def __init__(self, video: VideoFile) -> None:
        self._path, self._opened = video.path, ExitStack()
        self._source = self._opened.enter_context(opened_container(video.path))
        self.video: VideoStream = film_stream(video.path, self._source, video.reading.stream)
        self.start = max(Fraction(self._source.start_time or 0, av.time_base), Fraction(0))
        self._targets: dict[int, Stream] = {}
        self._packets: Iterator[Packet[Any]] = iter(())
        self._next: Packet[Any] | None = None

    def begin(self, container: OutputContainer, out: Path) -> list[str]:
        """Add the streams to a file that has its stream of pictures; return those that it cannot hold.

        Raises
        ------
        InputError
            If the file cannot hold the sound.
        """
        for tag, value in self._source.metadata.items():
            if tag not in NOT_KEPT:
                container.metadata[tag] = value
        others = [stream for stream in self._source.streams if stream.index != self.video.index]
        left_out = [said for stream in others if (said := self._add(stream, container, out)) is not None]
        if chapters := self._source.chapters():
            container.set_chapters(chapters)
        wanted = [self._source.streams[index] for index in self._targets]
        if wanted:
            self._packets = self._source.demux(wanted)
            self._next = self._read()
        return left_out

    def _add(self, stream: Stream, container: OutputContainer, out: Path) -> str | None:
        kind = f"{stream.name or 'unknown'} {stream.type}" if stream.type in KEPT else stream.type
        try:
            if stream.type not in KEPT or (stream.type == "attachment" and out.suffix.lower() != ".mkv"):
                raise ValueError(f"{out.suffix} files hold no such streams")
            added = container.add_stream_from_template(stream)
        except (ValueError, FFmpegError) as error:
            if stream.type == "audio":
                raise ArgumentError(
                    "out",
                    f"{out}: {out.suffix} files cannot hold the sound ({stream.name}); "
                    "give a name that ends in .mkv",
                ) from error
            return f"stream {stream.index} ({kind})"
        added.metadata.update({k: v for k, v in stream.metadata.items() if not k.startswith(LENGTHS)})
        added.disposition = stream.disposition
        if stream.type != "attachment":
            self._targets[stream.index] = added
        return None

    def copy_to(self, container: OutputContainer, until: float = math.inf) -> None:
        """Copy the packets that begin up to some time of the copy [s]."""
        while (packet := self._next) is not None and packet.dts is not None:
            if packet.dts * packet.time_base - self.start > until:
                break
            shift = round(self.start / packet.time_base)
            packet.dts -= shift
            packet.pts = packet.dts if packet.pts is None else packet.pts - shift
            packet.stream = self._targets[packet.stream.index]
            container.mux(packet)
            self._next = self._read()

    def _read(self) -> Packet[Any] | None:
        try:
            return next((p for p in self._packets if p.size and p.dts is not None), None)
        except FFmpegError as error:
            raise InputError(
                f"{self._path} is damaged in its sound or subtitles: {error.strerror}; {REMEDY}"
            ) from error

    def __exit__(self, *_: object) -> None:
        self._opened.close()

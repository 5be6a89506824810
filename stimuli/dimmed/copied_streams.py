"""What a dimmed video keeps of its file beside the pictures: sound, subtitles, chapters and tags, copied."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
from av.error import FFmpegError

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.video.packets import REMEDY
from evenlight.stimuli.video.video_file import FIELD_OF_VIEW, opened_container, video_stream_of

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.packet import Packet
    from av.stream import Stream
    from av.video.stream import VideoStream

    from evenlight.stimuli.video.video_locations import VideoPath

# Of the file that is read, and wrong of one that is written.
NOT_KEPT = ("major_brand", "minor_version", "compatible_brands", "encoder", FIELD_OF_VIEW)
LENGTHS = ("DURATION", "BPS", "NUMBER_OF_BYTES", "NUMBER_OF_FRAMES")
KEPT = ("audio", "subtitle", "attachment")


class CopiedStreams(AbstractContextManager["CopiedStreams"]):
    """Streams of a file that are copied packet by packet, as far as the pictures have come.

    Parameters
    ----------
    path : Path or RemoteFile
        The video file.

    Attributes
    ----------
    video : VideoStream
        The stream of the pictures.
    start : Fraction
        When the file begins, if that is later than 0: it begins at 0 when it is copied [s].
    """

    def __init__(self, path: VideoPath) -> None:
        self._path, self._opened = path, ExitStack()
        self._source = self._opened.enter_context(opened_container(path))
        self.video: VideoStream = video_stream_of(path, self._source)
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
                raise InputError(
                    f"--out {out}: {out.suffix} files cannot hold the sound ({stream.name}); "
                    "give a name that ends in .mkv"
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

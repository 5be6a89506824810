"""Frames of a video file of any format that FFmpeg reads, streamed; damage that can be noticed is refused.

Decoders report damage, where by default they would guess the picture. The checksums inside FFV1 frames are
compared here: FFmpeg's decoder sees them fail but does not report it (RFC 9043, 4.9).
"""

from __future__ import annotations

import re
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import av
import numpy as np
from av.codec.context import CodecContext
from av.error import FFmpegError
from av.stream import Disposition
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.stimuli.video.colour_conversion import ColourConverter, UnsupportedColourError
from evenlight.stimuli.video.frame_times import ASSUMED_RATE, FrameTimes, frame_times, uniform_times

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

REMEDY = "give a whole copy of it, or one encoded again"
SUPPORTED = "give a video file that FFmpeg plays, or a folder of images"
FOOTER = 8  # bytes at the end of a slice: its size (3), an error status (1), parity that makes the CRC 0 (4)
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
STRICT = {"err_detect": "crccheck+explode"}
# FFmpeg's TIFF decoder then refuses good files too; it reports damage of its own accord.
STRICT_ALREADY = ("tiff",)


@dataclass(frozen=True, slots=True)
class VideoFile:
    """A video file whose packets have been read once, without decoding them.

    Attributes
    ----------
    path : Path
        The file.
    timeline : FrameTimes
        When its frames appear.
    """

    path: Path
    timeline: FrameTimes

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
        return sha256_of_file(self.path)

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in the order of their presentation, one at a time.

        Raises
        ------
        InputError
            If a frame is damaged or missing, or differs in size from the first one.
        """
        times, durations = self.timeline.times, self.timeline.durations
        convert = ColourConverter()
        shape, k = None, 0
        with _opened(self.path) as container:
            for picture in self._decoded(container):
                if k == len(times):
                    raise InputError(
                        f"{self.path} decodes to more than the {k} frames it announces; {REMEDY}"
                    )
                try:
                    pixels = convert.rgb(picture)
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
                if durations[k] > 0:
                    yield Frame(float(times[k]), float(durations[k]), pixels)
                k += 1
        if k < len(times):
            raise InputError(f"{self.path} is damaged: {k} of {len(times)} frames can be decoded; {REMEDY}")

    def _decoded(self, container: InputContainer) -> Iterator[av.VideoFrame]:
        """Yield decoded frames; stop at the first that the decoder reports as damaged."""
        stream = _video_stream(self.path, container)
        decode_strictly(stream.codec_context)
        k = 0
        try:
            for picture in container.decode(stream):
                if picture.is_corrupt:
                    raise InputError(f"{self.path} is damaged at frame {k}; {REMEDY}")
                yield picture
                k += 1
        except FFmpegError as error:
            raise InputError(f"{self.path} is damaged at frame {k}: {error.strerror}; {REMEDY}") from error


def open_video_file(path: Path) -> VideoFile:
    """Return a video file, read from end to end but not decoded.

    Raises
    ------
    InputError
        If it is no video, or ends before its time.
    """
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path} is empty; {SUPPORTED}")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; {SUPPORTED}") from error
    with _opened(path) as container:
        return VideoFile(path, _timeline(path, container))


def _opened(path: Path) -> InputContainer:
    """Open a container; the protocol before the path keeps FFmpeg from seeing one in its name."""
    try:
        container = av.open(f"file:{path}")
    except (FFmpegError, UnicodeError) as error:
        raise InputError(
            f"FFmpeg finds no video in {path} (not a video, or damaged, or cut off); {SUPPORTED}"
        ) from error
    names = container.format.name.split(",")
    # `tty` draws text files as terminal screens.
    if "tty" in names or not any(_is_moving(s) for s in container.streams.video):
        container.close()
        raise InputError(f"{path} holds no video; {SUPPORTED}")
    if "image2" in names or container.format.name.endswith("_pipe"):
        container.close()
        raise InputError(f"{path} is one image, not a video; for images give the folder that holds them")
    return container


def _is_moving(stream: VideoStream) -> bool:
    """Whether a video stream is one, and not the cover picture of a sound file."""
    return not stream.disposition & Disposition.attached_pic


def _video_stream(path: Path, container: InputContainer) -> VideoStream:
    """Return the first video stream, with a decoder for it."""
    stream = next(s for s in container.streams.video if _is_moving(s))
    if stream.codec_context is None:
        raise InputError(f"{path} holds a video that FFmpeg has no decoder for; {SUPPORTED}")
    return stream


def _timeline(path: Path, container: InputContainer) -> FrameTimes:
    """Read all packets, and return when their frames appear."""
    stream = _video_stream(path, container)
    # An MP4 lists every packet before the first is read; other containers' indices may hold key frames only.
    promised = len(stream.index_entries) if "mp4" in container.format.name else 0
    packets = _read_packets(path, container, stream)
    if packets.count < promised:
        raise InputError(f"{path} is cut off: {packets.count} of {promised} frames are there; {REMEDY}")
    rates = [rate for rate in (stream.average_rate, stream.guessed_rate) if rate]
    tick = stream.time_base or 1 / ASSUMED_RATE
    stamps = packets.stamps()
    if stamps is None:
        return uniform_times(packets.count, rates[0] if rates else ASSUMED_RATE)
    times = frame_times(stamps, tick, packets.last_duration, rates)
    end = float(stamps.min() * tick) + float(times.times[-1] + times.durations[-1])
    promised_end = _promised_end(container, stream)
    if promised_end - end > 0.75 * float(np.median(times.durations)) + float(tick):
        raise InputError(
            f"{path} is cut off: it ends at {end:.3f} s instead of {promised_end:.3f} s; {REMEDY}"
        )
    return times


@dataclass(slots=True)
class _Packets:
    """Time stamps of the packets of a stream [ticks], and which of its checksums hold."""

    shown: array[int] = field(default_factory=lambda: array("q"))
    decoded: array[int] = field(default_factory=lambda: array("q"))
    count: int = 0
    last_duration: int = 0
    intact: int = 0
    first_broken: int | None = None

    def note_checksum(self, intact: bool) -> None:
        """Count a good checksum, or note the first bad one; if none at all is good, the file has none."""
        if intact:
            self.intact += 1
        elif self.first_broken is None:
            self.first_broken = self.count

    def stamps(self) -> NDArray[np.int64] | None:
        """Return presentation times, or decoding times where the file has no others, or None."""
        complete = next((s for s in (self.shown, self.decoded) if len(s) == self.count), None)
        return None if complete is None else np.array(complete, dtype=np.int64)


def _read_packets(path: Path, container: InputContainer, stream: VideoStream) -> _Packets:
    """Read all packets of a stream without decoding them."""
    packets, latest = _Packets(), None
    try:
        for packet in container.demux(stream):
            if packet.size == 0 or packet.is_discard:  # the end; cut away by the container's edit list
                continue
            if packet.is_corrupt:
                raise InputError(f"{path} is cut off or damaged at frame {packets.count}; {REMEDY}")
            if stream.codec_context.name == "ffv1":
                packets.note_checksum(slices_intact(bytes(packet)))
            packets.count += 1
            if packet.pts is not None:
                packets.shown.append(packet.pts)
                if latest is None or packet.pts >= latest:
                    latest, packets.last_duration = packet.pts, packet.duration or 0
            if packet.dts is not None:
                packets.decoded.append(packet.dts)
    except FFmpegError as error:
        raise InputError(f"{path} is damaged at frame {packets.count}: {error.strerror}; {REMEDY}") from error
    if packets.intact and packets.first_broken is not None:
        raise InputError(
            f"{path} is damaged at frame {packets.first_broken}: its checksum is wrong; {REMEDY}"
        )
    if not packets.count:
        raise InputError(f"{path} holds no frames: it is cut off or damaged; {REMEDY}")
    return packets


def _promised_end(container: InputContainer, stream: VideoStream) -> float:
    """Return when the header of the file says that the stream ends [s], 0 where it says nothing certain."""
    if container.format.name == "avi" and stream.average_rate:
        return float(stream.frames / stream.average_rate)
    if "matroska" not in container.format.name:
        return 0.0  # FFmpeg's own estimate from the size of the file is no promise
    tag = re.fullmatch(r"([0-9]+):([0-9]+):([0-9.]+)", stream.metadata.get("DURATION", ""))
    if tag is not None:
        return 3600 * int(tag[1]) + 60 * int(tag[2]) + float(tag[3])
    alone = len(container.streams) == 1
    return float(container.duration / av.time_base) if alone and container.duration else 0.0


def slices_intact(frame: bytes) -> bool:
    """Whether the slices of an FFV1 frame, each with a checksum, fill it exactly and are all intact.

    False also for a frame that was written without checksums.
    """
    end = len(frame)
    while end > 0:
        size = FOOTER + int.from_bytes(frame[max(end - FOOTER, 0) : end - FOOTER + 3], "big")
        if end < size or _crc(frame[end - size : end]) != 0:
            return False
        end -= size
    return True


def _crc(slice_: bytes) -> int:
    """Return the CRC of RFC 9043, 4.9.3, bits reversed: polynomial 0x04C11DB7, highest bit first, start 0.

    zlib has the same polynomial from the lowest bit on, between two inversions.
    """
    return zlib.crc32(slice_.translate(_REVERSED_BITS), 0xFFFFFFFF) ^ 0xFFFFFFFF


def decode_strictly(decoder: CodecContext) -> None:
    """Make a decoder that is not yet open stop at the first error, checksums included."""
    if decoder.name not in STRICT_ALREADY:
        decoder.options = STRICT

"""Frames of a video file of any format that FFmpeg reads, streamed; damage that can be noticed is refused.

Decoders report damage, where by default they would guess the picture. The checksums inside FFV1 frames are
compared here: FFmpeg's decoder sees them fail but does not report it (RFC 9043, 4.9). Files that are written
here are lossless, FFV1 in Matroska, whole or not at all.
"""

from __future__ import annotations

import math
import re
import zlib
from array import array
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
import numpy as np
from av.codec.context import CodecContext
from av.error import FFmpegError
from av.stream import Disposition
from av.video.frame import VideoFrame
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.whole_files import results_folder
from evenlight.stimuli.sequence_format import NARROWEST, WIDEST
from evenlight.stimuli.video.frame_conversion import ColourConverter, UnsupportedColourError
from evenlight.stimuli.video.square_pixels import SQUARE, pixel_aspect_of
from evenlight.stimuli.video.video_source import (
    ASSUMED_RATE,
    FrameTimes,
    frame_times,
    rate_from_number,
    uniform_times,
)

if TYPE_CHECKING:
    from av.container import InputContainer, OutputContainer
    from av.video.stream import VideoStream

REMEDY = "give a whole copy of it, or one encoded again"
SUPPORTED = "give a video file that FFmpeg plays, or a folder of images"
FOOTER = 8  # bytes at the end of a slice: its size (3), an error status (1), parity that makes the CRC 0 (4)
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
STRICT = {"err_detect": "crccheck+explode"}
# FFmpeg's TIFF decoder then refuses good files too; it reports damage of its own accord.
STRICT_ALREADY = ("tiff",)
FORMATS = {8: "bgr0", 10: "gbrp10le", 12: "gbrp12le", 16: "gbrp16le"}
# Version 3 with checksums: a damaged file is noticed. Every frame stands alone.
FFV1_OPTIONS = {"level": "3", "slicecrc": "1", "g": "1"}
FIELD_OF_VIEW = "FIELD_OF_VIEW"  # tag of the file: the degrees that the width was rendered to span


@dataclass(frozen=True, slots=True)
class VideoFile:
    """A video file whose packets have been read once, without decoding them.

    Attributes
    ----------
    path : Path
        The file.
    timeline : FrameTimes
        When its frames appear.
    pixel_aspect : Fraction
        Width of the file's pixels over their height; its frames come in square ones.
    field_of_view : float or None
        Angle that the width is to span for the viewer [deg]; None if the file does not say.
    """

    path: Path
    timeline: FrameTimes
    pixel_aspect: Fraction = SQUARE
    field_of_view: float | None = None

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
        convert = ColourConverter(self.pixel_aspect)
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
        If it is no video, ends before its time, or its pixels or its field of view cannot be.
    """
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path} is empty; {SUPPORTED}")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; {SUPPORTED}") from error
    with _opened(path) as container:
        aspect = pixel_aspect_of(path, _video_stream(path, container))
        return VideoFile(path, _timeline(path, container), aspect, _field_of_view(path, container))


def _field_of_view(path: Path, container: InputContainer) -> float | None:
    """Return the field of view that a file was rendered for [deg], None if it does not say."""
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


def write_video(
    path: Path,
    frames: Iterable[Frame | NDArray[Any]],
    frames_per_second: float,
    bits: int | None = None,
    field_of_view: float | None = None,
) -> int:
    """Write frames without loss, and return how many there were.

    Parameters
    ----------
    path : Path
        The file, ending in .mkv; it is there whole at the end, or not at all.
    frames : iterable of Frame or array, (height, width, 3), uint8 or uint16
        Gamma-encoded R, G, B over the full range of the integer type, all of one size.
    frames_per_second : float
        Constant frame rate [Hz].
    bits : int, optional
        Bits a channel: 8, 10, 12 or 16; those of the first frame's type if not given. Fewer bits than
        the type holds are lossless only for values that lie on their grid, as those of the built-in
        sequences do for 10 bits.
    field_of_view : float, optional
        Angle that the width is to span for the viewer [deg]; the file's tag `FIELD_OF_VIEW`.

    Raises
    ------
    InputError
        If the file cannot be written, or there is no frame.
    """
    if path.suffix.lower() != ".mkv":
        raise InputError(f"cannot write {path}: lossless video is Matroska, give a name that ends in .mkv")
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder, give the name of a file")
    rate = rate_from_number(frames_per_second)
    arrays = (frame.pixel_values if isinstance(frame, Frame) else frame for frame in frames)
    written = 0
    with (
        _told_by_name(path),
        results_folder(path.parent) as folder,
        _matroska(folder / path.name) as container,
    ):
        if field_of_view is not None:
            container.metadata[FIELD_OF_VIEW] = f"{field_of_view:.17g}"
        stream = None
        for array in arrays:
            if stream is None:
                depth = bits or 8 * array.dtype.itemsize
                stream = container.add_stream("ffv1", rate=rate, options=FFV1_OPTIONS)
                stream.height, stream.width = array.shape[:2]
                stream.pix_fmt = FORMATS[depth]
            container.mux(stream.encode(_picture(array, depth, stream)))
            written += 1
        if stream is None:
            raise InputError(f"no frames to write to {path}")
        container.mux(stream.encode())
    return written


def _matroska(path: Path) -> OutputContainer:
    """Open a Matroska file to be written, without a random identifier: same frames, same bytes."""
    return av.open(f"file:{path}", "w", format="matroska", container_options={"fflags": "+bitexact"})


@contextmanager
def _told_by_name(path: Path) -> Iterator[None]:
    """Name the file that cannot be written."""
    try:
        yield
    except (OSError, FFmpegError) as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error


def _picture(pixels: NDArray[Any], bits: int, stream: VideoStream) -> VideoFrame:
    """Return a frame in the pixel format of the stream; every conversion keeps the values as they are."""
    if pixels.dtype not in (np.uint8, np.uint16) or (bits == 8) != (pixels.dtype == np.uint8):
        raise ValueError(f"need uint8 for 8 bits and uint16 for more, got {pixels.dtype} for {bits} bits")
    if pixels.shape != (stream.height, stream.width, 3):
        raise ValueError(f"need frames of shape {(stream.height, stream.width, 3)}, got {pixels.shape}")
    if bits == 8:
        return VideoFrame.from_ndarray(np.ascontiguousarray(pixels), "rgb24").reformat(format=FORMATS[8])
    top = 2**bits - 1
    codes = pixels if bits == 16 else ((pixels.astype(np.uint32) * top + 32767) // 65535).astype(np.uint16)
    return VideoFrame.from_ndarray(np.ascontiguousarray(codes), FORMATS[bits])

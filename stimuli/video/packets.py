"""Packets of a video file, read from end to end, not decoded: when frames appear, and whether all are there.

The checksums inside FFV1 frames are compared here: FFmpeg's decoder sees them fail but does not report it
(RFC 9043, 4.9).
"""

from __future__ import annotations

import re
import zlib
from array import array
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.video.video_source import ASSUMED_RATE, FrameTimes, frame_times, uniform_times

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

    from evenlight.stimuli.video.video_locations import VideoPath

REMEDY = "give a whole copy of it, or one encoded again"
FOOTER = 8  # bytes at the end of a slice: its size (3), an error status (1), parity that makes the CRC 0 (4)
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def timeline_of(
    path: VideoPath, container: InputContainer, stream: VideoStream
) -> tuple[FrameTimes, NDArray[np.int64] | None]:
    """Read all packets: return when their frames appear, and rising stamps if these tell them apart.

    Raises
    ------
    InputError
        If the file is cut off, or damaged as far as its packets tell.
    """
    # An MP4 lists every packet before the first is read; other containers' indices may hold key frames only.
    promised = len(stream.index_entries) if "mp4" in container.format.name else 0
    packets = _read_packets(path, container, stream)
    if packets.count + packets.cut_away < promised:
        raise InputError(f"{path} is cut off: {packets.count} of {promised} frames are there; {REMEDY}")
    rates = [rate for rate in (stream.average_rate, stream.guessed_rate) if rate]
    tick = stream.time_base or 1 / ASSUMED_RATE
    stamps = packets.stamps()
    if stamps is None:
        return uniform_times(packets.count, rates[0] if rates else ASSUMED_RATE), None
    if len(stamps) > 1 and stamps.min() == stamps.max():
        raise InputError(f"{path}: all its {len(stamps)} frames have the same time; {REMEDY}")
    times = frame_times(stamps, tick, packets.last_duration, rates)
    end = float(stamps.min() * tick) + float(times.times[-1] + times.durations[-1])
    promised_end = _promised_end(container, stream)
    if promised_end - end > 0.75 * float(np.median(times.durations)) + float(tick):
        raise InputError(
            f"{path} is cut off: it ends at {end:.3f} s instead of {promised_end:.3f} s; {REMEDY}"
        )
    rising = np.sort(stamps)
    return times, rising if (np.diff(rising) > 0).all() else None


@dataclass(slots=True)
class _Packets:
    """Time stamps of the packets of a stream [ticks], and which of its checksums hold."""

    shown: array[int] = field(default_factory=lambda: array("q"))
    decoded: array[int] = field(default_factory=lambda: array("q"))
    count: int = 0
    cut_away: int = 0  # by the container's edit list
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


def _read_packets(path: VideoPath, container: InputContainer, stream: VideoStream) -> _Packets:
    packets, latest = _Packets(), None
    try:
        for packet in container.demux(stream):
            if packet.size == 0 or packet.is_discard:  # the end, or not to be shown
                packets.cut_away += packet.is_discard
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

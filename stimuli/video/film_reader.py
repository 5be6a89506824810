"""The pass over a film: its packets, the pictures that they decode to, and what of it is damaged.

The decoder's stamps are a film's timeline. Packets alone tell it, without decoding, where each is one
picture (docs/decisions/frame-times.md). The checksums inside FFV1 frames are compared here: FFmpeg's decoder
sees them fail but does not report it (RFC 9043, 4.9).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
from av.codec.context import CodecContext
from av.error import FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.stimuli.video.film_stream import film_stream

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.packet import Packet
    from av.video.codeccontext import VideoCodecContext
    from av.video.frame import VideoFrame
    from av.video.stream import VideoStream

    from evenlight.stimuli.video.video_locations import VideoPath

REMEDY = "give a whole copy of it, or one encoded again"
GO_ON = f"{REMEDY}; `damaged` hold or skip goes on without what is lost"
STRICT = {"err_detect": "crccheck+explode"}
# FFmpeg's TIFF decoder then refuses good files too; it reports damage of its own accord.
STRICT_ALREADY = ("tiff",)
# In 240 files damaged at random these report it at the same frame as in one thread; MPEG-4 and FFV1 do not.
DECODED_SIDE_BY_SIDE = ("h264", "hevc", "vp9")
# Each packet of these is one picture, but for the fields of interlaced films.
ONE_TO_ONE = (
    "h264",
    "hevc",
    "av1",
    "vp9",
    "mpeg2video",
    "mpeg4",
    "mjpeg",
    "prores",
    "ffv1",
    "dnxhd",
    "rawvideo",
)
OF_ALPHA = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
OF_FIELDS = ("h264", "mpeg2video")
PROGRESSIVE = 1  # FFmpeg's AV_FIELD_PROGRESSIVE
FOOTER = 8  # bytes at the end of a slice: its size (3), an error status (1), parity that makes the CRC 0 (4)
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


@dataclass(slots=True)
class FilmReader:
    """Reads a stream from where its container stands, and keeps account of it.

    Attributes
    ----------
    path, container : VideoPath, InputContainer
        The film.
    wanted : int or None
        Its stream, if it is not the one that players take.
    damaged : Damaged
        What becomes of damage: refused, or the pictures up to the next key frame are lost.
    count, cut_away : int
        Packets that were read, and those that the container's edit list cuts away.
    stamps : list of int or None
        Time stamps of the packets, in their order [ticks].
    decoding : list of int or None
        Their decoding times [ticks].
    last_duration : int
        Duration of the packet that is shown last [ticks].
    lost : list of int or None
        Stamps of the packets that damage costs [ticks].
    begins_with_key, in_order : bool
        Whether the first packet is a key frame, and no key frame lies before a picture that is decoded first.
    shown : int
        How many pictures the decoder has given, or the number of the next one.
    times : array, (frames,), or None
        When the frames appear, as far as it is known beforehand, to tell where damage is [s].
    """

    path: VideoPath
    container: InputContainer
    damaged: Damaged = Damaged.REFUSE
    wanted: int | None = None
    stream: VideoStream = field(init=False)
    decoder: VideoCodecContext = field(init=False)
    count: int = 0
    cut_away: int = 0
    stamps: list[int | None] = field(default_factory=list)
    decoding: list[int | None] = field(default_factory=list)
    last_duration: int = 0
    lost: list[int | None] = field(default_factory=list)
    begins_with_key: bool = True
    in_order: bool = True
    shown: int = 0
    times: NDArray[np.float64] | None = None
    _latest: int | None = None
    _intact: int = 0
    _broken: int | None = None  # the first frame whose checksum is wrong
    _waits: bool = False  # for a key frame
    _key: int | None = None  # stamp of the one that ended the waiting: no picture before it is whole

    def __post_init__(self) -> None:
        self.stream = film_stream(self.path, self.container, self.wanted)
        self.decoder = self.stream.codec_context
        if self.stream.metadata.get("alpha_mode") == "1" and self.decoder.name in OF_ALPHA:
            # The two pictures, of colours and of transparency, are decoded by this one only.
            self.decoder = cast("VideoCodecContext", CodecContext.create(OF_ALPHA[self.decoder.name], "r"))
        self._waits = self.damaged is not Damaged.REFUSE

    def packets(self) -> Iterator[Packet[VideoStream]]:
        """Yield the packets that hold pictures, each noted; at the end an empty one.

        Raises
        ------
        InputError
            If one is damaged, and damage is refused.
        """
        try:
            for packet in self.container.demux(self.stream):
                if packet.size == 0:
                    if self._intact and self._broken is not None and self.damaged is Damaged.REFUSE:
                        raise self._refusal(self._broken, "its checksum is wrong")
                    yield packet
                    return
                self._note(packet)
                yield packet
        except FFmpegError as error:
            if self.damaged is Damaged.REFUSE:
                raise self._refusal(self.count, error.strerror) from error

    def _note(self, packet: Packet[VideoStream]) -> None:
        if packet.is_discard:
            self.cut_away += 1
            return
        if packet.is_corrupt and self.damaged is Damaged.REFUSE:
            raise self._refusal(self.count, "its packet is cut off or damaged")
        if self.decoder.name == "ffv1":
            if slices_intact(bytes(packet)):
                self._intact += 1
            elif self._broken is None:
                self._broken = self.count
        if not self.count:
            self.begins_with_key = packet.is_keyframe
        elif packet.is_keyframe and packet.pts is not None and self._latest is not None:
            self.in_order &= packet.pts > self._latest
        self.count += 1
        self.stamps.append(packet.pts)
        self.decoding.append(packet.dts)
        if packet.pts is not None and (self._latest is None or packet.pts >= self._latest):
            self._latest, self.last_duration = packet.pts, packet.duration or 0

    def pictures(self) -> Iterator[VideoFrame]:
        """Yield the pictures that are whole, as the decoder gives them.

        Raises
        ------
        InputError
            If one is damaged, and damage is refused.
        """
        prepare(self.decoder)
        if self.damaged is not Damaged.REFUSE:
            self.decoder.thread_count = 1  # so that the packet is known that is damaged
        elif self.decoder.name in DECODED_SIDE_BY_SIDE:
            self.decoder.thread_type = "FRAME"
        for packet in self.packets():
            for picture in self._decoded(packet):
                self.shown += 1
                yield picture

    def _decoded(self, packet: Packet[VideoStream]) -> list[VideoFrame]:
        if self._waits and packet.size and not packet.is_keyframe:
            self.lost.append(packet.pts)
            return []
        if self._waits and packet.size:
            self._waits, self._key = False, packet.pts
        elif self._key is not None and packet.pts is not None and packet.pts < self._key:
            if self.lost:
                self.lost.append(packet.pts)
            return []
        why = "the decoder marks it"
        try:
            pictures: list[VideoFrame] = [] if self._is_broken(packet) else self.decoder.decode(packet)
        except FFmpegError as error:
            pictures, why = [], error.strerror or "it cannot be decoded"
        else:
            if not self._is_broken(packet) and not any(picture.is_corrupt for picture in pictures):
                return pictures
        if self.damaged is Damaged.REFUSE:
            raise self._refusal(self.shown, why)
        return self._given_up(packet, pictures)

    def _is_broken(self, packet: Packet[VideoStream]) -> bool:
        if self.damaged is Damaged.REFUSE:
            return False
        return packet.is_corrupt or (bool(self._intact) and not slices_intact(bytes(packet)))

    def _given_up(self, packet: Packet[VideoStream], pictures: list[VideoFrame]) -> list[VideoFrame]:
        """Return the pictures before one that is damaged; the decoder begins again at the next key frame."""
        self.lost.append(packet.pts)
        self.lost += [picture.pts for picture in pictures if picture.is_corrupt]
        with suppress(FFmpegError):
            pictures += self.decoder.decode(None)
        self.decoder.flush_buffers()
        self._waits = True
        return [one for one in pictures if not one.is_corrupt and one.pts not in self.lost]

    def _refusal(self, frame: int, why: str | None) -> InputError:
        """Return what is said of damage at a frame."""
        tick, stamps, at = self.stream.time_base, sorted(s for s in self.stamps if s is not None), ""
        if self.times is not None:
            at = f" ({self.times[min(frame, len(self.times) - 1)]:.3f} s)"
        elif tick is not None and stamps:
            at = f" ({float((stamps[min(frame, len(stamps) - 1)] - stamps[0]) * tick):.3f} s)"
        return InputError(f"{self.path} is damaged at frame {frame}{at}: {why}; {GO_ON}")

    @property
    def leading(self) -> int:
        """How many packets after the first, a key frame, hold pictures before it that lack their references.

        They are left out, as players do.
        """
        first, n = self.stamps[0], 0
        for stamp in self.stamps[1:]:
            if first is None or (stamp is not None and stamp > first):
                break
            n += 1
        return n if self.begins_with_key else 0

    @property
    def tells_frames(self) -> bool:
        """Whether each packet is known to be one picture: nothing need be decoded to know the times."""
        known = len({stamp for stamp in self.stamps if stamp is not None}) == self.count
        begins = self.begins_with_key and not self.leading and self.in_order
        return (
            self.damaged is Damaged.REFUSE and self.is_one_to_one and not self.has_fields and known and begins
        )

    @property
    def has_fields(self) -> bool:
        """Whether two packets may be the fields of one picture."""
        return self.decoder.name in OF_FIELDS and self.decoder.field_order != PROGRESSIVE

    @property
    def is_one_to_one(self) -> bool:
        """Whether a whole packet of the codec gives a picture."""
        return self.decoder.name in ONE_TO_ONE


def prepare(decoder: VideoCodecContext) -> None:
    """Make a decoder that is not yet open stop at the first error, checksums included."""
    if decoder.name not in STRICT_ALREADY:
        decoder.options = STRICT


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

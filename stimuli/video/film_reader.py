"""The pass over a film: its packets, the pictures that they decode to, and what of it is damaged.

The decoder's stamps are a film's timeline. Packets alone tell it, without decoding, where each is one
picture (docs/decisions/frame-times.md). The checksums inside FFV1 frames are compared here: FFmpeg's decoder
sees them fail but does not report it (RFC 9043, 4.9).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, cast

import numpy as np
from av.codec.context import CodecContext
from av.error import FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.stimuli.video.film_stream import film_stream
from evenlight.stimuli.video.video_source import ASSUMED_RATE

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
# Each packet of these is one picture, as of all codecs of single pictures, but for the fields of interlaced films.
ONE_TO_ONE = ("h264", "hevc", "av1", "libdav1d", "vp9", "mpeg2video", "mpeg4", "ffv1", "png", "qtrle")
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
    damaged : Damaged
        What becomes of damage: refused, or the pictures up to the next key frame are lost.
    wanted : int or None
        Its stream, if it is not the one that players take.
    times : array, (frames,), or None
        When the frames appear, as far as it is known beforehand, to tell where damage is [s].
    count, cut_away : int
        Packets that were read, and those that the container's edit list cuts away.
    stamps : list of int or None
        Time stamps of the packets, in their order [ticks].
    last_duration : int
        Duration of the packet that is shown last [ticks].
    lost : list of int or None
        Stamps of the packets that damage costs [ticks].
    begins_with_key, in_order : bool
        Whether the first packet is a key frame, and no key frame lies before a picture that is decoded first.
    shown : int
        How many pictures the decoder has given, or the number of the next one.
    """

    path: VideoPath
    container: InputContainer
    damaged: Damaged = Damaged.REFUSE
    wanted: int | None = None
    times: NDArray[np.float64] | None = None
    stream: VideoStream = field(init=False)
    decoder: VideoCodecContext = field(init=False)
    count: int = 0
    cut_away: int = 0
    stamps: list[int | None] = field(default_factory=list)
    last_duration: int = 0
    lost: list[int | None] = field(default_factory=list)
    begins_with_key: bool = True
    in_order: bool = True
    shown: int = 0
    _first: int | None = None  # stamp of the first packet
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
        if not self.count + self.cut_away:
            self.begins_with_key, self._first = packet.is_keyframe, packet.pts
        if packet.is_discard:
            self.cut_away += 1
            return
        if self.damaged is Damaged.REFUSE and _is_cut(packet, self.decoder.name):
            raise self._refusal(self.count, "its packet is cut off or damaged")
        if self.decoder.name == "ffv1":
            if slices_intact(bytes(packet)):
                self._intact += 1
            elif self._broken is None:
                self._broken = self.count
        self.count += 1
        self.stamps.append(packet.pts)
        if packet.pts is not None:
            if packet.is_keyframe and self._latest is not None:
                self.in_order &= packet.pts > self._latest
            if self._latest is None or packet.pts >= self._latest:
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
            for picture in [] if self._passed_over(packet) else self._decoded(packet):
                self.shown += 1
                yield picture

    def _passed_over(self, packet: Packet[VideoStream]) -> bool:
        """Whether a packet needs pictures that are lost, or were never there."""
        if not packet.size:
            return False
        if self._waits and packet.is_keyframe:
            self._waits, self._key = False, packet.pts
            return False
        leads = self._key is not None and packet.pts is not None and packet.pts < self._key
        if self._waits or (leads and self.lost):
            self.lost.append(packet.pts)
        return self._waits or leads

    def _decoded(self, packet: Packet[VideoStream]) -> list[VideoFrame]:
        pictures: list[VideoFrame] = []
        why: str | None = "its packet is cut off or damaged"
        refuses = self.damaged is Damaged.REFUSE  # what it is of the packets is refused as they are read
        broken = self._intact and packet.size and not slices_intact(bytes(packet))
        if refuses or not (broken or _is_cut(packet, self.decoder.name)):
            try:
                pictures, why = self.decoder.decode(packet), "the decoder marks it"
            except FFmpegError as error:
                why = error.strerror
            else:
                if not any(picture.is_corrupt for picture in pictures):
                    return pictures
        if refuses:
            raise self._refusal(self.shown, why)
        # The pictures before are whole; the decoder begins again at the next key frame.
        self.lost += [packet.pts, *(picture.pts for picture in pictures if picture.is_corrupt)]
        with suppress(FFmpegError):
            pictures += self.decoder.decode(None)
        self.decoder.flush_buffers()
        self._waits = True
        return [one for one in pictures if not one.is_corrupt and one.pts not in self.lost]

    def _refusal(self, frame: int, why: str | None) -> InputError:
        """Return what is said of damage at a frame."""
        stamps, at = sorted(s for s in self.stamps if s is not None), ""
        if self.times is not None:
            at = f" ({self.times[min(frame, len(self.times) - 1)]:.3f} s)"
        elif stamps:
            at = f" ({float((stamps[min(frame, len(stamps) - 1)] - stamps[0]) * self.tick):.3f} s)"
        return InputError(f"{self.path} is damaged at frame {frame}{at}: {why}; {GO_ON}")

    @property
    def is_one_to_one(self) -> bool:
        """Whether each whole packet gives a picture: no two of them may be the fields of one."""
        has_fields = self.decoder.name in OF_FIELDS and self.decoder.field_order != PROGRESSIVE
        return not has_fields and (self.decoder.codec.intra_only or self.decoder.name in ONE_TO_ONE)

    @property
    def tells_frames(self) -> bool:
        """Whether the packets are known to be the pictures: nothing need be decoded to know the times."""
        known = {stamp for stamp in self.stamps if stamp is not None}
        begins = self.begins_with_key and not any(self.leads(stamp) for stamp in known - {self._first})
        return self.is_one_to_one and len(known) == self.count and begins and self.in_order

    def leads(self, stamp: int) -> bool:
        """Whether a stamp lies before the end of the first packet's picture.

        Pictures that lead it need some before. Muxers that allow no negative times put them right after it.
        """
        return self._first is None or stamp < self._first + 0.5 * self.step

    def lacking(self, found: Iterable[int | None]) -> set[int]:
        """Return the stamps of pictures that damage costs, given those of the ones that were decoded."""
        lost = {stamp for stamp in self.lost if stamp is not None}
        if self.is_one_to_one:
            lost |= {s for s in self.stamps if s is not None and not (self.begins_with_key and self.leads(s))}
        return lost - set(found)

    @property
    def rates(self) -> list[Fraction]:
        """Frame rates that the file claims, the most trusted first [Hz]."""
        return [rate for rate in (self.stream.average_rate, self.stream.guessed_rate) if rate]

    @property
    def step(self) -> float:
        """About how long a picture lasts [ticks]."""
        return float(1 / ((*self.rates, ASSUMED_RATE)[0] * self.tick))

    @property
    def tick(self) -> Fraction:
        """What a time stamp counts [s]."""
        return self.stream.time_base or 1 / ASSUMED_RATE


def _is_cut(packet: Packet[VideoStream], codec: str) -> bool:
    # The data of a GIF's picture end with an empty block, before the file's last byte (GIF89a, 15 and 27).
    return packet.is_corrupt or (codec == "gif" and packet.size > 0 and bytes(packet)[-1] not in b"\0;")


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

"""The pass over a film: its packets, its pictures, when these appear, and what of it is damaged.

The decoder's stamps are a film's timeline. Packets alone tell it, without decoding, where each is one
picture (docs/decisions/frame-times.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import av
import numpy as np
from av.codec.context import CodecContext
from av.error import FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_sizes import MOST_PIXELS
from evenlight.data_schema.tracks.film_reading import Damaged, FilmReading
from evenlight.stimuli.video.film_bytes import slices_intact
from evenlight.stimuli.video.film_stream import bounded_pictures, film_stream, promised_end
from evenlight.stimuli.video.video_source import (
    ASSUMED_RATE,
    FrameTimes,
    frame_times,
    rising,
    uniform_times,
)

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.packet import Packet
    from av.video.codeccontext import VideoCodecContext
    from av.video.frame import VideoFrame
    from av.video.stream import VideoStream

    from evenlight.stimuli.video.video_locations import VideoPath

REMEDY = "give a whole copy of it, or one encoded again"
GO_ON = f"{REMEDY}; `damaged` hold or skip goes on without what is lost"
RISE = "encode it again with times that rise, as FFmpeg does with `-vf setpts=N/25/TB` for 25 frames a second"
LONGEST_FALL = 1.0  # [s]: stamps that fall back farther begin anew, and tell no times
MOST_LEFT_OUT = 0.1  # of the pictures
STRICT = {"err_detect": "crccheck+explode"}
# FFmpeg's TIFF decoder then refuses good files too; it reports damage of its own accord.
STRICT_ALREADY = ("tiff",)
# In 240 files damaged at random these report it at the same frame as in one thread; MPEG-4 and FFV1 do not.
DECODED_SIDE_BY_SIDE = ("h264", "hevc", "vp9")
# Each packet of these is one picture, as of all codecs of single pictures, if it is not one field of two.
ONE_TO_ONE = ("h264", "hevc", "av1", "libdav1d", "vp9", "mpeg2video", "mpeg4", "ffv1", "png", "qtrle")
OF_ALPHA = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
OF_FIELDS = ("h264", "mpeg2video")
PROGRESSIVE = 1  # FFmpeg's AV_FIELD_PROGRESSIVE
Times = NDArray[np.float64]
# When all pictures appear, with 0 s for those that are never seen; how the film is read; their stamps, rising
# [ticks], None where they do not tell them apart; in whose places the picture before is shown; places of key
# frames, where pictures can be sought.
FilmTimes = tuple[
    FrameTimes, FilmReading, NDArray[np.int64] | None, NDArray[np.bool_] | None, NDArray[np.intp]
]
NO_KEYS = np.empty(0, dtype=np.intp)


class FilmReader:
    """Reads a stream from where its container stands, and keeps account of it.

    Attributes
    ----------
    how : FilmReading
        Which stream is read, and what becomes of damage: the film is refused, or pictures are lost up to the
        next key frame.
    times : array, (frames,), or None
        When the frames appear, as far as it is known beforehand, to tell where damage is [s].
    shown : int
        How many pictures the decoder has given, or the number of the next one.
    """

    def __init__(
        self, path: VideoPath, container: InputContainer, how: FilmReading, times: Times | None = None
    ) -> None:
        self.path, self.container, self.how, self.times = path, container, how, times
        self.stream = stream = film_stream(path, container, how.stream)
        decoder = stream.codec_context
        if stream.metadata.get("alpha_mode") == "1" and decoder.name in OF_ALPHA:
            # The two pictures, of colours and of transparency, are decoded by this one only.
            decoder = cast("VideoCodecContext", CodecContext.create(OF_ALPHA[decoder.name], "r"))
        self.decoder, self.shown = decoder, 0
        has_fields = decoder.name in OF_FIELDS and decoder.field_order != PROGRESSIVE
        self._is_one_to_one = (decoder.codec.intra_only or decoder.name in ONE_TO_ONE) and not has_fields
        self._tick = stream.time_base or 1 / ASSUMED_RATE  # what a time stamp counts [s]
        self._rates = [rate for rate in (stream.average_rate, stream.guessed_rate) if rate]
        self._step = float(1 / ((*self._rates, ASSUMED_RATE)[0] * self._tick))  # about a picture's [ticks]
        self._stamps: list[int | None] = []  # of the packets, in their order [ticks]
        self._keys: list[int] = []  # of key frames' packets
        self._first: int | None = None  # of the first packet
        self._last: tuple[float, int] = (-math.inf, 0)  # stamp and duration of the latest packet [ticks]
        self._cut_away = 0  # packets that the container's edit list cuts away
        self._begins_with_key = True
        self._in_order = True  # no key frame lies before a picture that is decoded first
        self._has_checksums, self._holds = False, True  # and whether that of the packet holds
        self._broken: int | None = None  # the first frame whose checksum is wrong
        self._lost: list[int | None] = []  # stamps of packets that damage costs
        self._refuses = how.damaged is Damaged.REFUSE
        self._waits = not self._refuses  # for a key frame
        self._key: int | None = None  # stamp of the one that ended the waiting: no picture before it is whole

    def _packets(self) -> Iterator[Packet[VideoStream]]:
        """Yield the packets that hold pictures, each noted; at the end an empty one."""
        try:
            for packet in self.container.demux(self.stream):
                if packet.size == 0:
                    if self._has_checksums and self._broken is not None and self._refuses:
                        raise self._refusal(self._broken, "its checksum is wrong")
                    yield packet
                    return
                self._note(packet)
                yield packet
        except FFmpegError as error:
            if self._refuses:
                raise self._refusal(len(self._stamps), error.strerror) from error

    def _note(self, packet: Packet[VideoStream]) -> None:
        if not (self._stamps or self._cut_away):
            self._begins_with_key, self._first = packet.is_keyframe, packet.pts
        if packet.is_discard:
            self._cut_away += 1
            return
        if self._refuses and _is_cut(packet, self.decoder.name):
            raise self._refusal(len(self._stamps), "its packet is cut off or damaged")
        if self.decoder.name == "ffv1" and (self.times is None or not self._refuses):
            self._holds = slices_intact(bytes(packet))
            self._has_checksums |= self._holds
            if not self._holds and self._broken is None:
                self._broken = len(self._stamps)
        self._stamps.append(packet.pts)
        if packet.pts is not None:
            if packet.is_keyframe:
                self._keys.append(packet.pts)
                self._in_order &= packet.pts > self._last[0]
            self._last = max(self._last, (packet.pts, packet.duration or 0))

    def pictures(self) -> Iterator[VideoFrame]:
        """Yield the pictures that are whole, as the decoder gives them; damage that is refused is raised."""
        prepare(self.decoder)
        if not self._refuses:
            self.decoder.thread_count = 1  # so that the packet is known that is damaged
        elif self.decoder.name in DECODED_SIDE_BY_SIDE:
            self.decoder.thread_type = "FRAME"
        for packet in self._packets():
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
        if self._waits or (leads and self._lost):
            self._lost.append(packet.pts)
        return self._waits or leads

    def _decoded(self, packet: Packet[VideoStream]) -> list[VideoFrame]:
        pictures: list[VideoFrame] = []
        why: str | None = "its packet is cut off or damaged"
        broken = (self._has_checksums and not self._holds) or _is_cut(packet, self.decoder.name)
        if self._refuses or not (packet.size and broken):  # it is refused as packets are read
            try:
                pictures, why = self.decoder.decode(packet), "the decoder marks it"
            except FFmpegError as error:
                why = error.strerror
            else:
                if not any(picture.is_corrupt for picture in pictures):
                    return pictures
        if self._refuses:
            raise self._refusal(self.shown, why)
        # The pictures before are whole; the decoder begins again at the next key frame.
        self._lost += [packet.pts, *(picture.pts for picture in pictures if picture.is_corrupt)]
        with suppress(FFmpegError):
            pictures += self.decoder.decode(None)
        self.decoder.flush_buffers()
        self._waits = True
        return [one for one in pictures if not one.is_corrupt and one.pts not in self._lost]

    def _refusal(self, frame: int, why: str | None) -> InputError:
        stamps = sorted(stamp for stamp in self._stamps if stamp is not None)
        since = [float((s - stamps[0]) * self._tick) for s in stamps] if self.times is None else self.times
        if not self.decoder.width:  # FFmpeg keeps no size that is too large
            why = f"its pictures have no size, or more than {MOST_PIXELS} pixels (`large_ok`)"
        at = f" ({since[min(frame, len(since) - 1)]:.3f} s)" if len(since) else ""
        return InputError(f"{self.path} is damaged at frame {frame}{at}: {why}; {GO_ON}")

    def _leads(self, stamp: int) -> bool:
        """Whether a stamp lies before the end of the first picture: muxers put what leads it right after."""
        return self._first is None or stamp < self._first + 0.5 * self._step

    def _lacking(self, found: Iterable[int | None]) -> set[int]:
        """Return the stamps of pictures that damage costs, given those of the ones that were decoded."""
        lost = {stamp for stamp in self._lost if stamp is not None}
        if self._is_one_to_one:
            lost.update(s for s in self._stamps if s is not None)
            lost = {s for s in lost if not (self._begins_with_key and self._leads(s))}
        return lost - set(found)

    @property
    def _by_decoding(self) -> bool:
        """Whether stamps are times of decoding, as in AVI: they rise, and pictures are reordered."""
        known = [stamp for stamp in self._stamps if stamp is not None]
        reordered = self.container.format.name == "avi" and self.decoder.has_b_frames
        return reordered and known == sorted(known)

    def times_of_packets(self) -> FilmTimes | None:
        """Read all packets; return the times of a film's pictures, None if only the decoder knows them."""
        if not self._refuses:
            return None
        for _ in self._packets():
            pass
        _require_whole(self)
        known = {stamp for stamp in self._stamps if stamp is not None}
        begins = self._begins_with_key and not any(self._leads(stamp) for stamp in known - {self._first})
        if self._is_one_to_one and len(known) == len(self._stamps) and begins and self._in_order:
            return _film_times(self, sorted(known), self._last[1])
        return None

    def times_of_pictures(self) -> FilmTimes:
        """Decode a film, and return the times of its pictures by the decoder's stamps."""
        found: list[int | None] = []
        last = 0
        for picture in self.pictures():
            found.append(picture.dts if picture.pts is None else picture.pts)
            last = picture.duration or 0
        if self._refuses:
            _require_whole(self)
            _require_all(self, found)
        if not found:
            raise InputError(f"{self.path} holds no frames: it is cut off or damaged; {REMEDY}")
        given = [stamp for stamp in found if stamp is not None]
        if len(given) < len(found):
            timeline = uniform_times(len(found), (*self._rates, ASSUMED_RATE)[0])
            return timeline, _reading(self, frames_skipped=len(self._lost)), None, None, NO_KEYS
        # The decoder gives pictures in the order they are shown.
        return _film_times(self, sorted(given) if self._by_decoding else given, last)


def _is_cut(packet: Packet[VideoStream], codec: str) -> bool:
    # The data of a GIF's picture end with an empty block, before the file's last byte (GIF89a, 15 and 27).
    return packet.is_corrupt or (codec == "gif" and packet.size > 0 and bytes(packet)[-1] not in b"\0;")


def prepare(decoder: VideoCodecContext) -> None:
    """Make a decoder that is not yet open stop at the first error, checksums included, or a huge picture."""
    decoder.options = bounded_pictures() | ({} if decoder.name in STRICT_ALREADY else STRICT)


def _require_whole(reader: FilmReader) -> None:
    # An MP4 lists every packet before the first is read; other containers' indices may hold key frames only.
    promised = len(reader.stream.index_entries) if "mp4" in reader.container.format.name else 0
    there = len(reader._stamps) + reader._cut_away
    if there < promised:
        raise InputError(f"{reader.path} is cut off: {there} of {promised} frames are there; {GO_ON}")
    if not reader._stamps:
        raise InputError(f"{reader.path} holds no frames: it is cut off or damaged; {REMEDY}")


def _require_all(reader: FilmReader, found: list[int | None]) -> None:
    """Refuse a film that lacks pictures; those that lead the first key frame are left out, as players do."""
    n, packets = len(found), len(reader._stamps)
    if n >= packets or not reader._is_one_to_one:
        return
    if not reader._begins_with_key:
        lack = f"{packets - n} frames need those before"
        raise InputError(f"{reader.path} begins within a group of pictures: {lack}; {GO_ON}")
    if None in found or reader._lacking(found):
        raise InputError(f"{reader.path} is damaged: {n} of {packets} frames can be decoded; {GO_ON}")


def _reading(reader: FilmReader, **found: Any) -> FilmReading:
    container = reader.container
    chosen = reader.stream.index if len(container.streams.video) > 1 else reader.how.stream
    duration = container.duration / av.time_base if container.duration else None
    start = (container.start_time or 0) / av.time_base
    return replace(reader.how, stream=chosen, file_start=start, file_duration=duration, **found)


def _film_times(reader: FilmReader, given: list[int], last: int) -> FilmTimes:
    """Return the times of pictures that the decoder gives with some stamps."""
    stamps, tick, held = np.array(given, dtype=np.int64), reader._tick, None
    lost = [] if reader._refuses else sorted(reader._lacking(given))
    after = [stamp for stamp in lost if stamp > given[0]] if reader.how.damaged is Damaged.HOLD else []
    if after:
        places = np.searchsorted(stamps, after)
        held = np.insert(np.zeros(len(given), dtype=bool), places, True)
        stamps = np.insert(stamps, places, after)
    if len(stamps) > 1 and stamps.min() == stamps.max():
        raise InputError(f"{reader.path}: all its {len(stamps)} frames have the same time; {REMEDY}")
    mended, left = _mended(stamps, 0.75 * reader._step)
    back = float((np.maximum.accumulate(stamps) - stamps).max() * tick) if left else 0.0
    if back > LONGEST_FALL or (back and left > MOST_LEFT_OUT * len(stamps)):
        raise InputError(
            f"{reader.path}: its time stamps fall back by up to {back:.3f} s, and {left} of {len(stamps)} "
            f"pictures have no time of their own; {RISE}"
        )
    timeline = frame_times(mended, tick, last, reader._rates)
    first = float(mended[0] * tick)
    end = first + timeline.times[-1] + timeline.durations[-1]
    promised = promised_end(reader.container, reader.stream)
    most = 0.75 * float(np.median(timeline.durations)) + float(tick)
    if promised - end > most and reader._refuses:
        raise InputError(
            f"{reader.path} is cut off: it ends at {end:.3f} s instead of {promised:.3f} s; {GO_ON}"
        )
    reading = _reading(
        reader,
        picture_start=first - (reader.container.start_time or 0) / av.time_base,
        frames_held=len(after),
        frames_skipped=len(lost) - len(after) + (left if back else 0),
        fall_back=back,
    )
    if reader._by_decoding or (np.diff(stamps) <= 0).any():
        return timeline, reading, None, held, NO_KEYS
    keys = np.searchsorted(stamps, sorted(reader._keys)) if reader._refuses else NO_KEYS
    return timeline, reading, stamps, held, keys


def _mended(stamps: NDArray[np.int64], least: float) -> tuple[NDArray[np.int64], int]:
    """Return stamps that rise, and how many pictures have that of the next one, which replaces them at once.

    As many as rise are kept, and others put between where there is room for their pictures: a decoder that
    guesses a stamp which the file lacks may guess a wrong one.
    """
    seen = rising(stamps.tolist())
    places = np.arange(len(stamps))
    between = np.rint(np.interp(places, places[seen], stamps[seen])).astype(np.int64)
    room = np.diff(between) >= least
    seen |= np.append(False, room) & np.append(room, False)
    following = places[seen][np.minimum(np.cumsum(seen) - seen, seen.sum() - 1)]
    return between[following], int((~seen).sum())

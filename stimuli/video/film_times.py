"""When the pictures of a film appear: by its packets where they tell it, else by the decoder's stamps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import av
import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.film_reading import Damaged, FilmReading
from evenlight.stimuli.video.film_reader import GO_ON, REMEDY, FilmReader
from evenlight.stimuli.video.film_stream import promised_end
from evenlight.stimuli.video.video_source import (
    ASSUMED_RATE,
    FrameTimes,
    frame_times,
    rising,
    uniform_times,
)

Stamps = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FilmTimes:
    """When the pictures of a film appear, and how it is read.

    Attributes
    ----------
    timeline : FrameTimes
        Of all pictures, in the order of their presentation; those that are never seen last 0 s.
    reading : FilmReading
        How it is read.
    stamps : array of int, (frames,), or None
        Time stamps of the pictures, rising [ticks]; None where they do not tell them apart.
    held : array of bool, (frames,)
        In whose places the picture before is shown.
    """

    timeline: FrameTimes
    reading: FilmReading
    stamps: Stamps | None
    held: NDArray[np.bool_]


def times_of_packets(reader: FilmReader) -> FilmTimes | None:
    """Read all packets, and return the times of a film's pictures; None if only the decoder knows them.

    Raises
    ------
    InputError
        If the film is damaged, or ends before its time, and that is refused.
    """
    if reader.damaged is not Damaged.REFUSE:
        return None
    for _ in reader.packets():
        pass
    _require_whole(reader)
    if not reader.tells_frames:
        return None
    stamps = np.sort([stamp for stamp in reader.stamps if stamp is not None])
    return _film_times(reader, stamps, np.zeros(len(stamps), dtype=bool), reader.last_duration)


def times_of_pictures(reader: FilmReader) -> FilmTimes:
    """Decode a film, and return the times of its pictures by the decoder's stamps.

    Raises
    ------
    InputError
        If the film is damaged, or ends before its time, and that is refused.
    """
    found: list[int | None] = []
    last = 0
    for picture in reader.pictures():
        found.append(picture.dts if picture.pts is None else picture.pts)
        last = picture.duration or 0
    n = len(found)
    if reader.damaged is Damaged.REFUSE:
        _require_whole(reader)
        if not reader.begins_with_key and n < reader.count:
            raise InputError(
                f"{reader.path} begins within a group of pictures: {reader.count - n} frames "
                f"need those before; {GO_ON}"
            )
        if reader.is_one_to_one and not reader.has_fields and n < reader.count - reader.leading:
            raise InputError(
                f"{reader.path} is damaged: {n} of {reader.count} frames can be decoded; {GO_ON}"
            )
    if not n:
        raise InputError(f"{reader.path} holds no frames: it is cut off or damaged; {REMEDY}")
    if None in found:
        return _film_times(reader, None, np.zeros(n, dtype=bool), last)
    # What an AVI has are the times of decoding; the decoder gives pictures in the order they are shown.
    given = [stamp for stamp in found if stamp is not None]
    stamps = np.array(sorted(given) if reader.container.format.name == "avi" else given, dtype=np.int64)
    held = np.zeros(n, dtype=bool)
    if reader.damaged is Damaged.HOLD:
        lost = sorted({s for s in reader.lost if s is not None and s > given[0]} - set(given))
        places = np.searchsorted(stamps, lost)
        held, stamps = np.insert(held, places, True), np.insert(stamps, places, lost)
    return _film_times(reader, stamps, held, last)


def _require_whole(reader: FilmReader) -> None:
    # An MP4 lists every packet before the first is read; other containers' indices may hold key frames only.
    promised = len(reader.stream.index_entries) if "mp4" in reader.container.format.name else 0
    there = reader.count + reader.cut_away
    if there < promised:
        raise InputError(f"{reader.path} is cut off: {there} of {promised} frames are there; {GO_ON}")
    if not reader.count:
        raise InputError(f"{reader.path} holds no frames: it is cut off or damaged; {REMEDY}")


def _film_times(reader: FilmReader, stamps: Stamps | None, held: NDArray[np.bool_], last: int) -> FilmTimes:
    stream, container = reader.stream, reader.container
    rates = [rate for rate in (stream.average_rate, stream.guessed_rate) if rate]
    tick = stream.time_base or 1 / ASSUMED_RATE
    seconds = container.duration / av.time_base if container.duration else None
    reading = FilmReading(
        reader.wanted,
        file_duration=seconds,
        damaged=reader.damaged,
        frames_held=int(held.sum()),
        frames_skipped=len(reader.lost) - int(held.sum()),
    )
    if stamps is None:
        timeline = uniform_times(len(held), rates[0] if rates else ASSUMED_RATE)
        return FilmTimes(timeline, reading, None, held)
    if len(stamps) > 1 and stamps.min() == stamps.max():
        raise InputError(f"{reader.path}: all its {len(stamps)} frames have the same time; {REMEDY}")
    seen = rising(stamps.tolist())
    timeline = _of_all(frame_times(stamps[seen], tick, last, rates), seen)
    first = float(stamps[seen][0] * tick)
    if reader.damaged is Damaged.REFUSE:
        _require_end(reader, first + float(timeline.times[-1] + timeline.durations[-1]), timeline, tick)
    back = float((np.maximum.accumulate(stamps) - stamps).max() * tick)
    reading = replace(
        reading,
        picture_start=first - (container.start_time or 0) / av.time_base,
        frames_out_of_order=int((~seen).sum()) if back else 0,
        fall_back=back,
    )
    return FilmTimes(timeline, reading, stamps if seen.all() else None, held)


def _of_all(shown: FrameTimes, seen: NDArray[np.bool_]) -> FrameTimes:
    """Return the times of all pictures, given those of the ones that are seen."""
    if seen.all():
        return shown
    following = np.minimum(np.cumsum(seen) - seen, len(shown.times) - 1)
    return FrameTimes(shown.times[following], np.where(seen, shown.durations[following], 0.0))


def _require_end(reader: FilmReader, end: float, timeline: FrameTimes, tick: Fraction) -> None:
    promised = promised_end(reader.container, reader.stream)
    if promised - end > 0.75 * float(np.median(timeline.durations)) + float(tick):
        raise InputError(
            f"{reader.path} is cut off: it ends at {end:.3f} s instead of {promised:.3f} s; {GO_ON}"
        )

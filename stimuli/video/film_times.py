"""When the pictures of a film appear: by its packets where they tell it, else by the decoder's stamps."""

from __future__ import annotations

from typing import Any

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

RISE = "encode it again with times that rise, as FFmpeg does with `-vf setpts=N/25/TB` for 25 frames a second"
LONGEST_FALL = 1.0  # [s]: stamps that fall back farther begin anew, and tell no times
MOST_LEFT_OUT = 0.1  # of the pictures


# When all pictures appear, with 0 s for those that are never seen; how the film is read; their stamps, rising
# [ticks], None where they do not tell them apart; in whose places the picture before is shown.
FilmTimes = tuple[FrameTimes, FilmReading, NDArray[np.int64] | None, NDArray[np.bool_] | None]


def times_of_packets(reader: FilmReader) -> FilmTimes | None:
    """Read all packets, and return the times of a film's pictures; None if only the decoder knows them.

    Raises
    ------
    InputError
        If the film is damaged, or ends before its time.
    """
    if reader.damaged is not Damaged.REFUSE:
        return None
    for _ in reader.packets():
        pass
    _require_whole(reader)
    if not reader.tells_frames:
        return None
    return _film_times(reader, sorted(s for s in reader.stamps if s is not None), reader.last_duration)


def times_of_pictures(reader: FilmReader) -> FilmTimes:
    """Decode a film, and return the times of its pictures by the decoder's stamps.

    Raises
    ------
    InputError
        If the film is damaged, or ends before its time, and that is refused; if its stamps tell no times.
    """
    found: list[int | None] = []
    last = 0
    for picture in reader.pictures():
        found.append(picture.dts if picture.pts is None else picture.pts)
        last = picture.duration or 0
    if reader.damaged is Damaged.REFUSE:
        _require_whole(reader)
        _require_all(reader, found)
    if not found:
        raise InputError(f"{reader.path} holds no frames: it is cut off or damaged; {REMEDY}")
    given = [stamp for stamp in found if stamp is not None]
    if len(given) < len(found):
        timeline = uniform_times(len(found), (*reader.rates, ASSUMED_RATE)[0])
        return timeline, _reading(reader, frames_skipped=len(reader.lost)), None, None
    # What an AVI has are the times of decoding; the decoder gives pictures in the order they are shown.
    return _film_times(reader, sorted(given) if reader.container.format.name == "avi" else given, last)


def _require_whole(reader: FilmReader) -> None:
    # An MP4 lists every packet before the first is read; other containers' indices may hold key frames only.
    promised = len(reader.stream.index_entries) if "mp4" in reader.container.format.name else 0
    there = reader.count + reader.cut_away
    if there < promised:
        raise InputError(f"{reader.path} is cut off: {there} of {promised} frames are there; {GO_ON}")
    if not reader.count:
        raise InputError(f"{reader.path} holds no frames: it is cut off or damaged; {REMEDY}")


def _require_all(reader: FilmReader, found: list[int | None]) -> None:
    """Refuse a film that lacks pictures; those that lead the first key frame are left out, as players do."""
    n = len(found)
    if n >= reader.count or not reader.is_one_to_one:
        return
    if not reader.begins_with_key:
        raise InputError(
            f"{reader.path} begins within a group of pictures: {reader.count - n} frames need those before; "
            f"{GO_ON}"
        )
    if None in found or reader.lacking(found):
        raise InputError(f"{reader.path} is damaged: {n} of {reader.count} frames can be decoded; {GO_ON}")


def _reading(reader: FilmReader, **found: Any) -> FilmReading:
    container = reader.container
    return FilmReading(
        reader.stream.index if len(container.streams.video) > 1 else reader.wanted,
        file_duration=container.duration / av.time_base if container.duration else None,
        damaged=reader.damaged,
        **found,
    )


def _film_times(reader: FilmReader, given: list[int], last: int) -> FilmTimes:
    """Return the times of pictures that the decoder gives with some stamps."""
    stamps, tick, held = np.array(given, dtype=np.int64), reader.tick, None
    lost = [] if reader.damaged is Damaged.REFUSE else sorted(reader.lacking(given))
    after = [stamp for stamp in lost if stamp > given[0]] if reader.damaged is Damaged.HOLD else []
    if after:
        places = np.searchsorted(stamps, after)
        held = np.insert(np.zeros(len(given), dtype=bool), places, True)
        stamps = np.insert(stamps, places, after)
    if len(stamps) > 1 and stamps.min() == stamps.max():
        raise InputError(f"{reader.path}: all its {len(stamps)} frames have the same time; {REMEDY}")
    mended, seen = _mended(stamps, 0.75 * reader.step)
    left = int((~seen).sum())
    back = float((np.maximum.accumulate(stamps) - stamps).max() * tick) if left else 0.0
    if back > LONGEST_FALL or (back and left > MOST_LEFT_OUT * len(stamps)):
        raise InputError(
            f"{reader.path}: its time stamps fall back by up to {back:.3f} s, and {left} of {len(stamps)} "
            f"pictures have no time of their own; {RISE}"
        )
    timeline = _of_all(frame_times(mended[seen], tick, last, reader.rates), seen)
    first = float(mended[seen][0] * tick)
    if reader.damaged is Damaged.REFUSE:
        _require_end(reader, first + float(timeline.times[-1] + timeline.durations[-1]), timeline)
    reading = _reading(
        reader,
        picture_start=first - (reader.container.start_time or 0) / av.time_base,
        frames_held=len(after),
        frames_skipped=len(lost) - len(after),
        frames_out_of_order=left if back else 0,
        fall_back=back,
    )
    # H.264 in AVI is given its times of decoding in the order of presentation.
    apart = bool((np.diff(stamps) > 0).all()) and not (
        reader.container.format.name == "avi" and reader.decoder.name in ("h264", "hevc")
    )
    return timeline, reading, stamps if apart else None, held


def _mended(stamps: NDArray[np.int64], least: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the stamps of pictures, and which are seen: as many as rise, and others that fit between these.

    A decoder that guesses a stamp which the file lacks may guess a wrong one; there is room for its picture.
    """
    seen = rising(stamps.tolist())
    places = np.arange(len(stamps))
    between = np.rint(np.interp(places, places[seen], stamps[seen])).astype(np.int64)
    room = np.diff(between) >= least
    return between, seen | (np.append(False, room) & np.append(room, False))


def _of_all(shown: FrameTimes, seen: NDArray[np.bool_]) -> FrameTimes:
    """Return the times of all pictures, given those of the ones that are seen."""
    if seen.all():
        return shown
    following = np.minimum(np.cumsum(seen) - seen, len(shown.times) - 1)
    return FrameTimes(shown.times[following], np.where(seen, shown.durations[following], 0.0))


def _require_end(reader: FilmReader, end: float, timeline: FrameTimes) -> None:
    promised = promised_end(reader.container, reader.stream)
    if promised - end > 0.75 * float(np.median(timeline.durations)) + float(reader.tick):
        raise InputError(
            f"{reader.path} is cut off: it ends at {end:.3f} s instead of {promised:.3f} s; {GO_ON}"
        )

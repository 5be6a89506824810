"""An edit decision list (CMX 3600) that dims a video by its track, for programs that grade film.

Each event is a stretch of the video with one slope of the ASC CDL: out = in × slope on code values, which is
dimming as `dimming.py` defines it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.exported_track import ExportedTrack
from evenlight.stimuli.dimmed.exports.stretches import Stretch, stretches_of

TOLERANCE = 1 / 510  # half of white's 8-bit code value, so that no step between events is above one
MOST_EVENTS = 9999
RECORD_HOUR = 1  # where programs begin a timeline


def edit_decision_list(track: ExportedTrack) -> str:
    """Return an edit decision list, its timecode without dropped numbers at any rate.

    Raises
    ------
    InputError
        If timecode cannot count the frames, or there are too many events.
    """
    rate = timecode_rate(track)
    stretches = stretches_of(track, TOLERANCE)
    if len(stretches) > MOST_EVENTS:
        raise InputError(
            f"the track of {track.video!r} takes {len(stretches)} events, and an edit decision list holds "
            f"{MOST_EVENTS}: export it as json, ffmpeg or mpv"
        )
    name = " ".join(track.video.split())
    events = (line for k, s in enumerate(stretches, start=1) for line in _event(k, s, rate, name))
    return "\n".join([f"TITLE: {name}", "FCM: NON-DROP FRAME", "", *events, ""])


def timecode_rate(track: ExportedTrack) -> int:
    """Return how many frames a second of timecode counts: 24 for 23.976 too, 30 for 29.97.

    Raises
    ------
    InputError
        If the frame rate is not constant, or is none of timecode's.
    """
    times = np.array(track.times)
    mean = float(times[-1] - times[0]) / max(len(times) - 1, 1)
    if len(times) < 2 or np.abs(times - times[0] - np.arange(len(times)) * mean).max() > mean / 4:
        raise InputError(
            f"the frame rate of {track.video!r} is not constant, and an edit decision list counts frames: "
            "export it as json, ffmpeg or mpv"
        )
    rate, whole = 1 / mean, round(1 / mean)
    nearest = min((whole, whole * 1000 / 1001), key=lambda known: abs(known - rate))
    if not 10 <= whole <= 60 or abs(nearest - rate) > 2e-4 * rate:
        raise InputError(
            f"{track.video!r} has {rate:.5g} frames per second, and timecode counts 10 to 60 whole ones, or "
            "23.976, 29.97 and 59.94: export it as json, ffmpeg or mpv"
        )
    return whole


def _event(number: int, stretch: Stretch, rate: int, name: str) -> Iterator[str]:
    """Yield the lines of an event: from where to where in the video and on the timeline, and its slope."""
    source = [_timecode(frame, rate) for frame in (stretch.first, stretch.last + 1)]
    start = RECORD_HOUR * 3600 * rate
    record = [_timecode(start + frame, rate) for frame in (stretch.first, stretch.last + 1)]
    slope = " ".join([f"{stretch.scale:.6f}"] * 3)
    yield f"{number:03}  AX       V     C        {' '.join(source + record)}"
    yield f"* FROM CLIP NAME: {name}"
    yield f"* ASC_SOP ({slope})(0.000000 0.000000 0.000000)(1.000000 1.000000 1.000000)"
    yield "* ASC_SAT 1.000000"


def _timecode(frame: int, rate: int) -> str:
    """Return the timecode of a frame.

    >>> _timecode(3600 * 25 + 26, 25)
    '01:00:01:01'
    """
    seconds, frames = divmod(frame, rate)
    return f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}:{frames:02}"

"""The meter's clock on the computer's: by edges, pings, flash markers or arrivals, whatever there is.

Pings give the line with the most room between all questions and their answers; flash markers are found again
in the power; arrivals give a line below all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from evenlight.analysis.played_power.clock_line import (
    MOST_DRIFT,
    ClockLine,
    ClockWindows,
    fit_of,
    line_below,
    line_of,
)
from evenlight.analysis.played_power.power_recording import Flips, Recording, Samples
from evenlight.analysis.played_power.sync_edges import LATE_FLIP, SyncEdges, fit_edges
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.instrument_logs import FlashMark
from evenlight.data_schema.recordings.played_power import ClockFit, ClockFlag, ClockMethod

DISAGREEMENT = 0.2  # share of pings that the edges' clock may miss
VAGUE_DRIFT = 0.001  # a range of drifts wider than this says nothing about a clock with a crystal
MOST_ODD = 0.2  # share of pings that may contradict the others
STRETCHES = 200  # of each, the sample that arrived soonest
SOONEST = -0.001  # [s] the computer's own time stamps are not later than the arrival, but for rounding
LATEST = 2.0  # [s] nor long before it
REACH = 0.45  # [s] around the arrivals' clock: less than half the second in which the flashes repeat
AFTER_LAST = 0.4  # [s] of the last level, which holds for half a second
FEWEST_MARKS = 3  # of a marker: fewer are no pattern
FIRST_LAG = 0.005  # [s] where the search for the panel's lag begins
MOST_LAG = 0.1  # [s]
CLEAR = 0.8  # share of the power's variance that a marker must explain


def fit_clock(recording: Recording) -> ClockFit:
    """Return the meter's clock on the computer's, by the best that there is.

    Edges of the synchronisation input come first, then pings, then flash markers; then samples that carry the
    computer's time, or their arrival. What was there and could not be used is in the flags.

    Parameters
    ----------
    recording : Recording
        What was recorded.
    """
    samples, flips = recording.samples, recording.flips
    played = (float(flips.flip[0]), float(flips.flip[-1]))
    arrivals = fit_arrivals(samples)
    stretch = line_of(arrivals).to_meter(played)
    best = fit_pings(recording.pings, (stretch[0], stretch[1])) if len(recording.pings) else None
    best = best or _fit_flashes(samples, recording.flashes, played, line_of(arrivals))
    flags: tuple[ClockFlag, ...] = ()
    if recording.log.sync_connected:
        edges = fit_edges(samples, changes_of(flips), best or arrivals)
        if isinstance(edges, ClockFit):
            best, flags = edges, _doubts(edges, recording.pings)
        else:
            flags = (edges,)
    if best is None:
        flags += (ClockFlag.FLASHES_NOT_FOUND,) * bool(recording.flashes)
        best = _computer_time(samples) or arrivals
    return replace(best, flags=(*flags, *best.flags))


def changes_of(flips: Flips) -> SyncEdges:
    """Return when the synchronisation line changed with the frames shown."""
    at = np.flatnonzero(flips.sync[1:] != flips.sync[:-1]) + 1
    return SyncEdges(flips.flip[at], flips.sync[at])


def _doubts(edges: ClockFit, pings: Array) -> tuple[ClockFlag, ...]:
    """Return a flag if the pings disagree with the edges."""
    if len(pings) == 0 or ClockFlag.DISAGREES in edges.flags:
        return ()
    told = line_of(edges).to_computer(pings[:, 1])
    off = np.maximum(pings[:, 0] - told, told - pings[:, 2])
    return (ClockFlag.DISAGREES,) * bool((off > (edges.bound or 0.0) + LATE_FLIP).mean() > DISAGREEMENT)


def fit_pings(pings: Array, stretch: tuple[float, float]) -> ClockFit:
    """Return the meter's clock by its pings.

    The meter told its time after the question and before the answer, so each ping is a window that the line
    goes through, the narrower the quicker the answer came (Cristian 1989). Of the lines that do, the one is
    taken that stays farthest from the windows' ends: slow pings do not bear on it. The others say how far off
    it may be.

    Parameters
    ----------
    pings : array, (N, 3)
        Sent, the meter's time, received [s]; at least one.
    stretch : (float, float)
        First and last time on the meter's clock at which it is to hold [s].
    """
    sent, at, received = pings.T
    windows = ClockWindows(at, sent, received)
    odd = windows.missed() if windows.middle()[1] < 0 else np.zeros(len(pings), dtype=bool)
    linear = bool(odd.mean() <= MOST_ODD)
    if linear:
        windows = ClockWindows(at[~odd], sent[~odd], received[~odd])
    slowest, fastest = windows.drifts()
    vague = linear and fastest - slowest > VAGUE_DRIFT and slowest <= 0 <= fastest
    line, room = windows.middle(0.0 if vague else MOST_DRIFT)
    bound = windows.bound(line, stretch) if linear else float(windows.half_widths.max() - min(room, 0.0))
    return fit_of(
        line,
        ClockMethod.PINGS,
        len(windows.at),
        residual_sd=float(np.std(windows.middles - line.to_computer(windows.at))),
        bound=bound,
        n_rejected=len(pings) - len(windows.at),
        flags=(ClockFlag.NOT_LINEAR,) * (not linear) + (ClockFlag.OFFSET_ONLY,) * vague,
    )


def _computer_time(samples: Samples) -> ClockFit | None:
    """Return that the samples carry the computer's own time, if it is always right before they arrived."""
    delays = samples.received - samples.device_time
    if delays.min() < SOONEST or delays.max() > LATEST:
        return None
    line = ClockLine(reference=float(samples.device_time[0]), offset=0.0)
    return fit_of(line, ClockMethod.COMPUTER_TIME, 0, flags=(ClockFlag.UNKNOWN_LATENCY,))


def fit_arrivals(samples: Samples) -> ClockFit:
    """Return the meter's clock by the arrival of its samples.

    No sample arrives before it was made: the line is below all delays, as close to them as it can be (Moon et
    al. 1999). How long the fastest sample took remains unknown.

    Parameters
    ----------
    samples : Samples
        Each once.
    """
    delays = samples.received - samples.device_time
    parts = np.array_split(np.arange(len(delays)), min(STRETCHES, len(delays)))
    soonest = np.array([part[np.argmin(delays[part])] for part in parts])
    times, lowest = samples.device_time[soonest], delays[soonest]
    middle = float((samples.device_time[0] + samples.device_time[-1]) / 2)
    offset, drift = line_below(times, lowest, middle)
    above = delays - offset - drift * (samples.device_time - middle)
    line, flags = ClockLine(middle, offset, drift), (ClockFlag.UNKNOWN_LATENCY,)
    return fit_of(line, ClockMethod.ARRIVALS, len(delays), residual_sd=float(above.std()), flags=flags)


def _fit_flashes(
    samples: Samples, flashes: Sequence[FlashMark], played: tuple[float, float], seed: ClockLine
) -> ClockFit | None:
    """Return the meter's clock by flash markers; None if none is found in the power.

    Each marker is laid over the power where the squared differences are least (the cross-correlation is
    greatest), together with the lag with which the panel follows. Markers before and after what was played
    (first and last flip, on the computer's clock [s]) give offset and drift, a single one the offset.
    """
    groups = [
        [mark for mark in flashes if mark.time < played[0]],
        [mark for mark in flashes if mark.time > played[1]],
    ]
    places = [(len(group), _find(samples, group, seed)) for group in groups if len(group) >= FEWEST_MARKS]
    found = [(n, *place) for n, place in places if place is not None]
    if not found:
        return None
    n_used = sum(n for n, _, _ in found)
    first, last = found[0][1], found[-1][1]
    if len(found) > 1:
        device = last.reference - first.reference
        first = replace(first, drift=(device + last.offset - first.offset) / device - 1)
    return fit_of(
        first,
        ClockMethod.FLASHES,
        n_used,
        bound=samples.interval / 2 + max(lag for _, _, lag in found),
        n_rejected=len(flashes) - n_used,
        flags=() if len(found) > 1 else (ClockFlag.OFFSET_ONLY,),
    )


def _find(samples: Samples, marks: Sequence[FlashMark], seed: ClockLine) -> tuple[ClockLine, float] | None:
    """Return the clock by one marker, with the drift of the seed, and the panel's lag [s]."""
    times = seed.to_computer(samples.device_time)
    # What was shown before the first mark is not known: the second is the first that is seen to change.
    first, last = (marks[0].time + marks[1].time) / 2, marks[-1].time + AFTER_LAST
    near = (times > first - REACH) & (times < last + REACH)
    times, power = times[near], samples.power[near]
    if len(times) < 2 * len(marks) or times[0] > first or times[-1] < last:
        return None

    def unexplained(place: Array) -> float:
        """Return the share of the variance that a shift and a lag (its logarithm) leave."""
        ends, lag = times - place[0], _lag(place[1])
        inside = (ends - samples.interval > first) & (ends < last)
        if inside.sum() < 2 * len(marks):
            return 1.0
        pattern = _response(marks, ends[inside], lag) - _response(marks, ends[inside] - samples.interval, lag)
        return 1 - _correlation(pattern, power[inside]) ** 2

    shifts = np.arange(-REACH, REACH, max(samples.interval / 2, 0.002))
    grid = np.column_stack([shifts, np.full(len(shifts), np.log(FIRST_LAG))])
    start = grid[int(np.argmin([unexplained(place) for place in grid]))]
    simplex = start + np.array([(0.0, 0.0), (samples.interval / 2, 0.0), (0.0, 0.7)])
    options = {"initial_simplex": simplex, "xatol": 1e-5, "fatol": 1e-12}
    best = minimize(  # type: ignore[call-overload] # the stubs ask for statically 1-D arrays
        unexplained, start, method="Nelder-Mead", options=options
    )
    if best.fun > 1 - CLEAR:
        return None
    middle = (first + last) / 2
    device = float(seed.to_meter(middle + best.x[0]))
    return ClockLine(device, middle - device, seed.drift), _lag(best.x[1])


def _lag(logarithm: float) -> float:
    """Return a lag that is neither without effect nor longer than the marker's own times [s]."""
    return float(np.clip(np.exp(logarithm), 1e-5, MOST_LAG))


def _correlation(a: Array, b: Array) -> float:
    """Return the correlation of two series; 0 if one of them does not vary, or it is negative."""
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return max(float(a @ b) / size, 0.0) if size > 0 else 0.0


def _response(marks: Sequence[FlashMark], times: Array, lag: float) -> Array:
    """Return the integral, from the first mark to some times, of a brightness that follows with a lag."""
    starts = np.array([mark.time for mark in marks])
    aims = np.array([mark.factor for mark in marks])
    begun, area, level = [], [], aims[0]
    total = 0.0
    for k, (start, aim) in enumerate(zip(starts, aims, strict=True)):
        begun.append(level)
        area.append(total)
        if k + 1 < len(starts):
            left = np.exp(-(starts[k + 1] - start) / lag)
            total += aim * (starts[k + 1] - start) + (level - aim) * lag * (1 - left)
            level = aim + (level - aim) * left
    place = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, None)
    since = np.maximum(times - starts[place], 0.0)
    follows = (np.array(begun)[place] - aims[place]) * lag * (1 - np.exp(-since / lag))
    return np.asarray(np.array(area)[place] + aims[place] * since + follows)

"""A meter's clock from flash markers: the brightness goes up and down, and is found again in the power."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from evenlight.analysis.measurement.clock_line import ClockEstimate, ClockLine
from evenlight.analysis.measurement.sample_gaps import Samples
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame_energy import ClockFlag, ClockMethod
from evenlight.data_schema.power_log import FlashMark

REACH = 0.45  # [s] around the arrivals' clock: less than half the second in which the flashes repeat
AFTER_LAST = 0.4  # [s] of the last level, which holds for half a second
FEWEST_MARKS = 3  # of a marker: fewer are no pattern
FIRST_LAG = 0.005  # [s] where the search for the panel's lag begins
MOST_LAG = 0.1  # [s]
CLEAR = 0.8  # share of the power's variance that a marker must explain


@dataclass(frozen=True, slots=True)
class _Found:
    """A marker in the power: when it was, on both clocks, and the panel's lag [s]."""

    device: float
    computer: float
    lag: float


def fit_flashes(
    samples: Samples, flashes: Sequence[FlashMark], played: tuple[float, float], seed: ClockEstimate
) -> ClockEstimate | None:
    """Return the meter's clock by flash markers; None if none is found in the power.

    Each marker is laid over the power where the squared differences are least (the cross-correlation is
    greatest), together with the lag with which the panel follows. Markers before and after what was played
    give offset and drift, a single one the offset.

    Parameters
    ----------
    samples : Samples
        Each once.
    flashes : sequence of FlashMark
        The markers, in order.
    played : (float, float)
        First and last flip, on the computer's clock [s].
    seed : ClockEstimate
        The clock by arrivals.
    """
    groups = [
        [mark for mark in flashes if mark.time < played[0]],
        [mark for mark in flashes if mark.time > played[1]],
    ]
    places = [(group, _find(samples, group, seed)) for group in groups if len(group) >= FEWEST_MARKS]
    found = [place for _, place in places if place is not None]
    if not found:
        return None
    n_used = sum(len(group) for group, place in places if place is not None)
    first, last = found[0], found[-1]
    drift = seed.line.drift
    if len(found) > 1:
        drift = (last.computer - first.computer) / (last.device - first.device) - 1
    return ClockEstimate(
        method=ClockMethod.FLASHES,
        line=ClockLine(first.device, first.computer - first.device, drift),
        residual_sd=None,
        bound=samples.interval / 2 + max(place.lag for place in found),
        n_used=n_used,
        n_rejected=len(flashes) - n_used,
        flags=() if len(found) > 1 else (ClockFlag.OFFSET_ONLY,),
    )


def _find(samples: Samples, marks: Sequence[FlashMark], seed: ClockEstimate) -> _Found | None:
    """Return where a marker is in the power, or None if it is not."""
    times = seed.line.to_computer(samples.device_time)
    # What was shown before the first mark is not known: the second is the first that is seen to change.
    first, last = (marks[0].time + marks[1].time) / 2, marks[-1].time + AFTER_LAST
    near = (times > first - REACH) & (times < last + REACH)
    times, power = times[near], samples.power[near]
    if len(times) < 2 * len(marks) or times[0] > first or times[-1] < last:
        return None

    def unexplained(shift: float, lag: float) -> float:
        ends = times - shift
        inside = (ends - samples.interval > first) & (ends < last)
        if inside.sum() < 2 * len(marks):
            return 1.0
        pattern = _response(marks, ends[inside], lag) - _response(marks, ends[inside] - samples.interval, lag)
        return 1 - _correlation(pattern, power[inside]) ** 2

    grid = np.arange(-REACH, REACH, max(samples.interval / 2, 0.002))
    start = float(grid[int(np.argmin([unexplained(shift, FIRST_LAG) for shift in grid]))])
    shift, lag, left = _refined(unexplained, start, samples.interval)
    if left > 1 - CLEAR:
        return None
    middle = (first + last) / 2
    return _Found(float(seed.line.to_meter(middle + shift)), middle, lag)


def _refined(
    unexplained: Callable[[float, float], float], shift: float, interval: float
) -> tuple[float, float, float]:
    """Return the shift and the lag that leave the least unexplained, near a shift, and how much that is."""
    lag = float(np.log(FIRST_LAG))
    first = np.array([(shift, lag), (shift + interval / 2, lag), (shift, lag + 0.7)])
    best = minimize(  # type: ignore[call-overload] # the stubs ask for statically 1-D arrays
        lambda place: unexplained(float(place[0]), _lag(float(place[1]))),
        first[0],
        method="Nelder-Mead",
        options={"initial_simplex": first, "xatol": 1e-5, "fatol": 1e-12},
    )
    return float(best.x[0]), _lag(best.x[1]), float(best.fun)


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

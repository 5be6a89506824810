"""Edges of light after the flips of a patch: each flip's own, response times, and latency.

The response time is that from 10 to 90 % of the change (VESA FPDM2 305-1, ISO 9241-305), of the median of all
edges, laid over each other where they pass the middle; the levels are those before a change and long after
it. A PWM is averaged out over its period first, which no response much shorter than that survives: then it
is an upper limit. Latency is from the flip until the light passes the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.analysis.measurement.light.light_recording import LightRecording
from evenlight.analysis.measurement.played_power.clock_line import ClockEstimate
from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.recordings.light import Latency, ResponseTime
from evenlight.data_schema.recordings.played_power import ClockFlag

SEED, RESAMPLES = 1, 200  # of the bootstrap
CONFIDENCE = (2.5, 97.5)  # [%]
LOW, HIGH = 0.3, 0.7  # of the range: an edge passes both, so that noise at the middle is none
EARLIEST = -0.01  # [s] before its flip that an edge may come, by errors of the clock
SETTLED = 0.3  # share of the time to the next flip in which the light counts as settled
AC_BEFORE = 0.003  # [s] before a flip, in which an AC-coupled signal still shows the level
FAINTEST = 5.0  # standard deviations of levels that a patch must change the light by
SMOOTHED = 3  # samples, where there is no PWM to be averaged out
DROOP = 0.05  # share of a change by which a settled light may still move
RESOLVED = 2.0  # times the averaged time that a response must take, to be more than an upper limit
GRID = 800  # points of an edge
AROUND = 3.0  # response times before and after the middle that are laid over each other
ROUGHNESS = 15.0  # noise shorter than this part of a response is averaged out


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """All edges of one direction, laid over each other.

    Attributes
    ----------
    since : array, (G,)
        Time since the middle [s].
    shares : array, (E, G)
        Of the change that each edge has made, from 0 to 1.
    response : ResponseTime
        What they say.
    ends : (float, float)
        When the median edge passes 10 and 90 % [s].
    """

    since: Array
    shares: Array
    response: ResponseTime
    ends: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class LightEdges:
    """The edges of a recording; those of flips that have none are NaN.

    Attributes
    ----------
    times, before, after : array, (F - 1,)
        When the light passed the middle, on the sampler's clock [s], and its levels, for each flip from the
        second on: the first shows the white that all begins with.
    n_extra : int
        Edges that no flip has.
    smoothing : float
        Over how long the light was averaged [s].
    settled : bool
        Whether the light has come to rest before each next flip.
    visible : bool
        Whether the light changes clearly with the patch.
    """

    times: Array
    before: Array
    after: Array
    n_extra: int
    smoothing: float
    settled: bool
    visible: bool

    @property
    def found(self) -> Mask:
        """Which flips have their edge."""
        return np.isfinite(self.times)


class SmoothedLight:
    """Light averaged over a time, at any time; nothing averages where the time is 0.

    Parameters
    ----------
    times, values : array, (N,)
        Samples [s].
    width : float
        How long is averaged over [s].

    >>> step = SmoothedLight(np.arange(5.0), np.array([0.0, 0.0, 1.0, 1.0, 1.0]), 2.0)
    >>> step.at(np.array([1.0, 3.0])).tolist()
    [0.25, 1.0]
    """

    def __init__(self, times: Array, values: Array, width: float) -> None:
        self._times, self._values, self._width = times, values, width
        steps = np.diff(times) * (values[1:] + values[:-1]) / 2
        self._integral = np.concatenate([[0.0], np.cumsum(steps)])

    def at(self, times: Array) -> Array:
        """Return the light at some times."""
        if self._width == 0:
            return np.interp(times, self._times, self._values)
        half = self._width / 2  # at the ends of the recording the light counts as steady
        times = np.clip(times, self._times[0] + half, self._times[-1] - half)
        return (self._whole(times + half) - self._whole(times - half)) / self._width

    def _whole(self, times: Array) -> Array:
        """Return the integral up to some times, exact for light that is linear between two samples."""
        place = np.clip(np.searchsorted(self._times, times, side="right") - 1, 0, len(self._times) - 2)
        into = times - self._times[place]
        slope = (self._values[place + 1] - self._values[place]) / (
            self._times[place + 1] - self._times[place]
        )
        return np.asarray(self._integral[place] + into * (self._values[place] + slope * into / 2))


def find_edges(recording: LightRecording, ripple: float | None) -> LightEdges:
    """Return the edges of a recording.

    Parameters
    ----------
    recording : LightRecording
        With at least three flips.
    ripple : float or None
        Frequency of the PWM that is averaged out [Hz].
    """
    smoothing = 1 / ripple if ripple else SMOOTHED * recording.period
    smooth = SmoothedLight(recording.times, recording.values, smoothing)
    flips, lit = recording.flips, recording.lit
    before, after, settled = _levels(recording, smooth)
    change = np.where(lit[1:], after - before, before - after)
    contrast = float(np.median(change))
    # How far levels that should be the same differ, for the noise of a level.
    spread = float(np.median(np.abs(np.diff(change)))) + 1e-12
    times = np.full(len(change), np.nan)
    # The white that all begins with lasts, and tells which way the light changes. If it changes the other way
    # at the flips, it is late by an interval.
    polarity = before[0] - float(np.median(np.concatenate([before, after])))
    if abs(contrast) < FAINTEST * spread or contrast * polarity < 0:
        return LightEdges(times, before, after, 0, smoothing, settled, visible=False)
    ends = np.append(flips[2:], recording.times[-1])
    for k in np.flatnonzero(change / contrast > LOW):
        begin, end = np.searchsorted(recording.times, [flips[k + 1] + EARLIEST, ends[k]])
        at = recording.times[begin:end]
        times[k] = _middle(at, (smooth.at(at) - before[k]) / (after[k] - before[k]))
    shown = recording.times > (flips[0] + flips[1]) / 2
    n_found = int(np.isfinite(times).sum())
    n_extra = max(_turns(smooth.at(recording.times[shown])) - n_found, 0)
    visible = n_extra <= n_found  # else what was found may be chance
    return LightEdges(
        times if visible else 0 * times + np.nan, before, after, n_extra, smoothing, settled, visible
    )


def _levels(recording: LightRecording, smooth: SmoothedLight) -> tuple[Array, Array, bool]:
    """Return the light before each flip and after it, and whether it comes to rest."""
    flips = recording.flips
    ends = np.append(flips[1:], min(recording.times[-1], 2 * flips[-1] - flips[-2]))
    lasts = ends - flips
    points = np.linspace(0, 1, 50)

    def median(begin: Array, end: Array) -> Array:
        return np.median(smooth.at(begin[:, None] + (end - begin)[:, None] * points), axis=1)

    if not recording.log.dc_coupled:  # its level is gone soon: what comes right before and after the jump
        before = median(flips[1:] - AC_BEFORE, flips[1:])
        seen = smooth.at(flips[1:, None] + (lasts[1:, None] / 2) * np.linspace(0, 1, 1000))
        after = np.where(
            np.abs(seen.max(1) - before) > np.abs(seen.min(1) - before), seen.max(1), seen.min(1)
        )
        return before, after, False
    rest = median(ends - SETTLED * lasts, ends)
    early, late = (
        median(ends - SETTLED * lasts, ends - SETTLED / 2 * lasts),
        median(ends - SETTLED / 2 * lasts, ends),
    )
    moved = np.median(np.abs(late - early)) / max(float(np.median(np.abs(np.diff(rest)))), 1e-12)
    return rest[:-1], rest[1:], bool(moved < DROOP)


def _middle(times: Array, share: Array) -> float:
    """Return when a share passes 0.5 on its way from below `LOW` to above `HIGH`; NaN where it does not."""
    above = np.flatnonzero(share > HIGH)
    below = np.flatnonzero(share[: above[0]] < LOW) if len(above) else above
    if not len(below):
        return float("nan")
    way = slice(below[-1], above[0] + 1)
    at, share = times[way], share[way]
    passed = np.flatnonzero((share[:-1] < 0.5) != (share[1:] < 0.5))
    part = (0.5 - share[passed]) / (share[passed + 1] - share[passed])
    crossings = at[passed] + part * (at[passed + 1] - at[passed])
    return float((crossings[0] + crossings[-1]) / 2)  # noise may pass it more than once


def _turns(light: Array) -> int:
    """Return how often light comes from below `LOW` of its range to above `HIGH`, or back."""
    dim, bright = np.percentile(light, [2, 98])
    state = (light > dim + HIGH * (bright - dim)).astype(int) - (light < dim + LOW * (bright - dim))
    state = state[state != 0]
    return int((state[1:] != state[:-1]).sum())


def response_times(recording: LightRecording, edges: LightEdges, ripple: float | None) -> list[Overlay]:
    """Return the response times of rising and of falling edges; none for a direction without edges.

    Parameters
    ----------
    recording, edges : LightRecording, LightEdges
        The light, and its edges.
    ripple : float or None
        Frequency of the PWM that is averaged out [Hz].
    """
    smooth = SmoothedLight(recording.times, recording.values, 1 / ripple if ripple else 0.0)
    reach = 0.45 * float(np.diff(recording.flips).min())
    least = max(RESOLVED / ripple if ripple else 0.0, SMOOTHED * recording.period)
    overlays = []
    for rising in (True, False):
        places = np.flatnonzero(edges.found & (recording.lit[1:] == rising))
        if not len(places):
            continue
        since, shares = _laid_over(smooth, edges, places, reach)
        first = _ten_to_ninety(since, np.median(shares, axis=0))
        if first is None:
            continue
        length = first[1] - first[0]
        since, shares = _laid_over(smooth, edges, places, min(reach, AROUND * length + 4 * recording.period))
        overlay = _judged(since, shares, length / ROUGHNESS, least, rising=rising)
        overlays += [overlay] if overlay else []
    return overlays


def _laid_over(
    smooth: SmoothedLight, edges: LightEdges, places: Integers, reach: float
) -> tuple[Array, Array]:
    """Return times since the middle [s], up to a reach, and the share of its change that each edge made."""
    since = np.linspace(-reach, reach, GRID)
    before, after = edges.before[places, None], edges.after[places, None]
    return since, (smooth.at(edges.times[places, None] + since) - before) / (after - before)


def _ten_to_ninety(since: Array, share: Array) -> tuple[float, float] | None:
    """Return when a change passes 10 and 90 %, the nearest to its middle [s]; None where it does not."""
    middle = int(np.searchsorted(since, 0.0))
    low, high = np.flatnonzero(share[:middle] <= 0.1), middle + np.flatnonzero(share[middle:] >= 0.9)
    if not len(low) or not len(high) or high[0] == 0:
        return None
    a, b = low[-1], high[0] - 1
    step = since[1] - since[0]
    begin = since[a] + step * (0.1 - share[a]) / max(share[a + 1] - share[a], 1e-12)
    end = since[b] + step * (0.9 - share[b]) / max(share[b + 1] - share[b], 1e-12)
    return float(min(begin, since[a + 1])), float(min(end, since[b + 1]))


def _judged(since: Array, shares: Array, width: float, least: float, *, rising: bool) -> Overlay | None:
    """Return edges with their response time; one below the least that can be told is an upper limit."""
    size = max(round(width / (since[1] - since[0])), 1)
    kernel = np.ones(size) / size
    edge = len(since) - size // 2

    def ends(rows: Integers) -> tuple[float, float] | None:
        median = np.median(shares[rows], axis=0)
        smoothed = np.convolve(median, kernel, mode="same")
        smoothed[: size // 2], smoothed[edge:] = median[: size // 2], median[edge:]
        return _ten_to_ninety(since, smoothed)

    n_edges, rng = len(shares), np.random.default_rng(SEED)
    passed = ends(np.arange(n_edges))
    if passed is None:
        return None
    again = [found for _ in range(RESAMPLES) if (found := ends(rng.integers(n_edges, size=n_edges)))]
    time = passed[1] - passed[0]
    low, high = (float(p) for p in np.percentile([time, *(e - b for b, e in again)], CONFIDENCE))
    high, is_most = max(high, time), time < least
    response = ResponseTime(rising, high if is_most else time, min(low, time), high, is_most, n_edges)
    return Overlay(since, shares, response, passed)


def latency_of(
    recording: LightRecording, edges: LightEdges, clock: ClockEstimate
) -> tuple[Latency, Array] | None:
    """Return the latency, and that of each flip from the second on [s]; None without edges.

    Parameters
    ----------
    recording, edges, clock : LightRecording, LightEdges, ClockEstimate
        The light, its edges, and the sampler's clock on the computer's.
    """
    if not edges.found.any():
        return None
    each = clock.line.to_computer(edges.times) - clock.line.to_computer(recording.flips[1:])
    known = each[edges.found]
    rng = np.random.default_rng(SEED)
    medians = np.median(rng.choice(known, (RESAMPLES, len(known))), axis=1)
    low, high = np.percentile(medians, CONFIDENCE)
    off = (clock.bound or 0.0) + recording.period / 2

    def median(rising: bool) -> float | None:
        own = each[edges.found & (recording.lit[1:] == rising)]
        return float(np.median(own)) if len(own) else None

    return Latency(
        median=float(np.median(known)),
        ci_low=float(low) - off,
        ci_high=float(high) + off,
        sd=_pooled_sd(each[edges.found], recording.lit[1:][edges.found]),
        median_rising=median(True),
        median_falling=median(False),
        is_most=ClockFlag.UNKNOWN_LATENCY in clock.flags,
    ), each


def _pooled_sd(latencies: Array, rising: Mask) -> float:
    """Return the standard deviation within a direction, of both together [s].

    >>> _pooled_sd(np.array([1.0, 5.0, 12.0, 12.0]), np.array([True, True, False, False]))
    2.0
    """
    own = [latencies[rising == one] for one in np.unique(rising)]
    squares = sum(float(np.sum((part - part.mean()) ** 2)) for part in own)
    return float(np.sqrt(squares / max(len(latencies) - len(own), 1)))

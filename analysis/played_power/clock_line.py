"""A meter's clock on the computer's, as a line, and lines through windows.

A window: one clock is known to be between two times when another one shows a third.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog

from evenlight.data_schema.arrays import Array, Mask
from evenlight.data_schema.recordings.played_power import ClockFit, ClockMethod

MOST_DRIFT = 0.01  # of a clock without a crystal


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Computer's time = reference + offset + (1 + drift) · (meter's time - reference).

    Attributes
    ----------
    reference, offset : float
        On the meter's clock, and computer's time less the meter's, there [s].
    drift : float
        Seconds of the computer in one of the meter, less 1.
    """

    reference: float
    offset: float
    drift: float = 0.0

    def to_computer(self, device_time: ArrayLike) -> Array:
        """Return times of the meter's clock on the computer's [s].

        >>> ClockLine(reference=10.0, offset=100.0, drift=0.5).to_computer([10.0, 12.0]).tolist()
        [110.0, 113.0]
        """
        since = np.asarray(device_time, dtype=np.float64) - self.reference
        return np.asarray(self.reference + self.offset + (1 + self.drift) * since)

    def to_meter(self, computer_time: ArrayLike) -> Array:
        """Return times of the computer's clock on the meter's [s].

        >>> ClockLine(reference=10.0, offset=100.0, drift=0.5).to_meter([110.0, 113.0]).tolist()
        [10.0, 12.0]
        """
        since = np.asarray(computer_time, dtype=np.float64) - self.reference - self.offset
        return np.asarray(self.reference + since / (1 + self.drift))


def line_of(fit: ClockFit) -> ClockLine:
    """Return the line of a record."""
    return ClockLine(fit.reference, fit.offset, 1e-6 * fit.drift_ppm)


def fit_of(line: ClockLine, method: ClockMethod, n_used: int, **more: Any) -> ClockFit:
    """Return the record of a line, with what it rests on: other fields of `ClockFit`."""
    known = {"residual_sd": None, "bound": None, "n_rejected": 0, "flags": (), **more}
    return ClockFit(method, line.reference, line.offset, 1e6 * line.drift, n_used=n_used, **known)


class ClockWindows:
    """Windows of a clock at times of another, and the lines that go through all of them.

    Inside, a line is an offset about the windows' mean [s] and a drift in units of `MOST_DRIFT`, which makes
    both of about one size, as a solver likes it.

    Parameters
    ----------
    at : array, (N,)
        Times on one clock [s].
    low, high : array, (N,)
        Between which the other one was then [s].
    """

    def __init__(self, at: Array, low: Array, high: Array) -> None:
        self.at, self.middles, self.half_widths = at, (low + high) / 2, (high - low) / 2
        self.reference = float(at.mean())
        self._mean = float((self.middles - at).mean())
        low, high = low - at - self._mean, high - at - self._mean
        # Of thousands of windows, those on the hull of their ends are all that a line can touch.
        below, above = _lower_hull(at, high), _lower_hull(at, -low)
        columns = np.column_stack([np.ones(len(at)), MOST_DRIFT * (at - self.reference)])
        self._rows = np.vstack([columns[below], -columns[above]])
        self._ends = np.concatenate([high[below], -low[above]])

    def middle(self, most_drift: float = MOST_DRIFT) -> tuple[ClockLine, float]:
        """Return the line that is farthest from the windows' ends, and how far [s]; < 0 if outside one."""
        rows = np.column_stack([self._rows, np.ones(len(self._rows))])
        widest = most_drift / MOST_DRIFT
        offset, drift, room = _least((0.0, 0.0, -1.0), rows, self._ends, widest)
        return ClockLine(self.reference, self._mean + offset, MOST_DRIFT * drift), room

    def drifts(self) -> tuple[float, float]:
        """Return the slowest and the fastest of the lines through all windows, as drifts."""
        return self._extreme(0.0, 1.0).drift, self._extreme(0.0, -1.0).drift

    def bound(self, line: ClockLine, stretch: tuple[float, float]) -> float:
        """Return how far from a line another that goes through all windows is, at most, in a stretch [s]."""
        told = line.to_computer(stretch)
        return max(float(np.abs(one.to_computer(stretch) - told).max()) for one in self._extremes(stretch))

    def centre(self, stretch: tuple[float, float]) -> ClockLine:
        """Return the mean of the lines that are highest and lowest at both ends of a stretch."""
        offset, drift = np.mean([(one.offset, one.drift) for one in self._extremes(stretch)], axis=0)
        return ClockLine(self.reference, float(offset), float(drift))

    def _extremes(self, stretch: tuple[float, float]) -> list[ClockLine]:
        """Return the lines through all windows that are highest and lowest at both ends of a stretch."""
        return [
            self._extreme(sign, sign * MOST_DRIFT * (time - self.reference))
            for time in stretch
            for sign in (1.0, -1.0)
        ]

    def _extreme(self, *aim: float) -> ClockLine:
        """Return the line through all windows whose offset and drift make the aim · them least.

        Where no line is, the windows count as just so much wider that there is one.
        """
        offset, drift = _least(aim, self._rows, self._ends + self._slack, 1.0)
        return ClockLine(self.reference, self._mean + offset, MOST_DRIFT * drift)

    @cached_property
    def _slack(self) -> float:
        return max(-self.middle()[1], 0.0) + 1e-9

    def missed(self) -> Mask:
        """Return which windows a line misses that misses them by as little as possible, added up."""
        n = len(self.at)
        columns = np.column_stack([np.ones(n), MOST_DRIFT * (self.at - self.reference)])
        target = self.middles - self.at - self._mean
        rows = np.vstack([np.hstack([columns, -np.eye(n)]), np.hstack([-columns, -np.eye(n)])])
        ends = np.concatenate([target + self.half_widths, self.half_widths - target])
        found = _least((0.0, 0.0, *np.ones(n)), rows, ends, 1.0)
        return np.array(found[2:]) > 1e-7


def _least(aim: Sequence[float], rows: Array, ends: Array, widest: float) -> list[float]:
    """Return offset, drift and what follows that make the aim least, with rows · them at most the ends."""
    others = len(aim) - 2
    free = (None, None) if others == 1 else (0.0, None)  # the room of a line, or how much each window misses
    limits = [(None, None), (-widest, widest), *[free] * others]
    found = linprog(aim, A_ub=rows, b_ub=ends, bounds=limits)
    if not found.success or found.x is None:
        raise RuntimeError(f"no line through the windows of two clocks: {found.message}")
    return [float(value) for value in found.x]


def _lower_hull(x: Array, y: Array) -> list[int]:
    hull: list[int] = []
    for k in np.lexsort((y, x)).tolist():
        if hull and x[hull[-1]] == x[k]:
            continue
        while len(hull) >= 2:
            a, b = hull[-2:]
            if (x[b] - x[a]) * (y[k] - y[a]) > (y[b] - y[a]) * (x[k] - x[a]):
                break  # b is below the line from a to k
            hull.pop()
        hull.append(k)
    return hull


def line_below(x: Array, y: Array, middle: float) -> tuple[float, float]:
    """Return height at a middle and slope of the line below all points that is closest to them there.

    >>> line_below(np.array([0.0, 1.0, 2.0, 4.0]), np.array([1.0, 5.0, 2.0, 3.0]), 1.0)
    (1.5, 0.5)
    """
    hull = _lower_hull(x, y)
    right = int(np.clip(np.searchsorted(x[hull], middle), 1, max(len(hull) - 1, 1)))
    if len(hull) < 2:
        return float(y[hull[0]]), 0.0
    a, b = hull[right - 1], hull[right]
    slope = float((y[b] - y[a]) / (x[b] - x[a]))
    return float(y[a] + slope * (middle - x[a])), slope

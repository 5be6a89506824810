"""Whether a display was steady: at the end of its warm-up, and from the sweep to the repeats after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from evenlight.analysis.measurement.meter_noise import Noise, Repeats

LARGEST_DRIFT = 0.01  # share: twice what a peak is to be known to
FASTEST_CHANGE = 0.01  # share per ten minutes, over the last third of the warm-up
TEN_MINUTES = 600.0  # [s]
LATE = 2 / 3  # of the warm-up: what comes after is looked at
FEWEST_LATE = 3  # readings there, of which a line says more than its ends


@dataclass(frozen=True, slots=True)
class Change:
    """A change as a share of the value.

    Attributes
    ----------
    share : float
        The change; above 0 if the value rose.
    interval : (float, float)
        Its 95 % interval.
    """

    share: float
    interval: tuple[float, float]

    @property
    def clear(self) -> bool:
        """Whether the interval excludes no change."""
        return self.interval[0] > 0 or self.interval[1] < 0

    @property
    def half_width(self) -> float:
        """Half of the interval."""
        return (self.interval[1] - self.interval[0]) / 2


def change_at_the_end(levels: Sequence[tuple[Repeats, Repeats]], noise: Noise) -> Change | None:
    """Return by how much the repeats at the end differ from the sweep; None if nothing was repeated.

    Parameters
    ----------
    levels : sequence of (Repeats, Repeats)
        Of each level that was repeated: its readings in the sweep, and those at the end.
    noise : Noise
        Of single readings, by which the levels are weighed.
    """
    shares, weights = [], []
    for before, after in levels:
        if before.values.size and after.values.size and before.mean > 0:
            variance = float(noise.variance(before.mean)) / before.mean**2
            shares.append(after.mean / before.mean - 1)
            weights.append(1 / (variance * (1 / before.values.size + 1 / after.values.size)))
    if not shares:
        return None
    return _change(float(np.average(shares, weights=weights)), float(np.sum(weights)) ** -0.5, noise)


def late_change(warm_up: Repeats, noise: Noise) -> Change | None:
    """Return the change over the last third of a warm-up, per ten minutes; None of too few readings."""
    if not warm_up.values.size:
        return None
    late = warm_up.times >= LATE * warm_up.times.max()
    times, values = warm_up.times[late], warm_up.values[late]
    spread = float(((times - times.mean()) ** 2).sum())
    mean = float(values.mean())
    if values.size < FEWEST_LATE or spread == 0 or mean <= 0:
        return None
    slope = float((times - times.mean()) @ values) / spread
    error = float(noise.variance(mean)) ** 0.5 / spread**0.5
    return _change(slope / mean * TEN_MINUTES, error / mean * TEN_MINUTES, noise)


def drifted(change: Change | None) -> bool:
    """Return whether a change from the sweep to its end should be looked at: clear, and above 1 %."""
    return change is not None and change.clear and abs(change.share) > LARGEST_DRIFT


def unsteady(change: Change | None) -> bool:
    """Return whether a warm-up ended too early: a clear change of more than 1 % in ten minutes."""
    return change is not None and change.clear and abs(change.share) > FASTEST_CHANGE


def untold(change: Change | None) -> bool:
    """Return whether the readings of a warm-up leave open if the display was steady."""
    return change is None or (change.half_width > FASTEST_CHANGE and not unsteady(change))


def _change(share: float, error: float, noise: Noise) -> Change:
    """Return a change with its interval, from its standard error."""
    half = error * float(stats.t.ppf(0.975, noise.freedom or np.inf))
    return Change(share, (share - half, share + half))

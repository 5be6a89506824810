"""How far the mean over a horizon is from a budget, whenever the horizon begins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evenlight.data_schema.arrays import Array

LEAST_WHOLE = 1e-9  # of the largest: less is rounding


class HorizonErrors(NamedTuple):
    """Largest differences of a mean over a horizon from the budget: either way, and above it (0 if none)."""

    either_way: float
    above: float


def horizon_errors(
    used: Array, of: Array, durations: Array, asked: tuple[float, float]
) -> HorizonErrors | None:
    """Return by how much the mean over a horizon differs from the budget at most.

    Of every horizon within the video, wherever it begins. Those in which `of` is 0 throughout are left out,
    as nothing is a share of 0; None if there is no other, or if the video is shorter than the horizon.

    Parameters
    ----------
    used, of : array, (N,)
        What each frame uses, and what that is to be a share of; 1 where it is none.
    durations : array, (N,)
        How long each frame is shown [s].
    asked : (float, float)
        The budget, and the horizon [s].

    >>> used, second = np.array([0.25, 0.75, 0.25, 1.0]), np.ones(4)
    >>> horizon_errors(used, second, second, (0.75, 2.0))
    HorizonErrors(either_way=0.25, above=0.0)
    """
    budget, horizon = asked
    ends = np.append(0.0, np.cumsum(durations))
    last = ends[-1] - horizon
    if last < -1e-9 * horizon:
        return None
    # In between, both sums are straight lines and their ratio goes one way: the extremes lie here.
    begins = np.clip(np.concatenate([ends, ends - horizon]), 0.0, max(last, 0.0))
    over, whole = (_over_windows(part, durations, begins, horizon) for part in (used, of))
    # Beside a window of 0 the ratio is that of one frame alone, up to the next place in the list.
    counts = whole > LEAST_WHOLE * horizon * of.max()
    if not counts.any():
        return None
    away = over[counts] / whole[counts] - budget
    return HorizonErrors(float(np.abs(away).max()), max(float(away.max()), 0.0))


def _over_windows(values: Array, durations: Array, begins: Array, horizon: float) -> Array:
    """Return the integrals of a value of each frame over windows that begin at some times."""
    ends, total = (np.append(0.0, np.cumsum(part)) for part in (durations, values * durations))
    return np.asarray(np.interp(begins + horizon, ends, total) - np.interp(begins, ends, total))

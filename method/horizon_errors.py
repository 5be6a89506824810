"""How far the mean over a horizon is from a budget, whenever the horizon begins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class HorizonErrors(NamedTuple):
    """Largest differences of a mean over a horizon from the budget: either way, and above it (0 if none)."""

    either_way: float
    above: float


def horizon_errors(
    used: Array, of: Array, durations: Array, asked: tuple[float, float]
) -> HorizonErrors | None:
    """Return by how much the mean over a horizon differs from the budget at most; None if none is whole.

    Parameters
    ----------
    used, of : array, (N,)
        What each frame uses, and what that is a share of (1: of nothing).
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
    sums = [np.append(0.0, np.cumsum(part * durations)) for part in (used, of)]
    begins = ends[ends <= ends[-1] - horizon * (1 - 1e-9)]
    if not len(begins) or horizon > ends[-1] * (1 + 1e-9):
        return None
    over, whole = (np.interp(begins + horizon, ends, total) - total[: len(begins)] for total in sums)
    away = over / whole - budget
    return HorizonErrors(float(np.abs(away).max()), max(float(away.max()), 0.0))

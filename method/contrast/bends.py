"""The curve of a frame as its bends: as few points as it takes to give every loss between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.contrast.one_pass import compiled

TOLERANCE = 2e-4  # of loss, between bends
NO_BENDS = np.empty((0, 2))


def bends_of(factors: Array, loss: Array, tolerance: float = TOLERANCE) -> Array:
    """Return points of a curve, (M, 2), between which straight lines come within a tolerance of all others.

    Each line goes as far as one can (the cones of Sklansky & Gonzalez 1980, Pattern Recognition 12:327).

    Parameters
    ----------
    factors, loss : array, (F,)
        Brightness factors, rising, and 𝓛_c at each.
    tolerance : float
        Of loss.

    >>> b = np.array([0.25, 0.5, 0.6, 0.75, 1.0])
    >>> bends_of(b, np.array([0.5, 0.5, 0.5, 0.1, 0.0])).tolist()
    [[0.25, 0.5], [0.6, 0.5], [0.75, 0.1], [1.0, 0.0]]
    """
    chosen = _bends(factors, loss, tolerance)
    return np.stack([factors[chosen], loss[chosen]], axis=1)


@compiled
def _bends(factors: Any, loss: Any, tolerance: Any) -> Any:
    chosen, n, begin = np.empty(factors.size, np.int64), 1, 0
    chosen[0] = 0
    while begin < factors.size - 1:
        least, most, end = -np.inf, np.inf, begin + 1
        for k in range(begin + 1, factors.size):
            way, change = factors[k] - factors[begin], loss[k] - loss[begin]
            if least <= change / way <= most:
                end = k
            least, most = max(least, (change - tolerance) / way), min(most, (change + tolerance) / way)
            if least > most:
                break
        chosen[n] = begin = end
        n += 1
    return chosen[:n]

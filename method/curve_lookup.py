"""Loss curves between their knots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from data_schema.loss_curves import LossCurves

Array = NDArray[np.float64]


def loss_and_slope(curves: LossCurves, factors: Array) -> tuple[Array, Array]:
    """Return the contrast loss of each frame at its factor, and its derivative, between knots linearly.

    Parameters
    ----------
    curves : LossCurves
        N curves.
    factors : array, (N,)
        b of each frame, within the curves' factors.

    Returns
    -------
    loss, slope : array, (N,)
        𝓛_c, and d𝓛_c/db of the segment (at a knot: of the one above it, at factor 1 of the last).
    """
    knots = curves.factors
    segment = np.clip(np.searchsorted(knots, factors, side="right") - 1, 0, len(knots) - 2)
    frame = np.arange(len(factors))
    below, above = curves.loss[frame, segment], curves.loss[frame, segment + 1]
    slope = (above - below) / (knots[segment + 1] - knots[segment])
    return below + slope * (factors - knots[segment]), slope

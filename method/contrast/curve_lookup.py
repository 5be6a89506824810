"""Loss curves between their knots."""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.compiled_loop import compiled_loop


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
    loss, slope = _on_segments(curves.factors, curves.loss, np.asarray(factors, dtype=np.float64))
    return loss, slope


@compiled_loop(error_model="numpy", boundscheck=True)
def _on_segments(knots: Array, losses: Array, factors: Array) -> tuple[Array, Array]:
    loss, slope = np.empty(len(factors)), np.empty(len(factors))
    for i in range(len(factors)):
        above = min(max(np.searchsorted(knots, factors[i], side="right"), 1), len(knots) - 1)
        start, below = knots[above - 1], losses[i, above - 1]
        slope[i] = (losses[i, above] - below) / (knots[above] - start)
        # Rounding may leave a loss of -1e-20 at factor 1.
        loss[i] = max(below + slope[i] * (factors[i] - start), 0.0)
    return loss, slope


def loss_at(curves: LossCurves, factors: Array) -> Array:
    """Return 𝓛_c of each frame at its factor, (N,), as it is published: by bends where they are known."""
    return loss_and_slope(curves, factors)[0] if curves.bends is None else curves.bends.at(factors)


def factor_at_loss(curves: LossCurves, loss: Array) -> Array:
    """Return the factor at which each frame has a given contrast loss; the nearest knot where none has.

    A curve that rises somewhere is taken as the falling one above it.

    Parameters
    ----------
    curves : LossCurves
        N curves.
    loss : array, (N,)
        𝓛_c wanted of each frame.

    Returns
    -------
    array, (N,)
        b, within the curves' factors.
    """
    knots, frame = curves.factors, np.arange(len(loss))
    falling = np.maximum.accumulate(curves.loss[:, ::-1], axis=1)[:, ::-1]
    segment = np.clip((falling > loss[:, None]).sum(axis=1) - 1, 0, len(knots) - 2)
    above, below = falling[frame, segment], falling[frame, segment + 1]
    drop = np.where(above > below, above - below, 1.0)
    # Held to the drop before the division, which may be by 1e-308.
    share = np.where(above > below, np.clip(above - loss, 0.0, drop) / drop, 1.0)
    return np.asarray(knots[segment] + share * (knots[segment + 1] - knots[segment]))

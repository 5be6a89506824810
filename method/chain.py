"""Exact minimization of a quadratic over a chain: neighbours may differ only so much.

The rate limit couples each frame with the next one only. For a separable convex quadratic under such a
coupling, dynamic programming is exact and needs no grid: the cost-to-come of frame i, as a function of its
factor, is convex and piecewise quadratic, so its derivative is a rising, piecewise linear function, kept as
two stacks of knots left and right of its zero. Going to the next frame moves the left stack by the lower
affine map and the right stack by the upper one and puts a flat piece between them; both stacks are moved
lazily, so a frame costs a few operations however many knots there are. The idea is that of the "taut string"
and of Johnson's dynamic program for the fused lasso (2013, J. Comput. Graph. Stat. 22:246), with a bound on
the difference in place of a penalty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array

Ends = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ChainLimits:
    """Affine limits on each of the N-1 steps, and bounds on each of the N values.

    `down_slope[i]·x[i] + down_offset[i] <= x[i+1] <= up_slope[i]·x[i] + up_offset[i]`, slopes above 0, and
    `low[i] <= x[i] <= high[i]`. For every x in that range the upper map must not lie below the lower one.
    """

    down_slope: Array
    down_offset: Array
    up_slope: Array
    up_offset: Array
    low: Array
    high: Array


def minimize_chain(curvature: Array, gradient: Array, limits: ChainLimits) -> Array:
    """Return the x that minimizes Σ curvature/2 · x² + gradient · x within the limits of a chain.

    Parameters
    ----------
    curvature : array, (N,)
        Second derivative of each term, above 0.
    gradient : array, (N,)
        First derivative of each term at x = 0.
    limits : ChainLimits
        Limits on steps and values; some x must satisfy them all.

    Returns
    -------
    array, (N,)
        The minimizer; exact but for rounding.

    >>> free = ChainLimits(*(np.array([v]) for v in (1.0, -0.1, 1.0, 0.1)), np.zeros(2), np.ones(2))
    >>> minimize_chain(np.ones(2), np.array([-0.2, -0.8]), free).round(12).tolist()
    [0.45, 0.55]
    """
    return np.asarray(
        _minimize(
            curvature,
            gradient,
            limits.down_slope,
            limits.down_offset,
            limits.up_slope,
            limits.up_offset,
            limits.low,
            limits.high,
        )
    )


# A stack holds knots (x, d) of the derivative as stored values (x0, d0), with x = A·x0 + C and
# d = U·d0 + V·x0 + W; the five numbers are its `map`. Its `ends` are the indices of its outermost knot and of
# the one beyond its innermost knot.
_A, _C, _U, _V, _W = range(5)


@numba.njit(cache=True, error_model="numpy")
def _knot(xs: Array, ds: Array, mapping: Array, index: int) -> tuple[float, float]:
    """Return position and derivative of a knot."""
    x0 = xs[index]
    return mapping[_A] * x0 + mapping[_C], mapping[_U] * ds[index] + mapping[_V] * x0 + mapping[_W]


@numba.njit(cache=True, error_model="numpy")
def _put(xs: Array, ds: Array, mapping: Array, index: int, x: float, d: float) -> None:
    """Store a knot."""
    x0 = (x - mapping[_C]) / mapping[_A]
    xs[index] = x0
    ds[index] = (d - mapping[_V] * x0 - mapping[_W]) / mapping[_U]


@numba.njit(cache=True, error_model="numpy")
def _move(xs: Array, ds: Array, ends: Ends, mapping: Array, slope: float, offset: float) -> None:
    """Map all knots of a stack: x to slope·x + offset, and with it d to d / slope."""
    mapping[_A] *= slope
    mapping[_C] = mapping[_C] * slope + offset
    mapping[_U] /= slope
    mapping[_V] /= slope
    mapping[_W] /= slope
    if not 0.25 < mapping[_A] < 4.0 or abs(mapping[_C]) > 64.0:  # before rounding can grow
        for k in range(ends[0], ends[1]):
            x, d = _knot(xs, ds, mapping, k)
            xs[k] = x
            ds[k] = d
        mapping[:] = (1.0, 0.0, 1.0, 0.0, 0.0)


@numba.njit(cache=True, error_model="numpy")
def _cut(
    near_x: Array,
    near_d: Array,
    near_ends: Ends,
    near_map: Array,
    far_x: Array,
    far_d: Array,
    far_ends: Ends,
    far_map: Array,
    wall: float,
    side: float,
) -> None:
    """Cut the domain at a wall: `side` is 1 for a wall on the near stack's outside left, -1 for right.

    Knots beyond the wall go, from the near stack's outer end inwards and then from the far stack's inner end
    outwards; the derivative at the wall becomes the outermost knot.
    """
    x_out, d_out = 0.0, 0.0
    cut = False
    while near_ends[0] < near_ends[1]:
        x, d = _knot(near_x, near_d, near_map, near_ends[0])
        if (wall - x) * side <= 0.0:
            if cut:
                share = (wall - x_out) / (x - x_out)
                near_ends[0] -= 1
                _put(near_x, near_d, near_map, near_ends[0], wall, d_out + share * (d - d_out))
            return
        x_out, d_out, cut = x, d, True
        near_ends[0] += 1
    while far_ends[0] < far_ends[1]:
        x, d = _knot(far_x, far_d, far_map, far_ends[1] - 1)
        if (wall - x) * side <= 0.0:
            break
        x_out, d_out, cut = x, d, True
        far_ends[1] -= 1
    if not cut:
        return
    value = d_out
    if far_ends[0] < far_ends[1]:
        x, d = _knot(far_x, far_d, far_map, far_ends[1] - 1)
        if x != x_out:
            value = d_out + (wall - x_out) / (x - x_out) * (d - d_out)
    _put(far_x, far_d, far_map, far_ends[1], wall, value)
    far_ends[1] += 1


@numba.njit(cache=True, error_model="numpy")
def _balance(
    from_x: Array,
    from_d: Array,
    from_ends: Ends,
    from_map: Array,
    to_x: Array,
    to_d: Array,
    to_ends: Ends,
    to_map: Array,
    sign: float,
) -> None:
    """Move knots whose derivative has changed its sign over to the other stack."""
    while from_ends[0] < from_ends[1]:
        x, d = _knot(from_x, from_d, from_map, from_ends[1] - 1)
        if d * sign <= 0.0:
            return
        from_ends[1] -= 1
        _put(to_x, to_d, to_map, to_ends[1], x, d)
        to_ends[1] += 1


@numba.njit(cache=True, error_model="numpy")
def _zero(
    left_x: Array,
    left_d: Array,
    left_ends: Ends,
    left_map: Array,
    right_x: Array,
    right_d: Array,
    right_ends: Ends,
    right_map: Array,
) -> float:
    """Return where the derivative is zero, or the end of the domain that is nearest to it."""
    if left_ends[0] == left_ends[1]:
        return _knot(right_x, right_d, right_map, right_ends[1] - 1)[0]
    x_left, d_left = _knot(left_x, left_d, left_map, left_ends[1] - 1)
    if right_ends[0] == right_ends[1]:
        return x_left
    x_right, d_right = _knot(right_x, right_d, right_map, right_ends[1] - 1)
    if d_right <= d_left:
        return x_left
    zero: float = x_left + (x_right - x_left) * (-d_left / (d_right - d_left))
    return zero


@numba.njit(cache=True, error_model="numpy")
def _minimize(
    curvature: Array,
    gradient: Array,
    down_slope: Array,
    down_offset: Array,
    up_slope: Array,
    up_offset: Array,
    low: Array,
    high: Array,
) -> Array:
    """See `minimize_chain`: knots forward, the path of least cost backward."""
    n = len(curvature)
    size = 6 * n + 16
    middle = 2  # room below the outermost knot for the one that a wall puts back
    left_x, left_d = np.empty(size), np.empty(size)
    right_x, right_d = np.empty(size), np.empty(size)
    left_ends, right_ends = np.array([middle, middle]), np.array([middle, middle])
    left_map, right_map = np.array([1.0, 0.0, 1.0, 0.0, 0.0]), np.array([1.0, 0.0, 1.0, 0.0, 0.0])
    left_x[middle], left_d[middle] = low[0], 0.0
    right_x[middle], right_d[middle] = high[0], 0.0
    left_ends[1] += 1
    right_ends[1] += 1
    best = np.empty(n)
    for i in range(n):
        left_map[_V] += curvature[i] * left_map[_A]
        left_map[_W] += curvature[i] * left_map[_C] + gradient[i]
        right_map[_V] += curvature[i] * right_map[_A]
        right_map[_W] += curvature[i] * right_map[_C] + gradient[i]
        _balance(right_x, right_d, right_ends, right_map, left_x, left_d, left_ends, left_map, -1.0)
        _balance(left_x, left_d, left_ends, left_map, right_x, right_d, right_ends, right_map, 1.0)
        zero = _zero(left_x, left_d, left_ends, left_map, right_x, right_d, right_ends, right_map)
        best[i] = zero
        if i == n - 1:
            break
        _put(left_x, left_d, left_map, left_ends[1], zero, 0.0)
        left_ends[1] += 1
        _put(right_x, right_d, right_map, right_ends[1], zero, 0.0)
        right_ends[1] += 1
        _move(left_x, left_d, left_ends, left_map, down_slope[i], down_offset[i])
        _move(right_x, right_d, right_ends, right_map, up_slope[i], up_offset[i])
        _cut(left_x, left_d, left_ends, left_map, right_x, right_d, right_ends, right_map, low[i + 1], 1.0)
        _cut(right_x, right_d, right_ends, right_map, left_x, left_d, left_ends, left_map, high[i + 1], -1.0)
    for i in range(n - 2, -1, -1):
        after = best[i + 1]
        if after > up_slope[i] * best[i] + up_offset[i]:
            best[i] = (after - up_offset[i]) / up_slope[i]
        elif after < down_slope[i] * best[i] + down_offset[i]:
            best[i] = (after - down_offset[i]) / down_slope[i]
    return best

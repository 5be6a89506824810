"""Exact minimization of a quadratic over a chain: neighbours may differ only so much.

The rate limit couples each frame with the next one only. For a separable convex quadratic under such a
coupling, dynamic programming is exact and needs no grid: the cost-to-come of frame i, as a function of its
factor, is convex and piecewise quadratic, so its derivative is a rising, piecewise linear function, kept as
two stacks of knots left and right of its zero. Going to the next frame moves the left stack by the lower
affine map and the right stack by the upper one and puts a flat piece between them; both stacks are moved
lazily, so a frame costs a few operations however many knots there are. The idea is that of the "taut string"
and of Johnson's dynamic program for the fused lasso (2013, J. Comput. Graph. Stat. 22:246), with a bound on
the difference in place of a penalty.

The rate limit is such a coupling, linearized about feasible factors; the budget is met by a price on the
factor (`within_budget`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.method.compiled_loop import compiled_loop
from evenlight.method.optimizer.optimize import Problem, feasible_blend

Ends = NDArray[np.int64]
BUDGET_CLOSE = 1e-6  # mean factor at which the search for the price may end; the blend does the rest


class ChainLimits(NamedTuple):
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
    return np.asarray(_minimize(curvature, gradient, limits))


# A stack holds knots (x, d) of the derivative as stored values (x0, d0), with x = A·x0 + C and
# d = U·d0 + V·x0 + W.
_A, _C, _U, _V, _W = range(5)


class _Stack(NamedTuple):
    """Knots of the derivative on one side of its zero, outermost first."""

    x: Array  # x0
    d: Array  # d0
    ends: Ends  # the index of its outermost knot, and the one beyond its innermost knot
    map: Array  # A, C, U, V, W


@compiled_loop(error_model="numpy", forceinline=True)
def _knot(stack: _Stack, index: int) -> tuple[float, float]:
    x0, mapping = stack.x[index], stack.map
    return mapping[_A] * x0 + mapping[_C], mapping[_U] * stack.d[index] + mapping[_V] * x0 + mapping[_W]


@compiled_loop(error_model="numpy", forceinline=True)
def _put(stack: _Stack, index: int, x: float, d: float) -> None:
    mapping = stack.map
    x0 = (x - mapping[_C]) / mapping[_A]
    stack.x[index] = x0
    stack.d[index] = (d - mapping[_V] * x0 - mapping[_W]) / mapping[_U]


@compiled_loop(error_model="numpy", forceinline=True)
def _push(stack: _Stack, x: float, d: float) -> None:
    _put(stack, stack.ends[1], x, d)
    stack.ends[1] += 1


@compiled_loop(error_model="numpy", forceinline=True)
def _add_term(stack: _Stack, curvature: float, gradient: float) -> None:
    stack.map[_V] += curvature * stack.map[_A]
    stack.map[_W] += curvature * stack.map[_C] + gradient


@compiled_loop(error_model="numpy", forceinline=True)
def _move(stack: _Stack, slope: float, offset: float) -> None:
    """Map all knots of a stack: x to slope·x + offset, and with it d to d / slope."""
    mapping = stack.map
    mapping[_A] *= slope
    mapping[_C] = mapping[_C] * slope + offset
    mapping[_U] /= slope
    mapping[_V] /= slope
    mapping[_W] /= slope
    if not 0.25 < mapping[_A] < 4.0 or abs(mapping[_C]) > 64.0:  # before rounding can grow
        for k in range(stack.ends[0], stack.ends[1]):
            x, d = _knot(stack, k)
            stack.x[k] = x
            stack.d[k] = d
        mapping[:] = (1.0, 0.0, 1.0, 0.0, 0.0)


@compiled_loop(error_model="numpy", forceinline=True)
def _cut(near: _Stack, far: _Stack, wall: float, side: float) -> None:
    """Cut the domain at a wall: `side` is 1 for a wall on the near stack's outside left, -1 for right.

    Knots beyond the wall go, from the near stack's outer end inwards and then from the far stack's inner end
    outwards; the derivative at the wall becomes the outermost knot.
    """
    x_out, d_out = 0.0, 0.0
    cut = False
    while near.ends[0] < near.ends[1]:
        x, d = _knot(near, near.ends[0])
        if (wall - x) * side <= 0.0:
            if cut:
                share = (wall - x_out) / (x - x_out)
                near.ends[0] -= 1
                _put(near, near.ends[0], wall, d_out + share * (d - d_out))
            return
        x_out, d_out, cut = x, d, True
        near.ends[0] += 1
    while far.ends[0] < far.ends[1]:
        x, d = _knot(far, far.ends[1] - 1)
        if (wall - x) * side <= 0.0:
            break
        x_out, d_out, cut = x, d, True
        far.ends[1] -= 1
    if not cut:
        return
    value = d_out
    if far.ends[0] < far.ends[1]:
        x, d = _knot(far, far.ends[1] - 1)
        if x != x_out:
            value = d_out + (wall - x_out) / (x - x_out) * (d - d_out)
    _push(far, wall, value)


@compiled_loop(error_model="numpy", forceinline=True)
def _balance(giver: _Stack, taker: _Stack, sign: float) -> None:
    """Move knots whose derivative has changed its sign over to the other stack."""
    while giver.ends[0] < giver.ends[1]:
        x, d = _knot(giver, giver.ends[1] - 1)
        if d * sign <= 0.0:
            return
        giver.ends[1] -= 1
        _push(taker, x, d)


@compiled_loop(error_model="numpy", forceinline=True)
def _zero(left: _Stack, right: _Stack) -> float:
    """Return where the derivative is zero, or the end of the domain that is nearest to it."""
    if left.ends[0] == left.ends[1]:
        return _knot(right, right.ends[1] - 1)[0]
    x_left, d_left = _knot(left, left.ends[1] - 1)
    if right.ends[0] == right.ends[1]:
        return x_left
    x_right, d_right = _knot(right, right.ends[1] - 1)
    if d_right <= d_left:
        return x_left
    zero: float = x_left + (x_right - x_left) * (-d_left / (d_right - d_left))
    return zero


@compiled_loop(error_model="numpy")
def _stack(size: int, wall: float) -> _Stack:
    """Return a stack with a knot at a wall; below it is room for the one that a later wall puts back."""
    ends, mapping = np.array([2, 2]), np.array([1.0, 0.0, 1.0, 0.0, 0.0])
    stack = _Stack(np.empty(size), np.empty(size), ends, mapping)
    _push(stack, wall, 0.0)
    return stack


@compiled_loop(error_model="numpy")
def _minimize(curvature: Array, gradient: Array, limits: ChainLimits) -> Array:
    """See `minimize_chain`: knots forward, the path of least cost backward."""
    n = len(curvature)
    left, right = _stack(6 * n + 16, limits.low[0]), _stack(6 * n + 16, limits.high[0])
    best = np.empty(n)
    for i in range(n):
        _add_term(left, curvature[i], gradient[i])
        _add_term(right, curvature[i], gradient[i])
        _balance(right, left, -1.0)
        _balance(left, right, 1.0)
        zero = _zero(left, right)
        best[i] = zero
        if i == n - 1:
            break
        _push(left, zero, 0.0)
        _push(right, zero, 0.0)
        _move(left, limits.down_slope[i], limits.down_offset[i])
        _move(right, limits.up_slope[i], limits.up_offset[i])
        _cut(left, right, limits.low[i + 1], 1.0)
        _cut(right, left, limits.high[i + 1], -1.0)
    for i in range(n - 2, -1, -1):
        up_slope, up_offset = limits.up_slope[i], limits.up_offset[i]
        down_slope, down_offset = limits.down_slope[i], limits.down_offset[i]
        after = best[i + 1]
        if after > up_slope * best[i] + up_offset:
            best[i] = (after - up_offset) / up_slope
        elif after < down_slope * best[i] + down_offset:
            best[i] = (after - down_offset) / down_slope
    return best


def linearized_limits(problem: Problem, factors: Array, trust: float) -> ChainLimits:
    """Return the rate limit as affine limits on each step, exact to first order about feasible factors.

    Of the two ends of a step, the one with the lower limit counts: |b' - b|·m/Δt <= ΔL(b·Ī) at that end.
    """
    luminance = problem.luminance
    seen = factors * luminance
    limit = problem.rate_limit(seen)
    nudge = 1e-5 * np.maximum(seen, 1e-6)
    gain = (problem.rate_limit(seen + nudge) - limit) / nudge * luminance
    reach = problem.step_reach()
    free = np.isinf(reach)
    reach = np.where(free, 1.0, reach)
    at_first = limit[:-1] <= limit[1:]
    end_limit = np.where(at_first, limit[:-1], limit[1:])
    end_factor = np.where(at_first, factors[:-1], factors[1:])
    # A limit that changes by more than half the step it allows is taken as flatter: the map must stay rising.
    end_gain = np.clip(reach * np.where(at_first, gain[:-1], gain[1:]), -0.5, 0.5)
    size = reach * end_limit - end_gain * end_factor
    up = np.where(at_first, 1 + end_gain, 1 / (1 - end_gain))
    down = np.where(at_first, 1 - end_gain, 1 / (1 + end_gain))
    low = np.maximum(problem.lowest_factor, factors - trust)
    high = np.minimum(1.0, factors + trust)
    # Where the linearized limit would fall below 0, the two maps would cross: stay on this side of it.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        crossing = np.where(free, np.inf, -size / end_gain)
    low[:-1] = np.where(~free & (end_gain > 0), np.maximum(low[:-1], crossing), low[:-1])
    high[:-1] = np.where(~free & (end_gain < 0), np.minimum(high[:-1], crossing), high[:-1])
    return ChainLimits(
        down_slope=np.where(free, 1.0, down),
        down_offset=np.where(free, -1.0, -np.where(at_first, size, size * down)),
        up_slope=np.where(free, 1.0, up),
        up_offset=np.where(free, 1.0, np.where(at_first, size, size * up)),
        low=np.minimum(low, factors),
        high=np.maximum(high, factors),
    )


def nearest_feasible(problem: Problem, factors: Array, wanted: Array, trust: float) -> Array:
    """Return feasible factors near to the ones wanted, within a trust of feasible ones."""
    near = nearest_within_budget(problem, wanted, linearized_limits(problem, factors, trust))
    return feasible_blend(problem, np.clip(near, problem.lowest_factor, 1.0))


def nearest_within_budget(problem: Problem, wanted: Array, limits: ChainLimits) -> Array:
    """Return the factors nearest to the ones wanted, within the budget and the limits of a chain."""
    return within_budget(problem, (np.ones_like(wanted), -wanted), limits, (0.0, 1e-3))[0]


def within_budget(
    problem: Problem,
    quadratic: tuple[Array, Array],
    limits: ChainLimits,
    start: tuple[float, float],
) -> tuple[Array, float]:
    """Return the chain's minimizer that meets the budget, and the budget's price.

    The budget used falls with the price; `start` is a first guess at the price, and a step. Once it is
    bracketed, the blend of the two ends that meets the budget exactly is feasible too, since the linearized
    limits are convex.
    """
    curvature, gradient = quadratic
    weights = problem.budget_weights * len(gradient)

    def at(price: float) -> tuple[float, Array, float]:
        x = minimize_chain(curvature, gradient + price * weights, limits)
        return price, x, problem.budget_error(x)

    here = at(start[0])
    if abs(here[2]) < 1e-14:
        return here[1], here[0]
    step = np.copysign(start[1], here[2])
    other = at(here[0] + step)
    while here[2] * other[2] > 0:
        if abs(step) > 1e9:  # the budget is at the end of the range that the trust region leaves
            nearest = here if abs(here[2]) < abs(other[2]) else other
            return nearest[1], start[0]
        here, step = other, step * 4
        other = at(here[0] + step)
    over, under = (here, other) if here[2] > 0 else (other, here)
    for _ in range(4):
        share = over[2] / (over[2] - under[2])
        if min(over[2], -under[2]) < BUDGET_CLOSE:
            break
        middle = at(over[0] + float(np.clip(share, 0.02, 0.98)) * (under[0] - over[0]))
        over, under = (middle, under) if middle[2] > 0 else (over, middle)
    share = over[2] / (over[2] - under[2]) if over[2] > under[2] else 0.0
    return over[1] + share * (under[1] - over[1]), over[0] + share * (under[0] - over[0])

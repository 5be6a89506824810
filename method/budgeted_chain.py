"""The rate limit as a chain's limits, and the quadratic on that chain that meets the budget."""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.chain import ChainLimits, minimize_chain
from evenlight.method.optimize import Problem, feasible_blend

BUDGET_CLOSE = 1e-6  # mean factor at which the search for the price may end; the blend does the rest


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

"""The default solver: splitting the pair sum from the chain.

Two easy problems make up the hard one. For given targets, the factors that come nearest to them within the
rate limit and the budget are a quadratic on a chain, solved exactly in O(N) (`method.chain`), the budget
being one multiplier. For given losses, the ones with less spread near them are a sort and an isotonic
regression, O(N log N). The alternating direction method of multipliers (Boyd et al. 2011, Found. Trends Mach.
Learn. 3:1) alternates the two and carries the disagreement in a dual variable, which also certifies the
answer (`method.lower_bound`). Loss curves and rate limit are linearized about the last feasible factors, so
at the fixed point they are exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from method.chain import ChainLimits, minimize_chain
from method.curve_lookup import factor_at_loss, loss_and_slope
from method.modulation import step_luminance
from method.objective import pairwise_spread, proximal_spread
from method.optimize import Problem, Solution, feasible_blend, is_feasible

Array = NDArray[np.float64]

OVER_RELAXATION = 1.6  # Boyd et al. (2011), section 3.4.3: 1.5 to 1.8 converge faster than 1
TRUST = 0.15  # largest change of a factor in one iteration
# How far along the loss curves to look, as a difference of factors, and for how many fruitless iterations.
# Measured curves are stairs from close by, where pixels vanish one by one; only the last look is local.
LOOKS = ((1.0, 8), (0.125, 8), (0.0, 20))
# The stairs have many local optima. Short videos, whose stairs are the coarsest, can afford more searches.
MORE_SEARCHES = (
    (((0.0, 30),), TRUST),
    (((1.0, 30), (0.25, 20), (0.06, 20), (0.0, 30)), TRUST),
    (LOOKS * 3, TRUST / 4),
)
SHORT = 1000  # frames
BUDGET_CLOSE = 1e-6  # mean factor at which the search for the price may end; the blend does the rest
FLATTEST = 1e-9  # a curve flatter than this, or rising, gives no direction
NO_SPREAD = 1e-15  # below this, losses differ by rounding alone
DAMPING = 1e-3  # share of the mean curvature that holds frames without a slope where they are


@dataclass(frozen=True, slots=True)
class SplittingSolver:
    """Alternate between the pair sum and the chain; O(N log N) per iteration.

    It starts with a far look along the loss curves and ends with their local slopes.

    Attributes
    ----------
    max_iterations : int
        Iterations at most.
    tolerance : float
        A look has done its work when some iterations improved the objective by less than this share of it.
    """

    max_iterations: int = 400
    tolerance: float = 1e-6

    def solve(self, problem: Problem) -> Solution:
        """Return the best feasible factors of all iterations, and the dual variables of the best search."""
        best = self._search(problem, LOOKS, TRUST)
        if problem.curves.n_frames > SHORT or problem.objective(best.factors) <= NO_SPREAD:
            return best
        for looks, trust in MORE_SEARCHES:
            other = self._search(problem, looks, trust)
            if problem.objective(other.factors) < problem.objective(best.factors):
                best = other
        return best

    def _search(self, problem: Problem, looks: tuple[tuple[float, int], ...], trust: float) -> Solution:
        """Return the best feasible factors of one series of looks, from the constant baseline."""
        state = _start(problem)
        best, best_objective = state.factors, pairwise_spread(state.loss)
        iteration = 0
        for reach, patience in looks:
            milestone, since = best_objective, 0
            while iteration < self.max_iterations and best_objective > NO_SPREAD and since < patience:
                iteration += 1
                state = self._step(problem, state, reach, trust)
                objective = pairwise_spread(state.loss)
                if objective < best_objective and is_feasible(problem, state.factors):
                    best, best_objective = state.factors, objective
                since += 1
                if best_objective < milestone * (1 - self.tolerance):
                    milestone, since = best_objective, 0
                if iteration % 10 == 0:
                    state = _rebalance(state)
        # The weights count pairs divided by N; so does the price.
        return Solution(best, iteration, state.stiffness * state.dual, state.price)

    def _step(self, problem: Problem, state: _State, reach: float, trust: float) -> _State:
        """Return the state after one iteration."""
        stiffness = state.stiffness
        wanted, slope = _aim(problem, state.factors, state.target - state.dual, reach)
        stiff = stiffness * slope**2
        damping = DAMPING * float(np.mean(stiff)) + 1e-9
        gradient = -stiff * wanted - damping * state.factors
        limits = linearized_limits(problem, state.factors, trust)
        factors, price = _within_budget(
            problem, (stiff + damping, gradient), limits, (state.price, state.price_step)
        )
        factors = feasible_blend(problem, np.clip(factors, problem.lowest_factor, 1.0))
        loss = problem.loss(factors)
        mixed = OVER_RELAXATION * loss + (1 - OVER_RELAXATION) * state.target + state.dual
        target = proximal_spread(mixed, 1 / (stiffness * len(loss)))
        return _State(
            factors=factors,
            loss=loss,
            target=target,
            dual=mixed - target,
            stiffness=stiffness,
            price=price,
            price_step=max(abs(price - state.price), 1e-9),
            disagreement=float(np.linalg.norm(loss - target)),
            drift=float(np.linalg.norm(target - state.target)),
        )


@dataclass(frozen=True, slots=True)
class _State:
    """Where the iteration stands: factors and their losses, target losses, scaled dual, penalty, price."""

    factors: Array
    loss: Array
    target: Array
    dual: Array
    stiffness: float
    price: float = 0.0
    price_step: float = 1e-3
    disagreement: float = 0.0
    drift: float = 0.0


def _start(problem: Problem) -> _State:
    """Return the state of constant dimming; the penalty fits the spread that it has."""
    factors = problem.baseline()
    loss = problem.loss(factors)
    stiffness = 1 / max(float(np.std(loss)), 1e-4)
    return _State(factors, loss, loss, np.zeros_like(loss), stiffness)


def _aim(problem: Problem, factors: Array, targets: Array, reach: float) -> tuple[Array, Array]:
    """Return the factors at which the frames would have target losses, and the slopes on the way there.

    The slope is that of the chord to the target, at most `reach` and at least two knots long; with a reach
    of 0 it is the local one. Targets that no factor reaches are aimed at along it: they still pull.
    """
    curves = problem.curves
    if reach == 0:
        start = factors
        slope = loss_and_slope(curves, factors)[1]
    else:
        spacing = (1 - problem.lowest_factor) / (len(curves.factors) - 1)
        there = factor_at_loss(curves, targets)
        way = there - factors
        size = np.clip(np.abs(way), spacing, reach)
        low = np.maximum(factors - np.where(way > spacing, 0.0, size), problem.lowest_factor)
        high = np.minimum(factors + np.where(way < -spacing, 0.0, size), 1.0)
        start = np.where(np.abs(way) > reach, factors, there)
        slope = (problem.loss(high) - problem.loss(low)) / (high - low)
    slope = np.minimum(slope, -FLATTEST)
    return start + np.clip((targets - problem.loss(start)) / slope, -1.0, 1.0), slope


def _rebalance(state: _State) -> _State:
    """Return the state with a stiffer or softer penalty where one residual is far above the other."""
    if state.disagreement > 5 * state.drift:
        scale = 2.0
    elif state.drift > 5 * state.disagreement:
        scale = 0.5
    else:
        return state
    return _State(
        state.factors,
        state.loss,
        state.target,
        state.dual / scale,
        state.stiffness * scale,
        state.price,
        state.price_step,
    )


def linearized_limits(problem: Problem, factors: Array, trust: float) -> ChainLimits:
    """Return the rate limit as affine limits on each step, exact to first order about feasible factors.

    Of the two ends of a step, the one with the lower limit counts: |b' - b|·m/Δt <= ΔL(b·Ī) at that end.
    """
    luminance, durations = problem.luminance, problem.curves.durations[:-1]
    seen = factors * luminance
    limit = problem.rate_limit(seen)
    nudge = 1e-5 * np.maximum(seen, 1e-6)
    gain = (problem.rate_limit(seen + nudge) - limit) / nudge * luminance
    middle = step_luminance(luminance)
    dark = middle <= 0  # a step between black frames changes nothing and is free
    reach = durations / np.where(dark, 1.0, middle)
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
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.where(dark, np.inf, -size / end_gain)
    low[:-1] = np.where(~dark & (end_gain > 0), np.maximum(low[:-1], crossing), low[:-1])
    high[:-1] = np.where(~dark & (end_gain < 0), np.minimum(high[:-1], crossing), high[:-1])
    return ChainLimits(
        down_slope=np.where(dark, 1.0, down),
        down_offset=np.where(dark, -1.0, -np.where(at_first, size, size * down)),
        up_slope=np.where(dark, 1.0, up),
        up_offset=np.where(dark, 1.0, np.where(at_first, size, size * up)),
        low=np.minimum(low, factors),
        high=np.maximum(high, factors),
    )


def nearest_within_budget(problem: Problem, wanted: Array, limits: ChainLimits) -> Array:
    """Return the factors nearest to the ones wanted, within the budget and the limits of a chain."""
    return _within_budget(problem, (np.ones_like(wanted), -wanted), limits, (0.0, 1e-3))[0]


def _within_budget(
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

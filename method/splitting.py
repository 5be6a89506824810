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
from method.curve_lookup import loss_and_slope
from method.modulation import step_luminance
from method.objective import pairwise_spread, proximal_spread
from method.optimize import Problem, Solution, feasible_blend

Array = NDArray[np.float64]

OVER_RELAXATION = 1.6  # Boyd et al. (2011), section 3.4.3: 1.5 to 1.8 converge faster than 1
DAMPING = 1e-3  # share of the mean curvature that holds frames without a slope where they are


@dataclass(frozen=True, slots=True)
class SplittingSolver:
    """Alternate between the pair sum and the chain; O(N log N) per iteration.

    Attributes
    ----------
    max_iterations : int
        Iterations at most.
    tolerance : float
        Stop when `patience` iterations improved the objective by less than this share of it.
    patience : int
        See tolerance.
    trust : float
        Largest change of a factor in one iteration.
    """

    max_iterations: int = 300
    tolerance: float = 1e-6
    patience: int = 20
    trust: float = 0.15

    def solve(self, problem: Problem) -> Solution:
        """Return the best feasible factors of all iterations, and the last dual variables."""
        state = _start(problem)
        best, best_objective = state.factors, pairwise_spread(state.loss)
        milestone, since = best_objective, 0
        iteration = 0
        while iteration < self.max_iterations and best_objective > 1e-15 and since < self.patience:
            iteration += 1
            state = self._step(problem, state)
            objective = pairwise_spread(state.loss)
            if objective < best_objective:
                best, best_objective = state.factors, objective
            since += 1
            if best_objective < milestone * (1 - self.tolerance):
                milestone, since = best_objective, 0
            if iteration % 10 == 0:
                state = _rebalance(state)
        # The weights count pairs divided by N; so does the price.
        return Solution(best, iteration, state.stiffness * state.dual, state.price)

    def _step(self, problem: Problem, state: _State) -> _State:
        """Return the state after one iteration."""
        stiffness, slope = state.stiffness, state.slope
        stiff = stiffness * slope**2
        damping = DAMPING * float(np.mean(stiff)) + 1e-9
        wanted = state.loss - slope * state.factors - state.target + state.dual
        gradient = stiffness * slope * wanted - damping * state.factors
        limits = linearized_limits(problem, state.factors, self.trust)
        factors, price = _within_budget(problem, (stiff + damping, gradient), limits, state)
        factors = feasible_blend(problem, np.clip(factors, problem.lowest_factor, 1.0))
        loss, slope = loss_and_slope(problem.curves, factors)
        mixed = OVER_RELAXATION * loss + (1 - OVER_RELAXATION) * state.target + state.dual
        target = proximal_spread(mixed, 1 / (stiffness * len(loss)))
        return _State(
            factors=factors,
            loss=loss,
            slope=slope,
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
    slope: Array
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
    loss, slope = loss_and_slope(problem.curves, factors)
    stiffness = 1 / max(float(np.std(loss)), 1e-4)
    return _State(factors, loss, slope, loss, np.zeros_like(loss), stiffness)


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
        state.slope,
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
    return ChainLimits(
        down_slope=np.where(dark, 1.0, down),
        down_offset=np.where(dark, -1.0, -np.where(at_first, size, size * down)),
        up_slope=np.where(dark, 1.0, up),
        up_offset=np.where(dark, 1.0, np.where(at_first, size, size * up)),
        low=np.maximum(problem.lowest_factor, factors - trust),
        high=np.minimum(1.0, factors + trust),
    )


def _within_budget(
    problem: Problem, quadratic: tuple[Array, Array], limits: ChainLimits, state: _State
) -> tuple[Array, float]:
    """Return the chain's minimizer that meets the budget, and the budget's price.

    The budget used falls with the price. Once the price is bracketed, the blend of the two ends that meets
    the budget exactly is feasible too, since the linearized limits are convex.
    """
    curvature, gradient = quadratic
    weights = problem.budget_weights * len(gradient)

    def at(price: float) -> tuple[float, Array, float]:
        x = minimize_chain(curvature, gradient + price * weights, limits)
        return price, x, problem.budget_error(x)

    here = at(state.price)
    if abs(here[2]) < 1e-14:
        return here[1], here[0]
    step = np.copysign(state.price_step, here[2])
    other = at(here[0] + step)
    while here[2] * other[2] > 0:
        if abs(step) > 1e12:  # the budget is at the end of the range that the trust region leaves
            nearest = here if abs(here[2]) < abs(other[2]) else other
            return nearest[1], nearest[0]
        here, step = other, step * 4
        other = at(here[0] + step)
    over, under = (here, other) if here[2] > 0 else (other, here)
    for _ in range(4):
        share = over[2] / (over[2] - under[2])
        if min(over[2], -under[2]) < 1e-9:
            break
        middle = at(over[0] + float(np.clip(share, 0.02, 0.98)) * (under[0] - over[0]))
        over, under = (middle, under) if middle[2] > 0 else (over, middle)
    share = over[2] / (over[2] - under[2]) if over[2] > under[2] else 0.0
    return over[1] + share * (under[1] - over[1]), over[0] + share * (under[0] - over[0])

"""The iteration of the default solver: splitting the objective from the chain.

Two easy problems make up the hard one. For given targets, the factors that come nearest to them within the
rate limit and the budget are a quadratic on a chain, solved exactly in O(N) (`optimizer.chain`), the budget
being one multiplier. For given losses, the ones with less spread near them are a proximal step: a sort and an
isotonic regression, O(N log N); other objectives have one too (`optimizer.objective`). The alternating
direction method of multipliers (ADMM; Boyd et al. 2011, Found. Trends Mach. Learn. 3:1) alternates both and
carries the disagreement in a dual variable, which also certifies the answer (`optimizer.lower_bound`). Loss
curves and rate limit are linearized about the last feasible factors, so at the fixed point they are exact.
`optimizer.splitting` chooses where to start and the stages of the search.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.optimizer.chain import linearized_limits, within_budget
from evenlight.method.optimizer.objective import LEAST_WEIGHT
from evenlight.method.optimizer.optimize import Problem, Solution, feasible_blend, is_feasible

OVER_RELAXATION = 1.6  # Boyd et al. (2011), section 3.4.3: 1.5 to 1.8 converge faster than 1
FLATTEST = 1e-9  # a curve flatter than this gives no direction
NO_SPREAD = 1e-15  # below this, losses differ by rounding alone
DAMPING = 1e-3  # share of the mean curvature that holds frames without a slope where they are
MOST_ITERATIONS = 400  # of one search


@dataclass(frozen=True, slots=True)
class SearchStage:
    """A stage of the search: how far along the loss curves to look, and when to end.

    Measured curves are stairs from close by, where pixels vanish one by one: chords see past a stair, local
    slopes find its edge.
    """

    reach: float  # longest chord, as a difference of factors; 0 takes the local slope
    patience: int  # fruitless iterations after which it ends
    trust: float = 0.15  # largest change of a factor in one iteration
    from_best: bool = False  # whether it begins at the best factors so far, not at the last ones
    # improvement of the objective, as a share of it, below which iterations are fruitless
    worthwhile: float = 1e-6


@dataclass(frozen=True, slots=True)
class SplittingState:
    """Where the iteration (ADMM) stands."""

    factors: Array  # (N,): feasible
    loss: Array  # (N,): at these factors
    target: Array  # (N,): losses with less spread
    dual: Array  # (N,): the scaled dual variable
    stiffness: float  # penalty on the disagreement of losses and targets
    price: float = 0.0  # of the budget
    price_step: float = 1e-3  # how far to search about it
    disagreement: float = 0.0  # primal residual: of losses against targets
    drift: float = 0.0  # dual residual: of the targets against those before


def state_at(problem: Problem, factors: Array, known: Solution | None = None) -> SplittingState:
    """Return the state of feasible factors; the penalty fits the spread that they have.

    Parameters
    ----------
    problem : Problem
        N frames.
    factors : array, (N,)
        Feasible.
    known : Solution, optional
        Where the dual variables come from, else 0.
    """
    loss = problem.loss(factors)
    stiffness = 1 / max(float(np.std(problem.loss(problem.baseline()))), 1e-4)
    dual, price, importance = np.zeros_like(loss), 0.0, problem.frame_importance()
    if known is not None and known.frame_weights is not None:
        dual = known.frame_weights / np.where(importance > 0, importance, LEAST_WEIGHT) / stiffness
        price = known.budget_price
    return SplittingState(factors, loss, loss, dual, stiffness, price)


def search(problem: Problem, state: SplittingState, stages: tuple[SearchStage, ...]) -> Solution:
    """Return the best feasible factors of a series of stages, and the dual variables at its end."""
    best, best_objective = state.factors, problem.value(state.loss)
    iteration = 0
    for stage in stages:
        milestone, since = best_objective, 0
        if stage.from_best:
            state = replace(state, factors=best, loss=problem.loss(best))
        while iteration < MOST_ITERATIONS and best_objective > NO_SPREAD and since < stage.patience:
            iteration += 1
            state = _step(problem, state, stage)
            objective = problem.value(state.loss)
            if objective < best_objective and is_feasible(problem, state.factors):
                best, best_objective = state.factors, objective
            since += 1
            if best_objective < milestone * (1 - stage.worthwhile):
                milestone, since = best_objective, 0
            if iteration % 10 == 0:
                state = rebalanced(state)
    # The weights are about the objective times its size, divided by N; so is the price.
    weights = state.stiffness * problem.frame_importance() * state.dual
    return Solution(best, iteration, weights, state.price)


def _step(problem: Problem, state: SplittingState, stage: SearchStage) -> SplittingState:
    return moved(problem, state, *chained(problem, state, pull(problem, state, stage), stage))


def pull(problem: Problem, state: SplittingState, stage: SearchStage) -> tuple[Array, Array]:
    """Return the curvature and the linear part of what draws the factors to the targets, (N,) each."""
    wanted, slope = factors_at_targets(problem, state.factors, state.target - state.dual, stage.reach)
    stiff = state.stiffness * slope**2 * problem.frame_importance()
    return stiff, -stiff * wanted


def chained(
    problem: Problem, state: SplittingState, drawn: tuple[Array, Array], stage: SearchStage
) -> tuple[Array, float]:
    """Return the feasible factors that a pull leads to, (N,), and the price of the budget there."""
    stiff, gradient = drawn
    damping = DAMPING * float(np.mean(stiff)) + 1e-9
    quadratic = stiff + damping, gradient - damping * state.factors
    limits = linearized_limits(problem, state.factors, stage.trust)
    factors, price = within_budget(problem, quadratic, limits, (state.price, state.price_step))
    return feasible_blend(problem, np.clip(factors, problem.lowest_factor, 1.0)), price


def moved(
    problem: Problem, state: SplittingState, factors: Array, price: float, counted: float = 1.0
) -> SplittingState:
    """Return the state after factors and price have moved; its objective counts so much."""
    loss = problem.loss(factors)
    mixed = OVER_RELAXATION * loss + (1 - OVER_RELAXATION) * state.target + state.dual
    target = problem.minimized.proximal(mixed, counted / (state.stiffness * len(loss)), problem.importance)
    return SplittingState(
        factors=factors,
        loss=loss,
        target=target,
        dual=mixed - target,
        stiffness=state.stiffness,
        price=price,
        price_step=max(abs(price - state.price), 1e-9),
        disagreement=float(np.linalg.norm(loss - target)),
        drift=float(np.linalg.norm(target - state.target)),
    )


def factors_at_targets(problem: Problem, factors: Array, targets: Array, reach: float) -> tuple[Array, Array]:
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
    slope = np.where(np.abs(slope) < FLATTEST, -FLATTEST, slope)
    return start + np.clip((targets - problem.loss(start)) / slope, -1.0, 1.0), slope


def rebalanced(state: SplittingState) -> SplittingState:
    """Return the state with a stiffer or softer penalty where one residual is far above the other."""
    if state.disagreement > 5 * state.drift:
        scale = 2.0
    elif state.drift > 5 * state.disagreement:
        scale = 0.5
    else:
        return state
    return replace(state, dual=state.dual / scale, stiffness=state.stiffness * scale)

"""A lower bound on the spread of contrast loss, or another objective, of any track within the limits.

The pair sum is a maximum of linear functions: Σ_{i<j} |u_i - u_j| = max over w of Σ w_i u_i, w in the
permutahedron of the order weights; the other objectives have sets of w of their own (`Objective`). So for
*any* such w, and any price ν of the budget,

    min over tracks of the pair sum  >=  min over chains of Σ [w_i 𝓛_i(b_i) + ν a_i b_i] - ν · budget,

where chains obey the rate limit and the bounds but no budget. That minimum is found globally, although the
problem is not convex, by dynamic programming over cells of the factor (`optimizer.cell_chain`). Every
rounding goes the safe way. The solver's dual variables make the bound a good one; a poor w makes it poor,
never wrong: it is projected on the set first. They fit the slopes of the loss curves at the answer,
while the minimum is over the whole curves: a few iterations of the splitting along chords give a second w,
which fits curves with many stairs better. It is tried where the first falls short, and the better bound is
taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.optimizer.cell_chain import (
    ChainCosts,
    FrameBlocks,
    RateTable,
    cheapest_chain,
    make_blocks,
)
from evenlight.method.optimizer.optimize import BUDGET_TOLERANCE, Problem, Solution, is_feasible
from evenlight.method.optimizer.splitting_search import SearchStage, search, state_at
from evenlight.method.rate_limit import step_luminance

CELLS_PER_FRAME = 1000  # frames times cells, over frames: what one evaluation costs
LEAST_VISITS = 4_000_000  # short clips can afford more
CELLS_PER_KNOT = 200  # at most
CELLS_PER_BLOCK = 8.0  # cells that the factor may cross within a block
ALONG_CHORDS = (SearchStage(1.0, 4),)  # iterations from the answer that lead to the second w
ENOUGH = 0.9  # share of the objective: a bound as good as that needs no second w
TRIALS = 9  # evaluations to find the best price
GOOD_ENOUGH = 2e-3  # share of the objective that a better price could still add
ROUNDING_OF_LOSS = 1e-10  # of a mean difference of losses up to 1, summed over up to a million frames
RATE_MARGIN = 1.005  # covers what the rate limit does between the points where it is evaluated
ROUNDING = 1e-12  # share of the summed costs that is given away to rounding
NO_LIGHT = 1e-9  # [cd/m^2] a step between frames darker than this is taken as free
BINS = 4096  # of luminance, in equal ratios
DARKEST = 1e-7  # share of the brightest frame's luminance below which all is one bin


def lower_bound(problem: Problem, solution: Solution) -> float:
    """Return a value of the objective that no track within the limits can go below.

    Parameters
    ----------
    problem : Problem
        N frames.
    solution : Solution
        An answer, with the solver's dual variables if it has any; else the order of its losses is used.

    Returns
    -------
    float
        At least 0; the difference to the solution's objective bounds how much better any track could be.
    """
    n, size = problem.curves.n_frames, problem.size()
    if not size > 0:
        return 0.0
    near = problem.objective(problem.baseline()) - _gain_near_baseline(problem) / size
    if near >= (1 - GOOD_ENOUGH) * problem.objective(solution.factors):
        return float(max(near, 0.0))
    relaxation = _Relaxation.of(problem, dual_weights(problem, solution))
    slopes = np.abs(loss_and_slope(problem.curves, solution.factors)[1])
    scale = max(float((slopes * np.abs(relaxation.weights)).mean()) * n, 1e-9)
    price = float(np.clip(solution.budget_price * n, -100 * scale, 100 * scale))
    objective = problem.objective(solution.factors) * size / n
    hair, known = GOOD_ENOUGH * objective, max(near, 0.0) * size / n
    best = _best_over_prices(relaxation, price, scale / 16, TRIALS, hair, known)
    if best.value < ENOUGH * objective and is_feasible(problem, solution.factors):
        state = state_at(problem, solution.factors, solution)
        other = dual_weights(problem, search(problem, state, ALONG_CHORDS))
        again = replace(relaxation, weights=other)
        second = _best_over_prices(again, best.price, scale / 64, TRIALS // 3, hair, known)
        best = max(best, second, key=lambda tangent: tangent.value)
    return float(max(best.value * n / size, near, 0.0))


def checked_bound(bound: float, value: float, rounding: float = ROUNDING_OF_LOSS) -> float:
    """Return a lower bound, once it is checked to be one; it may be above the value by rounding.

    Raises
    ------
    RuntimeError
        If it is above by more: a defect of the bound or of the value.
    """
    if bound > value + rounding:
        raise RuntimeError(f"the lower bound {bound:.12g} is above {value:.12g}, which an answer has")
    return min(bound, value)


def _gain_near_baseline(problem: Problem) -> float:
    """Return what size times the objective can lose, at most, to tracks that are all near constant dimming.

    Where the budget is at the end of the range, a frame that leaves the end takes its share in the budget,
    and moves its loss by the steepest chord of its curve at most; the best frame to spend the tolerance on
    gains the most. Where the rate limit allows no change, every frame stays with the baseline.
    """
    curves, weights = problem.curves, problem.minimized.largest_weights(problem.frame_importance())
    low, baseline = problem.lowest_factor, problem.baseline_factor
    end, hair = (low, baseline - low) if baseline - low < 1 - baseline else (1.0, 1 - baseline)
    steep = weights * _steepest_chord(curves, end)
    with np.errstate(divide="ignore"):
        dearest = (steep[steep > 0] / problem.budget_weights[steep > 0]).max(initial=0.0)
    from_end = float(dearest) * (BUDGET_TOLERANCE + 2 * hair)
    way = BUDGET_TOLERANCE + float(_largest_steps(problem)[0].sum())
    return min(from_end, float(weights @ _steepest_chord(curves, baseline)) * way)


def _steepest_chord(curves: LossCurves, factor: float) -> Array:
    inner = curves.factors != factor
    there = loss_and_slope(curves, np.full(curves.n_frames, factor))[0][:, None]
    way = np.abs(curves.factors[inner] - factor)
    return np.asarray((np.abs(curves.loss[:, inner] - there) / way).max(axis=1))


def dual_weights(problem: Problem, solution: Solution) -> Array:
    """Return w for which Σ w · loss is at most size times the objective over N, whatever the losses, (N,).

    What a proximal step takes away from a point is that point's projection on the set of w / N (Moreau).
    """
    importance, objective = problem.frame_importance(), problem.minimized
    n = len(importance)
    if solution.frame_weights is None:
        return np.asarray(objective.frame_weights(problem.loss(solution.factors), importance) / n)
    counts = importance > 0
    density = solution.frame_weights[counts] / importance[counts]
    weights = np.zeros(n)
    moved = density - objective.proximal(density, 1 / n, importance[counts])
    weights[counts] = moved * importance[counts]
    return weights


class _Tangent(NamedTuple):
    """The bound at a price, and its slope there."""

    price: float
    value: float
    slope: float


def bound_of_costs(problem: Problem, costs: Array, price: float, known: float) -> float:
    """Return what the costs of all frames together cannot be below, on any track within the limits.

    Parameters
    ----------
    problem : Problem
        N frames; their losses do not count.
    costs : array, (N, K)
        Of each frame at each knot of the loss curves, linear between them.
    price : float
        Of the budget, where to begin: how much the costs fall per unit of the mean factor.
    known : float
        The costs of a track at hand, which says how good a price is good enough.
    """
    n, knots = problem.curves.n_frames, problem.curves.factors
    least = costs.min(axis=1, keepdims=True)
    scale = max(float((costs - least).max()), np.finfo(float).tiny)
    shares = replace(problem.curves, loss=np.clip((costs - least) / scale, 0.0, 1.0), bends=None)
    relaxation = _Relaxation.of(replace(problem, curves=shares), np.full(n, scale))
    step = float(np.abs(np.diff(costs, axis=1) / np.diff(knots)).mean()) * n / 16
    best = _best_over_prices(relaxation, price, max(step, 1e-9), TRIALS, GOOD_ENOUGH * abs(known))
    rounding = ROUNDING * float(np.abs(costs).max(axis=1).sum())
    return best.value + float(least.sum()) - rounding


def _best_over_prices(
    relaxation: _Relaxation, price: float, step: float, trials: int, hair: float, known: float = -np.inf
) -> _Tangent:
    """Return the best bound found over the price of the budget, or one less good by a hair.

    The search also ends once no price can lead above a bound that is known: what it found may be lower.

    The bound is concave in the price, and its slope is what its chain uses above the budget. The price to try
    next is where the tangents from both sides meet, and no price can lift the bound above that point.
    """
    best = at = relaxation.bound(price)
    dear: _Tangent | None = None  # slope at most 0
    cheap: _Tangent | None = None
    for _ in range(trials - 1):
        if at.slope > 0:
            cheap = at
        else:
            dear = at
        if dear is None or cheap is None:
            price, step = at.price + np.copysign(step, at.slope), step * 4
        else:
            if cheap.slope - dear.slope <= 1e-12:
                break
            ahead = dear.value - cheap.value - dear.slope * (dear.price - cheap.price)
            ahead /= cheap.slope - dear.slope
            if cheap.value + cheap.slope * ahead <= max(best.value + hair, known):
                break
            width = dear.price - cheap.price
            price = cheap.price + float(np.clip(ahead, 0.02 * width, 0.98 * width))
        at = relaxation.bound(price)
        best = at if at.value > best.value else best
    return best


@dataclass(frozen=True, slots=True)
class _Relaxation:
    """What the dynamic program needs, whatever the price."""

    problem: Problem
    weights: Array  # (N,): w of each frame
    rates: RateTable  # of the rate limit
    reach: Array  # (N-1,): change of the factor per rate; infinite where a step is free
    blocks: FrameBlocks  # of frames
    per_knot: int  # cells between two knots

    @classmethod
    def of(cls, problem: Problem, weights: Array) -> _Relaxation:
        """Return the relaxation of a problem for given weights."""
        knots, n = problem.curves.factors, problem.curves.n_frames
        largest, reach, rates = _largest_steps(problem)
        span = float(knots[-1] - knots[0])
        visits = max(CELLS_PER_FRAME * n, LEAST_VISITS)
        limited = largest[largest < span]
        moved = float(np.sum(limited))
        # Blocks so long that their number times the number of cells is what may be visited.
        target = float(np.sqrt(CELLS_PER_BLOCK * moved * span / visits))
        blocks = FrameBlocks(*make_blocks(largest, target, float(np.diff(knots).min())))
        cells = visits / len(blocks.anchor) / (len(knots) - 1)
        return cls(problem, weights, rates, reach, blocks, int(np.clip(round(cells), 1, CELLS_PER_KNOT)))

    def bound(self, price: float) -> _Tangent:
        """Return the bound on size times the objective over N, and its slope, at a price of the budget."""
        problem = self.problem
        curves, baseline = problem.curves, problem.baseline_factor
        costs = ChainCosts(curves.loss, self.weights, problem.budget_weights, price, curves.factors)
        least, used = cheapest_chain(costs, self.rates, self.reach, self.blocks, self.per_knot)
        # What tracks may gain that meet the budget only to their tolerance, and by rounding.
        allowance = abs(price) * BUDGET_TOLERANCE
        allowance += ROUNDING * (float(np.abs(self.weights).sum()) + 2 * abs(price))
        return _Tangent(price, least - price * baseline - allowance, used - baseline)


def _largest_steps(problem: Problem) -> tuple[Array, Array, RateTable]:
    """Return the largest change of the factor in each step, its reach per rate, and the rate limits."""
    knots, reach = problem.curves.factors, problem.step_reach()
    reach[step_luminance(problem.luminance) < NO_LIGHT] = np.inf
    rates, highest = _rate_table(problem)
    with np.errstate(invalid="ignore", over="ignore"):  # 0 times infinity: a free step
        largest = reach * np.minimum(highest[:-1], highest[1:])
    span = float(knots[-1] - knots[0])
    return np.where(np.isinf(reach), span, np.minimum(largest, span)), reach, rates


def _rate_table(problem: Problem) -> tuple[RateTable, Array]:
    """Return an upper envelope of the rate limit, and each frame's largest rate limit at any factor."""
    luminance, knots = problem.luminance, problem.curves.factors
    most = max(float(luminance.max()), np.finfo(float).tiny)
    least = max(most * DARKEST, float(np.min(luminance[luminance > 0], initial=most)) * knots[0])
    # Bins from the darkest luminance that any frame can have to the brightest; the first holds all below.
    step = max(np.log(most / least), 1e-9) / (BINS - 1)
    points = least * np.exp(step * np.arange(2 * BINS + 1) / 2)
    inside = _largest_in_bins(problem.rate_limit(points))
    below = _largest_in_bins(problem.rate_limit(np.linspace(0.0, least, 2 * 64 + 1))).max()
    envelope = np.maximum(np.append(below, inside), 0.0)
    with np.errstate(divide="ignore"):
        place = np.maximum(np.log(luminance / least), -1e9) / step + 1
    offset = np.log(knots) / step
    widest = int(np.ceil(np.diff(offset).max())) + 1
    table = RateTable(_largest_ahead(envelope, widest), np.maximum(place, -1e9), offset[:-1])
    bins = np.arange(len(envelope))
    start = np.clip(np.floor(place + offset[0]), 0, bins[-1]).astype(int)
    whole = _largest_ahead(envelope, int(np.ceil(-offset[0])) + 1)
    return table, np.where(luminance > 0, whole[start], below)


def _largest_in_bins(rates: Array) -> Array:
    """Return what a rate limit does not exceed within bins, from values at their ends and middles."""
    first, middle, last = rates[:-1:2], rates[1::2], rates[2::2]
    bulge = np.abs(first - 2 * middle + last)
    return np.asarray((np.maximum(np.maximum(first, last), middle) + bulge) * RATE_MARGIN)


def _largest_ahead(values: Array, places: int) -> Array:
    """Return the largest of each value and some that follow it."""
    padded = np.append(values, np.full(min(places, len(values)), values[-1]))
    windows = np.lib.stride_tricks.sliding_window_view(padded, min(places, len(values)) + 1)
    return np.asarray(windows.max(axis=1))

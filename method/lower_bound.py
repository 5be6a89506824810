"""A lower bound on the spread of contrast loss that any track within the limits must have.

The pair sum is a maximum of linear functions: Σ_{i<j} |u_i - u_j| = max over w of Σ w_i u_i, w in the
permutahedron of the order weights. So for *any* such w, and any price ν of the budget,

    min over tracks of the pair sum  >=  min over chains of Σ [w_i 𝓛_i(b_i) + ν a_i b_i] - ν · budget,

where chains obey the rate limit and the bounds but no budget. That minimum is found globally, although the
problem is not convex, by dynamic programming over cells of the factor. Every rounding goes the safe way: a
cell costs the least that any factor in it costs, and a step between two cells is allowed if any two factors
in them may follow each other. The solver's dual variables make the bound a good one; a poor w makes it poor,
never wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from method.curve_lookup import loss_and_slope
from method.modulation import step_luminance
from method.objective import order_weights
from method.optimize import BUDGET_TOLERANCE, Problem, Solution

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

CELL_VISITS = 4_000_000  # frames times cells: the memory of the rate limits, and 0.1 s for one evaluation
CELLS_PER_KNOT = 200  # at most
TRIALS = 12  # evaluations to find the best price
RATE_MARGIN = 1.005  # covers what the rate limit does between the points of a cell where it is evaluated
ROUNDING = 1e-12  # share of the summed costs that is given away to rounding
NO_LIGHT = 1e-9  # [cd/m^2] a step between frames darker than this is taken as free


def lower_bound(problem: Problem, solution: Solution) -> float:
    """Return a mean absolute pairwise difference of loss that no track within the limits can go below.

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
    n = problem.curves.n_frames
    if n < 2:
        return 0.0
    if _only_the_baseline_fits(problem):
        return problem.objective(problem.baseline())
    weights = solution.frame_weights
    if weights is None:
        weights = np.empty(n)
        weights[np.argsort(problem.loss(solution.factors), kind="stable")] = order_weights(n) / n
    slope = np.abs(loss_and_slope(problem.curves, solution.factors)[1] * weights)
    scale = max(float(slope.mean()) * n, 1e-9)
    price = float(np.clip(solution.budget_price * n, -100 * scale, 100 * scale))
    return max(_best_over_prices(_Relaxation.of(problem, weights), price, scale / 4) * 2 / (n - 1), 0.0)


def _only_the_baseline_fits(problem: Problem) -> bool:
    """Return whether the budget leaves no choice: every frame that counts must be at the end of its range."""
    at_end = problem.baseline_factor in (problem.lowest_factor, 1.0)
    return at_end and bool((problem.budget_weights > 0).all())


def _best_over_prices(relaxation: _Relaxation, price: float, step: float) -> float:
    """Return the best bound found over the price of the budget, in which the bound is concave."""
    best, trials = relaxation.bound(price), 1
    while trials < TRIALS:
        for other in (price + step, price - step):
            value = relaxation.bound(other)
            trials += 1
            if value > best:
                best, price, step = value, other, step * 1.5
                break
        else:
            step /= 3
    return best


@dataclass(frozen=True, slots=True)
class _Relaxation:
    """What the dynamic program needs, whatever the price: all but the cost of the budget.

    Attributes
    ----------
    loss, weights : array, (N, K) and (N,)
        Loss curves, and their weights w.
    excess : array, (N, K)
        Share of the budget that a frame uses above the baseline, at each knot.
    edges, per_knot : array, (C+1,), int
        Of the cells of the factor, and how many lie between two knots.
    rates : array, (N, C)
        No rate limit within a cell is above this [cd/m^2/s].
    reach : array, (N-1,)
        Change of the factor per rate; infinite where a step is free.
    """

    loss: Array
    weights: Array
    excess: Array
    edges: Array
    per_knot: int
    rates: Array
    reach: Array

    @classmethod
    def of(cls, problem: Problem, weights: Array) -> _Relaxation:
        """Return the relaxation of a problem for given weights."""
        curves = problem.curves
        segments = len(curves.factors) - 1
        per_knot = int(np.clip(round(CELL_VISITS / curves.n_frames / segments), 1, CELLS_PER_KNOT))
        # Points within a cell are every half of it.
        position = np.arange(2 * segments * per_knot + 1) / (2 * per_knot)
        points = np.interp(position, np.arange(segments + 1), curves.factors)
        rates = np.empty((curves.n_frames, segments * per_knot))
        for i, luminance in enumerate(problem.luminance):
            rate = problem.rate_limit(points * luminance)
            first, middle, last = rate[:-1:2], rate[1::2], rate[2::2]
            bulge = np.abs(first - 2 * middle + last)
            rates[i] = (np.maximum(np.maximum(first, last), middle) + bulge) * RATE_MARGIN
        middle = step_luminance(problem.luminance)
        dark = middle < NO_LIGHT
        reach = np.where(dark, np.inf, curves.durations[:-1] / np.where(dark, 1.0, middle))
        excess = problem.budget_weights[:, None] * (curves.factors - problem.baseline_factor)
        return cls(curves.loss, weights, excess, points[::2], per_knot, rates, reach)

    def bound(self, price: float) -> float:
        """Return the bound on the pair sum divided by N, at a price of the budget."""
        costs = self.weights[:, None] * self.loss + price * self.excess
        # What tracks may gain that meet the budget only to their tolerance, and by rounding.
        allowance = abs(price) * BUDGET_TOLERANCE / 1000
        allowance += ROUNDING * float(np.abs(costs).max(axis=1).sum())
        return float(_cheapest_chain(costs, self.edges, self.per_knot, self.rates, self.reach)) - allowance


@numba.njit(cache=True, error_model="numpy")
def _cell_costs(costs: Array, knots: Array, per_knot: int) -> None:
    """Write the least cost within each cell; within one it is linear, so at an edge."""
    for knot in range(len(knots) - 1):
        slope = (knots[knot + 1] - knots[knot]) / per_knot
        for k in range(per_knot):
            costs[knot * per_knot + k] = knots[knot] + slope * k + min(0.0, slope)


@numba.njit(cache=True, error_model="numpy")
def _windows(lowest: Cells, highest: Cells, edges: Array, first: Array, second: Array, reach: float) -> None:
    """Write the lowest and the highest cell that may follow each cell; `first` and `second` are rate limits.

    A step must keep the limits at both its ends. All four conditions are first made rising from cell to cell,
    by the running maximum or minimum on the side that allows more, so that what follows a cell is one stretch
    and the stretches rise: a limit with a dip may allow more than it should, never less.
    """
    cells = len(lowest)
    top, follow, end = -np.inf, 0, cells - 1
    bottom_ahead = np.empty(cells)  # least factor from which some cell at or above this one is reached
    least = np.inf
    for cell in range(cells - 1, -1, -1):
        least = min(least, edges[cell] - reach * second[cell])
        bottom_ahead[cell] = least
    for cell in range(cells):
        top = max(top, edges[cell + 1] + reach * first[cell])
        follow = max(follow, cell)
        while follow < end and edges[follow + 1] <= top and bottom_ahead[follow + 1] <= edges[cell + 1]:
            follow += 1
        highest[cell] = follow
    top_behind = np.empty(cells)  # largest factor from which some cell at or below this one is reached
    most = -np.inf
    for cell in range(cells):
        most = max(most, edges[cell + 1] + reach * second[cell])
        top_behind[cell] = most
    bottom, follow = np.inf, cells - 1
    for cell in range(cells - 1, -1, -1):
        bottom = min(bottom, edges[cell] - reach * first[cell])
        follow = min(follow, cell)
        while follow > 0 and edges[follow] >= bottom and top_behind[follow - 1] >= edges[cell]:
            follow -= 1
        lowest[cell] = follow


@numba.njit(cache=True, error_model="numpy")
def _cheapest_chain(knots: Array, edges: Array, per_knot: int, rates: Array, reach: Array) -> float:
    """Return the least Σ of cell costs over all chains of cells: a sliding minimum for each frame."""
    cells = len(edges) - 1
    value, following, cost = np.empty(cells), np.empty(cells), np.empty(cells)
    lowest, highest = np.zeros(cells, np.int64), np.empty(cells, np.int64)
    queue = np.empty(cells, np.int64)
    _cell_costs(value, knots[0], per_knot)
    for i in range(1, len(knots)):
        _cell_costs(cost, knots[i], per_knot)
        if np.isinf(reach[i - 1]):
            lowest[:], highest[:] = 0, cells - 1
        else:
            _windows(lowest, highest, edges, rates[i - 1], rates[i], reach[i - 1])
        head, tail, entering = 0, 0, 0
        for cell in range(cells):
            while entering < cells and lowest[entering] <= cell:
                while tail > head and value[queue[tail - 1]] >= value[entering]:
                    tail -= 1
                queue[tail] = entering
                tail += 1
                entering += 1
            while highest[queue[head]] < cell:
                head += 1
            following[cell] = value[queue[head]] + cost[cell]
        value, following = following, value
    return float(value.min())

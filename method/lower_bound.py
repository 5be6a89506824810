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

import numba
import numpy as np
from numpy.typing import NDArray

from method.modulation import step_luminance
from method.optimize import Problem, Solution

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

CELL_VISITS = 4_000_000  # frames times cells of one evaluation: about 0.1 s
PRICE_TRIALS = 8
TABLE_SIZE = 20_000
RATE_MARGIN = 1.0005  # covers what the rate limit does between two nodes of its table


def lower_bound(problem: Problem, solution: Solution) -> float:
    """Return a mean absolute pairwise difference of loss that no track within the limits can go below.

    Parameters
    ----------
    problem : Problem
        N frames.
    solution : Solution
        With the solver's dual variables; without them the bound is 0.

    Returns
    -------
    float
        At least 0; the difference to the solution's objective bounds how much better any track could be.
    """
    n = problem.curves.n_frames
    if n < 2 or solution.frame_weights is None:
        return 0.0
    weights = solution.frame_weights
    # In the price the bound is concave, and the solver's price is near its best.
    price, stretch = solution.budget_price * n, 1.25
    best = _bound(problem, weights, price)
    for _ in range(PRICE_TRIALS):
        moved = _bound(problem, weights, price * stretch)
        if moved > best:
            best, price = moved, price * stretch
        else:
            stretch = 1 / stretch if stretch > 1 else 1 / np.sqrt(stretch)
    return max(best * 2 / (n - 1), 0.0)


def _bound(problem: Problem, weights: Array, price: float) -> float:
    """Return the bound on the pair sum divided by N, for given weights and price."""
    curves = problem.curves
    segments = len(curves.factors) - 1
    per_knot = int(np.clip(round(CELL_VISITS / curves.n_frames / segments), 1, 200))
    position = np.arange(segments * per_knot + 1) / per_knot
    edges = np.interp(position, np.arange(segments + 1), curves.factors)
    top = max(float(problem.luminance.max()), 1e-9)
    table = problem.rate_limit(np.linspace(0.0, top, TABLE_SIZE + 1))
    middle = step_luminance(problem.luminance)
    reach = curves.durations[:-1] / np.maximum(middle, 1e-12)
    least = _cheapest_chain(
        (curves.loss, weights, price * problem.budget_weights),
        (edges, per_knot),
        (problem.luminance, reach, table * RATE_MARGIN, TABLE_SIZE / top),
    )
    return least - price * problem.baseline_factor


@numba.njit(cache=True)
def _table_value(table: Array, position: float) -> float:
    """Return a table's value between two nodes."""
    index = min(int(position), len(table) - 2)
    value: float = table[index] + (position - index) * (table[index + 1] - table[index])
    return value


@numba.njit(cache=True)
def _cell_rates(rates: Array, edges: Array, luminance: float, table: Array, scale: float) -> None:
    """Write the largest rate limit within each cell, for one frame."""
    before = _table_value(table, edges[0] * luminance * scale)
    for cell in range(len(rates)):
        after = _table_value(table, edges[cell + 1] * luminance * scale)
        rates[cell] = max(before, after)
        before = after


@numba.njit(cache=True)
def _cell_costs(costs: Array, loss: Array, weight: float, fee: float, edges: Array, per_knot: int) -> None:
    """Write the least cost within each cell; within one it is linear, so at an edge."""
    for knot in range(len(loss) - 1):
        first, last = knot * per_knot, (knot + 1) * per_knot
        low = weight * loss[knot] + fee * edges[first]
        high = weight * loss[knot + 1] + fee * edges[last]
        slope = (high - low) / per_knot
        for k in range(per_knot):
            costs[first + k] = low + slope * k + min(0.0, slope)


@numba.njit(cache=True)
def _windows(lowest: Cells, highest: Cells, edges: Array, first: Array, second: Array, reach: float) -> None:
    """Write the lowest and highest cell that may follow each cell; `first` and `second` are rate limits.

    Both are kept rising from cell to cell, which may allow too much, never too little.
    """
    cells = len(lowest)
    follow = 0
    for cell in range(cells):
        follow = max(follow, cell)
        while follow + 1 < cells and edges[follow + 1] <= edges[cell + 1] + reach * min(
            first[cell], second[follow + 1]
        ):
            follow += 1
        highest[cell] = follow
    follow = cells - 1
    for cell in range(cells - 1, -1, -1):
        follow = min(follow, cell)
        while follow > 0 and edges[follow] >= edges[cell] - reach * min(first[cell], second[follow - 1]):
            follow -= 1
        lowest[cell] = follow


@numba.njit(cache=True)
def _cheapest_chain(
    costs: tuple[Array, Array, Array],
    grid: tuple[Array, int],
    limits: tuple[Array, Array, Array, float],
) -> float:
    """Return the least Σ of cell costs over all chains of cells: a sliding minimum for each frame."""
    loss, weights, fees = costs
    edges, per_knot = grid
    luminance, reach, table, scale = limits
    cells = len(edges) - 1
    value, following, cost = np.zeros(cells), np.empty(cells), np.empty(cells)
    first, second = np.empty(cells), np.empty(cells)
    lowest, highest = np.zeros(cells, np.int64), np.empty(cells, np.int64)
    queue = np.empty(cells, np.int64)
    _cell_costs(value, loss[0], weights[0], fees[0], edges, per_knot)
    _cell_rates(second, edges, luminance[0], table, scale)
    for i in range(1, len(loss)):
        first, second = second, first
        _cell_rates(second, edges, luminance[i], table, scale)
        _cell_costs(cost, loss[i], weights[i], fees[i], edges, per_knot)
        if luminance[i - 1] + luminance[i] <= 0.0:  # a step between black frames is free
            lowest[:], highest[:] = 0, cells - 1
        else:
            _windows(lowest, highest, edges, first, second, reach[i - 1])
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

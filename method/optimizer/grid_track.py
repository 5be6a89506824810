"""The cheapest track through a grid of factors that keeps the rate limit and uses the budget.

Each frame has a few factors to choose from, and each choice a cost of its own. Of all tracks within the rate
limit the cheapest is found by dynamic programming (Viterbi 1967, IEEE Trans. Inf. Theory 13:260). The budget
is part of the state: what has been used so far, in bins. A price for it would not do, for where costs are
not convex the tracks on either side of a price miss the budget by far, and to mend that spoils them. The
cells that may come before a cell lie in a window that moves on with it, so that the least of them is kept in
a queue, and a frame takes time in proportion to cells times bins, however far a step may go.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array

Places = NDArray[np.int64]
Origins = NDArray[np.int32]

SPARE = 2  # bins on either side of what is needed
LEAST_BIN = 1e-12  # of the sum of factors, where all cells use the same


class GridCells(NamedTuple):
    """What each of N frames may choose from."""

    factors: Array  # (N, K): b, rising along each row
    used: Array  # (N, K): what each adds to what the track uses beyond the budget, rising along each row too
    limit: Array  # (N, K): rate limit at each of them [cd/m^2/s]
    reach: Array  # (N-1,): change of the factor per rate limit of each step; infinite where it is free


class BudgetBins(NamedTuple):
    """Bins of what has been used beyond the budget, from which the remaining frames can still meet it."""

    start: Array  # (N,): where the first bin starts, after each frame
    number: Places  # (N,): how many there are
    size: float  # of each


class CheapestWays(NamedTuple):
    """The cheapest way to each cell of a frame, for each bin."""

    cost: Array  # (bins, K): what it costs; infinite where there is none
    used: Array  # (bins, K): what it has used beyond the budget, exactly


class GridStep(NamedTuple):
    """How the ways to a frame go on from the frame before."""

    first: Places  # (K,): first cell of the frame before from which each cell may be reached
    last: Places  # (K,): and the last of them
    cost: Array  # (K,): of each cell
    used: Array  # (K,): of each cell
    start: float  # where the bins after this frame begin
    number: int  # how many there are
    size: float  # of each


def cheapest_track(cost: Array, cells: GridCells, bins: int) -> Places | None:
    """Return the cells of the cheapest track within the rate limit of both ends of each step, (N,).

    It misses the budget by a few bins at most. Tracks that lead to one cell and use as much but for a bin are
    held for one, of which the cheaper is kept. A step from one cell to another counts as too long if one from
    a cell on the way, or to it, would be: such steps are left out where the rate limit changes faster with
    the factor than the step that it allows.

    Parameters
    ----------
    cost : array, (N, K)
        Of each cell.
    cells : GridCells
        At least 1 frame.
    bins : int
        How many to tell apart.

    Returns
    -------
    array, (N,), or None
        None where no track uses the budget.

    >>> used = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    >>> cells = GridCells(used / 2 + 0.5, used, np.ones((2, 2)), np.array([np.inf]))
    >>> cheapest_track(np.array([[0.0, 5.0], [0.0, 2.0]]), cells, 4)
    array([0, 1])
    """
    if cells.used[:, 0].sum() > LEAST_BIN or cells.used[:, -1].sum() < -LEAST_BIN:
        return None  # even the lowest cells use too much, or the highest too little
    track = _cheapest(cost, cells, bins_within(cells.used, bins))
    return track if track[0] >= 0 else None


def bins_within(used: Array, bins: int) -> BudgetBins:
    """Return the bins of what may be used beyond the budget after each frame, for 0 to be met at the end.

    Parameters
    ----------
    used : array, (N, K)
        By each cell, rising along each row.
    bins : int
        How many, where they reach furthest.
    """
    least, most = used[:, 0].cumsum(), used[:, -1].cumsum()
    low = np.maximum(least, most - most[-1])
    width = np.maximum(np.minimum(most, least - least[-1]) - low, 0.0)
    size = max(float(width.max()) / bins, LEAST_BIN)
    return BudgetBins(low - SPARE * size, (width / size).astype(np.int64) + 2 * SPARE + 1, size)


@numba.njit(cache=True, error_model="numpy")
def _cheapest(cost: Array, cells: GridCells, bins: BudgetBins) -> Places:
    """See `cheapest_track`: fronts forward, the track backward; cells of -1 where there is no track."""
    n, width = cost.shape
    came = np.empty((n, bins.number.max(), width), dtype=np.int32)
    before = CheapestWays(np.full(came.shape[1:], np.inf), np.zeros(came.shape[1:]))
    after = CheapestWays(np.full(came.shape[1:], np.inf), np.zeros(came.shape[1:]))
    for k in range(width):
        place = int((cells.used[0, k] - bins.start[0]) / bins.size)
        if cells.used[0, k] >= bins.start[0] and place < bins.number[0]:
            before.cost[place, k], before.used[place, k] = cost[0, k], cells.used[0, k]
    for i in range(1, n):
        first, last = _windows(cells, i)
        choice = GridStep(first, last, cost[i], cells.used[i], bins.start[i], bins.number[i], bins.size)
        after.cost[: bins.number[i]] = np.inf
        for place in range(bins.number[i - 1]):
            _extend(before, place, choice, after, came[i])
        before, after = after, before
    return _traced(before.cost[: bins.number[n - 1]], came)


@numba.njit(cache=True, error_model="numpy")
def _windows(cells: GridCells, i: int) -> tuple[Places, Places]:
    """Return the first and the last cell of the frame before from which each cell of frame i may be reached.

    Both move on from cell to cell, as a queue needs them: so a step is left out if one from a cell on the
    way, or to it, would be too long.
    """
    before, after, reach = cells.factors[i - 1], cells.factors[i], cells.reach[i - 1]
    count = len(before)
    first, last = np.zeros(count, dtype=np.int64), np.full(count, count - 1, dtype=np.int64)
    if reach == np.inf:
        return first, last
    up, down = before + reach * cells.limit[i - 1], before - reach * cells.limit[i - 1]
    lowest, highest = after - reach * cells.limit[i], after + reach * cells.limit[i]
    for k in range(1, count):
        down[k], lowest[k] = max(down[k], down[k - 1]), max(lowest[k], lowest[k - 1])
        back = count - 1 - k
        up[back], highest[back] = min(up[back], up[back + 1]), min(highest[back], highest[back + 1])
    start, end = 0, 0
    for k in range(count):
        while start < count and (before[start] < lowest[k] or up[start] < after[k]):
            start += 1
        while end < count and before[end] <= highest[k] and down[end] <= after[k]:
            end += 1
        first[k], last[k] = start, end - 1
    return first, last


@numba.njit(cache=True, error_model="numpy")
def _extend(before: CheapestWays, place: int, choice: GridStep, after: CheapestWays, came: Origins) -> None:
    """Extend the ways of one bin by a frame: those that may yet be the least of a window wait."""
    row, used = before.cost[place], before.used[place]
    cells = len(row)
    queue = np.empty(cells, dtype=np.int64)
    head, tail, seen = 0, 0, 0
    for k in range(cells):
        while seen <= choice.last[k]:
            if row[seen] < np.inf:
                while tail > head and row[queue[tail - 1]] >= row[seen]:
                    tail -= 1
                queue[tail] = seen
                tail += 1
            seen += 1
        while head < tail and queue[head] < choice.first[k]:
            head += 1
        if head == tail:
            continue
        origin = queue[head]
        total, cost = used[origin] + choice.used[k], row[origin] + choice.cost[k]
        to = int((total - choice.start) / choice.size)
        if total >= choice.start and to < choice.number and cost < after.cost[to, k]:
            after.cost[to, k], after.used[to, k] = cost, total
            came[to, k] = place * cells + origin


@numba.njit(cache=True, error_model="numpy")
def _traced(cost: Array, came: Origins) -> Places:
    """Return the cells of the cheapest way to the last frame; -1 where there is none."""
    n, width = len(came), cost.shape[1]
    track = np.full(n, -1, dtype=np.int64)
    place, k = divmod(np.argmin(cost), width)
    if cost[place, k] == np.inf:
        return track
    track[-1] = k
    for i in range(n - 1, 0, -1):
        place, k = divmod(came[i, place, k], width)
        track[i - 1] = k
    return track

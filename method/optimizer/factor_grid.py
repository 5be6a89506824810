"""Starts for short videos: tracks over a grid of factors, each the cheapest of all when losses have a price.

Losses that rise and fall with the factor leave a search that follows their slopes in the nearest local
optimum. When each frame's loss costs by itself, whatever its curve, the cheapest track on a grid of factors
within the rate limit and the budget is found globally (`cheapest_track`). Two such costs are useful. The
distance from one loss common to all frames gives a first track for each such loss. The mean distance
from the losses of a track already found improves that track: over all factors first, then in ever narrower
bands about it with ever finer grids. All frames may move at once: with C(l', l) the mean distance of losses
l' from losses l, the energy distance 2 C(l', l) - C(l, l) - C(l', l') is never negative (Szekely & Rizzo,
2013, J. Stat. Plan. Inference 143:1249), so where C(l', l) is below C(l, l), the pair sum C(l', l') is too.

The cheapest track is found by dynamic programming (Viterbi 1967, IEEE Trans. Inf. Theory 13:260). The budget
is part of the state: what has been used so far, in bins. A price for it would not do, for where costs are
not convex the tracks on either side of a price miss the budget by far, and to mend that spoils them. The
cells that may come before a cell lie in a window that moves on with it, so that the least of them is kept in
a queue, and a frame takes time in proportion to cells times bins, however far a step may go.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array, Integers
from evenlight.method.compiled_loop import compiled_loop
from evenlight.method.optimizer.chain import nearest_feasible
from evenlight.method.optimizer.optimize import Problem, is_feasible

WORK = 4e6  # frames times cells times bins of the budget: what one track may cost
CELLS = (129, 1025)  # at least and at most: most knots lie on so many
CELLS_PER_STEP = 4  # as fine as that if so many are enough: else nothing could move on the grid
BINS = (16, 512)  # of the budget, at least and at most
LEVELS = 16  # losses common to all frames that are tried
KEPT = 2  # of the tracks found for them
ROUNDS = 8  # of improvement of each, at most
BAND_CELLS = 65
WIDEST_BAND = 8  # cells of the whole grid to either side
NARROWER = 3.0  # each band than the one before
NARROWEST_BAND = 5e-4  # factor; the splitting goes on from there
WORTHWHILE = 1e-3  # improvement of the objective, as a share of it, below which the band is made narrower
LEAST_WAY = 1e-6  # factor: where even all steps together lead no further, nothing can be gained
Origins = NDArray[np.int32]
SPARE = 2  # bins on either side of what is needed
LEAST_BIN = 1e-12  # of the sum of factors, where all cells use the same


@dataclass(frozen=True, slots=True)
class FactorGrid:
    """The factors that each frame may choose from."""

    problem: Problem  # N frames
    cells: GridCells  # K factors for each of them
    loss: Array  # (N, K): of each frame at each of its factors
    bins: int  # of the budget

    @classmethod
    def of(cls, problem: Problem) -> FactorGrid:
        """Return the grid of all factors that a track can have: every track crosses the baseline."""
        n, baseline, steps = problem.curves.n_frames, problem.baseline_factor, longest_steps(problem)
        low = max(problem.lowest_factor, baseline - steps.sum())
        high = min(1.0, baseline + steps.sum())
        wanted = CELLS_PER_STEP * (high - low) / max(float(np.median(steps)), LEAST_WAY / n)
        cells = int(np.clip(wanted, *CELLS)) // 16 * 16 + 1
        return cls.between(problem, np.full(n, low), np.full(n, high), cells)

    @classmethod
    def about(cls, problem: Problem, track: Array, width: float) -> FactorGrid:
        """Return the grid of a band about a track."""
        low = np.maximum(problem.lowest_factor, track - width)
        return cls.between(problem, low, np.minimum(1.0, track + width), BAND_CELLS)

    @classmethod
    def between(cls, problem: Problem, low: Array, high: Array, count: int) -> FactorGrid:
        """Return the grid of so many factors from the lowest to the highest of each frame."""
        factors = np.linspace(low, high, count, axis=1)
        used = (problem.budget_weights * len(low))[:, None] * (factors - problem.baseline_factor)
        limit = problem.rate_limit(factors * problem.luminance[:, None])
        loss = np.stack([problem.loss(chosen) for chosen in factors.T], axis=1)
        bins = int(np.clip(WORK / factors.size, *BINS))
        return cls(problem, GridCells(factors, used, limit, problem.step_reach()), loss, bins)

    def track(self, cost: Array, near: Array) -> Array:
        """Return the cheapest track, drawn into all limits.

        Parameters
        ----------
        cost : array, (N, K)
            Of each factor.
        near : array, (N,)
            Feasible factors, from which the answer is drawn into the limits; the answer if there is none.
        """
        chosen = cheapest_track(cost, self.cells, self.bins)
        if chosen is None:
            return near
        wanted, factors = self.cells.factors[np.arange(len(chosen)), chosen], near
        for _ in range(2):  # the rate limit is linearized about the last feasible factors
            factors = nearest_feasible(self.problem, factors, wanted, 1.0)
        return factors if is_feasible(self.problem, factors) else near


def grid_starts(problem: Problem) -> list[Array]:
    """Return feasible factors to start from, the best first; none where nothing can move.

    Parameters
    ----------
    problem : Problem
        N frames, at least 2.
    """
    if not longest_steps(problem).sum() > LEAST_WAY:
        return []
    grid = FactorGrid.of(problem)
    levels = np.quantile(grid.loss, (np.arange(LEVELS) + 0.5) / LEVELS)
    counts = problem.frame_importance()[:, None]
    tracks = [grid.track(counts * np.abs(grid.loss - u), problem.baseline()) for u in levels]
    tracks = sorted(tracks, key=problem.objective)[:KEPT]
    return sorted((_improved(grid, track) for track in tracks), key=problem.objective)


def longest_steps(problem: Problem) -> Array:
    """Return the longest change of the factor in each step, (N-1,), at most 1."""
    knots, reach = problem.curves.factors, problem.step_reach()
    highest = problem.rate_limit(knots * problem.luminance[:, None]).max(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):  # no limit where there is no light: a free step
        steps = np.where(np.isinf(reach), 1.0, reach * np.minimum(highest[:-1], highest[1:]))
    return np.minimum(steps, 1.0)


def _improved(grid: FactorGrid, track: Array) -> Array:
    """Return a track as good or better: each round, the frames go where the losses of the last one are."""
    problem, best, value = grid.problem, track, grid.problem.objective(track)
    factors, width = grid.cells.factors[0], np.inf
    widest = WIDEST_BAND * float(factors[1] - factors[0])
    for _ in range(ROUNDS):
        better = grid.track(distance_from(problem, grid.loss, problem.loss(best)), best)
        gained = value - problem.objective(better)
        if gained > 0:
            best, value = better, value - gained
        if gained <= WORTHWHILE * value:
            width = min(width / NARROWER, widest)
        if width < NARROWEST_BAND:
            break
        if width < np.inf:
            grid = FactorGrid.about(problem, best, width)
    return best


def distance_from(problem: Problem, losses: Array, loss: Array) -> Array:
    """Return how far losses are from those of a track on average, times the importance of their frame.

    Parameters
    ----------
    problem : Problem
        N frames.
    losses : array, (N, K)
        Several for each frame.
    loss : array, (N,)
        Of the track.
    """
    counts = problem.frame_importance()
    order = np.argsort(loss)
    loss, share = loss[order], counts[order] / counts.sum()
    place = np.searchsorted(loss, losses)
    below = np.append(0.0, np.cumsum(share))[place]
    mean_below = np.append(0.0, np.cumsum(share * loss))
    mean = losses * (2 * below - 1) + mean_below[-1] - 2 * mean_below[place]
    return np.asarray(counts[:, None] * mean)


class GridCells(NamedTuple):
    """What each of N frames may choose from."""

    factors: Array  # (N, K): b, rising along each row
    used: Array  # (N, K): what each adds to what the track uses beyond the budget, rising along each row too
    limit: Array  # (N, K): rate limit at each of them [cd/m^2/s]
    reach: Array  # (N-1,): change of the factor per rate limit of each step; infinite where it is free


class BudgetBins(NamedTuple):
    """Bins of what has been used beyond the budget, from which the remaining frames can still meet it."""

    start: Array  # (N,): where the first bin starts, after each frame
    number: Integers  # (N,): how many there are
    size: float  # of each


class CostToReach(NamedTuple):
    """The cheapest way to each cell of a frame, for each bin."""

    cost: Array  # (bins, K): what it costs; infinite where there is none
    used: Array  # (bins, K): what it has used beyond the budget, exactly


class GridStep(NamedTuple):
    """How the ways to a frame go on from the frame before."""

    first: Integers  # (K,): first cell of the frame before from which each cell may be reached
    last: Integers  # (K,): and the last of them
    cost: Array  # (K,): of each cell
    used: Array  # (K,): of each cell
    start: float  # where the bins after this frame begin
    number: int  # how many there are
    size: float  # of each


def cheapest_track(cost: Array, cells: GridCells, bins: int) -> Integers | None:
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


@compiled_loop(error_model="numpy")
def _cheapest(cost: Array, cells: GridCells, bins: BudgetBins) -> Integers:
    """See `cheapest_track`: fronts forward, the track backward; cells of -1 where there is no track."""
    n, width = cost.shape
    came = np.empty((n, bins.number.max(), width), dtype=np.int32)
    before = CostToReach(np.full(came.shape[1:], np.inf), np.zeros(came.shape[1:]))
    after = CostToReach(np.full(came.shape[1:], np.inf), np.zeros(came.shape[1:]))
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


@compiled_loop(error_model="numpy", forceinline=True)
def _windows(cells: GridCells, i: int) -> tuple[Integers, Integers]:
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


@compiled_loop(error_model="numpy", forceinline=True)
def _extend(before: CostToReach, place: int, choice: GridStep, after: CostToReach, came: Origins) -> None:
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


@compiled_loop(error_model="numpy")
def _traced(cost: Array, came: Origins) -> Integers:
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

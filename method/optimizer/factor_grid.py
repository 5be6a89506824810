"""Starts for short videos: tracks over a grid of factors, each the cheapest of all when losses have a price.

Losses that rise and fall with the factor leave a search that follows their slopes in the nearest local
optimum. When each frame's loss costs by itself, whatever its curve, the cheapest track on a grid of factors
within the rate limit and the budget is found globally (`grid_track`). Two such costs are useful. The
distance from one loss common to all frames gives a first track for each such loss. The mean distance
from the losses of a track already found improves that track: over all factors first, then in ever narrower
bands about it with ever finer grids. All frames may move at once: with C(l', l) the mean distance of losses
l' from losses l, the energy distance 2 C(l', l) - C(l, l) - C(l', l') is never negative (Szekely & Rizzo,
2013, J. Stat. Plan. Inference 143:1249), so where C(l', l) is below C(l, l), the pair sum C(l', l') is too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.optimizer.chain import nearest_feasible
from evenlight.method.optimizer.grid_track import GridCells, cheapest_track
from evenlight.method.optimizer.optimize import Problem, is_feasible

WORK = 4e6  # frames times cells times bins of the budget: what one track may cost
CELLS = (129, 1025)  # at least and at most: most knots lie on so many
CELLS_PER_STEP = 4  # as fine as that if so many are enough: else nothing could move on the grid
BINS = (16, 512)  # of the budget, at least and at most
LEVELS = 16  # losses common to all frames that are tried
KEPT = 3  # of the tracks found for them
ROUNDS = 12  # of improvement of each, at most
BAND_CELLS = 65
WIDEST_BAND = 8  # cells of the whole grid to either side
NARROWER = 3.0  # each band than the one before
NARROWEST_BAND = 5e-4  # factor; the splitting goes on from there
WORTHWHILE = 1e-3  # improvement of the objective, as a share of it, below which the band is made narrower
LEAST_WAY = 1e-6  # factor: where even all steps together lead no further, nothing can be gained


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
        n, baseline, steps = problem.curves.n_frames, problem.baseline_factor, _longest_steps(problem)
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
    if not _longest_steps(problem).sum() > LEAST_WAY:
        return []
    grid = FactorGrid.of(problem)
    levels = np.quantile(grid.loss, (np.arange(LEVELS) + 0.5) / LEVELS)
    counts = problem.frame_importance()[:, None]
    tracks = [grid.track(counts * np.abs(grid.loss - u), problem.baseline()) for u in levels]
    tracks = sorted(tracks, key=problem.objective)[:KEPT]
    return sorted((_improved(grid, track) for track in tracks), key=problem.objective)


def _longest_steps(problem: Problem) -> Array:
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

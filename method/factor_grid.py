"""Starts for short videos: tracks over a grid of factors, each the cheapest of all when losses have a price.

Losses that rise and fall with the factor leave a search that follows their slopes in the nearest local
optimum. When each frame's loss costs by itself, a convex function of it, the cheapest track on a grid of
factors within the rate limit is found globally, whatever the curves, by dynamic programming (Viterbi 1967,
IEEE Trans. Inf. Theory 13:260); the budget is one price. Two such costs are of use. The distance from one
loss common to all frames gives a first track for each such loss. The mean distance from the losses of a track
already found is the pair sum itself but for the frame that moves, and improves that track.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from method.budgeted_chain import nearest_feasible
from method.optimize import Problem, is_feasible

Array = NDArray[np.float64]
Places = NDArray[np.int64]

WORK = 2e6  # frames times cells squared: what one dynamic program may cost
CELLS = (65, 257)  # at least and at most
LEVELS = 8  # losses common to all frames that are tried
KEPT = 3  # of the tracks found for them
ROUNDS = 4  # of improvement of each
PRICES = 14  # per track, at most
LEAST_SPACING = 1e-8  # of cells: where even all steps together lead no further, nothing can be gained
CLOSE = 1e-3  # mean factor: a track this near to the budget needs no better price


@dataclass(frozen=True, slots=True)
class Grid:
    """What the dynamic program needs.

    Attributes
    ----------
    problem : Problem
        N frames.
    factors : array, (K,)
        Evenly spaced.
    loss : array, (N, K)
        Of each frame at each of them.
    limit : array, (N, K)
        Rate limit of each frame at each of them [cd/m^2/s].
    """

    problem: Problem
    factors: Array
    loss: Array
    limit: Array

    @classmethod
    def of(cls, problem: Problem) -> Grid:
        """Return the grid of a problem, as fine as the number of frames allows."""
        n = problem.curves.n_frames
        cells = int(np.clip(np.sqrt(WORK / n), *CELLS)) // 16 * 16 + 1  # most knots lie on it
        baseline, all_steps = problem.baseline_factor, _furthest(problem)
        low = max(problem.lowest_factor, baseline - all_steps)  # every track crosses the baseline
        factors = np.linspace(low, min(1.0, baseline + all_steps), cells)
        loss = np.stack([problem.loss(np.full(n, b)) for b in factors], axis=1)
        return cls(problem, factors, loss, problem.rate_limit(factors * problem.luminance[:, None]))

    def is_fine(self) -> bool:
        """Return whether half of the steps may go further than a cell: else nothing could move on it."""
        steps = _longest_steps(self.problem.step_reach(), self.limit)
        spacing = float(self.factors[1] - self.factors[0])
        return spacing > LEAST_SPACING and bool(np.median(steps) > spacing)

    def track(self, cost: Array, near: Array) -> Array:
        """Return the cheapest track that meets the budget nearly, drawn into all limits.

        Parameters
        ----------
        cost : array, (N, K)
            Of each factor.
        near : array, (N,)
            Feasible factors, from which the answer is drawn into the limits.
        """
        weights = self.problem.budget_weights * self.problem.curves.n_frames
        reach, spacing = self.problem.step_reach(), self.factors[1] - self.factors[0]
        ends: dict[bool, Array] = {}
        low, high, step, price = -np.inf, np.inf, float(cost.std()) + 1e-9, 0.0
        for _ in range(PRICES):
            priced = cost + price * weights[:, None] * self.factors
            wanted = self.factors[_cheapest(priced, self.limit, reach, spacing)]
            error = self.problem.budget_error(wanted)
            over = error > 0
            ends[over] = wanted
            if abs(error) < CLOSE:
                break
            low, high = (price, high) if over else (low, price)
            if np.isfinite(low) and np.isfinite(high):
                price = (low + high) / 2
            else:
                price, step = price + (step if over else -step), step * 3
        answers = [self._feasible(wanted, near) for wanted in ends.values()]
        kept = [answer for answer in answers if is_feasible(self.problem, answer)]
        return min(kept or [near], key=self.problem.objective)

    def _feasible(self, wanted: Array, near: Array) -> Array:
        """Return feasible factors near the ones wanted."""
        for _ in range(2):  # the rate limit is linearized about the last feasible factors
            near = nearest_feasible(self.problem, near, wanted, 1.0)
        return near


def grid_starts(problem: Problem) -> list[Array]:
    """Return feasible factors to start from, the best first; none where the rate limit is too tight.

    Parameters
    ----------
    problem : Problem
        N frames, at least 2.
    """
    grid = Grid.of(problem)
    if not grid.is_fine():
        return []
    levels = np.quantile(grid.loss, (np.arange(LEVELS) + 0.5) / LEVELS)
    counts = problem.frame_importance()[:, None]
    tracks = [grid.track(counts * np.abs(grid.loss - u), problem.baseline()) for u in levels]
    tracks = sorted(tracks, key=problem.objective)[:KEPT]
    return sorted((_improved(grid, track) for track in tracks), key=problem.objective)


def _longest_steps(reach: Array, limit: Array) -> Array:
    """Return the longest change of the factor in each step, (N-1,), from its reach per rate limit."""
    highest = limit.max(axis=1)
    lower = np.minimum(highest[:-1], highest[1:])
    with np.errstate(invalid="ignore", over="ignore"):  # no limit where there is no light: a free step
        return np.where(np.isinf(reach), np.inf, reach * lower)


def _furthest(problem: Problem) -> float:
    """Return how far all steps together may lead."""
    knots = problem.curves.factors
    steps = _longest_steps(problem.step_reach(), problem.rate_limit(knots * problem.luminance[:, None]))
    return float(np.minimum(steps, 1.0).sum())


def _improved(grid: Grid, track: Array) -> Array:
    """Return a track as good or better: each round, the frames go where the losses of the last one are."""
    problem, best = grid.problem, track
    for _ in range(ROUNDS):
        better = grid.track(_distance(grid, problem.loss(best)), best)
        if problem.objective(better) >= problem.objective(best):
            break
        best = better
    return best


def _distance(grid: Grid, loss: Array) -> Array:
    """Return how far every loss of the grid is from given losses on average, times the frame's importance."""
    counts = grid.problem.frame_importance()
    order = np.argsort(loss)
    loss, share = loss[order], counts[order] / counts.sum()
    place = np.searchsorted(loss, grid.loss)
    below = np.append(0.0, np.cumsum(share))[place]
    mean_below = np.append(0.0, np.cumsum(share * loss))
    mean = grid.loss * (2 * below - 1) + mean_below[-1] - 2 * mean_below[place]
    return np.asarray(counts[:, None] * mean)


@numba.njit(cache=True, error_model="numpy")
def _cheapest(cost: Array, limit: Array, reach: Array, spacing: float) -> Places:
    """Return the cells of the cheapest track, (N,); a step keeps the rate limit of both of its ends.

    Parameters
    ----------
    cost : array, (N, K)
        Of each cell.
    limit : array, (N, K)
        Rate limit at each cell.
    reach : array, (N-1,)
        Change of the factor per rate limit.
    spacing : float
        Between cells.
    """
    n, cells = cost.shape
    came = np.zeros((n, cells), dtype=np.int64)
    total = cost[0].copy()
    widths = np.empty(cells, dtype=np.int64)
    for i in range(1, n):
        for k in range(cells):
            furthest = reach[i - 1] * limit[i - 1, k]
            widths[k] = cells if not furthest < cells * spacing else int(furthest / spacing)
        after = np.empty(cells)
        for k in range(cells):
            furthest = reach[i - 1] * limit[i, k]
            width = cells if not furthest < cells * spacing else int(furthest / spacing)
            best = k
            for j in range(max(k - width, 0), min(k + width + 1, cells)):
                if abs(j - k) <= widths[j] and total[j] < total[best]:
                    best = j
            came[i, k] = best
            after[k] = total[best] + cost[i, k]
        total = after
    track = np.empty(n, dtype=np.int64)
    track[-1] = np.argmin(total)
    for i in range(n - 1, 0, -1):
        track[i - 1] = came[i, track[i]]
    return track

"""The shortest videos, to judge our solver by: all tracks over a grid of factors, looked at one by one.

Where losses rise and fall with the factor, searches that follow slopes or levels of loss can agree on a track
that is not the best. Up to eight frames have few enough tracks to look at all of them: the grid is as fine as
their number allows, which the rate limit and the budget hold down. From the best ones, apart from each other,
grids about them narrow down; the splitting and a dense solver go on from there (`from_all_tracks`).
"""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.optimizer.chain import nearest_feasible
from evenlight.method.optimizer.factor_grid import longest_steps
from evenlight.method.optimizer.optimize import Problem, Solution, is_feasible
from evenlight.method.optimizer.slsqp import slsqp_from
from evenlight.method.optimizer.splitting import DENSE_TOLERANCES, HOP
from evenlight.method.optimizer.splitting_search import search, state_at

MOST_FRAMES = 8
TRACKS, TRACKS_ABOUT = 50_000, 3_000  # over all factors, and about a track: most that are looked at
CELLS = (257, 129, 65, 33, 17, 9, 7, 5, 3)  # of each frame's factor: the first that will do
FINEST = 2.5  # power of the number of tracks, over the number of steps: no more cells are tried
KEPT = 5  # starts
APART = 1.5  # cells, in at least one frame
SEEN = 3000  # of the best tracks, from which those apart are taken
NARROWEST = 1e-3  # factor; a dense solver goes on from there
RISE = 1e-9  # of a loss with the factor, beyond rounding


def from_all_tracks(problem: Problem, best: Solution) -> float:
    """Return the least objective of an answer and of what is found from the best tracks over a grid."""
    least = problem.objective(best.factors)
    for factors in exhaustive_starts(problem):
        found = search(problem, state_at(problem, factors), HOP).factors
        polished, _ = slsqp_from(problem, found, DENSE_TOLERANCES[1])
        tried = [track for track in (factors, found, polished) if is_feasible(problem, track)]
        least = min([least, *map(problem.objective, tried)])
    return least


def exhaustive_starts(problem: Problem) -> list[Array]:
    """Return feasible factors to start from; none of many frames, or where no loss rises with its factor.

    Parameters
    ----------
    problem : Problem
        N frames.
    """
    n, baseline = problem.curves.n_frames, problem.baseline_factor
    if n > MOST_FRAMES or not (np.diff(problem.curves.loss, axis=1) > RISE).any():
        return []
    way = float(longest_steps(problem).sum())
    low, high = max(problem.lowest_factor, baseline - way), min(1.0, baseline + way)
    tracks, cell = _best_tracks(problem, np.full(n, low), np.full(n, high), TRACKS)
    chosen: list[Array] = []
    for track in tracks[:SEEN]:
        if all(np.abs(track - other).max() > APART * cell for other in chosen):
            chosen.append(track)
        if len(chosen) == KEPT:
            break
    return [_narrowed(problem, track, APART * cell) for track in chosen]


def _narrowed(problem: Problem, track: Array, width: float) -> Array:
    """Return the best track found about a track, within ever narrower bands."""
    best = _drawn(problem, track)
    while width > NARROWEST:
        low = np.maximum(problem.lowest_factor, best - width)
        about = _best_tracks(problem, low, np.minimum(1.0, best + width), TRACKS_ABOUT)[0]
        other = _drawn(problem, about[0]) if len(about) else best
        if problem.objective(other) < problem.objective(best) and is_feasible(problem, other):
            best = other
        width /= 3
    return best


def _drawn(problem: Problem, wanted: Array) -> Array:
    """Return factors drawn into the limits."""
    factors = problem.baseline()
    for _ in range(2):  # the rate limit is linearized about the last feasible factors
        factors = nearest_feasible(problem, factors, wanted, 1.0)
    return factors


def _best_tracks(problem: Problem, low: Array, high: Array, most: int) -> tuple[Array, float]:
    """Return tracks over a grid between two, best first, and the width of its widest cell.

    Each is moved as a whole by the half cell at most that it misses the budget by.
    """
    for count in (c for c in CELLS if c <= max(most ** (FINEST / max(len(low) - 1, 1)), CELLS[-1])):
        cells = np.linspace(low, high, count, axis=1)
        found = _tracks(problem, cells, most)
        if found is not None:
            break
    else:
        return np.empty((0, len(low))), 0.0
    tracks = np.take_along_axis(cells.T, found, axis=0)
    tracks = np.clip(tracks - (tracks @ problem.budget_weights - problem.baseline_factor)[:, None],
                     problem.lowest_factor, 1.0)  # fmt: skip
    curves = problem.curves
    losses = [np.interp(b, curves.factors, loss) for b, loss in zip(tracks.T, curves.loss, strict=True)]
    values = [problem.value(loss) for loss in np.stack(losses, axis=1)]
    return tracks[np.argsort(values, kind="stable")], float((high - low).max()) / (count - 1)


def _tracks(problem: Problem, cells: Array, most: int) -> np.ndarray | None:
    """Return the cells of all tracks within rate limit and budget, (M, N); None if there are more than that.

    Frame by frame, those go on from which the remaining frames can still meet the budget to half a cell.
    """
    n, count = cells.shape
    used = problem.budget_weights[:, None] * (cells - problem.baseline_factor)
    slack = float((cells[:, 1] - cells[:, 0]).max()) / 2 + 1e-12
    least, largest = used[::-1, 0].cumsum()[::-1], used[::-1, -1].cumsum()[::-1]
    limit = problem.rate_limit(cells * problem.luminance[:, None])
    tracks, total = np.arange(count)[:, None], used[0]
    for i, reach in enumerate(problem.step_reach(), start=1):
        change = np.abs(cells[i] - cells[i - 1][:, None])
        free = np.isinf(reach)
        furthest = np.inf if free else reach * np.minimum(limit[i - 1][:, None], limit[i])
        before, cell = np.nonzero((change <= furthest)[tracks[:, -1]])
        sums = total[before] + used[i][cell]
        rest_least, rest_most = (least[i + 1], largest[i + 1]) if i + 1 < n else (0.0, 0.0)
        possible = (sums + rest_least <= slack) & (sums + rest_most >= -slack)
        if np.count_nonzero(possible) > most:
            return None
        tracks = np.column_stack([tracks[before[possible]], cell[possible]])
        total = sums[possible]
    return tracks

"""The default solver: where the splitting starts, its stages of search, and how its answer is polished.

Long videos are first solved with blocks of frames for frames: the rate limit makes the factor smooth, so most
iterations can be made on an eighth of the frames. The fewer frames there are, the more searches they can
afford, and the shortest have the coarsest stairs in their loss curves, hence the most local optima.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves
from evenlight.method.choices import SolverName
from evenlight.method.optimizer.chain import nearest_feasible
from evenlight.method.optimizer.factor_grid import grid_starts
from evenlight.method.optimizer.optimize import Problem, Solution, Solver, is_feasible
from evenlight.method.optimizer.slsqp import SlsqpSolver, slsqp_from
from evenlight.method.optimizer.splitting_search import NO_SPREAD, SearchStage, search, state_at

FAR_TO_NEAR = (SearchStage(1.0, 8), SearchStage(0.125, 8), SearchStage(0.0, 20))
# From a start that is nearly right.
NEAR = (
    SearchStage(0.0, 5, 0.05, worthwhile=1e-4),
    SearchStage(0.0, 5, 0.01, from_best=True, worthwhile=1e-4),
)
SETTLING = tuple(SearchStage(0.0, 12, 0.03 / 5**k, from_best=True) for k in range(5))
# Searches of short videos from the constant baseline.
OTHER_SEARCHES = (
    (SearchStage(0.0, 30), *SETTLING),
    (SearchStage(1.0, 30), SearchStage(0.25, 20), SearchStage(0.06, 20), SearchStage(0.0, 30), *SETTLING),
)
HOP = (SearchStage(0.0, 10, 0.06), *SETTLING)
LONG = 600  # frames above which the search begins with a coarse start
SETTLED = 2000  # frames up to which its answer is settled
MEDIUM = 900  # and up to which another search begins at constant dimming
SHORT = 500  # frames up to which the best answer is left and sought again
DENSE = 150  # frames up to which a dense solver is affordable
SHORTEST = 60  # and up to which it is from many starts
HOPS = 2
AGREED = 1e-3  # share of the baseline's objective: searches no further apart have found one optimum
DENSE_CUBES = 1e6  # above that: fruitless starts times frames cubed, where searches do not agree
DENSE_STARTS = (8, 20)  # fruitless ones after which it ends: at least and at most; in all twice as many
DENSE_WORK = 480  # fruitless starts times frames
DENSE_ITERATIONS = 1500  # of all starts together; half as many again take the best of them to the end
DENSE_EFFORT = 1.2e8  # their iterations times frames cubed, at most
WORTHWHILE = 1e-7  # improvement of the objective, as a share of it
HAIR = 1e-8  # mean factor: a budget nearer to its end than this leaves nothing to polish
DENSE_TOLERANCES = (1e-6, 1e-10)  # of each start, and of the best of them
GOLDEN = (np.sqrt(5) - 1) / 2  # its multiples spread evenly over the unit interval
BLOCK = 8  # frames


@dataclass(frozen=True, slots=True)
class SplittingSolver:
    """Alternate between the pair sum and the chain; O(N log N) per iteration. Deterministic."""

    # (N,): factors to start from, such as the track of an earlier version of the video; they need not keep
    # the limits. The search from the constant baseline is then left out, the polish of short videos is not.
    start: Array | None = None
    # the only stages to go through, in place of those that suit the number of frames
    stages: tuple[SearchStage, ...] | None = None
    # how much is done above 600 frames, without a start: 1, one search from a coarse problem, and of
    # fewer frames, too; 2, its answer is settled; 3, another search from constant dimming; 4, all those of
    # 501 to 600 frames, which takes seconds. None takes what suits the number of frames.
    searches: int | None = None

    def solve(self, problem: Problem) -> Solution:
        """Return the best feasible factors of all searches, and the dual variables of the best one."""
        n = problem.curves.n_frames
        baseline = problem.baseline()
        if not problem.leaves_a_choice:
            return Solution(baseline, 0)
        if self.stages is not None:
            return search(problem, state_at(problem, baseline), self.stages)
        long = n > LONG or self.searches == 1
        if self.start is not None:
            best = _from_start(problem, self.start)
        elif long:
            best = _of_a_long_video(problem, self.searches or 1 + (n <= SETTLED) + (n <= MEDIUM))
        else:
            best = search(problem, state_at(problem, baseline), (*FAR_TO_NEAR, *SETTLING))
        return best if long else _of_a_short_video(problem, best, self.start is None)


def _of_a_long_video(problem: Problem, searches: int) -> Solution:
    best = _coarse_to_fine(problem)
    if searches > 1:
        best = _better(problem, best, search(problem, state_at(problem, best.factors, best), SETTLING))
    if searches > 2:
        stages = (*FAR_TO_NEAR, *SETTLING)
        best = _better(problem, best, search(problem, state_at(problem, problem.baseline()), stages))
    return _searched_elsewhere(problem, best)[0] if searches > 3 else best


def _coarse_to_fine(problem: Problem) -> Solution:
    """Return the best factors near those of the problem with blocks of frames for frames."""
    if problem.curves.n_frames <= LONG:
        return search(problem, state_at(problem, problem.baseline()), FAR_TO_NEAR)
    coarse = _coarse_to_fine(coarse_problem(problem))
    start = refined_solution(problem, coarse)
    best = search(problem, state_at(problem, start.factors, start), NEAR)
    return replace(best, iterations=best.iterations + coarse.iterations)


def _from_start(problem: Problem, start: Array) -> Solution:
    """Return the best factors near a start, or near the constant baseline if that is better."""
    factors = problem.baseline()
    for _ in range(2):  # the rate limit is linearized about the last feasible factors
        factors = nearest_feasible(problem, factors, start, 1.0)
    return search(problem, state_at(problem, factors), NEAR)


def _of_a_short_video(problem: Problem, best: Solution, search_more: bool) -> Solution:
    n = problem.curves.n_frames
    if n <= SHORTEST:
        return _polished(problem, best, int(np.clip(DENSE_WORK / n, *DENSE_STARTS)))
    alike = True
    if search_more:
        best, alike = _searched_elsewhere(problem, best)
    for turn in range(HOPS if n <= SHORT else 0):
        factors = nearest_feasible(problem, best.factors, best.factors + _wave(n, turn), 0.5)
        best = _better(problem, best, search(problem, state_at(problem, factors, best), HOP))
    if n > DENSE:
        return best
    return _polished(problem, best, 1 if alike else max(int(DENSE_CUBES / n**3), 1))


def _searched_elsewhere(problem: Problem, best: Solution) -> tuple[Solution, bool]:
    """Return the best of other searches from the baseline, up to one that disagrees, and whether none does.

    Where one does, loss curves have many local optima, and tracks over a grid of factors are tried too.
    """
    most_apart = AGREED * problem.objective(problem.baseline())
    for stages in OTHER_SEARCHES:
        other = search(problem, state_at(problem, problem.baseline()), stages)
        apart = abs(problem.objective(other.factors) - problem.objective(best.factors))
        best = _better(problem, best, other)
        if apart > most_apart:
            break
    else:
        return best, True
    for factors in grid_starts(problem):
        best = _better(problem, best, search(problem, state_at(problem, factors), HOP))
    return best, False


def _better(problem: Problem, best: Solution, other: Solution) -> Solution:
    iterations = best.iterations + other.iterations
    lower = problem.objective(other.factors) < problem.objective(best.factors)
    if lower and is_feasible(problem, other.factors):
        best = other
    return replace(best, iterations=iterations)


def _polished(problem: Problem, best: Solution, starts: int) -> Solution:
    """Return the best that a dense solver makes of the best answer, of others near it and near the baseline.

    Starts end after so many fruitless ones in turn, or twice as many in all; the best of them is then taken
    to the end. The dual variables stay: they certify any answer, not just the one they came with.
    """
    n = problem.curves.n_frames
    if min(problem.baseline_factor - problem.lowest_factor, 1 - problem.baseline_factor) < HAIR:
        return best
    most = int(min(DENSE_ITERATIONS, DENSE_EFFORT / n**3))
    end, (rough, fine), fruitless = best.iterations + most, DENSE_TOLERANCES, 0
    for turn in range(2 * starts):
        start = best.factors if turn % 2 == 0 else problem.baseline()
        wave = _wave(n, turn // 2) if turn % 2 == 0 else 0.1 * _wave(n, turn)
        best, gained = _by_dense(problem, best, start + (wave if turn else 0.0), (rough, end))
        fruitless = 0 if gained else fruitless + 1
        if fruitless == starts:
            break
    gained, end = True, best.iterations + most // 2
    while gained:
        best, gained = _by_dense(problem, best, best.factors, (fine, end))
    return best


def _by_dense(
    problem: Problem, best: Solution, start: Array, until: tuple[float, int]
) -> tuple[Solution, bool]:
    """Return the better of the best answer and what SLSQP makes of a start, and whether that was worth it.

    `until` is its tolerance, and how many iterations there may be in all.
    """
    tolerance, end = until
    before = problem.objective(best.factors)
    if before <= NO_SPREAD or best.iterations >= end:
        return best, False
    factors, iterations = slsqp_from(problem, start, tolerance, end - best.iterations)
    best = _better(problem, best, replace(best, factors=factors, iterations=iterations))
    return best, problem.objective(best.factors) < before * (1 - WORTHWHILE)


def _wave(n: int, turn: int) -> Array:
    """Return a change of the factors to leave a local optimum by: rough and slow ones in turn."""
    frame = np.arange(n)
    size = (0.1, 0.03, 0.3)[turn % 3]
    if turn % 2:
        return np.asarray(size * np.sin(2 * np.pi * (GOLDEN * (turn + 1) * (frame + 1) ** 1.5 % 1.0)))
    return np.asarray(size * np.sin((turn + 1) * 3.0 * frame / n + turn))


def coarse_problem(problem: Problem) -> Problem:
    """Return the problem with the means of blocks of frames; a free step frees the one between blocks."""
    starts = np.arange(0, problem.curves.n_frames, BLOCK)
    importance = np.add.reduceat(problem.frame_importance(), starts)
    return Problem(
        curves=_coarse_curves(problem.curves, starts),
        budget_weights=np.add.reduceat(problem.budget_weights, starts),
        baseline_factor=problem.baseline_factor,
        luminance=_means(problem.luminance, starts),
        rate_limit=problem.rate_limit,
        importance=importance / importance.mean(),
        allowances=_coarse_allowances(problem.allowances, starts),
        minimized=problem.minimized,
    )


def _means(values: Array, starts: NDArray[np.int64]) -> Array:
    sizes = np.diff(np.append(starts, len(values)))
    return np.asarray(np.add.reduceat(values, starts, axis=0) / sizes.reshape(-1, *[1] * (values.ndim - 1)))


def _coarse_curves(curves: LossCurves, starts: NDArray[np.int64]) -> LossCurves:
    of_frames = (name for name, shape in ARRAY_SHAPES.items() if shape[0] == "N")
    means: dict[str, Any] = {name: _means(getattr(curves, name), starts) for name in of_frames}
    for name in ("loss", "visible_contrast", "channel_means"):
        means[name] = np.clip(means[name], 0.0, 1.0)  # but for rounding they lie there
    means["times"], means["durations"] = curves.times[starts], np.add.reduceat(curves.durations, starts)
    return replace(curves, **means, bends=None)


def _coarse_allowances(allowances: Array | None, starts: NDArray[np.int64]) -> Array | None:
    """Return the mean allowance of the steps from the start of each block to that of the next."""
    if allowances is None:
        return None
    steps = allowances[: starts[-1]]
    return np.add.reduceat(steps, starts[:-1]) / BLOCK


def refined_solution(problem: Problem, coarse: Solution) -> Solution:
    """Return feasible factors of all frames near those of a coarse solution, with its dual variables."""
    n = problem.curves.n_frames
    starts = np.arange(0, n, BLOCK)
    sizes = np.diff(np.append(starts, n))
    wanted = np.interp(np.arange(n), starts + (sizes - 1) / 2, coarse.factors)
    factors = nearest_feasible(problem, problem.baseline(), wanted, 1.0)
    factors = nearest_feasible(problem, factors, wanted, 1.0)
    weights = coarse.frame_weights
    if weights is not None:
        weights = np.repeat(weights, sizes)
    return Solution(factors, 0, weights, coarse.budget_price)


def make_solver(name: SolverName, rng: np.random.Generator, start: Array | None = None) -> Solver:
    """Return a solver.

    Parameters
    ----------
    name : SolverName
        Which.
    rng : np.random.Generator
        Perturbs the start where the solver wants that.
    start : array, (N,), optional
        Factors to start from, where the solver can.

    Raises
    ------
    InputError
        If a start is given to a solver that takes none.
    """
    if name is SolverName.SPLITTING:
        return SplittingSolver(start)
    if start is not None:
        raise InputError(f"a start is for the solver splitting, not for {name.value}")
    return SlsqpSolver(rng)

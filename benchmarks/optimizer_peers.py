"""The optimizer against others: time, and how far the objective stays above the best that any finds."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.measured import Approach, RunSettings, claim, point
from benchmarks.optimizer_problems import made_curves, mean_factor_problem, odd_problems
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from evenlight.method.optimizer.optimize import Problem, Solver, optimize
from evenlight.method.optimizer.slsqp import SlsqpSolver
from evenlight.method.optimizer.splitting import DENSE, FAR_TO_NEAR, SplittingSolver

STARTS = 10
GAP = "objective above the best found by any, as a share of constant dimming's"
AFFORDABLE = {
    "SLSQP, best of ten starts": 100,
    "SLSQP, one start": 400,
}  # frames
MISSED = "; curves that rise and fall at random have more local optima than the searches visit"
IN_TURN = (50, 100)  # frames at which all approaches take seconds, and are timed several times
SAME = 1e-6  # of constant dimming's objective: below, two answers are one


@dataclass(frozen=True, slots=True)
class Family:
    """Problems of one size.

    Attributes
    ----------
    frames : tuple of int
        The least and the most that they have.
    instances : int
        How many.
    starts : int
        Of SLSQP.
    """

    frames: tuple[int, int]
    instances: int
    starts: int


# One start of SLSQP takes up to half a minute at 400 frames, so that large problems are few.
FAMILIES = (Family((2, 60), 20, STARTS), Family((61, 150), 8, STARTS), Family((151, 400), 4, STARTS))
QUICK_FAMILY = (Family((2, 12), 6, 10),)


def task_of(frames: int) -> str:
    """Return the name of the task with so many frames."""
    return f"{frames} frames, 2 s apart"


def peer_points(settings: RunSettings) -> list[BenchmarkPoint]:
    """Return time and gap of every approach for several numbers of frames."""
    points = []
    for frames in (30,) if settings.quick else (*IN_TURN, 400):
        settings.say(f"{frames} frames, against other solvers")
        rng = np.random.default_rng(settings.seed)
        problem = mean_factor_problem(made_curves(frames, rng, frames_per_second=0.5), 0.5)
        runs = {name: (run, role) for name, (run, role) in _approaches(problem, settings.seed).items()
                if frames <= AFFORDABLE.get(name, frames)}  # fmt: skip
        times, found = _timed(runs, 3 if frames in IN_TURN and not settings.quick else 1)
        best, base = min(found.values()), problem.objective(problem.baseline())
        for name, value in found.items():
            about = Approach(task_of(frames), name, runs[name][1], frames, "frames")
            points.append(point(about, times[name], (value - best) / base, GAP))
    return points


def _approaches(problem: Problem, seed: int) -> dict[str, tuple[Callable[[], float], Role]]:
    """Return what is compared: functions that return the objective of their answer."""

    def by(solver: Solver) -> float:
        return problem.objective(optimize(problem, solver).factors)

    return {
        "ours": (lambda: by(SplittingSolver()), Role.DEFAULT),
        "ours, one search": (lambda: by(SplittingSolver(stages=FAR_TO_NEAR)), Role.VARIANT),
        "SLSQP, one start": (partial(best_of, problem, 1, seed), Role.PEER),
        "SLSQP, best of ten starts": (partial(best_of, problem, STARTS, seed), Role.PEER),
    }


def best_of(problem: Problem, starts: int, seed: int) -> float:
    """Return the smallest objective that SLSQP reaches from some starts; each answer is checked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # SLSQP steps a hair outside its bounds, and says so
        answers = [optimize(problem, SlsqpSolver(np.random.default_rng([seed, k]))) for k in range(starts)]
    return min(problem.objective(answer.factors) for answer in answers)


def _timed(
    runs: Mapping[str, tuple[Callable[[], float], Role]], repeats: int
) -> tuple[dict[str, Times], dict[str, float]]:
    """Return the times of runs in turn, and what each found."""
    found: dict[str, float] = {}

    def remember(name: str) -> None:
        found[name] = runs[name][0]()

    return timed_in_turn({name: partial(remember, name) for name in runs}, repeats), found


def family_claims(settings: RunSettings) -> list[BenchmarkClaim]:
    """Return how far the default falls short of SLSQP's best, over problems of all kinds, by their size."""
    return [_family_claim(settings, family) for family in (QUICK_FAMILY if settings.quick else FAMILIES)]


def _family_claim(settings: RunSettings, family: Family) -> BenchmarkClaim:
    """Return how far the default falls short of SLSQP's best over the problems of one size."""
    least, most = family.frames
    short, ahead, sizes = [], [], []
    for number, problem in enumerate(
        odd_problems(np.random.default_rng(settings.seed), family.frames, family.instances)
    ):
        settings.say(f"problem {number + 1} of {family.instances}, {least} to {most} frames, against SLSQP")
        base = problem.objective(problem.baseline())
        ours = problem.objective(optimize(problem, SplittingSolver()).factors)
        gap = (ours - best_of(problem, family.starts, settings.seed)) / base if base > 0 else 0.0
        short.append(gap)
        sizes.append(problem.curves.n_frames)
        ahead += [gap] if gap < -SAME else []
    lost = sum(gap > SAME for gap in short)
    fewer = f"; {family.starts} starts, not {STARTS}, for want of time" if family.starts < STARTS else ""
    alone = f"; ours above {DENSE} frames is the splitting and the grid alone" if most > DENSE else ""
    better = f"better on {len(ahead)}" + (f" (by up to {-min(ahead):.2g})" if ahead else "")
    return claim(
        f"no worse than SLSQP's best of {family.starts} starts: a family of {least} to {most} frames",
        SAME,
        max(*short, 0.0),
        "share of constant dimming's objective",
        f"{family.instances} made ones of {min(sizes)} to {max(sizes)} frames, of all kinds: "
        f"worse on {lost}, {better}, the same on the rest{MISSED if lost else ''}{fewer}{alone}",
    )

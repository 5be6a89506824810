"""The optimizer against others: time, and how far the objective stays above the best that any finds."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.benchmarks.measured import Approach, Pains, claim, point
from analysis.benchmarks.optimizer_problems import made_curves, mean_factor_problem, odd_problems
from analysis.benchmarks.stopwatch import Times
from data_schema.benchmark import BenchmarkClaim, BenchmarkPoint, Role
from data_schema.errors import InputError
from method.optimize import Problem, Solver, optimize
from method.sequential_convex import Clarabel, Highs, SequentialConvexSolver
from method.slsqp import SlsqpSolver
from method.splitting import FAR_TO_NEAR, SplittingSolver

STARTS = 10
GAP = "objective above the best found by any, as a share of constant dimming's"
AFFORDABLE = {
    "SLSQP, best of ten starts": 100,
    "SLSQP, one start": 400,
    "HiGHS": 100,
    "Clarabel": 100,
}  # frames
MISSED = "; curves that rise and fall at random have more local optima than the searches visit"
SAME = 1e-6  # of constant dimming's objective: below, two answers are one


def task_of(frames: int) -> str:
    """Return the name of the task with so many frames."""
    return f"{frames} frames, 2 s apart"


def peer_points(pains: Pains, refused: dict[str, str]) -> list[BenchmarkPoint]:
    """Return time and gap of every approach for several numbers of frames; some may be refused."""
    points = []
    for frames in (30,) if pains.quick else (50, 100, 200, 400):
        pains.say(f"{frames} frames, against other solvers")
        rng = np.random.default_rng(pains.seed)
        problem = mean_factor_problem(made_curves(frames, rng, frames_per_second=0.5), 0.5)
        runs = {name: (run, role) for name, (run, role) in _approaches(problem, pains.seed).items()
                if frames <= AFFORDABLE.get(name, frames)}  # fmt: skip
        found: dict[str, tuple[Times, float]] = {}
        for name, (run, _) in runs.items():
            try:
                found[name] = _timed(run, (2 if pains.quick else 5) if name.startswith("ours") else 1)
            except InputError as error:
                refused[name] = str(error)
        best, base = min(value for _, value in found.values()), problem.objective(problem.baseline())
        ours = float(np.median(found["ours"][0].wall))
        for name, (times, value) in found.items():
            about = Approach(task_of(frames), name, runs[name][1], frames, "frames")
            related = Times(times.wall, times.processor, times.wall / ours)
            points.append(point(about, related, (value - best) / base, GAP))
    return points


def _approaches(problem: Problem, seed: int) -> dict[str, tuple[Callable[[], float], Role]]:
    """Return what is compared: functions that return the objective of their answer."""

    def by(solver: Solver) -> float:
        return problem.objective(optimize(problem, solver).factors)

    return {
        "ours": (lambda: by(SplittingSolver()), Role.DEFAULT),
        "ours, one search": (lambda: by(SplittingSolver(looks=FAR_TO_NEAR)), Role.VARIANT),
        "SLSQP, one start": (partial(best_of, problem, 1, seed), Role.PEER),
        "SLSQP, best of ten starts": (partial(best_of, problem, STARTS, seed), Role.PEER),
        "HiGHS": (lambda: by(SequentialConvexSolver(Highs())), Role.PEER),
        "Clarabel": (lambda: by(SequentialConvexSolver(Clarabel())), Role.PEER),
    }


def best_of(problem: Problem, starts: int, seed: int) -> float:
    """Return the smallest objective that SLSQP reaches from some starts; each answer is checked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # SLSQP steps a hair outside its bounds, and says so
        answers = [optimize(problem, SlsqpSolver(np.random.default_rng([seed, k]))) for k in range(starts)]
    return min(problem.objective(answer.factors) for answer in answers)


def _timed(run: Callable[[], float], repeats: int) -> tuple[Times, float]:
    """Return the times of runs, after one that compiles where there are several, and the objective."""
    wall, processor = [], []
    value = run() if repeats > 1 else np.nan
    for _ in range(repeats):
        began, used = time.perf_counter(), time.process_time()
        value = run()
        wall.append(time.perf_counter() - began)
        processor.append(time.process_time() - used)
    return Times(np.array(wall), np.array(processor), np.ones(repeats)), value


def family_claim(pains: Pains) -> BenchmarkClaim:
    """Return how far the default falls short of SLSQP's best of ten, over problems of all kinds."""
    instances, most = (6, 12) if pains.quick else (32, 60)
    short, ahead = [], 0
    for number, problem in enumerate(odd_problems(np.random.default_rng(pains.seed), most, instances)):
        pains.say(f"problem {number + 1} of {instances}, against SLSQP's best of ten starts")
        base = problem.objective(problem.baseline())
        ours = problem.objective(optimize(problem, SplittingSolver()).factors)
        gap = (ours - best_of(problem, STARTS, pains.seed)) / base if base > 0 else 0.0
        short.append(gap)
        ahead += gap < -SAME
    lost = sum(gap > SAME for gap in short)
    return claim(
        "objective no worse than SLSQP's best of ten starts, on every problem of a family",
        SAME,
        max(*short, 0.0),
        "share of constant dimming's objective",
        f"{instances} problems of 2 to {most} frames, curves that are smooth, flicker, jump or rise, "
        f"loose and tight limits, budgets up to the ends: worse on {lost}, better on {ahead}, the same on "
        f"the rest{MISSED if lost else ''}",
    )

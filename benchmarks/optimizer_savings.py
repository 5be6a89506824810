"""What the optimizer's savings cost in accuracy: fewer knots, fewer frames, an earlier track."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.measured import Approach, RunSettings, point
from benchmarks.optimizer_problems import (
    made_curves,
    mean_factor_problem,
    rendered_curves,
    some_frames,
    some_knots,
)
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from evenlight.data_schema.arrays import Array
from evenlight.method.optimizer.optimize import Problem, optimize
from evenlight.method.optimizer.splitting import SplittingSolver

KNOTS = 257  # of the curves that count as the truth
SAVED = "objective on the full curves, above that of the answer to them, as a share of constant dimming's"
AGAIN = "objective above that of a start from constant dimming, as a share of constant dimming's"
EDITS = {"budget": "another budget", "content": "a tenth is new"}
EVERY = 10  # frames, as in the paper


def savings_task(frames: int) -> str:
    """Return the name of the task with so many frames."""
    return f"a rendered sequence of {frames} frames, fewer knots and frames"


def edit_task(frames: int, edit: str) -> str:
    """Return the name of the task in which so many frames are optimized again."""
    return f"{frames} made frames again, {EDITS[edit]}"


def savings_points(settings: RunSettings) -> list[BenchmarkPoint]:
    """Return time and error with fewer knots, and with one frame in ten and a spline, as in the paper."""
    settings.say("fewer knots, fewer frames")
    curves = rendered_curves("sunrise", 10.0 if settings.quick else 30.0, KNOTS)
    whole = mean_factor_problem(curves, 0.5)
    answers: dict[str, Callable[[], Array]] = {"all 257 knots": partial(_solved, whole)}
    for knots in (65, 17, 5):
        few = mean_factor_problem(some_knots(curves, (KNOTS - 1) // (knots - 1)), 0.5)
        answers[f"{knots} knots"] = partial(_solved, few)
    answers["one frame in ten, spline"] = partial(_splined, whole)
    times = timed_in_turn(answers, 1 if settings.quick else 3)
    found = {name: answer() for name, answer in answers.items()}
    truth, base = whole.objective(found["all 257 knots"]), whole.objective(whole.baseline())
    points = []
    for name, factors in found.items():
        role = Role.REFERENCE if name == "all 257 knots" else Role.VARIANT
        role = Role.DEFAULT if name == "65 knots" else role
        about = Approach(savings_task(curves.n_frames), name, role, curves.n_frames, "frames")
        error = max((whole.objective(factors) - truth) / base, 0.0)
        points.append(point(about, times[name], error, SAVED, _kept(whole, factors)))
    return points


def _solved(problem: Problem, start: Array | None = None) -> Array:
    """Return the factors of the default solver, from a start if one is given."""
    return optimize(problem, SplittingSolver(start)).factors


def _splined(problem: Problem) -> Array:
    """Return factors of every tenth frame, through which a cubic spline is laid, cut off at the bounds."""
    curves = problem.curves
    frames = np.unique(np.append(np.arange(0, curves.n_frames, EVERY), curves.n_frames - 1))
    few = mean_factor_problem(some_frames(curves, frames), problem.baseline_factor)
    spline = CubicSpline(curves.times[frames], _solved(few))
    return np.clip(spline(curves.times), problem.lowest_factor, 1.0)


def _kept(problem: Problem, factors: Array) -> str:
    """Return what an answer breaks of the full problem's limits."""
    ratio, error = problem.rate_ratio(factors), problem.budget_error(factors)
    words = []
    if ratio > 1 + 1e-6:
        words.append(f"fastest step {ratio:.3g} of the rate limit")
    if abs(error) > 1e-6:
        words.append(f"mean factor off by {error:+.2g}")
    return f"breaks limits: {', '.join(words)}" if words else ""


def edit_points(settings: RunSettings) -> list[BenchmarkPoint]:
    """Return time and objective after an edit, from the earlier track and from constant dimming."""
    rng, frames = np.random.default_rng(settings.seed), 1500 if settings.quick else 3000
    curves = made_curves(frames, rng)
    earlier = _solved(mean_factor_problem(curves, 0.5))
    tenth, loss = slice(frames // 2, frames // 2 + frames // 10), curves.loss.copy()
    loss[tenth] = made_curves(frames // 10, rng).loss
    edits = {
        "budget": mean_factor_problem(curves, 0.52),
        "content": mean_factor_problem(replace(curves, loss=loss), 0.5),
    }
    points = []
    for name, problem in edits.items():
        settings.say(f"another {name}, from the earlier track")
        cold = partial(_solved, problem)
        answers = {
            "from constant dimming": cold,
            "from the earlier track": partial(_solved, problem, earlier),
        }
        times = timed_in_turn(answers, settings.repeats(5))
        base, reference = problem.objective(problem.baseline()), problem.objective(cold())
        for approach, answer in answers.items():
            role = Role.DEFAULT if answer is cold else Role.VARIANT
            about = Approach(edit_task(frames, name), approach, role, frames, "frames")
            difference = (problem.objective(answer()) - reference) / base
            note = f"objective lower by {-difference:.2g}" if difference < 0 else ""
            points.append(point(about, times[approach], max(difference, 0.0), AGAIN, note))
    return points

"""The optimizer over the number of frames: made and rendered curves, their bounds, limits and memory."""

from __future__ import annotations

import functools
import gc
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.measured import Approach, RunSettings, claim, growth, point
from benchmarks.optimizer_problems import (
    keep_made,
    made_curves,
    mean_factor_problem,
    rendered_curves,
    some_frames,
)
from benchmarks.peak_memory import peak_memory
from benchmarks.records import BenchmarkClaim, BenchmarkGrowth, BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import Problem, Solution, optimize
from evenlight.method.optimizer.splitting import SplittingSolver

LENGTH_TASK = "made videos of growing length"
AUTHORS_TASK = "a video of 3000 frames"
OPTIMIZED, CERTIFIED = "ours", "ours, with the lower bound"
RENDERED = "ours, with the lower bound, of the rendered sunrise"
WARMED = 10_000  # frames above which all is compiled, by the shorter ones
LONGEST = 100_000
LEAST_CERTAIN = 0.25  # of the objective: a larger gap to the bound would say little
PROBLEMS = "benchmarks.optimizer_problems"
EVERY = 4  # of so many of the rendered frames one is left where searches are compared
ALL_SEARCHES = 4  # what the solver takes for as many as a video of 600 frames gets
LOWEST = "objective above the lowest of these, as a share of constant dimming's"


@dataclass(frozen=True, slots=True)
class TrackQuality:
    """What an answer keeps, and how sure one can be of it.

    Attributes
    ----------
    gap : float
        Between objective and bound, as a share of the objective.
    rate : float
        Fastest step, as a share of the rate limit.
    off_budget : float
        Distance of the mean factor from the budget.
    """

    gap: float
    rate: float
    off_budget: float


def length_points(settings: RunSettings) -> tuple[list[BenchmarkPoint], dict[int, TrackQuality]]:
    """Return times over the number of made frames, and by it what the answers keep."""
    points, kept = [], {}
    for frames in (1000, 3000, 10_000) if settings.quick else (1000, 3000, 10_000, 30_000, LONGEST):
        settings.say(f"{frames} frames")
        curves = made_curves(frames, np.random.default_rng(settings.seed))
        repeats = settings.repeats(5 if frames <= WARMED else 3)
        timed = _certified(curves, repeats, first=frames <= WARMED)
        memory, note = _memory(curves) if frames in (3000, 30_000) else (None, "")
        kept[frames] = timed.kept
        for name, role in ((OPTIMIZED, Role.VARIANT), (CERTIFIED, Role.DEFAULT)):
            about = Approach(LENGTH_TASK, name, role, frames, "frames")
            memory_note = note if name == CERTIFIED else ""
            made = point(about, timed.times[name], note=f"{timed.words}{memory_note}")
            points.append(replace(made, peak_memory=memory if name == CERTIFIED else None))
    return points, kept


@functools.cache
def _sunrise() -> LossCurves:
    """Return the curves of 3000 rendered frames."""
    return rendered_curves("sunrise", 300.0, 65)


def rendered_point(settings: RunSettings) -> tuple[BenchmarkPoint, TrackQuality]:
    """Return the time for 3000 rendered frames with their bound, and what the answer keeps."""
    settings.say("rendering and optimizing 3000 frames of the sunrise")
    curves = _sunrise()
    timed = _certified(curves, settings.repeats(5), first=True)
    about = Approach(AUTHORS_TASK, RENDERED, Role.DEFAULT, curves.n_frames, "frames optimized")
    return point(about, timed.times[CERTIFIED], note=f"160 x 90, 300 s; {timed.words}"), timed.kept


def search_points(settings: RunSettings) -> list[BenchmarkPoint]:
    """Return what fewer and more searches than the default's take and give on rendered frames."""
    curves = some_frames(_sunrise(), np.arange(0, _sunrise().n_frames, EVERY))
    frames, problem = curves.n_frames, mean_factor_problem(curves, 0.5)
    settings.say(f"{frames} rendered frames, one search and more")
    task = f"the rendered sunrise, {frames} frames, by the number of searches"
    number = {OPTIMIZED: None, "one search": 1, "as many as for 600 frames": ALL_SEARCHES}
    if settings.quick:
        del number["as many as for 600 frames"]  # takes seconds
    found: dict[str, float] = {}

    def remember(name: str) -> None:
        solver = SplittingSolver(searches=number[name])
        found[name] = problem.objective(optimize(problem, solver).factors)

    times = timed_in_turn({name: partial(remember, name) for name in number}, settings.repeats(3))
    base, lowest = problem.objective(problem.baseline()), min(found.values())
    points = []
    for name, value in found.items():
        role = Role.DEFAULT if name == OPTIMIZED else Role.VARIANT
        about, error = Approach(task, name, role, frames, "frames"), (value - lowest) / base
        points.append(
            point(about, times[name], error, LOWEST, f"objective {value / base:.4f} of constant dimming's")
        )
    return points


@dataclass(frozen=True, slots=True)
class _Certified:
    """The times of an answer without and with its bound, what it keeps, and how near the bound is."""

    times: dict[str, Times]
    kept: TrackQuality
    words: str


def _certified(curves: LossCurves, repeats: int, first: bool) -> _Certified:
    """Return the answer to curves at a mean factor of a half, timed."""
    problem = mean_factor_problem(curves, 0.5)
    times, answer, bound = _timed(problem, repeats, first)
    objective = problem.objective(answer.factors)
    kept = TrackQuality(
        float(1 - bound / objective),
        problem.rate_ratio(answer.factors),
        abs(problem.budget_error(answer.factors)),
    )
    return _Certified(times, kept, f"bound {bound / objective:.1%} of the objective")


def _timed(problem: Problem, repeats: int, first: bool) -> tuple[dict[str, Times], Solution, float]:
    """Return the times with and without the bound, taken in the same runs, and the answer and its bound.

    Parameters
    ----------
    problem : Problem
        To solve.
    repeats : int
        Runs that count.
    first : bool
        Whether there is one before them that does not, to compile and to fill caches.
    """
    clocks = []
    for _ in range(repeats + first):
        gc.collect()
        began = time.perf_counter(), time.process_time()
        answer = optimize(problem, SplittingSolver())
        solved = time.perf_counter(), time.process_time()
        bound = lower_bound(problem, answer)
        clocks.append((began, solved, (time.perf_counter(), time.process_time())))
    took = np.diff(np.array(clocks[first:]), axis=1).cumsum(axis=1)  # run, part, clock
    ratio = took[:, :, 0] / took[:, :1, 0]
    names = enumerate((OPTIMIZED, CERTIFIED))
    return {name: Times(took[:, k, 0], took[:, k, 1], ratio[:, k]) for k, name in names}, answer, bound


def _memory(curves: LossCurves) -> tuple[float | None, str]:
    """Return the largest memory of a process that reads, solves and certifies curves [MiB], and a note."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "made.npz"
        keep_made(curves, file)
        used = peak_memory(f"{PROBLEMS}:solve_kept", str(file))
    return (
        used,
        "" if used is None else f"; of the memory the curves are {curves.loss.nbytes / 2**20:.1f} MiB",
    )


def target_points(lengths: list[BenchmarkPoint], rendered: BenchmarkPoint) -> list[BenchmarkPoint]:
    """Return the times for 3000 frames, made and rendered, beside the authors' published one."""
    ours = next(p for p in lengths if p.size == 3000 and p.approach == CERTIFIED)
    cited = BenchmarkPoint(
        task=AUTHORS_TASK,
        approach="the authors' script, 300 samples of it",
        role=Role.CITED,
        size=300,
        size_of="frames optimized",
        repeats=0,
        time=202.0,
        time_low=202.0,
        time_high=202.0,
        note="their program, on another machine, one core; the figure is that of this project's design",
    )
    made = replace(
        ours, task=AUTHORS_TASK, approach=f"{CERTIFIED}, of made curves", size_of="frames optimized"
    )
    # Ratios of both are to the time without the bound, which is no row here.
    return [replace(made, ratio=None), replace(rendered, ratio=None), cited]


def length_claims(
    targets: list[BenchmarkPoint], kept: dict[int, TrackQuality], rendered: TrackQuality
) -> list[BenchmarkClaim]:
    """Return the claims on 3000 frames, on the limits, and on the bound of the longest video."""
    # The optimizer's processor time is what one core needs, if a library should use more of them.
    on_one_core = {
        p.approach: max(p.time, p.processor_time or 0.0) for p in targets if p.role is not Role.CITED
    }
    slowest = max(on_one_core, key=on_one_core.__getitem__)
    both = "the worse of made and rendered curves"
    every = (*kept.values(), rendered)
    longest = max(kept)
    return [
        claim("3000 frames, optimized and with their bound, in 1 s on one core", 1.0, on_one_core[slowest],
              "s", f"{both}: {slowest}; {' and '.join(f'{s:.3g} s' for s in on_one_core.values())}"),
        claim("rate limit met to 1e-6", 1e-6, max(max(k.rate for k in every) - 1.0, 0.0),
              "share of the limit", f"{both}, all lengths"),
        claim("budget met to 1e-6", 1e-6, max(k.off_budget for k in every), "mean factor",
              f"{both}, all lengths"),
        claim(f"the bound is near the objective at {longest} made frames", LEAST_CERTAIN, kept[longest].gap,
              "share of the objective",
              "a gap is what no track can gain, or what the bound does not see; of 3000 rendered frames it "
              f"is {rendered.gap:.2g} (1: nothing is certified)"),
    ]  # fmt: skip


def growth_claim(
    lengths: list[BenchmarkPoint],
) -> tuple[tuple[BenchmarkGrowth, ...], BenchmarkClaim]:
    """Return how time grows with and without the bound, and the claim on it."""
    rows = [tuple(p for p in lengths if p.approach == a) for a in (OPTIMIZED, CERTIFIED)]
    grown = tuple(growth(row) for row in rows)
    last = [sorted(row, key=lambda p: p.size)[-2:] for row in rows]
    slopes = [growth(tuple(pair)).exponent for pair in last]
    words = (
        f"{grown[0].smallest} to {grown[0].largest} frames, without and with the bound, the larger; costs "
        f"that do not grow flatten it: from {last[0][0].size} to {last[0][1].size} frames alone it is "
        f"{slopes[0]:.3g} and {slopes[1]:.3g}"
    )
    largest = max(g.exponent for g in grown)
    return grown, claim("time grows with an exponent of at most 1.15", 1.15, largest, "1", words)

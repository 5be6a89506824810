"""From loss curves and a budget to brightness tracks: nothing is written or drawn here."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization_job import (
    AnalysedVideo,
    FrameWatcher,
    OptimizationJob,
    loss_curves_of,
    start_factors,
    track_header,
)
from evenlight.analysis.tracks.other_measures import with_other_measures
from evenlight.analysis.tracks.track_figure import DrawnTrack
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, TrackHeader
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.contrast.measures import measure_named
from evenlight.method.contrast.pixel_floor import floor_in_samples
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.calm import calmed
from evenlight.method.optimizer.evaluate import (
    RunRecord,
    SolverAnswer,
    limit_without_allowances,
    no_worse_than_constant,
    summarize,
    track_of,
)
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import Problem, Solver, clip_of, joined_curves, joints, pose
from evenlight.method.optimizer.optimize import optimize as optimize_problem
from evenlight.method.optimizer.robust import Measures, optimize_robustly
from evenlight.method.optimizer.splitting import make_solver
from evenlight.progress import shown_progress
from evenlight.stimuli.video.square_pixels import pixel_aspect

# What came of a job: of its whole budget, and of the video and each clip that shares the budget.
Optimized = tuple[OptimizationSummary, tuple[tuple[LossCurves, DrawnTrack], ...]]


def optimize_video(job: OptimizationJob, watchers: Sequence[FrameWatcher] = ()) -> Optimized:
    """Analyse the videos of a job and find their brightness tracks.

    There is a watcher for its video and for each clip that shares the budget, or none. `InputError` if it
    cannot be done, e.g. with loss curves of another video.
    """
    if isinstance(job.source, AnalysedVideo):
        return _optimize_curves(job, [job.source.curves], [FrameSamples()])
    jobs = [job, *(replace(job, source=source, others=()) for source in job.others)]
    samples = [FrameSamples() for _ in jobs]
    began = time.perf_counter()
    seen_by: Sequence[FrameWatcher | None] = watchers or [None] * len(jobs)
    curves = [loss_curves_of(*each) for each in zip(jobs, samples, seen_by, strict=True)]
    give_back_memory()
    by_measure = [
        loss_curves_of(replace(job, model=measure_named(name), model_name=name, robust=()), FrameSamples())
        for name in job.robust[1:]
    ]
    return _optimize_curves(job, curves, samples, time.perf_counter() - began, by_measure)


def give_back_memory() -> None:
    """Have glibc give back what is free: else it keeps all that the heap of each thread has ever held."""
    with suppress(OSError, TypeError, AttributeError):  # of Windows, and of other C libraries
        ctypes.CDLL(None).malloc_trim(0)


@one_blas_thread
def _optimize_curves(
    job: OptimizationJob,
    curves: Sequence[LossCurves],
    samples: Sequence[FrameSamples],
    curves_s: float = 0.0,
    by_measure: Sequence[LossCurves] = (),
) -> Optimized:
    """Find the tracks of a job's video and of the clips that share its budget, of which curves are known.

    The curves took a time `curves_s` [s]; `by_measure` are those by each further measure of a robust job.
    """
    began = time.perf_counter()
    whole = joined_curves(curves) if job.others else curves[0]
    problem = pose(whole, job.request, joints(curves))
    start = None if job.start is None else start_factors(job.start, curves)
    solver = make_solver(job.solver, np.random.default_rng(job.seed), start)
    with shown_progress(job.quiet, f"optimizing {whole.video}") as progress:
        if by_measure:
            measures = Measures((problem, *(pose(own, job.request) for own in by_measure)))
            factors, answer = _robust(job, measures, solver)
            solved = time.perf_counter()
        else:
            solution = optimize_problem(problem, solver)
            calm = calmed(problem, solution.factors, job.calm)
            factors = no_worse_than_constant(problem, calm, solution.factors)
            solved = time.perf_counter()
            progress.step(f"lower bound of {whole.video}")
            bound = lower_bound(problem, solution)
            give_back_memory()
            answer = SolverAnswer(bound, solution.iterations, job.model_name, len(curves))
    shape = float(pixel_aspect(job.source))
    effort = RunRecord(solved - began, curves_s, time.perf_counter() - solved, job.calm, shape)
    header = track_header(job, whole, curves)
    if not job.others:
        header = _with_floor(header, whole, samples[0], factors, job)
    track = track_of(problem, job.request, factors, header)
    summary = summarize(problem, job.request, answer, track, effort)
    if not job.others:
        summary = _measured(summary, track, samples[0], whole, job)
        return summary, (_clip(problem, track, summary, samples[0]),)
    clips, first = [], 0
    # The bound of all clips does not say how much worse than the best a single one is.
    answer = replace(answer, lower_bound=0.0)
    for source, own, held in zip((job.source, *job.others), curves, samples, strict=True):
        own_factors = factors[first : first + own.n_frames]
        part, counts = _on_its_own(clip_of(problem, own, first), own_factors)
        first += own.n_frames
        header = track_header(replace(job, source=source), own, [own])
        track = track_of(part, job.request, own_factors, _with_floor(header, own, held, own_factors, job))
        own_effort = replace(effort, pixel_aspect=float(pixel_aspect(source)))
        alone = _measured(summarize(part, job.request, answer, track, own_effort), track, held, own, job)
        clips.append(_clip(part, track, alone, held, counts))
    return summary, tuple(clips)


def _clip(
    problem: Problem,
    track: BrightnessTrack,
    summary: OptimizationSummary,
    samples: FrameSamples,
    counts: bool = True,
) -> tuple[LossCurves, DrawnTrack]:
    """Return the curves of a video, and its track beside constant dimming of the same power."""
    constant = loss_at(problem.curves, problem.baseline())
    fitted = limit_without_allowances(problem, track.factors)
    return problem.curves, DrawnTrack(track, summary, constant, samples.few, fitted, counts)


def _robust(job: OptimizationJob, measures: Measures, solver: Solver) -> tuple[Array, SolverAnswer]:
    found, bound, bounds = optimize_robustly(measures, solver)
    factors = calmed(measures.problems[0], found.factors, job.calm, measures.worst)
    worst, each = measures.outcome(job.robust, factors, bound, bounds)
    answer = SolverAnswer(bounds[0], found.iterations, job.model_name, minimized=worst, by_measure=each)
    return factors, answer


def _with_floor(
    header: TrackHeader, curves: LossCurves, samples: FrameSamples, factors: Array, job: OptimizationJob
) -> TrackHeader:
    """Return the header of a track made for a backlight, with what pixels would add to the loss."""
    if curves.actuator is Actuator.PIXELS:
        return header
    with shown_progress(job.quiet, f"loss of {curves.video} if pixels dimmed"):
        added = floor_in_samples(samples.few, factors, curves.display, job.model)
    return replace(header, loss_added_by_pixels=added)


def _measured(
    summary: OptimizationSummary,
    track: BrightnessTrack,
    samples: FrameSamples,
    curves: LossCurves,
    job: OptimizationJob,
) -> OptimizationSummary:
    with shown_progress(job.quiet, f"other measures of {curves.video}"):
        return with_other_measures(summary, track, samples.held, curves, job)


def _on_its_own(part: Problem, factors: Array) -> tuple[Problem, bool]:
    """Return a clip's part of a shared problem beside constant dimming of its own power, and if it counts.

    A clip of which no frame counts in the shared objective has an unweighted one of its own.
    """
    part = replace(part, baseline_factor=float(part.budget_weights @ factors))
    if part.importance is None or not np.ptp(part.importance) > 0:
        counts = part.importance is None or bool(part.importance.any())
        return replace(part, importance=None), counts
    return part, True

"""From a video and a budget to the files of a brightness track."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from evenlight.analysis.figure_style import write_png
from evenlight.analysis.tracks.contrast_map_figure import contrast_map, contrast_map_figure
from evenlight.analysis.tracks.earlier_track import clip_folder, start_factors, track_files
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.thumbnails import thumbnails_of
from evenlight.analysis.tracks.track_figure import track_figure
from evenlight.analysis.tracks.track_story import TrackStory, Weighing, uses_same_power
from evenlight.data_schema.brightness_track import (
    BrightnessTrack,
    OptimizationSummary,
    TrackHeader,
    write_track,
)
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.loss_curves import LossCurves, read_loss_curves, write_loss_curves
from evenlight.data_schema.provenance import Provenance, provenance_now, sha256_of_bytes, sha256_of_record
from evenlight.data_schema.text_files import write_json_record
from evenlight.method.calm import calmed
from evenlight.method.choices import SolverName
from evenlight.method.evaluate import Answer, Effort, limit_without_allowances, summarize, track_of
from evenlight.method.loss_curves import analyze_frames, brightness_factors
from evenlight.method.lower_bound import lower_bound
from evenlight.method.optimize import Problem, Request, Solver, pose
from evenlight.method.optimize import optimize as optimize_problem
from evenlight.method.shared_budget import clip_of, joined_curves, joints
from evenlight.method.solvers import make_solver
from evenlight.method.thrift import EVERYTHING, Thrift
from evenlight.stimuli.coarser_frames import coarser
from evenlight.stimuli.video_source import VideoSource


@dataclass(frozen=True, slots=True)
class Work:
    """What is asked: a video on a display, a budget, and how to go about it.

    Attributes
    ----------
    source : VideoSource
        The video.
    display : Display
        What it is shown on.
    request : Request
        Budget, power model, rate limit.
    model, model_name : ContrastModel, str
        Choices of the contrast model, and what they are called.
    solver : SolverName
        Which solver.
    seed : int
        Of the solver's start, where it draws one.
    min_factor : float
        Lowest brightness factor allowed.
    calm : float
        Share of the gain to give up for a calmer track.
    field_of_view : float or None
        Degrees that the video's width spans; None shows it pixel for pixel.
    curves : Path or None
        Loss curves of an earlier run.
    thrift : Thrift
        How much of the video is counted for its loss curves, and on how many cores.
    others : tuple of VideoSource
        Clips that share the budget with it.
    weights, allowances : Path or None
        Files of the sections that the request has.
    start : Path or None
        Track of an earlier result to start from, or its folder; of several clips, the folder of theirs.
    quiet : bool
        Whether to show no progress.
    watch : callable, optional
        Sees each frame as it is analysed, and hands it on.
    """

    source: VideoSource
    display: Display
    request: Request
    model: ContrastModel = DEFAULT_MODEL
    model_name: str = "default"
    solver: SolverName = SolverName.SPLITTING
    seed: int = 1
    min_factor: float = 0.2
    calm: float = 0.0
    field_of_view: float | None = None
    curves: Path | None = None
    thrift: Thrift = EVERYTHING
    others: tuple[VideoSource, ...] = ()
    weights: Path | None = None
    allowances: Path | None = None
    start: Path | None = None
    quiet: bool = False
    watch: Callable[[Iterable[Frame]], Iterable[Frame]] = lambda frames: frames


@dataclass(frozen=True, slots=True)
class _Results:
    """What the figures are drawn from: a track, its figures, and how its frames count in the objective."""

    track: BrightnessTrack
    summary: OptimizationSummary
    weighing: Weighing


def run_optimization(work: Work, folder: Path) -> OptimizationSummary:
    """Analyse, optimize, and write every result into a folder.

    Of several clips that share the budget, each gets a folder of its own in it, numbered and named for it.
    """
    clips = [work, *(replace(work, source=source, others=()) for source in work.others)]
    samples = [FrameSamples() for _ in clips]
    start = time.perf_counter()
    curves = [_loss_curves(clip, held) for clip, held in zip(clips, samples, strict=True)]
    analysed = time.perf_counter()
    whole = joined_curves(curves) if work.others else curves[0]
    problem = pose(whole, work.request, joints(curves))
    solution = optimize_problem(problem, _solver(work, curves))
    if work.calm > 0:
        solution = replace(solution, factors=calmed(problem, solution.factors, work.calm))
    solved = time.perf_counter()
    answer = Answer(lower_bound(problem, solution), solution.iterations, work.model_name, len(clips))
    effort = Effort(solved - analysed, analysed - start, time.perf_counter() - solved, work.calm)
    track = track_of(problem, work.request, solution.factors, _header(work, whole, curves))
    summary = summarize(problem, work.request, answer, track, effort)
    write_json_record(folder / "summary.json", summary)
    if not work.others:
        weighing = Weighing.WEIGHTED if summary.weighted else Weighing.ALIKE
        _write_clip(work, folder, problem, _Results(track, summary, weighing), samples[0])
        return summary
    first, answer = 0, replace(answer, lower_bound=0.0)  # it is about all clips, and says nothing of one
    for number, (clip, own, held) in enumerate(zip(clips, curves, samples, strict=True), start=1):
        factors = solution.factors[first : first + own.n_frames]
        part, weighing = _on_its_own(clip_of(problem, own, first), factors)
        first += own.n_frames
        track = track_of(part, work.request, factors, _header(clip, own, [own]))
        # How much worse than the best one clip is, the bound of all of them does not tell.
        alone = summarize(part, work.request, replace(answer, lower_bound=0.0), track, effort)
        path = folder / clip_folder(number, own.video)
        _write_clip(clip, path, part, _Results(track, alone, weighing), held)
        write_json_record(path / "summary.json", alone)
    return summary


def _on_its_own(part: Problem, factors: NDArray[np.float64]) -> tuple[Problem, Weighing]:
    """Return a clip's part of a shared problem beside constant dimming of the clip's own power.

    A clip of which no frame counts in the shared objective has an unweighted one of its own.
    """
    part = replace(part, baseline_factor=float(part.budget_weights @ factors))
    if part.importance is None or not np.ptp(part.importance) > 0:
        counts = part.importance is None or bool(part.importance.any())
        return replace(part, importance=None), Weighing.ALIKE if counts else Weighing.LEFT_OUT
    return part, Weighing.WEIGHTED


def _solver(work: Work, clips: Sequence[LossCurves]) -> Solver:
    """Return the solver, with the factors of an earlier result at each frame's time if there is one."""
    start = None if work.start is None else start_factors(work.start, clips)
    return make_solver(work.solver, np.random.default_rng(work.seed), start)


def _header(work: Work, curves: LossCurves, clips: Sequence[LossCurves]) -> TrackHeader:
    """Return what a track was made for."""
    request, display = work.request, work.display
    return TrackHeader(
        video=curves.video,
        display_name=display.name,
        display_fingerprint=display.fingerprint,
        power_model=request.power_model.name,
        rate_limit=request.rate_limit.name,
        budget=request.budget,
        budget_unit=request.budget_unit,
        solver=work.solver.value,
        provenance=_provenance(work, clips),
        rate_limit_procedure=request.rate_limit.procedure,
    )


def _write_clip(work: Work, folder: Path, problem: Problem, results: _Results, samples: FrameSamples) -> None:
    """Write the loss curves, the track and the figures of a clip."""
    folder.mkdir(exist_ok=True)
    write_loss_curves(folder / "loss_curves.npz", problem.curves)
    write_track(folder / "track.csv", results.track)
    _draw(work, folder, problem, results, samples)


def curves_of(work: Work, samples: FrameSamples) -> LossCurves:
    """Return the loss curves of a video, of an earlier run or made now; some of its frames are kept."""
    return _loss_curves(work, samples)


def _loss_curves(work: Work, samples: FrameSamples) -> LossCurves:
    """Return the loss curves: of an earlier run if one is given and fits, else of the frames."""
    with _progress(work) as frames:
        shown, display = _with_field_of_view(frames, work)
        watched = samples.watch(work.watch(shown))
        if work.curves is None:
            return analyze_frames(
                watched,
                work.source.name,
                display,
                work.model,
                factors=brightness_factors(work.min_factor),
                provenance=_provenance(work),
                thrift=work.thrift,
            )
        curves = read_loss_curves(work.curves)
        _require_same_source(work, curves, display)
        for _ in watched:  # for the pictures alone
            pass
        return curves


def _require_same_source(work: Work, curves: LossCurves, display: Display) -> None:
    """Raise `InputError` if loss curves are of another video or display than the ones asked for."""
    if curves.provenance.inputs.get("video") != work.source.sha256():
        raise InputError(f"--curves {work.curves}: made of another video than {work.source.name}")
    if curves.factors[0] != brightness_factors(work.min_factor)[0]:
        raise InputError(
            f"--curves {work.curves}: made for factors from {curves.factors[0]:g}, "
            f"asked is --min-factor {work.min_factor:g}"
        )
    if curves.provenance.inputs.get("contrast_model") != sha256_of_record(work.model):
        raise InputError(f"--curves {work.curves}: made with another contrast model than the one asked for")
    if curves.tolerance > work.thrift.tolerance:
        raise InputError(
            f"--curves {work.curves}: made to a tolerance of {curves.tolerance:g}, "
            f"asked is --tolerance {work.thrift.tolerance:g}"
        )
    if (curves.display.fingerprint, curves.display.pixels_per_degree) != (
        display.fingerprint,
        display.pixels_per_degree,
    ):
        raise InputError(
            f"--curves {work.curves}: made for {curves.display.name!r} at "
            f"{curves.display.pixels_per_degree:g} pixels per degree, asked is {display.name!r} at "
            f"{display.pixels_per_degree:g}"
        )


def _with_field_of_view(frames: Iterator[Frame], work: Work) -> tuple[Iterable[Frame], Display]:
    """Return the frames as the display can show them, and the display at their pixels per degree.

    That is the density in the middle of the video. Where the video has more pixels than the display shows in
    its field of view, it is averaged to as many as the display has.
    """
    display = work.display
    if work.field_of_view is None:
        return frames, display
    if not 0 < work.field_of_view < 180:
        raise InputError(f"--field-of-view must lie between 0 and 180 degrees, got {work.field_of_view:g}")
    first = next(frames)
    frames = itertools.chain([first], frames)
    height, width = first.pixel_values.shape[:2]
    distance = width / (2 * math.tan(math.radians(work.field_of_view) / 2))
    density = distance * math.radians(1)
    if density <= display.pixels_per_degree * (1 + 1e-9):
        return frames, replace(display, pixels_per_degree=density)
    narrower = math.floor(width * display.pixels_per_degree / density * (1 + 1e-9))
    share = narrower / width
    shape = max(round(height * share), 1), max(narrower, 1)
    if not work.quiet:
        Console(stderr=True).print(
            f"{work.source.name}: {width} x {height} pixels are more than {display.name!r} shows in "
            f"{work.field_of_view:g} degrees; averaged to {shape[1]} x {shape[0]}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
    return coarser(frames, shape, display.gamma), replace(display, pixels_per_degree=density * share)


@contextmanager
def _progress(work: Work) -> Iterator[Iterator[Frame]]:
    """Yield the video's frames under a progress bar with the time left."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    off = work.quiet or not console.is_terminal
    with Progress(*columns, console=console, disable=off, transient=True) as progress:
        source = work.source
        yield iter(
            progress.track(source.frames(), total=source.n_frames, description=f"analysing {source.name}")
        )


def _provenance(work: Work, clips: Sequence[LossCurves] = ()) -> Provenance:
    """Return where the results come from; the seed where the solver draws random numbers."""
    inputs = {"video": work.source.sha256(), "display": sha256_of_record(work.display)}
    for number, clip in enumerate(clips, start=1):
        key = "video" if number == 1 else f"video_{number}"
        inputs[key] = clip.provenance.inputs.get("video") or inputs[key]
    inputs["contrast_model"] = sha256_of_record(work.model)
    if not clips:
        return provenance_now(inputs=inputs)
    inputs["power_model"] = sha256_of_record(work.request.power_model)
    inputs["rate_limit"] = sha256_of_record(work.request.rate_limit)
    files = {"weights": work.weights, "allowances": work.allowances}
    inputs |= {name: sha256_of_bytes(path.read_bytes()) for name, path in files.items() if path is not None}
    if work.start is not None:
        earlier = [path.read_bytes() for path in track_files(work.start)]
        inputs["start"] = sha256_of_bytes(b"".join(earlier))
    return provenance_now(work.seed if work.solver is SolverName.SLSQP else None, inputs)


def _draw(work: Work, folder: Path, problem: Problem, results: _Results, samples: FrameSamples) -> None:
    """Draw the figures: the track over time, and where contrast is lost in the frame it changes most."""
    story = TrackStory(
        track=results.track,
        baseline_factor=problem.baseline_factor,
        baseline_loss=problem.loss(problem.baseline()),
        objective=results.summary.objective,
        objective_baseline=results.summary.objective_baseline,
        thumbnails=thumbnails_of(samples.held),
        lowest_factor=problem.lowest_factor,
        achieved=results.summary.achieved,
        clips=results.summary.clips,
        same_power=uses_same_power(results.summary),
        weighing=results.weighing,
        fitted_limit=limit_without_allowances(problem, results.track.factors),
    )
    write_png(folder / "track.png", track_figure(story))
    gain = np.abs(story.baseline_loss - results.track.contrast_loss)
    index, pixels = max(samples.held, key=lambda held: float(gain[held[0]]))
    panel = problem.curves.display
    ours, constant = (
        contrast_map(pixels, float(factor), panel, work.model)
        for factor in (results.track.factors[index], problem.baseline_factor)
    )
    name = f"{problem.curves.video} at {problem.curves.times[index]:.1f} s"
    write_png(folder / "contrast_map.png", contrast_map_figure(pixels, ours, constant, name))

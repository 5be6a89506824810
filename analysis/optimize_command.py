"""The command that turns a video and a power budget into a brightness track."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from data_schema.brightness_track import BudgetUnit
from data_schema.errors import InputError
from method.choices import LimitCurve, ModulatedLuminance, SolverName

if TYPE_CHECKING:
    from analysis.frame_samples import FrameSamples
    from data_schema.brightness_track import BrightnessTrack, OptimizationSummary
    from data_schema.display import Display
    from data_schema.frame import Frame
    from data_schema.loss_curves import LossCurves
    from data_schema.provenance import Provenance
    from method.optimize import Problem, Request
    from stimuli.video_source import VideoSource


def optimize(
    video: Annotated[
        str, typer.Argument(help="Video file, folder of images, or name of a built-in sequence.")
    ],
    budget: Annotated[float, typer.Option(help="Budget, in the unit of --budget-unit.")],
    out: Annotated[Path, typer.Option(help="Folder for track.csv, summary.json, track.png and the rest.")],
    budget_unit: Annotated[
        BudgetUnit, typer.Option(help="Mean brightness factor, share of full power, or watt.")
    ] = BudgetUnit.FACTOR,
    display: Annotated[str, typer.Option(help="Display: a preset or a toml file.")] = "varjo-xr3",
    power_model: Annotated[str, typer.Option(help="Power model: a preset or a toml file.")] = "surace2025",
    rate_limit: Annotated[
        str, typer.Option(help="Rate limit: a preset or a json file of `evenlight fit`.")
    ] = "surace2025",
    solver: Annotated[
        SolverName, typer.Option(help="The fast one, or the paper's (short clips).")
    ] = SolverName.SPLITTING,
    limit_curve: Annotated[
        LimitCurve, typer.Option(help="The fitted rate limit, or the lower edge of its band.")
    ] = LimitCurve.FITTED,
    modulated: Annotated[
        ModulatedLuminance, typer.Option(help="Luminance the rate limit is about.")
    ] = ModulatedLuminance.FRAME_MEAN,
    min_factor: Annotated[float, typer.Option(help="Lowest brightness factor allowed, above 0.")] = 0.2,
    field_of_view: Annotated[
        float | None,
        typer.Option(help="Degrees that the video's width spans; else it is shown pixel for pixel."),
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second of a folder of images or a sequence.")
    ] = None,
    curves: Annotated[
        Path | None, typer.Option(help="Loss curves (npz) of an earlier run on this video and display.")
    ] = None,
    calm: Annotated[
        float, typer.Option(help="Share of the gain to give up for a calmer track, e.g. 0.02.")
    ] = 0.0,
    other_display_ok: Annotated[
        bool, typer.Option("--other-display-ok", help="Accept a rate limit fitted on another display.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the solver's start (slsqp).")] = 1,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar, no closing lines.")] = False,
) -> None:
    """Find the brightness track of a video under a power budget."""
    from data_schema.files import results_folder
    from method.optimize import Request
    from method.preset_files import load_display, load_power_model, load_rate_limit
    from method.rate_limit import require_same_display
    from stimuli.video_source import open_video

    if not 0 < min_factor < 1:
        raise InputError(f"--min-factor must lie between 0 and 1, got {min_factor:g}")
    if not 0 <= calm <= 1:
        raise InputError(f"--calm must lie between 0 and 1, got {calm:g}")
    panel, limit = load_display(display), load_rate_limit(rate_limit)
    if not other_display_ok:
        require_same_display(limit, panel)
    request = Request(budget, budget_unit, load_power_model(power_model), limit, limit_curve, modulated)
    source = open_video(video, fps)
    work = _Work(source, panel, request, solver, seed, min_factor, calm, field_of_view, curves, quiet)
    with results_folder(out) as folder:
        summary = _run(work, folder)
    if not quiet:
        _tell(summary, out)


@dataclass(frozen=True, slots=True)
class _Work:
    """What the command was asked, read and checked."""

    source: VideoSource
    display: Display
    request: Request
    solver: SolverName
    seed: int
    min_factor: float
    calm: float
    field_of_view: float | None
    curves: Path | None
    quiet: bool


@dataclass(frozen=True, slots=True)
class _Results:
    """What the figures are drawn from."""

    track: BrightnessTrack
    summary: OptimizationSummary


def _run(work: _Work, folder: Path) -> OptimizationSummary:
    """Analyse, optimize, and write every result into a folder."""
    import numpy as np

    from analysis.frame_samples import FrameSamples
    from data_schema.brightness_track import TrackHeader, write_track
    from data_schema.loss_curves import write_loss_curves
    from data_schema.text_files import write_json_record
    from method.calm import calmed
    from method.evaluate import Timing, summarize, track_of
    from method.optimize import optimize as optimize_problem
    from method.optimize import pose
    from method.solvers import make_solver

    samples = FrameSamples()
    start = time.perf_counter()
    curves = _loss_curves(work, samples)
    analysed = time.perf_counter()
    problem = pose(curves, work.request)
    solution = optimize_problem(problem, make_solver(work.solver, np.random.default_rng(work.seed)))
    if work.calm > 0:
        solution = replace(solution, factors=calmed(problem, solution.factors, work.calm))
    timing = Timing(solve_s=time.perf_counter() - analysed, curves_s=analysed - start)
    request, display = work.request, work.display
    header = TrackHeader(
        video=curves.video,
        display_name=display.name,
        display_fingerprint=display.fingerprint,
        power_model=request.power_model.name,
        rate_limit=request.rate_limit.name,
        budget=request.budget,
        budget_unit=request.budget_unit,
        solver=work.solver.value,
        provenance=_provenance(work, curves),
    )
    track = track_of(problem, request, solution.factors, header)
    summary = summarize(problem, request, solution, track, timing)
    write_loss_curves(folder / "loss_curves.npz", curves)
    write_track(folder / "track.csv", track)
    write_json_record(folder / "summary.json", summary)
    _draw(folder, problem, _Results(track, summary), samples)
    return summary


def _loss_curves(work: _Work, samples: FrameSamples) -> LossCurves:
    """Return the loss curves: of an earlier run if one is given and fits, else of the frames."""
    from data_schema.loss_curves import read_loss_curves
    from method.loss_curves import analyze_frames, brightness_factors

    with _progress(work) as frames:
        watched, display = _with_field_of_view(samples.watch(frames), work)
        if work.curves is None:
            return analyze_frames(
                watched,
                work.source.name,
                display,
                factors=brightness_factors(work.min_factor),
                provenance=_provenance(work),
            )
        curves = read_loss_curves(work.curves)
        _require_same_source(work, curves, display)
        for _ in watched:  # for the pictures alone
            pass
        return curves


def _require_same_source(work: _Work, curves: LossCurves, display: Display) -> None:
    """Raise `InputError` if loss curves are of another video or display than the ones asked for."""
    if curves.provenance.inputs.get("video") != work.source.sha256():
        raise InputError(f"--curves {work.curves}: made of another video than {work.source.name}")
    if (curves.display.fingerprint, curves.display.pixels_per_degree) != (
        display.fingerprint,
        display.pixels_per_degree,
    ):
        raise InputError(
            f"--curves {work.curves}: made for {curves.display.name!r} at "
            f"{curves.display.pixels_per_degree:g} pixels per degree, asked is {display.name!r} at "
            f"{display.pixels_per_degree:g}"
        )


def _with_field_of_view(frames: Iterator[Frame], work: _Work) -> tuple[Iterable[Frame], Display]:
    """Return the frames, and the display at the pixels per degree that the video has in its middle."""
    import itertools
    import math

    display = work.display
    if work.field_of_view is None:
        return frames, display
    if not 0 < work.field_of_view < 180:
        raise InputError(f"--field-of-view must lie between 0 and 180 degrees, got {work.field_of_view:g}")
    first = next(frames)
    distance = first.pixel_values.shape[1] / (2 * math.tan(math.radians(work.field_of_view) / 2))
    density = distance * math.radians(1)
    if density > display.pixels_per_degree * (1 + 1e-9):
        raise InputError(
            f"--field-of-view {work.field_of_view:g} would put {density:.4g} pixels into a degree, "
            f"{display.name!r} shows {display.pixels_per_degree:g}; widen it, or scale the video down"
        )
    return itertools.chain([first], frames), replace(display, pixels_per_degree=density)


@contextmanager
def _progress(work: _Work) -> Iterator[Iterator[Frame]]:
    """Yield the video's frames under a progress bar with the time left."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    off = work.quiet or not console.is_terminal
    with Progress(*columns, console=console, disable=off, transient=True) as progress:
        source = work.source
        yield iter(
            progress.track(source.frames(), total=source.n_frames, description=f"analysing {source.name}")
        )


def _provenance(work: _Work, curves: LossCurves | None = None) -> Provenance:
    """Return where the results come from; the seed where the solver draws random numbers."""
    from data_schema.provenance import provenance_now, sha256_of_record

    video = curves.provenance.inputs.get("video") if curves else None
    inputs = {"video": video or work.source.sha256(), "display": sha256_of_record(work.display)}
    if curves is None:
        return provenance_now(inputs=inputs)
    inputs["power_model"] = sha256_of_record(work.request.power_model)
    inputs["rate_limit"] = sha256_of_record(work.request.rate_limit)
    return provenance_now(work.seed if work.solver is SolverName.SLSQP else None, inputs)


def _draw(folder: Path, problem: Problem, results: _Results, samples: FrameSamples) -> None:
    """Draw the figures: the track over time, and where contrast is lost in the frame it changes most."""
    import numpy as np

    from analysis.contrast_map_figure import contrast_map, contrast_map_figure
    from analysis.figure_style import write_png
    from analysis.thumbnails import thumbnails_of
    from analysis.track_figure import track_figure
    from analysis.track_story import TrackStory

    story = TrackStory(
        track=results.track,
        baseline_factor=problem.baseline_factor,
        baseline_loss=problem.loss(problem.baseline()),
        objective=results.summary.objective,
        objective_baseline=results.summary.objective_baseline,
        thumbnails=thumbnails_of(samples.held),
        lowest_factor=problem.lowest_factor,
    )
    write_png(folder / "track.png", track_figure(story))
    gain = np.abs(story.baseline_loss - results.track.contrast_loss)
    index, pixels = max(samples.held, key=lambda held: float(gain[held[0]]))
    panel = problem.curves.display
    ours, constant = (
        contrast_map(pixels, float(factor), panel)
        for factor in (results.track.factors[index], problem.baseline_factor)
    )
    name = f"{problem.curves.video} at {problem.curves.times[index]:.1f} s"
    write_png(folder / "contrast_map.png", contrast_map_figure(pixels, ours, constant, name))


def _tell(summary: OptimizationSummary, out: Path) -> None:
    """Say what was achieved, in a few lines."""
    less = 1 - summary.objective / summary.objective_baseline if summary.objective_baseline > 0 else 0.0
    typer.echo(
        f"{summary.video}: {summary.frames} frames at {summary.mean_power:.4g} W, "
        f"{summary.mean_power / summary.full_power:.1%} of full power, "
        f"mean factor {summary.mean_factor:.4g}\n"
        f"contrast loss differs by {summary.objective:.4g} between two frames, "
        f"{summary.objective_baseline:.4g} at constant dimming ({less:.1%} less; "
        f"no track does better than {summary.lower_bound:.4g})\n"
        f"fastest change {summary.max_rate_ratio:.1%} of the rate limit {summary.rate_limit!r}\n"
        f"results in {out}"
    )

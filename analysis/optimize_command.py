"""The command that turns a video and a power budget into a brightness track."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.analysis.track_options import (
    AcceptWideBandOption,
    ActuatorOption,
    BudgetUnitOption,
    ContrastModelOption,
    CurvesOption,
    DeviceOption,
    DisplayOption,
    FieldOfViewOption,
    FpsOption,
    JobsOption,
    LimitCurveOption,
    MinFactorOption,
    ModulatedOption,
    OtherDisplayOption,
    PowerModelOption,
    QuietOption,
    RateLimitOption,
    VideoArgument,
    check_video,
    chosen_device,
    require_curves_to_compute,
    require_there,
)
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import Device, LimitCurve, ModulatedLuminance, SolverName

if TYPE_CHECKING:
    from evenlight.data_schema.tracks.brightness_track import OptimizationSummary


def optimize(
    video: VideoArgument,
    budget: Annotated[float, typer.Option(help="Budget, in the unit of --budget-unit.")],
    out: Annotated[Path, typer.Option(help="Folder for track.csv, summary.json, track.png and the rest.")],
    budget_unit: BudgetUnitOption = BudgetUnit.FACTOR,
    display: DisplayOption = "varjo-xr3",
    power_model: PowerModelOption = "surace2025",
    rate_limit: RateLimitOption = "surace2025",
    contrast_model: ContrastModelOption = "default",
    solver: Annotated[
        SolverName, typer.Option(help="The fast one, the paper's, or a general one (short clips).")
    ] = SolverName.SPLITTING,
    limit_curve: LimitCurveOption = LimitCurve.FITTED,
    modulated: ModulatedOption = ModulatedLuminance.FRAME_MEAN,
    min_factor: MinFactorOption = 0.2,
    field_of_view: FieldOfViewOption = None,
    actuator: ActuatorOption = Actuator.BACKLIGHT,
    fps: FpsOption = None,
    curves: CurvesOption = None,
    tolerance: Annotated[
        float,
        typer.Option(help="Error of contrast loss to accept for counting fine detail only where it changes."),
    ] = 0.001,
    jobs: JobsOption = 1,
    device: DeviceOption = Device.CPU,
    weights: Annotated[
        Path | None, typer.Option(help="Sections that count more or less: csv start_s,end_s,weight.")
    ] = None,
    allowances: Annotated[
        Path | None,
        typer.Option(help="Sections with another rate limit: csv start_s,end_s,allowance; 0 holds still."),
    ] = None,
    with_: Annotated[
        list[str] | None, typer.Option("--with", help="Another clip to share the budget; may be repeated.")
    ] = None,
    start: Annotated[
        Path | None, typer.Option(help="Track of an earlier result to start from, or its folder.")
    ] = None,
    calm: Annotated[
        float, typer.Option(help="Share of the gain to give up for a calmer track, e.g. 0.02.")
    ] = 0.0,
    other_display_ok: OtherDisplayOption = False,
    accept_wide_band: AcceptWideBandOption = False,
    seed: Annotated[int, typer.Option(help="Seed of the solver's start (slsqp).")] = 1,
    quiet: QuietOption = False,
) -> None:
    """Find the brightness track of a video under a power budget."""
    from evenlight.analysis.earlier_results import files_in, remove_earlier_track
    from evenlight.analysis.tracks.optimization_job import OptimizationJob
    from evenlight.analysis.tracks.track_results import run_optimization
    from evenlight.data_schema.storage.tables import read_rows
    from evenlight.data_schema.storage.whole_files import results_folder
    from evenlight.data_schema.tracks.brightness_track import AllowanceSection, WeightSection
    from evenlight.method.choices import AnalysisEffort
    from evenlight.method.optimizer.request import Request, require_possible
    from evenlight.method.preset_files import (
        load_contrast_model,
        load_display,
        load_power_model,
        load_rate_limit_for,
    )
    from evenlight.stimuli.sequences import open_videos

    check_video(video, min_factor, field_of_view, jobs)
    require_curves_to_compute(curves, jobs, device)
    if not 0 <= calm <= 1:
        raise InputError(f"--calm must lie between 0 and 1, got {calm:g}")
    if not 0 <= tolerance < 1:
        raise InputError(
            f"--tolerance must lie in 0 (count all of every frame) to below 1, got {tolerance:g}"
        )
    require_seed(seed)
    require_there("--start", start, "a track.csv, or the folder of an earlier result")
    require_there("--weights", weights, "a csv table start_s,end_s,weight")
    require_there("--allowances", allowances, "a csv table start_s,end_s,allowance")
    if start is not None and solver is not SolverName.SPLITTING:
        raise InputError(f"--start is for --solver splitting; {solver.value} starts on its own")
    panel = load_display(display)
    limit = load_rate_limit_for(panel, rate_limit, other_display_ok, accept_wide_band)
    request = Request(
        budget, budget_unit, load_power_model(power_model), limit, limit_curve, modulated,
        weights=() if weights is None else tuple(read_rows(WeightSection, weights)),
        allowances=() if allowances is None else tuple(read_rows(AllowanceSection, allowances)),
    )  # fmt: skip
    require_possible(request, min_factor)
    if curves is not None and with_:
        raise InputError("--curves holds the loss curves of one video; leave it out where --with adds others")
    source, *others = open_videos([video, *(with_ or ())], fps)
    model = load_contrast_model(contrast_model)
    work = OptimizationJob(
        source=source,
        display=panel,
        request=request,
        model=model,
        model_name=contrast_model,
        solver=solver,
        seed=seed,
        min_factor=min_factor,
        calm=calm,
        field_of_view=field_of_view,
        actuator=actuator,
        curves=curves,
        others=tuple(others),
        weights=weights,
        allowances=allowances,
        start=start,
        effort=AnalysisEffort(
            tolerance, jobs, Device.CPU if curves else chosen_device(device, panel, model, quiet)
        ),
        quiet=quiet,
    )
    with results_folder(out) as folder:
        summary = run_optimization(work, folder)
        written = files_in(folder)
    remove_earlier_track(out, written)
    if not quiet:
        _print_result(summary, out)


def _print_result(summary: OptimizationSummary, out: Path) -> None:
    """Print what was achieved, in a few lines."""
    less = 1 - summary.objective / summary.objective_baseline if summary.objective_baseline > 0 else 0.0
    weighted = "weighted by --weights, " if summary.weighted else ""
    certified = (
        f"no track does better than {summary.lower_bound:.4g}" if summary.lower_bound > 0 else "not certified"
    )
    asked = "" if summary.rate_limit_procedure is None else f" ({summary.rate_limit_procedure.value})"
    accepted = ", whose wide or missing band was accepted" if summary.wide_band_accepted else ""
    typer.echo(
        f"{summary.video}: {summary.frames} frames at {summary.mean_power:.4g} W, "
        f"{summary.mean_power / summary.full_power:.1%} of full power, "
        f"mean factor {summary.mean_factor:.4g}\n"
        f"{weighted}contrast loss differs by {summary.objective:.4g} between two frames, "
        f"{summary.objective_baseline:.4g} at constant dimming ({less:.1%} less; "
        f"{certified})\n"
        f"fastest change {summary.max_rate_ratio:.1%} of the rate limit {summary.rate_limit!r}{asked}"
        f"{accepted}{beyond_the_fitted(summary)}\n"
        f"results in {out}"
    )


def beyond_the_fitted(summary: OptimizationSummary) -> str:
    """Return how much faster than the fitted limit brightness changes, where allowances say that it may."""
    allowance, ratio = summary.largest_allowance or 0.0, summary.max_rate_ratio_fitted or 0.0
    if not allowance > 1:
        return ""
    if ratio > 1 + 1e-6:
        return f" as allowed;\nwhere allowances say so, up to {ratio:.3g} times the fitted limit"
    return f" as allowed;\nnowhere beyond the fitted limit, though allowances go up to {allowance:g} times it"

"""The command that turns a video and a power budget into a brightness track."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from data_schema.brightness_track import BudgetUnit
from data_schema.errors import InputError
from method.choices import Device, LimitCurve, ModulatedLuminance, SolverName

if TYPE_CHECKING:
    from data_schema.brightness_track import OptimizationSummary

MIN_FACTORS = (0.001, 0.99)  # a display can hardly be dimmed further; beyond, there is nothing left to choose
WIDEST_FIELD = 175.0  # [deg] a flat screen that spans 180 would be infinitely wide


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
    contrast_model: Annotated[
        str, typer.Option(help="Choices of the contrast model: a preset or a toml file.")
    ] = "default",
    solver: Annotated[
        SolverName, typer.Option(help="The fast one, the paper's, or a general one (short clips).")
    ] = SolverName.SPLITTING,
    limit_curve: Annotated[
        LimitCurve, typer.Option(help="The fitted rate limit, or the lower edge of its band.")
    ] = LimitCurve.FITTED,
    modulated: Annotated[
        ModulatedLuminance, typer.Option(help="Luminance the rate limit is about.")
    ] = ModulatedLuminance.FRAME_MEAN,
    min_factor: Annotated[float, typer.Option(help="Lowest brightness factor allowed, 0.001 to 0.99.")] = 0.2,
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
    tolerance: Annotated[
        float,
        typer.Option(help="Error of contrast loss to accept for counting fine detail only where it changes."),
    ] = 0.001,
    jobs: Annotated[
        int, typer.Option(help="Frames to analyse at a time, each on a core; 0 for all cores.")
    ] = 1,
    device: Annotated[
        Device,
        typer.Option(help="What computes loss curves; auto: compute shaders where hardware runs them."),
    ] = Device.CPU,
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
    other_display_ok: Annotated[
        bool, typer.Option("--other-display-ok", help="Accept a rate limit fitted on another display.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the solver's start (slsqp).")] = 1,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar, no closing lines.")] = False,
) -> None:
    """Find the brightness track of a video under a power budget."""
    from analysis.device_choice import chosen_device
    from analysis.optimization import Work, run_optimization
    from data_schema.files import results_folder
    from data_schema.section import AllowanceSection, WeightSection
    from data_schema.text_files import read_rows
    from method.optimize import Request, require_possible
    from method.preset_files import (
        load_contrast_model,
        load_display,
        load_power_model,
        load_rate_limit,
    )
    from method.rate_limit import require_same_display
    from method.thrift import Thrift
    from stimuli.video_source import open_video

    low, high = MIN_FACTORS
    if not low <= min_factor <= high:
        raise InputError(f"--min-factor must lie in {low:g} to {high:g}, got {min_factor:.15g}")
    if not 0 <= calm <= 1:
        raise InputError(f"--calm must lie between 0 and 1, got {calm:g}")
    if field_of_view is not None and not 0 < field_of_view <= WIDEST_FIELD:
        raise InputError(
            f"--field-of-view must lie above 0 and not above {WIDEST_FIELD:g} degrees, got {field_of_view:g}"
        )
    if not 0 <= tolerance < 1:
        raise InputError(
            f"--tolerance must lie in 0 (count all of every frame) to below 1, got {tolerance:g}"
        )
    if jobs < 0:
        raise InputError(f"--jobs must be 0 (all cores) or more, got {jobs}")
    if seed < 0:
        raise InputError(f"--seed must be 0 or more, got {seed}")
    if not video:
        raise InputError(
            "the video has an empty name; give a file, a folder of images or a built-in sequence"
        )
    panel, limit = load_display(display), load_rate_limit(rate_limit)
    if not other_display_ok:
        require_same_display(limit, panel)
    request = Request(
        budget, budget_unit, load_power_model(power_model), limit, limit_curve, modulated,
        weights=() if weights is None else tuple(read_rows(WeightSection, weights)),
        allowances=() if allowances is None else tuple(read_rows(AllowanceSection, allowances)),
    )  # fmt: skip
    require_possible(request, min_factor)
    if curves is not None and with_:
        raise InputError("--curves holds the loss curves of one video; leave it out where --with adds others")
    source, others = open_video(video, fps), tuple(open_video(other, fps) for other in with_ or ())
    model = load_contrast_model(contrast_model)
    work = Work(
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
        curves=curves,
        others=others,
        weights=weights,
        allowances=allowances,
        start=start,
        thrift=Thrift(tolerance, jobs, chosen_device(device, panel, model, quiet)),
        quiet=quiet,
    )
    with results_folder(out) as folder:
        summary = run_optimization(work, folder)
    if not quiet:
        _tell(summary, out)


def _tell(summary: OptimizationSummary, out: Path) -> None:
    """Say what was achieved, in a few lines."""
    less = 1 - summary.objective / summary.objective_baseline if summary.objective_baseline > 0 else 0.0
    certified = (
        f"no track does better than {summary.lower_bound:.4g}" if summary.lower_bound > 0 else "not certified"
    )
    asked = "" if summary.rate_limit_procedure is None else f" ({summary.rate_limit_procedure.value})"
    typer.echo(
        f"{summary.video}: {summary.frames} frames at {summary.mean_power:.4g} W, "
        f"{summary.mean_power / summary.full_power:.1%} of full power, "
        f"mean factor {summary.mean_factor:.4g}\n"
        f"contrast loss differs by {summary.objective:.4g} between two frames, "
        f"{summary.objective_baseline:.4g} at constant dimming ({less:.1%} less; "
        f"{certified})\n"
        f"fastest change {summary.max_rate_ratio:.1%} of the rate limit {summary.rate_limit!r}{asked}\n"
        f"results in {out}"
    )

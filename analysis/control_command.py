"""The command that runs the online controller over a video."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.optimize_command import MIN_FACTORS, WIDEST_FIELD
from data_schema.brightness_track import BudgetUnit
from data_schema.errors import InputError
from method.choices import Device, LimitCurve, ModulatedLuminance

if TYPE_CHECKING:
    from analysis.control_run import Controlled
    from data_schema.control import TargetRow

MOST_TARGETS = 200


def control(
    video: Annotated[
        str, typer.Argument(help="Video file, folder of images, or name of a built-in sequence.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for track.csv, control.json, track.png and the rest.")],
    target_loss: Annotated[
        float | None, typer.Option(help="Contrast loss to hold, 0 to 1; with --budget only to begin with.")
    ] = None,
    budget: Annotated[
        float | None, typer.Option(help="Budget that the target follows, in the unit of --budget-unit.")
    ] = None,
    budget_unit: Annotated[
        BudgetUnit, typer.Option(help="Mean brightness factor, share of full power, or watt.")
    ] = BudgetUnit.FACTOR,
    horizon: Annotated[float, typer.Option(help="Seconds over which the mean is to meet the budget.")] = 60.0,
    proportional: Annotated[float, typer.Option(help="Gain K_p.")] = 0.2,
    integral: Annotated[float, typer.Option(help="Gain K_i, per frame of 1 / --gain-rate.")] = 0.01,
    derivative: Annotated[float, typer.Option(help="Gain K_d, likewise.")] = 0.05,
    gain_rate: Annotated[
        float, typer.Option(help="Frame rate that the gains are for [Hz]; 0: that of the video.")
    ] = 90.0,
    start_factor: Annotated[
        float | None, typer.Option(help="Factor of the first frame; else where it has the target loss.")
    ] = None,
    tune: Annotated[
        bool, typer.Option("--tune", help="Choose the gains for this video, within stability margins.")
    ] = False,
    sweep: Annotated[
        str | None, typer.Option(help="Targets to try as well, LOWEST:HIGHEST:HOW_MANY, as 0.01:0.1:10.")
    ] = None,
    display: Annotated[str, typer.Option(help="Display: a preset or a toml file.")] = "varjo-xr3",
    power_model: Annotated[str, typer.Option(help="Power model: a preset or a toml file.")] = "surace2025",
    rate_limit: Annotated[
        str, typer.Option(help="Rate limit: a preset or a json file of `evenlight fit`.")
    ] = "surace2025",
    contrast_model: Annotated[
        str, typer.Option(help="Choices of the contrast model: a preset or a toml file.")
    ] = "default",
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
    jobs: Annotated[
        int, typer.Option(help="Frames to analyse at a time, each on a core; 0 for all cores.")
    ] = 1,
    device: Annotated[
        Device,
        typer.Option(help="What computes loss curves; auto: compute shaders where hardware runs them."),
    ] = Device.CPU,
    other_display_ok: Annotated[
        bool, typer.Option("--other-display-ok", help="Accept a rate limit fitted on another display.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar, no closing lines.")] = False,
) -> None:
    """Dim a video online: hold a contrast loss, or a power budget, knowing nothing of the frames to come."""
    from analysis.control_results import run_control
    from analysis.control_run import Control
    from analysis.device_choice import chosen_device
    from analysis.optimization import Work
    from data_schema.files import results_folder
    from method.controller import ControllerSettings
    from method.governor import GovernorSettings
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

    _require_between("--min-factor", min_factor, MIN_FACTORS)
    if target_loss is None and budget is None:
        raise InputError("give --target-loss, the contrast loss to hold, or --budget, which it is to follow")
    for name, value in (("--target-loss", target_loss), ("--start-factor", start_factor)):
        if value is not None:
            _require_between(name, value, (0.0 if name == "--target-loss" else min_factor, 1.0))
    for name, gain in (
        ("--proportional", proportional), ("--integral", integral), ("--derivative", derivative),
        ("--gain-rate", gain_rate),
    ):  # fmt: skip
        _require_between(name, gain, (0.0, 1e6))
    _require_between("--horizon", horizon, (0.1, 1e6))
    if field_of_view is not None and not 0 < field_of_view <= WIDEST_FIELD:
        raise InputError(
            f"--field-of-view must lie above 0 and not above {WIDEST_FIELD:g} degrees, got {field_of_view:g}"
        )
    if jobs < 0:
        raise InputError(f"--jobs must be 0 (all cores) or more, got {jobs}")
    if not video:
        raise InputError(
            "the video has an empty name; give a file, a folder of images or a built-in sequence"
        )
    panel, limit = load_display(display), load_rate_limit(rate_limit)
    if not other_display_ok:
        require_same_display(limit, panel)
    power = load_power_model(power_model)
    request = Request(1.0 if budget is None else budget, budget_unit, power, limit, limit_curve, modulated)
    if budget is not None:
        require_possible(request, min_factor)
    model = load_contrast_model(contrast_model)
    work = Work(
        source=open_video(video, fps),
        display=panel,
        request=request,
        model=model,
        model_name=contrast_model,
        min_factor=min_factor,
        field_of_view=field_of_view,
        curves=curves,
        quiet=quiet,
        # Every frame by itself: between frames one would have to know the next.
        thrift=Thrift(jobs=jobs, device=chosen_device(device, panel, model, quiet)),
    )
    settings = ControllerSettings(
        target_loss=target_loss or 0.0,
        proportional=proportional,
        integral=integral,
        derivative=derivative,
        gain_rate=gain_rate or None,
        lowest_factor=min_factor,
    )
    asked = Control(
        work=work,
        settings=settings,
        start_factor=start_factor,
        budget=None if budget is None else GovernorSettings(budget, budget_unit, horizon),
        target_is_given=target_loss is not None,
        tuned=tune,
        sweep=targets_in(sweep),
    )
    with results_folder(out) as folder:
        done, rows = run_control(asked, folder)
    if not quiet:
        _tell(done, rows, out)


def _require_between(name: str, value: float, limits: tuple[float, float]) -> None:
    """Refuse a value of an option outside of its limits."""
    low, high = limits
    if not low <= value <= high:
        raise InputError(f"{name} must lie in {low:g} to {high:g}, got {value:.15g}")


def targets_in(words: str | None) -> tuple[float, ...]:
    """Return the targets of a sweep, evenly spread.

    >>> targets_in("0.01:0.03:3")
    (0.01, 0.02, 0.03)
    """
    if words is None:
        return ()
    try:
        low_word, high_word, count_word = words.split(":")
        low, high, count = float(low_word), float(high_word), int(count_word)
    except ValueError:
        raise InputError(f"--sweep {words!r}: give LOWEST:HIGHEST:HOW_MANY, as 0.01:0.1:10") from None
    if not 0 <= low < high <= 1 or not 2 <= count <= MOST_TARGETS:
        raise InputError(
            f"--sweep {words}: need targets with 0 <= LOWEST < HIGHEST <= 1, and 2 to {MOST_TARGETS} of them"
        )
    return tuple(round(low + (high - low) * k / (count - 1), 12) for k in range(count))


def _tell(done: Controlled, rows: list[TargetRow], out: Path) -> None:
    """Say how steady the loss was, and what it cost, in a few lines."""
    control, summary, spread = done.control, done.summary, done.spread
    ratio = "" if spread.ratio is None else f", {spread.ratio:.2f} times as much"
    typer.echo(
        f"{control.video}: {summary.frames} frames, contrast loss {control.mean_loss:.4g} on average, target "
        f"{_target(done)}\n"
        f"its SD over time is {control.sd_loss:.4g}, {control.sd_loss_constant:.4g} at constant dimming by "
        f"the same mean factor{ratio}\n"
        f"mean factor {control.mean_factor:.4g}, {control.mean_power:.4g} W, "
        f"{summary.mean_power / summary.full_power:.1%} of full power; "
        f"{control.share_limited:.1%} of the time at the rate limit {summary.rate_limit!r} or a bound"
    )
    if control.budget is not None and control.budget_unit is not None and control.horizon is not None:
        typer.echo(_budget_words(done))
    if done.tuning is not None:
        before, after = done.tuning.before, done.tuning.after
        typer.echo(
            f"gains tuned: K_p {after.proportional:.4g}, K_i {after.integral:.4g}, "
            f"K_d {after.derivative:.4g}; root mean square error {before.rms_error:.4g} before, "
            f"{after.rms_error:.4g} after"
        )
    if rows:
        typer.echo(
            f"targets {rows[0].target_loss:g} to {rows[-1].target_loss:g} take mean factors "
            f"{rows[0].mean_factor:.4g} to {rows[-1].mean_factor:.4g}"
        )
    typer.echo(f"results in {out}")


def _target(done: Controlled) -> str:
    """Return the target, or from where to where it went."""
    first, last = done.control.target_loss, done.control.final_target_loss
    return f"{first:.4g}" if done.control.budget is None else f"from {first:.4g} to {last:.4g}"


def _budget_words(done: Controlled) -> str:
    """Return how well the budget was met."""
    control = done.control
    assert control.budget_unit is not None
    words = f"budget {control.budget:g} ({control.budget_unit.value}): {done.summary.achieved:.4g} on average"
    if control.horizon_error is None:
        words += f"; shorter than the horizon of {control.horizon:g} s"
    else:
        words += f"; over any {control.horizon:g} s off by {control.horizon_error:.2g} at most"
    if control.share_budget_held:
        words += f"; out of reach at a bound for {control.share_budget_held:.1%} of the time"
    return words

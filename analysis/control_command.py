"""The command that runs the online controller over a video."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.analysis.track_options import (
    AcceptWideBandOption,
    ActuatorOption,
    BatteryOption,
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
    NoCacheOption,
    NoPlayerOption,
    OtherDisplayOption,
    PowerModelOption,
    QuietOption,
    RateLimitOption,
    VideoArgument,
    borrowed_line,
    check_video,
    chosen_device,
    require_between,
    require_curves_to_compute,
    results_in,
)
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import Device, LimitCurve, ModulatedLuminance
from evenlight.option_panels import asked, output

if TYPE_CHECKING:
    from evenlight.analysis.tracks.control_run import ControlResult
    from evenlight.data_schema.tracks.control import TargetRow

MOST_TARGETS = 200
gains_of = functools.partial(typer.Option, rich_help_panel="PID controller")
CURVES_TOLERANCE = 0.001  # of given loss curves: the default of `optimize`


def control(
    video: VideoArgument,
    out: Annotated[Path, output(help="Folder for track.csv, control.json, track.png, player.html and more.")],
    target_loss: Annotated[
        float | None,
        asked(
            help="Share of visible contrast that each frame may lose, 0 to 1; with --budget only to begin "
            "with."
        ),
    ] = None,
    budget: Annotated[
        float | None, asked(help="Budget to meet on average, in --budget-unit; the target loss follows it.")
    ] = None,
    budget_unit: Annotated[
        BudgetUnit | None,
        asked(
            help="What --budget counts: the mean brightness factor, the share of the power at full "
            "brightness, or watts.",
            show_default="factor",
        ),
    ] = None,
    horizon: Annotated[
        float | None, asked(help="Time over which the mean is to meet the budget.", show_default="60")
    ] = None,
    lookahead: Annotated[
        float | None,
        asked(
            metavar="SECONDS",
            help="Plan ahead, with so many seconds of the video to come known (0: none), in place of the "
            "PID controller.",
        ),
    ] = None,
    proportional: Annotated[
        float | None, gains_of(metavar="K_P", help="Proportional gain.", show_default="0.2")
    ] = None,
    integral: Annotated[
        float | None,
        gains_of(metavar="K_I", help="Integral gain, per frame of --gain-rate.", show_default="0.01"),
    ] = None,
    derivative: Annotated[
        float | None,
        gains_of(metavar="K_D", help="Derivative gain, per frame of --gain-rate.", show_default="0.05"),
    ] = None,
    gain_rate: Annotated[
        float | None,
        gains_of(
            metavar="HZ", help="Frame rate that the gains are for; 0: that of the video.", show_default="90"
        ),
    ] = None,
    start_factor: Annotated[
        float | None,
        asked(
            metavar="FACTOR",
            help="Brightness factor of the first frame. Otherwise the one at which it has the target loss.",
        ),
    ] = None,
    tune: Annotated[
        bool,
        gains_of("--tune", help="Choose gains for this video, with stability margins; ignores --budget."),
    ] = False,
    sweep: Annotated[
        str | None,
        gains_of(metavar="LOW:HIGH:N", help="Also try N target losses from LOW to HIGH; ignores --budget."),
    ] = None,
    display: DisplayOption = None,
    power_model: PowerModelOption = "surace2025",
    rate_limit: RateLimitOption = "surace2025",
    contrast_model: ContrastModelOption = "default",
    limit_curve: LimitCurveOption = LimitCurve.FITTED,
    modulated: ModulatedOption = ModulatedLuminance.FRAME_MEAN,
    min_factor: MinFactorOption = 0.2,
    field_of_view: FieldOfViewOption = None,
    actuator: ActuatorOption = Actuator.BACKLIGHT,
    fps: FpsOption = None,
    curves: CurvesOption = None,
    jobs: JobsOption = 1,
    device: DeviceOption = Device.CPU,
    other_display_ok: OtherDisplayOption = False,
    accept_wide_band: AcceptWideBandOption = False,
    battery_wh: BatteryOption = None,
    no_cache: NoCacheOption = False,
    no_player: NoPlayerOption = False,
    quiet: QuietOption = False,
) -> None:
    """Dim a video as a player would, frame by frame: hold a contrast loss, or meet a power budget.

    Give --target-loss or --budget. The controller sees the frames that were shown, and with --lookahead the
    next few seconds.
    """
    from evenlight.analysis.earlier_results import files_in, remove_earlier_track
    from evenlight.analysis.tracks.control_run import ControlJob
    from evenlight.analysis.tracks.optimization_job import OptimizationJob
    from evenlight.analysis.tracks.track_results import run_control
    from evenlight.data_schema.storage.whole_files import results_folder
    from evenlight.method.choices import AnalysisEffort
    from evenlight.method.online.controller import ControllerSettings
    from evenlight.method.online.governor import HORIZON, HORIZONS, GovernorSettings
    from evenlight.method.online.lookahead import LOOKAHEADS, LookaheadSettings
    from evenlight.method.optimizer.request import Request, require_possible
    from evenlight.method.preset_files import (
        display_for,
        load_contrast_model,
        load_power_model,
        load_rate_limit,
        usable_limit,
    )
    from evenlight.stimuli.sequences import open_video

    check_video(video, min_factor, field_of_view, jobs)
    if target_loss is None and budget is None:
        raise InputError("give --target-loss, the contrast loss to hold, or --budget, which it is to follow")
    for name, value in (("--target-loss", target_loss), ("--start-factor", start_factor)):
        if value is not None:
            require_between(name, value, (0.0 if name == "--target-loss" else min_factor, 1.0))
    require_curves_to_compute(curves, jobs, device)
    asked_gains = {
        "proportional": proportional, "integral": integral, "derivative": derivative, "gain_rate": gain_rate,
    }  # fmt: skip
    gains = {name: gain for name, gain in asked_gains.items() if gain is not None}
    for name, gain in gains.items():
        require_between(f"--{name.replace('_', '-')}", gain, (0.0, 1e6))
    if budget is None and (horizon is not None or budget_unit is not None):
        raise InputError("--horizon and --budget-unit are for --budget, which is not given")
    if lookahead is not None:
        require_between("--lookahead", lookahead, LOOKAHEADS)
        of_gains = [*(["tune"] if tune else []), *(["sweep"] if sweep else []), *gains]
        if of_gains:
            name = of_gains[0].replace("_", "-")
            raise InputError(f"--{name} is for the PID controller; --lookahead does without: leave one")
    unit, seconds = budget_unit or BudgetUnit.FACTOR, HORIZON if horizon is None else horizon
    require_between("--horizon", seconds, HORIZONS)
    limit = load_rate_limit(rate_limit)
    panel = display_for(limit, display, curves)
    limit = usable_limit(limit, panel, other_display_ok, accept_wide_band)
    power = load_power_model(power_model)
    request = Request(
        1.0 if budget is None else budget, unit, power, limit, limit_curve, modulated,
        battery=battery_wh,
    )  # fmt: skip
    if budget is not None:
        require_possible(request, min_factor)
    model = load_contrast_model(contrast_model)
    # Every frame by itself: between frames one would have to know the next.
    effort = (
        AnalysisEffort(jobs=jobs, device=chosen_device(device, panel, model, quiet))
        if curves is None
        else AnalysisEffort(CURVES_TOLERANCE)
    )
    work = OptimizationJob(
        source=open_video(video, fps),
        display=panel,
        request=request,
        model=model,
        model_name=contrast_model,
        min_factor=min_factor,
        field_of_view=field_of_view,
        actuator=actuator,
        curves=curves,
        cached=not no_cache,
        player=not no_player,
        quiet=quiet,
        effort=effort,
    )
    settings = replace(
        ControllerSettings(target_loss or 0.0, lowest_factor=min_factor),
        **(gains if gain_rate != 0 else {**gains, "gain_rate": None}),
    )
    asked = ControlJob(
        work=work,
        settings=settings,
        start_factor=start_factor,
        budget=None if budget is None else GovernorSettings(budget, unit, seconds),
        target_is_given=target_loss is not None,
        tuned=tune,
        sweep=targets_in(sweep),
        lookahead=None if lookahead is None else LookaheadSettings(lookahead, seconds),
    )
    with results_folder(out) as folder:
        done, rows = run_control(asked, folder)
        written = files_in(folder)
    remove_earlier_track(out, written)
    if not quiet:
        _print_result(done, rows, borrowed_line(limit, panel) + results_in(out))


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


def _print_result(done: ControlResult, rows: list[TargetRow], closing: str) -> None:
    """Print what is gained in plain words, then how steady the loss was, in figures."""
    from evenlight.analysis.tracks.gain_words import gain_in_words

    for line in gain_in_words(done.summary):
        typer.echo(line)
    control, summary, spread = done.control, done.summary, done.spread
    ratio = "" if spread.ratio is None else f", {spread.ratio:.2f} times as much"
    saved = f", {summary.mean_power / summary.full_power:.1%} of full power" if summary.full_power else ""
    typer.echo(
        f"{summary.frames} frames, contrast loss {control.mean_loss:.4g} on average, target "
        f"{_target(done)}\n"
        f"its SD over time is {control.sd_loss:.4g}, {control.sd_loss_constant:.4g} at constant dimming by "
        f"the same mean factor{ratio}\n"
        f"mean factor {control.mean_factor:.4g}, {control.mean_power:.4g} W{saved}; "
        f"{control.share_limited:.1%} of the time at the rate limit {summary.rate_limit!r} or a bound"
    )
    if control.budget is not None and control.budget_unit is not None and control.horizon is not None:
        typer.echo(_budget_words(done))
    for warning in done.warnings:
        typer.echo(f"warning: {warning}")
    if done.tuning is not None:
        before, after = done.tuning.before, done.tuning.after
        typer.echo(
            f"gains tuned: K_p {after.proportional:.4g}, K_i {after.integral:.4g}, "
            f"K_d {after.derivative:.4g}; root mean square error at a fixed target "
            f"{before.rms_error:.4g} before, {after.rms_error:.4g} after"
        )
    if rows:
        typer.echo(
            f"targets {rows[0].target_loss:g} to {rows[-1].target_loss:g} take mean factors "
            f"{rows[0].mean_factor:.4g} to {rows[-1].mean_factor:.4g}"
        )
    typer.echo(closing)


def _target(done: ControlResult) -> str:
    """Return the target, or from where to where it went."""
    first, last = done.control.target_loss, done.control.final_target_loss
    return f"{first:.4g}" if done.control.budget is None else f"from {first:.4g} to {last:.4g}"


def _budget_words(done: ControlResult) -> str:
    """Return how well the budget was met."""
    control = done.control
    assert control.budget_unit is not None
    words = f"budget {control.budget:g} ({control.budget_unit.value}): {done.summary.achieved:.4g} on average"
    if control.horizon_error is None:
        words += f"; shorter than the horizon of {control.horizon:g} s"
    else:
        words += f"; over any {control.horizon:g} s off by {control.horizon_error:.2g} at most"
        words += f", above it by {control.horizon_excess or 0.0:.2g}"
    if control.share_budget_held:
        words += f"; out of reach at a bound for {control.share_budget_held:.1%} of the time"
    return words

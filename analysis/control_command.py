"""The command that runs the online controller over a video."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.analysis.tracks.dimming_options import DimmedOn, option, path_of
from evenlight.analysis.tracks.track_request import Analysed, OneVideo, closing_words
from evenlight.analysis.wording import percent
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.experiments.playback.play_options import AimOptions, with_options
from evenlight.method.choices import AnalysisEffort
from evenlight.option_panels import asked, expert, output

if TYPE_CHECKING:
    from evenlight.analysis.tracks.control_run import ControlJob, ControlResult
    from evenlight.method.online.controller import ControllerSettings


@dataclass(frozen=True, kw_only=True)
class ControlledOptions(AimOptions, OneVideo, Analysed):
    """What `evenlight control` takes beside the display and its limits."""

    out: Annotated[Path, output(help="Folder for track.csv, summary.json, track.png, player.html and more.")]
    lookahead: Annotated[
        float | None,
        asked(
            metavar="SECONDS",
            help="Plan ahead, with so many seconds of the video to come known (0: none), in place of the "
            "PID controller.",
        ),
    ] = None
    start_factor: Annotated[
        float | None,
        expert(
            metavar="FACTOR",
            help="Brightness factor of the first frame. Otherwise the one at which it has the target loss.",
        ),
    ] = None


def _control(asked: ControlledOptions, on: DimmedOn) -> None:
    """Dim a video as a player would, frame by frame: hold a contrast loss, or meet a power budget.

    Give --target-loss or --budget. The controller sees the frames that were shown, and with --lookahead the
    next few seconds.
    """
    from evenlight.analysis.earlier_results import track_folder
    from evenlight.analysis.tracks.track_results import run_control

    job = _job(asked, on)
    with track_folder(asked.out) as folder:
        done = run_control(job, folder)
    if not asked.quiet:
        closing = closing_words(job.work.request.rate_limit, job.work.display, asked.out)
        typer.echo("\n".join([*_result_in_words(done), closing]))


control = with_options(_control, ControlledOptions, DimmedOn)


def _job(asked: ControlledOptions, on: DimmedOn) -> ControlJob:
    from evenlight.analysis.tracks.control_run import ControlJob
    from evenlight.method.online.governor import HORIZON, GovernorSettings
    from evenlight.method.online.lookahead import LookaheadSettings
    from evenlight.method.optimizer.request import require_possible
    from evenlight.stimuli.sequences import open_video

    on.check()
    asked.check_analysis()
    settings = _settings(asked, on.min_factor)
    unit = asked.budget_unit or BudgetUnit.FACTOR
    horizon = HORIZON if asked.horizon is None else asked.horizon
    display = on.shown_on(asked.curves)
    request = on.within(1.0 if asked.budget is None else asked.budget, unit, display)
    if asked.budget is not None:
        require_possible(request, on.min_factor)
    effort = AnalysisEffort()
    if asked.curves is None:
        effort = asked.effort(display, on.model()[0], asked.quiet)
    work = on.job(open_video(asked.video, on.fps), display, request)
    return ControlJob(
        replace(work, curves=path_of(asked.curves), quiet=asked.quiet, effort=effort),
        settings,
        start_factor=asked.start_factor,
        budget=None if asked.budget is None else GovernorSettings(asked.budget, unit, horizon),
        target_is_given=asked.target_loss is not None,
        lookahead=None if asked.lookahead is None else LookaheadSettings(asked.lookahead, horizon),
    )


def _settings(asked: ControlledOptions, min_factor: float) -> ControllerSettings:
    """Return target, gains and bounds of the controller; refuse options that do not go together."""
    from evenlight.inputs import number
    from evenlight.method.online.controller import ControllerSettings
    from evenlight.method.online.governor import HORIZONS
    from evenlight.method.online.lookahead import LOOKAHEADS

    gains = asked.gains
    if asked.target_loss is None and asked.budget is None:
        raise InputError("give --target-loss, the contrast loss to hold, or --budget, which it is to follow")
    if asked.budget is None and (asked.horizon is not None or asked.budget_unit is not None):
        raise InputError("--horizon and --budget-unit are for --budget, which is not given")
    bounds = {
        "target_loss": (0.0, 1.0),
        "start_factor": (min_factor, 1.0),
        **dict.fromkeys(gains, (0.0, 1e6)),
        "lookahead": LOOKAHEADS,
        "horizon": HORIZONS,
    }
    for name, ends in bounds.items():
        if (value := getattr(asked, name)) is not None:
            number(option(name), value, *ends)
    if asked.lookahead is not None and gains:
        raise InputError(
            f"{option(next(iter(gains)))} is for the PID controller; --lookahead does without: leave one"
        )
    return ControllerSettings(asked.target_loss or 0.0, lowest_factor=min_factor, **gains)


def _result_in_words(done: ControlResult) -> Iterator[str]:
    """Say what is gained in plain words, then how steady the loss was, in figures."""
    from evenlight.analysis.tracks.track_words import alike, gain_in_words, lost, watts

    summary = done.track.summary
    assert summary.control is not None  # `control_video` has seen to it
    control = summary.control
    ratio = "" if done.ratio is None else f", {done.ratio:.2f} times as much"
    full = summary.full_power
    saved = f", {percent(summary.mean_power / full)} of full power" if full else ""
    target = lost(control.target_loss)
    if control.budget is not None:
        target = f"from {target} to {lost(control.final_target_loss)}"
    yield from gain_in_words(summary)
    yield f"{summary.frames} frames, {lost(summary.mean_contrast_loss)} lost on average, target {target}"
    varies, constant = alike(control.sd_loss, control.sd_loss_constant)
    yield (
        f"the loss varies by {varies} points over time (SD), by {constant} points at constant dimming by the "
        f"same mean factor{ratio}"
    )
    yield (
        f"mean factor {min(summary.mean_factor, 1.0):.4g}, {watts(summary.mean_power)}{saved}; "
        f"{percent(control.share_limited)} of the time at the rate limit {summary.rate_limit!r} or a bound"
    )
    if control.budget_unit is not None:
        used, held = f"{summary.achieved:.4g} on average", control.share_budget_held
        over = f"; shorter than the horizon of {control.horizon:g} s"
        if control.horizon_error is not None:
            over = f"; over any {control.horizon:g} s off by {control.horizon_error:.2g} at most"
            over += f", above it by {control.horizon_excess or 0.0:.2g}"
        out = f"; out of reach at a bound for {percent(held)} of the time" if held else ""
        yield f"budget {control.budget:g} ({control.budget_unit.value}): {used}{over}{out}"
    yield from (f"warning: {warning}" for warning in done.warnings)

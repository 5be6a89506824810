"""The command that runs the online controller over a video."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import typer

from evenlight.analysis.tracks.control_request import Steered
from evenlight.analysis.tracks.dimming_options import DimmedOn, path_of
from evenlight.analysis.tracks.track_request import Analysed, OneVideo, closing_words
from evenlight.analysis.wording import percent
from evenlight.data_schema.errors import ArgumentError
from evenlight.method.choices import AnalysisEffort
from evenlight.option_panels import with_options

if TYPE_CHECKING:
    from evenlight.analysis.tracks.control_run import ControlJob
    from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


@dataclass(frozen=True, kw_only=True)
class ControlledOptions(Steered, OneVideo, Analysed):
    """What `evenlight control` takes beside the display and its limits."""


def _control(asked: ControlledOptions, on: DimmedOn) -> None:
    """Dim a video as a player would, frame by frame: hold a contrast loss, or meet a power budget.

    Give --target-loss or --budget. The controller sees the frames that were shown, and with --lookahead the
    next few seconds.
    """
    from evenlight.analysis.tracks.track_results import run_control
    from evenlight.data_schema.storage.result_folders import result_folder

    job = _job(asked, on)
    with result_folder(asked.out, "control", force=asked.force) as folder:
        done = run_control(job, folder)
    if not asked.quiet:
        closing = closing_words(job.work.request.rate_limit, job.work.display, asked.out)
        typer.echo("\n".join([*_result_in_words(*done), closing]))


control = with_options(_control, ControlledOptions, DimmedOn)


def _job(asked: ControlledOptions, on: DimmedOn) -> ControlJob:
    from evenlight.analysis.tracks.control_run import ControlJob
    from evenlight.stimuli.sequences import open_video

    on.check()
    asked.check_analysis()
    settings = asked.settings(on.min_factor)
    if asked.budget is None and asked.horizon is not None:  # a loop in Python judges its gain over it
        raise ArgumentError("horizon", "is for `budget`, which is not given")
    display, request = asked.posed(on, asked.curves)
    effort = AnalysisEffort()
    if asked.curves is None:
        effort = asked.effort(display, on.model()[0], asked.quiet)
    work = on.job(open_video(asked.video, on.fps, on.damaged, on.stream), display, request)
    return ControlJob(
        replace(work, curves=path_of(asked.curves), quiet=asked.quiet, effort=effort),
        settings,
        start_factor=asked.start_factor,
        budget=asked.governor(request),
        target_is_given=asked.target_loss is not None,
        lookahead=asked.known_ahead,
    )


def _result_in_words(
    summary: OptimizationSummary, ratio: float | None, warnings: tuple[str, ...]
) -> Iterator[str]:
    """Say what is gained in plain words, then how steady the loss was, in figures."""
    from evenlight.analysis.tracks.first_page import told
    from evenlight.analysis.tracks.track_words import alike, lost, moved_in_words

    assert summary.control is not None  # `control_video` has seen to it
    control = summary.control
    varies_by = "" if ratio is None else f", {ratio:.2f} times as much"
    factor = min(summary.mean_factor, 1.0)
    target = lost(control.target_loss)
    if control.budget is not None:
        target = f"from {target} to {lost(control.final_target_loss)}"
    yield from told(summary)
    yield f"{summary.frames} frames, target loss {target}"
    varies, constant = alike(control.sd_loss, control.sd_loss_constant)
    yield (
        f"the loss varies by {varies} points over time (SD), by {constant} points at constant dimming by the "
        f"same mean factor{varies_by}"
    )
    yield (
        f"mean factor {factor:.4g}; {percent(control.share_limited)} of the time "
        f"at the rate limit {summary.rate_limit!r}{moved_in_words(summary)} or a bound"
    )
    if control.budget_unit is not None:
        used, held = f"{summary.achieved:.4g} on average", control.share_budget_held
        over = f"; shorter than the horizon of {control.horizon:g} s"
        if control.horizon_error is not None:
            over = f"; over any {control.horizon:g} s off by {control.horizon_error:.2g} at most"
            over += f", above it by {control.horizon_excess or 0.0:.2g}"
        out = f"; out of reach at a bound for {percent(held)} of the time" if held else ""
        yield f"budget {control.budget:g} ({control.budget_unit.value}): {used}{over}{out}"
    yield from (f"warning: {warning}" for warning in warnings)

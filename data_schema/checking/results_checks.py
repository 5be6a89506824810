"""Checking the results of an optimization: whether track, header, summary and loss curves agree."""

from __future__ import annotations

import math
from pathlib import Path

from evenlight.data_schema.checking.file_checks import CheckedFile
from evenlight.data_schema.quantities import Array
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, OptimizationSummary
from evenlight.data_schema.tracks.control import ONLINE
from evenlight.data_schema.tracks.loss_curves import LossCurves

TOLERANCE = 1e-6  # relative; the order of summation is not the writer's


def compare_results(files: list[CheckedFile]) -> None:
    """Note where the files of a folder contradict each other; those with problems of their own are left out.

    Parameters
    ----------
    files : list of CheckedFile
        The checked files of one folder; problems are added to them.
    """
    records = {type(checked.record): checked for checked in files if checked.record is not None}
    if BrightnessTrack not in records:
        return
    track: BrightnessTrack = records[BrightnessTrack].records[0][1]
    if OptimizationSummary in records:
        _compare_header(records[OptimizationSummary], track, records[BrightnessTrack].path)
        _compare_figures(records[OptimizationSummary], track)
        _compare_promises(records[OptimizationSummary], track)
    if LossCurves in records:
        _compare_curves(records[LossCurves], track)


def _compare_header(checked: CheckedFile, track: BrightnessTrack, path: Path) -> None:
    """Note where a summary names another video, display, budget or solver than the track's header."""
    summary: OptimizationSummary = checked.records[0][1]
    header, name = track.header, path.with_suffix(".json").name
    pairs = (
        ("video", summary.video, header.video),
        ("display", summary.display, header.display_name),
        ("rate_limit", summary.rate_limit, header.rate_limit),
        ("power_model", summary.power_model, header.power_model),
        ("budget", summary.budget, header.budget),
        ("budget_unit", summary.budget_unit.value, header.budget_unit.value),
        ("solver", summary.solver, header.solver),
    )
    for key, got, other in pairs:
        if got != other:
            checked.blame(f"{key}: expected {other!r}, as in {name}, got {got!r}")
    if summary.frames != len(track.factors):
        checked.blame(f"frames: expected {len(track.factors)}, the rows of {path.name}, got {summary.frames}")


def _compare_figures(checked: CheckedFile, track: BrightnessTrack) -> None:
    """Note figures of a summary that do not follow from the track's columns.

    A mean over time lies between the extremes of its column, whatever the durations of the frames.
    """
    summary: OptimizationSummary = checked.records[0][1]
    for key, mean, column in (
        ("mean_factor", summary.mean_factor, track.factors),
        ("mean_contrast_loss", summary.mean_contrast_loss, track.contrast_loss),
        ("mean_power_w", summary.mean_power, track.power),
    ):
        low, high = float(column.min()), float(column.max())
        if not low - TOLERANCE * abs(low) <= mean <= high + TOLERANCE * abs(high):
            checked.blame(f"{key}: expected {low:g} to {high:g}, as the track's column reaches, got {mean:g}")
    if summary.frames != len(track.factors):
        return
    objective = mean_absolute_difference(track.contrast_loss)
    weighted = "weights" in summary.provenance.inputs  # then pairs of frames count differently
    if not weighted and abs(summary.objective - objective) > TOLERANCE * max(objective, 1e-3):
        checked.blame(
            f"objective: expected {objective:.6g}, the mean absolute difference of the track's "
            f"contrast_loss, got {summary.objective:.6g}"
        )


def _compare_promises(checked: CheckedFile, track: BrightnessTrack) -> None:
    """Note promises of a summary that it or the track's columns break: budget, baseline, rate limit."""
    summary: OptimizationSummary = checked.records[0][1]
    # Online control promises neither budget nor baseline, nor does one of several clips that share a budget.
    planned = summary.solver != ONLINE and summary.clips == 1
    if planned and abs(summary.achieved - summary.budget) > TOLERANCE:
        checked.blame(f"achieved: expected the budget {summary.budget:g}, got {summary.achieved:g}")
    if planned and summary.objective > summary.objective_baseline + TOLERANCE:
        checked.blame(
            f"objective: expected at most {summary.objective_baseline:g}, that of constant dimming, "
            f"got {summary.objective:g}"
        )
    steps = zip(track.rate.tolist(), track.rate_limit.tolist(), strict=True)
    ratio = max((abs(rate) / limit if limit else math.inf for rate, limit in steps if rate), default=0.0)
    if abs(ratio - summary.max_rate_ratio) > TOLERANCE * max(ratio, 1.0):
        checked.blame(f"max_rate_ratio: expected {ratio:g}, as in the track, got {summary.max_rate_ratio:g}")
    if ratio > 1 + TOLERANCE:
        checked.blame(f"max_rate_ratio: expected at most 1, the track's fastest step has {ratio:g}")


def mean_absolute_difference(values: Array) -> float:
    """Return the mean of |x_i - x_j| over all pairs; 0 for a single value.

    In order of size the k-th of n values is the greater one in k pairs and the smaller one in n - 1 - k.

    >>> import numpy as np
    >>> round(mean_absolute_difference(np.array([0.0, 1.0, 3.0])), 12)  # (1 + 3 + 2) / 3
    2.0
    """
    import numpy as np

    n = len(values)
    if n < 2:
        return 0.0
    return float(np.sort(values) @ (2 * np.arange(n) - (n - 1))) / (n * (n - 1) / 2)


def _compare_curves(checked: CheckedFile, track: BrightnessTrack) -> None:
    """Note loss curves of another video or display than the track's."""
    curves: LossCurves = checked.records[0][1]
    for key, got, other in (
        ("video", curves.video, track.header.video),
        ("display fingerprint", curves.display.fingerprint, track.header.display_fingerprint),
    ):
        if got != other:
            checked.blame(f"{key}: expected {other!r}, as in the track's header, got {got!r}")

"""The figure of a played video's measured power: over the video's own time, and the passes' means."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    MUTED,
    OURS,
    PAGE,
    Medium,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.measurement.played_power.pass_power import VERSIONS
from evenlight.analysis.measurement.played_power.power_table import MeasuredPower
from evenlight.analysis.measurement.played_power.power_words import heading_in_words
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.played_power import FrameEnergy, PlayedPower

STYLES: dict[str, dict[str, Any]] = {
    "baseline": {"color": BASELINE, "linestyle": "--"},
    "ours": {"color": OURS},
    "full": {"color": MUTED},
}
MOST_POINTS = 1000  # of a line: more do not show


def power_figure(measured: MeasuredPower, medium: Medium = PAGE) -> Figure:
    """Draw power over time for each version, and beside it the means of the passes.

    Parameters
    ----------
    measured : MeasuredPower
        What was measured.
    medium : Medium
        Where it is shown.
    """
    power = measured.power
    with look(medium):
        em = medium.em
        left, gap, beside = 5.0 * em, 2.2 * em, 17.0 * em
        width = medium.width - left - gap - beside - 1.2 * em
        lines, above = heading_lines(*_heading(power), medium.width - left - em, em)
        top, height = above + 2.4 * em, min(24 * em, 0.55 * medium.height)
        figure = new_figure(medium, top + height + 3.8 * em)
        lines_at(figure, left, lines)
        over_time = axes_at(figure, left, top, width, height)
        means = axes_at(figure, left + width + gap, top, beside, height)
        _draw_over_time(over_time, measured)
        _draw_means(means, power)
        highest = max(over_time.get_ylim()[1], means.get_ylim()[1])
        for axes in (over_time, means):
            axes.set_ylim(0.0, highest)
        _draw_model(means, power, highest)
        means.tick_params(labelleft=False)
    return figure


def _heading(power: PlayedPower) -> tuple[str, str]:
    """Return title and subtitle."""
    title = f"{'SIMULATED power' if power.simulated else 'Measured power'} of {power.video}"
    return title, heading_in_words(power)


def _draw_over_time(axes: Axes, measured: MeasuredPower) -> None:
    """Draw the mean over passes, and their range, over the time since each pass began."""
    power = measured.power
    handles: list[Line2D | Patch] = []
    for version in VERSIONS:
        begins = {one.pass_index: one.begun for one in power.passes if one.used and one.version == version}
        if not begins:
            continue
        edges = np.linspace(0, power.duration, _points(measured.energies, power) + 1)
        curves = np.array(
            [_binned(measured.energies, index, begun, edges) for index, begun in begins.items()]
        )
        style = STYLES[version]
        middle = (edges[1:] + edges[:-1]) / 2
        if len(edges) == 2:  # a video of one frame
            middle, curves = edges, np.repeat(curves, 2, axis=1)
        if len(curves) > 1:
            band = {"color": style["color"], "alpha": 0.25, "linewidth": 0}
            axes.fill_between(middle, curves.min(axis=0), curves.max(axis=0), **band)
        axes.plot(middle, curves.mean(axis=0), **style)
        mean = next(one.mean_power for one in power.versions if one.version == version)
        axes.axhline(mean, color=style["color"], linewidth=text_size() / 14, linestyle=":")
        handles.append(Line2D([], [], label=version, **style))
    handles.append(Line2D([], [], color=MUTED, linestyle=":", linewidth=text_size() / 14, label="mean"))
    if any(one.n_passes > 1 for one in power.versions):
        handles.append(Patch(facecolor=FAINT, label="passes' range"))
    legend_above(axes, handles=handles)
    axes.set(xlim=(0, power.duration), xlabel="time in the video [s]", ylabel="power [W]")
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])


def _points(energies: Sequence[FrameEnergy], power: PlayedPower) -> int:
    """Return how many points a line gets: one for each frame, as far as they show."""
    typical = float(np.median([frame.duration for frame in energies]))
    return max(min(MOST_POINTS, round(power.duration / typical)), 1)


def _binned(energies: Sequence[FrameEnergy], index: int, begun: float, edges: Array) -> Array:
    """Return the mean power of a pass between some times; NaN where a frame was left out, or none shown."""
    frames = [frame for frame in energies if frame.pass_index == index]
    ends = np.array([frame.begun + frame.duration - begun for frame in frames])
    spent = np.array([np.nan if frame.energy is None else frame.energy for frame in frames])
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(spent))])
    lost = np.concatenate([[0.0], np.cumsum(np.isnan(spent))])
    times = np.concatenate([[0.0], ends])
    lasted = np.diff(np.minimum(edges, ends[-1]))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.diff(np.interp(edges, times, total)) / lasted
    return np.where(
        (np.diff(np.interp(edges, times, lost)) > 0) | (lasted < np.diff(edges) / 2), np.nan, mean
    )


def _draw_means(axes: Axes, power: PlayedPower) -> None:
    """Draw each pass as a dot, and the version's mean with its interval."""
    size = text_size()
    for place, one in enumerate(power.versions):
        colour = STYLES[one.version]["color"]
        means = np.array([p.mean_power for p in power.passes if p.used and p.version == one.version])
        spread = 0.25 * (np.arange(len(means)) - (len(means) - 1) / 2) / max(len(means) - 1, 1)
        axes.plot(
            place - 0.2 + spread, means, "o", color=colour, ms=0.35 * size, alpha=0.6, markeredgewidth=0
        )
        if one.ci_low is not None and one.ci_high is not None:
            axes.plot([place + 0.1] * 2, [one.ci_low, one.ci_high], color=colour, linewidth=size / 5)
        axes.plot([place + 0.1], [one.mean_power], "D", color=colour, ms=0.45 * size)
    axes.set_xlim(-0.6, len(power.versions) - 0.4)
    names = [f"{one.version}\n{one.mean_power:.3f} W" for one in power.versions]
    axes.set_xticks(range(len(power.versions)), names)
    axes.tick_params(axis="x", length=0)
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])


def _draw_model(axes: Axes, power: PlayedPower, highest: float) -> None:
    """Draw what a model predicts, as far as it is on the scale of what was measured, and the legend."""
    size = text_size()
    dash: dict[str, Any] = {"marker": "_", "linestyle": "", "color": INK, "ms": 0.8 * size}
    dash["markeredgewidth"] = size / 8
    predicted = [(k, one.predicted_power) for k, one in enumerate(power.versions)]
    shown = [(k, watts) for k, watts in predicted if watts is not None and watts <= highest]
    for place, watts in shown:
        axes.plot([place + 0.35], [watts], **dash)
    handles = [
        Line2D([], [], marker="o", linestyle="", color=MUTED, ms=0.35 * size, label="pass"),
        Line2D([], [], marker="D", color=MUTED, ms=0.45 * size, label="mean"),
        Line2D([], [], label="model", **dash),
    ]
    legend_above(axes, handles=handles[: 3 if shown else 2], handlelength=1.0, columnspacing=1.0)

"""The figure of a power sweep: power over luminance, what the line misses, and drift."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import INK, LIMIT, OURS, PAGE, Medium, look, text_size
from evenlight.analysis.measurement.luminance_sweep import SIMULATED
from evenlight.analysis.measurement.power_fit import TOLERATED_DEVIATION
from evenlight.analysis.measurement.power_sweep import PowerSweepFit
from evenlight.analysis.measurement.sweep_panels import (
    TimedReading,
    draw_over_time,
    draw_points,
    half_width,
    legend_in,
    name_panel,
    page_of_panels,
)
from evenlight.data_schema.sweep_fit import LuminanceSource


def power_sweep_figure(result: PowerSweepFit, medium: Medium = PAGE) -> Figure:
    """Draw a power sweep and its fit.

    Parameters
    ----------
    result : PowerSweepFit
        What is drawn.
    medium : Medium
        Where it is shown.
    """
    with look(medium):
        figure, panels = page_of_panels(medium, _heading(result))
        _draw_line(panels[0], result)
        _draw_residuals(panels[1], result)
        _draw_power_over_time(panels[2], result)
        _draw_slopes(panels[3], result)
    return figure


def _heading(result: PowerSweepFit) -> tuple[str, str]:
    """Return title and subtitle."""
    record, rig = result.record, result.sweep.manifest.rig
    title = f"Power of {record.display_name}"
    data = f"{SIMULATED} readings" if record.simulated else "readings"
    light = rig.luminance_meter if record.luminance_source is LuminanceSource.METER else "factor × peak"
    return title, (
        f"sweep {record.session_id} · meter {rig.power_meter}, luminance {light} · {record.n_readings} "
        f"{data} of {record.n_levels} brightness factors · P = {record.power_per_luminance:.4g} L + "
        f"{record.base_power:.4g} W"
    )


def _draw_line(axes: Axes, result: PowerSweepFit) -> None:
    """Draw every reading and the line."""
    points, line = result.points, result.line
    ends = np.array([0.0, 1.05 * float(points.luminance.max())])
    axes.plot(ends, line.power(ends), color=OURS, label="line", zorder=2)
    axes.plot(points.luminance, points.power, "o", color=INK, ms=0.4 * text_size(), mew=0, alpha=0.6,
              label="one reading", zorder=3)  # fmt: skip
    axes.set(xlabel="luminance L [cd/m²]", ylabel="power P [W]", xlim=(0, ends[1]))
    axes.set_ylim(0, None)
    low, high = line.base_power_interval
    axes.errorbar([0.0], [line.base_power], yerr=[[line.base_power - low], [high - line.base_power]], fmt="D",
                  color=LIMIT, ms=0.5 * text_size(), capsize=0.3 * text_size(), clip_on=False, zorder=4,
                  label="base power, 95 %")  # fmt: skip
    legend_in(axes, "lower right")
    name_panel(axes, "A", "Power over luminance")


def _draw_residuals(axes: Axes, result: PowerSweepFit) -> None:
    """Draw every reading's deviation from the line, the levels' means, and what is tolerated."""
    points, line = result.points, result.line
    fitted = line.power(points.luminance)
    ends = np.array([0.0, 1.05 * float(points.luminance.max())])
    allowed = 1e3 * TOLERATED_DEVIATION * line.power(ends)
    axes.fill_between(ends, -allowed, allowed, color=OURS, alpha=0.12, linewidth=0, zorder=0,
                      label="tolerated: 1 % of P")  # fmt: skip
    axes.axhline(0, color=OURS, zorder=1)
    residuals = 1e3 * (points.power - fitted)
    axes.plot(points.luminance, residuals, "o", color=INK, ms=0.3 * text_size(), mew=0, alpha=0.45,
              label="one reading", zorder=3)  # fmt: skip
    half = 1e3 * half_width(line.level_errors, line.noise_freedom)
    draw_points(axes, line.level_luminance, points.level_means(residuals), half, "level mean, 95 %")
    reach = 1.3 * max(float(np.abs(residuals).max()), float(allowed[0]))
    axes.set(xlabel="luminance L [cd/m²]", ylabel="measured less fitted [mW]", xlim=(0, ends[1]))
    axes.set_ylim(-reach, 1.45 * reach)
    legend_in(axes, "upper left", columns=2)
    name_panel(axes, "B", "What the line misses")


def _draw_power_over_time(axes: Axes, result: PowerSweepFit) -> None:
    """Draw the readings that tell of warm-up and drift."""
    readings = [
        TimedReading(r.phase, (r.begun + r.ended) / 2, r.factor, r.power) for r in result.sweep.readings
    ]
    draw_over_time(axes, readings, "power")
    name_panel(axes, "C", "Warm-up and drift of power")


def _draw_slopes(axes: Axes, result: PowerSweepFit) -> None:
    """Draw the slope from each level to the next, in which droop shows whatever the base power is."""
    points, line = result.points, result.line
    luminance, power = line.level_luminance, points.level_means(points.power)
    order = np.argsort(luminance)
    step = np.diff(luminance[order])
    slopes = 1e3 * np.diff(power[order]) / step
    errors = np.hypot(line.level_errors[order][1:], line.level_errors[order][:-1])
    half = 1e3 * half_width(errors, line.noise_freedom) / step
    axes.axhline(1e3 * line.slope, color=OURS, label="slope of the line", zorder=2)
    draw_points(axes, luminance[order][:-1] + step / 2, slopes, half, "between two levels, 95 %")
    axes.set(xlabel="luminance L [cd/m²]", ylabel="slope of power [mW m²/cd]")
    axes.set_xlim(0, 1.05 * float(points.luminance.max()))
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.9e3 * line.slope), max(high, 1.15e3 * line.slope))
    legend_in(axes, "best")
    name_panel(axes, "D", "Power for more luminance")

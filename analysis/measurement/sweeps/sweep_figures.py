"""The figures of luminance and power sweeps: what was read, what the fit misses, and drift."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from evenlight.analysis.figure_style import FAINT, INK, LIMIT, MUTED, OURS, PAGE, Medium, look, text_size
from evenlight.analysis.measurement.sweeps.display_fit import GammaFit, tolerated
from evenlight.analysis.measurement.sweeps.luminance_sweep import SIMULATED, LuminanceSweepFit
from evenlight.analysis.measurement.sweeps.power_fit import TOLERATED_DEVIATION
from evenlight.analysis.measurement.sweeps.power_sweep import PowerSweepFit
from evenlight.analysis.measurement.sweeps.sweep_panels import (
    TimedReading,
    draw_over_time,
    draw_points,
    half_width,
    legend_in,
    name_panel,
    page_of_panels,
    plain_log_scale,
    widen,
)
from evenlight.data_schema.recordings.sweep_fit import LuminanceSource


def luminance_sweep_figure(result: LuminanceSweepFit, medium: Medium = PAGE) -> Figure:
    """Draw a luminance sweep and its fit.

    Parameters
    ----------
    result : LuminanceSweepFit
        What is drawn.
    medium : Medium
        Where it is shown.
    """
    with look(medium):
        figure, panels = page_of_panels(medium, _luminance_heading(result))
        _draw_curve(panels[0], result)
        _draw_deviations(panels[1], result)
        _draw_steadiness(panels[2], result)
        _draw_brightness(panels[3], result)
    return figure


def _luminance_heading(result: LuminanceSweepFit) -> tuple[str, str]:
    """Return title and subtitle."""
    record, manifest = result.record, result.sweep.manifest
    title = f"Luminance of {record.display_name}"
    data = f"{SIMULATED} readings" if record.simulated else "readings"
    return title, (
        f"sweep {record.session_id} · meter {manifest.rig.luminance_meter} · {record.n_readings} {data} of "
        f"{record.n_levels} pixel values · γ = {record.gamma:.3f}, peak {record.peak_luminance:.4g}, black "
        f"{record.black_level:.3g} cd/m²"
    )


def _draw_curve(axes: Axes, result: LuminanceSweepFit) -> None:
    """Draw luminance over pixel value; levels that were too dark for the meter as arrows from its lowest."""
    fit, reflected = result.curve_fit, result.record.reflected_luminance
    places = np.linspace(0, 1, 401)
    lowest = min(float((fit.means + reflected).min()), float(fit.curve.luminance(0.0)) + reflected)
    if lowest > 0:
        plain_log_scale(axes)
    axes.plot(places, fit.curve.luminance(places) + reflected, color=OURS, label="gamma curve", zorder=2)
    draw_points(axes, fit.pixel_values, fit.means + reflected, _half(fit, fit.errors), "level mean, 95 %")
    dark = [row.pixel_value for row in result.levels if row.luminance is None]
    if dark:
        limit = min(r.luminance for r in result.sweep.readings if r.luminance is not None)
        axes.plot(dark, np.full(len(dark), limit), "v", color=LIMIT, ms=0.5 * text_size(), zorder=4,
                  label="too dark for the meter: below")  # fmt: skip
    axes.set(xlabel="pixel value L′ [1]", ylabel="luminance L [cd/m²]", xlim=(-0.02, 1.02))
    legend_in(axes, "lower right")
    name_panel(axes, "A", "Luminance over pixel value")


def _draw_deviations(axes: Axes, result: LuminanceSweepFit) -> None:
    """Draw by how much levels deviate from the curve, over what is tolerated."""
    fit, reflected = result.curve_fit, result.record.reflected_luminance
    places = np.linspace(0, 1, 401)
    fitted = fit.curve.luminance(places) + reflected
    allowed = 100 * np.minimum(tolerated(fitted) / np.maximum(fitted, 1e-9), 10.0)
    axes.fill_between(places, -allowed, allowed, color=OURS, alpha=0.12, linewidth=0, zorder=0,
                      label="tolerated: 2 % and 0.02 cd/m²")  # fmt: skip
    deviations = 100 * fit.deviations(reflected)
    half = 100 * _half(fit, fit.errors) / (fit.curve.luminance(fit.pixel_values) + reflected)
    axes.axhline(0, color=OURS, zorder=1)
    draw_points(axes, fit.pixel_values, deviations, half, "level mean, 95 %")
    reach = 1.15 * float(np.max(np.abs(deviations) + np.minimum(half, 3 * np.abs(deviations) + 2)))
    axes.set(xlabel="pixel value L′ [1]", ylabel="measured less fitted [% of fitted]", xlim=(-0.02, 1.02))
    axes.set_ylim(-max(reach, 3.0), max(reach, 3.0) * 1.25)
    legend_in(axes, "upper right")
    name_panel(axes, "B", "What the curve misses")


def _draw_steadiness(axes: Axes, result: LuminanceSweepFit) -> None:
    """Draw the readings that tell of warm-up and drift: white, and the levels repeated at the end."""
    readings = [
        TimedReading(r.phase, (r.begun + r.ended) / 2, r.pixel_value, r.luminance)
        for r in result.sweep.readings
        if r.factor is None and r.luminance is not None
    ]
    draw_over_time(axes, readings, "luminance")
    name_panel(axes, "C", "Warm-up and drift")


def _draw_brightness(axes: Axes, result: LuminanceSweepFit) -> None:
    """Draw by how much the light of each brightness factor is out of proportion to it."""
    name_panel(axes, "D", "Brightness factor")
    rows = [r for r in result.brightness if r.deviation is not None and r.luminance is not None]
    if not rows:
        axes.set_axis_off()
        axes.text(0.0, 0.5, "no brightness factors were measured", color=MUTED, transform=axes.transAxes)
        return
    factors = np.array([row.achieved_factor for row in rows])
    deviation = 100 * np.array([row.deviation for row in rows], dtype=np.float64)
    means = np.array([row.luminance for row in rows], dtype=np.float64)
    counts, fit = np.array([row.n_readings for row in rows]), result.curve_fit
    half = 100 * _half(fit, np.sqrt(fit.noise.variance(means) / counts)) / means
    axes.axhspan(-2, 2, color=OURS, alpha=0.12, linewidth=0, zorder=0, label="tolerated: 2 %")
    axes.axhline(0, color=FAINT, linewidth=text_size() / 11, zorder=1)
    draw_points(axes, factors, deviation, half, "level mean, 95 %")
    axes.plot(factors, deviation, color=INK, linewidth=text_size() / 14, zorder=3)
    axes.set(xlabel="achieved brightness factor b [1]", ylabel="luminance, from b · full [%]", xlim=(0, 1.03))
    widen(axes, 3.0)
    legend_in(axes, "best")


def _half(fit: GammaFit, errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half the 95 % confidence interval of level means, by what their repeats know of the noise."""
    return half_width(errors, fit.noise.freedom)


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
        figure, panels = page_of_panels(medium, _power_heading(result))
        _draw_line(panels[0], result)
        _draw_residuals(panels[1], result)
        _draw_power_over_time(panels[2], result)
        _draw_slopes(panels[3], result)
    return figure


def _power_heading(result: PowerSweepFit) -> tuple[str, str]:
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

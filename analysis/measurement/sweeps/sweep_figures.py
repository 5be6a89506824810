"""The figures of luminance and power sweeps: what was read, what the fit misses, and drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from evenlight.analysis.figure_style import (
    FAINT,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.measurement.sweeps.display_fit import GammaFit, tolerated
from evenlight.analysis.measurement.sweeps.luminance_sweep import SIMULATED, LuminanceSweepFit
from evenlight.analysis.measurement.sweeps.power_fit import TOLERATED_DEVIATION
from evenlight.analysis.measurement.sweeps.power_sweep import PowerSweepFit
from evenlight.data_schema.recordings.sweep import SweepPhase
from evenlight.data_schema.recordings.sweep_fit import LuminanceSource

ROWS, COLUMNS = 2, 2  # of panels on a page
ROW = 3.0  # [inch] height of a row of panels with their names of axes, on a page of the report
PHASE_MARKS = {
    SweepPhase.WARM_UP: ("s", MUTED, "warm-up"),
    SweepPhase.SWEEP: ("o", INK, "sweep"),
    SweepPhase.DRIFT: ("D", OURS, "repeat at the end"),
}


def luminance_sweep_figure(result: LuminanceSweepFit, medium: FigureFormat = PAGE) -> Figure:
    """Draw a luminance sweep and its fit.

    Parameters
    ----------
    result : LuminanceSweepFit
        What is drawn.
    medium : FigureFormat
        Where it is shown.
    """
    with look(medium):
        figure, panels = _page_of_panels(medium, _luminance_heading(result))
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
    out = [(r.pixel_value, r.luminance) for r in result.sweep.left_out if r.factor is None and r.luminance]
    if out:
        axes.plot(*zip(*out, strict=True), "x", color=LIMIT, ms=0.6 * text_size(), label="suspect, left out")
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
        _TimedReading(r.phase, (r.begun + r.ended) / 2, r.pixel_value, r.luminance)
        for r in result.sweep.readings
        if r.factor is None and r.luminance is not None
    ]
    _draw_over_time(axes, readings, "luminance")
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


def power_sweep_figure(result: PowerSweepFit, medium: FigureFormat = PAGE) -> Figure:
    """Draw a power sweep and its fit.

    Parameters
    ----------
    result : PowerSweepFit
        What is drawn.
    medium : FigureFormat
        Where it is shown.
    """
    with look(medium):
        figure, panels = _page_of_panels(medium, _power_heading(result))
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
    left_out = result.sweep.left_out
    out = [(r.luminance, r.power) for r in left_out if r.luminance is not None and r.luminance < ends[1]]
    if out:
        axes.plot(*zip(*out, strict=True), "x", color=LIMIT, ms=0.6 * text_size(), label="suspect, left out")
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
        _TimedReading(r.phase, (r.begun + r.ended) / 2, r.factor, r.power) for r in result.sweep.readings
    ]
    _draw_over_time(axes, readings, "power")
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


def _page_of_panels(medium: FigureFormat, heading: tuple[str, str]) -> tuple[Figure, list[Axes]]:
    """Return a figure with a heading and four panels, two in a row, and the panels in reading order."""
    em = medium.em
    lines, above = heading_lines(*heading, medium.width - 6 * em, em)
    whole = above + ROWS * ROW * medium.width / PAGE.width
    figure = new_figure(medium, whole)
    lines_at(figure, 5.5 * em, lines)
    grid = figure.add_gridspec(
        ROWS, COLUMNS, left=5.5 * em / medium.width, right=1 - 1.5 * em / medium.width,
        top=1 - (above + 2.6 * em) / whole, bottom=4.2 * em / whole,
        wspace=0.26, hspace=0.46,
    )  # fmt: skip
    return figure, [figure.add_subplot(grid[row, column]) for row in range(ROWS) for column in range(COLUMNS)]


def name_panel(axes: Axes, letter: str, words: str) -> None:
    """Write the letter of a panel and what it shows above it."""
    axes.set_title(f"{letter}  {words}", loc="left", pad=0.7 * text_size(), fontweight="bold")


def draw_points(axes: Axes, x: ArrayLike, y: ArrayLike, half: ArrayLike, label: str) -> None:
    """Draw measured points with their error bars."""
    size = text_size()
    axes.errorbar(x, y, yerr=half, fmt="o", color=INK, ms=0.42 * size, capsize=0.2 * size,
                  elinewidth=size / 10, capthick=size / 10, label=label, zorder=4)  # fmt: skip


def half_width(errors: ArrayLike, freedom: float) -> NDArray[np.float64]:
    """Return half the 95 % confidence interval of means with some standard errors.

    Parameters
    ----------
    errors : array_like
        Standard errors.
    freedom : float
        Degrees of freedom that they are known with (Student's t); 0 for errors that are assumed.

    >>> half_width([1.0, 2.0], 10).round(3).tolist()  # t of 10 degrees of freedom: 2.228
    [2.228, 4.456]
    """
    quantile = stats.t.ppf(0.975, freedom) if freedom > 0 else stats.norm.ppf(0.975)
    return float(quantile) * np.asarray(errors, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _TimedReading:
    """One reading of a sweep."""

    phase: SweepPhase
    time: float
    level: float
    value: float


def from_level_means(readings: Sequence[_TimedReading]) -> list[tuple[SweepPhase, float, float]]:
    """Return phase, time [s] and deviation [%] of readings that tell of warm-up and drift.

    Only of levels that were read outside of the sweep too; the deviation is from the level's mean in the
    sweep. A level whose mean is 0 tells nothing.

    >>> swept, again = _TimedReading(SweepPhase.SWEEP, 0, 1, 2.0), _TimedReading(SweepPhase.DRIFT, 9, 1, 1.5)
    >>> from_level_means([swept, again])[1]
    (<SweepPhase.DRIFT: 'drift'>, 9, -25.0)
    """
    repeated = {r.level for r in readings if r.phase is not SweepPhase.SWEEP}
    means = {
        level: float(np.mean([r.value for r in readings if r.level == level and r.phase is SweepPhase.SWEEP]))
        for level in repeated
    }
    shown = [r for r in readings if means.get(r.level, 0.0) > 0]
    return [(r.phase, r.time, 100 * (r.value / means[r.level] - 1)) for r in shown]


def _draw_over_time(axes: Axes, readings: Sequence[_TimedReading], quantity: str) -> None:
    """Draw the readings that tell of warm-up and drift over time, each from its level's mean."""
    shown = from_level_means(readings)
    if not shown:
        axes.set_axis_off()
        words = "neither a warm-up nor a repeat at the end was read"
        axes.text(0.0, 0.5, words, color=MUTED, transform=axes.transAxes)
        return
    for phase, (mark, colour, name) in PHASE_MARKS.items():
        own = [(time / 60, percent) for what, time, percent in shown if what is phase]
        if own:
            axes.plot(*zip(*own, strict=True), mark, color=colour, ms=0.36 * text_size(), mew=0, label=name,
                      zorder=3)  # fmt: skip
    axes.axhline(0, color=FAINT, linewidth=text_size() / 11, zorder=1)
    axes.set(xlabel="time since the sweep began [min]", ylabel=f"{quantity}, from its level's mean [%]")
    widen(axes, 1.2)
    legend_in(axes, "best")


def widen(axes: Axes, least: float) -> None:
    """Let the vertical axis reach at least so far to both sides of 0, so that noise does not look large."""
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -least), max(high, least))


Corner = Literal["best", "lower right", "upper left", "upper right"]


def legend_in(axes: Axes, place: Corner, columns: int = 1) -> None:
    """Put the legend into a corner of some axes, clear of their frame."""
    axes.legend(loc=place, ncols=columns, borderaxespad=0.6)


def plain_log_scale(axes: Axes) -> None:
    """Give some axes a logarithmic vertical scale with plain numbers."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))

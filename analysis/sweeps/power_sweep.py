"""What a power sweep tells: the power model P(L), and how far it can be trusted."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from evenlight.analysis.figure_style import INK, LIMIT, OURS
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import prose
from evenlight.analysis.sweeps.luminance_sweep import luminance_less
from evenlight.analysis.sweeps.power_fit import LineFit, PowerPoints, fit_line, points_of, slope_through
from evenlight.analysis.sweeps.repeated_readings import Noise, RelativeChange
from evenlight.analysis.sweeps.sweep_loading import Quantity, Sweep, by_level, repeats_of, without_suspects
from evenlight.analysis.sweeps.sweep_result import (
    BAND,
    LUMINANCE,
    SIZE,
    Coefficient,
    SweepResult,
    draw_points,
    draw_suspects,
    fit_record,
    in_percent,
    interval_in_words,
    name_panel,
    source_of,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.recordings.sweep import PowerReading, SweepPhase
from evenlight.data_schema.recordings.sweep_fit import LuminanceSource, PowerFit, PowerLevel, SweepFlag
from evenlight.method.suspect_readings import POWER_TOLERANCE

MOST_LOST = 0.01  # share of samples: time-weighted means stand more, but something is wrong
READING: dict[str, Any] = {"label": "one reading", "color": INK, "mew": 0, "zorder": 3}


def fit_power_sweep(sweep: Sweep[PowerReading]) -> SweepResult:
    """Return the power model of a power sweep.

    Raises
    ------
    InputError
        If there is neither a luminance nor a peak luminance to go by, too few levels have one, or power does
        not rise with it.
    """
    sweep = without_suspects(sweep)
    source, luminance_of = _luminance(sweep)
    counted = [r for r in sweep.readings if r.phase is not SweepPhase.WARM_UP]
    used = [r for r in counted if luminance_of(r) is not None]
    luminance = repeats_of(used, luminance_of).values
    points = points_of(luminance, [r.power for r in used], [r.factor for r in used])
    line = _with_possible_base(fit_line(points), points)
    metered = source is LuminanceSource.METER
    changes = _changes(sweep, points, luminance_of, metered=metered)
    levels = tuple(_level_row(own, luminance_of, line, metered=metered) for own in by_level(used))
    record = replace(_record(sweep, used, points, line, source, changes), levels=levels)
    return SweepResult(
        sweep=sweep,
        model=_power_model(sweep, record),
        record=record,
        tables=(_level_table(levels),),
        draw=(
            lambda axes: _draw_line(axes, sweep, points, line),
            lambda axes: _draw_residuals(axes, points, line),
        ),
        coefficients=_coefficients(record),
        remarks=() if metered else prose("sweep_light"),
    )


def _power_model(sweep: Sweep[PowerReading], record: PowerFit) -> PowerModel:
    """Return the measured power model; a simulated one says so in its name and source."""
    manifest = sweep.manifest
    by = {
        LuminanceSource.METER: f"luminance by {manifest.rig.luminance_meter}",
        LuminanceSource.FACTOR: f"luminance as factor times {record.peak_luminance:g} cd/m^2",
    }[record.luminance_source]
    read = (
        f"power sweep {manifest.session_id} with {manifest.rig.power_meter}, {by}: {record.n_readings} "
        f"readings of {record.n_levels} brightness factors"
    )
    return PowerModel(
        kind=PanelKind.LCD,
        base_power=record.base_power,
        power_per_luminance=record.power_per_luminance,
        peak_luminance=record.peak_luminance,
        **source_of(sweep, record, read, "" if record.is_linear else "not linear"),
    )


def _luminance(sweep: Sweep[PowerReading]) -> tuple[LuminanceSource, Quantity]:
    """Return where luminances come from, and what tells that of a reading, without reflected light [cd/m^2].

    They are the meter's, if there was one.
    """
    if any(r.luminance_status is not None for r in sweep.readings):
        return LuminanceSource.METER, luminance_less(sweep.manifest.design.reflected_luminance)
    peak = sweep.manifest.peak_luminance
    if peak is None:
        raise InputError(
            f"power sweep {sweep.manifest.session_id}: has no luminances, and its display has no peak "
            "luminance to go by; measure with a luminance meter, or give the rig a measured display"
        )
    return LuminanceSource.FACTOR, lambda r: float(r.achieved_factor * peak)


def _with_possible_base(line: LineFit, points: PowerPoints) -> LineFit:
    """Return the line, with a base power of 0 if it would be below and may as well be 0.

    Raises
    ------
    InputError
        If it is clearly below 0: no panel gives power.
    """
    low, high = line.base_power_interval
    if line.base_power >= 0:
        return replace(line, base_power_interval=(max(low, 0.0), high))
    if high < 0:
        raise InputError(
            f"the line through power over luminance crosses zero luminance at {line.base_power:.4g} W "
            f"({low:.4g} to {high:.4g} W), and no panel gives power; is there an offset in the power meter, "
            "or reflected light in the luminances?"
        )
    slope = slope_through(points, 0.0)
    slopes = (*line.power_per_luminance_interval, slope)
    return replace(
        line,
        base_power=0.0,
        base_power_interval=(0.0, high),
        power_per_luminance=slope,
        power_per_luminance_interval=(min(slopes), max(slopes)),
    )


def _changes(
    sweep: Sweep[PowerReading], points: PowerPoints, luminance_of: Quantity, *, metered: bool
) -> tuple[RelativeChange, RelativeChange, RelativeChange]:
    """Return the changes of power and of luminance at the end, and that late in the warm-up."""

    def noise(values: Array) -> Noise:  # of readings without repeats, that of 1 %
        repeated = np.bincount(points.level).max() > 1
        return points.noise_of(values) if repeated else Noise(0.0, 0.01, 0)

    drift, warm_up = sweep.changes(lambda r: r.power, noise(points.power))
    if not metered:
        return drift, RelativeChange(), warm_up
    return drift, *sweep.changes(luminance_of, noise(points.luminance))


def _level_row(
    readings: Sequence[PowerReading], luminance_of: Quantity, line: LineFit, *, metered: bool
) -> PowerLevel:
    luminance, power = (repeats_of(readings, value).values for value in (luminance_of, lambda r: r.power))
    model = float(line.power(luminance.mean()))
    return PowerLevel(
        factor=readings[0].factor,
        achieved_factor=float(np.mean([r.achieved_factor for r in readings])),
        luminance=float(luminance.mean()),
        luminance_sd=statistics.stdev(luminance.tolist()) if metered and luminance.size > 1 else None,
        power=float(power.mean()),
        power_sd=statistics.stdev(power.tolist()) if power.size > 1 else None,
        n_readings=int(power.size),
        model_power=model,
        residual=float(power.mean()) - model,
    )


def _level_table(rows: Sequence[PowerLevel]) -> Table:
    cells: list[tuple[Cell, ...]] = [
        (
            *(row.factor, row.achieved_factor, row.luminance, row.luminance_sd, f"{row.power:.5g}"),
            *(None if row.power_sd is None else f"{1e3 * row.power_sd:.3g}", row.n_readings),
            *(f"{row.model_power:.5g}", f"{1e3 * row.residual:.3g}"),
        )
        for row in rows
    ]
    read = ("L [cd/m²]", "SD [cd/m²]", "P [W]", "SD [mW]", "n")
    columns = ("b", "achieved b", *read, "P of the line [W]", "residual [mW]")
    return Table("Brightness factors, white.", columns, tuple(cells))


def _record(
    sweep: Sweep[PowerReading],
    used: Sequence[PowerReading],
    points: PowerPoints,
    line: LineFit,
    source: LuminanceSource,
    changes: tuple[RelativeChange, RelativeChange, RelativeChange],
) -> PowerFit:
    drift, luminance_drift, warm_up = changes
    highest = max(r.achieved_factor for r in used)  # the luminance at b = 1 is in proportion to its
    at_top = np.array([r.achieved_factor == highest for r in used])
    n_left_out = sum(r.phase is not SweepPhase.WARM_UP for r in sweep.readings) - len(used)
    n_samples, n_lost = sum(r.n_samples for r in used), sum(r.n_lost for r in used)
    flags = {
        SweepFlag.NOT_LINEAR: not line.is_linear,
        SweepFlag.VAGUE: line.is_linear and line.is_vague,
        SweepFlag.DRIFTED: drift.is_large or luminance_drift.is_large,
        SweepFlag.REPEATS_APART: sweep.is_apart(lambda r: r.power, POWER_TOLERANCE),
        SweepFlag.LUMINANCE_MISSING: n_left_out > 0,
        SweepFlag.SAMPLES_LOST: n_lost > MOST_LOST * (n_lost + n_samples),
        SweepFlag.BASE_POWER_ZERO: line.base_power == 0,
    }
    metered = source is LuminanceSource.METER
    return fit_record(
        PowerFit,
        line,
        sweep,
        (drift, warm_up),
        flags,
        luminance_source=source,
        peak_luminance=float(points.luminance[at_top].mean()) / highest,
        reflected_luminance=sweep.manifest.design.reflected_luminance if metered else 0.0,
        n_readings=len(used),
        n_levels=points.n_levels,
        n_left_out=n_left_out,
        n_samples=n_samples,
        n_lost=n_lost,
        n_duplicated=sum(r.n_duplicated for r in used),
        largest_deviation=float(line.deviations[line.worst_level]),
        largest_deviation_luminance=float(line.level_luminance[line.worst_level]),
        is_linear=line.is_linear,
        luminance_drift=luminance_drift.share,
        luminance_drift_interval=luminance_drift.interval,
    )


def _coefficients(fit: PowerFit) -> tuple[Coefficient, ...]:
    base, slope = fit.base_power_interval, [1e3 * end for end in fit.power_per_luminance_interval]
    return (
        ("base power", f"{fit.base_power:.5g}", interval_in_words(base), "W"),
        ("slope", f"{1e3 * fit.power_per_luminance:.5g}", interval_in_words(slope), "mW per cd/m²"),
        ("luminance at b = 1", f"{fit.peak_luminance:.5g}", None, "cd/m²"),
        ("reflected luminance, as given", fit.reflected_luminance, None, "cd/m²"),
        ("SD around the line", f"{1e3 * fit.residual_sd:.3g}", None, "mW"),
        ("R²", f"{fit.r_squared:.6f}", None, "1"),
        ("lack of fit, F", fit.lack_of_fit_f, None, "1"),
        ("its probability on a linear panel", fit.lack_of_fit_p, None, "1"),
        ("bend, of the added power", f"{100 * fit.bend:.2f}", None, "%"),
        ("its probability on a linear panel", fit.bend_p, None, "1"),
        ("power at the end of the sweep", *in_percent(fit.drift, fit.drift_interval), "%"),
        ("luminance then", *in_percent(fit.luminance_drift, fit.luminance_drift_interval), "%"),
        ("change late in the warm-up", *in_percent(fit.warm_up_change, fit.warm_up_interval), "% in 10 min"),
        ("readings, and left out", f"{fit.n_readings} and {fit.n_left_out}", None, "1"),
        ("samples, lost, doubled", f"{fit.n_samples}, {fit.n_lost}, {fit.n_duplicated}", None, "1"),
    )


def _draw_line(axes: Axes, sweep: Sweep[PowerReading], points: PowerPoints, line: LineFit) -> None:
    """Draw every reading and the line; a suspect reading beyond the panel lies on its edge."""
    ends = np.array([0.0, 1.05 * points.luminance.max()])
    top = 1.15 * float(max(line.power(ends).max(), points.power.max()))
    axes.plot(ends, line.power(ends), color=OURS, label="line", zorder=2)
    axes.plot(points.luminance, points.power, "o", ms=0.4 * SIZE, alpha=0.6, **READING)
    out = [(r.luminance, r.power) for r in sweep.left_out if r.luminance is not None]
    draw_suspects(axes, [(min(L, ends[1]), min(P, top)) for L, P in out])
    low, high = line.base_power_interval
    bar: dict[str, Any] = {"color": LIMIT, "ms": 0.5 * SIZE, "capsize": 0.3 * SIZE, "zorder": 4}
    around = [[line.base_power - low], [high - line.base_power]]
    label = "base power, 95 %"
    axes.errorbar([0.0], [line.base_power], yerr=around, fmt="D", clip_on=False, label=label, **bar)
    axes.set(xlim=ends, ylim=(0, top))
    name_panel(axes, "A  Power over luminance", LUMINANCE, "power P [W]", loc="lower right")


def _draw_residuals(axes: Axes, points: PowerPoints, line: LineFit) -> None:
    """Draw every reading's deviation from the line, the levels' means, and what is tolerated."""
    ends = np.array([0.0, 1.05 * points.luminance.max()])
    allowed = 1e3 * POWER_TOLERANCE.of(line.power(ends))
    axes.fill_between(ends, -allowed, allowed, label="tolerated: 1 % of P", **BAND)
    axes.axhline(0, color=OURS, zorder=1)
    residuals = 1e3 * (points.power - line.power(points.luminance))
    axes.plot(points.luminance, residuals, "o", ms=0.3 * SIZE, alpha=0.45, **READING)
    draw_points(axes, line.level_luminance, points.level_means(residuals), 1e3 * line.half_widths)
    reach = 1.3 * max(float(np.abs(residuals).max()), float(allowed[0]))
    axes.set(xlim=ends, ylim=(-reach, 1.45 * reach))
    name_panel(
        axes, "B  What the line misses", LUMINANCE, "measured less fitted [mW]", loc="upper left", ncols=2
    )

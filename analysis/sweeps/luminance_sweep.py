"""What a luminance sweep tells: the display model, its brightness curve, and how far they can be trusted."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from evenlight.analysis.figure_style import LIMIT, OURS
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.sweeps.display_fit import GammaFit, PixelLevel, fit_gamma
from evenlight.analysis.sweeps.repeated_readings import half_width
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
from evenlight.data_schema.display import OF_DEVICE, Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import SWEEP_MANIFEST
from evenlight.data_schema.recordings.sweep import LuminanceReading, SweepPhase
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, LuminanceLevel, SweepFlag
from evenlight.method.contrast.luminance import displayed_luminance
from evenlight.method.suspect_readings import LUMINANCE_TOLERANCE

PIXEL_VALUES = np.linspace(0.0, 1.0, 65)  # at which a display is compared with its file
PLACES = np.linspace(0.0, 1.0, 401)  # pixel values at which a curve is drawn


def fit_luminance_sweep(sweep: Sweep[LuminanceReading]) -> SweepResult:
    """Return the display model and the brightness curve of a luminance sweep.

    Raises
    ------
    InputError
        If too few levels have a value, or they do not rise with pixel value.
    """
    sweep = without_suspects(sweep)
    reflected, known = sweep.manifest.design.reflected_luminance, sweep.manifest.display
    curve = fit_gamma(pixel_levels(sweep.readings, reflected), reflected, middle_of(sweep.readings))
    pixel_values, brightness = _pixel_value_rows(sweep, curve), _brightness_rows(sweep, curve)
    record = _record(sweep, curve, pixel_values, brightness)
    display = _display(sweep, record)
    return SweepResult(
        sweep=sweep,
        model=display,
        record=record,
        brightness=brightness,
        draw=(
            lambda axes: _draw_curve(axes, sweep, curve, pixel_values),
            lambda axes: _draw_deviations(axes, curve),
        ),
        coefficients=_coefficients(record),
        tables=tuple(_level_table(rows) for rows in (brightness, pixel_values) if rows),
        remarks=() if known is None else (compared_with_file(known, display),),
    )


def _display(sweep: Sweep[LuminanceReading], record: DisplayFit) -> Display:
    """Return the measured display; a simulated one says so in its name and source."""
    manifest = sweep.manifest
    if manifest.pixels_per_degree is None:
        raise InputError(
            f"luminance sweep {record.session_id}: its {SWEEP_MANIFEST} has no pixels_per_degree, which a "
            "display model needs; add that of the rig"
        )
    read = (
        f"luminance sweep {manifest.session_id} with {manifest.rig.luminance_meter}: {record.n_readings} "
        f"readings of {record.n_levels} pixel values"
    )
    known = manifest.display
    device = {} if known is None else {name: getattr(known, name) for name in OF_DEVICE}
    return Display(
        peak_luminance=record.peak_luminance,
        black_level=record.black_level,
        gamma=record.gamma,
        pixels_per_degree=manifest.pixels_per_degree,
        reflected_luminance=record.reflected_luminance,
        **source_of(sweep, record, read, "" if record.is_gamma else "no gamma display"),
        **device,
    )


def compared_with_file(known: Display, measured: Display) -> str:
    """Return how a measured display differs from its file, and whether the file still holds, in a sentence.

    It holds if the two curves, reflected light left out, differ nowhere by more than is tolerated of a gamma
    curve: 2 % and 0.02 cd/m².

    >>> known = Display("desk", 200.0, 0.2, 2.2, pixels_per_degree=40.0)
    >>> compared_with_file(known, Display("desk", 202.0, 0.2, 2.2, pixels_per_degree=40.0))
    "The file of 'desk' still holds: peak +1.0 %, gamma +0.000, black +0.00 cd/m^2 from it"
    """
    old, new = (
        displayed_luminance(PIXEL_VALUES, display) - display.reflected_luminance
        for display in (known, measured)
    )
    holds = bool((np.abs(new - old) <= LUMINANCE_TOLERANCE.of(old)).all())
    peak = 100 * (measured.peak_luminance / known.peak_luminance - 1)
    gamma, black = measured.gamma - known.gamma, measured.black_level - known.black_level
    since = f" ({known.measured[:10]})" if known.measured else ""
    return (
        f"The file of {known.name!r}{since} {'still' if holds else 'no longer'} holds: peak {peak:+z.1f} %, "
        f"gamma {gamma:+z.3f}, black {black:+z.2f} cd/m^2 from it"
    )


def luminance_less(reflected: float) -> Quantity:
    """Return what tells the luminance of a reading, without reflected light [cd/m^2]."""
    return lambda r: None if r.luminance is None else r.luminance - reflected


def pixel_levels(readings: Sequence[LuminanceReading], reflected: float) -> list[PixelLevel]:
    """Return the readings of each pixel value at full brightness, those repeated at the end among them.

    Parameters
    ----------
    readings : sequence of LuminanceReading
        Of a sweep.
    reflected : float
        L_refl, which is taken off [cd/m^2].
    """
    used = (r for r in readings if r.factor is None and r.phase is not SweepPhase.WARM_UP)
    less = luminance_less(reflected)
    return [
        PixelLevel(own[0].pixel_value, repeats_of(own, less), sum(r.luminance is None for r in own))
        for own in by_level(used)
    ]


def middle_of(readings: Sequence[LuminanceReading]) -> float:
    """Return the mean time of the sweep of pixel values [s]."""
    return float(np.mean([r.begun for r in readings if r.factor is None and r.phase is SweepPhase.SWEEP]))


def _pixel_value_rows(sweep: Sweep[LuminanceReading], curve: GammaFit) -> tuple[LuminanceLevel, ...]:
    """Return a level for each pixel value, as it was read beside the fitted curve."""
    swept = (r for r in sweep.of_phase(SweepPhase.SWEEP) if r.factor is None)
    return tuple(
        _row(own, float(curve.luminance(own[0].pixel_value)), curve.reflected_luminance, curve.peak_luminance)
        for own in by_level(swept)
    )


def _brightness_rows(sweep: Sweep[LuminanceReading], curve: GammaFit) -> tuple[LuminanceLevel, ...]:
    """Return a row of `brightness.csv` for each brightness factor; none if no factors were measured.

    Full is the luminance at b = 1 in the same part of the sweep; if that is no level, the fitted peak.
    """
    at_full = sweep.repeats(SweepPhase.SWEEP, luminance_less(curve.reflected_luminance), ("factor", 1.0))
    full = at_full.mean if at_full.values.size else curve.peak_luminance
    swept = (r for r in sweep.of_phase(SweepPhase.SWEEP) if r.factor is not None)
    return tuple(_row(own, _achieved(own) * full, curve.reflected_luminance, full) for own in by_level(swept))


def _achieved(readings: Sequence[LuminanceReading]) -> float:
    return float(np.mean([r.achieved_factor for r in readings]))


def _row(readings: Sequence[LuminanceReading], model: float, reflected: float, full: float) -> LuminanceLevel:
    values = [r.luminance for r in readings if r.luminance is not None]
    mean = float(np.mean(values)) if values else None
    shown = model + reflected
    return LuminanceLevel(
        factor=readings[0].factor,
        achieved_factor=_achieved(readings),
        luminance=mean,
        pixel_value=readings[0].pixel_value,
        luminance_sd=statistics.stdev(values) if len(values) > 1 else None,
        n_readings=len(values),
        n_under_range=len(readings) - len(values),
        share=None if mean is None else (mean - reflected) / full,
        model_luminance=shown,
        deviation=None if mean is None or shown <= 0 else mean / shown - 1,
    )


def _record(
    sweep: Sweep[LuminanceReading],
    curve: GammaFit,
    pixel_values: tuple[LuminanceLevel, ...],
    brightness: Sequence[LuminanceLevel],
) -> DisplayFit:
    told = [row for row in brightness if row.deviation is not None]
    uneven = max(told, key=_unevenness, default=None)  # by most of what is tolerated
    pixels = [r for r in sweep.readings if r.factor is None]
    counted = [r.luminance for r in pixels if r.phase is not SweepPhase.WARM_UP]
    black = min(r.pixel_value for r in pixels)
    flags = {
        SweepFlag.NOT_GAMMA: not curve.is_gamma,
        SweepFlag.VAGUE: curve.is_gamma and curve.is_vague,
        SweepFlag.REPEATS_APART: sweep.is_apart(luminance_less(0.0), LUMINANCE_TOLERANCE),
        SweepFlag.BLACK_UNDER_RANGE: any(r.luminance is None for r in pixels if r.pixel_value == black),
        SweepFlag.BLACK_NEGATIVE: curve.black_level_interval[1] <= 0,
        SweepFlag.BRIGHTNESS_NOT_LINEAR: uneven is not None and _unevenness(uneven) > 1,
    }
    return fit_record(
        DisplayFit,
        curve,
        sweep,
        sweep.changes(luminance_less(curve.reflected_luminance), curve.noise),
        flags,
        n_readings=sum(luminance is not None for luminance in counted),
        n_levels=int(curve.means.size),
        n_under_range=sum(luminance is None for luminance in counted),
        noise_share=curve.noise.share,
        noise_floor=curve.noise.floor,
        largest_deviation=float(curve.deviations[curve.worst_level]),
        largest_deviation_pixel_value=float(curve.pixel_values[curve.worst_level]),
        is_gamma=curve.is_gamma,
        levels=pixel_values,
        brightness_deviation=uneven.deviation if uneven else None,
        brightness_deviation_factor=uneven.factor if uneven else None,
    )


def _unevenness(row: LuminanceLevel) -> float:
    """Return the deviation of a level over the tolerated one."""
    luminance, model = row.luminance or 0.0, row.model_luminance or 0.0  # rows with a deviation have both
    return abs(luminance - model) / float(LUMINANCE_TOLERANCE.of(model))


def _coefficients(fit: DisplayFit) -> tuple[Coefficient, ...]:
    gamma, peak, black = fit.gamma_interval, fit.peak_luminance_interval, fit.black_level_interval
    return (
        ("γ", f"{fit.gamma:.4f}", interval_in_words(gamma, 5), "1"),
        ("peak luminance", f"{fit.peak_luminance:.5g}", interval_in_words(peak, 5), "cd/m²"),
        ("black level", f"{fit.black_level:.3g}", interval_in_words(black, 3), "cd/m²"),
        ("reflected luminance, as given", fit.reflected_luminance, None, "cd/m²"),
        ("noise of a reading, share", f"{100 * fit.noise_share:.2g}", None, "%"),
        ("noise of a reading in the dark", f"{fit.noise_floor:.2g}", None, "cd/m²"),
        ("lack of fit, F", fit.lack_of_fit_f, None, "1"),
        ("its probability on a gamma display", fit.lack_of_fit_p, None, "1"),
        ("change at the end of the sweep", *in_percent(fit.drift, fit.drift_interval), "%"),
        ("change late in the warm-up", *in_percent(fit.warm_up_change, fit.warm_up_interval), "% in 10 min"),
        ("readings, and without a value", f"{fit.n_readings} and {fit.n_under_range}", None, "1"),
    )


def _level_table(rows: Sequence[LuminanceLevel]) -> Table:
    """Return the table of brightness factors, or of pixel values at full brightness."""
    of_factors = rows[0].factor is not None
    cells: list[tuple[Cell, ...]] = []
    for row in rows:
        deviation = None if row.deviation is None else f"{100 * row.deviation:.2f}"
        measured = (row.luminance, row.luminance_sd, row.n_readings, row.n_under_range)
        level = [row.factor, row.achieved_factor] if of_factors else [row.pixel_value]
        cells.append((*level, *measured, row.model_luminance, deviation))
    read = ("L [cd/m²]", "SD [cd/m²]", "n", "too dark")
    if of_factors:
        factors = ("b", "achieved b", *read, "L in proportion to b [cd/m²]", "deviation [%]")
        return Table("Brightness factors, white.", factors, tuple(cells))
    pixel_values = ("L′", *read, "L of the curve [cd/m²]", "deviation [%]")
    return Table("Pixel values, at full brightness.", pixel_values, tuple(cells))


def _draw_curve(
    axes: Axes, sweep: Sweep[LuminanceReading], curve: GammaFit, pixel_values: Sequence[LuminanceLevel]
) -> None:
    """Draw luminance over pixel value; levels that were too dark for the meter as arrows from its lowest."""
    read, fitted = (
        curve.means + curve.reflected_luminance,
        curve.luminance(PLACES) + curve.reflected_luminance,
    )
    axes.plot(PLACES, fitted, color=OURS, label="gamma curve", zorder=2)
    draw_points(axes, curve.pixel_values, read, half_width(curve.errors, curve.noise.freedom))
    draw_suspects(axes, [(r.pixel_value, r.luminance) for r in sweep.left_out if r.factor is None])
    dark = [row.pixel_value for row in pixel_values if row.luminance is None]
    if dark:
        limit = min(r.luminance for r in sweep.readings if r.luminance is not None)
        label = "too dark for the meter: below"
        axes.plot(dark, [limit] * len(dark), "v", color=LIMIT, ms=0.5 * SIZE, zorder=4, label=label)
    if min(float(read.min()), float(fitted[0])) > 0:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlim(-0.02, 1.02)
    name_panel(axes, "A  Luminance over pixel value", "pixel value L′ [1]", LUMINANCE, loc="lower right")


def _draw_deviations(axes: Axes, curve: GammaFit) -> None:
    fitted = curve.luminance(PLACES) + curve.reflected_luminance
    allowed = 100 * np.minimum(LUMINANCE_TOLERANCE.of(fitted) / np.maximum(fitted, 1e-9), 10.0)
    axes.fill_between(PLACES, -allowed, allowed, label="tolerated: 2 % and 0.02 cd/m²", **BAND)
    axes.axhline(0, color=OURS, zorder=1)
    deviations = 100 * curve.deviations
    half = 100 * half_width(curve.errors, curve.noise.freedom) / curve.shown
    draw_points(axes, curve.pixel_values, deviations, half)
    reach = 1.15 * float(np.max(np.abs(deviations) + np.minimum(half, 3 * np.abs(deviations) + 2)))
    axes.set(xlim=(-0.02, 1.02), ylim=(-max(reach, 3.0), max(reach, 3.0) * 1.25))
    missed = "measured less fitted [% of fitted]"
    name_panel(axes, "B  What the curve misses", "pixel value L′ [1]", missed, loc="upper right")

"""What a luminance sweep tells: the display model, its brightness curve, and how far they can be trusted."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.measurement.sweeps.display_fit import GammaFit, PixelLevel, fit_gamma, tolerated
from evenlight.analysis.measurement.sweeps.repeated_readings import (
    RelativeChange,
    Repeats,
    change_at_the_end,
    drifted,
    late_change,
    unsteady,
    untold,
)
from evenlight.analysis.measurement.sweeps.suspects import without_suspects
from evenlight.analysis.measurement.sweeps.sweep_loading import Sweep
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.dataset_layout import SWEEP_MANIFEST
from evenlight.data_schema.recordings.sweep import LuminanceReading, LuminanceSweepDesign, SweepPhase
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, LuminanceLevel, SweepFlag

SIMULATED = "SIMULATED"
USED = (SweepPhase.SWEEP, SweepPhase.DRIFT)


@dataclass(frozen=True, slots=True)
class LuminanceSweepFit:
    """A luminance sweep and all that was made of it.

    Attributes
    ----------
    sweep, curve_fit, record : Sweep, GammaFit, DisplayFit
        What was read, the fitted curve, and the result.
    levels, brightness : tuple of LuminanceLevel
        Pixel values, and brightness factors (none if they were not measured).
    """

    sweep: Sweep[LuminanceReading]
    curve_fit: GammaFit
    levels: tuple[LuminanceLevel, ...]
    brightness: tuple[LuminanceLevel, ...]
    record: DisplayFit


def fit_luminance_sweep(sweep: Sweep[LuminanceReading]) -> LuminanceSweepFit:
    """Return the display model and the brightness curve of a luminance sweep.

    Raises
    ------
    InputError
        If too few levels have a value, or they do not rise with pixel value.
    """
    sweep = without_suspects(sweep)
    reflected, readings = _reflected(sweep), sweep.readings
    fit = fit_gamma(pixel_levels(readings, reflected), reflected, middle_of(readings))
    brightness = tuple(brightness_rows(readings, fit, reflected))
    warm_up = late_change(repeats_of(sweep.of_phase(SweepPhase.WARM_UP), reflected), fit.noise)
    drift = change_at_the_end(_repeated_levels(sweep, reflected), fit.noise)
    return LuminanceSweepFit(
        sweep=sweep,
        curve_fit=fit,
        levels=tuple(level_rows(readings, fit, reflected)),
        brightness=brightness,
        record=_record(sweep, fit, (drift, warm_up), brightness),
    )


def display_of(result: LuminanceSweepFit) -> Display:
    """Return the measured display; a simulated one says so in its name and source."""
    manifest, fit, record = result.sweep.manifest, result.curve_fit, result.record
    meter = manifest.rig.luminance_meter
    if manifest.pixels_per_degree is None:
        raise InputError(
            f"luminance sweep {record.session_id}: its {SWEEP_MANIFEST} has no pixels_per_degree, which a "
            "display model needs; add that of the rig"
        )
    source = (
        f"luminance sweep {manifest.session_id} with {meter}: {record.n_readings} readings of "
        f"{record.n_levels} pixel values"
    )
    if result.sweep.left_out:
        source += f"; suspect readings left out: {len(result.sweep.left_out)}"
    if not record.is_gamma:
        source += f"; no gamma display, a level deviates by {100 * record.largest_deviation:+.1f} %"
    return Display(
        name=named(manifest.display_name, manifest.simulated),
        peak_luminance=fit.curve.peak,
        black_level=fit.curve.black,
        gamma=fit.curve.gamma,
        pixels_per_degree=manifest.pixels_per_degree,
        reflected_luminance=record.reflected_luminance,
        source=f"{SIMULATED} {source}" if manifest.simulated else source,
        measured="" if manifest.simulated else manifest.started,
        provenance=record.provenance,
    )


def named(name: str, simulated: bool) -> str:
    """Return the name of a display or panel, with a word if it was simulated.

    >>> named("bench", True), named("bench (SIMULATED)", True), named("bench", False)
    ('bench (SIMULATED)', 'bench (SIMULATED)', 'bench')
    """
    return f"{name} ({SIMULATED})" if simulated and SIMULATED not in name else name


def _reflected(sweep: Sweep[LuminanceReading]) -> float:
    """Return L_refl of a sweep [cd/m^2]."""
    design = sweep.manifest.design
    assert isinstance(design, LuminanceSweepDesign)
    return design.reflected_luminance


def _repeated_levels(sweep: Sweep[LuminanceReading], reflected: float) -> list[tuple[Repeats, Repeats]]:
    """Return the readings of each pixel value that was repeated at the end: in the sweep, and then."""
    last = sweep.of_phase(SweepPhase.DRIFT)
    swept = [r for r in sweep.of_phase(SweepPhase.SWEEP) if r.factor is None]
    return [
        (
            repeats_of((r for r in swept if r.pixel_value == value), reflected),
            repeats_of((r for r in last if r.pixel_value == value), reflected),
        )
        for value in sorted({r.pixel_value for r in last})
    ]


def _record(
    sweep: Sweep[LuminanceReading],
    fit: GammaFit,
    changes: tuple[RelativeChange | None, RelativeChange | None],
    brightness: Sequence[LuminanceLevel],
) -> DisplayFit:
    """Return the result as a record."""
    manifest, reflected, (drift, warm_up) = sweep.manifest, _reflected(sweep), changes
    worst = fit.worst_level(reflected)
    told = [row for row in brightness if row.deviation is not None]
    uneven = max(told, key=_unevenness, default=None)  # by most of what is tolerated
    pixels = [r for r in sweep.readings if r.factor is None and r.phase is not SweepPhase.WARM_UP]
    return DisplayFit(
        display_name=named(manifest.display_name, manifest.simulated),
        session_id=manifest.session_id,
        simulated=manifest.simulated,
        gamma=fit.curve.gamma,
        gamma_interval=fit.intervals[0],
        peak_luminance=fit.curve.peak,
        peak_luminance_interval=fit.intervals[1],
        black_level=fit.curve.black,
        black_level_interval=fit.intervals[2],
        reflected_luminance=reflected,
        n_readings=sum(r.luminance is not None for r in pixels),
        n_levels=int(fit.means.size),
        n_under_range=sum(r.luminance is None for r in pixels),
        noise_share=fit.noise.share,
        noise_floor=fit.noise.floor,
        lack_of_fit_f=fit.lack_of_fit_f,
        lack_of_fit_p=fit.lack_of_fit_p,
        largest_deviation=float(fit.deviations(reflected)[worst]),
        largest_deviation_pixel_value=float(fit.pixel_values[worst]),
        is_gamma=fit.is_gamma(reflected),
        drift=drift.share if drift else None,
        drift_interval=drift.interval if drift else None,
        warm_up_change=warm_up.share if warm_up else None,
        warm_up_interval=warm_up.interval if warm_up else None,
        brightness_deviation=uneven.deviation if uneven else None,
        brightness_deviation_factor=uneven.factor if uneven else None,
        flags=tuple(_flags(sweep, fit, changes, uneven)),
        provenance=provenance_now(seed=manifest.provenance.seed, inputs=sweep.inputs),
        suspects=sweep.suspects,
    )


def _unevenness(row: LuminanceLevel) -> float:
    """Return the deviation of a level over the tolerated one."""
    assert row.luminance is not None
    assert row.model_luminance is not None
    return abs(row.luminance - row.model_luminance) / float(tolerated(row.model_luminance))


def _flags(
    sweep: Sweep[LuminanceReading],
    fit: GammaFit,
    changes: tuple[RelativeChange | None, RelativeChange | None],
    uneven: LuminanceLevel | None,
) -> Iterable[SweepFlag]:
    """Return what to look at."""
    reflected, (drift, warm_up) = _reflected(sweep), changes
    pixels = [r for r in sweep.readings if r.factor is None]
    black = min(r.pixel_value for r in pixels)
    found = {
        SweepFlag.INCOMPLETE: not sweep.complete,
        SweepFlag.NOT_GAMMA: not fit.is_gamma(reflected),
        SweepFlag.DRIFTED: drifted(drift),
        SweepFlag.UNSTEADY: unsteady(warm_up),
        SweepFlag.WARM_UP_UNKNOWN: untold(warm_up),
        SweepFlag.SUSPECT_READINGS: bool(sweep.suspects),
        SweepFlag.REPEATS_APART: _apart(sweep),
        SweepFlag.BLACK_UNDER_RANGE: any(r.luminance is None for r in pixels if r.pixel_value == black),
        SweepFlag.BLACK_NEGATIVE: fit.intervals[2][1] <= 0,
        SweepFlag.BRIGHTNESS_NOT_LINEAR: uneven is not None and _unevenness(uneven) > 1,
    }
    return (flag for flag, is_so in found.items() if is_so)


def _apart(sweep: Sweep[LuminanceReading]) -> bool:
    """Return whether the readings of any level differ by more than is tolerated."""
    by_level: dict[tuple[float, float | None], list[float]] = {}
    for reading in sweep.of_phase(SweepPhase.SWEEP):
        if reading.luminance is not None:
            by_level.setdefault((reading.pixel_value, reading.factor), []).append(reading.luminance)
    return any(max(v) - min(v) > float(tolerated(np.mean(v))) for v in by_level.values())


def pixel_levels(readings: Sequence[LuminanceReading], reflected: float) -> list[PixelLevel]:
    """Return the readings of each pixel value at full brightness, those repeated at the end among them.

    Parameters
    ----------
    readings : sequence of LuminanceReading
        Of a sweep.
    reflected : float
        L_refl, which is taken off [cd/m^2].
    """
    own = [r for r in readings if r.factor is None and r.phase in USED]
    levels = {
        value: [r for r in own if r.pixel_value == value] for value in sorted({r.pixel_value for r in own})
    }
    return [
        PixelLevel(value, repeats_of(at_value, reflected), sum(r.luminance is None for r in at_value))
        for value, at_value in levels.items()
    ]


def repeats_of(readings: Iterable[LuminanceReading], reflected: float = 0.0) -> Repeats:
    """Return luminances less the reflected one [cd/m^2] and times [s] of the readings that have a value."""
    pairs = [(r.luminance - reflected, (r.begun + r.ended) / 2) for r in readings if r.luminance is not None]
    values = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return Repeats(values[:, 0], values[:, 1])


def middle_of(readings: Sequence[LuminanceReading]) -> float:
    """Return the mean time of the sweep of pixel values [s]."""
    return float(np.mean([r.begun for r in readings if r.factor is None and r.phase is SweepPhase.SWEEP]))


def level_rows(readings: Sequence[LuminanceReading], fit: GammaFit, reflected: float) -> list[LuminanceLevel]:
    """Return a row of `luminance_levels.csv` for each pixel value, as it was read beside the fitted curve."""
    own = [r for r in readings if r.factor is None and r.phase is SweepPhase.SWEEP]
    rows = []
    for value in sorted({r.pixel_value for r in own}):
        at_value = [r for r in own if r.pixel_value == value]
        model = float(fit.curve.luminance(value)) + reflected
        rows.append(_row(at_value, model, reflected, fit.curve.peak))
    return rows


def brightness_rows(
    readings: Sequence[LuminanceReading], fit: GammaFit, reflected: float
) -> list[LuminanceLevel]:
    """Return a row of `brightness.csv` for each brightness factor; none if no factors were measured.

    Full is the luminance at b = 1 in the same part of the sweep; if that is no level, the fitted peak.
    """
    own = [r for r in readings if r.factor is not None and r.phase is SweepPhase.SWEEP]
    at_full = repeats_of((r for r in own if r.factor == 1.0), reflected)
    full = at_full.mean if at_full.values.size else fit.curve.peak
    rows = []
    for factor in sorted({r.factor for r in own if r.factor is not None}):
        at_factor = [r for r in own if r.factor == factor]
        achieved = float(np.mean([r.achieved_factor for r in at_factor]))
        rows.append(_row(at_factor, achieved * full + reflected, reflected, full))
    return rows


def _row(readings: Sequence[LuminanceReading], model: float, reflected: float, full: float) -> LuminanceLevel:
    """Return the row of one level."""
    values = np.array([r.luminance for r in readings if r.luminance is not None])
    mean = float(values.mean()) if values.size else None
    return LuminanceLevel(
        factor=readings[0].factor,
        achieved_factor=float(np.mean([r.achieved_factor for r in readings])),
        luminance=mean,
        pixel_value=readings[0].pixel_value,
        luminance_sd=statistics.stdev(values.tolist()) if values.size > 1 else None,
        n_readings=int(values.size),
        n_under_range=len(readings) - int(values.size),
        share=None if mean is None else (mean - reflected) / full,
        model_luminance=model,
        deviation=None if mean is None or model <= 0 else mean / model - 1,
    )

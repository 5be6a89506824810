"""The levels of a luminance sweep: its readings gathered by pixel value and by brightness factor."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence

import numpy as np

from evenlight.analysis.measurement.display_fit import GammaFit
from evenlight.analysis.measurement.gamma_curve import PixelLevel
from evenlight.analysis.measurement.meter_noise import Repeats
from evenlight.data_schema.sweep import LuminanceReading, SweepPhase
from evenlight.data_schema.sweep_fit import LuminanceLevel

USED = (SweepPhase.SWEEP, SweepPhase.DRIFT)


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
    return [
        PixelLevel(
            value, repeats_of((r for r in own if r.pixel_value == value), reflected), _too_dark(own, value)
        )
        for value in sorted({r.pixel_value for r in own})
    ]


def _too_dark(readings: Sequence[LuminanceReading], pixel_value: float) -> int:
    """Return how many readings of a pixel value have no luminance."""
    return sum(r.pixel_value == pixel_value and r.luminance is None for r in readings)


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

"""The brightness factor at which a pixel's contrast becomes visible: closed form but for two tables.

With D = b · I + L_refl, the ratio r = |ΔL| / L_a of emitted luminances does not change with b. Let
e = b · L_a be what is emitted around a pixel. Its contrast (Eq. 2) is then |C| = r · s(e), with the
*effective sensitivity*

    s(e) = S_CSF(f, e + L_refl) · e / (e + L_refl + ε).

Masking (Eq. 3, defined in `contrast.masking`) enters as m, the mean of |C|^0.2 over the neighbourhood divided
by the pixel's own |C|^0.2. In m only the ratio of sensitivities at neighbouring pixels changes with b, and
hardly; it is taken at a reference factor. This is the only approximation. The pixel is then visible where

    t^0.7 > 1 + m · t^0.2,   t = r · s(b · L_a).

The difference of the two sides changes sign once, at t = T(m); and s rises with e. So the pixel is visible
where b exceeds one *critical factor*, s⁻¹(T(m) / r) / L_a. The functions T, s and s⁻¹ are of one variable:
tables in logarithms to base 2.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial, chebyshev
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import ContrastModel, SensitivityModel, Visibility
from evenlight.data_schema.display import Display
from evenlight.method.contrast.csf import LOWEST_LUMINANCE, contrast_sensitivity
from evenlight.method.contrast.masking import MASKING_EXPONENT, TRANSDUCER_EXPONENT
from evenlight.method.contrast.pyramid import counted_frequencies

LARGEST_LOG_RATIO = 8.0  # log2 r is below, for any image: tests/method/test_loss_curves.py
MASKING_RANGE = (-12.0, 20.0)  # log2 m; below T is 1 to 4e-4, above a pixel is 2^-100 of its neighbours
FAINTEST_DETECTED = -4.0  # log2 ρ below which p < 5e-5: soft visibility ends there
TABLE_STEPS = 4096  # of each table but the inverse
_INVERSE_STEPS = 4  # times as many: a display without black level spans 27 octaves, the last nearly flat
SERIES_DEGREE = 12  # of the power series for log2 s and for log2 T
_MARGIN = 0.01  # by which tables reach beyond the luminances of the display, in log2

Table = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class BandTable:
    """The effective sensitivity s(e) of a band on a display, and its inverse, in logarithms to base 2."""

    # of e, from the black level at the lowest factor to the peak luminance [cd/m^2]
    log_luminance_range: tuple[float, float]
    log_sensitivity_range: tuple[float, float]  # of s at these two
    log_sensitivity: Table  # (steps,): log2 s at equal steps of log2 e
    log_sensitivity_series: tuple[np.float32, ...]  # a power series for it, steps being from -1/2 to 1/2
    series_error: float  # of that, at most
    steepest: float  # d log s / d log e, at most
    log_luminance: Table  # (4 steps,): log2 e at equal steps of log2 s; meaningless unless `rises`
    rises: bool  # whether s rises over all these luminances, so that it has an inverse
    can_be_seen: bool  # whether any contrast at all can be visible in this band on this display
    reflected_luminance: float  # L_refl [cd/m^2]


def threshold_table(masking_strength: float = 1.0) -> Table:
    """Return log2 T(m) at equal steps of log2 m over `MASKING_RANGE`.

    T is the contrast that is visible in spite of m: t^0.7 = 1 + κ m · t^0.2 at t = T, in the exponents of
    Zeng, with κ the strength of masking.

    >>> table = threshold_table()
    >>> log_T = np.interp(0.0, np.linspace(*MASKING_RANGE, len(table)), table)  # among equal neighbours
    >>> round(float(2**log_T), 2)
    3.21
    """
    masking = masking_strength * np.exp2(np.linspace(*MASKING_RANGE, TABLE_STEPS))
    return log_threshold(masking).astype(np.float32)


def log_threshold(masking: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return log2 T(m), of any m of at least 0; as `threshold_table`."""
    highest = 2 * np.log2(max(float(masking.max()), 1.0)) + 4
    low, high = np.zeros_like(masking), np.full_like(masking, highest)
    for _ in range(60):  # bisection, to 2^-54 of the interval
        middle = (low + high) / 2
        seen = np.exp2(TRANSDUCER_EXPONENT * middle) > 1 + masking * np.exp2(MASKING_EXPONENT * middle)
        low, high = np.where(seen, low, middle), np.where(seen, middle, high)
    return low


def band_table(
    spatial_frequency: float,
    lowest_factor: float,
    display: Display,
    model: ContrastModel,
    steps: int = TABLE_STEPS,
) -> BandTable:
    """Return the effective sensitivity s(e) of a band on a display, and its inverse.

    Parameters
    ----------
    spatial_frequency : float
        f of the band [cpd].
    lowest_factor : float
        Smallest brightness factor that will be asked for.
    display : Display
        Its luminance range and reflected light.
    model : ContrastModel
        Which sensitivity, and ε.
    steps : int
        Of the table of the sensitivity.
    """
    darkest = lowest_factor * max(display.black_level, LOWEST_LUMINANCE)
    ends = np.log2(darkest) - _MARGIN, np.log2(display.peak_luminance) + _MARGIN
    dense = np.linspace(*ends, 4 * TABLE_STEPS)
    s = effective_sensitivity(spatial_frequency, np.exp2(dense), display, model)
    # A sensitivity of 0, at absurd frequencies, has no logarithm: it stands for never.
    log_s = np.log2(np.maximum(s, np.finfo(np.float64).tiny))
    series, error = _power_series(log_s)
    sensitivity_ends = float(log_s[0]), float(log_s[-1])
    return BandTable(
        log_luminance_range=(float(ends[0]), float(ends[1])),
        log_sensitivity_range=sensitivity_ends,
        log_sensitivity=np.interp(np.linspace(*ends, steps), dense, log_s).astype(np.float32),
        log_sensitivity_series=series,
        series_error=error,
        steepest=float((np.diff(log_s) / np.diff(dense)).max()),
        log_luminance=_inverse(log_s, dense, _INVERSE_STEPS * steps),
        rises=bool((np.diff(log_s) > 0).all()),
        can_be_seen=bool(log_s.max() + LARGEST_LOG_RATIO > _faintest(model)),
        reflected_luminance=display.reflected_luminance,
    )


def _faintest(model: ContrastModel) -> float:
    return FAINTEST_DETECTED if model.visibility is Visibility.SOFT else 0.0


def _power_series(log_s: NDArray[np.float64]) -> tuple[tuple[np.float32, ...], float]:
    """Return the power series of log s at equal steps from -1/2 to 1/2, and its largest error."""
    steps = np.linspace(-0.5, 0.5, len(log_s))
    series = Chebyshev(_least_squares(len(log_s)) @ log_s, domain=[-0.5, 0.5]).convert(kind=Polynomial)
    return tuple(np.float32(c) for c in series.coef), float(np.abs(series(steps) - log_s).max())


@functools.cache
def _least_squares(steps: int) -> NDArray[np.float64]:
    """Return what gives the coefficients of values at equal steps: found once, for it takes 20 ms."""
    columns = chebyshev.chebvander(np.linspace(-1, 1, steps), SERIES_DEGREE)
    return np.asarray(np.linalg.pinv(columns), dtype=np.float64)


def band_tables(
    shape: tuple[int, int],
    lowest_factor: float,
    display: Display,
    model: ContrastModel,
    steps: int = TABLE_STEPS,
) -> list[BandTable]:
    """Return the tables of all bands of a frame of (height, width) pixels, finest first; as `band_table`."""
    frequencies = counted_frequencies(shape, display, model)
    return [band_table(float(f), lowest_factor, display, model, steps) for f in frequencies]


def tables_hold(display: Display, model: ContrastModel) -> bool:
    """Return whether contrast at any factor follows from the ratio r and the effective sensitivity s(e).

    It does not where reflected light meets a sensitivity that is taken at the mean of a level, not at the
    luminance around the pixel: the contrast of a pixel then depends on two luminances.
    """
    return model.sensitivity is not SensitivityModel.AUTHORS or not display.reflected_luminance > 0


def _inverse(log_s: NDArray[np.float64], log_e: NDArray[np.float64], steps: int) -> Table:
    return np.interp(np.linspace(log_s[0], log_s[-1], steps), log_s, log_e).astype(np.float32)


def effective_sensitivity(
    spatial_frequency: float, emitted: NDArray[np.float64], display: Display, model: ContrastModel
) -> NDArray[np.float64]:
    """Return s(e) = |C| / r: the sensitivity, less what reflected light takes from the contrast.

    Parameters
    ----------
    spatial_frequency : float
        f [cpd].
    emitted : array
        e = b · L_a, reflections excluded [cd/m^2].
    display : Display
        For L_refl.
    model : ContrastModel
        Which sensitivity, and ε.
    """
    seen = emitted + display.reflected_luminance
    S = contrast_sensitivity(spatial_frequency, seen, model.sensitivity, model.field_size) / model.threshold
    return np.asarray(S * emitted / (seen + model.epsilon))

"""Contrast in units of its threshold (Eq. 2), and the sensitivity S_CSF(f, L_a) in it: Barten's function.

Sources: P. G. J. Barten, Contrast Sensitivity of the Human Eye (SPIE, 1999), and "Formula for the contrast
sensitivity of the human eye" (Proc. SPIE 5294, 2003). Sensitivity is 1 / modulation at 50 % detection.
In its place, castleCSF: M. Ashraf, R. K. Mantiuk, A. Chapiro, S. Wuerger, Journal of Vision 24(4):5 (2024).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.contrast_model import EPSILON, FIELD_SIZE, SensitivityModel

LOWEST_LUMINANCE = 1e-6  # [cd/m^2] the dark-adapted eye sees nothing below

# All from Barten (1999, 2003), table of constants of the typical observer.
_SIGNAL_TO_NOISE = 3.0  # k
_INTEGRATION_TIME = 0.1  # T [s]
_QUANTUM_EFFICIENCY = 0.03  # η
_NEURAL_NOISE = 3e-8  # Φ0 [s deg²]
_LARGEST_FIELD = 12.0  # X_max [deg]
_LARGEST_CYCLES = 15.0  # N_max [cycles]
_LATERAL_INHIBITION = 7.0  # u0 [cpd]
_BLUR_OF_CONSTANT_PART = 0.5 / 60  # σ0 [deg]
_BLUR_PER_PUPIL_MM = 0.08 / 60  # C_ab [deg/mm]
_PHOTONS_PER_TROLAND = 1.2274e6  # p [photons/s/deg²/td]; ITU-R BT.2246, for displays

# What the authors' script holds fixed.
_AUTHORS_PUPIL = 3.0  # [mm] for the retinal illuminance
_AUTHORS_BLUR_PUPIL = 2.1  # [mm] for the optical blur

# castleCSF's sustained achromatic mechanism: Ashraf et al. (2024), fitted parameters of their release 0.2.0.
_CASTLE_PEAK = (56.4947, 7.54726, 0.144532, 5.58341e-07, 9.66862e09)  # S_max(L)
_CASTLE_PEAK_FREQUENCY = (1.78119, 91.5718, 0.256682)  # f_max(L) [cpd]
_CASTLE_BANDWIDTH = 0.000213047  # bw, in log2 of the squared width in log10 f
_CASTLE_DROP = 0.100207  # a: below f_max sensitivity falls by no more than this share
_CASTLE_AREA = 157.103  # A0 [deg²], over which the eye sums at f = 0
_CASTLE_AREA_FREQUENCY = 0.702338  # f0 [cpd], where this area is half as large
CASTLE_PATTERN_AREA = np.pi * 1.5**2  # A [deg²], σ = 1.5°: as ColorVideoVDP, Mantiuk et al. (2024)
_CASTLE_DARKEST = 1e-3  # [cd/m^2] the model's lowest luminance


def contrast_sensitivity(
    spatial_frequency: ArrayLike,
    luminance: ArrayLike,
    model: SensitivityModel = SensitivityModel.BARTEN,
    field_size: float = FIELD_SIZE,
) -> NDArray[np.float64]:
    """Return the contrast sensitivity S_CSF(f, L_a).

    Decision (docs/decisions/contrast-sensitivity.md): the full form of Barten (1999, 2003), with the pupil
    that goes with the luminance and the field size. castleCSF is taken at 0 Hz and 1.5°.

    Parameters
    ----------
    spatial_frequency : array_like, broadcast with `luminance`
        f, at least 0 [cpd]; at 0 lateral inhibition leaves nothing to be seen, and S is 0.
    luminance : array_like
        L_a [cd/m^2]; below 1e-6 the value at 1e-6 is returned.
    model : SensitivityModel
        Which function.
    field_size : float
        X0, side of the field of view [deg]; castleCSF has a pattern of a fixed size instead.

    Returns
    -------
    array
        S, a pure number.

    >>> contrast_sensitivity(4.0, [1.0, 100.0]).round().tolist()
    [174.0, 657.0]
    """
    f = np.asarray(spatial_frequency, dtype=np.float64)
    L = np.maximum(np.asarray(luminance, dtype=np.float64), LOWEST_LUMINANCE)
    # At f = 0 the neural noise is infinite, as are squares of absurd frequencies: either way the limit S = 0.
    with np.errstate(divide="ignore", over="ignore"):
        return _sensitivity(f, L, model, field_size)


def _sensitivity(
    f: NDArray[np.float64], L: NDArray[np.float64], model: SensitivityModel, field_size: float
) -> NDArray[np.float64]:
    if model is SensitivityModel.SIMPLIFIED:
        return _simplified(f, L, field_size)
    if model is SensitivityModel.CASTLE:
        return castle_sensitivity(f, L)
    if model is SensitivityModel.AUTHORS:
        blur, illuminance = optical_blur(_AUTHORS_BLUR_PUPIL), retinal_illuminance(L, _AUTHORS_PUPIL)
    else:
        pupil = pupil_diameter(L, field_size)
        blur, illuminance = optical_blur(pupil), retinal_illuminance(L, pupil)
    return _barten(f, blur, illuminance, field_size)


def csf_contrast(
    band_luminance: ArrayLike,
    adaptation_luminance: ArrayLike,
    contrast_sensitivity: ArrayLike,
    epsilon: float = EPSILON,
) -> NDArray[np.float64]:
    """Return the CSF-normalized contrast C = ΔL / (L_a + ε) · S_CSF (Eq. 2).

    Parameters
    ----------
    band_luminance : array_like
        ΔL(f, p), signed [cd/m^2].
    adaptation_luminance : array_like, same shape
        L_a(f, p) [cd/m^2].
    contrast_sensitivity : array_like, same shape or a number
        S_CSF(f, L_a(f, p)).
    epsilon : float
        ε, above 0 [cd/m^2].

    Returns
    -------
    array, same shape
        C: 1 is the threshold of a lone pattern.

    >>> csf_contrast([2.0, -1.0], [100.0, 100.0], 200.0).round(6).tolist()
    [4.0, -2.0]
    """
    normalized = np.asarray(band_luminance) / (np.asarray(adaptation_luminance) + epsilon)
    return np.asarray(normalized * np.asarray(contrast_sensitivity))


def pupil_diameter(luminance: ArrayLike, field_size: float = FIELD_SIZE) -> NDArray[np.float64]:
    """Return the pupil's diameter d for a square field (Barten 1999, Eq. 3.5 with field size).

    Parameters
    ----------
    luminance : array_like
        L, above 0 [cd/m^2].
    field_size : float
        X0 [deg].

    Returns
    -------
    array
        d, from 2 to 8 [mm].

    >>> pupil_diameter(1.0, field_size=40.0).item()
    5.0
    """
    return np.asarray(5 - 3 * np.tanh(0.4 * np.log10(np.asarray(luminance) * field_size**2 / 40**2)))


def retinal_illuminance(luminance: ArrayLike, pupil: ArrayLike) -> NDArray[np.float64]:
    """Return the retinal illuminance E, corrected for the Stiles-Crawford effect.

    Parameters
    ----------
    luminance : array_like
        L [cd/m^2].
    pupil : array_like
        d [mm].

    Returns
    -------
    array
        E [td].

    >>> round(retinal_illuminance(100.0, 2.1).item(), 3)
    330.412
    """
    d = np.asarray(pupil)
    area = np.pi * d**2 / 4
    return np.asarray(area * np.asarray(luminance) * (1 - (d / 9.7) ** 2 + (d / 12.4) ** 4))


def optical_blur(pupil: ArrayLike) -> NDArray[np.float64]:
    """Return σ, the standard deviation of the eye's line-spread function [deg], for a pupil d [mm].

    >>> round(optical_blur(2.1).item(), 6)
    0.008791
    """
    return np.hypot(_BLUR_OF_CONSTANT_PART, _BLUR_PER_PUPIL_MM * np.asarray(pupil))


def _barten(
    f: NDArray[np.float64], blur: ArrayLike, illuminance: ArrayLike, field_size: float
) -> NDArray[np.float64]:
    """Return the full form: optical MTF over the square root of photon and neural noise."""
    optical = np.exp(-2 * np.pi**2 * np.asarray(blur) ** 2 * f**2)
    area = 1 / (1 / field_size**2 + 1 / _LARGEST_FIELD**2 + f**2 / _LARGEST_CYCLES**2)
    photon_noise = 1 / (_QUANTUM_EFFICIENCY * _PHOTONS_PER_TROLAND * np.asarray(illuminance))
    neural_noise = _NEURAL_NOISE / -np.expm1(-((f / _LATERAL_INHIBITION) ** 2))
    noise = 2 / _INTEGRATION_TIME * (photon_noise + neural_noise) / area
    return np.asarray(optical / _SIGNAL_TO_NOISE / np.sqrt(noise))


def _simplified(f: NDArray[np.float64], L: NDArray[np.float64], field_size: float) -> NDArray[np.float64]:
    """Return the closed form of Barten (2003) for the typical observer."""
    optical = np.exp(-0.0016 * f**2 * (1 + 100 / L) ** 0.08)
    area = 1 + 144 / field_size**2 + 0.64 * f**2
    noise = 63 / L**0.83 - 1 / np.expm1(-0.02 * f**2)
    return np.asarray(5200 * optical / np.sqrt(area * noise))


def castle_sensitivity(
    spatial_frequency: ArrayLike, luminance: ArrayLike, area: float = CASTLE_PATTERN_AREA
) -> NDArray[np.float64]:
    """Return castleCSF's sensitivity to a static achromatic pattern in the fovea (Ashraf et al. 2024).

    At 0 Hz only the sustained mechanism answers; the transient one is below 1e-5 of it above 0.1 cd/m².

    Parameters
    ----------
    spatial_frequency : array_like, broadcast with `luminance`
        f, at least 0 [cpd]; at 0, S is 0.
    luminance : array_like
        L_a [cd/m^2]; below 1e-3, where the model ends, the value there is returned.
    area : float
        A, area of the pattern [deg²].

    >>> castle_sensitivity(4.0, [1.0, 100.0]).round(1).tolist()
    [51.5, 248.4]
    """
    f, L = np.asarray(spatial_frequency, dtype=np.float64), np.maximum(luminance, _CASTLE_DARKEST)
    first, half, exponent, bright, steepness = _CASTLE_PEAK
    # 1 - (1 + p/L)^-q, with p/L below 1e-3 and q near 1e10: in logarithms nothing is lost.
    fall = -np.expm1(-steepness * np.log1p(bright / L))
    peak = first * (1 + half / L) ** -exponent * fall
    highest, half, exponent = _CASTLE_PEAK_FREQUENCY
    peak_frequency = highest * (1 + half / L) ** -exponent
    with np.errstate(divide="ignore", over="ignore"):  # f = 0 is infinitely far below the peak
        decades = np.log10(f) - np.log10(peak_frequency)
        summed = 1 / ((1 + (f / _CASTLE_AREA_FREQUENCY) ** 2) / _CASTLE_AREA + 1 / area)
    parabola = 10 ** -(decades**2 / 2**_CASTLE_BANDWIDTH)
    shape = np.where(f < peak_frequency, np.maximum(parabola, 1 - _CASTLE_DROP), parabola)
    return np.asarray(peak * shape * np.sqrt(summed) * f)

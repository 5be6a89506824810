"""Visible contrast C_v (Eq. 4) and the contrast 𝓛_c that dimming loses (Eq. 5), by definition, in float64.

This is the plain and slow form, the oracle of everything faster; `contrast.loss_curves` is the fast one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.method.contrast.csf import contrast_sensitivity, csf_contrast
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.masking import perceived_contrast
from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    counted_frequencies,
    gaussian_pyramid,
    laplacian_bands,
)

VISIBILITY_THRESHOLD = 1.0  # of |C_t| (paper, below Eq. 4)


def contrast_loss(
    emitted: NDArray[np.float64], factor: float, display: Display, model: ContrastModel = DEFAULT_MODEL
) -> float:
    """Return the share 𝓛_c of visible contrast that dimming by b loses (Eq. 5).

    Decision (docs/decisions/no-visible-contrast.md): a frame in which nothing is visible even undimmed has
    nothing to lose, and its loss is 0.

    Parameters
    ----------
    emitted : array, (height, width)
        I, luminance that the display emits at b = 1 [cd/m^2].
    factor : float
        Brightness factor b, in (0, 1].
    display : Display
        The display that shows it.
    model : ContrastModel
        Choices of the contrast model.

    Returns
    -------
    float
        𝓛_c, in [0, 1].

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> contrast_loss(np.full((16, 16), 50.0), 0.5, lab)
    0.0
    """
    reference = visible_contrast(dimmed_luminance(emitted, 1.0, display), display, model)
    dimmed = visible_contrast(dimmed_luminance(emitted, factor, display), display, model)
    return loss_of(dimmed, reference)


def loss_of(dimmed: float, reference: float) -> float:
    """Return |1 - C_v^D / C_v^I| within [0, 1], and 0 where the reference is 0 (Eq. 5).

    >>> loss_of(0.25, 0.5), loss_of(0.0, 0.0)
    (0.5, 0.0)
    """
    return min(1.0, abs(1 - dimmed / reference)) if reference > 0 else 0.0


def visible_contrast(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> float:
    """Return the visible contrast C_v: the mean over the bands of their share of visible pixels (Eq. 4).

    Parameters
    ----------
    luminance : array, (height, width)
        L, luminance that reaches the eye, dimmed and with reflections (`dimmed_luminance`) [cd/m^2].
    display : Display
        Its pixels per degree.
    model : ContrastModel
        Choices of the contrast model.

    Returns
    -------
    float
        C_v, in [0, 1].

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> visible_contrast(np.full((16, 16), 50.0), lab)
    0.0
    """
    return float(np.mean([visible.mean() for visible in visible_map(luminance, display, model)]))


def visible_map(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> list[NDArray[np.bool_]]:
    """Return where contrast is visible, 𝕀(|C_t| > 1), in each band, finest first.

    Parameters
    ----------
    luminance : array, (height, width)
        L, luminance that reaches the eye [cd/m^2].
    display : Display
        Its pixels per degree.
    model : ContrastModel
        Choices of the contrast model.

    Returns
    -------
    list of boolean arrays
        One per band, each half as high and wide as the one before.
    """
    contrasts = perceived_contrasts(luminance, display, model)
    if model.visibility is Visibility.POSITIVE_ONLY:
        return [contrast > VISIBILITY_THRESHOLD for contrast in contrasts]
    return [np.abs(contrast) > VISIBILITY_THRESHOLD for contrast in contrasts]


def perceived_contrasts(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> list[NDArray[np.float64]]:
    """Return the perceived contrast C_t of each band, finest first (Eqs. 2 and 3); as `visible_map`."""
    return [perceived_contrast(C, model.masking) for C in csf_contrasts(luminance, display, model)]


def csf_contrasts(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> list[NDArray[np.float64]]:
    """Return the CSF-normalized contrast C of each band, finest first (Eq. 2); as `visible_map`."""
    frequencies = counted_frequencies((luminance.shape[0], luminance.shape[1]), display, model)
    gaussian = gaussian_pyramid(luminance, len(frequencies) + 2)
    bands = laplacian_bands(gaussian[:-1])
    contrasts = []
    for level, (f, band) in enumerate(zip(frequencies, bands, strict=True)):
        adaptation = adaptation_luminance(gaussian, level)
        seen = adaptation.mean() if model.sensitivity is SensitivityModel.AUTHORS else adaptation
        S = contrast_sensitivity(f, seen, model.sensitivity, model.field_size)
        contrasts.append(csf_contrast(band, adaptation, S, model.epsilon))
    return contrasts

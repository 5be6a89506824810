"""Visible contrast C_v (Eq. 4) and the contrast 𝓛_c that dimming loses (Eq. 5), by definition, in float64.

This is the plain and slow form, the oracle of everything faster; `contrast.loss_curves` is the fast one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    LossForm,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.method.contrast.csf import contrast_sensitivity, csf_contrast
from evenlight.method.contrast.detection import detection_probability, share_above_threshold
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.masking import contrast_over_threshold, perceived_contrast
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
    """Return the share 𝓛_c of visible contrast that dimming by b loses (Eq. 5), in the form of the model.

    Decision (docs/decisions/visibility.md): a frame in which nothing is visible even undimmed has
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
    return loss_of(dimmed, reference, model.loss)


def losses_of(dimmed: Array, reference: float, form: LossForm = LossForm.RELATIVE) -> Array:
    """Return `loss_of` of each of several visible contrasts."""
    if form is LossForm.ABSOLUTE:
        return np.abs(reference - dimmed)
    return np.minimum(1.0, np.abs(1 - dimmed / reference)) if reference > 0 else np.zeros_like(dimmed)


def loss_of(dimmed: float, reference: float, form: LossForm = LossForm.RELATIVE) -> float:
    """Return |1 - C_v^D / C_v^I| within [0, 1], and 0 where the reference is 0 (Eq. 5).

    In the absolute form it is |C_v^I - C_v^D|: what a frame with little to see can lose is little.

    >>> loss_of(0.25, 0.5), loss_of(0.0, 0.0), loss_of(0.25, 0.5, LossForm.ABSOLUTE)
    (0.5, 0.0, 0.25)
    """
    return float(losses_of(np.array(dimmed), reference, form))


def visible_contrast(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> float:
    """Return the visible contrast C_v: the mean over the bands of what their pixels count (Eq. 4).

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
    return float(np.mean([counted.mean() for counted in counted_map(luminance, display, model)]))


def counted_map(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> list[NDArray[np.float64] | NDArray[np.bool_]]:
    """Return how much each pixel counts as visible contrast, in each band, finest first.

    Whether it is visible; with soft visibility the probability p that it is detected; in the suprathreshold
    form the contrast that it shows above its threshold.

    Parameters
    ----------
    luminance, display, model : array (height, width), Display, ContrastModel
        As of `visible_map`.

    Returns
    -------
    list of arrays
        One per band, in [0, 1].
    """
    if model.loss is LossForm.SUPRATHRESHOLD:
        return [_shown(*band, display, model) for band in _bands(luminance, display, model)]
    if model.visibility is Visibility.SOFT:
        contrasts = csf_contrasts(luminance, display, model)
        masking = model.masking, model.masking_strength
        return [detection_probability(contrast_over_threshold(C, *masking)) for C in contrasts]
    return list(visible_map(luminance, display, model))


def _shown(
    band: NDArray[np.float64],
    adaptation: NDArray[np.float64],
    S: NDArray[np.float64],
    display: Display,
    model: ContrastModel,
) -> NDArray[np.float64]:
    """Return the contrast that a band shows above its threshold.

    Decision (docs/decisions/soft-visibility.md): it is bounded at that of light against black, |ΔL| = what
    the display emits around the pixel; otherwise a few pixels beside black would decide.
    """
    emitted = np.maximum(adaptation - display.reflected_luminance, 0.0)
    physical = np.minimum(np.abs(band), emitted) / (adaptation + model.epsilon)
    C = csf_contrast(band, adaptation, S, model.epsilon)
    over_threshold = contrast_over_threshold(C, model.masking, model.masking_strength)
    shown = physical * share_above_threshold(over_threshold)
    return np.where(band > 0, shown, 0.0) if model.visibility is Visibility.POSITIVE_ONLY else shown


def visible_map(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> list[NDArray[np.bool_]]:
    """Return where contrast is visible, 𝕀(|C_t| > 1), in each band, finest first.

    With soft visibility these are the pixels that are rather detected than not.

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
    contrasts = csf_contrasts(luminance, display, model)
    return [perceived_contrast(C, model.masking, model.masking_strength) for C in contrasts]


def csf_contrasts(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel = DEFAULT_MODEL
) -> list[NDArray[np.float64]]:
    """Return the CSF-normalized contrast C of each band, finest first (Eq. 2); as `visible_map`."""
    bands = _bands(luminance, display, model)
    return [csf_contrast(band, adaptation, S, model.epsilon) for band, adaptation, S in bands]


def _bands(
    luminance: NDArray[np.float64], display: Display, model: ContrastModel
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Yield ΔL, L_a and S_CSF of each band, finest first."""
    frequencies = counted_frequencies((luminance.shape[0], luminance.shape[1]), display, model)
    gaussian = gaussian_pyramid(luminance, len(frequencies) + 2)
    bands = laplacian_bands(gaussian[:-1])
    for level, (f, band) in enumerate(zip(frequencies, bands, strict=True)):
        adaptation = adaptation_luminance(gaussian, level)
        seen = adaptation.mean() if model.sensitivity is SensitivityModel.AUTHORS else adaptation
        S = contrast_sensitivity(f, seen, model.sensitivity, model.field_size) / model.threshold
        yield band, adaptation, S

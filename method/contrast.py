"""Contrast in units of its threshold (Eq. 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.contrast_model import EPSILON


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

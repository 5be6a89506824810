"""How much of a contrast is seen: the probability that it is detected, and what it shows above its threshold.

Both are functions of ρ, a contrast in units of the one that would be just visible where it is
(`masking.contrast_over_threshold`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SLOPE = 3.5  # β of the Weibull function for contrast detection, Watson & Pelli (1983)


def detection_probability(over_threshold: ArrayLike) -> NDArray[np.float64]:
    """Return the probability p = 1 - 2^(-ρ^β) that a contrast is detected (Weibull's function).

    Decision (docs/decisions/soft-visibility.md): one half at the threshold, because Barten's S is that of
    50 % detection; β from the literature; an observer who sees nothing says so.

    Parameters
    ----------
    over_threshold : array_like
        ρ, contrast over its threshold, at least 0.

    Returns
    -------
    array
        p, in [0, 1].

    >>> detection_probability([0.0, 0.5, 1.0, 2.0]).round(3).tolist()
    [0.0, 0.059, 0.5, 1.0]
    """
    return np.asarray(-np.expm1(-np.log(2) * np.asarray(over_threshold, dtype=np.float64) ** SLOPE))


def share_above_threshold(over_threshold: ArrayLike) -> NDArray[np.float64]:
    """Return the share max(0, 1 - 1/ρ) of a contrast that lies above its threshold.

    Above threshold, contrast looks like what it is physically, less its threshold (contrast constancy:
    Georgeson & Sullivan 1975; the difference: Kulikowski 1976).

    Parameters
    ----------
    over_threshold : array_like
        ρ, contrast over its threshold, at least 0.

    Returns
    -------
    array
        The share, in [0, 1).

    >>> share_above_threshold([0.0, 1.0, 2.0, 4.0]).tolist()
    [0.0, 0.0, 0.5, 0.75]
    """
    return np.asarray(1 - 1 / np.maximum(np.asarray(over_threshold, dtype=np.float64), 1.0))

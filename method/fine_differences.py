"""How many pixels of an image differ visibly from their neighbours: a cheap sign that fine contrast changed.

Counting a fine frequency band takes most of a frame's analysis. Whether the count will have changed since
another frame shows in something much cheaper: the shares of pixels whose difference g from the two next
pixels, to the right and below, exceeds some thresholds. At high frequencies sensitivity grows about as the
square root of luminance (de Vries and Rose; it does in Barten's model), so that visibility goes by g²/L.
These shares tell *that* something changed; what it does to the loss is then counted.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from evenlight.method.critical_factor import BandTable
from evenlight.method.one_pass import compiled

# The least contrast seen among equal neighbours, in units of the threshold: t^0.7 = 1 + t^0.2 at t = 3.2.
_AMONG_EQUALS = 3.2
_STEPS = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # of g, around what is just visible
_BELOW_PEAK = 0.1  # share of the peak luminance at which sensitivity is taken for these thresholds

Shares = NDArray[np.float64]


def difference_thresholds(band: BandTable) -> NDArray[np.float32]:
    """Return the thresholds of g²/L for a band [cd/m^2], (5,)."""
    log_e = band.log_luminance_range[1] + np.log2(_BELOW_PEAK)
    at = np.linspace(*band.log_luminance_range, len(band.log_sensitivity))
    sensitivity = np.exp2(np.interp(log_e, at, band.log_sensitivity))
    return np.asarray((_STEPS * _AMONG_EQUALS / sensitivity) ** 2 * np.exp2(log_e), dtype=np.float32)


def difference_shares(luminance: NDArray[np.float32], thresholds: NDArray[np.float32]) -> Shares:
    """Return the shares of pixels whose g²/L exceeds each threshold.

    Parameters
    ----------
    luminance : array, (height, width), at least 2 × 2
        Of an image, or of a level of its pyramid [cd/m^2].
    thresholds : array, (n,)
        Of g²/L [cd/m^2].

    >>> edge = np.array([[1, 1, 3], [1, 1, 3], [1, 1, 3]], np.float32)  # g²/L is 4 beside the edge, else 0
    >>> difference_shares(edge, np.array([1, 5], np.float32)).tolist()
    [0.5, 0.0]
    """
    counts = np.zeros(len(thresholds), np.int64)
    count_differences(luminance, thresholds, counts)
    return np.asarray(counts / ((luminance.shape[0] - 1) * (luminance.shape[1] - 1)))


@compiled
def count_differences(luminance: Any, thresholds: Any, counts: Any) -> None:
    """Add to `counts` how many pixels exceed each threshold."""
    height, width = luminance.shape
    row = np.empty(width - 1, np.float32)
    for i in range(height - 1):
        here, below = luminance[i], luminance[i + 1]
        for j in range(width - 1):
            g = abs(here[j] - here[j + 1]) + abs(here[j] - below[j])
            row[j] = g * g / max(here[j], np.float32(1e-9))
        for k in range(thresholds.size):
            threshold, n = thresholds[k], numba.int32(0)
            for j in range(width - 1):
                n += numba.int32(row[j] > threshold)
            counts[k] += n

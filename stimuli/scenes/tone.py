"""How a scene's luminance becomes the pixel values of a display."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

PEAK = 100.0  # [cd/m^2] of the display that scenes are made for, about that of a headset
KNEE = 0.75  # share of the peak above which light is compressed


def shown_share(luminance: ArrayLike) -> NDArray[np.float64]:
    """Return which share of the display's peak is shown for a scene's light, each channel for itself.

    Up to `KNEE` it is the luminance over the peak; above, it approaches 1 smoothly, with the same slope at
    the knee.

    Parameters
    ----------
    luminance : array_like, any shape
        Linear RGB luminance [cd/m^2].

    >>> shown_share([0.0, 50.0, 75.0, 1e6]).tolist()
    [0.0, 0.5, 0.75, 1.0]
    """
    share = np.maximum(np.asarray(luminance, dtype=np.float64), 0) / PEAK
    over = np.maximum(share - KNEE, 0) / (1 - KNEE)
    return np.asarray(np.minimum(share, KNEE) + (1 - KNEE) * (1 - np.exp(-over)))

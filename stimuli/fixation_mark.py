"""The mark that is looked at during an interval: a bull's eye with a cross hair.

Of the marks that Thaler, Schütz, Goodale & Gegenfurtner (2013, Vision Research 76:31) compared, it keeps the
eye most still.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.method.contrast.luminance import displayed_luminance

OUTER, INNER = 0.6, 0.2  # [deg] diameters of both discs, as published; the cross is as wide as the inner one
DARKER, BRIGHTER = -0.2, 0.25  # Weber contrast: plain to see, its after-image weak (choice)


def fixation_mark(size: tuple[int, int], pixels_per_degree: float) -> NDArray[np.uint8]:
    """Return how much of each pixel the mark covers, from 0 to 255, (height, width).

    Parameters
    ----------
    size : (int, int)
        Width and height of the window [pixels].
    pixels_per_degree : float
        Of the display.

    >>> mark = fixation_mark((101, 101), pixels_per_degree=100.0)
    >>> mark[50, [50, 62, 75, 90]].tolist(), mark[68, 68].item()  # dot, cross, cross, nothing; disc
    ([255, 0, 0, 0], 255)
    """
    width, height = size
    image = np.zeros((height, width), np.uint8)
    half = int(np.ceil(OUTER / 2 * pixels_per_degree)) + 1
    rows = slice(max(0, height // 2 - half), height // 2 + half + 1)
    columns = slice(max(0, width // 2 - half), width // 2 + half + 1)
    y = (np.arange(height)[rows] - (height - 1) / 2)[:, None] / pixels_per_degree
    x = (np.arange(width)[columns] - (width - 1) / 2)[None, :] / pixels_per_degree

    def within(distance: NDArray[np.float64], most: float) -> NDArray[np.float64]:
        return np.clip((most - distance) * pixels_per_degree + 0.5, 0.0, 1.0)  # smooth over a pixel

    from_centre, from_axes = np.hypot(x, y), np.minimum(abs(x), abs(y))
    ring = within(from_centre, OUTER / 2) * (1 - within(from_axes, INNER / 2))
    image[rows, columns] = np.rint(255 * np.maximum(ring, within(from_centre, INNER / 2)))
    return image


def mark_contrast(darkest: float, display: Display) -> float:
    """Return the Weber contrast of the mark for a trial: the same however the field changes in it.

    Parameters
    ----------
    darkest : float
        Lowest luminance L that pixels draw of the field in the trial [cd/m^2].
    display : Display
        The display: the mark is darker than the field, or brighter where black is too bright for that.

    >>> display = Display("lab", 100.0, 1.0, 2.0, pixels_per_degree=60.0)
    >>> mark_contrast(50.0, display), mark_contrast(1.1, display)
    (-0.2, 0.25)
    """
    return DARKER if (1 + DARKER) * darkest > float(displayed_luminance(0.0, display)) else BRIGHTER

"""Which codes a display draws for the pixels of an image that is dimmed by a factor.

Decision (docs/decisions/dimmed-playback.md): one way for all pictures. A pixel's level stands for a luminance
(Eq. 1), the factor dims it, and a display draws it with the two codes next to it (`stimuli.dithering`); each
channel counts as the luminance that all three together would have at its level. What is darker than the
display's black cannot be drawn, and is drawn black. `stimuli.image_renderer` draws these very codes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.method.luminance import LUMINANCE_WEIGHTS, dimmed_luminance, displayed_luminance
from evenlight.stimuli.dithering import dithered_codes, luminance_of_codes, neighbouring_codes

GRID_LEVELS, DEEP_LEVELS = 1024, 65536
# The 16-bit numbers that 10-bit files are read as; the ten upper bits of each are its level.
GRID = ((np.arange(GRID_LEVELS) * 65535 + 511) // 1023).astype(np.uint16)


def levels_of(pixel_values: NDArray[Any]) -> tuple[NDArray[Any], int]:
    """Return pixel values as whole levels, and how many levels there are.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        L': uint8 or uint16 over the full range, or floats in [0, 1].

    Returns
    -------
    levels : array of uint8 or uint16, same shape
        From 0 on.
    count : int
        256 for uint8, 1024 for 16 bits that hold 10, else 65536, to which floats are rounded.

    >>> levels_of(np.array([[[0, 21845, 65535]]], np.uint16))
    (array([[[   0,  341, 1023]]], dtype=uint16), 1024)
    """
    if pixel_values.dtype == np.uint8:
        return pixel_values, 256
    if pixel_values.dtype != np.uint16:
        return np.rint(np.clip(pixel_values, 0, 1) * (DEEP_LEVELS - 1)).astype(np.uint16), DEEP_LEVELS
    levels = pixel_values >> np.uint16(6)
    if np.array_equal(GRID[levels], pixel_values):
        return levels, GRID_LEVELS
    return pixel_values, DEEP_LEVELS


def level_luminance(count: int, factor: float, display: Display) -> NDArray[np.float64]:
    """Return the luminance D that each level is drawn with, reflected light included [cd/m^2].

    Parameters
    ----------
    count : int
        How many levels there are.
    factor : float
        Brightness factor b, in (0, 1].
    display : Display
        The display; nothing is darker than its black.

    >>> lab = Display("lab", 100.0, 1.0, 2.0, pixels_per_degree=60.0, reflected_luminance=4.0)
    >>> level_luminance(256, 0.5, lab)[[0, 255]].tolist()
    [5.0, 54.0]
    """
    full = displayed_luminance(np.arange(count) / (count - 1), display)
    dimmed = dimmed_luminance(full - display.reflected_luminance, factor, display)
    return np.asarray(np.maximum(dimmed, full[0]))


def level_mixtures(count: int, factor: float, display: Display, bits: int) -> NDArray[np.uint32]:
    """Return for each level the lower code, and the share of the upper one in 2^-24, (count, 2)."""
    lower, share = neighbouring_codes(level_luminance(count, factor, display), display, bits)
    return np.stack([lower.astype(np.uint32), share], axis=-1)


def image_codes(
    pixel_values: NDArray[Any], factor: float, thresholds: NDArray[np.uint32], display: Display, bits: int
) -> NDArray[np.int64]:
    """Return the codes that an image is drawn with, (height, width, 3).

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        As for `levels_of`.
    factor : float
        Brightness factor b.
    thresholds : array of uint32, (height, width)
        Of each pixel, the same for its channels, so that gray stays gray.
    display : Display
        The display.
    bits : int
        Bits of a code.
    """
    levels, count = levels_of(pixel_values)
    luminance = level_luminance(count, factor, display)[levels]
    return dithered_codes(luminance, thresholds[..., np.newaxis], display, bits)


def mean_of_levels(levels: NDArray[Any], luminance: NDArray[np.float64]) -> float:
    """Return the mean luminance of an image, each of whose channels has one for each level [cd/m^2].

    Parameters
    ----------
    levels : array of int, (height, width, 3)
        Levels, or codes, of R, G, B.
    luminance : array, (count,)
        That all three together have at a level.

    >>> mean_of_levels(np.array([[[0, 1, 0], [1, 1, 1]]]), np.array([0.0, 10.0]))
    8.576
    """
    # Levels are counted, not turned into luminances one by one: there are many pixels and few levels.
    counts = [np.bincount(levels[..., channel].ravel(), minlength=len(luminance)) for channel in range(3)]
    sums = np.array([count @ luminance for count in counts])
    return float(sums @ LUMINANCE_WEIGHTS / levels[..., 0].size)


def mean_of_codes(codes: NDArray[Any], display: Display, bits: int) -> float:
    """Return the mean luminance that codes show, (height, width, 3) [cd/m^2]."""
    return mean_of_levels(codes, luminance_of_codes(np.arange(1 << bits), display, bits))

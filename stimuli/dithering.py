"""Which codes a display draws for a luminance, and for the pixels of a dimmed image.

Decision (docs/decisions/dimmed-playback.md): a luminance between two neighbouring codes is drawn as a mix of
both, with a share of the upper one that is linear in light, so that the mean is unbiased in cd/m^2. From the
share on all is whole numbers, so that the shaders of `stimuli.field_renderer` and `stimuli.image_renderer`
draw these very codes. The mean luminance of a frame is then the one meant.

One way for all images: a pixel's level stands for a luminance (Eq. 1), the factor dims it, and it is drawn
with the two codes next to it; each channel counts as the luminance that all three together would have at its
level. What is darker than the display's black is drawn black.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, displayed_luminance, drawn_luminance

LEVELS = 1 << 24  # of a threshold: shares of the upper code are resolved to 6e-8
BAYER_2 = np.array([[0, 2], [3, 1]])  # Bayer (1973)
MULTIPLIER, INCREMENT = np.uint32(1664525), np.uint32(1013904223)  # Jarzynski & Olano (2020), pcg4d
ROUNDING = 1e-9  # relative, of a luminance that was computed
GRID_LEVELS, DEEP_LEVELS = 1024, 65536
# The 16-bit numbers that 10-bit files are read as; the ten upper bits of each are its level.
GRID = ((np.arange(GRID_LEVELS) * 65535 + 511) // 1023).astype(np.uint16)


def neighbouring_codes(
    luminance: ArrayLike, display: Display, bits: int
) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Return the code below a luminance, and the share of the code above it in a mix of that luminance.

    Parameters
    ----------
    luminance : array_like, any shape
        L, reflected light included [cd/m^2].
    display : Display
        The display.
    bits : int
        Bits of a code.

    Returns
    -------
    lower, share : array, same shape
        The lower code; the upper one's share, linear in light, in units of 1 / `LEVELS`.

    Raises
    ------
    ValueError
        If the display does not reach the luminance.

    >>> lab = Display("lab", 255.0, 0.0, 1.0, pixels_per_degree=60.0)
    >>> lower, share = neighbouring_codes([0.0, 100.25, 255.0], lab, bits=8)
    >>> lower.tolist(), (share / LEVELS).tolist()
    ([0, 100, 254], [0.0, 0.25, 1.0])
    """
    steps = luminance_of_codes(np.arange(1 << bits), display, bits)
    wanted = np.asarray(luminance, dtype=np.float64)
    slack = ROUNDING * steps[-1]
    outside = wanted[~((wanted >= steps[0] - slack) & (wanted <= steps[-1] + slack))]
    if outside.size:
        raise ValueError(
            f"luminance must be between {steps[0]:g} and {steps[-1]:g} cd/m^2 on {display.name!r}, "
            f"got {outside[0]:g}"
        )
    lower = np.clip(np.searchsorted(steps, wanted, side="right") - 1, 0, len(steps) - 2)
    share = (wanted - steps[lower]) / (steps[lower + 1] - steps[lower])
    return lower, np.rint(np.clip(share, 0.0, 1.0) * LEVELS).astype(np.uint32)


def luminance_of_codes(codes: ArrayLike, display: Display, bits: int) -> NDArray[np.float64]:
    """Return the luminance L that codes of a display show [cd/m^2].

    >>> luminance_of_codes([0, 1023], Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0), 10).tolist()
    [0.1, 100.0]
    """
    return displayed_luminance(np.asarray(codes) / ((1 << bits) - 1), display)


def thresholds_of(
    dither: Dither, shape: tuple[int, int], frame: int = 0, seed: int = 0
) -> NDArray[np.uint32]:
    """Return the threshold of each pixel, below `LEVELS`.

    Parameters
    ----------
    dither : Dither
        The method: noise that is fresh in each pixel and frame (Allard & Faubert 2008), the same 8 x 8 matrix
        in every frame (Bayer 1973), or one half everywhere, which rounds to the nearest luminance.
    shape : (int, int)
        Height and width [pixels].
    frame, seed : int
        Number of the frame, and the noise's seed; both in [0, 2^32).

    Returns
    -------
    array of uint32, (height, width)
        Row 0 on top.

    >>> (thresholds_of(Dither.ORDERED, (2, 2)) * 128 // LEVELS).tolist()
    [[1, 65], [97, 33]]
    """
    rows, columns = np.indices(shape, dtype=np.uint32)
    if dither is Dither.NOISY_BIT:
        return hashed(columns, rows, frame, seed) >> np.uint32(8)
    if dither is Dither.ORDERED:
        matrix = (2 * bayer_matrix() + 1) * (LEVELS // 128)
        return np.asarray(matrix[rows % 8, columns % 8], dtype=np.uint32)
    return np.full(shape, LEVELS // 2, dtype=np.uint32)


def bayer_matrix() -> NDArray[np.int64]:
    """Return the 8 x 8 threshold matrix of Bayer (1973): 0 to 63, each once, neighbours far apart.

    >>> bayer_matrix()[:2, :4].tolist()
    [[0, 32, 8, 40], [48, 16, 56, 24]]
    """
    matrix = BAYER_2
    for _ in range(2):
        # Four copies side by side, whose equal thresholds differ in the two new last bits.
        matrix = 4 * np.tile(matrix, (2, 2)) + np.kron(BAYER_2, np.ones_like(matrix))
    return matrix


def hashed(columns: ArrayLike, rows: ArrayLike, frame: int, seed: int) -> NDArray[np.uint32]:
    """Return the noise of pixels: pcg4d of Jarzynski & Olano (2020, JCGT 9(3)), its last word.

    The same column, row, frame and seed give the same noise on every machine, so what a participant saw can
    be drawn again from the log.

    Parameters
    ----------
    columns, rows : array_like of int, any shape
        From the left, from the top.
    frame, seed : int
        In [0, 2^32).
    """
    for name, number in (("frame", frame), ("seed", seed)):
        if not 0 <= number < 1 << 32:
            raise ValueError(f"{name} must be in [0, 2^32), got {number}")
    with np.errstate(over="ignore"):  # arithmetic modulo 2^32 is what is meant
        words = [
            np.asarray(w).astype(np.uint32) * MULTIPLIER + INCREMENT for w in (columns, rows, frame, seed)
        ]
        for last in (False, True):
            for k, (i, j) in enumerate(((1, 3), (2, 0), (0, 1), (1, 2))):
                words[k] = words[k] + words[i] * words[j]
            words = words if last else [word ^ (word >> np.uint32(16)) for word in words]
    return np.asarray(words[3])


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
    return drawn_luminance(full - display.reflected_luminance, factor, display)


def level_mixtures(count: int, factor: float, display: Display, bits: int) -> NDArray[np.uint32]:
    """Return for each level the lower code, and the share of the upper one in 2^-24, (count, 2)."""
    lower, share = neighbouring_codes(level_luminance(count, factor, display), display, bits)
    return np.stack([lower.astype(np.uint32), share], axis=-1)


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

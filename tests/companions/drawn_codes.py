"""The codes that an image is drawn with, by numpy: the reference of what the shaders draw."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.stimuli.dithering import level_luminance, levels_of, neighbouring_codes


def dithered_codes(
    luminance: ArrayLike, thresholds: NDArray[np.uint32], display: Display, bits: int
) -> NDArray[np.int64]:
    """The codes for a luminance, which broadcasts with the thresholds: the upper one where they are below.

    >>> lab = Display("lab", 255.0, 0.0, 1.0, pixels_per_degree=60.0)
    >>> dithered_codes(100.25, np.array([[0, 1 << 21], [1 << 22, 1 << 23]], np.uint32), lab, bits=8).tolist()
    [[101, 101], [100, 100]]
    """
    lower, share = neighbouring_codes(luminance, display, bits)
    return np.asarray(lower + (thresholds < share))


def image_codes(
    pixel_values: NDArray[Any], factor: float, thresholds: NDArray[np.uint32], display: Display, bits: int
) -> NDArray[np.int64]:
    """The codes, (height, width, 3), of an image dimmed by a factor.

    The thresholds, (height, width), are the same for a pixel's channels, so that gray stays gray.
    """
    levels, count = levels_of(pixel_values)
    luminance = level_luminance(count, factor, display)[levels]
    return dithered_codes(luminance, thresholds[..., np.newaxis], display, bits)

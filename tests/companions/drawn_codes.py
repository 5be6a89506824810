"""The codes that an image is drawn with, by numpy: the reference of what the shaders draw."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.stimuli.dithering import dithered_codes, level_luminance, levels_of


def image_codes(
    pixel_values: NDArray[Any], factor: float, thresholds: NDArray[np.uint32], display: Display, bits: int
) -> NDArray[np.int64]:
    """The codes, (height, width, 3), of an image dimmed by a factor.

    The thresholds, (height, width), are the same for a pixel's channels, so that gray stays gray.
    """
    levels, count = levels_of(pixel_values)
    luminance = level_luminance(count, factor, display)[levels]
    return dithered_codes(luminance, thresholds[..., np.newaxis], display, bits)

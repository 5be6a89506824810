"""Small pictures of frames, at full brightness and as they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.method.luminance import unit_pixel_values

Image = NDArray[np.uint8]

SCREEN_GAMMA = 2.2  # of the reader's screen: a picture dimmed by b has its pixel values scaled by b^(1/2.2)


def thumbnails_of(
    samples: Sequence[tuple[int, NDArray[Any]]], count: int = 6, width: int = 320
) -> tuple[tuple[int, Image], ...]:
    """Return small pictures of some sampled frames, evenly spread.

    Parameters
    ----------
    samples : sequence of (int, array (height, width, 3))
        Indices and pixel values of frames, as `FrameSamples.held`.
    count : int
        How many pictures.
    width : int
        Their least width [pixels].

    >>> frame = np.zeros((2, 2, 3), np.uint8)
    >>> [index for index, _ in thumbnails_of([(4 * k, frame) for k in range(12)], count=3)]
    [8, 24, 40]
    """
    n = len(samples)
    count = min(count, n)
    chosen = ((2 * k + 1) * n // (2 * count) for k in range(count))
    return tuple((samples[k][0], small_picture(samples[k][1], width)) for k in chosen)


def small_picture(pixel_values: NDArray[Any], width: int = 320) -> Image:
    """Return a frame as a small picture: pixels averaged in squares, so that it is at least `width` wide.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        As in `Frame`; a frame narrower than twice `width` keeps its size.
    width : int
        Its least width [pixels].
    """
    high, wide = pixel_values.shape[:2]
    across = max(1, wide // width)
    down = min(across, high)
    rows, columns = high // down, wide // across
    part = unit_pixel_values(pixel_values[: rows * down, : columns * across])
    mean = part.reshape(rows, down, columns, across, 3).mean(axis=(1, 3))
    return np.asarray(np.round(255 * mean), dtype=np.uint8)


def dimmed_picture(picture: Image, factor: float) -> Image:
    """Return a picture as it looks dimmed by b, on the reader's screen.

    >>> dimmed_picture(np.full((1, 1, 3), 255, np.uint8), 0.5 ** 2.2).tolist()
    [[[128, 128, 128]]]
    """
    return np.asarray(np.round(picture * factor ** (1 / SCREEN_GAMMA)), dtype=np.uint8)

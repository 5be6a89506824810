"""Frames with fewer pixels: what is left of a video on a display that cannot show all of them.

A pixel of the display gives the mean light of the pixels of the video that lie in it. So light is averaged by
area, not pixel values: a fine checkerboard of black and white is half as bright as white, not 22 %.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from evenlight.data_schema.frame import Frame


def coarser(frames: Iterable[Frame], shape: tuple[int, int], gamma: float) -> Iterator[Frame]:
    """Yield frames averaged to fewer pixels, in linear light.

    Parameters
    ----------
    frames : iterable of Frame
        All of one size.
    shape : (height, width)
        What they become, neither side longer than it was.
    gamma : float
        Of the display: linear light is pixel value to the power of gamma.

    Yields
    ------
    Frame
        Pixel values as float32 in [0, 1].
    """
    rows = columns = None
    for frame in frames:
        height, width = frame.pixel_values.shape[:2]
        if rows is None or columns is None or (rows.shape[1], columns.shape[1]) != (height, width):
            rows, columns = area_weights(height, shape[0]), area_weights(width, shape[1])
        light = linear_light(frame.pixel_values, gamma)
        flat = (rows @ light.reshape(height, -1)).reshape(shape[0], width, 3)
        across = np.ascontiguousarray(flat.transpose(1, 0, 2)).reshape(width, -1)
        small = (columns @ across).reshape(shape[1], shape[0], 3).transpose(1, 0, 2)
        encoded = np.clip(small, 0.0, 1.0) ** np.float32(1 / gamma)
        yield Frame(frame.time, frame.duration, np.ascontiguousarray(encoded, dtype=np.float32))


def linear_light(pixel_values: NDArray[Any], gamma: float) -> NDArray[np.float32]:
    """Return pixel values to the power of gamma, integers as shares of their range."""
    if pixel_values.dtype.kind == "u":
        steps = np.iinfo(pixel_values.dtype).max
        table = ((np.arange(steps + 1) / steps) ** gamma).astype(np.float32)
        return np.asarray(table[pixel_values])
    return np.asarray(pixel_values, dtype=np.float32) ** np.float32(gamma)


def area_weights(many: int, few: int) -> sparse.csr_array[Any]:
    """Return the share that each of many pixels in a row has in each of few, (few, many).

    >>> area_weights(4, 2).toarray().tolist()
    [[0.5, 0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 0.5]]
    """
    if not 0 < few <= many:
        raise ValueError(f"need 1 to {many} pixels in place of {many}, got {few}")
    scale = many / few
    cells, pixels, shares = [], [], []
    for cell in range(few):
        low, high = cell * scale, (cell + 1) * scale
        for pixel in range(int(low), min(int(np.ceil(high)), many)):
            share = (min(high, pixel + 1) - max(low, pixel)) / scale
            if share > 0:
                cells.append(cell)
                pixels.append(pixel)
                shares.append(share)
    weights = sparse.coo_array((shares, (cells, pixels)), shape=(few, many), dtype=np.float32)
    return sparse.csr_array(weights)

"""Colours of the scenes: linear light reflected by a surface, written as one picks them on a screen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Colour = tuple[float, float, float]
Texture = Callable[[np.random.Generator, int], NDArray[np.float32]]
"""(rng, size) -> (size, size, 3) linear albedo in [0, 1], or (size, size, 4) with alpha; it can be tiled."""


def linear(code: str) -> Colour:
    """Return the linear albedo of a colour picked as sRGB "rrggbb".

    >>> linear("ffffff"), linear("000000")
    ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    """
    encoded = np.array([int(code[at : at + 2], 16) for at in (0, 2, 4)]) / 255
    light = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    red, green, blue = light.tolist()
    return red, green, blue


def rgb(colour: Any) -> NDArray[np.float32]:
    """Return one colour or several as an array in single precision, as pictures are."""
    return np.asarray(colour, dtype=np.float32)


def blended(low: Any, high: Any, share: NDArray[Any]) -> NDArray[np.float32]:
    """Return the picture, (..., 3), that goes from colour `low` to `high` as `share` goes from 0 to 1."""
    amount = np.clip(share, 0, 1)[..., np.newaxis].astype(np.float32)
    first, second = rgb(low), rgb(high)
    mixed: NDArray[np.float32] = first + amount * (second - first)
    return mixed


def albedo(picture: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """Return a picture kept within what real surfaces reflect: nothing is black, nothing a mirror."""
    kept: NDArray[np.float32] = np.clip(picture, 0.004, 0.92).astype(np.float32)
    return kept


def shaded(picture: NDArray[np.float32], factor: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """Return the picture, (..., 3), times a factor for each pixel."""
    product: NDArray[np.float32] = picture * factor[..., np.newaxis].astype(np.float32)
    return product

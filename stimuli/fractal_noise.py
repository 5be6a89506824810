"""Fractal value noise, the same picture at every resolution: terrain, clouds, water."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def fractal_noise(
    rng: np.random.Generator, shape: tuple[int, int], cells: tuple[int, int], octaves: int, gain: float = 0.5
) -> NDArray[np.float32]:
    """Return noise with mean about 0.5 whose octaves double in frequency and fall in amplitude.

    The lattice of random values does not depend on the size of the picture: a larger picture of the same
    generator state shows the same shapes. The last column joins the first one.

    Parameters
    ----------
    rng : Generator
        Source of the lattice values.
    shape : (int, int)
        Height and width [pixels].
    cells : (int, int)
        Lattice cells over the height and the width in the first octave.
    octaves : int
        How many octaves are added.
    gain : float
        Amplitude of an octave relative to the one before it.

    Returns
    -------
    array, shape
        About in [0, 1].

    >>> fractal_noise(np.random.default_rng(1), (4, 6), (2, 2), octaves=2).shape
    (4, 6)
    """
    total = np.zeros(shape, dtype=np.float32)
    weights = gain ** np.arange(octaves)
    for octave, weight in enumerate(weights.tolist()):
        down, across = cells[0] << octave, cells[1] << octave
        lattice = rng.random((down + 1, across), dtype=np.float32) - np.float32(0.5)
        rows = _interpolation(shape[0], down, periodic=False)
        columns = _interpolation(shape[1], across, periodic=True)
        total += np.float32(weight) * (rows @ lattice @ columns.T)
    # Value noise of one octave has a standard deviation of about 0.2: this spreads the sum over [0, 1].
    total /= np.float32(1.3 * np.linalg.norm(weights))
    return total + np.float32(0.5)


def _interpolation(samples: int, cells: int, periodic: bool) -> NDArray[np.float32]:
    position = (np.arange(samples) + 0.5) * cells / samples
    below = np.floor(position).astype(np.intp)
    share = position - below
    share = share * share * share * (share * (6 * share - 15) + 10)  # Perlin (2002): no creases at cells
    matrix = np.zeros((samples, cells if periodic else cells + 1), dtype=np.float32)
    matrix[np.arange(samples), below] = 1 - share
    above = (below + 1) % cells if periodic else below + 1
    matrix[np.arange(samples), above] += share
    return matrix


def ridged(noise: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Return noise folded at its middle, so that sharp crests run where it crosses 0.5."""
    crests: NDArray[np.floating[Any]] = 1 - np.abs(2 * noise - 1)
    return crests


def smoothstep(values: NDArray[np.floating[Any]], low: float, high: float) -> NDArray[np.floating[Any]]:
    """Return 0 below `low`, 1 above `high`, and a smooth rise between.

    >>> smoothstep(np.array([0.0, 1.0, 2.0, 3.0]), 0.0, 2.0).tolist()
    [0.0, 0.5, 1.0, 1.0]
    """
    share: NDArray[np.floating[Any]] = np.clip((values - np.float32(low)) / np.float32(high - low), 0, 1)
    share *= share * (3 - 2 * share)
    return share

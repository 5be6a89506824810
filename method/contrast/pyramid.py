"""Gaussian and Laplacian pyramids (Burt & Adelson 1983), and which of their bands count.

Decision (docs/decisions/bands.md): beyond its border an image continues as its mirror, the edge
pixel not repeated. Each step is written in differences from the centre pixel, so that an area of one
luminance has bands of exactly 0 in any precision: masking raises contrasts to the power 0.2, which would
turn rounding noise of 1e-7 into 0.04.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import LOWEST_FREQUENCY, BandFrequency, ContrastModel
from evenlight.data_schema.display import Display

CENTRE_WEIGHT = 0.4  # a of the generating kernel, Burt & Adelson (1983), used by Tursun et al. (2019)
INNER_WEIGHT = 0.25  # of each neighbour
OUTER_WEIGHT = 0.25 - CENTRE_WEIGHT / 2  # of each neighbour but one
# Energy centroid of each band of the a = 0.4 pyramid, as a share of the Nyquist frequency; further bands
# halve. Computed from the kernel in tests/method/test_csf.py.
_CENTROIDS = (0.672, 0.294, 0.138, 0.068)


def level_shapes(shape: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the (height, width) of all Gaussian levels: halved, rounded up, until a side is one pixel.

    >>> level_shapes((9, 13))
    [(9, 13), (5, 7), (3, 4), (2, 2), (1, 1)]
    """
    shapes = [shape]
    while min(shapes[-1]) > 1:
        height, width = shapes[-1]
        shapes.append(((height + 1) // 2, (width + 1) // 2))
    return shapes


def gaussian_pyramid(image: Array, n_levels: int) -> list[Array]:
    """Return Gaussian levels 0 to n_levels - 1 of an image; level 0 is the image.

    Parameters
    ----------
    image : array, (height, width)
        For instance luminance [cd/m^2].
    n_levels : int
        How many; sizes are halved, rounded up.

    >>> [level.shape for level in gaussian_pyramid(np.ones((8, 5)), 3)]
    [(8, 5), (4, 3), (2, 2)]
    """
    levels = [image]
    while len(levels) < n_levels:
        levels.append(_reduce_rows(_reduce_rows(levels[-1]).T).T)
    return levels


def laplacian_bands(gaussian: Sequence[Array]) -> list[Array]:
    """Return the band-limited differences ΔL: each Gaussian level minus the next one expanded.

    Parameters
    ----------
    gaussian : sequence of n + 1 arrays
        Gaussian levels, finest first.

    Returns
    -------
    list of n arrays
        Bands, of the sizes of the first n levels.

    >>> bool(laplacian_bands(gaussian_pyramid(np.full((4, 4), 0.1), 2))[0].any())
    False
    """
    return [fine - expanded(coarse, (fine.shape[0], fine.shape[1])) for fine, coarse in pairwise(gaussian)]


def adaptation_luminance(gaussian: Sequence[Array], level: int) -> Array:
    """Return L_a of a band: the Gaussian two levels down, expanded twice to the band's size.

    Parameters
    ----------
    gaussian : sequence of arrays
        Gaussian levels, finest first; `level + 2` must be among them [cd/m^2].
    level : int
        The band.

    >>> adaptation_luminance(gaussian_pyramid(np.full((8, 8), 5.0), 4), level=1).tolist()[0]
    [5.0, 5.0, 5.0, 5.0]
    """
    middle, fine = gaussian[level + 1].shape, gaussian[level].shape
    return expanded(expanded(gaussian[level + 2], (middle[0], middle[1])), (fine[0], fine[1]))


def expanded(coarse: Array, shape: tuple[int, int]) -> Array:
    """Return a level interpolated to the next finer size (the EXPAND of Burt & Adelson).

    Parameters
    ----------
    coarse : array, (ceil(height / 2), ceil(width / 2))
        The level.
    shape : (height, width)
        The finer size.

    >>> expanded(np.array([[0.0, 1.0]]), (1, 3)).round(3).tolist()
    [[0.2, 0.5, 0.8]]
    """
    return _expand_rows(_expand_rows(coarse, shape[0]).T, shape[1]).T


def mirrored(index: NDArray[np.int64], length: int) -> NDArray[np.int64]:
    """Return where indices beyond an axis lie in its mirror, the edge not repeated.

    >>> mirrored(np.array([-2, -1, 0, 3, 4, 5]), 4).tolist()
    [2, 1, 0, 3, 2, 1]
    """
    if length == 1:
        return np.zeros_like(index)
    period = 2 * (length - 1)
    folded = np.abs(index) % period
    return np.asarray(np.minimum(folded, period - folded))


def _reduce_rows(fine: Array) -> Array:
    """Return every other row of an image, smoothed along the columns."""
    centre = np.arange(0, len(fine), 2)

    def row(offset: int) -> Array:
        return fine[mirrored(centre + offset, len(fine))]

    middle = row(0)
    inner = (row(-1) - middle) + (row(1) - middle)
    outer = (row(-2) - middle) + (row(2) - middle)
    return middle + INNER_WEIGHT * inner + OUTER_WEIGHT * outer


def _expand_rows(coarse: Array, length: int) -> Array:
    """Return an image with `length` rows between and on those given: twice the kernel's even, odd taps."""
    fine = np.empty((length, coarse.shape[1]))
    even, odd = np.arange(0, length, 2), np.arange(1, length, 2)

    def row(index: NDArray[np.int64]) -> Array:
        return coarse[mirrored(index, length) // 2]

    middle = row(even)
    fine[0::2] = middle + 2 * OUTER_WEIGHT * ((row(even - 2) - middle) + (row(even + 2) - middle))
    fine[1::2] = 2 * INNER_WEIGHT * (row(odd - 1) + row(odd + 1))
    return fine


def band_frequencies(
    shape: tuple[int, int],
    display: Display,
    rule: BandFrequency = BandFrequency.NYQUIST,
    lowest_frequency: float = LOWEST_FREQUENCY,
    band_count: int | None = None,
) -> NDArray[np.float64]:
    """Return the spatial frequencies f of the bands that count, finest first.

    Decision (docs/decisions/bands.md): a band needs a Gaussian level two levels down, which gives its L_a,
    and a frequency of at least `lowest_frequency`; the finest band always counts. Frequencies are the upper
    ends of the bands, Nyquist · 2^-level.

    Parameters
    ----------
    shape : (height, width)
        Of the frame, in pixels; at least 3 × 3.
    display : Display
        Its pixels per degree.
    rule : BandFrequency
        What frequency a band stands for.
    lowest_frequency : float
        No band below it [cpd].
    band_count : int, optional
        So many bands instead, where the frame has the levels for them.

    Returns
    -------
    array, (bands,)
        f [cpd].

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=64.0)
    >>> band_frequencies((1080, 1920), lab).tolist()
    [32.0, 16.0, 8.0, 4.0, 2.0, 1.0, 0.5]
    >>> band_frequencies((8, 8), lab).tolist()
    [32.0, 16.0]
    """
    available = len(level_shapes(shape)) - 2
    frequencies = display.nyquist_frequency * _relative_frequencies(available, rule)
    if band_count is not None:
        return frequencies[:band_count]
    return frequencies[: max(1, int((frequencies >= lowest_frequency).sum()))]


def counted_frequencies(
    shape: tuple[int, int], display: Display, model: ContrastModel
) -> NDArray[np.float64]:
    """Return the frequencies f of the bands that a contrast model counts [cpd]; as `band_frequencies`."""
    return band_frequencies(shape, display, model.band_frequency, model.lowest_frequency, model.band_count)


def _relative_frequencies(n: int, rule: BandFrequency) -> NDArray[np.float64]:
    levels = np.arange(n)
    halving = np.exp2(-levels.astype(np.float64))
    if rule is BandFrequency.AUTHORS:
        return halving / 4
    if rule is BandFrequency.CENTROID:
        last = len(_CENTROIDS) - 1
        return np.asarray(np.array(_CENTROIDS)[np.minimum(levels, last)] * np.minimum(1, halving * 2**last))
    return halving

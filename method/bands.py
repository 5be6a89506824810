"""Which frequency bands of the pyramid count, and the spatial frequency f that each stands for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import LOWEST_FREQUENCY, BandFrequency, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.method.pyramid import level_shapes

# Energy centroid of each band of the a = 0.4 pyramid, as a share of the Nyquist frequency; further bands
# halve. Computed from the kernel in tests/method/test_bands.py.
_CENTROIDS = (0.672, 0.294, 0.138, 0.068)


def band_frequencies(
    shape: tuple[int, int],
    display: Display,
    rule: BandFrequency = BandFrequency.NYQUIST,
    lowest_frequency: float = LOWEST_FREQUENCY,
    band_count: int | None = None,
) -> NDArray[np.float64]:
    """Return the spatial frequencies f of the bands that count, finest first.

    Decisions (docs/decisions/bands.md, docs/decisions/band-frequency.md): a band needs a Gaussian level
    two levels down, which gives its L_a, and a frequency of at least `lowest_frequency`; the finest band
    always counts. Frequencies are the upper ends of the bands, Nyquist · 2^-level.

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
    """Return the frequencies of n bands as shares of the Nyquist frequency."""
    levels = np.arange(n)
    halving = np.exp2(-levels.astype(np.float64))
    if rule is BandFrequency.AUTHORS:
        return halving / 4
    if rule is BandFrequency.CENTROID:
        last = len(_CENTROIDS) - 1
        return np.asarray(np.array(_CENTROIDS)[np.minimum(levels, last)] * np.minimum(1, halving * 2**last))
    return halving

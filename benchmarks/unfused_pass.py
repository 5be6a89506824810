"""The one pass as expressions over whole images, in double or in single precision.

Beside it shows what the compiled loops of `contrast.one_pass` save in time, and what single precision, their
polynomial logarithms and their small tables cost. The steps and the one approximation are the same: see
`method.contrast.critical_factor`. Pyramids, masking and sensitivity are those of the definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.method.contrast.band_shares import FEW_PIXELS, REFERENCES
from evenlight.method.contrast.contrast_loss import loss_of
from evenlight.method.contrast.critical_factor import LARGEST_LOG_RATIO, MASKING_RANGE, effective_sensitivity
from evenlight.method.contrast.csf import LOWEST_LUMINANCE
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS
from evenlight.method.contrast.masking import MASKING_EXPONENT, TRANSDUCER_EXPONENT, neighbourhood_mean
from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    counted_frequencies,
    expanded,
    gaussian_pyramid,
)

TABLE_STEPS = 2**16  # read linearly, they err by 2e-8 of an octave at most
_MARGIN = 0.01  # by which the tables reach beyond the display's luminances, in log2

Image = NDArray[Any]  # of the precision asked for


class UnfusedPass:
    """Tables for frames of one size on one display, and the loss curve of a frame with them.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    factors : array, (K,)
        Knots b, rising to 1.
    precision : numpy type
        To which every step's images are rounded; tables are always float64.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        display: Display,
        factors: Array,
        precision: type[np.floating[Any]] = np.float64,
    ) -> None:
        self._log_factors, self._precision = np.log2(factors), precision
        lowest = factors[0] * max(display.black_level, LOWEST_LUMINANCE)
        self._log_e = np.linspace(
            np.log2(lowest) - _MARGIN, np.log2(display.peak_luminance) + _MARGIN, TABLE_STEPS
        )
        self._log_s = [
            np.log2(effective_sensitivity(float(f), np.exp2(self._log_e), display, DEFAULT_MODEL))
            for f in counted_frequencies(shape, display, DEFAULT_MODEL)
        ]
        self._log_m, self._log_threshold = _thresholds()
        self._linear = (np.arange(256) / 255) ** display.gamma
        self._black = display.black_level
        self._span = display.peak_luminance - display.black_level

    def loss(self, pixel_values: NDArray[np.uint8]) -> Array:
        """Return the contrast loss of a frame, (height, width, 3), at each knot, (K,)."""
        bands = self.log_critical_factors(pixel_values)
        visible = np.mean([visible_share(band, self._log_factors) for band in bands], axis=0)
        return np.array([loss_of(float(C_v), float(visible[-1])) for C_v in visible])

    def log_critical_factors(self, pixel_values: NDArray[np.uint8]) -> list[list[Image]]:
        """Return log2 of each pixel's critical factor, of each band, once for each reference factor.

        A band of which nothing can be seen has infinite ones.
        """
        linear = self._linear[pixel_values] @ np.array(LUMINANCE_WEIGHTS)
        luminance = (self._black + self._span * linear).astype(self._precision)
        gaussian = gaussian_pyramid(luminance, len(self._log_s) + 2)
        return [self._of_band(gaussian, level, log_s) for level, log_s in enumerate(self._log_s)]

    def _of_band(self, gaussian: Sequence[Image], level: int, log_s: Array) -> list[Image]:
        """Return log2 of the critical factors of a band, once for each of its reference factors."""
        fine = gaussian[level]
        if log_s[-1] + LARGEST_LOG_RATIO <= 0:
            return [np.full(fine.shape, np.inf)]
        low = expanded(gaussian[level + 1], fine.shape).astype(self._precision)
        around = adaptation_luminance(gaussian, level).astype(self._precision)
        around = np.maximum(around, self._precision(LOWEST_LUMINANCE))
        # No contrast, as in an area of one luminance, has no logarithm: the least number stands for it.
        ratio = np.maximum(np.abs(fine - low) / around, np.finfo(self._precision).tiny)
        log_ratio, log_around = np.log2(ratio), np.log2(around)
        n = REFERENCES if fine.size <= FEW_PIXELS else 1
        references = self._log_factors[0] * (1 - (np.arange(n) + 0.5) / n)
        return [self._log_critical(log_ratio, log_around, reference, log_s) for reference in references]

    def _log_critical(self, log_ratio: Image, log_around: Image, reference: float, log_s: Array) -> Image:
        """Return log2 of s⁻¹(T(m) / r) / L_a at each pixel, neighbours compared at a reference factor."""
        sensitivity = np.interp(log_around + self._precision(reference), self._log_e, log_s)
        log_own = self._precision(MASKING_EXPONENT) * (log_ratio + sensitivity.astype(self._precision))
        log_masking = np.log2(neighbourhood_mean(np.exp2(log_own))) - log_own
        threshold = np.interp(log_masking, self._log_m, self._log_threshold).astype(self._precision)
        emitted = np.interp(threshold - log_ratio, log_s, self._log_e, -np.inf, np.inf)
        return np.asarray(emitted.astype(self._precision) - log_around)


def visible_share(log_critical: Sequence[Image], log_factors: Array) -> Array:
    """Return the share of a band's pixels that are visible at each knot, (K,).

    Parameters
    ----------
    log_critical : sequence of arrays
        log2 of the critical factors, counted at each of several reference factors, lowest first; a knot takes
        the count of the equal step of log b that it lies in.
    log_factors : array, (K,)
        log2 of the knots, rising to 0.

    >>> two = [np.array([-1.5, 0.5]), np.array([-0.5, -0.5])]
    >>> visible_share(two, np.array([-2.0, -1.4, -1.0, 0.0])).tolist()
    [0.0, 0.5, 0.5, 1.0]
    """
    first = np.array([np.digitize(each.ravel(), log_factors) for each in log_critical])
    counts = np.array([np.bincount(knots, minlength=len(log_factors) + 1) for knots in first])
    visible = counts.cumsum(axis=1)[:, :-1]
    n = len(log_critical)
    step = np.minimum((1 - log_factors / log_factors[0]) * n, n - 1).astype(np.int64)
    chosen = visible[step, np.arange(len(log_factors))]
    # Where two counts meet, a pixel may seem to vanish again as b grows.
    return np.asarray(np.maximum.accumulate(chosen) / first.shape[1])


def _thresholds() -> tuple[Array, Array]:
    """Return log2 m, rising, and the log2 T(m) that goes with each: t^0.7 = 1 + m · t^0.2 solved for m."""
    log_t = np.geomspace(2.0**-16, 2 * MASKING_RANGE[1] + 4, TABLE_STEPS)
    over = np.expm1(np.log(2) * TRANSDUCER_EXPONENT * log_t)
    return np.log2(over) - MASKING_EXPONENT * log_t, log_t

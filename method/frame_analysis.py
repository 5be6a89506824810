"""The analysis of one frame: its contrast loss at all brightness factors, in one pass over its pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schema.contrast_model import (
    ContrastModel,
    MaskingNeighbourhood,
    PixelToLuminance,
    SensitivityModel,
    Visibility,
)
from data_schema.display import Display
from method.bands import band_frequencies
from method.contrast_loss import loss_of, visible_contrast
from method.critical_factor import BandTable, band_table, threshold_table
from method.csf import LOWEST_LUMINANCE
from method.luminance import channel_means, dimmed_luminance, emitted_luminance
from method.one_pass import (
    FLOAT_STEPS,
    ToContrast,
    ToFactor,
    convert_floats,
    convert_integers,
    count_band,
    expanded,
    reduced,
)

_CELLS = 4096  # of the histogram of critical factors, at least; equal steps of log b
# In a band of few pixels each one shows in the loss. Such a band is cheap, and is counted several times, with
# neighbours compared at several factors (`method.critical_factor`); each count serves the factors next to it.
_FEW_PIXELS = 16384
_REFERENCES = 8

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FrameLoss:
    """What the analysis of a frame gives: a row of `LossCurves`.

    Attributes
    ----------
    loss : array, (K,)
        𝓛_c at each knot.
    visible_contrast : float
        C_v of the undimmed frame.
    mean_luminance : float
        Ī, mean luminance emitted at b = 1 [cd/m^2].
    channel_means : array, (3,)
        Means of the linear R, G, B channels.
    """

    loss: Array
    visible_contrast: float
    mean_luminance: float
    channel_means: Array


class FrameAnalysis:
    """Tables for frames of one size on one display, and the analysis of a frame with them.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.
    """

    def __init__(
        self, shape: tuple[int, int], display: Display, model: ContrastModel, factors: Array
    ) -> None:
        self._display, self._model, self._factors = display, model, factors
        rule, lowest, count = model.band_frequency, model.lowest_frequency, model.band_count
        frequencies = band_frequencies(shape, display, rule, lowest, count)
        self._bands = [band_table(float(f), float(factors[0]), display, model) for f in frequencies]
        self._threshold = threshold_table()
        self._log_factors = np.log2(factors)
        # A multiple, so that knots in equal ratios lie between cells, and no pixel is counted in part.
        self._n_cells = -(-_CELLS // (len(factors) - 1)) * (len(factors) - 1)
        self._linear: dict[int, NDArray[np.float32]] = {}

    @property
    def in_one_pass(self) -> bool:
        """Whether one pass gives the curve; otherwise each knot is computed by definition.

        It does not where sensitivity falls with luminance somewhere, so that a pixel has no single critical
        factor; nor where reflected light meets a sensitivity taken at another luminance than the pixel's.
        """
        by_level = self._model.sensitivity is SensitivityModel.AUTHORS
        reflects = self._display.reflected_luminance > 0
        return all(band.rises for band in self._bands) and not (by_level and reflects)

    def of(self, pixel_values: NDArray[Any]) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""
        if self._model.pixel_to_luminance is PixelToLuminance.LUMA_FIRST:
            wide = emitted_luminance(pixel_values, self._display, PixelToLuminance.LUMA_FIRST)
            luminance, means = wide.astype(np.float32), channel_means(pixel_values, self._display.gamma)
        else:
            luminance, means = self._luminance_of(pixel_values)
        visible = self.visible_contrast(luminance)
        reference = float(visible[-1])
        loss = np.array([loss_of(float(C_v), reference) for C_v in visible])
        return FrameLoss(loss, reference, float(luminance.mean(dtype=np.float64)), means)

    def visible_contrast(self, emitted: NDArray[np.float32]) -> Array:
        """Return C_v at each knot for a frame of emitted luminance I, (height, width) [cd/m^2]."""
        if not self.in_one_pass:
            dimmed = (dimmed_luminance(emitted, b, self._display) for b in self._factors)
            return np.array([visible_contrast(D, self._display, self._model) for D in dimmed])
        shares, fine = np.zeros(len(self._factors)), np.ascontiguousarray(emitted, dtype=np.float32)
        coarse = reduced(fine)
        for band in self._bands:
            coarser = reduced(coarse)
            if band.can_be_seen:
                shares += self._share_of_band(fine, coarse, expanded(coarser, *coarse.shape), band)
            fine, coarse = coarse, coarser
        return shares / len(self._bands)

    def _share_of_band(self, fine: Any, coarse: Any, around: Any, band: BandTable) -> Array:
        """Return the share of visible pixels of a band at each knot.

        `fine` and `coarse` are two Gaussian levels, `around` is the third at the size of the second.
        """
        tables = self._tables(band, self._log_common_adaptation(fine, around))
        masks_itself = self._model.masking is MaskingNeighbourhood.WITH_CENTRE
        n = _REFERENCES if fine.size <= _FEW_PIXELS else 1
        way = 1 - self._log_factors / self._log_factors[0]  # of log b from the lowest factor to 1
        nearest = np.minimum((way * n).astype(np.int64), n - 1)
        shares = np.empty(len(way))
        for k in range(n):
            counts = np.zeros(self._n_cells + 2, np.int64)
            reference = self._log_factors[0] * (1 - (k + 0.5) / n)
            to_contrast = tables[0]._replace(log_reference_factor=np.float32(reference))
            count_band(fine, coarse, around, (to_contrast, tables[1]._replace(counts=counts), masks_itself))
            here = nearest == k
            edges = np.arange(self._n_cells + 1)
            shares[here] = np.interp(way[here] * self._n_cells, edges, np.cumsum(counts[:-1]))
        # Where two counts meet, a pixel may seem to vanish again as b grows.
        return np.asarray(np.maximum.accumulate(shares) / fine.size)

    def _tables(self, band: BandTable, log_common_adaptation: float) -> tuple[ToContrast, ToFactor]:
        """Return what the compiled loops need for a band, but for the reference factor and the counts."""
        to_contrast = ToContrast(
            log_sensitivity=band.log_sensitivity,
            log_darkest=np.float32(band.log_luminance_range[0]),
            log_span=np.float32(np.ptp(band.log_luminance_range)),
            log_reference_factor=None,
            log_common_adaptation=np.float32(log_common_adaptation),
            positive_only=self._model.visibility is Visibility.POSITIVE_ONLY,
        )
        to_factor = ToFactor(
            log_threshold=self._threshold,
            log_luminance=band.log_luminance,
            log_faintest=np.float32(band.log_sensitivity_range[0]),
            log_span=np.float32(np.ptp(band.log_sensitivity_range)),
            log_lowest_factor=np.float32(self._log_factors[0]),
            counts=None,
        )
        return to_contrast, to_factor

    def _log_common_adaptation(self, fine: Any, around: Any) -> float:
        """Return log2 of the level's mean L_a if sensitivity is taken there, nan if at each pixel's own."""
        if self._model.sensitivity is not SensitivityModel.AUTHORS:
            return float("nan")
        mean = expanded(around, *fine.shape).mean(dtype=np.float64)
        return float(np.log2(max(mean, LOWEST_LUMINANCE)))

    def _luminance_of(self, pixel_values: NDArray[Any]) -> tuple[NDArray[np.float32], Array]:
        """Return emitted luminance, and the means of the linear channels."""
        whole = np.issubdtype(pixel_values.dtype, np.integer)
        steps = np.iinfo(pixel_values.dtype).max if whole else FLOAT_STEPS
        if steps not in self._linear:
            encoded = np.arange(steps + 1) / steps
            self._linear[steps] = (encoded**self._display.gamma).astype(np.float32)
        luminance = np.empty(pixel_values.shape[:2], np.float32)
        black = np.float32(self._display.black_level)
        span = np.float32(self._display.peak_luminance - self._display.black_level)
        convert = convert_integers if whole else convert_floats
        sums = convert(np.ascontiguousarray(pixel_values), self._linear[steps], black, span, luminance)
        return luminance, np.array(sums) / luminance.size

"""Contrast loss at every brightness factor at once, for the frames of a video.

Decision (docs/decisions/one-pass-curves.md): each pixel has one critical brightness factor
(`method.critical_factor`), and the share of pixels whose factor is below b is the visible contrast at b, for
all b. `loss_curves_by_definition` dims and compares instead, and is what the fast form is measured against.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.frame import Frame
from data_schema.loss_curves import LossCurves
from data_schema.provenance import Provenance, provenance_now
from method.bands import band_frequencies
from method.contrast_loss import DEFAULT_MODEL, ContrastModel, Visibility, loss_of, visible_contrast
from method.critical_factor import BandTable, band_table, threshold_table
from method.csf import LOWEST_LUMINANCE, SensitivityModel
from method.luminance import PixelToLuminance, channel_means, dimmed_luminance, emitted_luminance
from method.masking import MaskingNeighbourhood
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

SMALLEST_SIDE = 8  # [pixels] leaves two bands with their adaptation luminance
_CELLS = 4096  # of the histogram of critical factors, equal steps of log2 b

Array = NDArray[np.float64]


def brightness_factors(lowest: float = 0.2, knots: int = 65) -> Array:
    """Return the knots of loss curves: brightness factors b from the lowest to 1, in equal ratios.

    Loss bends most where b is small; equal ratios follow it there whatever the lowest factor.

    Parameters
    ----------
    lowest : float
        The lowest factor, above 0; the paper's precomputation starts at 0.2.
    knots : int
        How many; between them loss is interpolated linearly.

    >>> brightness_factors(0.25, knots=3).tolist()
    [0.25, 0.5, 1.0]
    """
    return np.geomspace(lowest, 1.0, knots)


def analyze_frames(
    frames: Iterable[Frame],
    video: str,
    display: Display,
    model: ContrastModel = DEFAULT_MODEL,
    factors: ArrayLike | None = None,
    provenance: Provenance | None = None,
) -> LossCurves:
    """Return the contrast-loss curves of a video, one frame in memory at a time.

    A frame equal to the one before it is not analysed again.

    Parameters
    ----------
    frames : iterable of Frame
        In order of time, all of one size of at least 8 × 8 pixels.
    video : str
        Its name, for messages.
    display : Display
        The display that it is shown on, pixel by pixel.
    model : ContrastModel
        Choices of the contrast model.
    factors : array_like, (K,), optional
        Knots b, rising to 1; otherwise `brightness_factors()`.
    provenance : Provenance, optional
        Otherwise made here.
    """
    knots = _checked_knots(brightness_factors() if factors is None else factors)
    times, durations, results = [], [], []
    analysis: FrameAnalysis | None = None
    before: NDArray[Any] | None = None
    for number, frame in enumerate(frames):
        shape = frame.pixel_values.shape[:2]
        if analysis is None:
            analysis = FrameAnalysis(_checked_shape(shape, video), display, model, knots)
        if before is not None and shape != before.shape[:2]:
            raise InputError(f"{video}: {_size_change(number, before.shape, shape)}")
        if before is None or not np.array_equal(before, frame.pixel_values):
            result = analysis.of(frame.pixel_values)
            before = frame.pixel_values.copy()  # a source may fill the same array again
        times.append(frame.time)
        durations.append(frame.duration)
        results.append(result)
    if not results:
        raise InputError(f"{video}: holds no frame; at least one is needed")
    return LossCurves(
        video=video,
        display=display,
        times=np.array(times),
        durations=np.array(durations),
        factors=knots,
        loss=np.array([result.loss for result in results]),
        visible_contrast=np.array([result.visible_contrast for result in results]),
        mean_luminance=np.array([result.mean_luminance for result in results]),
        channel_means=np.array([result.channel_means for result in results]),
        provenance=provenance or provenance_now(),
    )


def _checked_knots(factors: ArrayLike) -> Array:
    """Return the knots, or refuse ones that `LossCurves` would refuse after all the work."""
    knots = np.asarray(factors, dtype=np.float64)
    rising = knots.ndim == 1 and len(knots) >= 2 and bool((np.diff(knots) > 0).all())
    if not rising or knots[0] <= 0 or knots[-1] != 1:
        raise ValueError(f"factors must rise from above 0 to 1, got {knots}")
    return knots


def _checked_shape(shape: tuple[int, ...], video: str) -> tuple[int, int]:
    """Return a frame's height and width, or refuse a frame without two bands."""
    height, width = shape
    if min(height, width) < SMALLEST_SIDE:
        raise InputError(
            f"{video}: frames are {width} x {height} pixels; "
            f"need at least {SMALLEST_SIDE} x {SMALLEST_SIDE} for two frequency bands"
        )
    return height, width


def _size_change(number: int, before: tuple[int, ...], now: tuple[int, ...]) -> str:
    """Return what to say of a frame whose size differs."""
    return (
        f"frame {number} has {now[1]} x {now[0]} pixels, the one before {before[1]} x {before[0]}; "
        f"need frames of one size"
    )


def loss_curves_by_definition(
    emitted: Array, factors: ArrayLike, display: Display, model: ContrastModel = DEFAULT_MODEL
) -> Array:
    """Return the contrast loss of one frame at each factor: dim, rebuild, compare (Eqs. 1 to 5), in float64.

    Parameters
    ----------
    emitted : array, (height, width)
        I, luminance that the display emits at b = 1 [cd/m^2].
    factors : array_like, (K,)
        Brightness factors b.
    display : Display
        The display that shows it.
    model : ContrastModel
        Choices of the contrast model.

    Returns
    -------
    array, (K,)
        𝓛_c, in [0, 1].
    """
    reference = visible_contrast(dimmed_luminance(emitted, 1.0, display), display, model)
    dimmed = (dimmed_luminance(emitted, b, display) for b in np.asarray(factors, dtype=np.float64))
    return np.array([loss_of(visible_contrast(D, display, model), reference) for D in dimmed])


@dataclass(frozen=True, slots=True)
class FrameLoss:
    """What the analysis of one frame gives; the fields are a row of `LossCurves`."""

    loss: Array
    visible_contrast: float
    mean_luminance: float
    channel_means: Array


class FrameAnalysis:
    """The tables for frames of one size on one display, and the analysis of a frame with them.

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
        self._log_cells = np.linspace(np.log2(factors[0]), 0, _CELLS + 1)
        self._linear: dict[int, NDArray[np.float32]] = {}

    @property
    def in_one_pass(self) -> bool:
        """Whether one pass gives the curve.

        Not where sensitivity falls with luminance somewhere, so that a pixel has no single critical factor;
        and not where reflected light meets a sensitivity taken at another luminance than the pixel's own.
        """
        by_level = self._model.sensitivity is SensitivityModel.AUTHORS
        return all(band.rises for band in self._bands) and not (
            by_level and self._display.reflected_luminance > 0
        )

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
                shares += self._share_of_band(fine, coarse, coarser, band)
            fine, coarse = coarse, coarser
        return shares / len(self._bands)

    def _share_of_band(self, fine: Any, coarse: Any, coarser: Any, band: BandTable) -> Array:
        """Return the share of visible pixels of a band at each knot, from three Gaussian levels."""
        around = expanded(coarser, *coarse.shape)
        common = np.nan
        if self._model.sensitivity is SensitivityModel.AUTHORS:
            common = np.log2(max(expanded(around, *fine.shape).mean(dtype=np.float64), LOWEST_LUMINANCE))
        to_contrast = ToContrast(
            log_sensitivity=band.log_sensitivity,
            log_darkest=np.float32(band.log_luminance_range[0]),
            log_span=np.float32(np.ptp(band.log_luminance_range)),
            log_reference_factor=np.float32(self._log_cells[0] / 2),
            log_common_adaptation=np.float32(common),
            positive_only=self._model.visibility is Visibility.POSITIVE_ONLY,
        )
        to_factor = ToFactor(
            log_threshold=self._threshold,
            log_luminance=band.log_luminance,
            log_faintest=np.float32(band.log_sensitivity_range[0]),
            log_span=np.float32(np.ptp(band.log_sensitivity_range)),
            log_lowest_factor=np.float32(self._log_cells[0]),
            counts=np.zeros(_CELLS + 2, np.int64),
        )
        masks_itself = self._model.masking is MaskingNeighbourhood.WITH_CENTRE
        count_band(fine, coarse, around, (to_contrast, to_factor, masks_itself))
        shares = np.cumsum(to_factor.counts[:-1]) / fine.size
        return np.asarray(np.interp(np.log2(self._factors), self._log_cells, shares))

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

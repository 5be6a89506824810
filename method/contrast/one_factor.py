"""The contrast loss of one frame at one brightness factor: what the online controller measures (Section 6).

The curve of all factors at once (`contrast.frame_analysis`) compares neighbours at a reference factor; at one
factor nothing need be approximated. Contrast and masking (Eq. 3, a fast form of `contrast.masking`) are
computed at b and at 1 in one sweep over the pixels, with the tables of sensitivity and the pyramid of the
curve, in single precision. Where looking at all rows takes too long, strips of them stand for the rest, or a
picture of fewer pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    LossForm,
    MaskingNeighbourhood,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.frame import Pixels
from evenlight.method.contrast.band_shares import contrast_tables
from evenlight.method.contrast.contrast_loss import loss_of, visible_contrast
from evenlight.method.contrast.critical_factor import BandTable, band_tables, tables_hold
from evenlight.method.contrast.detection import SLOPE
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.one_pass import (
    EXACT,
    ContrastTables,
    compiled,
    exp2,
    expand_row,
    expanded,
    log2,
    power_row,
    ratio_row,
    reduced,
)

MANY_PIXELS = 300_000  # only bands with more are counted in part: of fewer there is little to save
_PER_X = np.float32(10 * SLOPE)  # ρ = x^10
_NEWTON_STEPS = 6  # to x of any contrast that counts; far below threshold they stop short
STRIP = 4  # rows that are counted together
GOLDEN = (math.sqrt(5) - 1) / 2  # its multiples, without whole parts, fall evenly into [0, 1)


@dataclass(frozen=True, slots=True)
class MeasuredLoss:
    """What the controller needs of a frame."""

    loss: float  # 𝓛_c at the factor that was asked for
    mean_luminance: float  # Ī, mean luminance emitted at b = 1 [cd/m^2], of all pixels
    channel_means: Array = field(compare=False)  # (3,): means of the linear R, G, B channels, of all pixels


class Counting(NamedTuple):
    """What a pixel counts."""

    masks_itself: bool
    masking: np.float32  # strength of masking
    soft: bool  # the probability that it is detected, rather than 0 or 1
    weighs: bool  # the contrast that it shows above its threshold
    lost_light: np.float32  # L_refl + ε [cd/m^2], what takes from that contrast


class OneFactorLoss:
    """Tables for frames of one size on one display, and the loss of a frame at one factor with them.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    lowest_factor : float
        Lowest factor that will be asked for.
    one_strip_in : int
        Of bands with many pixels, only one strip of 4 rows in so many is counted; 1 counts them all.
    halvings : int
        How often the picture's pixels are halved each way before, in linear light; so many of the finest
        bands do not count. Models without tables look at all pixels.

    Raises
    ------
    InputError
        If no band is left.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel = DEFAULT_MODEL,
        lowest_factor: float = 0.2,
        one_strip_in: int = 1,
        halvings: int = 0,
    ) -> None:
        self._display, self._model, self._lowest, self._one_in = display, model, lowest_factor, one_strip_in
        self._shape = shape
        self._light = FrameLight(display, model.pixel_to_luminance)
        self._by_definition = not tables_hold(display, model)
        self._halvings = 0 if self._by_definition else halvings
        self._bands = band_tables(shape, lowest_factor, display, model)[self._halvings :]
        if not self._bands:
            few = f"1/{2**halvings} of the pixels each way"
            raise ArgumentError("resolution", f"leaves no band of frames of the shape {shape} at {few}")
        self._counting = Counting(
            masks_itself=model.masking is MaskingNeighbourhood.WITH_CENTRE,
            masking=np.float32(model.masking_strength),
            soft=model.visibility is Visibility.SOFT,
            weighs=model.loss is LossForm.SUPRATHRESHOLD,
            lost_light=np.float32(display.reflected_luminance + model.epsilon),
        )
        self.count_only(np.ones(shape, dtype=bool))

    def count_only(self, seen: NDArray[np.bool_]) -> None:
        """Let only some pixels count from now on, (height, width): those that a headset's lens shows.

        In coarser bands it is what the pixel is at which theirs lies. Others' light adapts and masks all the
        same, for they are drawn; of a model without tables all count.
        """
        self._counted = [
            np.ascontiguousarray(seen[:: 2**level, :: 2**level])
            for level in range(self._halvings, self._halvings + len(self._bands))
        ]

    def of(self, pixel_values: Pixels, factor: float, turn: int = 0) -> MeasuredLoss:
        """Return the loss of a frame, (height, width, 3) gamma-encoded, at a factor.

        Parameters
        ----------
        pixel_values : array, (height, width, 3), or LumaChroma
            The frame.
        factor : float
            Brightness factor b.
        turn : int
            Which strips are counted where not all are; over as many turns as there are, each is once.

        Raises
        ------
        InputError
            If the frame has another size, or the factor is below the lowest.
        """
        if pixel_values.shape[:2] != self._shape:
            raise InputError(f"expected a frame of the shape {self._shape}, got {pixel_values.shape[:2]}")
        if not self._lowest * (1 - 1e-9) <= factor <= 1:
            raise InputError(f"the factor must lie in {self._lowest:g} to 1, got {factor:g}")
        luminance, mean, means = self._light.luminance_and_mean(pixel_values, self._halvings)
        dimmed, full = self.visible_contrast(luminance, factor, turn)
        return MeasuredLoss(loss_of(dimmed, full, self._model.loss), mean, means)

    def visible_contrast(
        self, emitted: NDArray[np.float32], factor: float, turn: int = 0
    ) -> tuple[float, float]:
        """Return C_v at a factor and at 1 of emitted luminance I, (height, width) once halved [cd/m^2]."""
        if self._by_definition:
            dimmed, full = (
                visible_contrast(dimmed_luminance(emitted, b, self._display), self._display, self._model)
                for b in (factor, 1.0)
            )
            return dimmed, full
        shares, fine = np.zeros(2), np.ascontiguousarray(emitted, dtype=np.float32)
        coarse = reduced(fine)
        for band, counted in zip(self._bands, self._counted, strict=True):
            coarser = reduced(coarse)
            if band.can_be_seen:
                levels = fine, coarse, expanded(coarser, *coarse.shape), counted
                shares += self._shares_of_band(levels, band, factor, turn)
            fine, coarse = coarse, coarser
        return float(shares[0] / len(self._bands)), float(shares[1] / len(self._bands))

    def _shares_of_band(
        self, levels: tuple[Any, Any, Any, Any], band: BandTable, factor: float, turn: int
    ) -> Array:
        fine, _, around, counted = levels
        tables = contrast_tables(band, self._model, (fine, around), factor)
        counts, pixels = np.zeros(2), 0
        for begin, end in counted_rows(len(fine), self._one_in if fine.size > MANY_PIXELS else 1, turn):
            counts += _count_visible(*levels, (begin, end), (tables, self._counting))
            pixels += int(np.count_nonzero(counted[begin:end]))
        return np.asarray(counts / max(pixels, 1))


@compiled
def _count_visible(
    fine: Any, coarse: Any, adaptation: Any, counted: Any, rows: Any, choices: tuple[ContrastTables, Counting]
) -> Any:
    """Return what the pixels of some rows of a band count at the factor, and at 1.

    The levels are as of `one_pass.count_band`; `counted` says which pixels count;
    `rows` holds the first row that counts, and the one after the last; `choices` the tables of the band, and
    what a pixel counts.
    """
    tables, counting = choices
    height, width = fine.shape
    first, last = max(rows[0] - 2, 0), min(rows[1] + 2, height)
    power = np.zeros((2, 5, width + 4), np.float32)  # |C|^0.2 of the last five rows, at b and at 1
    sums = np.zeros((2, 5, width), np.float32)  # the same, by five columns
    weight = np.ones((2, 5, width), np.float32)  # what a pixel counts that is seen: 0 if it does not
    low, seen = np.empty(width, np.float32), np.empty(width, np.float32)
    ratio, light, x = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    cells, between = np.empty(width, np.int32), np.empty(coarse.shape[1] + 2, np.float32)
    columns = np.empty(width, np.float32)
    for j in range(width):
        columns[j] = min(j + 2, width - 1) - max(j - 2, 0) + 1
    counts, by_series = np.zeros(2), tables.series_error < EXACT
    first_at = 1 if tables.log_factor == 0 else 0  # at factor 1 both are the same
    for i in range(first, last + 2):
        new, ready = i % 5, (i - 2) % 5
        if i < last:
            expand_row(coarse, i, height, between, low)
            expand_row(adaptation, i, height, between, seen)
            ratio_row(fine[i], low, seen, tables, (ratio, light))
            counts_here = weight[1, new]
            for j in range(width):
                counts_here[j] = counted[i, j]
            if tables.positive_only:
                counts_here *= fine[i] > low
            weight[0, new] = counts_here
            for at in range(first_at, 2):
                log_factor = tables.log_factor if at == 0 else np.float32(0)
                if counting.weighs:
                    _weigh_row(ratio, light, log_factor, counting, weight[at, new])
                power_row(
                    (ratio, light), log_factor, tables, by_series, (x, sums[at, new], power[at, new], cells)
                )
        else:
            sums[:, new] = 0
        if rows[0] <= i - 2 < rows[1]:
            n_rows = min(i, height - 1) - max(i - 4, 0) + 1
            for at in range(first_at, 2):
                here = power[at, ready], sums[at], (np.float32(n_rows), columns), weight[at, ready]
                if counting.soft or counting.weighs:
                    counts[at] += _seen_in_row(here, counting, x)
                else:
                    counts[at] += _visible_in_row(here, counting)
    if first_at == 1:
        counts[0] = counts[1]
    return counts


@compiled
def _weigh_row(ratio: Any, light: Any, log_factor: Any, counting: Counting, weight: Any) -> None:
    """Multiply weights by contrast, bounded at that of light against black: |ΔL| = L_a."""
    for j in range(weight.size):
        e = exp2(light[j] + log_factor)
        weight[j] *= exp2(min(ratio[j], np.float32(0))) * e / (e + counting.lost_light)


@compiled
def _masking_at(j: Any, here: Any, counting: Counting) -> Any:
    """Return |C|^0.2 of a pixel of a row, the sum of those that mask it, and how many they are."""
    power, sums, (rows, columns), _ = here
    own = power[j + 2]
    total = sums[0, j] + sums[1, j] + sums[2, j] + sums[3, j] + sums[4, j]
    n = rows * columns[j]
    if not counting.masks_itself:
        total -= own
        n = max(n - np.float32(1), np.float32(1))
    return own, total, n


@compiled
def _seen_in_row(here: Any, counting: Counting, x: Any) -> Any:
    """Return what the pixels of a row count: p or the share above threshold, by ρ = x^10.

    x solves x^7 + M x^5 = |C|^0.7 (`masking.contrast_over_threshold`); it is `x` that is filled with it.
    """
    weight = here[3]
    for j in range(x.size):
        own, total, n = _masking_at(j, here, counting)
        transduced, masked, root = own * own * own * np.sqrt(own), counting.masking * total / n, np.sqrt(own)
        for _ in range(_NEWTON_STEPS):
            square = root * root
            fourth = square * square
            excess = fourth * root * (square + masked) - transduced
            root -= excess / (fourth * (np.float32(7) * square + np.float32(5) * masked))
        x[j] = log2(max(root, np.float32(1e-6)))
    seen = 0.0
    if counting.weighs:
        for j in range(x.size):
            seen += weight[j] * (np.float32(1) - exp2(np.float32(-10) * max(x[j], np.float32(0))))
    else:
        for j in range(x.size):
            hazard = exp2(min(max(_PER_X * x[j], np.float32(-60)), np.float32(6.5)))
            seen += weight[j] * (np.float32(1) - exp2(-hazard))
    return seen


@compiled
def _visible_in_row(here: Any, counting: Counting) -> Any:
    """Return how many pixels of a row are visible: |C|^0.7 > 1 + mean of |C|^0.2 about them (Eq. 3)."""
    weight, visible = here[3], numba.int32(0)
    for j in range(weight.size):
        own, total, n = _masking_at(j, here, counting)
        transduced = own * own * own * np.sqrt(own)  # (|C|^0.2)^3.5
        visible += numba.int32(weight[j] * transduced * n > n + counting.masking * total)
    return visible


def counted_rows(height: int, one_in: int, turn: int) -> list[tuple[int, int]]:
    """Return the strips of rows that are counted: the first row of each, and the one after its last.

    One of each `one_in` strips that follow each other, by the golden ratio's multiples, so that no period of
    the picture is met by a period of the strips; at the next turn the next one.

    >>> counted_rows(16, 2, turn=0), counted_rows(16, 2, turn=1), counted_rows(16, 1, turn=0)
    ([(0, 4), (12, 16)], [(4, 8), (8, 12)], [(0, 16)])
    """
    if one_in == 1 or height < one_in * STRIP:
        return [(0, height)]
    strips = []
    for part in range(-(-height // (one_in * STRIP))):
        chosen = (int(part * GOLDEN % 1 * one_in) + turn) % one_in
        begin = (part * one_in + chosen) * STRIP
        if begin < height:
            strips.append((begin, min(begin + STRIP, height)))
    return strips

"""Samples of a picture dimmed: of Y', Cb, Cr as they are decoded, or of R', G', B'; and dithered.

Dimming multiplies R', G' and B' by one scale, and Y', Cb, Cr are linear in them: so each sample is moved
towards its plane's zero (black of luma, gray of chroma) by that scale, at the resolution that the plane has.
Nothing is converted, and chroma is not resampled.

A sample between two codes is drawn with either, by an 8 x 8 matrix of thresholds (Bayer 1973) that stands
still: the mean over 8 x 8 pixels is right to 1/64 of a code, and encoders find the pattern in each frame.

Cameras and encoders write samples whose R', G' or B' is above 1 in highlights and in saturated colours. They
are cut off first, as displays do: dimmed as they are, they would be brighter than their share of what is seen
at full brightness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.dithering import thresholds_of
from evenlight.stimuli.video.frame_conversion import BT709, LUMA_WEIGHTS, quantization

FRACTION = 16  # bits below a code, to which samples are computed
_ONE = 1 << FRACTION
ROUNDING = 0.5  # codes of luma above white that may be the rounding of what was white
STRIP = 16  # rows of chroma whose largest and smallest samples may tell that nothing is above white

Codes = NDArray[Any]  # of uint8 or uint16, (height, width)
Fixed = NDArray[np.uint32]  # codes with `FRACTION` bits below them


@dataclass(frozen=True, slots=True)
class Coding:
    """How whole numbers stand for the values of a plane."""

    bits: int  # of a number
    # the number that stands for 0, and how many stand for a difference of 1
    zero: float
    span: float


Codings = tuple[Coding, Coding, Coding]  # of the planes of a picture


def luma_chroma_codings(bits: int, *, full: bool) -> Codings:
    """Return how Y', Cb, Cr are coded over the full or the limited range (ITU-T H.273, equations 20-31)."""
    black, luma_span, chroma_span = quantization(bits, full)
    chroma = Coding(bits, 2.0 ** (bits - 1), float(chroma_span))
    return Coding(bits, float(black), float(luma_span)), chroma, chroma


def rgb_codings(bits: int) -> Codings:
    """Return how R', G', B' are coded over the full range."""
    channel = Coding(bits, 0.0, 2.0**bits - 1)
    return channel, channel, channel


def dimmed_codes(scale: float, source: Coding, target: Coding) -> Fixed:
    """Return what each code of a plane becomes where values are multiplied by a scale, (2^bits,).

    >>> black_gray_white = np.array([16, 126, 235])
    >>> (luma, *_), (deep, *_) = (luma_chroma_codings(bits, full=False) for bits in (8, 10))
    >>> (dimmed_codes(0.5, luma, deep)[black_gray_white] / 2**FRACTION).tolist()
    [64.0, 284.0, 502.0]
    """
    values = (np.arange(1 << source.bits) - source.zero) / source.span * scale
    return fixed(values * target.span + target.zero, target.bits)


def fixed(codes: NDArray[Any], bits: int) -> Fixed:
    """Return codes with fractions as whole numbers of 2^-`FRACTION`, cut off where no code is."""
    top = float(((1 << bits) - 1) * _ONE)
    return np.asarray(np.clip(np.rint(codes * _ONE), 0.0, top), dtype=np.uint32)


def dithered(values: Fixed, bits: int) -> Codes:
    """Return the codes that are drawn for values between them; whole ones stay as they are.

    >>> dithered(np.full((2, 2), 5.25 * 2**FRACTION, np.uint32), 8).tolist()
    [[5, 5], [6, 5]]
    """
    codes = (values + _thresholds(values.shape)) >> np.uint32(FRACTION)
    return np.asarray(codes, dtype=np.uint8 if bits <= 8 else np.uint16)


@lru_cache(4)  # 33 MB for a plane of 4K
def _thresholds(shape: tuple[int, int]) -> Fixed:
    return np.asarray(thresholds_of(Dither.ORDERED, shape) >> np.uint32(24 - FRACTION))


def ycbcr_of(pixel_values: NDArray[Any], scale: float, *, half: bool) -> list[NDArray[np.float32]]:
    """Return Y', Cb, Cr by BT.709 of R', G', B' that are multiplied by a scale.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        L': whole numbers over the full range of their type, or floats in [0, 1].
    scale : float
        The factor of L'.
    half : bool
        Whether Cb and Cr get half of the rows and columns (4:2:0); their samples then lie left, between
        two rows, as in MPEG-2 and later (H.273, chroma sample location 0).
    """
    whole = pixel_values.dtype.kind == "u"
    unit = np.float32(scale / np.iinfo(pixel_values.dtype).max if whole else scale)
    red, green, blue = (pixel_values[..., channel] * unit for channel in range(3))
    weight_red, weight_blue = (np.float32(w) for w in LUMA_WEIGHTS[BT709])
    luma = weight_red * red + (1 - weight_red - weight_blue) * green + weight_blue * blue
    chroma = [(blue - luma) / (2 * (1 - weight_blue)), (red - luma) / (2 * (1 - weight_red))]
    return [luma, *(map(_halved, chroma) if half else chroma)]


def _halved(plane: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a plane with half of the rows, each the mean of two, and with every other column, smoothed."""
    rows = (plane[0::2] + plane[1::2]) / 2
    left = np.concatenate([rows[:, :1], rows[:, 1:-1:2]], axis=1)
    return np.asarray((left + 2 * rows[:, 0::2] + rows[:, 1::2]) / 4, dtype=np.float32)


def cut_above_white(planes: list[Codes], codings: Codings, weights: tuple[float, float]) -> list[Codes]:
    """Return Y', Cb, Cr without what is above white; the weights are K_R and K_B of their matrix."""
    luma, blue, red = planes[0], planes[1].copy(), planes[2].copy()
    (height, width), (rows, columns) = luma.shape, blue.shape
    down, across = -(-height // rows), -(-width // columns)
    whole = np.pad(luma, ((0, rows * down - height), (0, columns * across - width)), mode="edge")
    parts = [whole[i::down, j::across] for i in range(down) for j in range(across)]
    for row in range(0, rows, STRIP):
        strip = slice(row, row + STRIP)
        _cut_off([part[strip] for part in parts], (blue[strip], red[strip]), codings, weights)
    return [whole[:height, :width], blue, red]


def _cut_off(
    parts: list[Codes], chroma: tuple[Codes, Codes], codings: Codings, weights: tuple[float, float]
) -> None:
    """Cut off, in place, what is above white in the parts of luma that have a sample of chroma in common."""
    of_luma, of_chroma, _ = codings
    white = of_luma.zero + of_luma.span + ROUNDING

    def added(*samples: Any) -> list[Any]:
        """Return R' - Y', G' - Y', B' - Y' of Cb, Cr (ITU-T H.273, 8.3), in codes of luma."""
        blue, red = ((c - np.float32(of_chroma.zero)) / of_chroma.span * of_luma.span for c in samples)
        r, b = 2 * (1 - weights[0]) * red, 2 * (1 - weights[1]) * blue
        return [r, (weights[0] * r + weights[1] * b) / (sum(weights) - 1), b]

    extremes = [added(*map(end, chroma)) for end in (np.min, np.max)]
    if max(part.max() for part in parts) + np.max(extremes) <= white:
        return
    above = reduce(np.maximum, parts) + reduce(np.maximum, added(*chroma)) > white
    luma = np.stack([part[above] for part in parts]) - np.float32(of_luma.zero)
    r, g, b = (np.minimum(luma + more, of_luma.span) for more in added(*(plane[above] for plane in chroma)))
    luma = weights[0] * r + (1 - sum(weights)) * g + weights[1] * b
    for part, values in zip(parts, luma, strict=True):
        part[above] = np.rint(values + of_luma.zero)
    for plane, channel, weight in zip(chroma, (b, r), reversed(weights), strict=True):
        mean = ((channel - luma) / (2 * (1 - weight))).mean(axis=0)
        plane[above] = np.rint(mean / of_luma.span * of_chroma.span + of_chroma.zero)

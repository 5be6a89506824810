"""Luminance of the pixel values of frames, in single precision and in one pass over them.

The definition, in double precision and step by step, is `contrast.luminance.emitted_luminance`. Of a file it
is taken straight from Y, Cb, Cr, without an image of R, G, B between them. The R, G, B whose light is taken
are those of FFmpeg's exact conversion to 8 bits, to the last bit: chroma is interpolated linearly, in 16ths
of a code, and the matrix is of whole numbers (docs/decisions/one-pass-curves.md). So planes give the same
luminance as pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import DTypeLike, NDArray

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import LumaChroma, Pixels, rgb_of
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, channel_means, emitted_luminance
from evenlight.method.contrast.one_pass import BLOCK, compiled, interpolated

Luminance = NDArray[np.float32]
FLOAT_STEPS = 65535  # of the linearization table for floats, read with linear interpolation
_R, _G, _B = (np.float32(w) for w in LUMINANCE_WEIGHTS)
_SHIFT = 17  # bits after the point: 13 of the matrix, 4 of chroma
_MIDDLE = 16 * 128  # chroma of gray


class FrameLight:
    """Tables that linearize the pixel values of frames, and what a display emits for them at factor 1.

    Parameters
    ----------
    display : Display
        The display that shows them.
    order : PixelToLuminance
        Whether channels are linearized before they are weighed.
    take : function of (shape, type)
        Gives arrays to be filled.

    >>> light = FrameLight(Display("lab", 100.0, 0.0, 2.0, 60.0), PixelToLuminance.LINEAR_FIRST)
    >>> light.luminance(np.full((1, 2, 3), [[[0], [255]]], dtype=np.uint8)).round(3).tolist()
    [[0.0, 100.0]]
    """

    def __init__(
        self,
        display: Display,
        order: PixelToLuminance,
        take: Callable[[tuple[int, ...], DTypeLike], NDArray[Any]] = np.empty,
    ) -> None:
        self._display, self._order, self._take = display, order, take
        self._linear: dict[int, NDArray[np.float32]] = {}

    def luminance(self, pixels: Pixels) -> Luminance:
        """Return I of a frame, (height, width, 3) gamma-encoded or Y, Cb, Cr [cd/m^2]."""
        if self._order is PixelToLuminance.LUMA_FIRST:
            return self._of_luma(pixels)
        return self._converted(pixels)[0]

    def drawn(self, pixels: Pixels, factor: float) -> Luminance:
        """Return what pixels emit for a frame that they dim: `drawn_luminance`, reflections excluded."""
        if self._order is PixelToLuminance.LUMA_FIRST:
            dimmed = np.float32(factor) * self._of_luma(pixels)
            return np.asarray(np.maximum(dimmed, np.float32(self._display.black_level)))
        return self._converted(pixels, factor)[0]

    def luminance_and_means(self, pixels: Pixels) -> tuple[Luminance, NDArray[np.float64]]:
        """Return I, and the means of the linear R, G, B channels, (3,)."""
        if self._order is PixelToLuminance.LUMA_FIRST:
            return self._of_luma(pixels), channel_means(rgb_of(pixels), self._display.gamma)
        return self._converted(pixels)

    def luminance_and_mean(
        self, pixels: Pixels, halvings: int = 0
    ) -> tuple[Luminance, float, NDArray[np.float64]]:
        """Return I, its mean Ī, and the means of the linear R, G, B channels, (3,).

        With `halvings`, I is of so many times half the pixels each way, rounded up: means of their light.
        """
        if self._order is PixelToLuminance.LUMA_FIRST:
            luminance, means = self.luminance_and_means(pixels)
            mean = float(luminance.mean(dtype=np.float64))
        else:
            luminance, means = self._converted(pixels, block=2**halvings)
            black, peak = self._display.black_level, self._display.peak_luminance
            mean = float(black + (peak - black) * (LUMINANCE_WEIGHTS @ means))
        for _ in range(halvings if luminance.shape == pixels.shape[:2] else 0):
            luminance = halved(luminance)
        return luminance, mean, means

    def _of_luma(self, pixels: Pixels) -> Luminance:
        wide = emitted_luminance(rgb_of(pixels), self._display, PixelToLuminance.LUMA_FIRST)
        luminance = self._take(wide.shape, np.float32)
        np.copyto(luminance, wide, casting="same_kind")
        return luminance

    def _converted(
        self, pixels: Pixels, drawn_at: float | None = None, block: int = 1
    ) -> tuple[Luminance, NDArray[np.float64]]:
        """Return I, or what pixels draw at a factor, and the channels' means, where these come first.

        Where whole numbers fill whole blocks of so many pixels each way, I is that of the blocks.
        """
        kind = np.dtype(np.uint8) if isinstance(pixels, LumaChroma) else pixels.dtype
        whole = np.issubdtype(kind, np.integer)
        steps = int(np.iinfo(kind).max) if whole else FLOAT_STEPS
        if steps not in self._linear:
            encoded = np.arange(steps + 1) / steps
            self._linear[steps] = (encoded**self._display.gamma).astype(np.float32)
        height, width, _ = pixels.shape
        fits = whole and isinstance(pixels, np.ndarray) and height % block == width % block == 0
        block = block if fits else 1
        luminance = self._take((height // block, width // block), np.float32)
        black = np.float32(self._display.black_level)
        span = np.float32(self._display.peak_luminance - self._display.black_level)
        linear = self._linear[steps]
        if drawn_at is not None:  # each level as the one that is drawn for it
            linear = np.maximum(np.float32(drawn_at) * (black + span * linear) - black, np.float32(0)) / span
        if isinstance(pixels, LumaChroma):
            planes = tuple(map(plane_in_memory, pixels.planes))
            light = linear, black, span
            sums = convert_planes(planes, pixels.amid, matrix_of(pixels), light, luminance)
        else:
            given = np.ascontiguousarray(pixels), linear, black, span, luminance
            sums = convert_integers(*given, tuple(range(block))) if whole else convert_floats(*given)
        return luminance, np.array(sums) / (height * width)


@compiled
def convert_integers(
    pixel_values: Any, linear: Any, black: Any, span: Any, luminance: Any, within: Any = (0,)
) -> Any:
    """Fill `luminance` with I of an integer frame; return the sums of its linear channels.

    `linear[v]` is the linear value of the pixel value v; `span` is from `black` to the peak [cd/m^2];
    `within` counts the rows of a block of pixels that I is a mean of, a tuple for the compiler to unroll.
    """
    red = green = blue = np.float64(0)
    n = len(within)
    share = span / np.float32(n * n)
    for i in range(luminance.shape[0]):
        rows, out = pixel_values[n * i : n * i + n], luminance[i]
        for j in range(luminance.shape[1]):
            r = g = b = np.float32(0)
            for p in within:
                for q in within:
                    row, column = np.uint64(p), np.uint64(n * j + q)
                    r += linear[rows[row, column, 0]]
                    g += linear[rows[row, column, 1]]
                    b += linear[rows[row, column, 2]]
            red += r
            green += g
            blue += b
            out[j] = black + share * (_R * r + _G * g + _B * b)
    return red, green, blue


@compiled
def halved(fine: Any) -> Any:
    """Return the means of 2 × 2 pixels; beyond an odd edge the last row or column goes on."""
    height, width = fine.shape
    coarse = np.empty(((height + 1) // 2, (width + 1) // 2), np.float32)
    for i in range(coarse.shape[0]):
        a, b = fine[2 * i], fine[min(2 * i + 1, height - 1)]
        for j in range(coarse.shape[1]):
            k = min(2 * j + 1, width - 1)
            coarse[i, j] = np.float32(0.25) * ((a[2 * j] + a[k]) + (b[2 * j] + b[k]))
    return coarse


@compiled
def convert_floats(pixel_values: Any, linear: Any, black: Any, span: Any, luminance: Any) -> Any:
    """Fill `luminance` with I of a frame of floats in [0, 1]; otherwise as `convert_integers`."""
    red = green = blue = 0.0
    for i in range(luminance.shape[0]):
        for j in range(luminance.shape[1]):
            r = interpolated(linear, np.float32(pixel_values[i, j, 0]))
            g = interpolated(linear, np.float32(pixel_values[i, j, 1]))
            b = interpolated(linear, np.float32(pixel_values[i, j, 2]))
            red += r
            green += g
            blue += b
            luminance[i, j] = black + span * (_R * r + _G * g + _B * b)
    return red, green, blue


def matrix_of(picture: LumaChroma) -> tuple[int, ...]:
    """Return the matrix to R, G, B in whole numbers, as FFmpeg rounds them (ITU-T H.273, section 8.3).

    It is the code of black, and the gains of Y, of Cr in R, of Cb in B, and of Cr and Cb in G.

    >>> gray = np.full((2, 2), 128, np.uint8)
    >>> matrix_of(LumaChroma((gray, gray, gray), (0.299, 0.114), True, (False, False), gray.copy))
    (0, 131072, 11485, 14516, -5850, -2819)
    """
    weight_red, weight_blue = picture.luma_weights
    red, blue = 2 * (1 - weight_red), 2 * (1 - weight_blue)
    green = 1 - weight_red - weight_blue
    gains = []
    for share in (red, blue, -red * weight_red / green, -blue * weight_blue / green):
        limited = round(abs(share) * 2**16 * 255 / 224)
        gain = limited * 224 // 255 if picture.full_range else limited
        gains.append(((gain if share > 0 else -gain) + 4) >> 3)
    luma = 2**16 if picture.full_range else 2**16 * 255 // 219
    return 0 if picture.full_range else 16, 16 * ((luma + 4) >> 3), *gains


def plane_in_memory(plane: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int, tuple[int, int]]:
    """Return a plane's memory in one row, how far its rows lie apart, and its size.

    So all planes are of one type for the compiler, whatever padding their rows have.

    >>> plane_in_memory(np.arange(6, dtype=np.uint8).reshape(2, 3)[:, :2])
    (array([0, 1, 2, 3, 4], dtype=uint8), 3, (2, 2))
    """
    if plane.strides[1] != 1 or plane.strides[0] < plane.shape[1]:
        plane = np.ascontiguousarray(plane)
    (rows, columns), stride = plane.shape, plane.strides[0]
    memory = as_strided(plane, ((rows - 1) * stride + columns,), (1,), writeable=False)
    return memory, stride, (rows, columns)


@compiled
def convert_planes(planes: Any, amid: Any, matrix: Any, light: Any, luminance: Any) -> Any:
    """Fill `luminance` with I of Y, Cb and Cr; return the sums of the linear R, G and B channels.

    `planes` are as of `plane_in_memory`; `amid` as of the picture; `light` is the linear value of each code
    of R, G or B, luminance of black, and from there to the peak.
    """
    (luma, stride, _), blue, red = planes
    linear, black, span = light
    code_of_black, gain, cr_in_red, cb_in_blue, cr_in_green, cb_in_green = matrix
    height, width = luminance.shape
    whole = -(-width // BLOCK) * BLOCK  # rows are filled up without light
    down = np.empty(blue[2][1] + 2, np.int32)
    cb, cr = np.empty(width + 1, np.int32), np.empty(width + 1, np.int32)
    codes, lights = np.empty((3, width), np.uint8), np.zeros((3, whole), np.float32)
    sums = np.zeros((3, BLOCK))  # each of every so many columns
    start = np.int32((1 << (_SHIFT - 1)) - code_of_black * gain)
    for i in range(height):
        interpolate_chroma(blue, i, height, amid, down, cb)
        interpolate_chroma(red, i, height, amid, down, cr)
        row, out = luma[i * stride : i * stride + width], luminance[i]
        for j in range(width):
            y = np.int32(start + np.int32(np.int32(row[j]) * np.int32(gain)))
            from_red = np.int32(cr[j] * np.int32(cr_in_green))
            codes[0, j] = code_of(y, np.int32(cr[j] * np.int32(cr_in_red)))
            codes[1, j] = code_of(y, np.int32(from_red + np.int32(cb[j] * np.int32(cb_in_green))))
            codes[2, j] = code_of(y, np.int32(cb[j] * np.int32(cb_in_blue)))
        for c in range(3):
            for j in range(width):
                lights[c, j] = linear[codes[c, j]]
            for begin in range(0, whole, BLOCK):
                for k in range(BLOCK):
                    sums[c, k] += lights[c, np.uint64(begin + k)]
        for j in range(width):
            out[j] = black + span * (_R * lights[0, j] + _G * lights[1, j] + _B * lights[2, j])
    return sums[0].sum(), sums[1].sum(), sums[2].sum()


@compiled
def code_of(y: Any, chroma: Any) -> Any:
    """Return the code of R, G or B; whole numbers of 32 bits stay so, where Numba would widen them."""
    code = np.int32(np.int32(y + chroma) >> np.int32(_SHIFT))
    return np.uint8(min(max(code, np.int32(0)), np.int32(255)))


@compiled
def interpolate_chroma(plane: Any, i: Any, height: Any, amid: Any, down: Any, row: Any) -> None:
    """Fill `row` with row i of a plane of chroma at every pixel, in 16ths of a code from gray.

    `down` is scratch, two cells wider than the plane; `row` is one cell wider than the picture. A sample
    stands for one or two pixels each way; beyond the picture's edge the last one goes on.
    """
    samples, stride, (rows, columns) = plane
    own, other, near, far = np.int32(4), np.int32(0), i, i
    if rows < height:
        near = i // 2
        far = min(max(near + (1 if i % 2 else -1), 0), rows - 1)
        other = np.int32(1) if amid[0] else np.int32(2 * (i % 2))
        own = np.int32(4) - other
    here = samples[near * stride : near * stride + columns]
    there = samples[far * stride : far * stride + columns]
    for k in range(columns):
        down[k + 1] = own * np.int32(here[k]) + other * np.int32(there[k])
    down[0], down[columns + 1] = down[1], down[columns]
    width = row.size - 1
    if columns == width:
        for j in range(width):
            row[j] = np.int32(4) * down[j + 1] - np.int32(_MIDDLE)
    elif amid[1]:
        for k in range(columns):
            row[2 * k] = down[k] + np.int32(3) * down[k + 1] - np.int32(_MIDDLE)
            row[2 * k + 1] = np.int32(3) * down[k + 1] + down[k + 2] - np.int32(_MIDDLE)
    else:
        for k in range(columns):
            row[2 * k] = np.int32(4) * down[k + 1] - np.int32(_MIDDLE)
            row[2 * k + 1] = np.int32(2) * (down[k + 1] + down[k + 2]) - np.int32(_MIDDLE)

"""Luminance of the pixel values of frames, in single precision and in one pass over them.

The definition, in double precision and step by step, is `contrast.luminance.emitted_luminance`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import LumaChroma, Pixels, rgb_of
from evenlight.method.contrast.luma_chroma import convert_planes, matrix_of, plane_in_memory
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, channel_means, emitted_luminance
from evenlight.method.contrast.one_pass import compiled, interpolated

Luminance = NDArray[np.float32]
FLOAT_STEPS = 65535  # of the linearization table for floats, read with linear interpolation
_R, _G, _B = (np.float32(w) for w in LUMINANCE_WEIGHTS)


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

    def _of_luma(self, pixels: Pixels) -> Luminance:
        """Return I of pixel values whose channels are weighed first."""
        wide = emitted_luminance(rgb_of(pixels), self._display, PixelToLuminance.LUMA_FIRST)
        luminance = self._take(wide.shape, np.float32)
        np.copyto(luminance, wide, casting="same_kind")
        return luminance

    def _converted(
        self, pixels: Pixels, drawn_at: float | None = None
    ) -> tuple[Luminance, NDArray[np.float64]]:
        """Return I, or what pixels draw at a factor, and the channels' means, where these come first."""
        kind = np.dtype(np.uint8) if isinstance(pixels, LumaChroma) else pixels.dtype
        whole = np.issubdtype(kind, np.integer)
        steps = int(np.iinfo(kind).max) if whole else FLOAT_STEPS
        if steps not in self._linear:
            encoded = np.arange(steps + 1) / steps
            self._linear[steps] = (encoded**self._display.gamma).astype(np.float32)
        luminance = self._take(pixels.shape[:2], np.float32)
        black = np.float32(self._display.black_level)
        span = np.float32(self._display.peak_luminance - self._display.black_level)
        linear = self._linear[steps]
        if drawn_at is not None:  # each level as the one that is drawn for it
            linear = np.maximum(np.float32(drawn_at) * (black + span * linear) - black, np.float32(0)) / span
        if isinstance(pixels, LumaChroma):
            planes = tuple(map(plane_in_memory, pixels.planes))
            matrix = matrix_of(pixels)
            sums = convert_planes(planes, pixels.amid, matrix, (linear, black, span), luminance)
        else:
            convert = convert_integers if whole else convert_floats
            sums = convert(np.ascontiguousarray(pixels), linear, black, span, luminance)
        return luminance, np.array(sums) / luminance.size


@compiled
def convert_integers(pixel_values: Any, linear: Any, black: Any, span: Any, luminance: Any) -> Any:
    """Fill `luminance` with I of an integer frame; return the sums of its linear channels.

    `linear[v]` is the linear value of the pixel value v; `span` is from `black` to the peak [cd/m^2].
    """
    red = green = blue = 0.0
    for i in range(luminance.shape[0]):
        for j in range(luminance.shape[1]):
            r = linear[pixel_values[i, j, 0]]
            g = linear[pixel_values[i, j, 1]]
            b = linear[pixel_values[i, j, 2]]
            red += r
            green += g
            blue += b
            luminance[i, j] = black + span * (_R * r + _G * g + _B * b)
    return red, green, blue


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

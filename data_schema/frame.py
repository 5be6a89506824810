"""One frame of a video, on its way from a source to the model."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arguments import number
from evenlight.data_schema.errors import ArgumentError, InputError, shown_kind

PIXEL_TYPES = ("uint8", "uint16", "float32", "float64")


@dataclass(frozen=True, eq=False)
class LumaChroma:
    """A picture as most files hold it: Y, Cb, Cr of 8 bits, chroma often with fewer samples (ITU-T H.273).

    Attributes
    ----------
    planes : three arrays of uint8, (height, width) for Y; half or all of that each way for Cb and Cr
        Nothing writes to them any more.
    luma_weights : (float, float)
        K_R and K_B.
    full_range : bool
        Whether Y is from 0 to 255, else from 16 to 235.
    amid : (bool, bool)
        Whether a sample of chroma that stands for two pixels lies amid them, down and across; else it lies
        on the first.
    to_rgb : function
        Makes gamma-encoded R, G, B of the picture, (height, width, 3), uint8; called from any thread.
    """

    planes: tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]
    luma_weights: tuple[float, float]
    full_range: bool
    amid: tuple[bool, bool]
    to_rgb: Callable[[], NDArray[np.uint8]]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Height, width and 3, as of the pixel values."""
        return (*self.planes[0].shape, 3)

    @cached_property
    def rgb(self) -> NDArray[np.uint8]:
        """Gamma-encoded R, G, B, (height, width, 3); made when it is first asked for."""
        return self.to_rgb()


Pixels: TypeAlias = NDArray[Any] | LumaChroma


def rgb_of(pixels: Pixels) -> NDArray[Any]:
    """Return gamma-encoded R, G, B of pixels, (height, width, 3)."""
    return pixels.rgb if isinstance(pixels, LumaChroma) else pixels


def same_pixels(one: Pixels, other: Pixels) -> bool:
    """Whether pictures are equal and of one kind: 1 as a float is white, as an integer all but black."""
    if isinstance(one, LumaChroma) and isinstance(other, LumaChroma):
        meant = [(picture.luma_weights, picture.full_range, picture.amid) for picture in (one, other)]
        return meant[0] == meant[1] and all(map(_equal, one.planes, other.planes))
    if isinstance(one, LumaChroma) or isinstance(other, LumaChroma):
        return False
    return one.dtype == other.dtype and _equal(one, other)


def _equal(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether arrays are equal; a few rows tell most that are not, at a hundredth of the time."""
    return np.array_equal(one[::64], other[::64]) and np.array_equal(one, other)


@dataclass(frozen=True, slots=True, init=False)
class Frame:
    """A frame of a video.

    Attributes
    ----------
    time, duration : float
        When it appears, and for how long [s].
    pixel_values : array, (height, width, 3), uint8, uint16, float32 or float64
        Gamma-encoded R, G, B: integers over their full range (0-255, 0-65535), floats in [0, 1].
        Copy what is kept when the next frame is asked for: its source may fill the same array again.
    pixels : array or LumaChroma
        The same as its source has it, and as it is handed in.
    """

    time: float
    duration: float
    pixels: Pixels

    def __init__(self, time: float, duration: float, pixel_values: Pixels) -> None:
        for name, value in (("time", time), ("duration", duration), ("pixels", pixel_values)):
            object.__setattr__(self, name, value)
        for name, value in (("time", time), ("duration", duration)):
            if type(value) is not float:  # as nearly all are
                number(name, value)
        if not (math.isfinite(time) and 0 < duration < math.inf):
            raise InputError(
                f"a frame needs a finite time and a duration above 0 s, got {time:g} and {duration:g}"
            )
        if not isinstance(pixel_values, LumaChroma):
            _check(pixel_values, time)

    @property
    def pixel_values(self) -> NDArray[Any]:
        """Gamma-encoded R, G, B, (height, width, 3)."""
        return rgb_of(self.pixels)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width [pixels]."""
        return self.pixels.shape[0], self.pixels.shape[1]

    def __repr__(self) -> str:
        height, width = self.shape
        kind = "Y, Cb, Cr" if isinstance(self.pixels, LumaChroma) else self.pixels.dtype
        return f"<Frame at {self.time:g} s for {self.duration:g} s: {width} x {height} pixels, {kind}>"


def _way_out(shape: tuple[int, ...]) -> str:
    """Return how an array of another layout becomes a frame, if it looks like one; else nothing.

    >>> _way_out((3, 90, 160))
    '; channels come last: numpy.moveaxis(frame, 0, -1)'
    """
    if len(shape) == 2:
        return "; of gray, give numpy.stack([frame] * 3, axis=-1)"
    if len(shape) == 3 and shape[2] == 4:
        return "; without alpha: frame[..., :3]"
    first = len(shape) == 3 and shape[0] in (3, 4)
    return "; channels come last: numpy.moveaxis(frame, 0, -1)" if first else ""


def _check(pixels: NDArray[Any], time: float) -> None:
    if not isinstance(pixels, np.ndarray):
        raise ArgumentError("pixel_values", f"must be an array, got {shown_kind(pixels)}")
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype.name not in PIXEL_TYPES:
        raise InputError(
            f"the frame at {time:g} s needs pixel values of shape (height, width, 3), "
            f"{', '.join(PIXEL_TYPES)}, got {pixels.shape} of {pixels.dtype}{_way_out(pixels.shape)}"
        )
    # Compiled loops take pixel values for indices of tables: a NaN would read beyond their ends.
    if pixels.dtype.kind == "f" and pixels.size and not (pixels.min() >= 0 and pixels.max() <= 1):
        raise InputError(
            f"the frame at {time:g} s needs pixel values in [0, 1], got {pixels.min():g} to {pixels.max():g}"
        )

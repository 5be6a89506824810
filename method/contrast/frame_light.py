"""The light of a frame: its luminance in single precision, and the means of its channels.

Frames are large, and fresh memory can cost more than the work done on it: `SpareArrays` are filled again and
again.
"""

from __future__ import annotations

import threading
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.method.contrast.luminance import channel_means, emitted_luminance
from evenlight.method.contrast.one_pass import FLOAT_STEPS, convert_floats, convert_integers

Luminance = NDArray[np.float32]
_Kind = tuple[tuple[int, ...], np.dtype[Any]]  # shape and type of an array


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

    def luminance(self, pixel_values: NDArray[Any]) -> Luminance:
        """Return I of a frame, (height, width, 3) gamma-encoded [cd/m^2]."""
        if self._order is PixelToLuminance.LUMA_FIRST:
            return self._of_luma(pixel_values)
        return self._converted(pixel_values)[0]

    def luminance_and_means(self, pixel_values: NDArray[Any]) -> tuple[Luminance, NDArray[np.float64]]:
        """Return I, and the means of the linear R, G, B channels, (3,)."""
        if self._order is PixelToLuminance.LUMA_FIRST:
            return self._of_luma(pixel_values), channel_means(pixel_values, self._display.gamma)
        return self._converted(pixel_values)

    def _of_luma(self, pixel_values: NDArray[Any]) -> Luminance:
        """Return I of pixel values whose channels are weighed first."""
        wide = emitted_luminance(pixel_values, self._display, PixelToLuminance.LUMA_FIRST)
        luminance = self._take(wide.shape, np.float32)
        np.copyto(luminance, wide, casting="same_kind")
        return luminance

    def _converted(self, pixel_values: NDArray[Any]) -> tuple[Luminance, NDArray[np.float64]]:
        """Return I and the channels' means of pixel values whose channels are linearized first."""
        whole = np.issubdtype(pixel_values.dtype, np.integer)
        steps = int(np.iinfo(pixel_values.dtype).max) if whole else FLOAT_STEPS
        if steps not in self._linear:
            encoded = np.arange(steps + 1) / steps
            self._linear[steps] = (encoded**self._display.gamma).astype(np.float32)
        luminance = self._take(pixel_values.shape[:2], np.float32)
        black = np.float32(self._display.black_level)
        span = np.float32(self._display.peak_luminance - self._display.black_level)
        convert = convert_integers if whole else convert_floats
        sums = convert(np.ascontiguousarray(pixel_values), self._linear[steps], black, span, luminance)
        return luminance, np.array(sums) / luminance.size


class SpareArrays:
    """Arrays that were given back, to be filled again; any thread may take and give.

    The system hands out memory page by page, at its first touch: for the luminance of a 1080p frame that can
    take milliseconds. So there are as many arrays as were ever in use at a time, and no more: one that comes
    back when all that were handed out are back is not kept.

    >>> spare = SpareArrays()
    >>> first = spare.take((2, 3), np.float32)
    >>> spare.give_back(first)
    >>> spare.take((2, 3), np.float32) is first
    True
    """

    def __init__(self) -> None:
        self._held: defaultdict[_Kind, list[NDArray[Any]]] = defaultdict(list)
        self._out: Counter[_Kind] = Counter()
        self._one_at_a_time = threading.Lock()

    def take(self, shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
        """Return an array of a shape and type, whatever it holds."""
        asked = shape, np.dtype(kind)
        with self._one_at_a_time:
            self._out[asked] += 1
            held = self._held[asked]
            if held:
                return held.pop()
        return np.empty(shape, kind)

    def give_back(self, array: NDArray[Any]) -> None:
        """Give back an array, for the next `take`."""
        given = array.shape, array.dtype
        with self._one_at_a_time:
            if self._out[given] > 0:
                self._out[given] -= 1
                self._held[given].append(array)

    @property
    def held(self) -> int:
        """How many arrays wait to be filled again."""
        with self._one_at_a_time:
            return sum(map(len, self._held.values()))

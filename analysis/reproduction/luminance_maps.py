"""The luminance of each frame of a video, at a few pixels, kept while it streams past."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.method.luminance import LUMINANCE_WEIGHTS, dimmed_luminance, linear_channels

Map = NDArray[np.float32]


@dataclass(slots=True)
class LuminanceMaps:
    """Means of the luminance at factor 1 over blocks of pixels, frame by frame.

    Attributes
    ----------
    display : Display
        The display that shows the video; channels are linearized, then weighed to luminance.
    width : int
        Blocks across; as many down as make them nearly square, and no more than there are pixels.
    times, durations : list of float
        When each frame appeared, and for how long [s].
    emitted : list of array, (h, w)
        I of each frame, reflected light excluded [cd/m^2].

    >>> maps = LuminanceMaps(Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0), width=2)
    >>> white = Frame(0.0, 0.04, np.full((9, 18, 3), 255, np.uint8))
    >>> _ = list(maps.watch([white]))
    >>> maps.luminance.round(4).tolist()
    [[[100.0, 100.0]]]
    """

    display: Display
    width: int = 48
    times: list[float] = field(default_factory=list)
    durations: list[float] = field(default_factory=list)
    emitted: list[Map] = field(default_factory=list)
    _table: NDArray[Any] = field(default_factory=lambda: np.empty(0), repr=False)

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield the frames unchanged, keeping the luminance of each."""
        for frame in frames:
            self.times.append(frame.time)
            self.durations.append(frame.duration)
            self.emitted.append(self._reduced(frame.pixel_values))
            yield frame

    @property
    def luminance(self) -> Map:
        """I of all frames, (N, h, w) [cd/m^2]."""
        return np.stack(self.emitted)

    def _reduced(self, pixel_values: NDArray[Any]) -> Map:
        """Return the means of a frame's blocks; blocks of linear values, so that the mean is the light's."""
        height, width = pixel_values.shape[:2]
        across = min(self.width, width)
        down = min(max(round(across * height / width), 1), height)
        linear = self._linear(pixel_values) @ np.array(LUMINANCE_WEIGHTS)
        blocks = block_means(linear, (down, across))
        span = self.display.peak_luminance - self.display.black_level
        return (blocks * span + self.display.black_level).astype(np.float32)

    def _linear(self, pixel_values: NDArray[Any]) -> NDArray[Any]:
        """Return linear channels in [0, 1]; of integers by a table, which takes a tenth of the time."""
        if not np.issubdtype(pixel_values.dtype, np.integer):
            return linear_channels(pixel_values, self.display.gamma)
        codes = np.iinfo(pixel_values.dtype).max + 1
        if len(self._table) != codes:
            self._table = linear_channels(np.arange(codes, dtype=pixel_values.dtype), self.display.gamma)
        return np.asarray(self._table[pixel_values])


def block_means(values: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Return the means of an image over a grid of blocks, as equal in size as whole pixels allow.

    Parameters
    ----------
    values : array, (..., height, width)
        The image, or several.
    shape : (h, w)
        Blocks down and across, at most as many as there are pixels.

    >>> block_means(np.arange(6.0).reshape(2, 3), (1, 3)).tolist()
    [[1.5, 2.5, 3.5]]
    """
    for axis, count in ((-2, shape[0]), (-1, shape[1])):
        edges = np.arange(count + 1) * values.shape[axis] // count
        sums = np.add.reduceat(values, edges[:-1], axis=axis, dtype=np.float64)
        values = sums / np.expand_dims(np.diff(edges), -1 if axis == -2 else 0)
    return values


def seen_luminance(emitted: NDArray[Any], factors: NDArray[np.float64], display: Display) -> Map:
    """Return L = b · I + L_refl of each frame and block [cd/m^2].

    Parameters
    ----------
    emitted : array, (N, ...)
        I [cd/m^2].
    factors : array, (N,)
        b of each frame.
    display : Display
        For L_refl.
    """
    factor = np.asarray(factors).reshape(-1, *(1,) * (emitted.ndim - 1))
    return dimmed_luminance(emitted, factor, display).astype(np.float32)

"""One frame of a video, on its way from a source to the model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

PIXEL_TYPES = ("uint8", "uint16", "float32", "float64")


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame of a video.

    Attributes
    ----------
    time, duration : float
        When it appears, and for how long [s].
    pixel_values : array, (height, width, 3), uint8, uint16, float32 or float64
        Gamma-encoded R, G, B: integers over their full range (0-255, 0-65535), floats in [0, 1].
        Copy what is kept when the next frame is asked for: its source may fill the same array again.
    """

    time: float
    duration: float
    pixel_values: NDArray[Any]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.time) and 0 < self.duration < math.inf):
            raise ValueError(
                f"a frame needs a finite time and a duration above 0 s, "
                f"got {self.time:g} and {self.duration:g}"
            )
        pixels = self.pixel_values
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype.name not in PIXEL_TYPES:
            raise ValueError(
                f"the frame at {self.time:g} s needs pixel values of shape (height, width, 3), "
                f"{', '.join(PIXEL_TYPES)}, got {pixels.shape} of {pixels.dtype}"
            )
        # Compiled loops take pixel values for indices of tables: a NaN would read beyond their ends.
        if pixels.dtype.kind == "f" and pixels.size and not (pixels.min() >= 0 and pixels.max() <= 1):
            raise ValueError(
                f"the frame at {self.time:g} s needs pixel values in [0, 1], "
                f"got {pixels.min():g} to {pixels.max():g}"
            )

    def __repr__(self) -> str:
        height, width = self.pixel_values.shape[:2]
        pixels = f"{width} x {height} pixels, {self.pixel_values.dtype}"
        return f"<Frame at {self.time:g} s for {self.duration:g} s: {pixels}>"

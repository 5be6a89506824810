"""One frame of a video, on its way from a source to the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray


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

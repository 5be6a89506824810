"""What all built-in sequences share: size, length, frame rate, and how light becomes pixel values."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.stimuli.video.video_source import FramesInALoop, VideoSource, rate_from_number

ENCODING_GAMMA = 2.2
# Pixel values lie on the 10-bit grid, so that a 10-bit file holds a sequence without loss.
LEVELS = 1023
LONGEST = 86400.0  # [s] a day
FIELD_OF_VIEW = 90.0  # [deg] horizontal, about that of one eye in a headset
NARROWEST, WIDEST = 0.1, 175.0  # [deg] field of view of a flat picture; at 180 its width is infinite


@dataclass(frozen=True, slots=True)
class SequenceFormat:
    """Size, length and rate of a built-in sequence.

    Attributes
    ----------
    width, height : int
        Size [pixels].
    duration : float
        Length, rounded to whole frames [s].
    frames_per_second : float
        Frame rate [Hz].
    field_of_view : float
        Angle that the width is to span for the viewer [deg].
    """

    width: int = 640
    height: int = 360
    duration: float = 20.0
    frames_per_second: float = 25.0
    field_of_view: float = FIELD_OF_VIEW

    def __post_init__(self) -> None:
        if not (8 <= self.width <= 16384 and 8 <= self.height <= 16384):
            raise ValueError(f"need a size from 8x8 to 16384x16384 pixels, got {self.width}x{self.height}")
        rate_from_number(self.frames_per_second)
        if not NARROWEST <= self.field_of_view <= WIDEST:
            raise ValueError(
                f"need a field of view from {NARROWEST:g} to {WIDEST:g} degrees, got {self.field_of_view:g}"
            )
        if not (0 < self.duration <= LONGEST and self.n_frames >= 2):
            raise ValueError(
                f"need two frames or more, and at most {LONGEST:g} s, got {self.duration:g} s at "
                f"{self.frames_per_second:g} Hz"
            )

    @property
    def rate(self) -> Fraction:
        """Frame rate as a ratio of whole numbers, 29.97 as 30000/1001 [Hz]."""
        return rate_from_number(self.frames_per_second)

    @property
    def n_frames(self) -> int:
        """How many frames there are."""
        return round(self.duration * self.rate)

    def times(self) -> list[tuple[float, float]]:
        """When each frame appears, and for how long [s]."""
        return [(float(k / self.rate), float(1 / self.rate)) for k in range(self.n_frames)]


@dataclass(frozen=True, slots=True)
class BuiltInSequence(FramesInALoop, VideoSource):
    """A video that is rendered in a format of choice.

    Attributes
    ----------
    format : SequenceFormat
        Size, length and rate.
    """

    format: SequenceFormat

    @property
    def n_frames(self) -> int:
        """How many frames there are."""
        return self.format.n_frames

    @property
    def field_of_view(self) -> float:
        """Angle that the width is to span for the viewer [deg]."""
        return self.format.field_of_view


def on_grid(pixel_values: ArrayLike) -> NDArray[np.uint16]:
    """Return pixel values in [0, 1], rounded to 10 bits, over the 16-bit range.

    >>> on_grid([0.0, 1 / 3, 1.0]).tolist()
    [0, 21845, 65535]
    """
    return codes_on_grid(np.rint(np.asarray(pixel_values) * np.float32(LEVELS)).astype(np.intp))


def codes_on_grid(codes: NDArray[np.integer[Any]]) -> NDArray[np.uint16]:
    """Return 10-bit codes over the 16-bit range.

    >>> codes_on_grid(np.array([0, 341, 1023])).tolist()
    [0, 21845, 65535]
    """
    return np.asarray(_GRID[codes])


# Whole-number arithmetic, as in the reader of files: the same values come back.
_GRID = ((np.arange(LEVELS + 1) * 65535 + LEVELS // 2) // LEVELS).astype(np.uint16)

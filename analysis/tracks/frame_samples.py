"""A few frames of a video, evenly spread, kept while it streams past."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame

MEMORY = 200_000_000  # bytes of frames held at most, but for the least count


@dataclass(slots=True)
class FrameSamples:
    """Frames held: whenever there are too many, every second one is let go and the stride doubles.

    So at any time between half of `most` and `most` evenly spread frames are held, whatever the length.

    >>> import numpy as np
    >>> samples = FrameSamples(most=4)
    >>> frame = Frame(0.0, 0.04, np.zeros((8, 8, 3), np.uint8))
    >>> _ = list(samples.watch([frame] * 11))
    >>> [index for index, _ in samples.held]
    [0, 4, 8]
    """

    most: int = 16
    least: int = 4
    stride: int = 1
    held: list[tuple[int, NDArray[Any]]] = field(default_factory=list)

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield the frames unchanged, keeping some of them."""
        for index, frame in enumerate(frames):
            if index % self.stride == 0:
                self.held.append((index, frame.pixel_values.copy()))  # its source may fill it again
                limit = max(self.least, min(self.most, MEMORY // max(frame.pixel_values.nbytes, 1)))
                if len(self.held) > limit:
                    self.stride *= 2
                    self.held = [kept for kept in self.held if kept[0] % self.stride == 0]
            yield frame

"""A few frames of a video, kept while it streams past, and small pictures of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.luminance import unit_pixel_values

MEMORY = 200_000_000  # bytes of frames held at most, but for the least count
Image = NDArray[np.uint8]
SCREEN_GAMMA = 2.2  # of the reader's screen: a picture dimmed by b has its pixel values scaled by b^(1/2.2)


@dataclass(slots=True)
class FrameSamples:
    """Frames held: whenever there are too many, every second one is dropped and the stride doubles.

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


def thumbnails_of(
    samples: Sequence[tuple[int, NDArray[Any]]], count: int = 6, width: int = 320
) -> tuple[tuple[int, Image], ...]:
    """Return small pictures of some sampled frames, evenly spread.

    Parameters
    ----------
    samples : sequence of (int, array (height, width, 3))
        Indices and pixel values of frames, as `FrameSamples.held`.
    count, width : int
        How many pictures, and their least width [pixels].

    >>> frame = np.zeros((2, 2, 3), np.uint8)
    >>> [index for index, _ in thumbnails_of([(4 * k, frame) for k in range(12)], count=3)]
    [8, 24, 40]
    """
    n = len(samples)
    count = min(count, n)
    chosen = ((2 * k + 1) * n // (2 * count) for k in range(count))
    return tuple((samples[k][0], small_picture(samples[k][1], width)) for k in chosen)


def small_picture(pixel_values: NDArray[Any], width: int = 320) -> Image:
    """Return a frame as a small picture: pixels averaged in squares, so that it is at least `width` wide.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        As in `Frame`; a frame narrower than twice `width` keeps its size.
    width : int
        Its least width [pixels].
    """
    high, wide = pixel_values.shape[:2]
    across = max(1, wide // width)
    down = min(across, high)
    rows, columns = high // down, wide // across
    part = unit_pixel_values(pixel_values[: rows * down, : columns * across])
    mean = part.reshape(rows, down, columns, across, 3).mean(axis=(1, 3))
    return np.asarray(np.round(255 * mean), dtype=np.uint8)


def dimmed_picture(picture: Image, factor: float) -> Image:
    """Return a picture as it looks dimmed by b, on the reader's screen.

    >>> dimmed_picture(np.full((1, 1, 3), 255, np.uint8), 0.5 ** 2.2).tolist()
    [[[128, 128, 128]]]
    """
    return np.asarray(np.round(picture * factor ** (1 / SCREEN_GAMMA)), dtype=np.uint8)

"""A few frames of a video, kept while it streams past, and small pictures of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.luminance import unit_pixel_values

MEMORY = 200_000_000  # bytes of frames held at most, but for the least count
THUMBNAIL = 320  # [pixels] wide at least
Image = NDArray[np.uint8]
SCREEN_GAMMA = 2.2  # of the reader's screen: a picture dimmed by b has its pixel values scaled by b^(1/2.2)


@dataclass(slots=True)
class FrameSamples:
    """Frames held: whenever there are too many, every second one is dropped and the stride doubles.

    So between half of `most` and `most` evenly spread frames are held, whatever the length.

    >>> import numpy as np
    >>> samples = FrameSamples(most=4)
    >>> frame = Frame(0.0, 0.04, np.zeros((8, 8, 3), np.uint8))
    >>> _ = list(samples.watch([frame] * 11))
    >>> [index for index, _ in samples.held]
    [0, 4, 8]
    """

    most: int = 32
    least: int = 4
    stride: int = 1
    held: list[tuple[int, NDArray[Any]]] = field(default_factory=list)

    @property
    def few(self) -> list[tuple[int, NDArray[Any]]]:
        """All of them, or every second one: at most 16, for what takes long or is drawn."""
        return self.held[:: 2 if len(self.held) > 16 else 1]

    def watch(self, frames: Iterable[Frame], n_frames: int | None = None) -> Iterator[Frame]:
        """Yield the frames unchanged, keeping some.

        With their number, `n_frames`, none is kept that would not stay; if fewer come, fewer are held.
        """
        for index, frame in enumerate(frames):
            if index == 0:
                self._spread(frame, n_frames or 0)
            if index % self.stride == 0:
                self.held.append((index, frame.pixel_values.copy()))  # its source may fill it again
                if len(self.held) > self._limit(frame):
                    self.stride *= 2
                    self.held = [kept for kept in self.held if kept[0] % self.stride == 0]
            yield frame

    def take(
        self, first: Frame, frames_at: Callable[[Sequence[int]], Iterable[Frame]], n_frames: int
    ) -> None:
        """Hold the frames that would be held after watching all of a video, without watching it."""
        self._spread(first, n_frames)
        numbers = range(0, n_frames, self.stride)
        found = zip(numbers, frames_at(numbers), strict=True)
        self.held = [(number, frame.pixel_values.copy()) for number, frame in found]

    def _spread(self, first: Frame, n_frames: int) -> None:
        while -(-n_frames // self.stride) > self._limit(first):
            self.stride *= 2

    def _limit(self, frame: Frame) -> int:
        return max(self.least, min(self.most, MEMORY // max(frame.pixel_values.nbytes, 1)))


def thumbnails_of(samples: Sequence[tuple[int, NDArray[Any]]], count: int) -> tuple[tuple[int, Image], ...]:
    """Return small pictures of some sampled frames (as `FrameSamples.held`), evenly spread.

    >>> frame = np.zeros((2, 2, 3), np.uint8)
    >>> [index for index, _ in thumbnails_of([(4 * k, frame) for k in range(12)], count=3)]
    [8, 24, 40]
    """
    n = len(samples)
    count = min(count, n)
    chosen = ((2 * k + 1) * n // (2 * count) for k in range(count))
    return tuple((samples[k][0], small_picture(samples[k][1], THUMBNAIL)) for k in chosen)


def small_picture(pixel_values: NDArray[Any], width: int) -> Image:
    """Return a frame as a small picture: pixels averaged in squares, so that it is at least `width` wide."""
    mean = square_means(pixel_values, max(1, pixel_values.shape[1] // width), unit_pixel_values)
    return np.asarray(np.round(255 * mean), dtype=np.uint8)


def square_means(
    pixel_values: NDArray[Any], across: int, values: Callable[[NDArray[Any]], NDArray[Any]]
) -> Array:
    """Return the means of values of a frame over squares of so many pixels, a row of squares at a time.

    A frame that is lower than a square is one row of them.
    """
    high, wide = pixel_values.shape[:2]
    down = min(across, high)
    rows, columns = high // down, wide // across
    means = np.empty((rows, columns, 3))
    for k in range(rows):
        part = values(pixel_values[k * down : (k + 1) * down, : columns * across])
        means[k] = part.reshape(down, columns, across, 3).mean(axis=(0, 2))
    return means


def dimmed_picture(picture: Image, factor: float) -> Image:
    """Return a picture as it looks dimmed by b, on the reader's screen.

    >>> dimmed_picture(np.full((1, 1, 3), 255, np.uint8), 0.5 ** 2.2).tolist()
    [[[128, 128, 128]]]
    """
    return np.asarray(np.round(picture * factor ** (1 / SCREEN_GAMMA)), dtype=np.uint8)

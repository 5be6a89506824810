"""Large arrays that are filled again and again: fresh memory can cost more than the work done on it."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class SpareArrays:
    """Arrays that were given back, to be filled anew; any thread may take and give.

    The system hands out memory page by page, at its first touch: for the luminance of a 1080p frame that can
    take milliseconds. So there are as many arrays as were ever in use at a time, and no more.

    >>> spare = SpareArrays()
    >>> first = spare.take((2, 3), np.float32)
    >>> spare.give_back(first)
    >>> spare.take((2, 3), np.float32) is first
    True
    """

    def __init__(self) -> None:
        self._held: defaultdict[tuple[tuple[int, ...], np.dtype[Any]], list[NDArray[Any]]] = defaultdict(list)

    def take(self, shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
        """Return an array of a shape and type, whatever it holds."""
        try:
            return self._held[shape, np.dtype(kind)].pop()
        except IndexError:
            return np.empty(shape, kind)

    def give_back(self, array: NDArray[Any]) -> None:
        """Let an array be filled by whoever takes one next."""
        self._held[array.shape, array.dtype].append(array)

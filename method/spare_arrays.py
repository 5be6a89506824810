"""Large arrays that are filled again and again: fresh memory can cost more than the work done on it."""

from __future__ import annotations

import threading
from collections import Counter, defaultdict
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

_Kind = tuple[tuple[int, ...], np.dtype[Any]]  # shape and type of an array


class SpareArrays:
    """Arrays that were given back, to be filled anew; any thread may take and give.

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
        """Let an array be filled by whoever takes one next."""
        given = array.shape, array.dtype
        with self._one_at_a_time:
            if self._out[given] > 0:
                self._out[given] -= 1
                self._held[given].append(array)

    @property
    def held(self) -> int:
        """How many arrays wait to be filled anew."""
        with self._one_at_a_time:
            return sum(map(len, self._held.values()))

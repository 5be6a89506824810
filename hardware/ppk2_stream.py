"""What a PPK2 streams: 100 000 words a second, checked by their counter, and averaged to the rate asked for.

A word of 32 bits, least significant byte first: bits 0-13 the converter, 14-16 the measuring range, 18-23 a
counter, 24-31 the digital inputs D0 to D7. The counter's place is Nordic's application's, and was not
confirmed on a device.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

RAW_RATE = 100_000  # [Hz]
WORD = 4  # bytes
CONVERTER_MASK = 0x3FFF
RANGE_SHIFT, RANGE_MASK, RANGES = 14, 0x7, 5
COUNTER_SHIFT, COUNTER_SIZE = 18, 64
LOGIC_SHIFT = 24
LOOK_AHEAD = 4  # words that must follow on after a jump of the counter, or it was no loss
FULLEST = 0.5  # share of its words that an average needs


class OutOfStepError(ValueError):
    """The bytes that came are no words of a PPK2, or not from their beginning."""


@dataclass(frozen=True, slots=True)
class Average:
    """The mean of some neighbouring words.

    Attributes
    ----------
    index : int
        Which it is, from 0.
    current : float
        Mean [A].
    sync : bool
        Level of D0 at its end.
    """

    index: int
    current: float
    sync: bool


class WordStream:
    """Makes words of bytes, and finds by the counter which were lost.

    A jump of the counter is a loss only where the words after it follow on; else bytes are missing, and what
    comes is not read right any more. The last words of each lot are kept until it is known.
    """

    def __init__(self) -> None:
        import numpy as np

        self._rest = b""
        self._held = np.empty(0, dtype="<u4")
        self._last_counter: int | None = None
        self._last_place = -1
        self.n_lost = 0

    def take(self, data: bytes, *, is_last: bool = False) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """Return the words that are sure, and the place of each in the instrument's own count, from 0.

        Parameters
        ----------
        data : bytes
            What came.
        is_last : bool, optional
            Whether no more will come.

        Raises
        ------
        OutOfStepError
            If bytes are missing, or what came is from no PPK2.
        """
        import numpy as np

        data = self._rest + data
        whole = len(data) // WORD * WORD
        self._rest = data[whole:]
        words = np.concatenate([self._held, np.frombuffer(data[:whole], dtype="<u4")])
        steps = self._steps(words)
        jumps = np.flatnonzero(steps != 1)
        if np.any(np.diff(jumps) <= LOOK_AHEAD) or np.any((words >> RANGE_SHIFT & RANGE_MASK) >= RANGES):
            raise OutOfStepError("its counter does not count, so bytes were lost on the way")
        sure = len(words) if is_last else max(len(words) - LOOK_AHEAD, 0)
        if is_last and len(jumps) and jumps[-1] > len(words) - 1 - LOOK_AHEAD:
            sure = int(jumps[-1])  # nothing can follow that would tell a loss from nonsense
        self._held = words[sure:]
        return self._placed(words[:sure], steps[:sure])

    def length(self) -> int:
        """Return how many words the instrument has counted so far, the lost ones among them."""
        return self._last_place + 1

    def _steps(self, words: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return by how much the counter went on to each word: 1, or more where some were lost."""
        import numpy as np

        counters = (words >> COUNTER_SHIFT).astype(np.int64) % COUNTER_SIZE
        if not len(counters):
            return counters
        before = counters[0] - 1 if self._last_counter is None else self._last_counter
        return (np.diff(counters, prepend=before) - 1) % COUNTER_SIZE + 1

    def _placed(
        self, words: NDArray[np.uint32], steps: NDArray[np.int64]
    ) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """Return words and their places, and remember where they ended."""
        places = self._last_place + steps.cumsum()
        if len(words):
            self._last_counter = int(words[-1] >> COUNTER_SHIFT) % COUNTER_SIZE
            self._last_place = int(places[-1])
            self.n_lost += int(steps.sum()) - len(steps)
        return words, places


class Averages:
    """Averages neighbouring words.

    Parameters
    ----------
    width : int
        How many make one average, the lost ones counted.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._index, self._sum, self._count, self._sync = 0, 0.0, 0, False

    def take(
        self, places: NDArray[np.int64], currents: NDArray[np.float64], sync: NDArray[np.bool_]
    ) -> list[Average]:
        """Return the averages that are complete; one that lost more than half of its words is left out.

        Parameters
        ----------
        places : numpy.ndarray of int
            Place of each word in the instrument's count, rising.
        currents : numpy.ndarray of float
            Their currents [A].
        sync : numpy.ndarray of bool
            Their levels of D0.
        """
        import numpy as np

        indices = places // self._width
        edges = np.flatnonzero(np.diff(indices, prepend=-1, append=-1))
        complete: list[Average] = []
        for start, end in itertools.pairwise(edges):
            if indices[start] != self._index:
                complete += self._finished()
                self._index, self._sum, self._count = int(indices[start]), 0.0, 0
            self._sum += float(currents[start:end].sum())
            self._count += int(end - start)
            self._sync = bool(sync[end - 1])
        return complete

    def _finished(self) -> list[Average]:
        """Return the average that is complete, if it holds enough."""
        if self._count < FULLEST * self._width:
            return []
        return [Average(self._index, self._sum / self._count, self._sync)]

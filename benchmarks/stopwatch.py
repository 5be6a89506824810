"""Times of several approaches, taken in turn: what else the machine does falls on all of them alike."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array


@dataclass(frozen=True, slots=True)
class Times:
    """Times of one approach.

    Attributes
    ----------
    wall, processor : array, (repeats,)
        Wall time, and processor time over all threads, of each run [s].
    ratio : array, (repeats,)
        Wall time of each run to that of the first approach in the same turn.
    """

    wall: Array
    processor: Array
    ratio: Array

    @property
    def quartiles(self) -> tuple[float, float, float]:
        """Lower quartile, median and upper quartile of the wall time [s]."""
        low, middle, high = (float(q) for q in np.quantile(self.wall, [0.25, 0.5, 0.75]))
        return low, middle, high


def timed_in_turn(approaches: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, Times]:
    """Return the times of approaches, run one after the other in each of several turns.

    A first turn is not counted: it compiles, fills caches and touches memory.

    Parameters
    ----------
    approaches : mapping of str to function
        By name; ratios are to the first.
    repeats : int
        Turns that count, at least 1.
    """
    wall = np.empty((repeats, len(approaches)))
    processor = np.empty_like(wall)
    with _without_the_garbage_of_others():
        for turn in range(-1, repeats):
            for k, run in enumerate(approaches.values()):
                gc.collect()
                began, used = time.perf_counter(), time.process_time()
                run()
                if turn >= 0:
                    wall[turn, k] = time.perf_counter() - began
                    processor[turn, k] = time.process_time() - used
    ratio = wall / wall[:, :1]
    return {name: Times(wall[:, k], processor[:, k], ratio[:, k]) for k, name in enumerate(approaches)}


@contextmanager
def _without_the_garbage_of_others() -> Iterator[None]:
    """Let the search for garbage pass over all that was there before: its time grows with their number."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()

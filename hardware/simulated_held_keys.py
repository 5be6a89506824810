"""Keys that a program holds down for some time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager


class SimulatedHeldKeys(AbstractContextManager["SimulatedHeldKeys"]):
    """Keys that are down from one time to another.

    Parameters
    ----------
    clock : callable
        The window's clock [s].
    holds : sequence of (str, float, float)
        Name of a key, from when, and until when it is down [s].

    >>> keys = SimulatedHeldKeys(lambda: 0.5, [("w", 0.0, 1.0), ("d", 1.0, 2.0)])
    >>> sorted(keys.held())
    ['w']
    """

    def __init__(self, clock: Callable[[], float], holds: Sequence[tuple[str, float, float]] = ()) -> None:
        self._clock, self._holds = clock, holds

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are down now."""
        now = self._clock()
        return frozenset(name for name, begin, end in self._holds if begin <= now < end)

    def close(self) -> None:
        """Let go of the device."""

    def __exit__(self, *_: object) -> None:
        self.close()

"""A pointer that nobody moves: movements are queued, and become due as the clock goes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager


class SimulatedPointer(AbstractContextManager["SimulatedPointer"]):
    """A mouse that is moved by a program.

    Parameters
    ----------
    clock : callable
        The window's clock [s].

    >>> time = [0.0]
    >>> pointer = SimulatedPointer(lambda: time[0])
    >>> pointer.queue(right=30.0, up=-4.0, delay=0.5)
    >>> pointer.moved()
    (0.0, 0.0)
    >>> time[0] = 0.6
    >>> pointer.moved(), pointer.moved()
    ((30.0, -4.0), (0.0, 0.0))
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._movements: list[tuple[float, float, float]] = []

    def queue(self, right: float, up: float, delay: float) -> None:
        """Move by some pixels, to the right and up, some time from now [s]."""
        self._movements.append((self._clock() + delay, right, up))

    def moved(self) -> tuple[float, float]:
        """Return how far it moved since the last call, to the right and up [pixels]; return at once."""
        now = self._clock()
        due = [movement for movement in self._movements if movement[0] <= now]
        self._movements = [movement for movement in self._movements if movement[0] > now]
        return sum((right for _, right, _ in due), 0.0), sum((up for _, _, up in due), 0.0)

    def close(self) -> None:
        """Let go of the device."""

    def __exit__(self, *_: object) -> None:
        self.close()

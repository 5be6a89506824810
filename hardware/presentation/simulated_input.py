"""Keyboard and held keys of a program: what is queued becomes due as the clock goes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from evenlight.hardware.protocols import ContextDevice, KeyPress


class SimulatedKeyboard(ContextDevice):
    """Keys that are pressed by a program.

    Parameters
    ----------
    clock : callable
        The window's clock [s].

    >>> from evenlight.hardware.simulated.clocks import RefreshClock
    >>> clock = RefreshClock(10.0)
    >>> keyboard = SimulatedKeyboard(clock.now)
    >>> keyboard.queue("y", delay=0.15)
    >>> keyboard.pressed(), clock.advance(2), keyboard.pressed()
    ([], 0.2, [KeyPress(name='y', time=0.15)])
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._presses: list[KeyPress] = []

    def queue(self, name: str, delay: float) -> None:
        """Press a key some time from now [s]; above 0, for what is pressed before a question is no answer."""
        if not delay > 0:
            raise ValueError(f"delay must be above 0 s, got {delay:g}")
        self._presses.append(KeyPress(name, self._clock() + delay))
        self._presses.sort(key=lambda press: press.time)

    def waiting(self) -> int:
        """Return how many presses are still to come, or to be taken."""
        return len(self._presses)

    def pressed(self) -> list[KeyPress]:
        """Return the keys pressed since the last call, in order; return at once."""
        now = self._clock()
        due = [press for press in self._presses if press.time <= now]
        self._presses = self._presses[len(due) :]
        return due

    def clear(self) -> None:
        """Forget what was pressed until now; what is queued for later stays."""
        self.pressed()

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""
        return {"keyboard": "simulated"}


class SimulatedHeldKeys(ContextDevice):
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

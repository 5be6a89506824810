"""Commanded against achieved brightness, with times: a backlight that remembers how it was set."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager

from evenlight.data_schema.power_log import BacklightSetting
from evenlight.hardware.protocols import Backlight

KEPT = 10_000  # settings; at 50 a second, more than three minutes


class LoggedBacklight(AbstractContextManager["LoggedBacklight"]):
    """A backlight whose settings are kept: what was asked for, what was achieved, and when.

    Parameters
    ----------
    inner : Backlight
        The device; it is closed with this.
    clock : callable
        Of the times [s].
    sink : callable, optional
        Is told each setting as it is made: a file's writer.
    kept : int, optional
        How many of the last settings are remembered.

    >>> from evenlight.hardware.backlights import SimulatedBacklight
    >>> backlight = LoggedBacklight(SimulatedBacklight(lambda: 0.0, steps=100), lambda: 0.0)
    >>> backlight.set_factor(0.503)
    0.5
    >>> backlight.settings()
    [BacklightSetting(begun=0.0, ended=0.0, commanded=0.503, achieved=0.5)]
    """

    def __init__(
        self,
        inner: Backlight,
        clock: Callable[[], float],
        sink: Callable[[BacklightSetting], None] | None = None,
        kept: int = KEPT,
    ) -> None:
        self._inner, self._clock, self._sink = inner, clock, sink
        self._settings: deque[BacklightSetting] = deque(maxlen=kept)

    def settings(self) -> list[BacklightSetting]:
        """Return the last settings, in order."""
        return list(self._settings)

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such factor, or refuses; that is kept, too.
        """
        begun, achieved = self._clock(), None
        try:
            achieved = self._inner.set_factor(factor)
        finally:
            setting = BacklightSetting(begun, self._clock(), factor, achieved)
            self._settings.append(setting)
            if self._sink is not None:
                self._sink(setting)
        return achieved

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        return self._inner.read_factor()

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return self._inner.smallest_factor()

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return self._inner.step()

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._inner.min_interval()

    def close(self) -> None:
        """Leave the device as it was found; more than once does nothing."""
        self._inner.close()

    def __exit__(self, *_: object) -> None:
        self.close()

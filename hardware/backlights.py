"""What backlights share: equal steps, the refusal of factors, a log of settings, leaving a device as found.

Where pixels make the brightness there is no backlight, and no device is opened.
"""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections import deque
from collections.abc import Callable

from evenlight.data_schema.recordings.instrument_logs import BacklightSetting
from evenlight.hardware.protocols import Backlight, ContextDevice, Fault, InstrumentError

ROUNDING = 1e-9  # of a factor that was computed
REMEMBERED = 10_000  # settings; at 50 a second, more than three minutes


class SteppedBacklight(ContextDevice):
    """A backlight of equal steps above 0; each driver says how a step is set and read."""

    _steps: int  # above 0: the highest is the full backlight
    _found: int  # the step that it was found at, and is left at
    _min_interval: float  # shortest time between two settings [s]

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such factor, refuses, or reports another step afterwards.
        """
        self._require_open()
        require_factor(factor, self.smallest_factor(), self._name)
        step = max(1, round(factor * self._steps))
        self._set(step)
        return step / self._steps

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        self._require_open()
        return self._possible(self._read_step()) / self._steps

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return 1 / self._steps

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return 1 / self._steps

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._min_interval

    def close(self) -> None:
        """Leave the device as it was found; more than once does nothing.

        Raises
        ------
        InstrumentError
            If it cannot be left so, unless another exception is under way.
        """
        if not self._closed:
            self._closed = True
            restore_and_release(lambda: self._set(self._found), self._release)

    def _possible(self, step: int) -> int:
        if not 0 <= step <= self._steps:
            raise self._error(f"reports step {step}; it has 0 to {self._steps}", Fault.IMPLAUSIBLE)
        return step

    @abstractmethod
    def _set(self, step: int) -> None:
        """Set the device to a step, and check that it has taken it."""

    def _read_step(self) -> int:
        """Return the step that the device reports."""
        raise NotImplementedError  # where `read_factor` is the device's own

    def _release(self) -> None:
        """Let go of the device."""
        return


class WrappedBacklight(ContextDevice):
    """A backlight around another one, which it is closed with.

    Parameters
    ----------
    inner : Backlight
        The device.
    """

    def __init__(self, inner: Backlight) -> None:
        self._inner = inner

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device."""
        return self._inner.set_factor(factor)

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


class LoggedBacklight(WrappedBacklight):
    """A backlight whose settings are kept: what was asked for, what was achieved, and when.

    Parameters
    ----------
    inner : Backlight
        The device; it is closed with this.
    clock : callable
        Of the times [s].
    sink : callable, optional
        Is called with each setting as it is made: a file's writer.
    kept : int, optional
        How many of the last settings are remembered.

    >>> from evenlight.hardware.simulated.panel import SimulatedBacklight
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
        kept: int = REMEMBERED,
    ) -> None:
        super().__init__(inner)
        self._clock, self._sink = clock, sink
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


def require_factor(factor: float, smallest: float, device: str) -> None:
    """Refuse a brightness factor that a backlight does not have; nothing is clipped."""
    if not smallest - ROUNDING <= factor <= 1 + ROUNDING:
        raise InstrumentError(f"{device}: has factors from {smallest:.4g} to 1, got {factor:.6g}")


def restore_and_release(restore: Callable[[], object], release: Callable[[], None]) -> None:
    """Put a device back to how it was found, and let go of it in any case.

    A device that cannot be put back stands where no one expects it, so that is an error once all is released.
    But where another exception is under way already, that one is raised, and this one becomes a note of it.
    A caller in `finally`, `with` or a stack of callbacks need not distinguish the two.

    Parameters
    ----------
    restore : callable
        Puts the device back.
    release : callable
        Lets go of it.

    Raises
    ------
    InstrumentError
        If the device cannot be put back, and no exception is being handled.

    >>> restore_and_release(lambda: print("back to full"), lambda: print("closed"))
    back to full
    closed
    """
    under_way = sys.exception()
    try:
        restore()
    except InstrumentError as error:
        if under_way is None:
            raise
        under_way.add_note(f"And it could not be left as it was found: {error}")
    finally:
        release()

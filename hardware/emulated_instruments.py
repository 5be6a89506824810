"""Drivers on emulated instruments, as one device each: closing it closes the link, too."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any, Generic, Self, TypeVar, cast

from evenlight.data_schema.power_log import ClockPing, PowerSample
from evenlight.hardware.protocols import Backlight, LuminanceMeter, PowerMeter, Reading, ZeroedMeter

NOTE = {"instrument": "SIMULATED: the driver on an emulated instrument"}


Driver = TypeVar("Driver", bound=LuminanceMeter | PowerMeter | Backlight)


class _Emulated(Generic[Driver]):
    """A driver on an emulated device.

    Parameters
    ----------
    driver : LuminanceMeter, PowerMeter or Backlight
        The driver, open.
    link : context manager
        To the emulated device, open.
    """

    def __init__(self, driver: Driver, link: AbstractContextManager[Any]) -> None:
        self._driver, self._link = driver, _Once(link)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close driver and link; more than once does nothing."""
        with self._link:
            self._driver.close()


class _EmulatedMeter(_Emulated[Driver]):
    """A driver of a meter on an emulated one."""

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself, and that it is none."""
        return cast("LuminanceMeter | PowerMeter", self._driver).apparatus() | NOTE

    def zero(self) -> float | None:
        """Set the zero, of a driver that does."""
        return cast("ZeroedMeter", self._driver).zero()


class EmulatedLuminanceMeter(_EmulatedMeter[LuminanceMeter]):
    """A driver of a luminance meter on an emulated one."""

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]."""
        return self._driver.read_luminance()


class EmulatedPowerMeter(_EmulatedMeter[PowerMeter]):
    """A driver of a power meter on an emulated one."""

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved."""
        return self._driver.start(rate)

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once."""
        return self._driver.samples()

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        return self._driver.stop()

    def ping(self) -> ClockPing | None:
        """Return one comparison of the instrument's clock with the computer's."""
        return self._driver.ping()


class EmulatedBacklight(_Emulated[Backlight]):
    """A driver of a backlight on an emulated one; closing it leaves the device as it was found."""

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device."""
        return self._driver.set_factor(factor)

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        return self._driver.read_factor()

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return self._driver.smallest_factor()

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return self._driver.step()

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._driver.min_interval()


class _Once(AbstractContextManager[None]):
    """A context that is left once, however often it is asked to."""

    def __init__(self, context: AbstractContextManager[Any]) -> None:
        self._context: AbstractContextManager[Any] | None = context

    def __exit__(self, *_: object) -> None:
        context, self._context = self._context, None
        if context is not None:
            context.__exit__(None, None, None)

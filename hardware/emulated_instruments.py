"""Drivers on emulated instruments, as one device each: closing it closes the link, too."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any, Self, cast

from data_schema.power_log import ClockPing, PowerSample
from hardware.protocols import Backlight, LuminanceMeter, PowerMeter, Reading, ZeroedMeter

NOTE = {"instrument": "SIMULATED: the driver on an emulated instrument"}


class EmulatedLuminanceMeter:
    """A driver of a luminance meter on an emulated one.

    Parameters
    ----------
    meter : LuminanceMeter
        The driver, open.
    link : context manager
        To the emulated instrument, open.
    """

    def __init__(self, meter: LuminanceMeter, link: AbstractContextManager[Any]) -> None:
        self._meter, self._link = meter, _Once(link)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]."""
        return self._meter.read_luminance()

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself, and that it is none."""
        return self._meter.apparatus() | NOTE

    def zero(self) -> float | None:
        """Set the zero, of a driver that does."""
        return cast("ZeroedMeter", self._meter).zero()

    def close(self) -> None:
        """Close driver and link; more than once does nothing."""
        with self._link:
            self._meter.close()


class EmulatedPowerMeter:
    """A driver of a power meter on an emulated one.

    Parameters
    ----------
    meter : PowerMeter
        The driver, open.
    link : context manager
        To the emulated instrument, open.
    """

    def __init__(self, meter: PowerMeter, link: AbstractContextManager[Any]) -> None:
        self._meter, self._link = meter, _Once(link)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved."""
        return self._meter.start(rate)

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once."""
        return self._meter.samples()

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        return self._meter.stop()

    def ping(self) -> ClockPing | None:
        """Return one comparison of the instrument's clock with the computer's."""
        return self._meter.ping()

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself, and that it is none."""
        return self._meter.apparatus() | NOTE

    def zero(self) -> float | None:
        """Set the zero, of a driver that does."""
        return cast("ZeroedMeter", self._meter).zero()

    def close(self) -> None:
        """Close driver and link; more than once does nothing."""
        with self._link:
            self._meter.close()


class EmulatedBacklight:
    """A driver of a backlight on an emulated one.

    Parameters
    ----------
    backlight : Backlight
        The driver, open.
    link : context manager
        To the emulated device, open.
    """

    def __init__(self, backlight: Backlight, link: AbstractContextManager[Any]) -> None:
        self._backlight, self._link = backlight, _Once(link)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device."""
        return self._backlight.set_factor(factor)

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        return self._backlight.read_factor()

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return self._backlight.smallest_factor()

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return self._backlight.step()

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._backlight.min_interval()

    def close(self) -> None:
        """Leave the device as it was found, close driver and link; more than once does nothing."""
        with self._link:
            self._backlight.close()


class _Once(AbstractContextManager[None]):
    """A context that is left once, however often it is asked to."""

    def __init__(self, context: AbstractContextManager[Any]) -> None:
        self._context: AbstractContextManager[Any] | None = context

    def __exit__(self, *_: object) -> None:
        context, self._context = self._context, None
        if context is not None:
            context.__exit__(None, None, None)

"""Drivers on emulated instruments, as one device each: closing it closes the link, too.

A board that is both power meter and backlight is opened once for a panel, and shared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any, Generic, TypeVar, cast
from weakref import WeakValueDictionary

from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.backlights import WrappedBacklight
from evenlight.hardware.drivers.board_link import PowerBoard
from evenlight.hardware.emulators.link import EmulatedLink
from evenlight.hardware.emulators.power_board import PowerBoardEmulator
from evenlight.hardware.protocols import (
    Backlight,
    ContextDevice,
    LuminanceMeter,
    PowerMeter,
    Reading,
    ZeroedMeter,
)
from evenlight.hardware.simulated.panel import SimulatedPanel, Simulation

# One emulated board for each panel; it is forgotten with the last device that uses it.
_boards_on_panels: WeakValueDictionary[int, EmulatedBoard] = WeakValueDictionary()
NOTE = {"instrument": "SIMULATED: the driver on an emulated instrument"}


Driver = TypeVar("Driver", bound=LuminanceMeter | PowerMeter | Backlight)


class _Emulated(ContextDevice, Generic[Driver]):
    """A driver on an emulated device, both open; closing it closes the link, too."""

    def __init__(self, driver: Driver, link: AbstractContextManager[Any]) -> None:
        self._inner, self._link = driver, link

    def close(self) -> None:
        """Close driver and link; more than once does nothing."""
        if not self._closed:
            self._closed = True
            with self._link:
                self._inner.close()


class _EmulatedMeter(_Emulated[Driver]):
    """A driver of a meter on an emulated one."""

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself, and that it is none."""
        return cast("LuminanceMeter | PowerMeter", self._inner).apparatus() | NOTE

    def zero(self) -> float | None:
        """Set the zero, of a driver that does."""
        return cast("ZeroedMeter", self._inner).zero()


class EmulatedLuminanceMeter(_EmulatedMeter[LuminanceMeter]):
    """A driver of a luminance meter on an emulated one."""

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]."""
        return self._inner.read_luminance()


class EmulatedPowerMeter(_EmulatedMeter[PowerMeter]):
    """A driver of a power meter on an emulated one."""

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved."""
        return self._inner.start(rate)

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once."""
        return self._inner.samples()

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        return self._inner.stop()

    def ping(self) -> ClockPing | None:
        """Return one comparison of the instrument's clock with the computer's."""
        return self._inner.ping()


class EmulatedBacklight(_Emulated[Backlight], WrappedBacklight):
    """A driver of a backlight on an emulated one; closing it leaves the device as it was found."""


class EmulatedBoard(PowerBoard):
    """A board on an emulated one, whose link is closed with it.

    Parameters
    ----------
    simulation : Simulation
        What the board measures and dims.
    clock : callable
        For the times at which lines arrive [s].
    """

    def __init__(self, simulation: Simulation, clock: Callable[[], float]) -> None:
        self.panel: SimulatedPanel = simulation.panel  # kept, so that no other has its identity meanwhile
        self._to_emulator = EmulatedLink(PowerBoardEmulator(simulation), pseudo_terminal=True)
        try:
            super().__init__(self._to_emulator.url, clock)
        except BaseException:
            self._to_emulator.unplug()
            raise

    def close(self) -> None:
        """Close the port and the link to the emulated board; more than once does nothing."""
        super().close()
        self._to_emulator.unplug()


def emulated_board(simulation: Simulation, clock: Callable[[], float]) -> PowerBoard:
    """Return the emulated board on a panel: the one that is open already, or else a new one."""
    board = _boards_on_panels.get(id(simulation.panel))
    if board is None or not board.is_open():
        board = EmulatedBoard(simulation, clock)
        _boards_on_panels[id(simulation.panel)] = board
    return board

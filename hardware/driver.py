"""What a driver is: where it is, what it drives, how it is tried; and what the name of an instrument says.

Which drivers there are: `hardware.driver_table`, and of packages `hardware.installed_drivers`.
"""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.arguments import flag, positive, text
from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from evenlight.hardware.simulated.panel import Simulation

SIMULATED = "simulated"  # by itself, an instrument in this process; before a driver's name, an emulated one
GONE = {"rapl": "it saw the processor and not the panel; battery: tells what the whole computer takes"}


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver: its class, and what `measure list` says of it.

    A package declares one for each instrument that it brings, in an entry point (docs/drivers.md).

    Attributes
    ----------
    place : type
        The class, of the arguments `address, clock, timeout=None`. Of Evenlight's own drivers its module and
        name in `evenlight.hardware`, "drivers.power_board:BoardPowerMeter"; empty where no device is opened.
    instrument, address, settings, note : str
        What it drives; the form of its address, which begins with its name ("ls100:PORT"); settings of line
        and instrument, and what else to know, in words.
    usb_ids : tuple of (int, int)
        Vendor and product numbers that the instrument has on USB, where they are known.
    emulator : callable, optional
        What a package tries it on: called with a `Simulation`, it returns a context that serves an emulated
        instrument and yields its address.
    needs_address : bool
        Whether the driver needs to know where the instrument is.
    sample_rate : float
        Of a power meter, where `measure power` is given no other [Hz].
    """

    place: str | type[Any]
    instrument: str = ""  # what it drives; a driver without it is not listed
    address: str = ""  # the form of its address, e.g. "ls100:PORT"
    settings: str = ""  # of the line and of the instrument, in words
    note: str = ""  # what else to know: an extra or a program to install, what is not confirmed
    # vendor and product numbers that the instrument has on USB, where they are known
    usb_ids: tuple[tuple[int, int], ...] = ()
    emulator: Callable[[Simulation], AbstractContextManager[str]] | None = None
    needs_address: bool = True  # whether the driver needs to know where the instrument is
    sample_rate: float = 100.0
    package: str = ""  # that it comes from, which is noted when it is found; empty for our own

    def __post_init__(self) -> None:
        if not isinstance(self.place, str | type):
            raise InputError(f"place must be a class, got {self.place!r}")
        for name in ("instrument", "address", "settings", "note", "package"):
            text(name, getattr(self, name))
        if not (self.emulator is None or callable(self.emulator)):
            raise InputError(f"emulator must be a function, got {self.emulator!r}")
        if not (isinstance(self.usb_ids, tuple) and all(isinstance(one, tuple) for one in self.usb_ids)):
            raise InputError(f"usb_ids must be pairs of numbers, got {self.usb_ids!r}")
        flag("needs_address", self.needs_address)
        positive("sample_rate", self.sample_rate)

    def load(self) -> Any:
        """Return the class of the driver."""
        return self.place if isinstance(self.place, type) else _named(self.place)

    def guarded(self) -> bool:
        """Return whether what the driver gives is another's, and checked: a package's or a program's."""
        return bool(self.package) or self.address.startswith("exec:")


def _named(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(f"evenlight.hardware.{module}"), name)


@dataclass(frozen=True, slots=True)
class NamedDriver:
    """What the name of an instrument says."""

    name: str  # of the driver
    driver: Driver  # where it is
    address: str  # of the instrument
    emulated: bool  # whether it is the emulated instrument that a package brings


def named_driver(name: str, drivers: Mapping[str, Driver], what: str) -> NamedDriver:
    """Return what the name of an instrument says.

    Parameters
    ----------
    name : str
        DRIVER:ADDRESS, or "simulated:DRIVER" for a package's driver on its emulated instrument.
    drivers : mapping of str to Driver
        What there is.
    what : str
        What kind of instrument they drive, as messages name it.

    Raises
    ------
    InputError
        If there is no such driver, or the name does not say where the instrument is.

    >>> from evenlight.hardware.driver_table import LUMINANCE_METERS
    >>> named_driver("ls100:COM3", LUMINANCE_METERS, "luminance meter").address
    'COM3'
    """
    driver, _, address = name.partition(":")
    emulated = driver == SIMULATED and bool(address)
    if emulated:
        driver, address = address, ""
    offered = [each for each in drivers if (drivers[each].emulator if emulated else drivers[each].place)]
    if emulated and driver in drivers and driver not in offered:
        raise InputError(f"{name}: {driver} brings no emulated instrument; `simulated` needs no device")
    if driver in GONE:
        raise InputError(f"{name.rstrip(':')}: there is no {what} {driver!r} any more: {GONE[driver]}")
    if driver not in offered:
        kind = f"emulated {what}" if emulated else what
        raise InputError(f"{name}: there is no {kind} {driver!r}; {_offer(driver, offered)}")
    if drivers[driver].needs_address and not (address or emulated):
        raise InputError(
            f"{name.rstrip(':')}: where is it? Give {driver}:ADDRESS; `evenlight measure list` shows its form"
        )
    return NamedDriver(driver, drivers[driver], address, emulated)


def own_simulation(clock: Callable[[], float]) -> Simulation:
    """Return something to look at for a simulated instrument that was handed nothing: a panel of its own."""
    import time

    import numpy as np

    from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

    return Simulation(SimulatedPanel(PanelPhysics(), clock), np.random.default_rng(1), clock, time.sleep)


def _offer(driver: str, drivers: Collection[str]) -> str:
    hint = difflib.get_close_matches(driver, drivers, n=1)
    return (f"did you mean {hint[0]!r}? There" if hint else "there") + f" is {', '.join(drivers)}"

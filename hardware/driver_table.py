"""Where a driver is and what stands in for its instrument: modules are imported when a device is opened."""

from __future__ import annotations

import difflib
import enum
import importlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from evenlight.hardware.simulated_panel import Simulation

SIMULATED = "simulated"  # by itself, an instrument in this process; before a driver's name, an emulated one


class LinkKind(enum.Enum):
    """How a driver reaches an emulated instrument."""

    SOCKET = "socket"  # a port of any setting
    TERMINAL = "terminal"  # a serial port of 8N1
    OWN = "own"  # the emulator is no dialogue, and makes what the driver opens


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver, and the emulated instrument that it can be tried on.

    Attributes
    ----------
    place : str
        Module and class, as "power_board:BoardPowerMeter" in `evenlight.hardware`.
    emulator : str
        Module and class of the emulated instrument; empty where there is none.
    link : LinkKind
        How the driver reaches that.
    address : str
        Of the emulated instrument, with `{url}` for what the link made, or `{host}` and `{port}` in it.
    on_link : str
        Module and function that open the driver on an emulated instrument, where its class does not.
    needs_address : bool
        Whether the driver has to be told where the instrument is.
    """

    place: str
    emulator: str = ""
    link: LinkKind = LinkKind.SOCKET
    address: str = "{url}"
    on_link: str = ""
    needs_address: bool = True

    def load(self) -> Any:
        """Return the class of the driver."""
        return _named(self.place)

    def load_emulator(self) -> Any:
        """Return the class of the emulated instrument."""
        return _named(self.emulator)

    def open_at(self, url: str, clock: Callable[[], float], timeout: float | None = None) -> Any:
        """Return the driver, opened at what the link to an emulated instrument made."""
        opener, where = _named(self.on_link or self.place), urlsplit(url)
        return opener(self.address.format(url=url, host=where.hostname, port=where.port), clock, timeout)

    def open_emulated(self, clock: Callable[[], float], simulation: Simulation) -> tuple[Any, Any]:
        """Return the driver on an emulated instrument, and the link between them; both are open."""
        from evenlight.hardware.emulators.link import EmulatedLink

        emulator = self.load_emulator()(simulation)
        if self.link is LinkKind.OWN:
            link = emulator
        else:
            link = EmulatedLink(emulator, pseudo_terminal=self.link is LinkKind.TERMINAL)
        try:
            return self.open_at(link.url, clock), link
        except BaseException:
            link.__exit__(None, None, None)
            raise


def _named(place: str) -> Any:
    """Return what a module of `evenlight.hardware` has under a name."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(f"evenlight.hardware.{module}"), name)


@dataclass(frozen=True, slots=True)
class NamedDriver:
    """What the name of an instrument says.

    Attributes
    ----------
    name : str
        Of the driver.
    driver : Driver
        Where it is.
    address : str
        Of the instrument.
    emulated : bool
        Whether the instrument is an emulated one.
    """

    name: str
    driver: Driver
    address: str
    emulated: bool


def named_driver(name: str, drivers: Mapping[str, Driver], what: str) -> NamedDriver:
    """Return what the name of an instrument says.

    Parameters
    ----------
    name : str
        DRIVER:ADDRESS, or "simulated:DRIVER".
    drivers : mapping of str to Driver
        What there is.
    what : str
        What kind of instrument they drive, as messages name it.

    Raises
    ------
    InputError
        If there is no such driver, or the name does not say where the instrument is.

    >>> meters = {"ls100": Driver("konica:Ls100", "emulators:Ls100")}
    >>> named_driver("ls100:COM3", meters, "luminance meter").address
    'COM3'
    >>> named_driver("simulated:ls100", meters, "luminance meter").emulated
    True
    """
    driver, _, address = name.partition(":")
    emulated = driver == SIMULATED and bool(address)
    if emulated:
        driver, address = address, ""
    offered = [each for each in drivers if not emulated or drivers[each].emulator]
    if driver not in offered:
        kind = f"emulated {what}" if emulated else what
        raise InputError(f"{name}: there is no {kind} {driver!r}; {_offer(driver, offered)}")
    if drivers[driver].needs_address and not (address or emulated):
        raise InputError(
            f"{name}: where is it? Give {driver}:ADDRESS; `evenlight measure list` shows its form"
        )
    return NamedDriver(driver, drivers[driver], address, emulated)


def own_simulation(clock: Callable[[], float]) -> Simulation:
    """Return something to look at for a simulated instrument that was handed nothing: a panel of its own."""
    import time

    import numpy as np

    from evenlight.hardware.simulated_panel import PanelPhysics, SimulatedPanel, Simulation

    return Simulation(SimulatedPanel(PanelPhysics(), clock), np.random.default_rng(1), clock, time.sleep)


def _offer(driver: str, drivers: Collection[str]) -> str:
    """Return what was meant perhaps, and what there is."""
    hint = difflib.get_close_matches(driver, drivers, n=1)
    return (f"did you mean {hint[0]!r}? " if hint else "") + f"There is {', '.join(drivers)}"

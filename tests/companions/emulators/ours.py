"""The emulated instrument of each of our drivers, and the drivers that a test opens on them by name.

To try a new driver: write its instrument's side (`receive(data)` returns what is answered, `stream()` what is
sent unasked), and add it to `OURS`. tests/conventions/test_drivers.py then tries all that drivers promise.
"""

from __future__ import annotations

import enum
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from emulators import device_power, luminance_meters, power_meters
from emulators.ddc_monitor import DdcOnLink, EmulatedMonitor
from emulators.link import EmulatedLink, FaultPlan
from emulators.power_board import PowerBoardEmulator
from emulators.program import EmulatedProgram
from emulators.spotread import EmulatedSpotread

from evenlight.hardware.driver import Driver
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.simulated.panel import Simulation

PROGRAM = shlex.join([sys.executable, "-I", "-S", str(Path(__file__).with_name("program.py"))])


class LinkKind(enum.Enum):
    """How a driver reaches an emulated instrument."""

    SOCKET = "socket"  # a port of any setting
    TERMINAL = "terminal"  # a serial port of 8N1
    OWN = "own"  # the emulator is no dialogue, and makes what the driver opens


@dataclass(frozen=True)
class Emulated:
    """The emulated instrument of a driver."""

    emulator: Callable[..., Any]  # made of a Simulation
    link: LinkKind = LinkKind.SOCKET
    form: str = "{url}"  # of its address, with `{url}`, or `{host}` and `{port}`, for where the link is
    place: type[Any] | None = None  # a class in place of the driver's, which opens no link

    @contextmanager
    def linked(self, simulation: Simulation, plan: FaultPlan | None = None) -> Iterator[Any]:
        """Yield the link to it, on which something may go wrong."""
        emulator = self.emulator(simulation)
        terminal = self.link is LinkKind.TERMINAL
        if self.link is not LinkKind.OWN:
            emulator = EmulatedLink(emulator, plan, pseudo_terminal=terminal)
        with emulator as link:
            yield link

    def address(self, url: str) -> str:
        """Return its address on a link."""
        where = urlsplit(url)
        return self.form.format(url=url, host=where.hostname, port=where.port)

    @contextmanager
    def at(self, simulation: Simulation) -> Iterator[str]:
        """Yield its address, as `Driver.emulator` does."""
        with self.linked(simulation) as link:
            yield self.address(link.url)


@dataclass(frozen=True)
class EmulatedBoard(Emulated):
    """A board: one for each panel, as meter and backlight share one."""

    @contextmanager
    def at(self, simulation: Simulation) -> Iterator[str]:
        panel = id(simulation.panel)
        if panel not in _boards:
            linked = self.linked(simulation)
            _boards[panel] = (linked, self.address(linked.__enter__().url), [])
        linked, address, users = _boards[panel]
        users.append(simulation)
        try:
            yield address
        finally:
            users.pop()
            if not users:
                del _boards[panel]
                linked.__exit__(None, None, None)


_boards: dict[int, tuple[Any, str, list[Simulation]]] = {}  # their links, addresses and users
LUMINANCE, POWER, BACKLIGHT = InstrumentKind
_TERMINAL, _OWN = LinkKind.TERMINAL, LinkKind.OWN
_BOARD = EmulatedBoard(PowerBoardEmulator, _TERMINAL)
_EXEC = Emulated(EmulatedProgram, form=f"{PROGRAM} {{port}}")
OURS: dict[tuple[InstrumentKind, str], Emulated] = {
    (LUMINANCE, "ls100"): Emulated(luminance_meters.EmulatedLs100),
    (LUMINANCE, "ls110"): Emulated(luminance_meters.EmulatedLs110),
    (LUMINANCE, "cs100a"): Emulated(luminance_meters.EmulatedCs100a),
    (LUMINANCE, "pr655"): Emulated(luminance_meters.EmulatedPr655, _TERMINAL),
    (LUMINANCE, "pr670"): Emulated(luminance_meters.EmulatedPr670, _TERMINAL),
    (LUMINANCE, "pr650"): Emulated(luminance_meters.EmulatedPr650, _TERMINAL),
    (LUMINANCE, "colorcal"): Emulated(luminance_meters.EmulatedColorCal, _TERMINAL),
    (LUMINANCE, "spotread"): Emulated(EmulatedSpotread, _OWN),
    (LUMINANCE, "exec"): _EXEC,
    (POWER, "board"): _BOARD,
    (POWER, "hwmon"): Emulated(power_meters.HwmonEmulator, _OWN),
    (POWER, "ppk2"): Emulated(power_meters.Ppk2Emulator, _TERMINAL, "{url}?voltage=5.0"),
    (POWER, "scpi"): Emulated(power_meters.ScpiEmulator, form="{host}:{port}"),
    (POWER, "visa"): Emulated(power_meters.ScpiEmulator, form="TCPIP::{host}::{port}::SOCKET"),
    (POWER, "battery"): Emulated(device_power.BatteryEmulator, _OWN),
    (POWER, "adb"): Emulated(device_power.AdbEmulator, _OWN),
    (POWER, "exec"): _EXEC,
    (BACKLIGHT, "ddc"): Emulated(EmulatedMonitor, form="{port}", place=DdcOnLink),
    (BACKLIGHT, "board"): _BOARD,
    (BACKLIGHT, "exec"): _EXEC,
}


def on_emulator(kind: InstrumentKind, name: str) -> Driver:
    """Return a driver of ours that brings its emulated instrument, as a package's may."""
    emulated, driver = OURS[kind, name], kind.ours[name]
    return replace(driver, emulator=emulated.at, place=emulated.place or driver.place)


def open_at(kind: InstrumentKind, name: str, url: str, clock: Any, timeout: float | None = None) -> Any:
    """Return a driver of ours, opened on the link to its emulated instrument."""
    return on_emulator(kind, name).load()(OURS[kind, name].address(url), clock, timeout)


def attach(monkeypatch: Any) -> None:
    """Let a test open any driver of ours on its emulated instrument, as `simulated:DRIVER`."""
    for kind, name in OURS:
        monkeypatch.setitem(kind.ours, name, on_emulator(kind, name))

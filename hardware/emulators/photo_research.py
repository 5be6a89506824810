"""Emulated Photo Research PR-655 and PR-670, and the older PR-650."""

from __future__ import annotations

import re

from evenlight.hardware.emulators.meter import WHITE, EmulatedMeter, tristimulus
from evenlight.hardware.meter_physics import PR650_PHYSICS, PR655_PHYSICS, PR670_PHYSICS, MeterPhysics
from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated_panel import Simulation

ENTER, LEAVE = b"PHOTO", b"Q"
CODES = {Fault.OVER_RANGE: "-2", Fault.UNDER_RANGE: "-8"}
SETTINGS = re.compile(r"S[UENOSK]\d+")
QUALITIES = {Fault.OVER_RANGE: 19, Fault.UNDER_RANGE: 10, Fault.LOW_BATTERY: 17}


class EmulatedPr655(EmulatedMeter):
    """A PR-655, switched on.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of it.

    Attributes
    ----------
    remote : bool
        Whether it is in remote mode.
    """

    model, serial_number = "PR-655", "60102905"

    def __init__(self, simulation: Simulation, physics: MeterPhysics = PR655_PHYSICS) -> None:
        super().__init__(simulation, physics)
        self.remote = False

    def _end_of_command(self, came: bytes) -> int:
        """Return how many bytes the first command has: those that enter and leave end with themselves."""
        if not self.remote:
            place = came.find(ENTER)
            return place + len(ENTER) if place >= 0 else 0
        if came.startswith(LEAVE):
            return len(LEAVE)
        return super()._end_of_command(came)

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""
        if not self.remote:
            self.remote = True
            return b" REMOTE MODE\r\n"
        if command == LEAVE.decode():
            self.remote = False
            return b""
        return f"{self._words(command)}\r\n".encode()

    def _words(self, command: str) -> str:
        """Return the answer to a command in remote mode, without its end."""
        if command == "M1":
            seen = self._look()
            if seen.fault is not None:
                return CODES[seen.fault]
            x, y = WHITE
            return f"0000,111,{seen.luminance:.3e},{x:.4f},{y:.4f}"
        facts = {"D110": self.serial_number, "D111": self.model, "D114": "2.02"}
        if command in facts:
            return f"0000,{facts[command]}"
        return "0000" if SETTINGS.fullmatch(command) else "-1000"


class EmulatedPr670(EmulatedPr655):
    """A PR-670, switched on; parameters as of `EmulatedPr655`."""

    model, serial_number = "PR-670", "67093102"

    def __init__(self, simulation: Simulation, physics: MeterPhysics = PR670_PHYSICS) -> None:
        super().__init__(simulation, physics)


class EmulatedPr650(EmulatedMeter):
    """A PR-650 in remote mode.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of it.
    """

    def __init__(self, simulation: Simulation, physics: MeterPhysics = PR650_PHYSICS) -> None:
        super().__init__(simulation, physics)
        self._last = (0, 0.0, 0.0, 0.0)  # quality, X, Y and Z: what it answers before it has measured

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""
        if command == "m0":
            seen = self._look()
            quality = 0 if seen.fault is None else QUALITIES[seen.fault]
            self._last = (quality, *tristimulus(seen.luminance))
            return f"{quality:03d}\r\n".encode()
        if command == "d2":
            quality, *values = self._last
            return f"{quality:02d},0,{','.join(f'{value:.3e}' for value in values)}\r\n".encode()
        return b"000\r\n" if re.fullmatch(r"b\d|s[\d,]+", command) else b"020\r\n"

"""Emulated Konica Minolta LS-100, LS-110 and CS-100A."""

from __future__ import annotations

from evenlight.hardware.emulators.meter import WHITE, EmulatedMeter
from evenlight.hardware.meter_physics import CS100A_PHYSICS, LS100_PHYSICS, LS110_PHYSICS, MeterPhysics
from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated_panel import Simulation

FIELD = 6  # characters of a luminance, its decimal point included
CODES = {Fault.OVER_RANGE: "ER10", Fault.LOW_BATTERY: "ER30"}
MODES = ("00", "01", "04", "05", "06", "07", "08", "09")


class EmulatedLs100(EmulatedMeter):
    """An LS-100 in remote mode.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of it.
    padded : bool, optional
        Whether luminances are padded to a sign and six characters; what an LS-100 does is not confirmed.
    """

    def __init__(
        self, simulation: Simulation, physics: MeterPhysics = LS100_PHYSICS, *, padded: bool = True
    ) -> None:
        super().__init__(simulation, physics)
        self._padded = padded

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""
        if command == "MES":
            return self._measured().encode() + b"\r\n"
        if command in [f"MDS,{mode}" for mode in MODES] or command == "CLE":
            return b"OK00\r\n"
        return b"ER00\r\n"

    def _measured(self) -> str:
        """Return check code and values of a measurement."""
        seen = self._look()
        if seen.fault is None:
            return f"OK00,{self._luminance(seen.luminance)}"
        if seen.fault is Fault.UNDER_RANGE:
            return f"OK13,{self._luminance(0.0)}"
        return CODES[seen.fault]

    def _luminance(self, luminance: float) -> str:
        """Return a luminance as it is sent."""
        text = _in_field(luminance)
        return f" {text:>{FIELD}}" if self._padded else f" {text}"


class EmulatedLs110(EmulatedLs100):
    """An LS-110 in remote mode; parameters as of `EmulatedLs100`."""

    def __init__(
        self, simulation: Simulation, physics: MeterPhysics = LS110_PHYSICS, *, padded: bool = True
    ) -> None:
        super().__init__(simulation, physics, padded=padded)


class EmulatedCs100a(EmulatedLs100):
    """A CS-100A in remote mode; parameters as of `EmulatedLs100`.

    Attributes
    ----------
    chromaticity_fails : bool
        Whether the chromaticity is out of range from now on.
    """

    def __init__(
        self, simulation: Simulation, physics: MeterPhysics = CS100A_PHYSICS, *, padded: bool = True
    ) -> None:
        super().__init__(simulation, physics, padded=padded)
        self.chromaticity_fails = False

    def _measured(self) -> str:
        """Return check code and values of a measurement."""
        seen = self._look()
        x, y = (f" {value:.4f}".replace("0.", ".") for value in WHITE)
        if seen.fault is Fault.OVER_RANGE:
            return f"OK12,-999999,{x},{y}"  # the luminance alone is beyond the display
        if seen.fault is Fault.UNDER_RANGE:
            return f"OK13,{self._luminance(0.0)},{x},{y}"
        if seen.fault is not None:
            return CODES[seen.fault]
        if self.chromaticity_fails:
            return f"OK11,{self._luminance(seen.luminance)},-9.9999,-9.9999"
        return f"OK00,{self._luminance(seen.luminance)},{x},{y}"


def _in_field(luminance: float) -> str:
    """Return a luminance in as many characters as there are.

    >>> _in_field(0.123), _in_field(48.1), _in_field(12340.0)
    ('0.123', '48.1', '12340')
    """
    return f"{luminance:.3f}".rstrip("0").rstrip(".")[:FIELD].rstrip(".")

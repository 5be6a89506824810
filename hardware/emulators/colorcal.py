"""An emulated ColorCAL II of Cambridge Research Systems."""

from __future__ import annotations

from evenlight.hardware.emulators.meter import EmulatedMeter, tristimulus
from evenlight.hardware.meter_physics import COLORCAL_PHYSICS, MeterPhysics
from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated_panel import Simulation

END, PROMPT = b"\n\r", b">"
IDENTITY = "OK00,1,8096,100.10,3100042,1.24"
Row = tuple[float, float, float]
MATRIX: tuple[Row, Row, Row] = ((0.8, -0.1, 0.0), (0.0, 1.25, -0.2), (0.0, 0.0, 0.5))
TOO_BRIGHT = "ER10"  # assumed: which code it sends is not known
NOT_DARK = "ER11"
DARK = 0.5  # [cd/m^2] up to which the sensor counts as covered


class EmulatedColorCal(EmulatedMeter):
    """A ColorCAL II.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of it.
    """

    def __init__(self, simulation: Simulation, physics: MeterPhysics = COLORCAL_PHYSICS) -> None:
        super().__init__(simulation, physics)

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command, after a line that is blank."""
        return END + self._words(command).encode() + END + PROMPT

    def _words(self, command: str) -> str:
        """Return the answer to a command, without its end."""
        if command == "MES":
            return self._measured()
        if command == "IDR":
            return IDENTITY
        if command == "UZC":
            return "OK00" if self._simulation.panel.luminance() <= DARK else NOT_DARK
        if command in ("r01", "r02", "r03"):
            entries = ",".join(f"{_as_integer(entry):5d}" for entry in MATRIX[int(command[-1]) - 1])
            return f"OK00,{entries}"
        return "ER00"

    def _measured(self) -> str:
        """Return the values before they are corrected, which the computer does."""
        seen = self._look()
        if seen.fault is Fault.UNDER_RANGE:
            return "OK00,  0.00,  0.00,  0.00"
        if seen.fault is not None:
            return TOO_BRIGHT
        return "OK00," + ",".join(f"{value:6.2f}" for value in _uncorrected(seen.luminance))


def _uncorrected(luminance: float) -> Row:
    """Return what the matrix makes X, Y and Z of; its last row first, for it has one entry."""
    X, Y, Z = tristimulus(luminance)
    third = Z / MATRIX[2][2]
    second = (Y - MATRIX[1][2] * third) / MATRIX[1][1]
    first = (X - MATRIX[0][1] * second - MATRIX[0][2] * third) / MATRIX[0][0]
    return first, second, third


def _as_integer(entry: float) -> int:
    """Return an entry of the matrix as it is sent.

    >>> _as_integer(0.8053), _as_integer(-0.204)
    (8053, 52040)
    """
    size = round(abs(entry) * 10000)
    return size if entry >= 0 else 50000 + size

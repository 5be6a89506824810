"""Emulated luminance meters of Konica Minolta, Photo Research and CRS, which look at the simulated panel."""

from __future__ import annotations

import re
from abc import abstractmethod

from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated.luminance_meter import MeterPhysics, sensed
from evenlight.hardware.simulated.panel import Simulation

# Ranges, digits and repeatability of catalogues, from memory.
LS100_PHYSICS = MeterPhysics(lowest=0.001, resolution=0.001, floor_noise=0.001)
LS110_PHYSICS = MeterPhysics(lowest=0.01, highest=999_900.0)
CS100A_PHYSICS = MeterPhysics(lowest=0.01, highest=299_000.0)
PR655_PHYSICS = MeterPhysics(
    lowest=0.3, highest=20_000.0, resolution=0.0, reading_time=1.0, dark_reading_time=20.0
)
PR670_PHYSICS = MeterPhysics(
    lowest=0.03, highest=20_000.0, resolution=0.0, reading_time=1.0, dark_reading_time=40.0
)
PR650_PHYSICS = MeterPhysics(
    lowest=0.3, highest=100_000.0, resolution=0.0, reading_time=2.0, dark_reading_time=20.0
)
COLORCAL_PHYSICS = MeterPhysics(lowest=0.01, highest=1_000.0, floor_noise=0.005, significant_digits=6)
WHITE = (0.3127, 0.329)  # chromaticity of D65, which every emulated panel has
MINOLTA_FIELD = 6  # characters of a luminance, its decimal point included
MINOLTA_CODES = {Fault.OVER_RANGE: "ER10", Fault.LOW_BATTERY: "ER30"}
MINOLTA_MODES = ("00", "01", "04", "05", "06", "07", "08", "09")
PR655_ENTER, PR655_LEAVE = b"PHOTO", b"Q"
PR655_CODES = {Fault.OVER_RANGE: "-2", Fault.UNDER_RANGE: "-8"}
PR655_SETTINGS = re.compile(r"S[UENOSK]\d+")
PR650_QUALITIES = {Fault.OVER_RANGE: 19, Fault.UNDER_RANGE: 10, Fault.LOW_BATTERY: 17}
COLORCAL_END, COLORCAL_PROMPT = b"\n\r", b">"
COLORCAL_IDENTITY = "OK00,1,8096,100.10,3100042,1.24"
Row = tuple[float, float, float]
COLORCAL_MATRIX: tuple[Row, Row, Row] = ((0.8, -0.1, 0.0), (0.0, 1.25, -0.2), (0.0, 0.0, 0.5))
COLORCAL_TOO_BRIGHT = "ER10"  # assumed: which code it sends is not known
COLORCAL_TOO_LONG = 999.995  # for a field of six characters
COLORCAL_NOT_DARK = "ER11"
COLORCAL_DARK = 0.5  # [cd/m^2] up to which the sensor counts as covered


class EmulatedMeter:
    """A luminance meter at the other end of a link, which answers at once.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of it, in place of its own, but for the time that a reading takes.

    Attributes
    ----------
    fault : Fault or None
        What is wrong with the instrument itself from now on: OVER_RANGE, UNDER_RANGE, LOW_BATTERY.
    """

    own_physics = MeterPhysics()

    def __init__(self, simulation: Simulation, physics: MeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or self.own_physics
        self._came = b""
        self.fault: Fault | None = None

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, and answer the commands that are complete."""
        self._came += data
        answers = b""
        while (cut := self._end_of_command(self._came)) > 0:
            command, self._came = self._came[:cut], self._came[cut:]
            answers += self._answer(command.decode("ascii", errors="replace").strip("\r\n"))
        return answers

    def stream(self) -> bytes:
        """Return nothing: it speaks when it is asked."""
        return b""

    def _end_of_command(self, came: bytes) -> int:
        """Return how many bytes the first command has, 0 if it is not complete."""
        places = [came.find(ending) for ending in (b"\r\n", b"\r", b"\n") if ending in came]
        if not places:
            return 0
        first = min(places)
        return first + (2 if came[first : first + 2] == b"\r\n" else 1)

    def _look(self) -> tuple[float, Fault | None]:
        """Return what it makes of the panel now, and what is wrong."""
        shown, fault = sensed(self._simulation.panel.luminance(), self._physics, self._simulation.rng)
        return shown, self.fault or fault

    @abstractmethod
    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""


def tristimulus(luminance: float) -> tuple[float, float, float]:
    """Return X, Y and Z of white light of a luminance [cd/m^2]."""
    x, y = WHITE
    return luminance * x / y, luminance, luminance * (1 - x - y) / y


class EmulatedLs100(EmulatedMeter):
    """An LS-100 in remote mode.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of it.
    width : int, optional
        To how many characters luminances are padded after their sign; what an LS-100 does is not confirmed.
    """

    own_physics = LS100_PHYSICS

    def __init__(
        self, simulation: Simulation, physics: MeterPhysics | None = None, *, width: int = MINOLTA_FIELD
    ) -> None:
        super().__init__(simulation, physics)
        self._width = width

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""
        if command == "MES":
            return self._measured().encode() + b"\r\n"
        if command in [f"MDS,{mode}" for mode in MINOLTA_MODES] or command == "CLE":
            return b"OK00\r\n"
        return b"ER00\r\n"

    def _measured(self) -> str:
        """Return check code and values of a measurement."""
        shown, fault = self._look()
        if fault is None:
            return f"OK00,{self._luminance(shown)}"
        if fault is Fault.UNDER_RANGE:
            return f"OK13,{self._luminance(0.0)}"
        return MINOLTA_CODES[fault]

    def _luminance(self, luminance: float) -> str:
        """Return a luminance as it is sent."""
        return f" {_minolta_field(luminance):>{self._width}}"


class EmulatedLs110(EmulatedLs100):
    """An LS-110 in remote mode; parameters as of `EmulatedLs100`."""

    own_physics = LS110_PHYSICS


class EmulatedCs100a(EmulatedLs100):
    """A CS-100A in remote mode; parameters as of `EmulatedLs100`.

    Attributes
    ----------
    chromaticity_fails : bool
        Whether the chromaticity is out of range from now on.
    """

    own_physics = CS100A_PHYSICS
    chromaticity_fails = False

    def _measured(self) -> str:
        """Return check code and values of a measurement."""
        shown, fault = self._look()
        x, y = (f" {value:.4f}".replace("0.", ".") for value in WHITE)
        if fault is Fault.OVER_RANGE:
            return f"OK12,-999999,{x},{y}"  # the luminance alone is beyond the display
        if fault is Fault.UNDER_RANGE:
            return f"OK13,{self._luminance(0.0)},{x},{y}"
        if fault is not None:
            return MINOLTA_CODES[fault]
        if self.chromaticity_fails:
            return f"OK11,{self._luminance(shown)}, .0000, .0000"
        return f"OK00,{self._luminance(shown)},{x},{y}"


def _minolta_field(luminance: float) -> str:
    """Return a luminance in as many characters as there are.

    >>> _minolta_field(0.123), _minolta_field(48.1), _minolta_field(12340.0)
    ('0.123', '48.1', '12340')
    """
    return f"{luminance:.3f}".rstrip("0").rstrip(".")[:MINOLTA_FIELD].rstrip(".")


class EmulatedPr655(EmulatedMeter):
    """A PR-655, switched on; parameters as of `EmulatedMeter`.

    Attributes
    ----------
    remote : bool
        Whether it is in remote mode.
    """

    model, serial_number, own_physics = "PR-655", "60102905", PR655_PHYSICS
    remote = False
    _last = "-2000"  # what it answers before it has measured

    def _end_of_command(self, came: bytes) -> int:
        """Return how many bytes the first command has: those that enter and leave end with themselves."""
        if not self.remote:
            place = came.find(PR655_ENTER)
            return place + len(PR655_ENTER) if place >= 0 else 0
        if came.startswith(PR655_LEAVE):
            return len(PR655_LEAVE)
        return super()._end_of_command(came)

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""
        if not self.remote:
            self.remote = True
            return b" REMOTE MODE\r\n"
        if command == PR655_LEAVE.decode():
            self.remote = False
            return b""
        return f"{self._words(command)}\r\n".encode()

    def _words(self, command: str) -> str:
        """Return the answer to a command in remote mode, without its end."""
        if command == "M1":
            (shown, fault), (x, y) = self._look(), WHITE
            self._last = f"0000,111,{shown:.3e},{x:.4f},{y:.4f}" if fault is None else PR655_CODES[fault]
        if command in ("M1", "D1"):
            return self._last
        facts = {"D110": self.serial_number, "D111": self.model, "D114": "2.02"}
        if command in facts:
            return f"0000,{facts[command]}"
        return "0000" if PR655_SETTINGS.fullmatch(command) else "-1000"


class EmulatedPr670(EmulatedPr655):
    """A PR-670, switched on; parameters as of `EmulatedPr655`."""

    model, serial_number, own_physics = "PR-670", "67093102", PR670_PHYSICS


class EmulatedPr650(EmulatedMeter):
    """A PR-650 in remote mode; parameters as of `EmulatedMeter`."""

    own_physics = PR650_PHYSICS
    _last = (0, 0.0, 0.0, 0.0)  # quality, X, Y and Z: what it answers before it has measured

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""
        if command == "m0":
            shown, fault = self._look()
            quality = 0 if fault is None else PR650_QUALITIES[fault]
            self._last = (quality, *tristimulus(shown))
            return f"{quality:03d}\r\n".encode()
        if command == "d2":
            quality, *values = self._last
            return f"{quality:02d},0,{','.join(f'{value:.3e}' for value in values)}\r\n".encode()
        return b"000\r\n" if re.fullmatch(r"b\d|s[\d,]+", command) else b"020\r\n"


class EmulatedColorCal(EmulatedMeter):
    """A ColorCAL II; parameters as of `EmulatedMeter`."""

    own_physics = COLORCAL_PHYSICS

    def _answer(self, command: str) -> bytes:
        """Return the answer to a command, after a line that is blank."""
        return COLORCAL_END + self._words(command).encode() + COLORCAL_END + COLORCAL_PROMPT

    def _words(self, command: str) -> str:
        """Return the answer to a command, without its end."""
        if command == "MES":
            return self._measured()
        if command == "IDR":
            return COLORCAL_IDENTITY
        if command == "UZC":
            return "OK00" if self._simulation.panel.luminance() <= COLORCAL_DARK else COLORCAL_NOT_DARK
        if command in ("r01", "r02", "r03"):
            entries = ",".join(f"{_as_integer(entry):5d}" for entry in COLORCAL_MATRIX[int(command[-1]) - 1])
            return f"OK00,{entries}"
        return "ER00"

    def _measured(self) -> str:
        """Return the values before they are corrected, which the computer does."""
        shown, fault = self._look()
        if fault is Fault.UNDER_RANGE:
            return "OK00,  0.00,  0.00,  0.00"
        values = _uncorrected(shown)
        if fault is not None or max(values) >= COLORCAL_TOO_LONG:
            return COLORCAL_TOO_BRIGHT
        return "OK00," + ",".join(f"{value:6.2f}" for value in values)


def _uncorrected(luminance: float) -> Row:
    """Return what the matrix makes X, Y and Z of; its last row first, for it has one entry."""
    X, Y, Z = tristimulus(luminance)
    third = Z / COLORCAL_MATRIX[2][2]
    second = (Y - COLORCAL_MATRIX[1][2] * third) / COLORCAL_MATRIX[1][1]
    first = (X - COLORCAL_MATRIX[0][1] * second - COLORCAL_MATRIX[0][2] * third) / COLORCAL_MATRIX[0][0]
    return first, second, third


def _as_integer(entry: float) -> int:
    """Return an entry of the matrix as it is sent.

    >>> _as_integer(0.8053), _as_integer(-0.204)
    (8053, 52040)
    """
    size = round(abs(entry) * 10000)
    return size if entry >= 0 else 50000 + size

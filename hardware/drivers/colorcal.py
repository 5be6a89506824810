"""The colorimeter ColorCAL II of Cambridge Research Systems, over USB.

Written from the commands as public drivers have them, and tested against an emulator, not against an
instrument. Which code it sends when the light is too bright is not known: any error is shown as it came.
Its fields have a fixed width, by which one that lost a digit is told; that no digit changes on its way is
left to USB, which checks each packet.
"""

from __future__ import annotations

import re

from evenlight.hardware.drivers.serial_link import LineSettings
from evenlight.hardware.drivers.serial_meter import MeterAnswer, SerialMeter
from evenlight.hardware.protocols import Fault

# USB that looks serial takes any rate; the end of a line, LF CR, as psychopy-crs has it
LINE = LineSettings(baud_rate=115200, terminator=b"\n\r")
IDENTITY_FIELDS = 6  # OK00,1,<rom>,100.10,<serial number>,<build>
MATRIX_ROWS = (b"r01\n", b"r02\n", b"r03\n")
FINE = "OK00"
# CRS's own example: OK00,242.85,248.11, 89.05 of a measurement, OK00, 8053,52040,50642 of a row of the matrix
VALUES = re.compile(r"OK00" + r",(?=[ \d.-]{6}(?:,|$)) *(-?\d+\.\d\d)" * 3)
ENTRIES = re.compile(r"OK00" + r",(?=[ \d]{5}(?:,|$)) *(\d+)" * 3)
NEGATIVE = 50000  # added to the size of a negative entry of the matrix
SCALE = 10000  # of the entries

Row = tuple[float, float, float]


class ColorCal(SerialMeter):
    """The ColorCAL II, corrected with the matrix it was calibrated with; parameters as of `SerialMeter`."""

    driver = "colorcal"
    maker, model, line = "CRS", "ColorCAL II", LINE
    longest = 15.0
    wake = "Unplug it, and plug it in again"
    zero_is_a_reading = False
    before_zero = "cover the sensor, so that no light reaches it"
    _identity = ""
    _matrix: tuple[Row, ...] = ()

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument said of itself when it was opened."""
        _, _, rom, _, serial_number, build = self._identity.split(",")
        return {
            "model": "CRS ColorCAL II",
            "serial number": serial_number.strip(),
            "firmware": f"{rom.strip()}, build {build.strip()}",
            "matrix": "; ".join(" ".join(f"{entry:g}" for entry in row) for row in self._matrix),
        }

    def zero(self) -> None:
        """Set the zero, with the sensor covered.

        Raises
        ------
        InstrumentError
            If light reached the sensor.
        """
        self._ask(self._set_zero)

    def _begin(self) -> None:
        self._link.write(b"IDR\n")
        line = self._next_line()
        if not _is_identity(line):
            raise self._error(f"answers {line!r}, which is no ColorCAL II's", Fault.WRONG_INSTRUMENT)
        self._identity = line
        self._require_landmark()  # the same again: it is a landmark from here on
        self._matrix, again = (tuple(self._row(command) for command in MATRIX_ROWS) for _ in range(2))
        if self._matrix != again:  # all readings go through it
            raise self._error(f"sent its matrix as {self._matrix}, then as {again}", Fault.GARBLED)

    def _send_landmark(self) -> None:
        """Ask who it is, which nothing else looks like, and no other instrument answers."""
        self._link.write(b"IDR\n")

    def _is_landmark(self, line: str) -> bool:
        return line == self._identity

    def _measure(self) -> MeterAnswer:
        raw = self._numbers(b"MES\n", VALUES)
        self._require_no_more()
        X, Y, Z = (sum(entry * value for entry, value in zip(row, raw, strict=True)) for row in self._matrix)
        total = X + Y + Z
        return Y, FINE, (X / total, Y / total) if total > 0 else None

    def _set_zero(self) -> None:
        if (line := self._reply(b"UZC\n")) != FINE:
            raise self._error(f"sent {line!r} instead of {FINE}", Fault.GARBLED)

    def _row(self, command: bytes) -> Row:
        row = self._numbers(command, ENTRIES)
        if not all(0 <= entry < 2 * NEGATIVE for entry in row):
            raise self._error(f"sent {row} as a row of its matrix", Fault.GARBLED)
        first, second, third = ((entry if entry <= NEGATIVE else NEGATIVE - entry) / SCALE for entry in row)
        return first, second, third

    def _numbers(self, command: bytes, form: re.Pattern[str]) -> Row:
        line = self._reply(command)
        if (found := form.fullmatch(line)) is None:
            raise self._error(f"sent {line!r} instead of three numbers", Fault.GARBLED)
        return float(found[1]), float(found[2]), float(found[3])

    def _reply(self, command: bytes) -> str:
        self._link.write(command)
        line = self._next_line()
        code = line.partition(",")[0]
        if code == FINE:
            return line
        if not (len(code) == 4 and code[:2] == "ER" and code[2:].isdigit()):
            raise self._error(f"sent {line!r}, which has no code", Fault.GARBLED)
        if command == b"UZC\n":
            words = f"could not set its zero: {self.before_zero}"
        else:
            words = "refused to measure, without a reason that is known; is the screen too bright for it?"
        raise self._error(f"{words} (error {code})", Fault.REFUSED, code)


def _is_identity(line: str) -> bool:
    fields = line.split(",")
    return len(fields) == IDENTITY_FIELDS and fields[0] == FINE

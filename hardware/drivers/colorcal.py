"""The colorimeter ColorCAL II of Cambridge Research Systems, over USB.

Written from the commands as public drivers have them, and tested against an emulator, not against an
instrument. Which code it sends when the light is too bright is not known: any error is shown as it came.
"""

from __future__ import annotations

from evenlight.hardware.drivers.serial_link import LineSettings
from evenlight.hardware.drivers.serial_meter import MeterAnswer, SerialMeter
from evenlight.hardware.protocols import Fault

LINE = LineSettings(  # USB that looks serial takes any rate; the end of a line, LF CR, as psychopy-crs has it
    baud_rate=115200, data_bits=8, parity="N", stop_bits=1, terminator=b"\n\r", timeout=15.0
)
IDENTITY_FIELDS = 6  # OK00,1,<rom>,100.10,<serial number>,<build>
MATRIX_ROWS = (b"r01\n", b"r02\n", b"r03\n")
FINE = "OK00"
NEGATIVE = 50000  # added to the size of a negative entry of the matrix
SCALE = 10000  # of the entries

Row = tuple[float, float, float]


class ColorCal(SerialMeter):
    """The ColorCAL II, corrected with the matrix it was calibrated with; parameters as of `SerialMeter`."""

    maker, model, line = "CRS", "ColorCAL II", LINE
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
        """Ask who it is, and for its matrix."""
        self._link.write(b"IDR\n")
        line = self._next_line()
        if not _is_identity(line):
            raise self._error(f"answers {line!r}, which is no ColorCAL II's", Fault.WRONG_INSTRUMENT)
        self._identity = line
        self._matrix = tuple(self._row(command) for command in MATRIX_ROWS)

    def _resynchronise(self) -> None:
        """Ask who it is, which nothing else looks like."""
        self._link.write(b"IDR\n")
        self._wait_for_line(_is_identity)

    def _measure(self) -> MeterAnswer:
        """Ask for X, Y and Z as measured, and correct them."""
        raw = self._numbers(b"MES\n")
        X, Y, Z = (sum(entry * value for entry, value in zip(row, raw, strict=True)) for row in self._matrix)
        total = X + Y + Z
        return MeterAnswer(Y, FINE, (X / total, Y / total) if total > 0 else None)

    def _set_zero(self) -> None:
        """Ask it to take what it sees for black."""
        if (line := self._reply(b"UZC\n")) != FINE:
            raise self._error(f"sent {line!r} instead of {FINE}", Fault.GARBLED)

    def _row(self, command: bytes) -> Row:
        """Return one row of its matrix."""
        row = self._numbers(command)
        if not all(0 <= entry < 2 * NEGATIVE for entry in row):
            raise self._error(f"sent {row} as a row of its matrix", Fault.GARBLED)
        first, second, third = ((entry if entry <= NEGATIVE else NEGATIVE - entry) / SCALE for entry in row)
        return first, second, third

    def _numbers(self, command: bytes) -> Row:
        """Return the three numbers of a reply."""
        line = self._reply(command)
        try:
            first, second, third = (float(field) for field in line.split(",")[1:])
        except ValueError:
            raise self._error(f"sent {line!r} instead of three numbers", Fault.GARBLED) from None
        return first, second, third

    def _reply(self, command: bytes) -> str:
        """Send a command, and return its reply, if that is no error."""
        self._link.forget()
        self._link.write(command)
        line = self._next_line(skip=_is_identity)  # late, of an earlier question
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
    """Return whether a line is the answer to IDR."""
    fields = line.split(",")
    return len(fields) == IDENTITY_FIELDS and fields[0] == FINE

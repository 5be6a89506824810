"""Konica Minolta luminance meters LS-100 and LS-110, and the chroma meter CS-100A, over RS-232.

Written from the protocol as the CS-100A's manual and public drivers have it, and tested against emulators,
not against instruments. The exact length of an LS-100's reply is not confirmed: it is read by its commas.
"""

from __future__ import annotations

import re
from abc import abstractmethod

from evenlight.hardware.drivers.serial_link import LineSettings
from evenlight.hardware.drivers.serial_meter import MeterAnswer, SerialMeter
from evenlight.hardware.protocols import Fault

REMOTE_LINE = LineSettings(  # CS-100A manual p. 6; LS-100 and LS-110 as psychopy-minolta and hrl have it
    baud_rate=4800,
    data_bits=7,
    parity="E",
    stop_bits=2,
    terminator=b"\r\n",
    timeout=10.0,  # a reading in the dark takes seconds
)
SETTLED = "OK00"
ABSOLUTE = b"MDS,04\r\n"  # luminance itself, not its difference from a stored one
MEASURE = b"MES\r\n"
REPLY = re.compile(r"(OK|ER)(\d\d)(?:,(.*))?")
NUMBER = re.compile(r"[+-]?\s*(?:\d+\.?\d*|\.\d+)")

# CS-100A manual, table of check codes; the LS-100 and LS-110 have those that are not about chromaticity.
CHECK_CODES: dict[str, tuple[str, Fault]] = {
    "OK12": ("the luminance is beyond its display", Fault.OVER_RANGE),
    "OK13": ("the luminance is below its display's range", Fault.UNDER_RANGE),
    "ER00": ("it does not know the command", Fault.REFUSED),
    "ER01": ("its settings are wrong; switch it off and on, holding F", Fault.REFUSED),
    "ER10": ("too bright for it: its measuring range is exceeded", Fault.OVER_RANGE),
    "ER11": ("a value in its memory is wrong; recalibrate it, or use the preset calibration", Fault.REFUSED),
    "ER12": ("luminance and chromaticity are beyond its display", Fault.OVER_RANGE),
    "ER19": ("the luminance is beyond its display", Fault.OVER_RANGE),
    "ER20": ("its memory (EEPROM) fails: have it repaired", Fault.REFUSED),
    "ER30": ("its battery is low: change it", Fault.LOW_BATTERY),
}
NO_CHROMATICITY = "OK11"


class MinoltaMeter(SerialMeter):
    """What the three have in common; parameters as of `SerialMeter`."""

    maker = "Konica Minolta"
    line = REMOTE_LINE
    wake = "Switch it off, and on again with F held, until C shows; begin with a bright screen"

    def apparatus(self) -> dict[str, str]:
        """Return what is known of the instrument: it has no command to ask for more."""
        return {"model": f"Konica Minolta {self.model}, as named", "measuring mode": "absolute"}

    def _begin(self) -> None:
        """Set it to absolute luminances."""
        self._link.write(ABSOLUTE)
        line = self._next_line(skip=_holds_data)  # a reading that another program had asked for
        if line == SETTLED:
            return
        if not REPLY.fullmatch(line):
            raise self._error(
                f"answers {line!r}, which is no Konica Minolta meter's reply", Fault.WRONG_INSTRUMENT
            )
        raise self._refusal(line[:4])

    def _resynchronise(self) -> None:
        """Set the mode again: its answer holds no data, which that of a measurement does."""
        self._link.write(ABSOLUTE)
        self._wait_for_line(lambda line: line == SETTLED)

    def _measure(self) -> MeterAnswer:
        """Ask for one reading."""
        self._link.forget()
        self._link.write(MEASURE)
        line = self._next_line(skip=lambda line: line == SETTLED)  # a late answer to the mode
        match = REPLY.fullmatch(line)
        if match is None:
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED)
        code, fields = match[1] + match[2], (match[3] or "").split(",")
        if code not in (SETTLED, NO_CHROMATICITY):
            raise self._refusal(code)
        numbers = [self._number(field, line) for field in fields]
        if numbers[0] < 0:
            raise self._error(
                f"a luminance of {numbers[0]:g}: does it show differences (DIFF.)? Set it to ABS.",
                Fault.REFUSED,
                code,
            )
        return self._parse_numbers(code, numbers)

    @abstractmethod
    def _parse_numbers(self, code: str, numbers: list[float]) -> MeterAnswer:
        """Return a reading from a reply's numbers, if there are as many as the model sends."""

    def _number(self, field: str, line: str) -> float:
        """Return the number in a field, whose sign may stand apart."""
        if not NUMBER.fullmatch(field.strip()):
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED)
        return float(field.replace(" ", ""))

    def _refusal(self, code: str) -> Exception:
        """Return the error of a check code."""
        words, fault = CHECK_CODES.get(code, ("a check code that its manual does not have", Fault.REFUSED))
        return self._error(f"{words} (check code {code})", fault, code)


class Ls100(MinoltaMeter):
    """The LS-100, of a spot of 1 degree; parameters as of `SerialMeter`."""

    model = "LS-100"

    def _parse_numbers(self, code: str, numbers: list[float]) -> MeterAnswer:
        """Return a luminance alone."""
        if len(numbers) == 3:
            raise self._error(
                "answers with chromaticity, as a CS-100A does: name it cs100a", Fault.WRONG_INSTRUMENT
            )
        if len(numbers) != 1:
            raise self._error(f"sent {len(numbers)} values instead of one", Fault.GARBLED)
        return MeterAnswer(numbers[0], code)


class Ls110(Ls100):
    """The LS-110, of a spot of 1/3 degree; parameters as of `SerialMeter`."""

    model = "LS-110"


class Cs100a(MinoltaMeter):
    """The CS-100A, which measures chromaticity, too; parameters as of `SerialMeter`."""

    model = "CS-100A"

    def _parse_numbers(self, code: str, numbers: list[float]) -> MeterAnswer:
        """Return a luminance, and its chromaticity unless that is out of range."""
        if code == NO_CHROMATICITY:
            return MeterAnswer(numbers[0], f"{code}: chromaticity out of range")
        if len(numbers) == 1:
            raise self._error(
                "answers without chromaticity, as an LS-100 or LS-110 does: name it ls100 or ls110",
                Fault.WRONG_INSTRUMENT,
            )
        if len(numbers) != 3:
            raise self._error(f"sent {len(numbers)} values instead of three", Fault.GARBLED)
        return MeterAnswer(numbers[0], code, (numbers[1], numbers[2]))


def _holds_data(line: str) -> bool:
    """Return whether a line is the reply to a measurement."""
    return line.startswith("OK") and "," in line

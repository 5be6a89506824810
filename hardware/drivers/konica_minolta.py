"""Konica Minolta luminance meters LS-100 and LS-110, and the chroma meter CS-100A, over RS-232.

Written from the protocol as the CS-100A's manual and public drivers have it, and tested against emulators,
not against instruments. Replies have a fixed length, by which one that lost characters is told: 12.3 is no
12.34. That of an LS-100 is not confirmed: its first reply may have another, if the next two have the same.
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
)
SETTLED = "OK00"
ABSOLUTE = b"MDS,04\r\n"  # luminance itself, not its difference from a stored one
MEASURE = b"MES\r\n"
REPLY = re.compile(r"((?:OK|ER)\d\d)(?:,.*)?")
# CS-100A manual, as a MATLAB class quotes it: check code, sign and six characters, twice a sign and .dddd.
LUMINANCE = r"([ +-]?)( *(?:\d+\.?\d*|\.\d+))"
LUMINANCE_ALONE = re.compile(rf"(OK00),{LUMINANCE}")
WITH_CHROMATICITY = re.compile(rf"(OK00|OK11),{LUMINANCE},([ +-]\.\d{{4}}),([ +-]\.\d{{4}})")
LUMINANCE_LENGTH, CHROMATICITY_LENGTH = 12, 26  # characters, without CR LF

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
    form: re.Pattern[str]  # of its readings: check code, sign, luminance, and chromaticity if it has that
    form_of_another: re.Pattern[str]
    another = ""  # what an instrument that answers so is
    line = REMOTE_LINE
    longest = 10.0  # [s] a reading in the dark takes seconds
    wake = "Switch it off, and on again with F held, until C shows; begin with a bright screen"

    def apparatus(self) -> dict[str, str]:
        """Return what is known of the instrument: it has no command to ask for more."""
        return {"model": f"Konica Minolta {self.model}, as named", "measuring mode": "absolute"}

    def _begin(self) -> None:
        self._link.write(ABSOLUTE)
        line = self._next_line(skip=_holds_data)  # a reading that another program had asked for
        if line == SETTLED:
            return
        if not REPLY.fullmatch(line):
            raise self._error(
                f"answers {line!r}, which is no Konica Minolta meter's reply", Fault.WRONG_INSTRUMENT
            )
        raise self._refusal(line[:4])

    def _send_landmark(self) -> None:
        """Set the mode again: its answer holds no data, which that of a measurement does."""
        self._link.write(ABSOLUTE)

    def _is_landmark(self, line: str) -> bool:
        return line == SETTLED

    def _measure(self) -> MeterAnswer:
        line, found = self._reply()
        self._require_length(line)
        self._require_no_more()
        code, sign, luminance, *coordinates = found.groups()
        if sign == "-":
            raise self._error(
                f"a luminance of -{luminance.strip()}: does it show differences (DIFF.)? Set it to ABS.",
                Fault.REFUSED,
                code,
            )
        if code == NO_CHROMATICITY:
            return float(luminance), f"{code}: chromaticity out of range", None
        x_y = [float(coordinate.replace(" ", "")) for coordinate in coordinates]
        return float(luminance), code, (x_y[0], x_y[1]) if x_y else None

    def _reply(self) -> tuple[str, re.Match[str]]:
        self._link.write(MEASURE)
        line = self._next_line()
        if found := self.form.fullmatch(line):
            return line, found
        if self.form_of_another.fullmatch(line):
            raise self._error(self.another, Fault.WRONG_INSTRUMENT)
        refused = REPLY.fullmatch(line)
        if refused is None or refused[1] == SETTLED:
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED)
        raise self._refusal(refused[1])

    @abstractmethod
    def _require_length(self, line: str) -> None:
        """Refuse a reply of another length than the instrument's: it has lost characters, or gained some."""

    def _wrong_length(self, line: str, length: int) -> Exception:
        return self._error(f"sent {line!r}, {len(line)} characters instead of {length}", Fault.GARBLED)

    def _refusal(self, code: str) -> Exception:
        words, fault = CHECK_CODES.get(code, ("a check code that its manual does not have", Fault.REFUSED))
        return self._error(f"{words} (check code {code})", fault, code)


class Ls100(MinoltaMeter):
    """The LS-100, of a spot of 1 degree; parameters as of `SerialMeter`."""

    driver, model = "ls100", "LS-100"
    form, form_of_another = LUMINANCE_ALONE, WITH_CHROMATICITY
    another = "answers with chromaticity, as a CS-100A does: name it cs100a"
    _length = 0  # of its replies, as the first one has it

    def _require_length(self, line: str) -> None:
        """Refuse a reply of another length than the first, which is a CS-100A's, or came three times."""
        if not self._length:
            if len(line) != LUMINANCE_LENGTH and any(len(self._reply()[0]) != len(line) for _ in range(2)):
                raise self._wrong_length(line, LUMINANCE_LENGTH)
            self._length = len(line)
        if len(line) != self._length:
            raise self._wrong_length(line, self._length)


class Ls110(Ls100):
    """The LS-110, of a spot of 1/3 degree; parameters as of `SerialMeter`."""

    driver, model = "ls110", "LS-110"


class Cs100a(MinoltaMeter):
    """The CS-100A, which measures chromaticity, too; parameters as of `SerialMeter`."""

    driver, model = "cs100a", "CS-100A"
    form, form_of_another = WITH_CHROMATICITY, LUMINANCE_ALONE
    another = "answers without chromaticity, as an LS-100 or LS-110 does: name it ls100 or ls110"

    def _require_length(self, line: str) -> None:
        """Refuse a reply of another length than the manual's."""
        if len(line) != CHROMATICITY_LENGTH:
            raise self._wrong_length(line, CHROMATICITY_LENGTH)


def _holds_data(line: str) -> bool:
    return line.startswith("OK") and "," in line

"""Photo Research spectroradiometers: PR-655 and PR-670 over USB or RS-232, and the older PR-650 over RS-232.

Written from the commands and codes as public drivers and quotations of the manual have them, and tested
against emulators, not against instruments. PR-655 and PR-670 take one character at a time. The lines have no
parity, so each reading is asked for a second time, without measuring again: the two copies have to be equal.
"""

from __future__ import annotations

import re

from evenlight.hardware.drivers.serial_link import LineSettings
from evenlight.hardware.drivers.serial_meter import MeterAnswer, SerialMeter
from evenlight.hardware.protocols import Fault, InstrumentError

# 9600 8N1 without handshake: as psychopy-photoresearch and Psychtoolbox's PR655Toolbox open it
LINE = LineSettings(baud_rate=9600)
LONGEST = 60.0  # [s] a PR-670 exposes for up to 30 s, as long again for its dark signal; a PR-650 is slow
ENTERING_TIME = 1.5  # [s] in which it reports remote mode
REMOTE_MODE = b"REMOTE MODE"
CODE = re.compile(r"-?\d{4,5}|-\d{1,3}")
FINE = "0000"
# PR-655/670 manual p. 126, after its code: UUUU,Y.YYYe+ee,x.xxxx,y.yyyy, as in 0,1.865e+01,0.4035,0.4202
# The exponent has three digits in the example of data code 5; the second copy tells one that lost a digit.
SCIENTIFIC = r"([ +-]?\d\.\d{3}[eE][+-]\d{2,3})"
READING = re.compile(rf"(\d{{1,4}}),{SCIENTIFIC},([ +-]?0\.\d{{4}}),([ +-]?0\.\d{{4}})")
# The units of a reading. PR-7 manual, table 7, and Psychtoolbox, which requires 0 of a PR-670; those of three
# digits and of two are in a MATLAB class that quotes the PR-655's manual.
LUMINANCE_UNITS = (0, 111)
OTHER_UNITS = {
    1: "illuminance",
    2: "luminous intensity",
    3: "luminous flux",
    11: "radiance",
    12: "irradiance",
    112: "illuminance",
    13: "radiant intensity",
    113: "luminous intensity",
    14: "radiant flux",
    114: "luminous flux",
}
ERROR_CODES: dict[int, tuple[str, Fault]] = {
    -1: ("the light is not constant; set the synchronisation, or a longer exposure", Fault.REFUSED),
    -2: ("too bright for it: overload", Fault.OVER_RANGE),
    -3: ("cannot synchronise: the light has no frequency of 20 to 400 Hz, or is too weak", Fault.REFUSED),
    -4: ("its adaptive mode failed", Fault.REFUSED),
    -8: ("too dark for it: weak light", Fault.UNDER_RANGE),
    -9: ("its synchronisation failed", Fault.REFUSED),
    -10: ("cannot synchronise to the light by itself", Fault.REFUSED),
    -12: ("its adaptive mode found no exposure in time: the light is not constant", Fault.REFUSED),
    -1000: ("it does not know the command", Fault.REFUSED),
    -2000: ("it has no such data", Fault.REFUSED),
}
PR650_BACKLIGHT_ON = b"b1\n"
PR650_SET_UP = b"s01,,,,,,01,1\n"  # the lens MS-75, one exposure for a reading, SI units
PR650_MEASURE = b"m0\n"
PR650_TRISTIMULUS = b"d2\n"  # quality, units, X, Y, Z of the last measurement
PR650_CODE = re.compile(r"-?\d{1,3}")
# Quality, units, and three numbers of fixed form, as a MATLAB class quotes the manual: qq,U,Y.YYYEsee,...
PR650_VALUES = re.compile(rf"(-?\d\d?),(\d),{SCIENTIFIC},{SCIENTIFIC},{SCIENTIFIC}")
PR650_LUMINANCE_UNITS = 0  # 1 is illuminance, 2 uncalibrated
PR650_QUALITY: dict[int, tuple[str, Fault]] = {
    -1: ("it could not measure; is the light too weak?", Fault.REFUSED),
    1: ("its sensor gave no signal to begin with", Fault.REFUSED),
    3: ("its sensor gave no start signal", Fault.REFUSED),
    4: ("its sensor gave no signal to integrate", Fault.REFUSED),
    5: ("its memory access failed", Fault.REFUSED),
    6: ("its sensor gave no signal after synchronising", Fault.REFUSED),
    7: ("cannot synchronise to the light", Fault.REFUSED),
    8: ("lost the synchronisation while it measured", Fault.REFUSED),
    10: ("too dark for it: weak light", Fault.UNDER_RANGE),
    12: ("its hardware fails", Fault.REFUSED),
    13: ("its software fails", Fault.REFUSED),
    14: ("it has no sample to compare with", Fault.REFUSED),
    16: ("found no exposure in time: the light is not constant", Fault.REFUSED),
    17: ("its battery is low: charge or change it", Fault.LOW_BATTERY),
    18: ("too dark for it: low light", Fault.UNDER_RANGE),
    19: ("too bright for it: overload", Fault.OVER_RANGE),
    20: ("has no signal to synchronise to", Fault.REFUSED),
    21: ("its memory (RAM) fails", Fault.REFUSED),
    29: ("its data are corrupted", Fault.REFUSED),
    30: ("its signal is noisy", Fault.REFUSED),
}


class Pr655(SerialMeter):
    """The PR-655; parameters as of `SerialMeter`."""

    driver = "pr655"
    maker, model, line = "Photo Research", "PR-655", LINE
    longest = LONGEST
    interval = 0.05  # [s] between two characters that are sent, as Psychtoolbox leaves
    wake = "Switch it on, wait for its menu, and let no other program use it"
    zero_is_a_reading = False
    _serial_number = _firmware = ""

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument said of itself when it was opened."""
        return {
            "model": f"Photo Research {self.model}",
            "serial number": self._serial_number,
            "firmware": self._firmware,
        }

    def _begin(self) -> None:
        self._enter_remote_mode()
        model = self._answer("D111")
        if self.model not in model:
            name = model.strip().lower().replace("-", "")
            raise self._error(
                f"it is a {model.strip()}; name it {name}"
                if re.fullmatch(r"pr6\d\d", name)
                else f"it says that it is {model.strip()!r}",
                Fault.WRONG_INSTRUMENT,
            )
        self._serial_number = self._answer("D110").strip()
        self._require_copy(self._serial_number, self._answer("D110").strip())  # a landmark from here on
        self._firmware = self._answer("D114").strip()
        self._answer("SU1")

    def _enter_remote_mode(self) -> None:
        """Send the word that starts it, which an instrument that is in it already takes for a command."""
        self._link.write(b"PHOTO", self.interval)
        try:
            self._link.read_until(REMOTE_MODE, min(ENTERING_TIME, self._timeout))
            return
        except InstrumentError as error:
            if error.fault is not Fault.NO_REPLY:
                raise
        self._link.write(b"\r")
        line = self._next_line(skip=lambda line: REMOTE_MODE.decode() in line)  # late
        if not CODE.fullmatch(line):
            raise self._error(f"answers {line!r}, which is no {self.model}'s reply", Fault.WRONG_INSTRUMENT)
        self._link.forget()

    def _send_landmark(self) -> None:
        """Ask for the serial number, which no measurement looks like."""
        self._send("D110")

    def _is_landmark(self, line: str) -> bool:
        code, _, rest = line.partition(",")
        return bool(CODE.fullmatch(code)) and rest.strip() == self._serial_number

    def _measure(self) -> MeterAnswer:
        found = READING.fullmatch(line := self._answer("M1"))
        if found is None:
            raise self._error(f"sent {line!r}, which is no reading", Fault.GARBLED)
        for _ in range(self._n_checks()):
            self._require_copy(line, self._answer("D1"))
        units = int(found[1])
        if units not in LUMINANCE_UNITS:
            what = OTHER_UNITS.get(units, "in units that its manual does not have")
            raise self._error(f"measures {what}: take the accessory off", Fault.REFUSED, found[1])
        luminance, x, y = (float(found[place]) for place in (2, 3, 4))
        return luminance, FINE, (x, y)

    def _leave(self) -> None:
        """Leave remote mode; it does not answer."""
        self._link.write(b"Q")

    def _answer(self, command: str) -> str:
        """Send a command, and return what comes after the code of its reply, if that is no error."""
        self._send(command)
        line = self._next_line()
        code, _, rest = line.partition(",")
        if not CODE.fullmatch(code):
            raise self._error(f"sent {line!r}, which has no code", Fault.GARBLED)
        if int(code) != 0:
            words, fault = ERROR_CODES.get(int(code), ("see this error in its manual", Fault.REFUSED))
            raise self._error(f"{words} (error {int(code)})", fault, str(int(code)))
        return rest

    def _send(self, command: str) -> None:
        self._link.write(command.encode() + b"\r", self.interval)


class Pr670(Pr655):
    """The PR-670; parameters as of `Pr655`."""

    driver, model = "pr670", "PR-670"


class Pr650(SerialMeter):
    """The older PR-650, over RS-232 only; parameters as of `SerialMeter`."""

    driver = "pr650"
    maker, model, line = "Photo Research", "PR-650", LINE
    longest = LONGEST
    wake = "Switch it off and on, and connect within 5 s"
    zero_is_a_reading = False

    def apparatus(self) -> dict[str, str]:
        """Return what is known of the instrument: it is not asked for more."""
        return {"model": "Photo Research PR-650, as named", "settings": PR650_SET_UP.decode().strip()}

    def _begin(self) -> None:
        for command in (PR650_BACKLIGHT_ON, PR650_SET_UP):
            self._link.write(command)
            line = self._next_line(skip=self._is_landmark)
            if not PR650_CODE.fullmatch(line):
                raise self._error(
                    "answers as a PR-655 or PR-670 does: name it pr655 or pr670"
                    if re.fullmatch(r"-\d{4}", line)
                    else f"answers {line!r}, which is no PR-650's reply",
                    Fault.WRONG_INSTRUMENT,
                )
            self._refuse(int(line))

    def _send_landmark(self) -> None:
        """Ask for the last measurement: its answer has five fields, that to every other command one."""
        self._link.write(PR650_TRISTIMULUS)

    def _is_landmark(self, line: str) -> bool:
        return line.count(",") == 4

    def _measure(self) -> MeterAnswer:
        self._link.write(PR650_MEASURE)
        line = self._next_line()
        if not PR650_CODE.fullmatch(line):
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED)
        self._refuse(int(line))
        found = PR650_VALUES.fullmatch(line := self._values())
        if found is None:
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED)
        for _ in range(self._n_checks()):
            self._require_copy(line, self._values())
        self._refuse(int(found[1]))
        if int(found[2]) != PR650_LUMINANCE_UNITS:
            raise self._error(f"its units are not cd/m^2 (code {found[2]})", Fault.REFUSED, found[2])
        X, Y, Z = (float(found[place]) for place in (3, 4, 5))
        total = X + Y + Z
        return Y, "00", (X / total, Y / total) if total > 0 else None

    def _values(self) -> str:
        self._ask_landmark()
        line = self._next_line()
        self._n_due -= self._is_landmark(line)
        return line

    def _refuse(self, code: int) -> None:
        if code != 0:
            words, fault = PR650_QUALITY.get(code, ("a code that its manual does not have", Fault.REFUSED))
            raise self._error(f"{words} (quality code {code})", fault, str(code))

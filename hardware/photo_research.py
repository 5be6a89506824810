"""Photo Research spectroradiometers PR-655 and PR-670, over USB or RS-232.

Written from the commands as public drivers and quotations of the manual have them, and tested against
emulators, not against instruments. They take one character at a time.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.serial_link import LineSettings
from evenlight.hardware.serial_meter import Found, SerialMeter

REPLY_TIME = 60.0  # [s] a PR-670 exposes for up to 30 s, and as long again for its dark signal
ENTERING_TIME = 2.0  # [s] in which it reports remote mode
BETWEEN_CHARACTERS = 0.05  # [s] as Psychtoolbox leaves
REMOTE_MODE = b"REMOTE MODE"
CODE = re.compile(r"-?\d{4,5}|-\d{1,3}")
FINE = "0000"
OTHER_UNITS = {  # of what is no luminance, by the second field of a reading
    "11": "radiance",
    "12": "irradiance",
    "112": "illuminance",
    "13": "radiant intensity",
    "113": "luminous intensity",
    "14": "radiant flux",
    "114": "luminous flux",
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
    -1001: ("too many fields in a setting", Fault.REFUSED),
    -1002: ("no such primary accessory", Fault.REFUSED),
    -1003: ("no such add-on accessory 1", Fault.REFUSED),
    -1004: ("no such add-on accessory 2", Fault.REFUSED),
    -1005: ("the accessory is no primary one", Fault.REFUSED),
    -1006: ("the accessory is no add-on", Fault.REFUSED),
    -1007: ("the accessory is selected already", Fault.REFUSED),
    -1008: ("no such aperture", Fault.REFUSED),
    -1009: ("no such system of units", Fault.REFUSED),
    -1010: ("no such exposure: 3 to 6000 ms on a PR-655, 6 to 30000 ms on a PR-670", Fault.REFUSED),
    -1011: ("no such gain", Fault.REFUSED),
    -1012: ("no such number of averages: 1 to 99", Fault.REFUSED),
    -1015: ("no such observer: 2 or 10 degrees", Fault.REFUSED),
    -1017: ("no such dark mode", Fault.REFUSED),
    -1019: ("no such synchronisation mode", Fault.REFUSED),
    -1021: ("the title is too long", Fault.REFUSED),
    -1022: ("the title is empty", Fault.REFUSED),
    -1023: ("no such frequency: 20 to 400 Hz", Fault.REFUSED),
    -1024: ("no such recall command", Fault.REFUSED),
    -1025: ("no such add-on accessory 3", Fault.REFUSED),
    -1026: ("no such sensitivity", Fault.REFUSED),
    -1035: ("this instrument has no such setting", Fault.REFUSED),
    -2000: ("it has no such data", Fault.REFUSED),
}


class Pr655(SerialMeter):
    """The PR-655.

    Parameters
    ----------
    url : str
        A port, or a URL of pyserial.
    clock : callable, optional
        Of the readings' times [s].
    timeout : float, optional
        How long a reply may take [s].
    interval : float, optional
        Between two characters that are sent [s].
    """

    model = "PR-655"
    wake = "Switch it on, wait for its menu, and let no other program use it"
    zero_is_a_reading = False

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        timeout: float | None = None,
        interval: float = BETWEEN_CHARACTERS,
    ) -> None:
        self._interval = interval
        self._serial_number = self._firmware = ""
        settings = LineSettings(9600, timeout=REPLY_TIME if timeout is None else timeout)
        super().__init__(url, settings, f"Photo Research {self.model}", clock)

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument said of itself when it was opened."""
        return {
            "model": f"Photo Research {self.model}",
            "serial number": self._serial_number,
            "firmware": self._firmware,
        }

    def _begin(self) -> None:
        """Enter remote mode, refuse another model, and set SI units."""
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
        self._firmware = self._answer("D114").strip()
        self._answer("SU1")

    def _enter_remote_mode(self) -> None:
        """Send the word that starts it, which an instrument that is in it already takes for a command."""
        self._link.write(b"PHOTO", self._interval)
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

    def _resynchronise(self) -> None:
        """Ask for the serial number, which no measurement looks like."""
        self._send("D110")
        self._wait_for_line(self._is_serial_number)

    def _measure(self) -> Found:
        """Ask for luminance and chromaticity: code, units, Y, x, y."""
        fields = self._answer("M1").split(",")
        if len(fields) < 4:
            raise self._error(f"sent {','.join(fields)!r}, which is no reading", Fault.GARBLED)
        units = fields[0].strip()
        if units in OTHER_UNITS:
            raise self._error(f"measures {OTHER_UNITS[units]}: take the accessory off", Fault.REFUSED, units)
        luminance, x, y = (self._number(field) for field in fields[1:4])
        return Found(luminance, FINE, (x, y))

    def _leave(self) -> None:
        """Leave remote mode; it does not answer."""
        self._link.write(b"Q")

    def _answer(self, command: str) -> str:
        """Send a command, and return what comes after the code of its reply, if that is no error."""
        self._link.forget()
        self._send(command)
        line = self._next_line(skip=self._is_late(command))
        code, _, rest = line.partition(",")
        if not CODE.fullmatch(code.strip()):
            raise self._error(f"sent {line!r}, which has no code", Fault.GARBLED)
        if int(code) != 0:
            words, fault = ERROR_CODES.get(
                int(code), ("an error that its manual does not have", Fault.REFUSED)
            )
            raise self._error(f"{words} (error {int(code)})", fault, str(int(code)))
        return rest

    def _is_late(self, command: str) -> Callable[[str], bool]:
        """Return what tells a late answer to `_resynchronise` from that to a command."""
        return lambda line: command.startswith("M") and self._is_serial_number(line)

    def _is_serial_number(self, line: str) -> bool:
        """Return whether a line is the answer to `_resynchronise`."""
        code, _, rest = line.partition(",")
        return bool(CODE.fullmatch(code)) and rest.strip() == self._serial_number

    def _send(self, command: str) -> None:
        """Send a command, one character at a time."""
        self._link.write(command.encode() + b"\r", self._interval)

    def _number(self, field: str) -> float:
        """Return the number in a field."""
        try:
            return float(field)
        except ValueError:
            raise self._error(f"sent {field!r} instead of a number", Fault.GARBLED) from None


class Pr670(Pr655):
    """The PR-670; parameters as of `Pr655`."""

    model = "PR-670"

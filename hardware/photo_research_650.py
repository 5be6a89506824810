"""The older Photo Research PR-650, over RS-232.

Written from the commands and quality codes as public drivers have them, and tested against an emulator, not
against an instrument.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from evenlight.hardware.protocols import Fault
from evenlight.hardware.serial_link import LineSettings
from evenlight.hardware.serial_meter import Found, SerialMeter

REPLY_TIME = 60.0  # [s] it exposes for up to 6 s, more than once, and has been slow since 1993
BACKLIGHT_ON = b"b1\n"
SET_UP = b"s01,,,,,,01,1\n"  # the lens MS-75, one exposure for a reading, SI units
MEASURE = b"m0\n"
TRISTIMULUS = b"d2\n"  # quality, units, X, Y, Z of the last measurement
CODE = re.compile(r"-?\d{1,3}")
N_FIELDS = 5
SI_UNITS = 0

QUALITY: dict[int, tuple[str, Fault]] = {
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


class Pr650(SerialMeter):
    """The PR-650.

    Parameters
    ----------
    url : str
        A port, or a URL of pyserial.
    clock : callable, optional
        Of the readings' times [s].
    timeout : float, optional
        How long a reply may take [s].
    """

    wake = "Switch it off and on, and connect within 5 s"
    zero_is_a_reading = False

    def __init__(
        self, url: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        settings = LineSettings(9600, timeout=REPLY_TIME if timeout is None else timeout)
        super().__init__(url, settings, "Photo Research PR-650", clock)

    def apparatus(self) -> dict[str, str]:
        """Return what is known of the instrument: it is not asked for more."""
        return {"model": "Photo Research PR-650, as named", "settings": SET_UP.decode().strip()}

    def _begin(self) -> None:
        """Light its display, and set lens, exposures and units."""
        for command in (BACKLIGHT_ON, SET_UP):
            self._link.write(command)
            line = self._next_line(skip=_is_tristimulus)
            if not CODE.fullmatch(line):
                raise self._error(
                    "answers as a PR-655 or PR-670 does: name it pr655 or pr670"
                    if re.fullmatch(r"-\d{4}", line)
                    else f"answers {line!r}, which is no PR-650's reply",
                    Fault.WRONG_INSTRUMENT,
                )
            self._refuse(int(line))

    def _resynchronise(self) -> None:
        """Ask for the last measurement: its answer has five fields, that to every other command one."""
        self._link.write(TRISTIMULUS)
        self._wait_for_line(_is_tristimulus)

    def _measure(self) -> Found:
        """Measure, then ask for X, Y and Z."""
        self._link.forget()
        self._link.write(MEASURE)
        line = self._next_line(skip=_is_tristimulus)  # late, of an earlier measurement
        if not CODE.fullmatch(line):
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED)
        self._refuse(int(line))
        self._link.write(TRISTIMULUS)
        line = self._next_line()
        try:
            quality, units = (int(field) for field in line.split(",")[:2])
            X, Y, Z = (float(field) for field in line.split(",")[2:])
        except ValueError:
            raise self._error(f"sent {line!r}, which cannot be read", Fault.GARBLED) from None
        self._refuse(quality)
        if units != SI_UNITS:
            raise self._error(f"its units are not cd/m^2 (code {units})", Fault.REFUSED, str(units))
        total = X + Y + Z
        return Found(Y, "00", (X / total, Y / total) if total > 0 else None)

    def _refuse(self, code: int) -> None:
        """Refuse a quality code that is not that of a good measurement."""
        if code != 0:
            words, fault = QUALITY.get(code, ("a code that its manual does not have", Fault.REFUSED))
            raise self._error(f"{words} (quality code {code})", fault, str(code))


def _is_tristimulus(line: str) -> bool:
    """Return whether a line is the answer to `TRISTIMULUS`."""
    return line.count(",") == N_FIELDS - 1

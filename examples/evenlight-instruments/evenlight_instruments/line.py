"""The line to the instruments: `#7 L?` is answered `#7 123.4 *1B`, with the question's number and a checksum.

The number tells a late or repeated answer from that to the question, and the checksum a damaged one from a
whole one. An instrument without either needs more care: see `hardware/drivers/serial_meter.py` of Evenlight.
"""

import re
import time

from evenlight import Fault, InstrumentError, LineSettings, SerialLink

SETTINGS = LineSettings(baud_rate=115200, terminator=b"\n", timeout=2.0)  # page 7 of a manual names them
ANSWER = re.compile(r"#(\d+) (\S+) \*([0-9A-F]{2})")


def checksum(text: str) -> str:
    """Return the sum of the characters, as two hexadecimal digits."""
    return f"{sum(text.encode()) % 256:02X}"


class NumberedLine:
    """A port, a question and its answer at a time; `timeout` is how long that may take [s]."""

    def __init__(self, url: str, device: str, timeout: float | None) -> None:
        self._link = SerialLink(url, SETTINGS, device)
        self._timeout = SETTINGS.timeout if timeout is None else timeout
        self._number = 0
        self.name = self._link.name

    def ask(self, command: str) -> float:
        """Return the number that a command is answered with."""
        self._number += 1
        self._link.write(f"#{self._number} {command}\n".encode())
        end = time.monotonic() + self._timeout
        while True:
            line = self._link.read_line(max(end - time.monotonic(), 0.0))
            found = ANSWER.fullmatch(line)
            if found is None or checksum(f"#{found[1]} {found[2]} ") != found[3]:
                raise InstrumentError(f"{self.name}: sent {line[:40]!r}", Fault.GARBLED)
            if int(found[1]) == self._number:
                return self._value(found[2])

    def _value(self, word: str) -> float:
        """Return a number, or the instrument's own error."""
        if word == "E1":
            raise InstrumentError(f"{self.name}: too bright for it", Fault.OVER_RANGE, word)
        try:
            return float(word)
        except ValueError:
            raise InstrumentError(f"{self.name}: refused ({word})", Fault.REFUSED, word) from None

    def close(self) -> None:
        """Close the port."""
        self._link.close()

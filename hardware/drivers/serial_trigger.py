"""Triggers over a serial port: a byte with the code, or a pulse on one of the port's control lines."""

from __future__ import annotations

import threading
import time
from contextlib import suppress

from evenlight.hardware.drivers.power_sampling import split_address
from evenlight.hardware.drivers.serial_link import BROKEN, LineSettings, SerialLink
from evenlight.hardware.protocols import InstrumentError

BAUD = {"baud": "baud rate of the serial port"}
PULSE_WIDTH = {"pulse_ms": "how long a pulse lasts [ms]"}
FASTEST = 0.2  # [s] a byte that a port has not taken by then would come too late
DEFAULT_PULSE = 5.0  # [ms] seen by recorders of 400 samples a second and more (choice)
APART = 0.001  # [s] between a pulse's end and the next; triggers closer than that share a pulse


class SerialTrigger(SerialLink):
    """Sends the code as one byte.

    Parameters
    ----------
    address : str
        Port, and "?baud=" with a baud rate where it is not 115200.
    """

    def __init__(self, address: str) -> None:
        port, options = split_address(address, "serial", BAUD)
        baud_rate = round(options.get("baud", 115200))
        super().__init__(port, LineSettings(baud_rate=baud_rate, timeout=FASTEST), "the trigger port")
        self._says = f"one byte at {baud_rate} baud, 8N1"

    def send(self, code: int, label: str) -> None:
        """Send the code; what the port still has to say is not waited for."""
        try:
            self._open_port().write(bytes((code,)))
        except BROKEN as error:
            raise self._broken(error) from None

    def apparatus(self) -> dict[str, str]:
        """Return what it sends."""
        return {"sends": self._says}


class RtsTrigger(SerialTrigger):
    """Sends a pulse on the control line RTS, the same for every code.

    Parameters
    ----------
    address : str
        Port, and "?pulse_ms=" with the length of a pulse where it is not 5 ms.
    """

    line = "rts"

    def __init__(self, address: str) -> None:
        port, options = split_address(address, self.line, PULSE_WIDTH)
        super().__init__(port)
        self._pulse = options.get("pulse_ms", DEFAULT_PULSE) / 1000
        self._says = f"a pulse of {1000 * self._pulse:g} ms on {self.line.upper()}"
        self._end_of_pulse: threading.Timer | None = None
        self._rose = self._fell = 0.0  # when the line last did [s]
        self._set(high=False)  # a port raises its lines when it is opened

    def send(self, code: int, label: str) -> None:
        """Raise the line; it falls by itself, or at once for a trigger that comes during its pulse."""
        if self._end_of_pulse is not None:
            if time.monotonic() < self._rose + APART:  # of the same flip
                return
            self._end_of_pulse.cancel()
            self._end_of_pulse.join()
            if self._fell < self._rose:
                self._fall()
            time.sleep(max(0.0, self._fell + APART - time.monotonic()))
        self._set(high=True)
        self._rose = time.monotonic()
        self._end_of_pulse = threading.Timer(self._pulse, self._fall)
        self._end_of_pulse.start()

    def close(self) -> None:
        """Wait for the end of the pulse, and let go of the port."""
        if self._end_of_pulse is not None and self._end_of_pulse is not threading.current_thread():
            self._end_of_pulse.join()
        super().close()

    def _set(self, *, high: bool) -> None:
        try:
            setattr(self._open_port(), self.line, high)
        except BROKEN as error:
            raise self._broken(error) from None

    def _fall(self) -> None:
        """Lower the line; if the port is gone, the next trigger tells of it."""
        with suppress(InstrumentError):
            self._set(high=False)
        self._fell = time.monotonic()


class DtrTrigger(RtsTrigger):
    """Sends a pulse on the line DTR."""

    line = "dtr"

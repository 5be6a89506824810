"""A PPK2 through the library ppk2-api, whose swallowed errors are brought to light again.

The library (GPLv2) is imported when an instrument is opened, and is not part of Evenlight. It logs an error
of the port and goes on, and it takes a calibration in part without a word: both end in an error here.
"""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.serial_link import refusal

if TYPE_CHECKING:
    import serial

QUIET = 0.1  # [s] without a byte: the instrument has ended its stream
LONGEST_STREAM = 10.0  # [s] in which it must have
LINES = [f"{name}{index}" for name in ("R", "GS", "GI", "O", "S", "I", "UG") for index in range(5)]
FIELDS = ("Calibrated", *LINES, "HW", "IA")  # of the calibration that it tells


class Ppk2Port:
    """An open PPK2.

    Parameters
    ----------
    port : str
        Its serial port.
    timeout : float
        How long it may take to write [s].

    Raises
    ------
    InputError
        If the library is not installed.
    InstrumentError
        If there is no such port, or what answers is no PPK2.
    """

    def __init__(self, port: str, timeout: float) -> None:
        library = _library()
        self.name = f"the PPK2 at {port}"
        try:
            self._api: Any = library.PPK2_API(port, timeout=0, write_timeout=timeout, exclusive=True)
        except (OSError, ValueError) as error:
            raise refusal(self.name, error) from None
        self._port = _HonestPort(self._api.ser)
        self._api.ser = self._port
        try:
            self.command(self._api.stop_measuring)  # a program that crashed may have left it streaming
            self.drain()
            self.calibration = self._read_calibration()
        except BaseException:
            self.close()
            raise

    def use_as_ampere_meter(self, voltage: float) -> None:
        """Measure the current of a panel with its own supply, of a voltage [V], and let it through."""
        self.command(self._api.use_ampere_meter)
        self.command(self._api.set_source_voltage, round(voltage * 1000))
        self.command(self._api.toggle_DUT_power, "ON")

    def start(self) -> None:
        """Begin to stream."""
        self._api.remainder = {"sequence": b"", "len": 0}
        self.command(self._api.start_measuring)

    def stop(self) -> bytes:
        """End the stream, and return what was still on its way."""
        self.command(self._api.stop_measuring)
        return self.drain()

    def read(self) -> bytes:
        """Return what has come; at once."""
        parts = []
        while part := self._guarded(self._api.get_data):
            parts.append(part)
        return b"".join(parts)

    def drain(self) -> bytes:
        """Return what comes until nothing more does."""
        parts, begun = [], time.monotonic()
        last = begun
        while time.monotonic() < last + QUIET:
            if part := self.read():
                parts.append(part)
                last = time.monotonic()
            else:
                time.sleep(QUIET / 20)
            if last > begun + LONGEST_STREAM:
                raise InstrumentError(
                    f"{self.name}: does not stop streaming; unplug it, and plug it in again", Fault.GARBLED
                )
        return b"".join(parts)

    def currents(self, words: bytes) -> list[float]:
        """Return the currents that whole words hold [A], by the library's calibration."""
        if not words:
            return []
        microamperes, _ = self._api.get_samples(words)
        return [current * 1e-6 for current in microamperes]

    def command(self, send: Any, *arguments: Any) -> None:
        """Let the library send a command, and raise what it swallows."""
        self._guarded(send, *arguments)
        if (error := self._port.swallowed()) is not None:
            raise self._broken(error)

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        self._port.close()

    def _guarded(self, call: Any, *arguments: Any) -> Any:
        """Return what a call of the library returns; an error of the port closes it."""
        if self._port.is_closed():
            raise InstrumentError(f"{self.name}: is no longer connected", Fault.DISCONNECTED)
        try:
            return call(*arguments)
        except (OSError, TypeError) as error:  # TypeError: pyserial's, where the file is gone in between
            raise self._broken(error) from None

    def _broken(self, error: Exception) -> InstrumentError:
        """Close the port, and return the error of a connection that is gone."""
        self.close()
        return InstrumentError(f"{self.name}: the connection broke ({error})", Fault.DISCONNECTED)

    def _read_calibration(self) -> dict[str, str]:
        """Return the calibration that the instrument tells, once the library has taken all of it."""
        self._port.listen()
        try:
            taken = self._guarded(self._api.get_modifiers)
        except UnicodeDecodeError:
            taken = None
        heard = self._port.heard()
        if self._port.swallowed() is not None or not heard:
            raise InstrumentError(
                f"{self.name}: no reply; a PPK2 has two ports, is it the other one?", Fault.NO_REPLY
            )
        said = dict(re.findall(r"^(\w+): (\S+)\r?$", heard.decode("ascii", errors="replace"), re.MULTILINE))
        if not any(field in said for field in FIELDS):
            raise _stranger(self.name, heard)
        missing = [field for field in FIELDS if field not in said]
        if not taken or missing:
            raise InstrumentError(
                f"{self.name}: its calibration came in part; {', '.join(missing) or 'END'} is missing",
                Fault.GARBLED,
            )
        return said


class _HonestPort:
    """The port that the library writes to and reads from: it keeps the errors that the library swallows."""

    def __init__(self, port: serial.Serial) -> None:
        self._port, self._error = port, list[OSError]()
        self._heard: bytearray | None = None

    @property
    def in_waiting(self) -> int:  # an attribute, as the library reads it
        """How many bytes have come."""
        return self._port.in_waiting

    def read(self, size: int) -> bytes:
        """Return some of them."""
        data = bytes(self._port.read(size))
        if self._heard is not None:
            self._heard += data
        return data

    def write(self, data: bytes) -> None:
        """Send some bytes, and keep the error if they cannot be sent."""
        try:
            self._port.write(data)
        except OSError as error:
            self._error.append(error)

    def swallowed(self) -> OSError | None:
        """Return the first error since the last call."""
        errors, self._error = self._error, []
        return errors[0] if errors else None

    def listen(self) -> None:
        """Keep what is read from now on."""
        self._heard = bytearray()

    def heard(self) -> bytes:
        """Return what was read since `listen`, and keep no more."""
        heard, self._heard = bytes(self._heard or b""), None
        return heard

    def is_closed(self) -> bool:
        """Return whether the port is closed."""
        return not self._port.is_open

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        self._port.close()


def _library() -> Any:
    """Return the library, if it is installed."""
    try:
        from ppk2_api import ppk2_api
    except ImportError:
        raise InputError(
            "ppk2: needs the extra of instruments: pip install 'evenlight[instruments]' (ppk2-api)"
        ) from None
    return ppk2_api


def _stranger(name: str, heard: bytes) -> InstrumentError:
    """Return the error of an answer that no PPK2 gives."""
    text = heard.decode("ascii", errors="replace").strip()
    if text.isascii() and text.isprintable():
        return InstrumentError(
            f"{name}: answers {text[:60]!r}, and is no PPK2; which instrument is at this port?",
            Fault.WRONG_INSTRUMENT,
        )
    return InstrumentError(f"{name}: its calibration cannot be read; it sent {heard[:20]!r}", Fault.GARBLED)

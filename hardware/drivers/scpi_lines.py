"""Lines to a SCPI instrument: a socket, a serial port, and all that PyVISA reaches."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING, Protocol

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.scpi_answers import SHOWN
from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.protocols import Fault, InstrumentError

if TYPE_CHECKING:
    from typing import Any

SCPI_PORT = 5025  # registered with IANA as scpi-raw
SERIAL_LINE = LineSettings(  # assumed: a frequent factory setting; the end of a line is SCPI-99's, LF
    baud_rate=9600, data_bits=8, parity="N", stop_bits=1, terminator=b"\n"
)
DEVICE = "the SCPI instrument"
QUIET = 0.03  # [s] without a byte: what is late has come; what comes later yet shows at the next answer
VISA_TIMEOUTS = ("VI_ERROR_TMO",)
VISA_BUSY = ("VI_ERROR_RSRC_BUSY", "VI_ERROR_RSRC_LOCKED")
NOISY = 2.0  # [s] after which a port that is never quiet is no SCPI instrument's


class ScpiLine(Protocol):
    """What questions are sent over, and answers come back on."""

    name: str

    def write(self, question: str) -> None:
        """Send a command or question."""

    def answer(self, timeout: float) -> str:
        """Return the next line; NO_REPLY if none comes in time [s]."""

    def answer_waiting(self, longest: float) -> str | None:
        """Return the next line if it is there, None if not; wait so long [s] where it cannot be looked at."""

    def is_quiet(self) -> bool:
        """Return whether nothing is there that was not asked for, where the line can be looked at."""

    def forget(self) -> None:
        """Throw away what comes, until nothing more does."""

    def close(self) -> None:
        """Let go of the line; more than once does nothing."""


class SocketLine:
    """A raw socket, "HOST", "HOST:PORT", or the path of a serial port.

    Parameters
    ----------
    place : str
        Where.
    timeout : float
        How long an answer may take [s].
    """

    def __init__(self, place: str, timeout: float) -> None:
        url = port_url(place)
        settings = dataclasses.replace(SERIAL_LINE, timeout=timeout)
        self._link, self._lines = SerialLink(url, settings, DEVICE), list[str]()
        self.name = self._link.name

    def write(self, question: str) -> None:
        """Send a command or question."""
        self._link.write(f"{question}\n".encode("ascii"))

    def answer(self, timeout: float) -> str:
        """Return the next line; NO_REPLY if none comes in time [s]."""
        return (self._lines.pop(0) if self._lines else self._link.read_line(timeout)).strip()

    def answer_waiting(self, longest: float) -> str | None:
        """Return the next line if it is there, None if not."""
        self._lines += self._link.lines_waiting()
        return self._lines.pop(0).strip() if self._lines else None

    def is_quiet(self) -> bool:
        """Return whether nothing is there that was not asked for."""
        return not self._lines and not self._link.forget()

    def forget(self) -> None:
        """Throw away what comes, until nothing more does; WRONG_INSTRUMENT if it never ends."""
        self._lines.clear()
        begun = last = time.monotonic()
        while time.monotonic() < last + QUIET:
            if came := self._link.forget():
                last = time.monotonic()
            if last > begun + NOISY:
                raise _never_quiet(self.name, came.decode("ascii", errors="replace"))
            time.sleep(QUIET / 20)

    def close(self) -> None:
        """Let go of the line; more than once does nothing."""
        self._link.close()


class VisaLine:
    """A resource of PyVISA: USB, GPIB, VXI-11, a socket.

    Parameters
    ----------
    resource : str
        As PyVISA names it.
    timeout : float
        How long an answer may take [s].
    backend : str, optional
        Of PyVISA, "@py" for PyVISA-py; PyVISA's own choice, and PyVISA-py where there is no other.

    Raises
    ------
    InputError
        If PyVISA is not installed.
    InstrumentError
        If the resource cannot be opened.
    """

    def __init__(self, resource: str, timeout: float, backend: str = "") -> None:
        self.name, self._timeout = f"{DEVICE} at {resource}", timeout
        self._manager = _visa_manager(backend)
        self._resource: Any = None
        try:
            self._resource = self._manager.open_resource(
                resource, read_termination="\n", write_termination="\n", timeout=round(timeout * 1000)
            )
        except Exception as error:  # PyVISA's own, and those of its backends
            self.close()
            raise self._failed(error, Fault.NOT_FOUND) from None

    def write(self, question: str) -> None:
        """Send a command or question."""
        try:
            self._open().write(question)
        except Exception as error:
            raise self._failed(error, Fault.DISCONNECTED) from None

    def answer(self, timeout: float) -> str:
        """Return the next line; NO_REPLY if none comes in time [s]."""
        resource = self._open()
        try:
            resource.timeout = round(timeout * 1000)
            return str(resource.read()).strip()
        except UnicodeDecodeError:
            raise InstrumentError(f"{self.name}: sent what is no text", Fault.GARBLED) from None
        except Exception as error:
            raise self._failed(error, Fault.DISCONNECTED) from None

    def answer_waiting(self, longest: float) -> str | None:
        """Return the next line, which is waited for [s]: a VISA resource cannot be looked at."""
        return self.answer(max(longest, 0.0))

    def is_quiet(self) -> bool:
        """Return True: it cannot be looked at."""
        return True

    def forget(self) -> None:
        """Throw away what comes, until nothing more does; WRONG_INSTRUMENT if it never ends."""
        end, came = time.monotonic() + NOISY, ""
        while time.monotonic() < end:
            try:
                came = self.answer(QUIET)
            except InstrumentError as error:
                if error.fault is Fault.GARBLED:
                    continue
                if error.fault is Fault.NO_REPLY:
                    return
                raise
        raise _never_quiet(self.name, came)

    def close(self) -> None:
        """Let go of the line; more than once does nothing."""
        resource, self._resource = self._resource, None
        try:
            if resource is not None:
                resource.close()
        finally:
            self._manager.close()

    def _open(self) -> Any:
        """Return the resource, if it is open."""
        if self._resource is None:
            raise InstrumentError(f"{self.name}: is no longer connected", Fault.DISCONNECTED)
        return self._resource

    def _failed(self, error: Exception, otherwise: Fault) -> InstrumentError:
        """Return what an error of PyVISA's says; a connection that is gone is closed."""
        code = str(getattr(error, "abbreviation", ""))
        if code in VISA_TIMEOUTS:
            return InstrumentError(
                f"{self.name}: no reply; is it switched on, does it speak SCPI, and has another program hold "
                "of it?",
                Fault.NO_REPLY,
                code,
            )
        if code in VISA_BUSY:
            return InstrumentError(
                f"{self.name}: is in use by another program; end that first", Fault.BUSY, code
            )
        if self._resource is not None:
            self.close()
        if isinstance(error, ConnectionRefusedError):  # PyVISA-py learns of it after it has opened a socket
            return InstrumentError(
                f"{self.name}: cannot be opened ({error}); is the instrument at this address, and its SCPI "
                "socket enabled?",
                Fault.NOT_FOUND,
                code,
            )
        return InstrumentError(f"{self.name}: cannot be reached ({error})", otherwise, code)


def port_url(place: str) -> str:
    """Return what a port is opened by.

    >>> port_url("192.0.2.7"), port_url("192.0.2.7:5555"), port_url("/dev/ttyUSB0")
    ('socket://192.0.2.7:5025', 'socket://192.0.2.7:5555', '/dev/ttyUSB0')
    """
    if "://" in place or place.startswith("/") or place.upper().startswith("COM"):
        return place
    return f"socket://{place}" if ":" in place else f"socket://{place}:{SCPI_PORT}"


def _never_quiet(name: str, came: str) -> InstrumentError:
    """Return the error of what sends on and on, unasked."""
    return InstrumentError(
        f"{name}: sends {came.strip()[:SHOWN]!r} and more without being asked; which instrument is there?",
        Fault.WRONG_INSTRUMENT,
    )


def _visa_manager(backend: str) -> Any:
    """Return PyVISA's manager of resources."""
    try:
        import pyvisa
    except ImportError:
        raise InputError(
            "visa: needs the extra: pip install '.[instruments]' in the checkout (pyvisa, pyvisa-py)"
        ) from None
    if backend:
        return pyvisa.ResourceManager(backend)
    try:
        return pyvisa.ResourceManager()
    except (OSError, ValueError):  # no VISA library of a vendor
        return pyvisa.ResourceManager("@py")

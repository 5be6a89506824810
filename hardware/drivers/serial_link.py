"""A line to an instrument over a serial port, or a socket: opened in one way, with one set of errors.

Every driver opens its port here, through `serial.serial_for_url`: "/dev/ttyUSB0", "COM3", or
"socket://127.0.0.1:5025". Whatever goes wrong ends in an `InstrumentError` that says which port, what was
asked and what came.

Parity is checked, which pyserial switches off in the computer's driver of the port: it is switched on again
after opening, and a byte that fails comes as NUL. Where a port hands over eight bits of a line of seven, as
those in a network and pseudo-terminals may, the eighth is the parity, and is checked here. Windows hands
over a byte that fails as if nothing were wrong: there it is not noticed.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from evenlight.data_schema.arguments import must_be_one_of, positive, text, whole
from evenlight.data_schema.errors import InputError
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError

try:
    import termios

    BROKEN: tuple[type[Exception], ...] = (OSError, termios.error)  # of a port that is gone
    HAS_TERMINALS = True
except ImportError:  # on Windows
    BROKEN = (OSError,)
    HAS_TERMINALS = False
GONE: tuple[type[Exception], ...] = (*BROKEN, TypeError)  # pyserial's, where the file is gone in between
NOT_OPENED: tuple[type[Exception], ...] = (*BROKEN, ValueError)

if TYPE_CHECKING:
    import serial

POLL = 0.002  # [s] between two looks at the port: a time-out is met to within it
AT_ONCE = 4096  # bytes
SHOWN = 60  # characters of what came that a message quotes
LONGEST_BURST = 1.0  # [s] in which a line falls silent, unless what is there never stops sending
SEVEN_BITS = bytes(value & 0x7F for value in range(256))


@dataclass(frozen=True, slots=True)
class LineSettings:
    """How a port talks."""

    baud_rate: int = 9600  # bits per second; a socket and a USB port that only looks serial take any
    data_bits: int = 8  # 7 or 8
    parity: str = "N"  # "N", "E" or "O"
    stop_bits: int = 1  # 1 or 2
    terminator: bytes = b"\r\n"  # what ends a line that the instrument sends
    timeout: float = 5.0  # how long a reply may take [s]

    def __post_init__(self) -> None:
        if whole("baud_rate", self.baud_rate) == 0:
            raise InputError("baud_rate must be above 0, got 0")
        for name, kind, known in (
            ("data_bits", int, (7, 8)),
            ("parity", str, "NEO"),
            ("stop_bits", int, (1, 2)),
        ):
            value = getattr(self, name)
            if not (isinstance(value, kind) and value in tuple(known)):
                raise must_be_one_of(name, value, known)
        if not (isinstance(self.terminator, bytes) and self.terminator):
            raise InputError(f"terminator must be at least one byte, got {self.terminator!r}")
        positive("timeout", self.timeout)


class SerialLink(ContextDevice):
    """An open port to an instrument.

    Parameters
    ----------
    url : str
        A port, or a URL of pyserial.
    settings : LineSettings
        How it talks.
    device : str
        The instrument, as messages name it.
    clock : callable, optional
        For time-outs [s].

    Raises
    ------
    InputError
        If an argument is of another kind.
    InstrumentError
        If there is no such port, it may not be opened, or another program holds it.
    """

    def __init__(
        self, url: str, settings: LineSettings, device: str, clock: Callable[[], float] | None = None
    ) -> None:
        text("url", url)
        if not isinstance(settings, LineSettings):
            raise InputError(f"settings must be LineSettings, got {settings!r}")
        if not (clock is None or callable(clock)):
            raise InputError(f"clock must be a function, got {clock!r}")
        self.name = self._name = f"{text('device', device)} at {url}"
        self._settings = settings
        self._clock = time.monotonic if clock is None else clock
        self._came = b""  # read from the port, not yet taken
        self._port: serial.SerialBase | None = _open(url, settings, self.name)

    @property
    def is_open(self) -> bool:
        """Whether the port is open: no more after the instrument was disconnected."""
        return self._port is not None

    def write(self, data: bytes, pause_between: float = 0.0) -> None:
        """Send bytes; one at a time with a pause between them where an instrument takes no more [s]."""
        parts = [data[i : i + 1] for i in range(len(data))] if pause_between else [data]
        for number, part in enumerate(parts):
            if number and pause_between:
                time.sleep(pause_between)
            try:
                self._open_port().write(part)
                self._open_port().flush()
            except BROKEN as error:
                raise self._broken(error) from None

    def read_line(self, timeout: float | None = None) -> str:
        """Return the next line without its terminator, as ASCII.

        Parameters
        ----------
        timeout : float, optional
            How long it may take, in place of the settings' [s].

        Raises
        ------
        InstrumentError
            NO_REPLY if nothing comes; GARBLED if a line breaks off, or is not ASCII; DISCONNECTED.
        """
        line = self.read_until(self._settings.terminator, timeout)
        try:
            return line.decode("ascii")
        except UnicodeDecodeError:
            raise self._error(
                f"sent what is no text, {_quoted(line)}; are baud rate and parity right?", Fault.GARBLED
            ) from None

    def read_until(self, end_of_it: bytes, timeout: float | None = None) -> bytes:
        """Return what comes before some bytes, which are taken, too: of a reply that has no terminator.

        It takes as long, and raises the same errors, as `read_line`.
        """
        end = self._clock() + (self._settings.timeout if timeout is None else timeout)
        while (place := self._text(self._came).find(end_of_it)) < 0:
            if self._clock() >= end:
                raise self._missing()
            self._came += self._take()
        whole = place + len(end_of_it)
        came, self._came = self._came[:whole], self._came[whole:]
        self._require_parity(came)
        return self._text(came)[:place]

    def lines_waiting(self) -> list[str]:
        """Return the whole lines that are there; return at once. What is no text keeps its place as "?"."""
        self._came += self._take(at_once=True)
        *lines, self._came = self._came.split(self._settings.terminator)
        return [line.decode("ascii", errors="replace") for line in lines]

    def forget(self, quiet: float = 0.0) -> bytes:
        """Throw away what has come, until nothing more came for some time [s]; return what it was.

        Before a question it clears what was not asked for; after a time-out it waits for a late reply.

        Raises
        ------
        InstrumentError
            GARBLED if what is there never stops sending.
        """
        thrown, self._came = self._came, b""
        end = self._clock() + quiet
        last = end + LONGEST_BURST
        while self._clock() < last:
            part = self._take(at_once=quiet == 0)
            thrown += part
            if part:
                end = self._clock() + quiet
            elif self._clock() >= end:
                return self._text(thrown)
        raise self._error(f"never stops sending, beginning with {_quoted(thrown)}", Fault.GARBLED)

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        if self._port is not None:
            port, self._port = self._port, None
            own_socket = getattr(port, "_socket", None)  # pyserial leaves it open where the other end is gone
            port.close()
            if own_socket is not None:
                own_socket.close()

    def _take(self, *, at_once: bool = False) -> bytes:
        """Return what has come; wait a moment if nothing has, unless it is wanted at once."""
        try:
            came = self._open_port().read(AT_ONCE)
            if not came and not at_once:
                _await_bytes(self._open_port(), POLL)
                came = self._open_port().read(AT_ONCE)
            return bytes(came)
        except GONE as error:
            raise self._broken(error) from None

    def _text(self, came: bytes) -> bytes:
        """Return bytes without the parity that a port may hand over on top of seven bits."""
        return came.translate(SEVEN_BITS) if self._settings.data_bits == 7 else came

    def _require_parity(self, came: bytes) -> None:
        """Refuse a line with a byte of the wrong parity: NUL, or, where the parity is handed over, that byte.

        Every line ends with CR LF, of which one has its eighth bit set then, whether parity is even or odd: a
        line without any eighth bit is one without its parity.
        """
        settings = self._settings
        if settings.parity == "N":
            return
        odd = settings.parity == "O"
        on_top = settings.data_bits == 7 and max(came, default=0) > 0x7F
        if 0 in came or (on_top and any(byte.bit_count() % 2 != odd for byte in came)):
            raise self._error(
                f"sent a byte of the wrong parity in {_quoted(self._text(came))}", Fault.GARBLED
            )

    def _open_port(self) -> serial.SerialBase:
        if self._port is None:
            raise self._error("is no longer connected", Fault.DISCONNECTED)
        return self._port

    def _missing(self) -> InstrumentError:
        came, self._came = self._came, b""
        if came:
            return self._error(f"its reply broke off after {_quoted(came)}", Fault.GARBLED)
        return self._error("no reply; is it switched on, and in remote mode?", Fault.NO_REPLY)

    def _broken(self, error: Exception) -> InstrumentError:
        try:
            self.close()
        except BROKEN:  # a port that is gone may not even close
            self._port = None
        return self._error(f"the connection broke ({error})", Fault.DISCONNECTED)


def _await_bytes(port: serial.SerialBase, seconds: float) -> None:
    try:
        select.select([port.fileno()], [], [], seconds)
    except (AttributeError, OSError, ValueError):  # a port that is no file, as on Windows
        time.sleep(seconds)


def _open(url: str, settings: LineSettings, name: str) -> serial.SerialBase:
    import serial

    own = {} if "://" in url else {"exclusive": True}  # a socket serves one client by itself
    try:
        port = serial.serial_for_url(
            url,
            baudrate=settings.baud_rate,
            bytesize=settings.data_bits,
            parity=settings.parity,
            stopbits=settings.stop_bits,
            xonxoff=False,
            rtscts=False,
            dsrdtr=False,  # no instrument here has flow control
            timeout=0,  # never set again: a pseudo-terminal takes 7 data bits only once
            write_timeout=settings.timeout,
            **own,
        )
        if settings.parity != "N" and HAS_TERMINALS and "://" not in url:
            _check_parity(port.fileno())
        return port
    except NOT_OPENED as error:
        raise port_error(name, error) from None


def _check_parity(terminal: int) -> None:
    """Have the computer's driver of a port check parity, and hand over NUL for a byte that fails."""
    settings = termios.tcgetattr(terminal)
    settings[0] = settings[0] & ~(termios.IGNPAR | termios.PARMRK) | termios.INPCK
    termios.tcsetattr(terminal, termios.TCSANOW, settings)


def port_error(name: str, error: Exception) -> InstrumentError:
    """Return the error of a port that cannot be opened, with what to do about it."""
    words = str(error).lower()
    if "exclusively lock" in words or "busy" in words or "access is denied" in words:
        return InstrumentError(f"{name}: the port is in use by another program; end that first", Fault.BUSY)
    if "permission" in words:
        return InstrumentError(
            f"{name}: may not be opened; on Linux, join the group dialout and log in again", Fault.NOT_FOUND
        )
    return InstrumentError(
        f"{name}: cannot be opened ({error}); `evenlight measure list` shows the ports there are",
        Fault.NOT_FOUND,
    )


def _quoted(came: bytes) -> str:
    text = came.decode("ascii", errors="backslashreplace")
    return repr(text[:SHOWN]) + ("…" if len(text) > SHOWN else "")

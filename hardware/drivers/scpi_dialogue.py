"""Questions to a SCPI instrument through PyVISA, paired with their answers (docs/decisions/power-meters.md).

A line that nobody asked for would shift all answers by one. So the instrument is asked for its name after
every answer, and the answer counts once the name has come, and comes next. After an error the line has to be
silent for as long as an answer may take.
"""

from __future__ import annotations

import contextlib
import functools
import re
import time
from collections.abc import Generator
from typing import Any, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.serial_link import port_error
from evenlight.hardware.protocols import TRANSIENT, ContextDevice, Fault, InstrumentError

LOOK = (
    0.005  # [s] that a look at a socket waits for a line; other resources than streams wait for their answer
)
QUIET, NOISY = 0.03, 2.0  # [s] without a byte: what is late has come; and when it never is, it is no SCPI
OPENING = 1.5  # [s] for its name, where a driver is opened: a wrong port is told soon
NAME = "*IDN?"
# IEEE 488.2: maker, model, serial number, firmware. Sentences of a GPS receiver ($) or of AIS (!) are others.
IDENTITY = re.compile(r"[^,$!][^,]*,[^,]*,[^,]*,.*")
IN_USE = ("VI_ERROR_RSRC_BUSY", "VI_ERROR_RSRC_LOCKED")
SHOWN = 60  # characters of an answer that a message quotes
Value = TypeVar("Value")


class ScpiDialogue(ContextDevice):
    """What is asked, and what is answered to it.

    Parameters
    ----------
    name, resource : str
        The instrument, as messages and as PyVISA name it.
    timeout : float
        How long an answer may take [s].
    backend : str, optional
        Of PyVISA, "@py" for PyVISA-py; else PyVISA's own choice, and PyVISA-py where there is no other.

    Raises
    ------
    InputError
        If PyVISA is not installed.
    InstrumentError
        If the resource cannot be opened, nothing answers, or what does is no SCPI instrument.
    """

    def __init__(self, name: str, resource: str, timeout: float, backend: str = "") -> None:
        self._name, self._timeout = name, timeout
        self._is_serial = resource.upper().startswith("ASRL")
        self._is_stream = self._is_serial or resource.upper().endswith("::SOCKET")
        self._sent, self._rest = list[str](), b""
        self._silence = 0.0  # before the next question, where an answer may be late [s]
        self.came = 0.0  # when the last answer did, on the computer's own clock [s]
        self._resource: Any = None
        try:
            self._resource = _opened(resource, backend, round(timeout * 1000))
        except Exception as error:  # PyVISA's own, and those of its backends
            raise (_no_address(resource) or self._failed(error, Fault.NOT_FOUND)) from None
        try:
            self.identity = self._identify(min(timeout, OPENING))
        except BaseException:
            self.close()
            raise

    def asked(self, question: str, probe: float | None = None) -> Generator[None, None, str]:
        """Ask, and return the answer; yield at every look at the line at which it is not there.

        Parameters
        ----------
        question : str
            What is asked.
        probe : float, optional
            In place of the time-out [s], where it may be a question that the instrument does not know.

        Raises
        ------
        InstrumentError
            NO_REPLY if it takes longer than an answer may; GARBLED if something else came; DISCONNECTED.
        """
        timeout = self._timeout if probe is None else min(probe, self._timeout)
        if self._silence:
            yield from self._forget(self._silence)
        self._silence = timeout if probe is None else QUIET
        self.send(question)
        answer = yield from self._line(timeout)
        self.came = time.monotonic()
        self.send(NAME)
        if (name := (yield from self._line(timeout))) != self.identity:
            raise self._error(
                f"{answer[:SHOWN]!r} and {name[:SHOWN]!r} came to {question} and {NAME}; does "
                "another program ask it, too, or is the line disturbed?",
                Fault.GARBLED,
            )
        self._silence = 0.0
        return answer

    def answer_if_known(self, question: str, probe: float) -> str:
        """Return the answer to a question that the instrument may not know, nothing if none comes."""
        try:
            return finished(self.asked(question, probe))
        except InstrumentError as error:
            if error.fault not in TRANSIENT:
                raise
            return ""

    def send(self, message: str) -> None:
        """Send questions or commands; some serial converters send them back as lines of their own."""
        self._sent = message.split("\n")
        if self._resource is None:
            raise self._error("is no longer connected", Fault.DISCONNECTED)
        try:
            self._resource.write_raw(f"{message}\n".encode("ascii"))
        except Exception as error:
            raise self._failed(error, Fault.DISCONNECTED) from None

    def close(self) -> None:
        """Let go of the instrument; more than once does nothing."""
        resource, self._resource = self._resource, None
        if resource is not None:
            with contextlib.suppress(Exception):  # of a connection that is gone
                resource.close()

    def _line(self, timeout: float) -> Generator[None, None, str]:
        """Return the next line that is not the question sent back; yield while it is not there."""
        end = time.monotonic() + timeout
        while (line := self._look(LOOK if self._is_stream else timeout)) is None or line in self._sent:
            if line is None and time.monotonic() >= end:
                broken, self._rest = self._rest[:SHOWN], b""
                words = f"only {broken!r} and no end" if broken else "no reply"
                raise self._error(
                    f"{words} to {self._sent[-1]} within {timeout:g} s; is it on, does it "
                    "speak SCPI, and does another program talk to it?",
                    Fault.GARBLED if broken else Fault.NO_REPLY,
                )
            yield
        return line

    def _look(self, seconds: float) -> str | None:
        if b"\n" not in self._rest:
            self._rest += self._taken(seconds)
        line, end, rest = self._rest.partition(b"\n")
        if not end:
            return None
        self._rest = rest
        if not line.isascii():
            raise self._error(f"sent what is no text, {line[:SHOWN]!r}", Fault.GARBLED)
        return line.decode("ascii").strip()

    def _taken(self, seconds: float) -> bytes:
        """Return what comes within some time [s]: of a stream what is there, else a whole answer."""
        if self._resource is None:
            raise self._error("is no longer connected", Fault.DISCONNECTED)
        try:
            if self._is_serial:
                if not self._resource.bytes_in_buffer:
                    time.sleep(seconds)
                waiting = self._resource.bytes_in_buffer
                return bytes(self._resource.read_bytes(waiting)) if waiting else b""
            self._resource.timeout = max(round(seconds * 1000), 1)
            came = bytes(self._resource.read_raw())
            return came if self._is_stream or came.endswith(b"\n") else came + b"\n"
        except Exception as error:
            if getattr(error, "abbreviation", "") != "VI_ERROR_TMO":
                raise self._failed(error, Fault.DISCONNECTED) from None
            return b""

    def _forget(self, silence: float) -> Generator[None, None, None]:
        """Throw away what comes, until nothing does for some time [s]; WRONG_INSTRUMENT if it never ends."""
        if not self._is_stream:
            with contextlib.suppress(Exception):  # of an interface without a clear
                self._resource.clear()
            return
        begun = last = time.monotonic()
        self._rest = b""
        while time.monotonic() < last + silence:
            if came := self._taken(min(silence, LOOK)):
                last = time.monotonic()
            if last > begun + silence + NOISY:
                raise self._error(
                    f"sends {came[:SHOWN]!r} and more, unasked; which instrument is there?",
                    Fault.WRONG_INSTRUMENT,
                )
            yield

    def _identify(self, timeout: float) -> str:
        """Return what the instrument calls itself, each time that it is asked; refuse what speaks no SCPI."""
        names: list[str] = []
        finished(self._forget(QUIET))
        for _ in range(2):
            self.send(NAME)
            names.append(finished(self._line(timeout)))
        if len(set(names)) > 1 or not IDENTITY.fullmatch(names[0]):
            answers = " and then ".join(repr(name[:SHOWN]) for name in dict.fromkeys(names))
            raise self._error(
                f"answers {answers} to {NAME}, and that is no SCPI instrument's; which instrument is there?",
                Fault.WRONG_INSTRUMENT,
            )
        return names[0]

    def _failed(self, error: Exception, otherwise: Fault) -> InstrumentError | InputError:
        if isinstance(error, InputError | InstrumentError):
            return error
        self.close()
        code = str(getattr(error, "abbreviation", ""))
        if code in IN_USE:
            return self._error("is in use by another program; end that first", Fault.BUSY, code)
        if self._is_serial and otherwise is Fault.NOT_FOUND:
            return port_error(self._name, error)
        if isinstance(error, ConnectionRefusedError):  # PyVISA-py learns of it after it has opened a socket
            otherwise = Fault.NOT_FOUND
        words = str(error).partition("\n")[0]
        hint = "is another program connected to it?"
        if otherwise is Fault.NOT_FOUND:
            hint = "is it at this address, and its SCPI socket enabled?"
        return self._error(f"cannot be reached ({words}); {hint}", otherwise, code)


def finished(dialogue: Generator[None, None, Value]) -> Value:
    """Return what a dialogue returns, waiting for it."""
    while True:
        try:
            next(dialogue)
        except StopIteration as ended:
            value: Value = ended.value
            return value


def _no_address(resource: str) -> InputError | None:
    """Return what is said of a name that PyVISA cannot read, and that no library of VISA has opened."""
    with contextlib.suppress(ImportError):
        from pyvisa import rname

        try:
            rname.ResourceName.from_string(resource)
        except rname.InvalidResourceName:
            return InputError(
                f"{resource}: is neither an address of VISA, such as USB0::0x2A8D::0x0101::MY5450::INSTR or "
                "TCPIP::192.0.2.7::5025::SOCKET, nor a name that its library knows"
            )
    return None


def _opened(resource: str, backend: str, timeout: int) -> Any:
    """Return an open resource, whose time-outs are in ms; a serial port is this program's alone."""
    try:
        from pyvisa import constants
    except ImportError:
        raise InputError(
            "scpi, visa: need the extra: pip install '.[instruments]' in the checkout (pyvisa, pyvisa-py)"
        ) from None
    manager = _manager(backend)
    opened = manager.open_resource(
        resource, read_termination="\n", write_termination="\n", timeout=timeout, open_timeout=timeout
    )
    if resource.upper().endswith("::SOCKET"):  # hand over a part of a line as well
        opened.set_visa_attribute(constants.ResourceAttribute.suppress_end_enabled, False)
    session = getattr(manager.visalib, "sessions", {}).get(opened.session)  # PyVISA-py's
    port: Any = getattr(session, "interface", None)
    if hasattr(port, "exclusive"):
        port.exclusive = True
    return opened


@functools.cache
def _manager(backend: str) -> Any:
    """Return PyVISA's manager of resources: one for the process, for closing it closes all of them."""
    import pyvisa

    try:
        return pyvisa.ResourceManager(backend)
    except (OSError, ValueError):  # no VISA library of a vendor
        return pyvisa.ResourceManager("@py")

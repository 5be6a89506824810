"""Our power board: one serial link, shared by a power meter and a PWM backlight (docs/power-board.md).

A board that is open already is shared: `board_at` opens each port once.
"""

from __future__ import annotations

import dataclasses
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from weakref import WeakValueDictionary

from evenlight.hardware.drivers import board_protocol as protocol
from evenlight.hardware.drivers.power_sampling import split_address
from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.protocols import TRANSIENT, ContextDevice, Fault, InstrumentError

TIMEOUT = 1.0  # [s] the board answers within milliseconds
HIGHEST_TAG = 999
# A port is open once in a process; a board is forgotten with the last device that uses it.
_at_ports: WeakValueDictionary[str, PowerBoard] = WeakValueDictionary()
LINE = LineSettings(  # our own protocol: docs/power-board.md, "The lines"
    baud_rate=protocol.BAUD_RATE, data_bits=8, parity="N", stop_bits=1, terminator=b"\n"
)
OPTIONS = {"baud": "baud rate of the board's serial port"}


@dataclass(frozen=True, slots=True)
class BoardIdentity:
    """What a board says of itself."""

    chip: str  # "INA219", "INA226" or "INA228"
    serial_number: str
    firmware: str
    highest_rate: float  # that sensor and microcontroller have [Hz]
    native_usb: bool  # whether its port is USB itself, so that no baud rate limits it
    highest_power: float  # above it the sensor saturates [W]
    pwm_steps: int  # of the backlight above 0; 0 if it has no PWM output


class PowerBoard(ContextDevice):
    """The link to a power board, for one device or two; each that shares it releases it once.

    Every command carries a number of its own, which its reply repeats: a reply that comes too late is never
    taken for that of another command, and samples may be streamed in between.

    Parameters
    ----------
    url : str
        Its port, "?baud=" and a baud rate after it where it is not 115200.
    clock : callable, optional
        For the times at which lines arrive [s]; time-outs go by the computer's own clock.
    timeout : float, optional
        How long a reply may take [s].

    Raises
    ------
    InputError
        If the address has an option that a board does not have.
    InstrumentError
        If there is no board at the port, or it speaks another version of the protocol.
    """

    def __init__(
        self, url: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        port, options = split_address(url, "board", OPTIONS)
        self._baud_rate = options.get("baud", float(protocol.BAUD_RATE))
        self._clock, self._timeout = clock, TIMEOUT if timeout is None else timeout
        settings = dataclasses.replace(
            LINE, baud_rate=round(self._baud_rate), timeout=max(self._timeout, TIMEOUT)
        )
        self._link = SerialLink(port, settings, "the power board")
        self._tag, self._users, self._corrupted = 0, 0, 0
        self._samples: list[tuple[float, str]] = []  # when it arrived, and a line
        self._event: InstrumentError | None = None
        self._strange = ""  # the last line that no board sends
        try:
            self._identity = self._identify()
        except BaseException:
            self._link.close()
            raise

    def name(self) -> str:
        """Return what messages call the board."""
        return self._link.name

    def is_open(self) -> bool:
        """Return whether its port is open, so that one device more may share it."""
        return self._link.is_open

    def identity(self) -> BoardIdentity:
        """Return what the board said of itself when it was opened."""
        return self._identity

    def highest_rate(self) -> float:
        """Return the highest sample rate that sensor and line have [Hz]."""
        own = self._identity.highest_rate
        return own if self._identity.native_usb else min(own, protocol.fastest_over(self._baud_rate))

    def corrupted_lines(self) -> int:
        """Return how many lines had a wrong checksum since the board was opened."""
        return self._corrupted

    def ask(self, command: str, timeout: float | None = None) -> list[str]:
        """Return the words of the reply to a command, after the command's own name.

        Lines of samples that come first are kept for `sample_lines`.

        Raises
        ------
        InstrumentError
            If the board refuses, in its words; NO_REPLY, GARBLED or DISCONNECTED if the link fails.
        """
        self._tag = self._tag % HIGHEST_TAG + 1
        self._take_what_waits()
        corrupted = self._corrupted
        self._link.write(protocol.with_checksum(f"{self._tag} {command}"))
        timeout = self._timeout if timeout is None else timeout
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            if (words := self._reply(self._next_line(left), command)) is not None:
                return words
        if self._corrupted > corrupted:
            raise InstrumentError(
                f"{self.name()}: the reply to {command!r} was disturbed on the line; is the baud rate right?",
                Fault.GARBLED,
            )
        raise InstrumentError(
            f"{self.name()}: no reply to {command!r} within {timeout:g} s; is it plugged in and running?",
            Fault.NO_REPLY,
        )

    def _take_what_waits(self) -> None:
        """Take the lines that came before a command, which else would use up the time of its reply."""
        end = time.monotonic() + self._timeout
        while time.monotonic() < end and (lines := self._link.lines_waiting()):
            for line in lines:
                self._reply(line, "")

    def sample_lines(self) -> list[tuple[float, str]]:
        """Return the samples that came since the last call, each with the time of its arrival; at once.

        Raises
        ------
        InstrumentError
            If the board reported a fault meanwhile, or the link is broken.
        """
        for line in self._link.lines_waiting():
            self._reply(line, "")
        if self._event is not None:
            event, self._event = self._event, None
            raise event
        lines, self._samples = self._samples, []
        return lines

    def share(self) -> None:
        """Count one more device that uses the board."""
        self._users += 1

    def release(self) -> None:
        """Count one device less, and close the port after the last."""
        self._users -= 1
        if self._users <= 0:
            self.close()

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        self._link.close()

    def _next_line(self, timeout: float) -> str:
        """Return the next line, whatever it is; nothing if none comes in time."""
        try:
            return self._link.read_line(timeout)
        except InstrumentError as error:
            if error.fault not in TRANSIENT:
                raise
            self._corrupted += error.fault is Fault.GARBLED
            return ""

    def _reply(self, line: str, command: str) -> list[str] | None:
        """Return the words of a line if it is the reply to a command; else keep what is of use in it."""
        if not line:
            return None
        body = protocol.checked_body(line)
        if body is None:
            self._corrupted += 1
            self._strange = line.strip()
            return None
        kind, _, rest = body.partition(" ")
        if kind == "P":
            self._samples.append((self._clock(), body))
        elif kind == "E":
            self._event = self._error(rest.split(" "), "reports a fault")
        elif kind in ("OK", "ERR"):
            return self._own_reply(kind, rest.split(" "), command)
        return None

    def _own_reply(self, kind: str, words: list[str], command: str) -> list[str] | None:
        # A board that could not read a command cannot say its number, either: it answers to number 0.
        unread = kind == "ERR" and words[:2] == ["0", "1"]
        if not command or (words[0] != str(self._tag) and not unread):
            return None  # too late: the caller already got NO_REPLY
        if kind == "ERR":
            raise self._error(words[1:], f"refuses {command!r}")
        return words[2:] if words[1:2] == command.split(" ")[:1] else None

    def _error(self, words: list[str], what: str) -> InstrumentError:
        number = int(words[0]) if words and words[0].isdigit() else 0
        meaning = protocol.ERROR_WORDS.get(number, "an error that this program does not know")
        own = " ".join(words[1:]).replace("_", " ")
        return InstrumentError(
            f"{self.name()}: {what}: {meaning} (error {number}: {own or 'no words'})",
            protocol.ERROR_FAULT.get(number, Fault.REFUSED),
            str(number),
        )

    def _identify(self) -> BoardIdentity:
        try:
            self._link.forget()
            words = self.ask("ID?")
        except InstrumentError as error:
            raise self._no_board(error) from None
        said = dict(word.partition("=")[::2] for word in words[1:])
        if words[:1] != [protocol.FAMILY] or said.get("protocol") != protocol.VERSION:
            raise InstrumentError(
                f"{self.name()}: calls itself {' '.join(words) or 'nothing'}; this program speaks version "
                f"{protocol.VERSION} of {protocol.FAMILY}",
                Fault.WRONG_INSTRUMENT,
            )
        return _identity_of(said, self.name())

    def _no_board(self, error: InstrumentError) -> InstrumentError:
        """Return what a failed first question means: another instrument, another program, or as it was."""
        strange = self._strange
        if (
            error.fault in TRANSIENT
            and strange.isprintable()
            and strange
            and not protocol.has_checksum(strange)
        ):
            return InstrumentError(
                f"{self.name()}: answers {strange!r}, and is no power board; which instrument is there?",
                Fault.WRONG_INSTRUMENT,
            )
        return error


def _identity_of(said: dict[str, str], name: str) -> BoardIdentity:
    try:
        identity = BoardIdentity(
            chip=said["chip"],
            serial_number=said["serial"],
            firmware=said["firmware"],
            highest_rate=float(said["max_rate_hz"]),
            native_usb=said["line"] == "usb",
            highest_power=int(said["max_power_uw"]) * 1e-6,
            pwm_steps=int(said["pwm_steps"]),
        )
    except (KeyError, ValueError) as error:
        raise _no_identity(name, str(error)) from None
    if not 0 < identity.highest_rate < math.inf:
        raise _no_identity(name, f"max_rate_hz={said['max_rate_hz']}")
    if identity.highest_power <= 0:
        raise _no_identity(name, f"max_power_uw={said['max_power_uw']}")
    if identity.pwm_steps < 0:
        raise _no_identity(name, f"pwm_steps={said['pwm_steps']}")
    return identity


def _no_identity(name: str, what: str) -> InstrumentError:
    return InstrumentError(
        f"{name}: its identity cannot be read ({what}); is its firmware older than this program?",
        Fault.WRONG_INSTRUMENT,
    )


def shared_board(board: str | PowerBoard, clock: Callable[[], float], timeout: float | None) -> PowerBoard:
    """Return a board for one device more: an open one that is shared, or the one at a port."""
    board = PowerBoard(board, clock, timeout) if isinstance(board, str) else board
    board.share()
    return board


def board_at(address: str, clock: Callable[[], float]) -> PowerBoard:
    """Return the board at a port: the one that is open already, or else a new link.

    Parameters
    ----------
    address : str
        Port, and "?baud=" with a baud rate if need be.
    clock : callable
        For the times at which lines arrive [s]; that of the first device where two share the board.
    """
    port = os.path.realpath(address.partition("?")[0])  # links by the board's serial number lead to it, too
    board = _at_ports.get(port)
    if board is None or not board.is_open():
        board = PowerBoard(address, clock)
        _at_ports[port] = board
    return board

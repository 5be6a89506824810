"""Our power board: one serial link, shared by a power meter and a PWM backlight (docs/power-board.md).

A board that is open already is shared: `board_at` opens each port once.
"""

from __future__ import annotations

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
OPTIONS = {"baud": "baud rate of the board's serial port"}


@dataclass(frozen=True, slots=True)
class BoardIdentity:
    """What a board says of itself.

    Attributes
    ----------
    chip, serial_number, firmware : str
        "INA219", "INA226" or "INA228", and so on.
    highest_rate : float
        The highest sample rate that sensor, microcontroller and line have [Hz].
    highest_power : float
        Above it the sensor saturates [W].
    pwm_steps : int
        Of the backlight above 0; 0 if it has no PWM output.
    """

    chip: str
    serial_number: str
    firmware: str
    highest_rate: float
    highest_power: float
    pwm_steps: int


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

    Attributes
    ----------
    url, name : str
        As it was opened; what messages call the board.
    identity : BoardIdentity
        What the board says of itself.
    corrupted_lines : int
        How many had a wrong checksum since the board was opened.

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
        baud_rate = options.get("baud", float(protocol.BAUD_RATE))
        self._clock, self._timeout = clock, TIMEOUT if timeout is None else timeout
        settings = LineSettings(  # our own protocol: docs/power-board.md, "The lines"
            baud_rate=round(baud_rate), terminator=b"\n", timeout=max(self._timeout, TIMEOUT)
        )
        self._link = SerialLink(port, settings, "the power board")
        self.url, self.name = url, self._link.name
        self._name = self.name
        self._tag = self._users = self.corrupted_lines = 0
        self._samples: list[tuple[float, str]] = []  # when it arrived, and a line
        self._event: InstrumentError | None = None
        self._strange = ""  # the last line that no board sends
        try:
            self.identity = self._identify(baud_rate)
        except BaseException:
            self._link.close()
            raise

    def is_open(self) -> bool:
        """Return whether its port is open, so that one device more may share it."""
        return self._link.is_open

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
        corrupted = self.corrupted_lines
        self._link.write(protocol.with_checksum(f"{self._tag} {command}"))
        timeout = self._timeout if timeout is None else timeout
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            if (words := self._reply(self._next_line(left), command)) is not None:
                return words
        if self.corrupted_lines > corrupted:
            raise self._error(
                f"the reply to {command!r} was disturbed on the line; is the baud rate right?", Fault.GARBLED
            )
        raise self._error(
            f"no reply to {command!r} within {timeout:g} s; is it plugged in and running?", Fault.NO_REPLY
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
            self.corrupted_lines += error.fault is Fault.GARBLED
            return ""

    def _reply(self, line: str, command: str) -> list[str] | None:
        """Return the words of a line if it is the reply to a command; else keep what is of use in it."""
        if not line:
            return None
        body = protocol.checked_body(line)
        if body is None:
            self.corrupted_lines += 1
            self._strange = line.strip()
            return None
        kind, _, rest = body.partition(" ")
        if kind == "P":
            self._samples.append((self._clock(), body))
        elif kind == "E":
            self._event = self._told(rest.split(" "), "reports a fault")
        elif kind in ("OK", "ERR"):
            return self._own_reply(kind, rest.split(" "), command)
        return None

    def _own_reply(self, kind: str, words: list[str], command: str) -> list[str] | None:
        # A board that could not read a command cannot say its number, either: it answers to number 0.
        unread = kind == "ERR" and words[:2] == ["0", "1"]
        if not command or (words[0] != str(self._tag) and not unread):
            return None  # too late: the caller already got NO_REPLY
        if kind == "ERR":
            raise self._told(words[1:], f"refuses {command!r}")
        return words[2:] if words[1:2] == command.split(" ")[:1] else None

    def _told(self, words: list[str], what: str) -> InstrumentError:
        number = int(words[0]) if words and words[0].isdigit() else 0
        meaning = protocol.ERROR_WORDS.get(number, "an error that this program does not know")
        own = " ".join(words[1:]).replace("_", " ")
        return self._error(
            f"{what}: {meaning} (error {number}: {own or 'no words'})",
            protocol.ERROR_FAULT.get(number, Fault.REFUSED),
            str(number),
        )

    def _identify(self, baud_rate: float) -> BoardIdentity:
        try:
            self._link.forget()
            words = self.ask("ID?")
        except InstrumentError as error:
            raise self._no_board(error) from None
        said = dict(word.partition("=")[::2] for word in words[1:])
        if words[:1] != [protocol.FAMILY] or said.get("protocol") != protocol.VERSION:
            raise self._error(
                f"calls itself {' '.join(words) or 'nothing'}; this program speaks version "
                f"{protocol.VERSION} of {protocol.FAMILY}",
                Fault.WRONG_INSTRUMENT,
            )
        try:
            chip, serial_number, firmware = said["chip"], said["serial"], said["firmware"]
            rate, power = float(said["max_rate_hz"]), int(said["max_power_uw"]) * 1e-6
            is_usb, pwm_steps = said["line"] == "usb", int(said["pwm_steps"])
        except (KeyError, ValueError) as error:
            raise self._no_identity(str(error)) from None
        possible = {
            "max_rate_hz": 0 < rate < math.inf, "max_power_uw": power > 0, "pwm_steps": pwm_steps >= 0
        }  # fmt: skip
        for key in (key for key, holds in possible.items() if not holds):
            raise self._no_identity(f"{key}={said[key]}")
        highest = rate if is_usb else min(rate, protocol.fastest_over(baud_rate))
        return BoardIdentity(chip, serial_number, firmware, highest, power, pwm_steps)

    def _no_identity(self, what: str) -> InstrumentError:
        return self._error(
            f"its identity cannot be read ({what}); is its firmware older than this program?",
            Fault.WRONG_INSTRUMENT,
        )

    def _no_board(self, error: InstrumentError) -> InstrumentError:
        """Return what a failed first question means: another instrument, another program, or as it was."""
        strange = self._strange
        if (
            error.fault in TRANSIENT
            and strange.isprintable()
            and strange
            and not protocol.has_checksum(strange)
        ):
            return self._error(
                f"answers {strange!r}, and is no power board; which instrument is there?",
                Fault.WRONG_INSTRUMENT,
            )
        return error


def board_at(address: str, clock: Callable[[], float], timeout: float | None = None) -> PowerBoard:
    """Return the board at a port for one device more: the one that is open already, or else a new link.

    Parameters
    ----------
    address : str
        Port, and "?baud=" with a baud rate if need be.
    clock, timeout : callable and float, optional
        As of `PowerBoard`; those of the first device where two share the board.
    """
    port = os.path.realpath(address.partition("?")[0])  # links by the board's serial number lead to it, too
    board = _at_ports.get(port)
    if board is None or not board.is_open():
        board = _at_ports[port] = PowerBoard(address, clock, timeout)
    board.share()
    return board

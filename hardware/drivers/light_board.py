"""A photodiode at a microcontroller that prints samples with its own clock (docs/light-board.md).

Not tried on a board: tested with the document's sketch, compiled for a computer.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence

import numpy as np

from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.hardware.drivers.board_protocol import UnwrappedCounter, checked_body, has_checksum
from evenlight.hardware.drivers.power_sampling import split_address
from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError, LightBlock, LightStream

FAMILY = "evenlight-light-board"
BAUD_RATE = 1_000_000
STARTING = 4.0  # [s] that a board takes to answer after its port was opened: many restart then
REPLY = 0.5  # [s]
SILENCE = 1.0  # [s] without a sample, after which it has stopped sending
RATE_ROUNDING = 0.01  # of a rate that is asked for
DIGITS = 3  # hexadecimal, of a sample
CLOCK_LETTERS = "abcdefghijklmnopqrstuvwxyz"  # that ask for the clock, by turns: the answer repeats its own


class LightBoard(ContextDevice):
    """A board that samples all the time, at a rate of its own.

    Parameters
    ----------
    address : str
        Its port, "?baud=" and a baud rate after it where it is not 1000000.
    clock : callable, optional
        The computer's clock, for arrivals and pings [s].

    Raises
    ------
    InstrumentError
        If there is no such board at the port.
    """

    def __init__(self, address: str, clock: Callable[[], float] = time.monotonic) -> None:
        port, options = split_address(address, "adc", {"baud": "baud rate of the board's serial port"})
        settings = LineSettings(round(options.get("baud", BAUD_RATE)), terminator=b"\n")
        self._link, self._clock = SerialLink(port, settings, "the light board"), clock
        self._name = self._link.name
        self._blocks: list[LightBlock] = []
        self._count, self._ticks = UnwrappedCounter(32, 0), UnwrappedCounter(32, 0)
        self._n_bad, self._heard = 0, time.monotonic()
        self._letters, self._strange = itertools.cycle(CLOCK_LETTERS), ""
        self._identity: dict[str, float] = {}
        try:
            self._identity = self._identify()
        except BaseException:
            self._link.close()
            raise

    def start(self, rate: float | None) -> LightStream:
        """Return what comes; the board samples all the time, so what came before is thrown away."""
        self._require_open()
        own = self._identity["rate_hz"]
        if rate is not None and abs(rate / own - 1) > RATE_ROUNDING:
            raise InstrumentError(f"{self._name}: its sketch samples at {own:g} Hz, got {rate:g} Hz")
        self._link.forget()
        self._heard = time.monotonic()
        return LightStream(own, full_scale=1.0, dc_coupled=True)

    def samples(self) -> Sequence[LightBlock]:
        """Return the samples that came; a line with a wrong checksum is lost."""
        self._require_open()
        for line in self._link.lines_waiting():
            self._take(line, self._clock())
        if time.monotonic() - self._heard > SILENCE:
            raise InstrumentError(
                f"{self._name}: sent no sample for {SILENCE:g} s; {self._n_bad} lines were disturbed",
                Fault.NO_REPLY,
            )
        blocks, self._blocks = self._blocks, []
        return blocks

    def ping(self) -> ClockPing | None:
        """Return one comparison of the board's clock with the computer's; None if its answer got lost."""
        self._require_open()
        for line in self._link.lines_waiting():  # so that the answer waits behind nothing
            self._take(line, self._clock())
        letter, sent = next(self._letters), self._clock()
        words = self._ask(letter.encode(), ["T", letter], REPLY)
        received = self._clock()
        ticks = words[2:]
        if len(ticks) != 1 or not ticks[0].isdecimal():
            return None
        return ClockPing(sent, self._ticks.next(int(ticks[0])) * 1e-6, received)

    def apparatus(self) -> dict[str, str]:
        """Return what the board says of itself."""
        return {"light_sampler": FAMILY, "light_sampler_disturbed_lines": str(self._n_bad)} | {
            f"light_sampler_{key}": f"{value:g}" for key, value in self._identity.items()
        }

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        super().close()
        self._link.close()

    def _identify(self) -> dict[str, float]:
        """Return what the board says of itself; it may still be starting."""
        end = time.monotonic() + STARTING
        words: list[str] = []
        while not words and time.monotonic() < end:
            words = self._ask(b"?", ["A"], REPLY)
        said = dict(word.partition("=")[::2] for word in words[2:])
        try:
            identity = {key: float(said[key]) for key in ("rate_hz", "bits")}
        except (KeyError, ValueError):
            identity = {}
        if words[1:2] != [FAMILY] or not identity or not (1 <= identity["rate_hz"] <= 1e6):
            raise InstrumentError(
                f"{self._name}: {' '.join(words) or self._strange or 'no answer'}; "
                f"expected {FAMILY} with rate_hz and bits (docs/light-board.md)",
                Fault.WRONG_INSTRUMENT if words or self._strange else Fault.NO_REPLY,
            )
        if not 1 <= identity["bits"] <= 4 * DIGITS or identity["bits"] % 1:
            raise InstrumentError(f"{self._name}: states {identity['bits']:g} bits", Fault.GARBLED)
        return identity

    def _ask(self, question: bytes, begins: list[str], timeout: float) -> list[str]:
        """Return the words of an answer that begins so; none if it got lost. Samples are kept meanwhile."""
        self._link.write(question)
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            try:
                line = self._link.read_line(left)
            except InstrumentError as error:
                if error.fault is Fault.DISCONNECTED:
                    raise
                continue
            words = (checked_body(line) or "").split(" ")
            if words[: len(begins)] == begins:
                return words
            if line.isprintable() and not has_checksum(line):
                self._strange = line[:60]
            self._take(line, self._clock())
        return []

    def _take(self, line: str, received: float) -> None:
        """Take in a line of samples: `L`, count and clock [us] of the first, and the samples."""
        body = checked_body(line)
        words = body.split(" ") if body else []
        if words[:1] != ["L"] or not self._identity:
            self._n_bad += body is None
            return
        try:
            _, count, ticks, digits = words
            first, begun = int(count), int(ticks)
            codes = [int(digits[k : k + DIGITS], 16) for k in range(0, len(digits), DIGITS)]
        except ValueError:
            raise InstrumentError(f"{self._name}: sent {line!r}, and no samples", Fault.GARBLED) from None
        highest = 2 ** self._identity["bits"] - 1
        if not codes or len(digits) % DIGITS or max(codes) > highest or not 0 <= first < 2**32 > begun >= 0:
            raise InstrumentError(f"{self._name}: sent {line!r}, and no samples", Fault.GARBLED)
        self._heard = time.monotonic()
        self._count.next(first)
        since = np.arange(len(codes)) / self._identity["rate_hz"]
        self._blocks.append(
            LightBlock(self._ticks.next(begun) * 1e-6 + since, np.array(codes) / highest, received)
        )

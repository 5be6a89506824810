"""The lines that our power board speaks (docs/power-board.md): checksum, samples, rollover, errors."""

from __future__ import annotations

import binascii
import contextlib
import enum
import math
import re
from dataclasses import dataclass

from evenlight.hardware.protocols import Fault, InstrumentError

VERSION = "1"
FAMILY = "evenlight-power-board"
BAUD_RATE = 115_200
BITS_PER_BYTE = 10  # 8N1: a start and a stop bit beside the eight
LONGEST_SAMPLE = len("P 65535 4294967295 -99999999 F*29B1\n")  # bytes
SHARE_FOR_SAMPLES = 0.85  # of the line; the rest is for the replies in between
SEQUENCE_BITS, TIME_BITS = 16, 32
SLOWEST = 1.0  # [Hz]
# What the board says with ERR or E. Its own words come with it; these say what it means for the user.
ERROR_WORDS = {
    1: "a command was disturbed on the line",
    2: "unknown command; is its firmware older than this program?",
    3: "a command without the number that it needs",
    4: "outside what the board has",
    5: "not while it samples",
    6: "the sensor does not answer the microcontroller; check the four wires of I2C",
    7: "the board has no PWM output",
    8: "the current is not near zero; unplug the panel before zeroing",
}
ERROR_FAULT = {1: Fault.GARBLED}  # all others: refused


class Flag(enum.IntFlag):
    """What the last field of a sample says."""

    SYNC = 1  # level of the synchronisation input
    SHUNT_OVERLOAD = 2
    BUS_OVERLOAD = 4
    LOW_SUPPLY = 8  # the board's own supply is too low to measure right


@dataclass(frozen=True, slots=True)
class SampleLine:
    """One line of samples, as the board counts."""

    sequence: int  # 16 bits, from 0 at START
    ticks: int  # 32 bits of the board's clock [µs], at the end of what the power is the mean of
    power: float  # [W]
    flags: Flag  # synchronisation input, and what makes the power no measurement


def with_checksum(body: str) -> bytes:
    r"""Return a line: body, `*`, CRC-16/CCITT-FALSE in four hexadecimal digits, line feed.

    >>> with_checksum("123456789")  # the check value that catalogues of CRCs give
    b'123456789*29B1\n'
    """
    return f"{body}*{_checksum(body)}\n".encode("ascii")


def checked_body(line: str) -> str | None:
    """Return the body of a line, None if the line was changed on its way.

    >>> checked_body("123456789*29B1"), checked_body("123456780*29B1"), checked_body("12345678")
    ('123456789', None, None)
    """
    body, star, checksum = line.rstrip("\r").rpartition("*")
    if not star or not body.isascii() or checksum != _checksum(body):
        return None
    return body


def has_checksum(line: str) -> bool:
    """Return whether a line ends as those of a board do, right or wrong.

    >>> has_checksum("P 7 1000000 672301 1*0000"), has_checksum("$GPGLL,4916.45,N,12311.12,W,225444,A*31")
    (True, False)
    """
    return re.search(r"\*[0-9A-F]{4}$", line) is not None


def parse_sample(body: str) -> SampleLine:
    """Return the sample that the body of a line holds.

    Raises
    ------
    ValueError
        If it holds none.

    >>> parse_sample("P 7 1000000 672300 1")
    SampleLine(sequence=7, ticks=1000000, power=0.6723, flags=<Flag.SYNC: 1>)
    """
    letter, sequence, ticks, power, flags = body.split(" ")
    if letter != "P":
        raise ValueError(f"no sample: {body!r}")
    line = SampleLine(int(sequence), int(ticks), int(power) * 1e-6, Flag(int(flags, 16)))
    if not 0 <= line.sequence < 1 << SEQUENCE_BITS or not 0 <= line.ticks < 1 << TIME_BITS:
        raise ValueError(f"counts out of range: {body!r}")
    return line


def fastest_over(baud_rate: float) -> float:
    """Return the highest sample rate that a line carries, replies in between included [Hz].

    >>> round(fastest_over(115200))  # 0.85 * 115200 / 10 / 36
    272
    """
    return SHARE_FOR_SAMPLES * baud_rate / BITS_PER_BYTE / LONGEST_SAMPLE


class UnwrappedCounter:
    """A counter that rolls over, made into one that does not: each value is the one nearest to the last.

    Parameters
    ----------
    bits : int
        Of the counter.
    last : int
        Its full value now, as far as it is known.

    >>> count = UnwrappedCounter(bits=8, last=250)
    >>> [count.next(value) for value in (255, 3, 255, 4)]  # 255 came once more: no second round
    [255, 259, 255, 260]
    """

    def __init__(self, bits: int, last: int) -> None:
        self._size, self._last = 1 << bits, last

    def next(self, value: int) -> int:
        """Return the full value of a counter."""
        step = (value - self._last + self._size // 2) % self._size - self._size // 2
        self._last += step
        return self._last


def _checksum(body: str) -> str:
    """Return the CRC-16/CCITT-FALSE of a body: polynomial 0x1021, from 0xFFFF."""
    return f"{binascii.crc_hqx(body.encode('ascii'), 0xFFFF):04X}"


def whole_in(words: list[str], name: str, lowest: int) -> int:
    """Return the whole number that a reply consists of, if it is not below the lowest that makes sense.

    >>> whole_in(["4000"], "the board", lowest=1)
    4000
    """
    number = number_in(words, name)
    if number != int(number) or number < lowest:
        raise InstrumentError(
            f"{name}: answered {words[0]!r} where a whole number from {lowest} belongs", Fault.GARBLED
        )
    return int(number)


def number_in(words: list[str], name: str) -> float:
    """Return the number that a reply consists of."""
    number = math.nan
    if len(words) == 1:
        with contextlib.suppress(ValueError):
            number = float(words[0])
    if not math.isfinite(number):
        raise InstrumentError(f"{name}: answered {' '.join(words)!r} where a number belongs", Fault.GARBLED)
    return number

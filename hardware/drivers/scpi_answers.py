"""What a SCPI instrument answers: its identity, numbers with their units, entries of its list of errors."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from evenlight.hardware.protocols import Fault, InstrumentError

OVERFLOW = 9.9e37  # SCPI-99, 7.2.1: infinity, which stands for an overload; 9.91e37 is not a number
ROUNDING = 1e-4  # of it
# IEEE 488.2: maker, model, serial number, firmware. Sentences of a GPS receiver ($) or of AIS (!) are others.
IDENTITY = re.compile(r"[^,$!][^,]*,[^,]*,[^,]*,.*")
ERROR = re.compile(r'([+-]?\d+)(?:(?:\s*,\s*|\s+)"?(.*?)"?)?')
NUMBER = re.compile(r"([+-]?)((?:\d+|(?=\.\d))(\.\d*)?(E[+-]?\d+)?)\s*([A-Z]*)", re.IGNORECASE)
INFINITE = ("INF", "+INF", "-INF")  # Yokogawa's overload
SUFFIXES = {"": 1.0, "M": 1e-3, "U": 1e-6, "N": 1e-9, "K": 1e3}  # IEEE 488.2: M is milli, in either case
SHOWN = 60  # characters of an answer that a message quotes
# What the hundreds of SCPI's error numbers mean (SCPI-99, volume 2, 21.8).
ERROR_CLASSES = {1: "command", 2: "execution", 3: "instrument", 4: "query"}
ALIKE = 4  # answers in a row that show in which form an instrument writes its numbers
FORMLESS = 16  # answers without four alike, after which it has no form
STEADY = 1.5  # ratio of two neighbouring values; a lost digit before the point makes at least 2


def is_identity(answer: str) -> bool:
    """Return whether an answer is one to *IDN?.

    >>> is_identity("RIGOL TECHNOLOGIES,DP832,DP8A1234,00.01.16"), is_identity("0000,PR-655")
    (True, False)
    """
    return IDENTITY.fullmatch(answer) is not None


def number_in(answer: str, unit: str, name: str) -> float:
    """Return the number of an answer in a unit, "W", "V" or "A".

    Raises
    ------
    InstrumentError
        If there is none, it is in another unit, or it stands for an overload.

    >>> number_in("500mW", "W", "the meter"), number_in("+1.25E+00", "W", "the meter")
    (0.5, 1.25)
    """
    match = NUMBER.fullmatch(answer)
    scale = SUFFIXES.get(match[5].upper().removesuffix(unit)) if match else None
    number = math.nan if match is None or scale is None else float(match[1] + match[2]) * scale
    if answer.upper() in INFINITE or abs(abs(number) / OVERFLOW - 1) <= ROUNDING:
        raise InstrumentError(
            f"{name}: overload ({answer}): the panel takes more than the range that is set",
            Fault.OVER_RANGE,
            answer,
        )
    if not math.isfinite(number) or (match and match[5].upper() in SUFFIXES and match[5]):
        raise InstrumentError(
            f"{name}: answered {answer[:SHOWN]!r} where a number of {unit} belongs", Fault.GARBLED
        )
    if abs(number) > OVERFLOW:
        raise InstrumentError(f"{name}: has no value ({answer})", Fault.REFUSED, answer)
    return number


def is_error(answer: str) -> bool:
    """Return whether an answer is an entry in a list of errors, "no error" among them."""
    return ERROR.fullmatch(answer) is not None


def error_in(answer: str) -> tuple[int, str]:
    """Return number and words of an entry in an instrument's list of errors.

    >>> error_in('-113,"Undefined header"'), error_in('+0,"No error"'), error_in("0  No Error")
    ((-113, 'Undefined header'), (0, 'No error'), (0, 'No Error'))
    """
    match = ERROR.fullmatch(answer)
    if match is None:
        raise ValueError(f"{answer[:SHOWN]!r} is no error of SCPI")
    return int(match[1]), match[2] or ""


def error_in_words(code: int, words: str) -> str:
    """Return what an error says.

    >>> error_in_words(-222, "Data out of range")
    'execution error -222: Data out of range'
    """
    kind = ERROR_CLASSES.get(-code // 100, "instrument")
    return f"{kind} error {code}: {words or 'without words'}"


@dataclass(frozen=True, slots=True)
class _Written:
    """A number as it was written."""

    length: int  # characters, the sign left out
    tail: str  # from the decimal point on, each digit a 0
    value: float

    def follows(self, other: _Written) -> bool:
        """Return whether no digit was lost of this number, if none was of another before it."""
        smaller, larger = sorted((abs(self.value), abs(other.value)))
        return self.length == other.length or (self.tail == other.tail and larger <= STEADY * smaller)


class NumberForm:
    """The form in which an instrument writes its numbers, by which one that lost a digit is found.

    SCPI has no checksum. But an instrument writes its numbers equally long, or with equally many decimals;
    what lost a character has neither, or is at most half of what it was. Such an answer is asked for again,
    until four in a row show a new form: another range, or much more power. Where an instrument writes as many
    digits as it happens to have, a number need only be near the one before.

    >>> form = NumberForm()
    >>> [form.is_whole(answer, float(answer)) for answer in ("12.5", "12.4", "12.5", "12.6", "2.6", "12.6")]
    [False, False, False, True, False, True]
    """

    def __init__(self) -> None:
        self._held: _Written | None = None
        self._new: list[_Written] = []  # that do not follow it, but each other
        self._n_first, self._is_formless = 0, False

    def is_known(self) -> bool:
        """Return whether enough answers have shown the form."""
        return self._held is not None

    def is_whole(self, answer: str, value: float) -> bool:
        """Return whether an answer is in the form, and so not shorter or longer than it was sent."""
        digits = answer.lstrip("+-")
        tail = re.sub(r"\d", "0", re.sub(r"^\d*", "", digits))
        self._n_first += self._held is None
        self._is_formless |= self._n_first == FORMLESS
        now = _Written(len(digits), "" if self._is_formless else tail, value)
        if self._is_formless and self._held is None:
            self._held = now
        if self._held is None or not now.follows(self._held):
            if self._new and not now.follows(self._new[-1]):
                self._new.clear()
            self._new.append(now)
            if len(self._new) < ALIKE:
                return False
        self._held = now
        self._new.clear()
        return True

"""What SCPI instruments answer: who they are, numbers with overload, entries of their lists of errors."""

from __future__ import annotations

import math
import re

from evenlight.hardware.protocols import Fault, InstrumentError

OVERFLOW = 9.9e37  # SCPI-99, 7.2.1: infinity, which is how overload is told; 9.91e37 is not a number
ROUNDING = 1e-4  # of it
IDENTITY = re.compile(r"[^,]+,[^,]*,[^,]*,.*")  # IEEE 488.2: maker, model, serial number, firmware
ERROR = re.compile(r'([+-]?\d+)\s*,\s*"?(.*?)"?')
SHOWN = 60  # characters of an answer that a message quotes

# What the hundreds of SCPI's error numbers mean (SCPI-99, volume 2, 21.8).
ERROR_CLASSES = {1: "command", 2: "execution", 3: "instrument", 4: "query"}


def is_identity(answer: str) -> bool:
    """Return whether an answer is one to *IDN?.

    >>> is_identity("RIGOL TECHNOLOGIES,DP832,DP8A1234,00.01.16"), is_identity("0000,PR-655")
    (True, False)
    """
    return IDENTITY.fullmatch(answer) is not None


def is_error(answer: str) -> bool:
    """Return whether an answer is an entry in a list of errors, "no error" among them."""
    return ERROR.fullmatch(answer) is not None


def number_in(answer: str, name: str) -> float:
    """Return the number of an answer.

    Raises
    ------
    InstrumentError
        If there is none, or it stands for an overload.
    """
    try:
        number = float(answer)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InstrumentError(f"{name}: answered {answer[:SHOWN]!r} where a number belongs", Fault.GARBLED)
    if abs(number) > OVERFLOW * (1 + ROUNDING):
        raise InstrumentError(f"{name}: has no value ({answer})", Fault.REFUSED, answer)
    if abs(number) >= OVERFLOW * (1 - ROUNDING):
        raise InstrumentError(
            f"{name}: overload ({answer}): the panel takes more than the range that is set",
            Fault.OVER_RANGE,
            answer,
        )
    return number


def error_in(answer: str) -> tuple[int, str]:
    """Return number and words of an entry in an instrument's list of errors.

    >>> error_in('-113,"Undefined header"'), error_in('+0,"No error"')
    ((-113, 'Undefined header'), (0, 'No error'))
    """
    match = ERROR.fullmatch(answer)
    if match is None:
        raise ValueError(f"{answer[:SHOWN]!r} is no error of SCPI")
    return int(match[1]), match[2]


def error_in_words(code: int, words: str) -> str:
    """Return what an error says.

    >>> error_in_words(-222, "Data out of range")
    'execution error -222: Data out of range'
    """
    kind = ERROR_CLASSES.get(-code // 100, "instrument")
    return f"{kind} error {code}: {words or 'without words'}"

"""The numbers in our power board's replies: what no board answers is garbled, never a number."""

from __future__ import annotations

import contextlib
import math

from evenlight.hardware.protocols import Fault, InstrumentError


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

"""A luminance meter that a person reads by eye: what it shows is typed in."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from evenlight.hardware.plausibility import ANY_LUMINANCE
from evenlight.hardware.protocols import ContextDevice, Fault, Reading

QUESTION = "Luminance [cd/m^2] (u: under range, o: over range, stop: end): "
NUMBER_AND_UNIT = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)")
UNITS = ("", "cd/m2", "cd/m^2", "cd/m²", "cd/qm", "nit", "nits", "nt")
FACTORS = {"fl": 3.426, "ftl": 3.426, "kcd/m2": 1000.0, "mcd/m2": 0.001}  # [cd/m^2], for the advice


class ManualMeter(ContextDevice):
    """A meter whose readings are typed in.

    Parameters
    ----------
    ask : callable
        Shows a question, and returns the line that was typed.
    clock : callable, optional
        Of the readings' times [s].
    instrument : str, optional
        What it is, for the record.
    """

    _name = "the meter that is read by eye"

    def __init__(
        self,
        ask: Callable[[str], str],
        clock: Callable[[], float] = time.monotonic,
        instrument: str = "",
    ) -> None:
        self._ask, self._clock, self._instrument = ask, clock, instrument

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]; what is no luminance is asked for again, and so is an empty line.

        Raises
        ------
        InstrumentError
            If the meter shows that it is out of range, or the person stops.
        """
        self._require_open()
        begun, question = self._clock(), QUESTION
        while True:
            typed = self._typed(question)
            match typed.lower():
                case "":
                    question = QUESTION
                case "u":
                    raise self._error("too dark for it", Fault.UNDER_RANGE, "u")
                case "o":
                    raise self._error("too bright for it", Fault.OVER_RANGE, "o")
                case "stop":
                    raise self._error("stopped by the person who reads it", Fault.REFUSED, "stop")
                case _:
                    try:
                        value = luminance_in(typed)
                    except ValueError as problem:
                        question = f"{problem}\n{QUESTION}"
                    else:
                        return Reading(value, "cd/m^2", begun, self._clock(), "typed")

    def apparatus(self) -> dict[str, str]:
        """Return what is known of the instrument."""
        return {"model": self._instrument or "read by eye, and typed in"}

    def _typed(self, question: str) -> str:
        try:
            return self._ask(question).strip()
        except EOFError:
            raise self._error("no one types any more", Fault.DISCONNECTED) from None


def luminance_in(typed: str) -> float:
    """Return the luminance that was typed [cd/m^2].

    Raises
    ------
    ValueError
        In one line for the person who typed it, if it is none.

    >>> luminance_in("12.5 cd/m2")
    12.5
    >>> luminance_in("29.2 fL")
    Traceback (most recent call last):
    ValueError: 'fL' is not cd/m^2: 29.2 fL are 100.039 cd/m^2.
    """
    match = NUMBER_AND_UNIT.fullmatch(typed)
    if match is None or match[2].startswith(","):
        point = " Write a decimal point, not a comma." if "," in typed else ""
        raise ValueError(f"{typed!r} is no luminance; type a number, such as 12.5.{point}")
    value, unit = float(match[1]), match[2].strip()
    if unit.lower() not in UNITS:
        factor = FACTORS.get(unit.lower())
        advice = f"{value:g} {unit} are {value * factor:g} cd/m^2" if factor else "type it in cd/m^2"
        raise ValueError(f"{unit!r} is not cd/m^2: {advice}.")
    least, most = ANY_LUMINANCE.least, ANY_LUMINANCE.most
    if not least <= value <= most:
        raise ValueError(
            f"{typed!r} is no luminance of a display, which is from {least:g} to {most:g} cd/m^2."
        )
    return abs(value)  # -0 is 0

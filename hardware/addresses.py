"""Addresses of instruments, with what has to be said of them: `/dev/ttyACM0?voltage=5.0`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from evenlight.data_schema.errors import InputError


def split_address(address: str, driver: str, options: Mapping[str, str]) -> tuple[str, dict[str, float]]:
    """Return an address and the numbers that were said with it.

    Parameters
    ----------
    address : str
        Without the driver's name.
    driver : str
        Its name, as messages have it.
    options : mapping of str to str
        What may be said, and what it is, in words.

    Raises
    ------
    InputError
        If something else is said, it is no number above 0, or there is no address.

    >>> split_address("/dev/ttyACM0?voltage=5.0", "ppk2", {"voltage": "the supply's [V]"})
    ('/dev/ttyACM0', {'voltage': 5.0})
    """
    place, _, said = address.partition("?")
    given = f"{driver}:{address}"
    if not place:
        raise InputError(f"{given}: names no instrument; `evenlight measure list` shows what there is")
    numbers: dict[str, float] = {}
    for part in filter(None, said.split("&")):
        name, _, text = part.partition("=")
        if name not in options:
            known = ", ".join(f"{key} ({words})" for key, words in options.items()) or "none"
            raise InputError(f"{given}: there is no option {name!r}; there is {known}")
        numbers[name] = _positive(text, f"{given}: {name}")
    return place, numbers


def _positive(text: str, what: str) -> float:
    """Return a number above 0 that was written as text."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise InputError(f"{what} must be a number above 0, got {text!r}")
    return number

"""What a caller's argument, or a command's option, must be: a number, a choice, a path; said by its name."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from evenlight.data_schema.errors import ArgumentError, shown_kind
from evenlight.data_schema.quantities import require_computable

if TYPE_CHECKING:
    from numpy.typing import NDArray

Choice = TypeVar("Choice", bound=enum.Enum)


def choice(name: str, value: Any, of: type[Choice]) -> Choice:
    """Return the member of an enum that an argument names."""
    try:
        return of(value)
    except ValueError:
        raise must_be_one_of(name, value, [member.value for member in of]) from None


def must_be_one_of(name: str, value: Any, known: Iterable[object]) -> ArgumentError:
    """Return the error of an argument that is none of some words."""
    return ArgumentError(name, f"must be one of {', '.join(map(str, known)) or 'none'}, got {value!r}")


def text(name: str, value: Any) -> str:
    """Return the text that an argument holds."""
    if not isinstance(value, str):
        raise ArgumentError(name, f"must be a text, got {value!r}")
    return value


def real(name: str, value: Any) -> float:
    """Return the number that an argument holds, as it is: not a number, too."""
    if isinstance(value, int):
        require_computable(name, value)
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ArgumentError(name, f"must be a number, got {value!r}")
    return float(value)


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """Return the number that an argument holds, if it lies within its limits."""
    if math.isnan(real(name, value)):
        raise ArgumentError(name, f"must be a number, got {value!r}")
    if not low <= float(value) <= high:
        raise ArgumentError(name, f"must lie in {low:g} to {high:g}, got {float(value):.15g}")
    return float(value)


def positive(name: str, value: Any) -> float:
    """Return the number that an argument holds, if it is finite and above 0."""
    if not 0 < number(name, value) < math.inf:
        raise ArgumentError(name, f"must be above 0, got {value!r}")
    return float(value)


def whole(name: str, value: Any, least: int = 0) -> int:
    """Return the whole number that an argument holds, if it is not below the least."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise ArgumentError(name, f"must be a whole number from {least} on, got {value!r}")
    require_computable(name, int(value))
    return int(value)


def flag(name: str, value: Any) -> bool:
    """Return the flag that an argument holds."""
    if not isinstance(value, bool):
        raise ArgumentError(name, f"must be true or false, got {value!r}")
    return value


def path(name: str, value: Any) -> Path:
    """Return the path that an argument holds."""
    if not isinstance(value, str | PathLike):
        raise ArgumentError(name, f"must be a path, got {shown_kind(value)}")
    return Path(value)


def numbers(name: str, value: Any) -> NDArray[Any]:
    """Return the numbers that an argument holds, as an array of their shape."""
    import numpy as np

    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(name, f"must be numbers, got {value!r}") from None

"""Fields of records: a quantity with its unit, its limits and the key it has in files."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

UNIT_SUFFIX = {
    "cd/m^2": "_cd_m2",
    "cd/m^2/s": "_cd_m2_s",
    "s": "_s",
    "W": "_w",
    "W m^2/cd": "_w_m2_cd",
    "deg": "_deg",
    "Hz": "_hz",
    "pixels": "_px",
}


def quantity(
    unit: str,
    doc: str,
    *,
    default: Any = dataclasses.MISSING,
    above: float | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    key: str | None = None,
) -> Any:
    """Return a dataclass field for a physical quantity.

    Parameters
    ----------
    unit : str
        Its unit; "1" for a pure number. In files the unit is part of the key (`_cd_m2`, `_s`, ...),
        because no docstring travels with them.
    doc : str
        What it is, for the JSON Schema and the data dictionary.
    default : optional
        The value when none is given.
    above, minimum, maximum : float, optional
        Its limits, which `check_limits` and the JSON Schema both enforce.
    key : str, optional
        Its key in files, where it is not the attribute's name with the unit's suffix.
    """
    limits = {"above": above, "minimum": minimum, "maximum": maximum}
    metadata = {"unit": unit, "doc": doc, "key": key, **limits}
    return dataclasses.field(default=default, metadata=metadata)


def described(doc: str, *, default: Any = dataclasses.MISSING, pattern: str | None = None) -> Any:
    """Return a dataclass field without a unit: a name, a choice, a flag."""
    return dataclasses.field(default=default, metadata={"doc": doc, "pattern": pattern})


def file_key(field: dataclasses.Field[Any]) -> str:
    """Return the key or column name that a field has in files."""
    explicit = field.metadata.get("key")
    return explicit or field.name + UNIT_SUFFIX.get(field.metadata.get("unit", ""), "")


def check_limits(record: Any) -> None:
    """Raise `ValueError` naming the quantity, the limit, the unit and the value got, if a field breaks one.

    Arrays and tuples are checked element by element; None stands for "not measured" and passes.
    """
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if "unit" in field.metadata and value is not None:
            _check_quantity(field, value)


def _check_quantity(field: dataclasses.Field[Any], value: Any) -> None:
    """Check one quantity, scalar or array, against its limits."""
    meta = field.metadata
    numbers = np.asarray(value, dtype=np.float64)
    unit = "" if meta["unit"] == "1" else f" {meta['unit']}"
    if not np.isfinite(numbers).all():
        raise ValueError(f"{file_key(field)} must be finite, got {_first(numbers, ~np.isfinite(numbers))}")
    for limit, broken, words in (
        (meta["above"], np.less_equal, "above"),
        (meta["minimum"], np.less, "at least"),
        (meta["maximum"], np.greater, "at most"),
    ):
        if limit is not None and broken(numbers, limit).any():
            got = _first(numbers, broken(numbers, limit))
            raise ValueError(f"{file_key(field)} must be {words} {limit:g}{unit}, got {got}")


def _first(numbers: NDArray[np.float64], mask: NDArray[np.bool_]) -> str:
    """Return the first offending number, as text."""
    return f"{np.atleast_1d(numbers)[np.atleast_1d(mask)][0]:g}"


def read_only(values: ArrayLike, dtype: type[Any] = np.float64) -> NDArray[Any]:
    """Return a copy of an array that cannot be written to, for use in a frozen record."""
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def all_finite(values: Iterable[float]) -> bool:
    """Return whether every value is a finite number.

    >>> all_finite([1.0, float("nan")])
    False
    """
    return all(math.isfinite(value) for value in values)

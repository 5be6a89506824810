"""Fields of records: a quantity with its unit, its limits and the key it has in files."""

from __future__ import annotations

import dataclasses
import functools
import math
import operator
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from evenlight.data_schema.arrays import Array as Array
else:
    Array = Sequence[float]  # at run time a name is enough: numpy is imported where arrays are made

UNIT_SUFFIX = {
    "cd/m^2": "_cd_m2",
    "cd/m^2/s": "_cd_m2_s",
    "s": "_s",
    "m": "_m",
    "W": "_w",
    "J": "_j",
    "W m^2/cd": "_w_m2_cd",
    "deg": "_deg",
    "Hz": "_hz",
    "pixels": "_px",
}
LARGEST_WHOLE = 2**63  # what arrays and other programs hold
# A date, with or without a time of day and its zone (ISO 8601); or nothing.
MOMENT = (
    "^([0-9]{4}-[0-9]{2}-[0-9]{2}"
    r"(T[0-9]{2}:[0-9]{2}(:[0-9]{2}(\.[0-9]+)?)?(Z|[+-][0-9]{2}:[0-9]{2})?)?)?$"
)


def quantity(
    unit: str,
    doc: str,
    *,
    default: Any = dataclasses.MISSING,
    above: float | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    min_items: int = 0,
    key: str | None = None,
    shape: tuple[str, ...] = (),
    later: bool = False,
    pattern: str | None = None,
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
    min_items : int, optional
        How many numbers a list of them must hold at least.
    key : str, optional
        Its key in files, where it is not the attribute's name with the unit's suffix.
    shape : tuple of str, optional
        Of an array: the name of each axis, or its length, e.g. ("N", "3").
    later : bool, optional
        As in `described`.
    pattern : str, optional
        Of a number that may be a word instead: what the word must match.
    """
    limits = {"above": above, "minimum": minimum, "maximum": maximum, "min_items": min_items}
    metadata = {"unit": unit, "doc": doc, "key": key, "shape": shape, "later": later, **limits}
    if pattern is not None:
        metadata["pattern"] = pattern
    return dataclasses.field(default=default, metadata=metadata)


def described(
    doc: str,
    *,
    default: Any = dataclasses.MISSING,
    pattern: str | None = None,
    later: bool = False,
    unhashed: bool = False,
) -> Any:
    """Return a dataclass field without a unit: a name, a choice, a flag.

    A `pattern` is a regular expression that the whole text, or each text of a list, must match. A field that
    a record got `later` leaves its hash as it was while it has its default, so that older files stay usable;
    one that is `unhashed` always does: another field tells its content.
    """
    metadata = {"doc": doc, "pattern": pattern, "later": later, "unhashed": unhashed}
    return dataclasses.field(default=default, metadata=metadata)


def as_in(record: type[Any], name: str) -> Any:
    """Return a dataclass field as another record declares it: its description, unit, limits and default."""
    field = next(field for field in dataclasses.fields(record) if field.name == name)
    return dataclasses.field(default=field.default, metadata=field.metadata)


def file_key(field: dataclasses.Field[Any]) -> str:
    """Return the key or column name that a field has in files."""
    explicit = field.metadata.get("key")
    return explicit or field.name + UNIT_SUFFIX.get(field.metadata.get("unit", ""), "")


def array_shapes(cls: type[Any]) -> dict[str, tuple[str, ...]]:
    """Return the axes of each array of a record, by the attribute's name."""
    fields = dataclasses.fields(cls)
    return {field.name: field.metadata["shape"] for field in fields if field.metadata.get("shape")}


def one_line(
    record: object, name: str, times: Array | Sequence[float], **shown: Array | Sequence[float]
) -> str:
    """Return a record with arrays in one line: its name, how many frames at which times [s], and ranges.

    >>> from types import SimpleNamespace
    >>> one_line(SimpleNamespace(), "bikes", (0.0, 0.5, 1.0), factors=(0.3, 0.5, 0.4))
    "<SimpleNamespace 'bikes': 3 frames from 0 to 1 s, factors 0.3 to 0.5>"
    """
    parts = [f"{len(times)} frames", *(f"{key} {_range(values)}" for key, values in shown.items())]
    if len(times):
        parts[0] += f" from {times[0]:g} to {times[-1]:g} s"
    return f"<{type(record).__name__} {name!r}: {', '.join(parts)}>"


def _range(values: Array | Sequence[float]) -> str:
    """Return the extremes of some numbers, in words."""
    extremes = _extremes(values)
    return f"{min(extremes):.4g} to {max(extremes):.4g}" if len(extremes) else "none"


def check_limits(record: Any) -> None:
    """Raise `ValueError` naming the quantity, the limit, the unit and the value got, if a field breaks one.

    Arrays and tuples are checked element by element; None stands for "not measured" and passes.
    """
    for field in _limited(record.__class__):
        value = getattr(record, field.name)
        if value is not None:
            check_value(field, value)


def check_value(field: dataclasses.Field[Any], value: Any) -> None:
    """Raise `ValueError` as `check_limits` does, for the value of one field."""
    if "unit" in field.metadata and not isinstance(value, str):
        _check_quantity(field, value)
        return
    pattern = field.metadata.get("pattern")
    for text in value if isinstance(value, tuple) else (value,):
        if pattern and not re.fullmatch(pattern, text):
            raise ValueError(f"{file_key(field)} must match {pattern}, got {text!r}")


@functools.cache
def _limited(cls: type[Any]) -> tuple[dataclasses.Field[Any], ...]:
    """Return the fields of a class whose values are checked; a data set has tens of thousands of records."""
    return tuple(
        field
        for field in dataclasses.fields(cls)
        if "unit" in field.metadata or field.metadata.get("pattern")
    )


def _check_quantity(field: dataclasses.Field[Any], value: Any) -> None:
    """Check one quantity, scalar or array, against its limits."""
    meta = field.metadata
    unit = "" if meta["unit"] == "1" else f" {meta['unit']}"
    for number in _extremes(value):
        if isinstance(number, int) and abs(number) >= LARGEST_WHOLE:
            digits = f"{math.log10(abs(number)):.0f}"
            raise ValueError(f"{file_key(field)} must be a whole number below 2^63, got one near 10^{digits}")
        if not -math.inf < number < math.inf:
            raise ValueError(f"{file_key(field)} must be finite, got {number:g}")
        for limit, breaks, words in (
            (meta["above"], operator.le, "above"),
            (meta["minimum"], operator.lt, "at least"),
            (meta["maximum"], operator.gt, "at most"),
        ):
            if limit is not None and breaks(number, limit):
                got = number if isinstance(number, int) else f"{number:.10g}"
                raise ValueError(f"{file_key(field)} must be {words} {limit:g}{unit}, got {got}")
    if meta["min_items"] and len(value) < meta["min_items"]:
        raise ValueError(
            f"{file_key(field)} must hold at least {meta['min_items']} number(s), got {len(value)}"
        )


def _extremes(value: Any) -> Sequence[float]:
    """Return the numbers of a value that decide about its limits: its own, or the extremes of an array.

    Scalars and tuples go without numpy: a data set has tens of thousands of records, and an array for each
    of their numbers would cost ten times as much.
    """
    if isinstance(value, int | float):
        return (value,)
    if isinstance(value, tuple) and all(isinstance(number, int | float) for number in value):
        return value
    import numpy as np

    numbers = np.asarray(value, dtype=np.float64)
    if numbers.size == 0:
        return ()
    return (float(numbers.min()), float(numbers.max()))  # a NaN makes both NaN


def read_only(values: ArrayLike, dtype: type[Any] = float) -> NDArray[Any]:
    """Return a copy of an array that cannot be written to, for use in a frozen record."""
    import numpy as np

    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def rises(values: Array) -> bool:
    """Return whether each number is greater than the one before.

    >>> rises(read_only([0.0, 0.5, 0.5]))
    False
    """
    return bool((values[1:] > values[:-1]).all())

"""Fields of records: a quantity with its unit, its limits and the key it has in files."""

from __future__ import annotations

import dataclasses
import enum
import functools
import math
import operator
import re
import sys
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

from evenlight.data_schema.errors import ArgumentError, FieldError, InputError, shown

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
    "mm": "_mm",
    "W": "_w",
    "J": "_j",
    "W m^2/cd": "_w_m2_cd",
    "deg": "_deg",
    "Hz": "_hz",
    "pixels": "_px",
}
Class = TypeVar("Class")
LARGEST_WHOLE = 2**63  # what arrays and other programs hold
_LARGEST = sys.float_info.max
_EXPECTED = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}
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


def share(doc: str, *, above: float | None = None, **declared: Any) -> Any:
    """Return a field for a pure number in [0, 1], or `above` a limit; others are as of `quantity`."""
    return quantity("1", doc, above=above, minimum=0.0 if above is None else None, maximum=1.0, **declared)


def count(doc: str, *, minimum: int = 0, **declared: Any) -> Any:
    """Return a field for a whole number of at least `minimum`; others are as of `quantity`."""
    return quantity("1", doc, minimum=minimum, **declared)


def described(
    doc: str,
    *,
    default: Any = dataclasses.MISSING,
    pattern: str | None = None,
    form: str = "",
    later: bool = False,
    unhashed: bool = False,
    factory: Callable[[], Any] | None = None,
) -> Any:
    """Return a dataclass field without a unit: a name, a choice, a flag.

    A `pattern` is a regular expression that the whole text, or each text of a list, must match; `form` says
    so in words, as "be one of ...". A field that a record got `later` leaves its hash as it was while it has
    its default, so that older files stay usable; one that is `unhashed` always does: another field tells its
    content. A `factory` makes the default that is not given.
    """
    metadata = {"doc": doc, "pattern": pattern, "form": form, "later": later, "unhashed": unhashed}
    if factory is not None:
        return dataclasses.field(default_factory=factory, metadata=metadata)
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
    extremes = _extremes(values)
    return f"{min(extremes):.4g} to {max(extremes):.4g}" if len(extremes) else "none"


@dataclass_transform(frozen_default=True)
def record(cls: type[Class]) -> type[Class]:
    """Make a class a record: a frozen dataclass whose constructor takes only what its fields declare.

    A choice may be given by its value, a tuple as a list or an array; arrays are copied, and cannot be
    written to. What is of another type or beyond a limit is refused with an `InputError`, and so is what the
    class's own `__post_init__`, which holds the rules between fields, raises `ValueError` about. It names the
    argument; who reads a file is told the key.
    """
    own: Callable[[Any], None] = cls.__dict__.get("__post_init__", lambda _: None)

    def __post_init__(self: Any) -> None:  # noqa: N807 - it becomes the class's own
        check_limits(self)
        try:
            own(self)
        except InputError:
            raise
        except ValueError as error:
            of_argument = of_key = str(error)
            for field in dataclasses.fields(self):
                if field.metadata.get("unit") in UNIT_SUFFIX:
                    of_argument = re.sub(rf"\b{file_key(field)}\b", field.name, of_argument)
            raise FieldError(of_argument, of_key) from None

    cls.__post_init__ = __post_init__  # type: ignore[attr-defined]
    return dataclasses.dataclass(frozen=True, slots=True)(cls)


def check_limits(record: Any) -> None:
    """Raise `FieldError` naming the quantity, what would be right and the value got, if a field is wrong.

    Values are made those of their type. Arrays and tuples are checked element by element; None stands for
    "not measured" and has no limits.
    """
    typed_fields, limited_fields = _checked(record.__class__)
    for field, kind, types_taken in typed_fields:
        value = getattr(record, field.name)
        if type(value) not in types_taken:
            object.__setattr__(record, field.name, _field_value(field, kind, value))
    for field, low, high in limited_fields:
        value = getattr(record, field.name)
        if type(value) in (int, float) and low <= value <= high:
            continue  # as nearly all are, and a data set has tens of thousands of records
        if value is not None:
            check_value(field, value)


@functools.cache
def _checked(cls: type[Any]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return the fields of a class with their types and those that need no look, and the limited fields."""
    kinds = typing.get_type_hints(cls)
    typed_fields, limited_fields = [], []
    for field in dataclasses.fields(cls):
        kind, meta = kinds[field.name], field.metadata
        parts = typing.get_args(kind) if _is_union(kind) else (kind,)
        taken = {part for part in parts if isinstance(part, type)} if not meta.get("shape") else set()
        typed_fields.append((field, kind, frozenset(taken)))
        if "unit" in meta or meta.get("pattern"):
            whole = int in parts
            low, high = (-LARGEST_WHOLE + 1, LARGEST_WHOLE - 1) if whole else (-_LARGEST, _LARGEST)
            low = math.nextafter(meta["above"], math.inf) if meta.get("above") is not None else low
            low = meta["minimum"] if meta.get("minimum") is not None else low
            high = meta["maximum"] if meta.get("maximum") is not None else high
            limited_fields.append((field, low, high))
    return tuple(typed_fields), tuple(limited_fields)


def _field_value(field: dataclasses.Field[Any], kind: Any, value: Any) -> Any:
    try:
        if not field.metadata.get("shape"):
            return typed(kind, value, "")
        if value is None and type(None) in typing.get_args(kind):
            return None
        array, axes = read_only(value), field.metadata["shape"]
        if array.ndim != len(axes):
            raise InputError(f"expected an array of shape ({', '.join(axes)}), got {array.shape}")
        return array
    except (ValueError, TypeError, OverflowError) as error:
        problem = str(error).removeprefix(": ")
        raise _field_error(field, f": {problem}") from None


def _field_error(field: dataclasses.Field[Any], problem: str) -> FieldError:
    return FieldError(field.name + problem, file_key(field) + problem)


def typed(kind: Any, value: Any, where: str, null: str = "") -> Any:
    """Return a value as the type that a field declares; raise `InputError` if it is of another.

    Which of several records it may be, its class's own rules say.
    """
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(kind, type) and origin is None and isinstance(value, kind) and kind not in (int, float):
        return value
    if hasattr(value, "tolist"):  # numpy's: a number, or an array for a tuple
        value = value.tolist()
    if _is_union(kind):
        possible = [part for part in parts if part is not type(None)]
        if value is None and type(None) in parts:
            return None
        if len(possible) > 1 and dataclasses.is_dataclass(value):
            return value
        lists = [part for part in possible if typing.get_origin(part) is tuple]
        likely = lists if isinstance(value, list | tuple) else []
        likeliest = type(value) if type(value) in possible else (*likely, *possible)[0]
        return typed(likeliest, value, where, " or null" if type(None) in parts else "")
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise InputError(f"{where}: expected a list{null}, got {shown(value)}")
        if parts[-1] is Ellipsis and set(map(type, value)) <= {parts[0]}:
            return tuple(value)
        of = [parts[0]] * len(value) if parts[-1] is Ellipsis else list(parts)
        if len(of) != len(value):
            raise InputError(f"{where}: expected {len(of)} values, got {len(value)}")
        return tuple(typed(part, each, where) for part, each in zip(of, value, strict=True))
    if origin is dict:
        if not isinstance(value, Mapping):
            raise InputError(f"{where}: expected a table of names and values{null}, got {shown(value)}")
        return {str(key): typed(parts[1], each, f"{where}: {key}") for key, each in value.items()}
    if dataclasses.is_dataclass(kind):
        raise InputError(f"{where}: expected a {getattr(kind, '__name__', kind)}{null}, got {shown(value)}")
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return choice(kind, value, where)
    if kind is float and type(value) is int:
        try:
            return float(value)
        except OverflowError:
            problem = "expected a number below 1.8e308, got a whole number beyond it"
            raise InputError(f"{where}: {problem}") from None
    if kind in _EXPECTED and type(value) is not kind:
        raise InputError(f"{where}: expected {_EXPECTED[kind]}{null}, got {shown(value)}")
    return value


def _is_union(kind: Any) -> bool:
    return typing.get_origin(kind) in (types.UnionType, typing.Union)


def choice(kind: type[enum.Enum], value: Any, where: str) -> enum.Enum:
    """Return a member of an enumeration by its value."""
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(repr(member.value) for member in kind)
        raise InputError(f"{where}: expected one of {known}, got {shown(value)}") from None


def require_computable(where: str, value: object) -> None:
    """Raise `InputError` for NaN, infinity, and whole numbers that no array can hold."""
    if isinstance(value, float) and not math.isfinite(value):
        raise ArgumentError(where, f"must be a finite number, got {value:g}")
    if isinstance(value, int) and abs(value) >= LARGEST_WHOLE:
        got = f"one near 10^{math.log10(abs(value)):.0f}"
        raise ArgumentError(where, f"must be a whole number below 2^63, got {got}")


def check_value(field: dataclasses.Field[Any], value: Any) -> None:
    """Raise `FieldError` if the value of a field, of the right type, is beyond its limits."""
    if broken := _broken_limit(field, value):
        raise _field_error(field, f" must {broken[0]} {broken[1]}")


def limit_expected(field: dataclasses.Field[Any], value: Any) -> str:
    """Return what the limits of a field would have in place of a value; empty if it keeps them."""
    verb, right = _broken_limit(field, value) or ("", "")
    words = {"be": "expected ", "match": "expected text that matches ", "hold": "expected a list of "}
    return words[verb] + right if verb else ""


def _one_of(pattern: str) -> str:
    """Return the words among which a pattern leaves the choice; empty where it is no such pattern."""
    words = re.fullmatch(r"\^\(([\w|-]+)\)\$", pattern)
    return f"one of {words[1].replace('|', ', ')}" if words else ""


def _broken_limit(field: dataclasses.Field[Any], value: Any) -> tuple[str, str] | None:
    """Return what a value "must be", "match" or "hold", and what it is; None if it keeps its limits."""
    meta = field.metadata
    if "unit" not in meta or isinstance(value, str):
        for text in value if isinstance(value, tuple) else (value,):
            if meta.get("pattern") and not re.fullmatch(meta["pattern"], text):
                form = meta.get("form") or _one_of(meta["pattern"])
                return ("be" if form else "match"), f"{form or meta['pattern']}, got {text!r}"
        return None
    unit = "" if meta["unit"] == "1" else f" {meta['unit']}"
    for number in _extremes(value):
        if isinstance(number, int) and abs(number) >= LARGEST_WHOLE:
            return "be", f"a whole number below 2^63, got one near 10^{math.log10(abs(number)):.0f}"
        if not -math.inf < number < math.inf:
            return "be", f"finite, got {number:g}"
        for limit, breaks, words in (
            (meta["above"], operator.le, "above"),
            (meta["minimum"], operator.lt, "at least"),
            (meta["maximum"], operator.gt, "at most"),
        ):
            if limit is not None and breaks(number, limit):
                got = number if isinstance(number, int) else f"{number:.10g}"
                return "be", f"{words} {limit:g}{unit}, got {got}"
    if meta["min_items"] and not isinstance(value, int | float) and len(value) < meta["min_items"]:
        return "hold", f"at least {meta['min_items']} number(s), got {len(value)}"
    return None


def _extremes(value: Any) -> Sequence[float]:
    """Return the numbers of a value that decide about its limits; the first that is not finite alone does.

    Tuples go without numpy: an array for each of a data set's would cost ten times as much.
    """
    if isinstance(value, int | float):
        return (value,)
    if isinstance(value, tuple) and value:
        if isinstance(value[0], float) and not all(map(math.isfinite, value)):
            return (next(number for number in value if not math.isfinite(number)),)
        return (min(value), max(value))
    import numpy as np

    numbers = np.asarray(value, dtype=np.float64)
    return (float(numbers.min()), float(numbers.max())) if numbers.size else ()  # a NaN makes both NaN


def read_only(values: ArrayLike, dtype: type[Any] = float) -> NDArray[Any]:
    """Return a copy of an array that cannot be written to, for use in a frozen record; of one, itself."""
    import numpy as np

    if (  # as of a record that is replaced by one with other fields
        isinstance(values, np.ndarray)
        and values.dtype == dtype
        and values.base is None
        and not values.flags.writeable
    ):
        return values
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def rises(values: Array) -> bool:
    """Return whether each number is greater than the one before.

    >>> rises(read_only([0.0, 0.5, 0.5]))
    False
    """
    return bool((values[1:] > values[:-1]).all())

"""Records to plain mappings and back, for every text format (json, toml, csv rows)."""

from __future__ import annotations

import dataclasses
import difflib
import enum
import json
import types
import typing
from collections.abc import Hashable, Iterable, Mapping
from functools import cache
from typing import Any, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import SCHEMA_VERSION, sha256_of_bytes
from evenlight.data_schema.quantities import file_key

Record = TypeVar("Record")


def mapping_from_record(record: Any) -> dict[str, Any]:
    """Return a record as a mapping of plain values under its file keys (units included)."""
    return {file_key(f): plain_value(getattr(record, f.name)) for f in dataclasses.fields(record)}


def plain_value(value: Any) -> Any:
    """Return a value as JSON and TOML know it."""
    if dataclasses.is_dataclass(value):
        return mapping_from_record(value)
    if isinstance(value, enum.Enum):
        return value.value
    if hasattr(value, "tolist"):  # of numpy, which this module does without: it is loaded by every command
        return value.tolist()
    if isinstance(value, tuple | list):
        return [plain_value(v) for v in value]
    if isinstance(value, Mapping):
        return {k: plain_value(v) for k, v in value.items()}
    return value


def sha256_of_record(record: Any) -> str:
    """Return the SHA-256 of a record's content, the same whether it came from a preset or a file."""
    content = mapping_from_record(record)
    for field in dataclasses.fields(record):
        unchanged = field.metadata.get("later") and getattr(record, field.name) == field.default
        if unchanged or field.metadata.get("unhashed"):
            del content[file_key(field)]
    text = json.dumps(content, sort_keys=True)
    return sha256_of_bytes(text.encode())


def record_from_mapping(cls: type[Record], data: object, where: str) -> Record:
    """Return a record made from a mapping of plain values, checked strictly.

    Parameters
    ----------
    cls : type
        The record's class.
    data : object
        What was read; anything but a mapping with the record's keys is refused.
    where : str
        File (and line) it came from, for the error.

    Raises
    ------
    InputError
        For a missing, unknown or ill-typed key, a value outside its limits, or a newer schema.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"{where}: expected the keys of a {cls.__name__}, got {shown(data)}")
    refuse_newer_schema(data, where)
    fields, required = keys_of(cls)
    for key in data:
        if key not in fields:
            raise InputError(f"{where}: {unknown_key(key, fields)}")
    for key in required:
        if key not in data:
            raise InputError(f"{where}: the key {key!r} of a {cls.__name__} is missing")
    kinds = types_in(cls, data)
    values = {}
    for key, name in fields.items():
        if key in data:
            kind, value = kinds[name], data[key]
            # Most values are of their type already, and a data set has hundreds of thousands of them.
            values[name] = value if type(value) is kind else _typed(kind, value, f"{where}: {key}")
    try:
        return cls(**values)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def unknown_key(key: object, known: Iterable[str]) -> str:
    """Return a message about an unknown key, with the known key that is most like it.

    >>> unknown_key("gama", ["name", "gamma"])
    "unknown key 'gama'; did you mean 'gamma'?"
    """
    known = list(known)
    hint = difflib.get_close_matches(str(key), known, n=1)
    guess = f"did you mean {hint[0]!r}?" if hint else f"known are {', '.join(known)}"
    return f"unknown key {shown(key)}; {guess}"


def shown(value: object) -> str:
    """Return a value as it is put into a message: as JSON names its kind, and not too long.

    >>> shown({"a": 1}), shown([1, 2]), shown(None)
    ('a table', 'a list', 'null')
    """
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"


def keys_of(cls: type[Any]) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the attribute for each file key of a record, and the keys that a file must have."""
    return _keys(typing.cast(Hashable, cls))


@cache
def _keys(cls: Any) -> tuple[dict[str, str], tuple[str, ...]]:
    fields = dataclasses.fields(cls)
    required = (
        file_key(f)
        for f in fields
        if f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
    )
    return {file_key(f): f.name for f in fields}, tuple(required)


def type_hints(cls: type[Any]) -> dict[str, Any]:
    """Return the types of a record's fields; looked up once, because a data set has thousands of rows."""
    return _hints(typing.cast(Hashable, cls))


@cache
def _hints(cls: Any) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def nullable_fields(cls: type[Any]) -> frozenset[str]:
    """Return the fields of a record that may be None: not there, or unknown."""
    kinds = type_hints(cls).items()
    return frozenset(name for name, kind in kinds if types.NoneType in typing.get_args(kind))


def types_in(cls: type[Any], data: object) -> dict[str, Any]:
    """Return the types of a record's fields, those that depend on its content among them."""
    if hasattr(cls, "types_in") and isinstance(data, Mapping):
        own: dict[str, Any] = cls.types_in(data)
        return type_hints(cls) | own
    return type_hints(cls)


def refuse_newer_schema(data: Mapping[str, Any], where: str) -> None:
    """Refuse a file whose schema version is newer than this software."""
    origin = data.get("provenance", data)
    version = origin.get("schema_version") if isinstance(origin, Mapping) else None
    if isinstance(version, int) and version > SCHEMA_VERSION:
        raise InputError(
            f"{where}: written in schema version {version}, this Evenlight reads up to {SCHEMA_VERSION}; "
            f"update Evenlight"
        )


def _typed(kind: Any, value: Any, where: str) -> Any:
    """Return a plain value as the type that a field declares."""
    origin = typing.get_origin(kind)
    if origin in (types.UnionType, typing.Union):
        if value is None and types.NoneType in typing.get_args(kind):
            return None
        return _typed(_likeliest(typing.get_args(kind), value), value, where)
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise InputError(f"{where}: expected a list, got {shown(value)}")
        parts = typing.get_args(kind)
        of = [parts[0]] * len(value) if parts[-1] is Ellipsis else list(parts)
        if len(of) != len(value):
            raise InputError(f"{where}: expected {len(of)} values, got {len(value)}")
        return tuple(_typed(k, v, where) for k, v in zip(of, value, strict=True))
    if origin is dict:
        if not isinstance(value, Mapping):
            raise InputError(f"{where}: expected a table of names and values, got {shown(value)}")
        return {str(k): _typed(typing.get_args(kind)[1], v, where) for k, v in value.items()}
    if dataclasses.is_dataclass(kind):
        return record_from_mapping(typing.cast("type[Any]", kind), value, where)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return _choice(kind, value, where)
    if kind is float and type(value) is int:
        return _float(value, where)
    if kind in (int, float, str, bool) and type(value) is not kind:
        names = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}
        raise InputError(f"{where}: expected {names[kind]}, got {shown(value)}")
    return value


def _likeliest(kinds: tuple[Any, ...], value: Any) -> Any:
    """Return which of several types a value is of: of records, the one whose keys are most like its own."""
    possible = [kind for kind in kinds if kind is not type(None)]
    records: list[Any] = [kind for kind in possible if dataclasses.is_dataclass(kind)]
    if len(possible) == 1 or not records or not isinstance(value, Mapping):
        return type(value) if type(value) in possible else possible[0]
    known = {kind: keys_of(kind)[0].keys() for kind in records}
    return max(records, key=lambda kind: len(known[kind] & value.keys()) / len(known[kind] | value.keys()))


def _float(value: int, where: str) -> float:
    """Return a whole number as a floating-point one, if it has one."""
    try:
        return float(value)
    except OverflowError:
        raise InputError(f"{where}: expected a number below 1.8e308, got a whole number beyond it") from None


def _choice(kind: type[enum.Enum], value: Any, where: str) -> enum.Enum:
    """Return a member of an enumeration by its value."""
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(repr(m.value) for m in kind)
        raise InputError(f"{where}: expected one of {known}, got {shown(value)}") from None

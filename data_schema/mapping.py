"""Records to plain mappings and back, for every text format (json, toml, csv rows)."""

from __future__ import annotations

import dataclasses
import difflib
import enum
import json
import re
import types
import typing
from collections.abc import Hashable, Iterable, Iterator, Mapping
from functools import cache
from typing import Any, TypeVar

from evenlight.data_schema.errors import InputError, shown, told_of_file
from evenlight.data_schema.provenance import SCHEMA_VERSION, sha256_of_bytes
from evenlight.data_schema.quantities import check_limits, file_key, limit_expected, typed

Record = TypeVar("Record")
MOST_LISTED = 60  # keys, in a message about an unknown one
Place = tuple[str | int, ...]  # keys and list indices, from the outermost in


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
        What was read; anything but a mapping with the record's keys is refused. Keys that earlier versions
        wrote are passed over if the class names them in `FORMER_KEYS`.
    where : str
        File (and line) it came from, for the error.

    Raises
    ------
    InputError
        For a missing, unknown or ill-typed key, a value outside its limits, or a newer schema.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"{where}: expected the keys of a {words_of(cls)}, got {shown(data)}")
    refuse_newer_schema(data, where)
    fields, required = keys_of(cls)
    for key in data:
        if key not in fields and key not in getattr(cls, "FORMER_KEYS", ()):
            raise InputError(f"{where}: {unknown_key(key, fields)}")
    for key in required:
        if key not in data:
            raise InputError(f"{where}: the key {key!r} of a {words_of(cls)} is missing")
    parts = types_in(cls, data)
    values = {name: data[key] for key, name in fields.items() if key in data}
    for key, name in _inner_records(cls):
        if name in values:
            values[name] = _with_records(parts[name], values[name], f"{where}: {key}")
    try:
        made = cls(**values)
        if not hasattr(cls, "__post_init__"):  # a task's from a package, which takes anything
            check_limits(made)
        return made
    except ValueError as error:
        raise InputError(f"{where}: {told_of_file(error)}") from None


def words_of(cls: type[Any]) -> str:
    """Return what a record is called in messages: `RateLimit` is a rate limit."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", cls.__name__).lower()


def problems_in(cls: type[Any], data: object, place: Place = ()) -> Iterator[tuple[Place, str]]:
    """Yield every place at which a mapping is not that of a record, and what would be right there.

    >>> from evenlight.data_schema.display import Display
    >>> list(problems_in(Display, {"peak_luminance_cd_m2": -1.0}))[-1]
    (('peak_luminance_cd_m2',), 'expected at least 1e-06 cd/m^2, got -1')
    """
    if not isinstance(data, Mapping):
        yield place, f"expected a table of names and values, got {shown(data)}"
        return
    known, required = keys_of(cls)
    yield from ((place, f"the key {key!r} is missing") for key in required if key not in data)
    for key in data:
        if key not in known and key not in getattr(cls, "FORMER_KEYS", ()):
            yield (*place, key), unknown_key(key, known)
    kinds = types_in(cls, data)
    for field in dataclasses.fields(cls):
        if file_key(field) in data:
            key = file_key(field)
            yield from _problems_at(field, kinds[field.name], data[key], (*place, key))


def _problems_at(
    field: dataclasses.Field[Any], kind: Any, value: Any, place: Place
) -> Iterator[tuple[Place, str]]:
    parts = typing.get_args(kind)
    if isinstance(value, list) and typing.get_origin(kind) is tuple:
        inside = [
            each for n, one in enumerate(value) for each in _problems_at(field, parts[0], one, (*place, n))
        ]
        yield from inside
        if inside or _holds_records(kind):
            return
    elif _holds_records(kind) and typing.get_origin(kind) is not tuple:
        if value is not None or type(None) not in parts:
            yield from problems_in(_likeliest(parts or (kind,), value), value, place)
        return
    try:
        value = typed(kind, value, "")
    except InputError as error:
        yield place, str(error).removeprefix(": ")
    else:
        if problem := "" if value is None else limit_expected(field, value):
            yield place, problem


def unknown_key(key: object, known: Iterable[str]) -> str:
    """Return a message about an unknown key, with the known key that is most like it.

    >>> unknown_key("gama", ["name", "gamma"])
    "unknown key 'gama'; did you mean 'gamma'?"
    """
    known = list(known)
    hint = difflib.get_close_matches(str(key), known, n=1, cutoff=0.7)
    listed = f"known are {', '.join(known)}" if len(known) <= MOST_LISTED else "nor is any like it known"
    guess = f"did you mean {hint[0]!r}?" if hint else listed
    return f"unknown key {shown(key)}; {guess}"


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


def _inner_records(cls: type[Any]) -> tuple[tuple[str, str], ...]:
    """Return key and name of the fields of a record that hold records."""
    return _inner(typing.cast(Hashable, cls))


@cache
def _inner(cls: Any) -> tuple[tuple[str, str], ...]:
    kinds = type_hints(cls)
    return tuple((key, name) for key, name in _keys(cls)[0].items() if _holds_records(kinds[name]))


def _holds_records(kind: Any) -> bool:
    return dataclasses.is_dataclass(kind) or any(map(_holds_records, typing.get_args(kind)))


def _with_records(kind: Any, value: Any, where: str) -> Any:
    """Return a plain value with records in place of the mappings that its type has them for."""
    parts = typing.get_args(kind)
    if value is None and type(None) in parts:
        return None
    if typing.get_origin(kind) is tuple:
        return [_with_records(parts[0], each, where) for each in value] if isinstance(value, list) else value
    return record_from_mapping(_likeliest(parts or (kind,), value), value, where)


def _likeliest(kinds: tuple[Any, ...], value: Any) -> Any:
    """Return which of several records a value is: the one whose keys are most like its own."""
    records: list[Any] = [kind for kind in kinds if dataclasses.is_dataclass(kind)]
    if len(records) == 1 or not isinstance(value, Mapping):
        return records[0]
    known = {kind: keys_of(kind)[0].keys() for kind in records}
    return max(records, key=lambda kind: len(known[kind] & value.keys()) / len(known[kind] | value.keys()))

"""JSON, TOML and CSV files of records."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import tomllib
import types
import typing
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import tomli_w

from data_schema.errors import InputError
from data_schema.files import write_whole
from data_schema.mapping import mapping_from_record, record_from_mapping
from data_schema.quantities import file_key

Record = TypeVar("Record")


def read_text(path: Path, what: str) -> str:
    """Return a file's text, or raise an `InputError` that names the file and what was expected in it."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected {what}") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; expected {what}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text; expected {what}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); expected {what}") from error


def read_json(path: Path, what: str) -> Any:
    """Return the content of a JSON file."""
    try:
        return json.loads(read_text(path, what))
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}: not valid JSON at line {error.lineno} ({error.msg}); expected {what}"
        ) from None


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file, whole, with numbers in full precision; NaN is refused, as JSON has none."""
    write_whole(path, json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def read_json_record(cls: type[Record], path: Path) -> Record:
    """Return the record that a JSON file holds."""
    return record_from_mapping(cls, read_json(path, f"a {cls.__name__} in JSON"), str(path))


def write_json_record(path: Path, record: Any) -> None:
    """Write a record as a JSON file."""
    write_json(path, mapping_from_record(record))


def read_toml_record(cls: type[Record], path: Path) -> Record:
    """Return the record that a TOML file holds."""
    what = f"a {cls.__name__} in TOML"
    try:
        data = tomllib.loads(read_text(path, what))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}; expected {what}") from None
    return record_from_mapping(cls, data, str(path))


def write_toml_record(path: Path, record: Any) -> None:
    """Write a record as a TOML file; TOML has no null, so None is left out."""
    write_whole(path, tomli_w.dumps(_without_none(mapping_from_record(record))))


def _without_none(value: Any) -> Any:
    """Return nested mappings without the keys whose value is None."""
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    return value


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV: numbers in full precision, an empty cell for None."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return stream.getvalue()


def write_rows(path: Path, cls: type[Any], records: Iterable[Any]) -> None:
    """Write records of one class as a CSV table, one row each."""
    columns = [file_key(f) for f in dataclasses.fields(cls)]
    write_whole(path, csv_text(columns, (list(mapping_from_record(r).values()) for r in records)))


def read_rows(cls: type[Record], path: Path) -> list[Record]:
    """Return the records of a CSV table whose columns are the record's keys, in any order."""
    reader = csv.DictReader(io.StringIO(read_text(path, f"a table of {cls.__name__} rows")))
    kinds = typing.get_type_hints(cls)
    by_key = {file_key(f): kinds[f.name] for f in dataclasses.fields(cls)}  # type: ignore[arg-type] # a dataclass
    records = []
    for line, row in enumerate(reader, start=2):
        where = f"{path}, line {line}"
        if None in row or None in row.values():
            raise InputError(f"{where}: has not as many cells as the header; the table is torn")
        cells = {key: _cell(by_key.get(key, str), text, f"{where}: {key}") for key, text in row.items()}
        records.append(record_from_mapping(cls, cells, where))
    return records


def _cell(kind: Any, text: str, where: str) -> Any:
    """Return a cell's text as the plain value of its column."""
    if isinstance(kind, types.UnionType):
        if text == "":
            return None
        kind = next(k for k in typing.get_args(kind) if k is not type(None))
    try:
        if kind is bool:
            return {"True": True, "False": False, "true": True, "false": False}[text]
        return kind(text) if kind in (int, float) else text
    except (ValueError, KeyError):
        names = {int: "a whole number", float: "a number", bool: "True or False"}
        raise InputError(f"{where}: expected {names[kind]}, got {text!r}") from None

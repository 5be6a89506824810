"""Checking one file: every problem in it, by its JSON Schema and by making the record."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.json_schema import committed_schema, schema_of
from evenlight.data_schema.mapping import (
    record_from_mapping,
    refuse_newer_schema,
    shown,
    type_hints,
    types_in,
    unknown_key,
)
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.record_kinds import KINDS, FileFormat, RecordKind
from evenlight.data_schema.storage.tables import columns_of, csv_rows, optional_columns, plain_cell
from evenlight.data_schema.storage.text_files import (
    Place,
    json_line_numbers,
    line_of,
    parse_json,
    read_text,
    read_toml,
    toml_line_numbers,
)
from evenlight.data_schema.tracks.brightness_track import TRACK_COLUMNS, BrightnessTrack, read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator, ValidationError

Locate = Callable[[Place], str]
_TYPES = {
    "integer": "a whole number",
    "number": "a number",
    "string": "text",
    "boolean": "true or false",
    "array": "a list",
    "object": "a table of names and values",
    "null": "null",
}
_LIMITS = {"exclusiveMinimum": "above", "minimum": "at least", "maximum": "at most"}
_LENGTHS = {"minItems": "at least", "maxItems": "at most"}


@dataclass(slots=True)
class CheckedFile:
    """A file, what was found in it, and the records that could be made of it.

    Attributes
    ----------
    path : Path
        The file.
    words : str
        What it was checked as; empty if it was not checked.
    problems : list of str
        What is wrong, each with file, line, key and value.
    notes : list of str
        What a reader should know, though nothing is wrong.
    records : list of (int, record)
        Records with the line they come from (0 for a file that is one record); those with a problem are
        left out.
    """

    path: Path
    words: str
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    records: list[tuple[int, Any]] = field(default_factory=list)

    @property
    def record(self) -> Any | None:
        """The record of a file that is one; None if it has a problem."""
        return self.records[0][1] if self.records else None

    @classmethod
    def blamed(cls, path: Path, words: str, problem: str) -> CheckedFile:
        """Return a file, or its place, with one problem."""
        checked = cls(path, words)
        checked.blame(problem)
        return checked

    def blame(self, problem: str, line: int = 0) -> None:
        """Note a problem, in a line if one is given."""
        self.problems.append(f"{self.path}{f', line {line}' if line else ''}: {problem}")


def check_file(path: Path, kind: RecordKind) -> CheckedFile:
    """Return what is in a file of a kind, and all that is wrong with it."""
    checked = CheckedFile(path, kind.words)
    check = {
        FileFormat.TOML: _check_toml,
        FileFormat.JSON: _check_json,
        FileFormat.JSON_LINES: _check_json_lines,
        FileFormat.CSV: _check_table,
        FileFormat.NPZ: _check_arrays,
    }[kind.file_format]
    try:
        check(checked, kind)
    except InputError as error:
        checked.problems.append(str(error))
    if isinstance(checked.record, RateLimit) and checked.record.wide_band:
        checked.notes.append(f"{path}: {checked.record.wide_band}; refused without --accept-wide-band")
    return checked


def _check_toml(checked: CheckedFile, kind: RecordKind) -> None:
    """Check a TOML file that is one record."""
    content = read_toml(checked.path, f"a {kind.words} in TOML")
    lines = toml_line_numbers(read_text(checked.path, kind.words))
    _check_content(checked, kind, content, 0, _place_in_file(checked.path, lines))


def _check_json(checked: CheckedFile, kind: RecordKind) -> None:
    """Check a JSON file that is one record."""
    text = read_text(checked.path, f"a {kind.words} in JSON")
    content = parse_json(text, str(checked.path), f"a {kind.words}")
    _check_content(checked, kind, content, 0, _place_in_file(checked.path, json_line_numbers(text)))


def _place_in_file(path: Path, lines: dict[Place, int]) -> Locate:
    """Return a function that tells where a place of a content is: file, line, key."""

    def where(place: Place) -> str:
        line = line_of(place, lines)
        return f"{path}{f', line {line}' if line else ''}{_key(place)}"

    return where


def _key(place: Place) -> str:
    """Return a place as it is written, `: display.gamma`; nothing for the whole content."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return f": {text.lstrip('.')}" if text else ""


def _check_json_lines(checked: CheckedFile, kind: RecordKind) -> None:
    """Check a file with one record in each line; a last line without its end was torn off."""
    text = read_text(checked.path, f"a {kind.words} in each line")
    for number, line in enumerate(io.StringIO(text), start=1):  # unlike splitlines: at line ends only
        if not line.strip():
            continue
        where = f"{checked.path}, line {number}"
        try:
            content = parse_json(line, where, f"a {kind.words}")
        except InputError as error:
            torn = not line.endswith("\n")
            checked.problems.append(
                f"{where}: the last line is torn, it was not complete; --resume cuts it off and keeps it in "
                "the log of events"
                if torn
                else str(error)
            )
            continue
        _check_row(checked, kind, content, number)


def _check_table(checked: CheckedFile, kind: RecordKind) -> None:
    """Check a table with one record in each row, or a brightness track."""
    if kind.record is BrightnessTrack:
        _check_track(checked, kind)
        return
    optional = optional_columns(kind.record)
    for number, cells in _rows_of(checked, columns_of(kind.record), kind.words, optional):
        row = _row(checked, kind, cells, number)
        if row is not None:
            _check_row(checked, kind, row, number)


def _check_track(checked: CheckedFile, kind: RecordKind) -> None:
    """Check a brightness track as a whole; if it is unusable, row by row."""
    try:
        checked.records.append((0, read_track(checked.path)))
    except InputError as error:
        for number, cells in _rows_of(checked, TRACK_COLUMNS, kind.words):
            row: dict[str, Any] = {}
            for name, text in zip(TRACK_COLUMNS, cells, strict=True):
                kind_of_cell = int if name == "frame" else float
                _put_cell(checked, row, name, kind_of_cell, text, number)
            checked.problems += [
                f"{checked.path}, line {number}{_key(place)}: {problem}"
                for place, problem in schema_problems(row, kind.name)
                if place
            ]
        if not checked.problems or not checked.path.with_suffix(".json").exists():
            checked.problems.append(str(error))


def _rows_of(
    checked: CheckedFile, columns: Iterable[str], words: str, optional: Collection[str] = ()
) -> Iterable[tuple[int, list[str]]]:
    """Yield the rows of a table; note those that are torn."""
    return csv_rows(
        checked.path,
        list(columns),
        f"a table ({words})",
        torn=lambda error: checked.problems.append(str(error)),
        optional=optional,
    )


def _row(checked: CheckedFile, kind: RecordKind, cells: list[str], number: int) -> dict[str, Any] | None:
    """Return a row as plain values; None if a cell cannot be one, each of which is noted."""
    before = len(checked.problems)
    row: dict[str, Any] = {}
    kinds = type_hints(kind.record)
    optional = optional_columns(kind.record)
    for column, text in zip(dataclasses.fields(kind.record), cells, strict=True):
        if not text and file_key(column) in optional:
            continue
        _put_cell(checked, row, file_key(column), kinds[column.name], text, number)
    return row if len(checked.problems) == before else None


def _put_cell(
    checked: CheckedFile, row: dict[str, Any], name: str, kind: Any, text: str, number: int
) -> None:
    """Put a cell into a row, or note why it cannot be."""
    try:
        row[name] = plain_cell(kind, text, f"{checked.path}, line {number}: {name}")
    except InputError as error:
        checked.problems.append(str(error))


def _check_row(checked: CheckedFile, kind: RecordKind, content: Any, number: int) -> None:
    """Check one of many records: by making it, and where that fails by its schema, which finds all.

    What its schema refuses cannot be made into a record (a test holds that), so the schema, which takes
    four times as long, has nothing to add where the record could be made.
    """
    where = f"{checked.path}, line {number}"
    try:
        checked.records.append((number, record_from_mapping(kind.record, content, where)))
    except InputError as error:
        found = _problems_in(content, kind)
        checked.problems += [f"{where}{_key(place)}: {problem}" for place, problem in found]
        if not found:
            checked.problems.append(str(error))


def _check_content(checked: CheckedFile, kind: RecordKind, content: Any, number: int, where: Locate) -> None:
    """Check the content of a file that is one record, by its schema and then by making it."""
    if isinstance(content, dict):
        refuse_newer_schema(content, str(checked.path))
    found = _problems_in(content, kind)
    checked.problems += [f"{where(place)}: {problem}" for place, problem in found]
    if not found:
        checked.records.append((number, record_from_mapping(kind.record, content, str(checked.path))))


def _check_arrays(checked: CheckedFile, kind: RecordKind) -> None:
    """Check loss curves."""
    checked.records.append((0, read_loss_curves(checked.path)))


def schema_problems(content: Any, name: str) -> list[tuple[Place, str]]:
    """Return every place at which a content breaks a schema, and what would be right there.

    Parameters
    ----------
    content : object
        Plain values, as read from JSON or TOML.
    name : str
        Name of the schema.

    >>> schema_problems({"peak_luminance_cd_m2": -1.0}, "display")[-1]
    (('peak_luminance_cd_m2',), 'expected at least 1e-06 cd/m^2, got -1.0')
    """
    return _broken(_validator(name), content)


def _problems_in(content: Any, kind: RecordKind) -> list[tuple[Place, str]]:
    """Return where a content breaks the schema of its kind; that of a registered task is not committed."""
    types = types_in(kind.record, content)
    if kind in KINDS and types == type_hints(kind.record):
        return schema_problems(content, kind.name)
    from jsonschema import Draft202012Validator

    return _broken(Draft202012Validator(schema_of(kind, types)), content)


def _broken(validator: Draft202012Validator, content: Any) -> list[tuple[Place, str]]:
    """Return every place at which a content breaks a schema, in order."""
    problems = [each for error in validator.iter_errors(content) for each in _problems_of(error)]
    return sorted(problems, key=lambda problem: [str(key) for key in problem[0]])


@cache
def _validator(name: str) -> Draft202012Validator:
    """Return the validator of a schema; jsonschema is imported only where something is validated."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(committed_schema(name))


def _problems_of(error: ValidationError) -> Iterator[tuple[Place, str]]:
    """Yield what one error of jsonschema says: its place, and the problem in words."""
    place: Place = tuple(error.absolute_path)
    rule, limit = str(error.validator), error.validator_value
    got: Any = error.instance
    schema = error.schema if isinstance(error.schema, dict) else {}
    if rule == "anyOf":
        yield from _nearest_choice(error)
    elif rule == "required":
        # jsonschema reports each missing key apart, and names it in its message only.
        yield place, f"the key {error.message.split(' is a required')[0]} is missing"
    elif rule == "additionalProperties":
        known = list(schema["properties"])
        for key in got:
            if key not in known:
                yield (*place, key), unknown_key(key, known)
    elif rule in _LIMITS:
        unit = "" if schema.get("unit", "1") == "1" else f" {schema['unit']}"
        yield place, f"expected {_LIMITS[rule]} {limit:g}{unit}, got {shown(got)}"
    elif rule in _LENGTHS:
        yield place, f"expected a list of {_LENGTHS[rule]} {limit}, got {len(got)}"
    else:
        yield place, f"expected {_expected(rule, limit)}, got {shown(got)}"


def _expected(rule: str, limit: Any) -> str:
    """Return what a rule about the kind of a value wants."""
    if rule == "type":
        names = limit if isinstance(limit, list) else [limit]
        return " or ".join(_TYPES[name] for name in names)
    if rule == "enum":
        return "one of " + ", ".join(map(repr, limit))
    return f"text that matches {limit}" if rule == "pattern" else f"{rule} {limit!r}"


def _nearest_choice(error: ValidationError) -> Iterator[tuple[Place, str]]:
    """Yield what is wrong by the choice that comes nearest: the one broken deepest inside, not at the top."""
    choices: dict[int, list[ValidationError]] = {}
    for cause in error.context or []:
        choices.setdefault(int(cause.schema_path[0]), []).append(cause)
    inside = [
        causes
        for causes in choices.values()
        if not any(c.validator == "type" and not c.relative_path for c in causes)
    ]
    for cause in min(inside or choices.values(), key=len):
        yield from _problems_of(cause)

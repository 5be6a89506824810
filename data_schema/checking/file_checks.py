"""Checking one file: every problem in it, by making the record and, where that fails, each of its keys."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import (
    Place,
    problems_in,
    record_from_mapping,
    refuse_newer_schema,
)
from evenlight.data_schema.quantities import file_key, limit_expected, typed
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.record_kinds import FileFormat, RecordKind
from evenlight.data_schema.recordings.session import TASKS, SessionManifest
from evenlight.data_schema.storage.tables import (
    columns_of,
    csv_rows,
    optional_columns,
    plain_cell,
    plain_cells,
)
from evenlight.data_schema.storage.text_files import (
    json_line_numbers,
    line_of,
    parse_json,
    read_text,
    read_toml,
    toml_line_numbers,
)
from evenlight.data_schema.tracks.brightness_track import TRACK_COLUMNS, BrightnessTrack, read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves

Locate = Callable[[Place], str]


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
    content = read_toml(checked.path, f"a {kind.words} in TOML")
    lines = toml_line_numbers(read_text(checked.path, kind.words))
    _check_content(checked, kind, content, 0, _place_in_file(checked.path, lines))


def _check_json(checked: CheckedFile, kind: RecordKind) -> None:
    text = read_text(checked.path, f"a {kind.words} in JSON")
    content = parse_json(text, str(checked.path), f"a {kind.words}")
    task = content.get("task") if kind.record is SessionManifest and isinstance(content, dict) else None
    if isinstance(task, str) and task not in TASKS:
        content |= {"design": None}  # of a task that is not here nobody knows what is right
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
    if kind.record is BrightnessTrack:
        _check_track(checked, kind)
        return
    optional = optional_columns(kind.record)
    for number, cells in _rows_of(checked, columns_of(kind.record), kind.words, optional):
        _check_row(checked, kind, plain_cells(kind.record, cells), number)


def _check_track(checked: CheckedFile, kind: RecordKind) -> None:
    """Check a brightness track as a whole; if it is unusable, row by row."""
    try:
        checked.records.append((0, read_track(checked.path)))
    except InputError as error:
        columns = {file_key(each): each for each in dataclasses.fields(BrightnessTrack)}
        for number, cells in _rows_of(checked, TRACK_COLUMNS, kind.words):
            for name, text in zip(TRACK_COLUMNS, cells, strict=True):
                of = int if name == "frame" else float
                try:
                    value = typed(of, plain_cell(of, text), name)
                except InputError as problem:
                    checked.blame(str(problem), number)
                    continue
                if name in columns and (expected := limit_expected(columns[name], value)):
                    checked.blame(f"{name}: {expected}", number)
        if not checked.problems or not checked.path.with_suffix(".json").exists():
            checked.problems.append(str(error))


def _rows_of(
    checked: CheckedFile, columns: Iterable[str], words: str, optional: Collection[str] = ()
) -> Iterable[tuple[int, list[str]]]:
    return csv_rows(
        checked.path,
        list(columns),
        f"a table ({words})",
        torn=lambda error: checked.problems.append(str(error)),
        optional=optional,
    )


def _check_row(checked: CheckedFile, kind: RecordKind, content: Any, number: int) -> None:
    line = f"{checked.path}, line {number}"
    _check_content(checked, kind, content, number, lambda place: line + _key(place))


def _check_content(checked: CheckedFile, kind: RecordKind, content: Any, number: int, where: Locate) -> None:
    """Check the content of a record by making it, and where that fails each of its keys."""
    if isinstance(content, dict):
        refuse_newer_schema(content, where(()))
    try:
        checked.records.append((number, record_from_mapping(kind.record, content, where(()))))
    except InputError as error:
        found = sorted(problems_in(kind.record, content), key=lambda one: [str(key) for key in one[0]])
        checked.problems += [f"{where(place)}: {problem}" for place, problem in found] or [str(error)]


def _check_arrays(checked: CheckedFile, kind: RecordKind) -> None:
    checked.records.append((0, read_loss_curves(checked.path)))

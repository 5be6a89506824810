"""Reading another program's table of trials: CSV, TSV, PsychoPy's CSV, jsPsych's CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from evenlight.data_schema.errors import InputError, shown
from evenlight.data_schema.storage.text_files import parse_json, read_text

EXPECTED = "a table (CSV, TSV) or a list of trials (JSON), in UTF-8"
DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs"}
MISSING = frozenset({"", "n/a", "na", "nan", "none", "null"})  # in small letters; PsychoPy writes None


class Row(NamedTuple):
    """Where a row is: its file, and its line there or its place in a list."""

    path: Path
    number: int

    def beside(self, other: Row) -> str:
        """Return its number, and its file if another row is of another one.

        >>> Row(Path("two.csv"), 7).beside(Row(Path("one.csv"), 3))
        '7 of two.csv'
        """
        return str(self.number) if self.path == other.path else f"{self.number} of {self.path.name}"


@dataclass(frozen=True, slots=True)
class SourceTable:
    """Another program's table.

    Attributes
    ----------
    path : Path
        The file; the first of several that are read as one table.
    file_format : str
        What kind of table it is, in words.
    columns : tuple of str
        In their order.
    rows : tuple of (Row, dict of str to str)
        Where each row is; and its cells by column, empty without a value.
    may_have_decimal_commas : bool
        Whether a comma does not divide its cells, and may stand in its numbers.
    counted : str
        What the numbers of rows count: lines, or trials of a list.
    """

    path: Path
    file_format: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Row, dict[str, str]], ...]
    may_have_decimal_commas: bool = False
    counted: str = "line"

    def place(self, row: Row, column: str = "") -> str:
        """Return where a row, or a cell of it, is."""
        return f"{row.path}, {self.counted} {row.number}{f', column {column!r}' if column else ''}"

    def has(self, name: str) -> bool:
        """Return whether there is a column of a name, or one with which a path (`response.Q0`) begins."""
        return self._column_of(name) is not None

    def cell(self, row: dict[str, str], name: str) -> str:
        """Return the text of a row in a column, or at a path into the JSON of its cell; may be empty."""
        column = self._column_of(name)
        if column is None or column == name:
            return row.get(name, "").strip()
        try:
            value = json.loads(row.get(column, ""))
        except (ValueError, RecursionError):
            return ""
        for key in name.removeprefix(f"{column}.").split("."):
            value = value.get(key) if isinstance(value, dict) else None
        return _cell_text(value).strip()

    def _column_of(self, name: str) -> str | None:
        """Return the column that a name or a path begins with; the longest of them."""
        fitting = (c for c in self.columns if name == c or name.startswith(f"{c}."))
        return max(fitting, key=len, default=None)


def read_sources(paths: Sequence[Path]) -> SourceTable:
    """Return the table of one file or, one below the other, of several, as one for each participant.

    Raises
    ------
    InputError
        If one is no table in UTF-8, is torn, has a column twice, or has no row; if they are of several kinds,
        or one is given twice.
    """
    first, *others = tables = [_read_source(path) for path in paths]
    twice = next((path for path in paths if paths.count(path) > 1), None)
    if twice is not None:
        raise InputError(f"{twice}: is given twice; expected each file once")
    for other in others:
        if other.file_format != first.file_format:
            raise InputError(
                f"{other.path}: {other.file_format}, but {first.path} is "
                f"{first.file_format}; import them apart"
            )
    columns = dict.fromkeys(name for table in tables for name in table.columns)
    return replace(first, columns=tuple(columns), rows=tuple(row for table in tables for row in table.rows))


def _read_source(path: Path) -> SourceTable:
    text = read_text(path, EXPECTED)
    table = _json_table(path, text) if text.lstrip()[:1] in ("[", "{") else _csv_table(path, text)
    if not table.rows:
        raise InputError(f"{path}: has no row; expected one for each trial")
    return table


def _csv_table(path: Path, text: str) -> SourceTable:
    first, _, rest = text.partition("\n")
    skipped = first.strip().startswith("sep=")  # a line of Excel's, which names the delimiter
    if skipped:
        first, text = rest.partition("\n")[0], rest
    reader = csv.reader([first])
    try:
        delimiter = max(DELIMITERS, key=lambda mark: len(next(csv.reader([first], delimiter=mark), [])))
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        header = [name.strip() for name in next(reader, [])]
        twice = next((name for name in header if name and header.count(name) > 1), None)
        if twice is not None or not any(header):
            problem = f"the column {twice!r} is there twice" if twice else "no header"
            raise InputError(f"{path}, line 1: {problem}; expected the names of the columns, each once")
        rows = tuple(_csv_rows(path, reader, header, int(skipped)))
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not readable as a table ({error})") from None
    kind = "TSV" if delimiter == "\t" else f"CSV with {DELIMITERS[delimiter]}"
    named = tuple(name for name in header if name)
    return SourceTable(path, _kind_of(kind, named), named, rows, delimiter != ",")


def _csv_rows(
    path: Path, reader: Any, header: list[str], skipped: int
) -> Iterator[tuple[Row, dict[str, str]]]:
    """Yield the rows of a table, each with its line; PsychoPy ends each line with a delimiter."""
    for cells in reader:
        if not any(cells):
            continue
        line = reader.line_num + skipped
        if len(cells) != len(header):
            raise InputError(f"{path}, line {line}: expected {len(header)} cells, got {len(cells)}")
        yield Row(path, line), {name: cell for name, cell in zip(header, cells, strict=True) if name}


def _json_table(path: Path, text: str) -> SourceTable:
    """Return a list of trials, or several lists, each on its line as servers of experiments collect them."""
    trials: list[Any] = []
    lines = [(n, line) for n, line in enumerate(text.split("\n"), start=1) if line.strip()]
    if len(lines) > 1 and all(_is_json(line) for _, line in lines):
        for number, line in lines:
            content = parse_json(line, f"{path}, line {number}", EXPECTED)
            trials += content if isinstance(content, list) else [content]
    else:
        content = parse_json(text, str(path), EXPECTED)
        if not isinstance(content, list):
            raise InputError(f"{path}: expected a list of trials, got an object")
        trials = content
    for number, one in enumerate(trials, start=1):
        if not isinstance(one, dict):
            raise InputError(f"{path}, trial {number}: expected names and values, got {shown(one)}")
    columns = tuple(dict.fromkeys(str(key) for one in trials for key in one))
    cells = ({key: _cell_text(value) for key, value in one.items()} for one in trials)
    rows = tuple((Row(path, number), own) for number, own in enumerate(cells, start=1))
    return SourceTable(path, _kind_of("JSON", columns), columns, rows, counted="trial")


def _is_json(line: str) -> bool:
    try:
        return isinstance(json.loads(line), dict | list)
    except (ValueError, RecursionError):
        return False


def _cell_text(value: Any) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _kind_of(kind: str, columns: tuple[str, ...]) -> str:
    if any(name.endswith(".thisN") for name in columns):
        return f"PsychoPy's {kind}"
    return f"jsPsych's {kind}" if {"trial_type", "trial_index"} <= set(columns) else kind

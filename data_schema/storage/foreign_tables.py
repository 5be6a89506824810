"""Other programs' tables as texts of cells: CSV, TSV, JSON, and what `binary_tables` reads."""

from __future__ import annotations

import csv
import io
import itertools
import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from evenlight.data_schema.errors import InputError, shown
from evenlight.data_schema.storage.binary_tables import binary_kind, read_binary_table
from evenlight.data_schema.storage.text_files import decoded_text, parse_json, read_bytes

EXPECTED = "a table (CSV, TSV, .xlsx, .ods, .sav, .dta) or a list of trials (JSON)"
DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs"}

FILE_NAME = "the file"  # a column that a pattern makes of its name
_IF_DATA = "; if these are data, name the columns with --names A,B,C"
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")


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
class ForeignTable:
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
    counted : str
        What the numbers of rows count: lines, rows, or trials of a list.
    labels : dict of str to dict of str to str
        What values of a column mean, by column, as statistics programs keep it.
    encodings : tuple of str
        Those of its texts that are not UTF-8.
    title : str
        The file's own, as statistics programs keep it; empty without one.
    other_sheets : str
        Those of the workbook that were not read, and how to read them, in words; empty without any.
    """

    path: Path
    file_format: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Row, dict[str, str]], ...]
    counted: str = "line"
    labels: dict[str, dict[str, str]] = field(default_factory=dict)
    encodings: tuple[str, ...] = ()
    title: str = ""
    other_sheets: str = ""

    @property
    def may_have_decimal_commas(self) -> bool:
        """Whether a comma does not divide its cells, and may stand in its numbers."""
        return not self.file_format.endswith(DELIMITERS[","])

    def place(self, row: Row, column: str = "") -> str:
        """Return where a row, or a cell of it, is."""
        return f"{row.path}, {self.counted} {row.number}{f', column {column!r}' if column else ''}"

    def what_columns(self) -> str:
        """Return which columns there are, and whether their names look like data."""
        below = {name: {cells.get(name) for _, cells in self.rows} for name in self.columns}
        data = any(_NUMBER.fullmatch(name) or name in below[name] for name in self.columns)
        hint = _IF_DATA if data else ""
        return f"its columns are {', '.join(self.columns)}{hint}{self.other_sheets}"

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
        return _json_cell(value).strip()

    def _column_of(self, name: str) -> str | None:
        """Return the column that a name or a path begins with; the longest of them."""
        fitting = (c for c in self.columns if name == c or name.startswith(f"{c}."))
        return max(fitting, key=len, default=None)


def read_foreign_tables(paths: Sequence[Path], settings: Mapping[str, Sequence[str]]) -> ForeignTable:
    """Return the table of one file or, one below the other, of several, as one for each participant.

    What a file is, its content says. Whole numbers of workbooks and statistics programs are texts without a
    point, dates and times as ISO 8601 writes them; what is missing, also by a user's definition, is empty.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    settings : mapping of str to sequence of str
        By what is known of them, of which the last counts: `names` of the columns, where no row has them; an
        `encoding`; a `sheet`, else the first that is not empty; `participant_from`, a pattern whose group
        finds a participant in the names of the files.

    Raises
    ------
    InputError
        If one is no table, damaged or torn, has a column twice, or has no row; if they are of several kinds,
        or one is given twice; if what reads it is not installed.
    """
    first, *others = tables = [_read_table(path, settings) for path in paths]
    twice = next((path for path in paths if paths.count(path) > 1), None)
    if twice is not None:
        raise InputError(f"{twice}: is given twice; expected each file once")
    for other in others:
        if other.file_format != first.file_format:
            raise InputError(
                f"{other.path}: {other.file_format}, but {first.path} is "
                f"{first.file_format}; import them apart"
            )
        if other.labels != first.labels:
            raise InputError(f"{other.path}: its values have other labels than those of {first.path}")
    return replace(
        first,
        columns=tuple(dict.fromkeys(name for table in tables for name in table.columns)),
        rows=tuple(row for table in tables for row in table.rows),
        encodings=tuple(dict.fromkeys(name for table in tables for name in table.encodings)),
    )


def _read_table(path: Path, settings: Mapping[str, Sequence[str]]) -> ForeignTable:
    encoding, sheet, pattern = (settings.get(n, [""])[-1] for n in ("encoding", "sheet", "participant_from"))
    source = _read_sheet(path, encoding, sheet)
    others = f"; other sheets are {', '.join(source.others)} (--sheet)" if source.others else ""
    try:
        table = replace(_named_table(path, source, list(settings.get("names", ()))), other_sheets=others)
    except InputError as error:
        raise InputError(f"{error}{others}") from None
    return _with_participant(table, pattern) if pattern else table


def _read_sheet(path: Path, encoding: str, sheet: str) -> _Sheet:
    content = read_bytes(path, EXPECTED)
    if kind := binary_kind(content):
        return _Sheet(**read_binary_table(path, kind, sheet))
    decoded = decoded_text(content, encoding)
    if decoded is None:
        raise InputError(f"{path}: is not text{f' in {encoding}' * bool(encoding)}; expected {EXPECTED}")
    text, encoding = decoded
    table = (_json_table if text.lstrip()[:1] in ("[", "{") else _csv_table)(path, text)
    return table._replace(encoding=encoding)


def _named_table(path: Path, source: _Sheet, given: list[str]) -> ForeignTable:
    """Return a table whose columns are named by the file, its first row, or an option."""
    rows, counted = [(number, cells) for number, cells in source.rows if any(cells)], source.counted
    where, header, first = f"{path}", given or source.names or [], 0
    titles = 0 if header else sum(1 for _ in itertools.takewhile(_is_title, (cells for _, cells in rows)))
    titles = titles if titles < len(rows) else 0
    if not header:
        first, header = rows[titles] if rows else (1, [])
        rows, where = rows[titles + 1 :], f"{path}, {counted} {first}"
        if rows and all(len(cells) == len(header) + 1 for _, cells in rows):
            header = ["", *header]  # R's names of rows
    header = [name.strip() for name in header]
    twice = next((name for name, times in Counter(header).items() if name and times > 1), None)
    if twice is not None or not any(header):
        problem = f"the column {twice!r} is there twice" if twice else "no header"
        hint = _IF_DATA if twice and _NUMBER.fullmatch(twice) else ""
        raise InputError(f"{where}: {problem}; expected the names of the columns, each once{hint}")
    if not rows:
        raise InputError(f"{path}: has no row; expected one for each trial")
    torn = next(((number, cells) for number, cells in rows if len(cells) != len(header)), None)
    if torn:
        raise InputError(
            f"{path}, {counted} {torn[0]}: expected {len(header)} cells, got {len(torn[1])}"
            + ("; --names has a name for each" if given else "")
        )
    columns = tuple(name for name in header if name)
    named = ({name: cell for name, cell in zip(header, cells, strict=True) if name} for _, cells in rows)
    placed = tuple((Row(path, number), cells) for (number, _), cells in zip(rows, named, strict=True))
    encodings = () if source.encoding == "utf-8" else (source.encoding,)
    kind = f"{'titled ' * bool(titles)}{_kind_of(source.kind, columns)}"
    return ForeignTable(
        path, kind, columns, placed, counted, source.labels or {}, encodings, source.title or ""
    )


def _is_title(cells: list[str]) -> bool:
    """Return whether a row above the columns' names is a title: one cell of it is filled."""
    return sum(map(bool, cells)) == 1


def _with_participant(table: ForeignTable, pattern: str) -> ForeignTable:
    """Add what a pattern finds in the file's name as a column."""
    found = re.search(pattern, table.path.stem)
    if found is None or not found[1]:
        raise InputError(f"{table.path}: --participant-from {pattern} finds nothing in its name")
    rows = tuple((row, cells | {FILE_NAME: found[1]}) for row, cells in table.rows)
    return replace(table, columns=(*table.columns, FILE_NAME), rows=rows)


def _kind_of(kind: str, columns: tuple[str, ...]) -> str:
    if any(name.endswith(".thisN") for name in columns):
        return f"PsychoPy's {kind}"
    return f"jsPsych's {kind}" if {"trial_type", "trial_index"} <= set(columns) else kind


class _Sheet(NamedTuple):
    """What a file holds: kind, number and cells of each row; without names the first row has them."""

    kind: str
    rows: list[tuple[int, list[str]]]
    names: list[str] | None = None
    labels: dict[str, dict[str, str]] | None = None
    title: str | None = None
    counted: str = "row"
    encoding: str = "utf-8"
    others: list[str] | None = None  # sheets


def _csv_table(path: Path, text: str) -> _Sheet:
    first, _, rest = text.partition("\n")
    skipped = first.strip().startswith("sep=")  # a line of Excel's, which names the delimiter
    if skipped:
        first, text = rest.partition("\n")[0], rest
    reader = csv.reader([first])
    try:
        delimiter = _delimiter_of([first, *text.split("\n", 5)[1:5]])
        if delimiter == " ":
            text = "\n".join(line.rstrip() for line in text.split("\n"))  # MATLAB's and R's
        reader = csv.reader(
            io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=delimiter == " "
        )
        rows = [(reader.line_num + skipped, cells) for cells in reader]
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not readable as a table ({error})") from None
    kind = {" ": "text with blanks", "\t": "TSV"}.get(delimiter, f"CSV with {DELIMITERS.get(delimiter)}")
    return _Sheet(kind, rows, counted="line")


def _delimiter_of(lines: list[str]) -> str:
    """Return what divides the cells of a text, by its first lines: titles, if any, then names and a row."""

    def cells(line: str, mark: str) -> int:
        reader = csv.reader([line.strip()], delimiter=mark, skipinitialspace=mark == " ")
        return len(next(reader, []))

    filled = [line for line in lines if line.strip()] or [""]
    for names, row in itertools.pairwise(filled):
        counts = {mark: cells(names, mark) for mark in (*DELIMITERS, " ")}
        alike = {m: n for m, n in counts.items() if n > 1 and cells(row, m) - n in (0, 1)}
        marked = {mark: n for mark, n in alike.items() if mark != " "}
        if alike:
            return max(marked or alike, key=lambda mark: counts[mark])
    return max(DELIMITERS, key=lambda mark: cells(filled[0], mark))


def _json_table(path: Path, text: str) -> _Sheet:
    """Return a list of trials, or several lists, each on its line as servers of experiments collect them."""
    trials: list[Any] = []
    lines = [(n, line) for n, line in enumerate(text.split("\n"), start=1) if line.strip()]
    if len(lines) > 1 and all(_is_json(line) for _, line in lines):
        for number, line in lines:
            content = parse_json(line, f"{path}, line {number}", EXPECTED)
            several = isinstance(content, list) and all(isinstance(one, dict) for one in content)
            trials += content if several else [content]
    else:
        trials = _trials_in(path, parse_json(text, str(path), EXPECTED))
    kinds = {type(one) for one in trials}
    if kinds == {list}:
        arrays = [(n, list(map(_json_cell, one))) for n, one in enumerate(trials, start=1)]
        return _Sheet("JSON", arrays, counted="trial")
    for number, one in enumerate(trials, start=1):
        if not isinstance(one, dict):
            raise InputError(f"{path}, trial {number}: expected names and values, got {shown(one)}")
    names = list(dict.fromkeys(key for one in trials for key in one))
    rows = [(n, [_json_cell(one.get(name)) for name in names]) for n, one in enumerate(trials, start=1)]
    return _Sheet("JSON", rows, names, counted="trial")


def _trials_in(path: Path, content: Any) -> list[Any]:
    """Return the trials of a list, of an object that holds one, or of columns, as pandas and MATLAB write."""
    if isinstance(content, list):
        return content
    if isinstance(content.get("columns"), list) and isinstance(content.get("data"), list):
        return [content["columns"], *content["data"]]
    columns = {name: list(v.values()) if isinstance(v, dict) else v for name, v in content.items()}
    lists = {name: values for name, values in columns.items() if isinstance(values, list)}
    if len(lists) == 1:
        of_all = {name: value for name, value in content.items() if not isinstance(value, list | dict)}
        return [of_all | one if isinstance(one, dict) else one for one in next(iter(lists.values()))]
    if lists != columns or len({len(values) for values in lists.values()}) != 1:
        raise InputError(f"{path}: expected a list of trials, or columns of equal length, got an object")
    return [dict(zip(lists, values, strict=True)) for values in zip(*lists.values(), strict=True)]


def _is_json(line: str) -> bool:
    try:
        return isinstance(json.loads(line), dict | list)
    except (ValueError, RecursionError):
        return False


def _json_cell(value: Any) -> str:
    """Return what a value of JSON is as the text of a cell; lists and objects stay JSON."""
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)

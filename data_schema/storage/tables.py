"""CSV tables: rows of cells, and tables of records."""

from __future__ import annotations

import csv
import dataclasses
import io
import re
import types
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from evenlight.data_schema.errors import InputError, shown
from evenlight.data_schema.mapping import (
    keys_of,
    mapping_from_record,
    record_from_mapping,
    type_hints,
    unknown_key,
    words_of,
)
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.storage.text_files import read_text
from evenlight.data_schema.storage.whole_files import write_whole

Record = TypeVar("Record")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_COMMA_NUMBER, _POINT_NUMBER = re.compile(r"-?(\d+|\d{1,3}(\.\d{3})+),\d+"), re.compile(r"-?\d*\.\d+")
_WHOLE_NUMBER = re.compile("[+-]?[0-9]{1,19}")
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9]+(?:[eE][+-]?[0-9]+)?(?:[;\r\n]|$))")  # at the end of a cell
_FORMULA = re.compile(r"'*[=+@\-\t\r]")  # where a cell begins so, spreadsheets compute it
MISSING = ("", "n/a")  # how a table says that there is no value: CSV, BIDS


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV: numbers in full precision, an empty cell for None.

    Words that a spreadsheet would compute begin with an apostrophe, which `csv_rows` takes off.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([safe_cell(cell) for cell in row] for row in rows)
    return stream.getvalue()


def safe_cell(value: Any) -> Any:
    """Return what stands in a cell: words that a spreadsheet would compute after an apostrophe.

    >>> safe_cell("=1+1"), safe_cell("-0.5"), safe_cell(None)
    ("'=1+1", '-0.5', '')
    """
    computed = isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value)
    return f"'{value}" if computed else "" if value is None else value


def cell_words(cell: str) -> str:
    """Return what a cell says, without the apostrophe of words that a spreadsheet would compute."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def _raise(error: InputError) -> None:
    raise error


def csv_rows(
    path: Path,
    columns: Sequence[str],
    what: str,
    delimiter: str = ",",
    torn: Callable[[InputError], None] = _raise,
    optional: Collection[str] = (),
) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a table with their line numbers; the cells are in the order of `columns`.

    Parameters
    ----------
    path : Path
        The file; its columns may be in any order.
    columns : sequence of str
        The columns that it must have, and no other.
    what : str
        What it should be, for the error.
    delimiter : str, optional
        What divides the cells. Where semicolons do, as spreadsheets write a table where decimals come after
        commas, they are taken in place of commas, and such decimals too.
    torn : callable, optional
        What to do about a row that has not as many cells as the header; else it is raised.
    optional : collection of str, optional
        Columns that may be missing, as in files of older versions; their cells are empty then.

    Raises
    ------
    InputError
        If it is no table of these columns, or a row has not as many cells as the header.
    """
    text = read_text(path, what)
    first = text.partition("\n")[0]
    if delimiter == "," and ";" in first and "," not in first:
        delimiter, text = ";", _DECIMAL_COMMA.sub(".", text)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        header = next(reader, [])
        order = _column_places(header, columns, f"{path}: ", what, optional)
        for cells in reader:
            if not cells:
                continue  # an empty line, as some editors leave at the end
            where = f"{path}, line {reader.line_num}"
            if len(cells) != len(header):
                got = f"expected {len(header)} cells, got {len(cells)}; the table is torn"
                torn(InputError(f"{where}: {got}"))
                continue
            yield reader.line_num, ["" if place is None else cell_words(cells[place]) for place in order]
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not readable as a table ({error})") from None


def _column_places(
    header: list[str], columns: Sequence[str], where: str, what: str, optional: Collection[str]
) -> list[int | None]:
    if not header:
        raise InputError(f"{where}is empty; expected {what} with the columns {','.join(columns)}")
    for name in header:
        if name not in columns:
            problem = unknown_key(name, columns).replace("key", "column", 1)
            raise InputError(f"{where}{problem}")
        if header.count(name) > 1:
            raise InputError(f"{where}the column {shown(name)} is there twice")
    for name in columns:
        if name not in header and name not in optional:
            raise InputError(f"{where}the column {name!r} of {what} is missing")
    return [header.index(name) if name in header else None for name in columns]


def write_rows(path: Path, cls: type[Any], records: Iterable[Any]) -> None:
    """Write records of one class as a CSV table, one row each."""
    write_whole(path, csv_text(columns_of(cls), (list(mapping_from_record(r).values()) for r in records)))


def columns_of(cls: type[Any]) -> list[str]:
    """Return the columns of a table of records: their file keys."""
    return [file_key(field) for field in dataclasses.fields(cls)]


def read_rows(cls: type[Record], path: Path) -> list[Record]:
    """Return the records of a CSV table whose columns are the record's keys, in any order.

    Columns with a default may be missing, and their cells empty.
    """
    return [record for _, record in numbered_rows(cls, path)]


def numbered_rows(cls: type[Record], path: Path) -> list[tuple[int, Record]]:
    """Return the records of a CSV table as `read_rows` does, each with its line."""
    what, optional = f"a {words_of(cls)} table", optional_columns(cls)
    rows = csv_rows(path, columns_of(cls), what, optional=optional)
    return [
        (line, record_from_mapping(cls, plain_cells(cls, cells), f"{path}, line {line}"))
        for line, cells in rows
    ]


def optional_columns(cls: type[Any]) -> frozenset[str]:
    """Return the columns of a table of records that have a default."""
    known, required = keys_of(cls)
    return frozenset(known) - frozenset(required)


def plain_cells(cls: type[Any], cells: Sequence[str]) -> dict[str, Any]:
    """Return the cells of a row, in the order of a record's fields, as the plain values they stand for.

    An empty cell of a column with a default stands for that.
    """
    kinds, optional = type_hints(cls), optional_columns(cls)
    return {
        file_key(field): plain_cell(kinds[field.name], text)
        for field, text in zip(dataclasses.fields(cls), cells, strict=True)
        if text or file_key(field) not in optional
    }


def have_decimal_commas(texts: Collection[str]) -> bool:
    """Return whether the numbers among texts have decimals after commas, and none after a point.

    >>> have_decimal_commas(["0,5", "1.074,1"]), have_decimal_commas(["0,5", "0.5"])
    (True, False)
    """
    commas = [_COMMA_NUMBER.fullmatch(text) for text in texts]
    return any(commas) and not any(_POINT_NUMBER.fullmatch(text) for text in texts)


def number_in(text: str, where: str, decimal_commas: bool = False) -> float:
    """Return the number in a cell of a table: in digits, without "nan", "1_0" or others that Python takes.

    Where decimals come after commas, thousands may come after points.

    >>> number_in("1.074,1", "here", decimal_commas=True)
    1074.1
    """
    plain = text
    if decimal_commas:
        plain = (text.replace(".", "") if _COMMA_NUMBER.fullmatch(text) else text).replace(",", ".")
    if _NUMBER.fullmatch(plain.strip(" ")):
        return float(plain)
    raise InputError(f"{where}: expected a number, got {shown(text)}")


def as_number(text: str) -> str:
    """Return a text or, of a number, the one text that all its spellings have: numbers compare as numbers.

    >>> [as_number(text) for text in ("1.0", "1,00", "01", "1e1", "ours", "nan")]
    ['1', '1', '1', '10', 'ours', 'nan']
    """
    plain = text.replace(",", ".")
    number = len(plain) < 16 and _NUMBER.fullmatch(plain)  # longer ones are ids, and a float would merge them
    return f"{float(plain):.15g}" if number else text


def plain_cell(kind: Any, text: str) -> Any:
    """Return a cell as the plain value of its column's type; if it is none, its text: a record refuses that.

    >>> plain_cell(int, "12"), plain_cell(int, "1_2"), plain_cell(float | None, "n/a")
    (12, '1_2', None)
    """
    if isinstance(kind, types.UnionType):
        if text in MISSING:
            return None
        kind = next(k for k in typing.get_args(kind) if k is not type(None))
    number = text.strip(" ") if kind in (int, float) else ""
    if kind is float and _NUMBER.fullmatch(number):
        return float(number)
    if kind is int and _WHOLE_NUMBER.fullmatch(number):
        return int(number)
    truths = {"True": True, "False": False, "true": True, "false": False}
    return truths.get(text, text) if kind is bool else text

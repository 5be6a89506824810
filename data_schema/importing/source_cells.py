"""Which of another program's columns is taken for which of ours, and what its cells mean."""

from __future__ import annotations

import dataclasses
import enum
import math
import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError, shown, told_of_file
from evenlight.data_schema.importing.import_mapping import UNITS, ImportMapping, fields_by_name
from evenlight.data_schema.importing.source_tables import MISSING, Row, SourceTable
from evenlight.data_schema.mapping import type_hints
from evenlight.data_schema.quantities import check_value, file_key
from evenlight.data_schema.storage.tables import number_in

# Names that other programs give to columns of ours, in small letters; units are never guessed.
ALSO_CALLED = {
    "participant_id": ("participant", "participant id", "participant_id", "subject", "subject_id"),
    "session_id": ("session", "session id", "session_id"),
    "found": ("correct", "accuracy"),
}
TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
_COMMA_NUMBER, _POINT_NUMBER = re.compile(r"-?\d+,\d+"), re.compile(r"-?\d*\.\d+")
Cells = dict[str, tuple[str, str]]  # text of a cell and the column it stands in, by our attribute


def taken_columns(table: SourceTable, mapping: ImportMapping) -> ImportMapping:
    """Return a mapping with all columns that are taken: those that were named, and those whose names tell.

    Raises
    ------
    InputError
        If a column that was named is not there, two could be meant, or one has no unit where it needs one.
    """
    known = fields_by_name(mapping.record)
    columns = {ours: theirs for ours, theirs in mapping.columns.items() if theirs}
    for ours in {**columns, **mapping.constants}:
        if (ours in columns) + (ours in mapping.constants) + (ours in mapping.wide) > 1:
            raise InputError(f"{ours} is given twice; expected one of --column, --constant and --wide")
    for theirs in (*columns.values(), *mapping.only):
        if not table.has(theirs):
            raise InputError(
                f"{table.path}: no column {theirs!r}; its columns are {', '.join(table.columns)}"
            )
    settled = {*mapping.columns, *mapping.constants, *mapping.wide}
    for own in {each.name: each for each in known.values()}.values():
        if own.name not in settled:
            found = _own_column(table, own, own.name in mapping.units)
            columns |= {own.name: found} if found else {}
    for name in (*columns, *mapping.wide):
        theirs, own = columns.get(name, ""), known[name]
        unit = own.metadata.get("unit", "1")
        if unit != "1" and name not in mapping.units and theirs.lower() != file_key(own):
            raise InputError(
                f"{table.path}: the unit of {theirs or mapping.wide[name]!r} ({name}) is not known; give it "
                f"with --unit {name}=UNIT, one of {', '.join(UNITS[unit])}"
            )
    return dataclasses.replace(mapping, columns=columns)


def _own_column(table: SourceTable, own: dataclasses.Field[Any], unit_given: bool) -> str | None:
    """Return the column whose name is ours but for capitals; None if there is none, or it needs a unit."""
    names = {file_key(own), *ALSO_CALLED.get(own.name, ())}
    if own.metadata.get("unit", "1") == "1" or unit_given:
        names.add(own.name)
    found = [name for name in table.columns if name.lower() in names]
    if len(found) > 1:
        raise InputError(
            f"{table.path}: {' and '.join(map(repr, found))} may both be {own.name}; "
            f"say which with --column {own.name}=THEIRS"
        )
    return found[0] if found else None


def rows_of_cells(table: SourceTable, taken: ImportMapping) -> Iterator[tuple[Row, Cells]]:
    """Yield line and cells of each trial; a row of a wide table holds several."""
    constants = {ours: (text, f"--constant {ours}") for ours, text in taken.constants.items()}
    places = _wide_places(table, taken)
    for line, row in table.rows:
        cells = {ours: (table.cell(row, theirs), theirs) for ours, theirs in taken.columns.items()}
        for told, columns in places:
            own = {ours: (row.get(column, "").strip(), column) for ours, column in columns.items()}
            yield line, constants | cells | told | own


def _wide_places(table: SourceTable, taken: ImportMapping) -> list[tuple[Cells, dict[str, str]]]:
    """Return what the names of columns tell of each trial of a row, and its columns; one if not wide."""
    if not taken.wide:
        return [({}, {})]
    places: dict[tuple[str, ...], tuple[Cells, dict[str, str]]] = {}
    for ours, pattern in taken.wide.items():
        expression, names = _expression(pattern, taken)
        found = [(column, re.fullmatch(expression, column)) for column in table.columns]
        if not any(match for _, match in found):
            raise InputError(
                f"{table.path}: no column is like --wide {ours}={pattern}; its columns are "
                f"{', '.join(table.columns)}"
            )
        _refuse_unknown_versions(table, taken, ours, [match for _, match in found if match])
        for column, match in found:
            if match:
                told = {name: (match[name], column) for name in names}
                key = tuple(match[name] for name in sorted(names))
                places.setdefault(key, (told, {}))[1][ours] = column
    return list(places.values())


def _refuse_unknown_versions(
    table: SourceTable, taken: ImportMapping, ours: str, matches: list[re.Match[str]]
) -> None:
    pattern, kinds = taken.wide[ours], type_hints(taken.record)
    choices = [name for name in matches[0].groupdict() if issubclass(plain_kind(kinds[name]), enum.Enum)]
    shape = re.escape(pattern).replace(r"\{", "{").replace(r"\}", "}")
    loose = re.sub(r"\{(\w+)\}", lambda part: f"(?P<{fields_by_name(taken.record)[part[1]].name}>.+)", shape)
    whole = {match[0] for match in matches}
    rest = {
        tuple(text for name, text in match.groupdict().items() if name not in choices) for match in matches
    }
    for column in table.columns:
        match = re.fullmatch(loose, column)
        if not choices or match is None or column in {*whole, *taken.columns.values(), *taken.only}:
            continue
        if tuple(text for name, text in match.groupdict().items() if name not in choices) in rest:
            name, text = choices[0], match[choices[0]]
            members = list(typing.cast("type[enum.Enum]", plain_kind(kinds[name])))
            known = taken.values.get(name, {}).values()
            value = next((one.value for one in reversed(members) if one.value not in known), members[0].value)
            raise InputError(
                f"{table.path}: the column {column!r} is like --wide {ours}={pattern}, but what {text!r} "
                f"means is not known; say it, as with --value {name}:{value}={text}"
            )


def _expression(pattern: str, taken: ImportMapping) -> tuple[str, list[str]]:
    fields, kinds = fields_by_name(taken.record), type_hints(taken.record)
    expression, names = "", []
    for number, part in enumerate(re.split(r"\{(\w+)\}", pattern)):
        if number % 2 == 0:
            expression += re.escape(part)
            continue
        if part not in fields or fields[part].name in names:
            raise InputError(f"--wide {pattern}: expected columns of ours in braces, each once, got {part!r}")
        name = fields[part].name
        names.append(name)
        kind = plain_kind(kinds[name])
        choices = [re.escape(text) for text in taken.values.get(name, ())]
        choices += [f"(?i:{member.value})" for member in kind] if issubclass(kind, enum.Enum) else []
        inside = "|".join(choices) or (r"\d+" if kind is int else ".+")
        expression += f"(?P<{name}>{inside})"
    return expression, names


def plain_kind(kind: Any) -> type[Any]:
    """Return the type of a value that may also be unknown.

    >>> plain_kind(int | None)
    <class 'int'>
    """
    if isinstance(kind, types.UnionType):
        kind = next(part for part in typing.get_args(kind) if part is not types.NoneType)
    return typing.cast("type[Any]", kind)


class CellReader:
    """Reads cells as plain values of our columns, in our units.

    Parameters
    ----------
    table : SourceTable
        The file.
    taken : ImportMapping
        What its columns, units and values mean.
    rows : list of (Row, Cells)
        All of them: the numbers of each file tell whether its decimals come after commas.
    """

    def __init__(self, table: SourceTable, taken: ImportMapping, rows: list[tuple[Row, Cells]]) -> None:
        self._table, self._mapping = table, taken
        self._fields = {each.name: each for each in dataclasses.fields(taken.record)}
        self._kinds = {name: plain_kind(kind) for name, kind in type_hints(taken.record).items()}
        numeric = [name for name in taken.given if self._kinds[name] in (int, float)]
        numbers: dict[Path, set[str]] = {}
        for row, cells in rows:
            numbers.setdefault(row.path, set()).update(cells[name][0] for name in numeric if name in cells)
        self.decimal_commas = {
            path
            for path, texts in numbers.items()
            if table.may_have_decimal_commas
            and any(_COMMA_NUMBER.fullmatch(text) for text in texts)
            and not any(_POINT_NUMBER.fullmatch(text) for text in texts)
        }

    def value(self, name: str, cells: Cells, line: Row) -> Any:
        """Return what a cell stands for, as JSON would hold it; None if it is empty or not there.

        Raises
        ------
        InputError
            If it cannot be that, naming file, line, column and value.
        """
        text, column = cells.get(name, ("", ""))
        given = self._mapping.values.get(name, {})
        text = given.get(text, text)
        if text.lower() in MISSING:
            return None
        where = self._table.place(line, column)
        kind, own = self._kinds[name], self._fields[name]
        if issubclass(kind, enum.Enum):
            return _choice(kind, text, where, name)
        if kind is bool:
            if text.lower() not in TRUTHS:
                raise InputError(
                    f"{where}: expected true or false, got {text!r}; {_value_hint(name, 'true')}"
                )
            return TRUTHS[text.lower()]
        if line.path in self.decimal_commas:
            text = text.replace(",", ".") if kind in (int, float) else text
        value: Any = text if kind is str else self._number(name, kind, text, where)
        try:
            if not own.metadata.get("pattern"):  # names are made fit later
                check_value(own, value)
        except ValueError as error:
            raise InputError(f"{where}: {told_of_file(error)}") from None
        return value

    def values(self, cells: Cells, line: Row) -> dict[str, Any]:
        """Return what all cells of a row stand for; without those that are empty and have a default."""
        values = {name: self.value(name, cells, line) for name in self._fields if name != "simulated"}
        required = {name for name, each in self._fields.items() if each.default is dataclasses.MISSING}
        return {name: value for name, value in values.items() if value is not None or name in required}

    def _number(self, name: str, kind: type[Any], text: str, where: str) -> float:
        number = number_in(text, where)
        unit = self._fields[name].metadata.get("unit", "1")
        number *= UNITS[unit][self._mapping.units[name]] if name in self._mapping.units else 1.0
        if kind is not int:
            return number
        if not math.isfinite(number) or abs(number - round(number)) > 1e-6:
            raise InputError(f"{where}: expected a whole number, got {shown(text)}")
        return round(number)


def _choice(kind: type[enum.Enum], text: str, where: str, name: str) -> str:
    known = [str(member.value) for member in kind if member.value]
    found = next((value for value in known if value == text.lower()), None)
    if found is None:
        wanted = ", ".join(map(repr, known))
        raise InputError(f"{where}: expected one of {wanted}, got {text!r}; {_value_hint(name, known[0])}")
    return found


def _value_hint(name: str, value: str) -> str:
    return f"say what stands for them, as with --value {name}:{value}=THEIRS"

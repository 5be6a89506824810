"""Which of another program's columns is taken for which of ours, and what its cells mean."""

from __future__ import annotations

import dataclasses
import enum
import math
import re
import types
import typing
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError, shown, told_of_file
from evenlight.data_schema.importing.import_request import BESIDE, COUNTS, UNITS, BesideTrials, ImportRequest
from evenlight.data_schema.mapping import type_hints
from evenlight.data_schema.quantities import check_value, file_key
from evenlight.data_schema.storage.foreign_tables import FILE_NAME, ForeignTable, Row
from evenlight.data_schema.storage.tables import as_number, have_decimal_commas, number_in

# Names that other programs give to columns of ours, in small letters; units are never guessed.
ALSO_CALLED = {
    "participant_id": ("participant", "participant id", "participant_id", "subject", "subject_id"),
    "session_id": ("session", "session id", "session_id"),
    "found": ("correct", "accuracy"),
    "correct": ("accuracy",),
    "n_yes": ("k",),
    "n_ours": ("k",),
    "n_trials": ("n",),
    "initial_luminance": ("luminance_cd_m2",),  # in our tables
}
MISSING = frozenset({"", "n/a", "na", "nan", "none", "null"})  # in small letters; PsychoPy writes None
TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
Cells = dict[str, tuple[str, str]]  # text of a cell and the column it stands in, by our attribute


def taken_columns(table: ForeignTable, asked: ImportRequest) -> ImportRequest:
    """Return a request with all columns that are taken: those that were named, and those whose names tell.

    Raises
    ------
    InputError
        If a column that was named is not there, two could be meant, or one has no unit where it needs one.
    """
    columns = {ours: theirs for ours, theirs in asked.columns.items() if theirs}
    if table.has(FILE_NAME):
        columns.setdefault("participant_id", FILE_NAME)
    for ours in {**columns, **asked.constants}:
        if (ours in columns) + (ours in asked.constants) + (ours in asked.wide) > 1:
            raise InputError(f"{ours} is given twice; expected one of --column, --constant and --wide")
    for theirs in (*columns.values(), *asked.only):
        if not table.has(theirs):
            raise InputError(f"{table.path}: no column {theirs!r}; {table.what_columns()}")
    settled = {*asked.columns, *asked.constants, *asked.wide, *columns}
    number, answer, *_ = COUNTS.get(asked.task, ("", ""))
    # Fields beside a record come last: where there is an answer, k and n are other things.
    for own in asked.fields.values():
        beside = own.name in BESIDE.get(asked.task, ())
        if own.name not in settled and not (beside and answer in {*columns, *settled}):
            found = _own_column(table, own, own.name in asked.units)
            columns |= {own.name: found} if found else {}
    told = {*columns, *asked.constants, *asked.wide}
    guessed = {"n_trials"} if number not in told else set()
    guessed |= {"correct"} if "ramp_interval" not in told else set()
    columns = {ours: theirs for ours, theirs in columns.items() if ours in settled or ours not in guessed}
    if columns.get("n_yes", "").lower() == "k" and "n_yes" not in settled:
        raise InputError(
            f"{table.path}: are the answers in {columns['n_yes']!r} yes (--column n_yes=k), or right ones of "
            "two intervals (then give a row for each trial: counts do not tell the intervals)?"
        )
    for name in (*columns, *asked.wide):
        theirs, own = columns.get(name, ""), asked.fields[name]
        has_unit = own.metadata.get("unit", "1") == "1" or name in asked.units
        if not has_unit and theirs.lower() not in (file_key(own), *ALSO_CALLED.get(name, ())):
            raise _unknown_unit(table, theirs or asked.wide[name], own)
    return dataclasses.replace(asked, columns=columns)


def _unknown_unit(table: ForeignTable, column: str, own: dataclasses.Field[Any]) -> InputError:
    return InputError(
        f"{table.path}: the unit of {column!r} ({own.name}) is not known; give it with --unit "
        f"{own.name}=UNIT, one of {', '.join(UNITS[own.metadata.get('unit', '1')])}"
    )


def _own_column(table: ForeignTable, own: dataclasses.Field[Any], unit_given: bool) -> str | None:
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


def rows_of_cells(table: ForeignTable, taken: ImportRequest) -> Iterator[tuple[Row, Cells]]:
    """Yield line and cells of each trial; a row of a wide table holds several."""
    constants = {ours: (text, f"--constant {ours}") for ours, text in taken.constants.items()}
    places = _wide_places(table, taken)
    for line, row in table.rows:
        cells = {ours: (table.cell(row, theirs), theirs) for ours, theirs in taken.columns.items()}
        for told, columns in places:
            own = {ours: (row.get(column, "").strip(), column) for ours, column in columns.items()}
            yield line, constants | cells | told | own


def _wide_places(table: ForeignTable, taken: ImportRequest) -> list[tuple[Cells, dict[str, str]]]:
    """Return what the names of columns tell of each trial of a row, and its columns; one if not wide."""
    places: dict[tuple[str, ...], tuple[Cells, dict[str, str]]] = {}
    for ours, pattern in taken.wide.items():
        expression, names = _expression(pattern, taken)
        found = {column: match for column in table.columns if (match := re.fullmatch(expression, column))}
        if not found:
            raise InputError(
                f"{table.path}: no column is like --wide {ours}={pattern}; {table.what_columns()}"
            )
        _refuse_unknown_versions(table, taken, ours, found)
        for column, match in found.items():
            key = tuple(match[name] for name in sorted(names))
            places.setdefault(key, ({name: (match[name], column) for name in names}, {}))[1][ours] = column
    return list(places.values()) or [({}, {})]


def _refuse_unknown_versions(
    table: ForeignTable, taken: ImportRequest, ours: str, found: dict[str, re.Match[str]]
) -> None:
    """Refuse a column that a pattern would take too if only its version, or other choice, were known."""
    loose, names = _expression(taken.wide[ours], taken, known=False)
    kinds = _kinds(taken)
    choices = [name for name in names if _words(kinds[name])]
    others = [name for name in names if name not in choices]
    known = {tuple(match[name] for name in others) for match in found.values()}
    for column in table.columns if choices else ():
        match = re.fullmatch(loose, column)
        if match is None or column in {*found, *taken.columns.values(), *taken.only}:
            continue
        if tuple(match[name] for name in others) in known:
            name, text = choices[0], match[choices[0]]
            if text in taken.settings.get("missing", ()):
                continue
            said = {*taken.values.get(name, {}).values(), *(each[name].lower() for each in found.values())}
            value = next((one for one in reversed(_words(kinds[name])) if one not in said), "")
            way = f"say it, as with --value {name}:{value}={text}, or " if value else ""
            raise InputError(
                f"{table.path}: the column {column!r} is like --wide {ours}={taken.wide[ours]}, but what "
                f"{text!r} means is not known; {way}leave it out with --missing {text}"
            )


def _expression(pattern: str, taken: ImportRequest, known: bool = True) -> tuple[str, list[str]]:
    """Return what columns of a pattern match, and ours in it; with choices by their known words, or any."""
    expression, names, kinds = "", list[str](), _kinds(taken)
    for number, part in enumerate(re.split(r"\{(\w+)\}", pattern)):
        if number % 2 == 0:
            expression += re.escape(part)
            continue
        if part not in taken.fields or taken.fields[part].name in names:
            raise InputError(f"--wide {pattern}: expected columns of ours in braces, each once, got {part!r}")
        name = taken.fields[part].name
        names.append(name)
        words = [f"(?i:{word})" for word in _words(kinds[name])]
        choices = [*map(re.escape, taken.values.get(name, ())), *words] if known else []
        inside = "|".join(choices) or (r"\d+" if kinds[name] is int else ".+")
        expression += f"(?P<{name}>{inside})"
    return expression, names


def missing_column(table: ForeignTable, taken: ImportRequest, names: tuple[str, ...]) -> InputError:
    """Return the error of a table that has none of some of our columns, with what may be meant."""
    column = next((column for column in table.columns if column.lower() in names), None)
    if column is not None:
        return _unknown_unit(table, column, taken.fields[column.lower()])
    counts = (
        f", or {COUNTS[taken.task][0]} and n_trials" if "response" in names and taken.task in COUNTS else ""
    )
    return InputError(
        f"{table.path}: no column {' or '.join(names)}{counts}; name the one that it is with --column "
        f"{names[0]}=THEIRS, or give --constant {names[0]}=VALUE{_wide_hint(table, taken)}; "
        f"{table.what_columns()}"
    )


def _wide_hint(table: ForeignTable, taken: ImportRequest) -> str:
    """Return which option takes a table with a column for each answer; empty if it does not look like one."""
    answer = {"rating": "rating", "search": "search_time"}.get(taken.task)
    known = {*taken.fields, *map(str.lower, taken.columns.values())}
    others = [name for name in table.columns if answer and name.lower() not in known]
    parts = [found for name in others if (found := re.fullmatch("(.+)[_. -](.+)", name))]
    for place, pattern in ((2, "{sequence}_{version}"), (1, "{version}_{sequence}")):
        stems: dict[str, set[str]] = {}
        for part in parts:
            stems.setdefault(part[3 - place], set()).add(part[place])
        pairs = Counter(tuple(sorted(each)) for each in stems.values() if len(each) == 2)
        for versions, times in pairs.most_common(1):
            if times > 1:
                return (
                    f"; if each answer has a column, as of {' and '.join(versions)}, give --wide "
                    f"{answer}={pattern}, and --value version:ours=THEIRS"
                )
    return ""


def _kinds(taken: ImportRequest) -> dict[str, type[Any]]:
    """Return the type of each of our columns, where its value is known."""
    known = type_hints(BesideTrials) | type_hints(taken.record)
    parts = {name: typing.get_args(known.get(name)) or (known.get(name, int),) for name in taken.fields}
    return {name: next(kind for kind in each if kind is not types.NoneType) for name, each in parts.items()}


def _words(kind: type[Any]) -> list[str]:
    """Return the values among which a choice is; none where it is no choice."""
    return [str(member.value) for member in kind if member.value] if issubclass(kind, enum.Enum) else []


class CellReader:
    """Reads cells as plain values of our columns, in our units.

    All rows are handed in: the numbers of each file tell whether its decimals come after commas.
    """

    def __init__(self, table: ForeignTable, taken: ImportRequest, rows: list[tuple[Row, Cells]]) -> None:
        self._table, self._taken, self._fields, self._kinds = table, taken, taken.fields, _kinds(taken)
        self._given, self._units = taken.given, taken.units
        missing = taken.settings.get("missing", [])
        self.blanked = set[tuple[str, Row]]()  # cells that have a text that stands for no value
        self._missing = MISSING | {as_number(text).lower() for text in missing}
        numeric = [name for name in taken.given if self._kinds[name] in (int, float)]
        numbers: dict[Path, set[str]] = {}
        for row, cells in rows:
            numbers.setdefault(row.path, set()).update(cells[name][0] for name in numeric if name in cells)
        self.decimal_commas = {
            path
            for path, texts in numbers.items()
            if table.may_have_decimal_commas and have_decimal_commas(texts)
        }

    def value(self, name: str, cells: Cells, line: Row) -> Any:
        """Return what a cell stands for, as JSON would hold it; None if it is empty or not there.

        Of a value that has a label, choices and names are what the label says, and numbers the value.

        Raises
        ------
        InputError
            If it cannot be that, naming file, line, column and value.
        """
        text, column = cells.get(name, ("", ""))
        kind, own, given = self._kinds[name], self._fields[name], self._taken.values.get(name, {})
        if as_number(text).lower() in self._missing:
            self.blanked |= {(name, line)} if text.lower() not in MISSING else set()
            return None
        label = text if kind in (int, float) else self._table.labels.get(column, {}).get(text, text)
        numbers = {as_number(theirs): meant for theirs, meant in given.items()}
        text = given.get(text, given.get(label, numbers.get(as_number(text), label)))
        where = self._table.place(line, column)
        if text.lower() in MISSING:
            return None
        if known := [*TRUTHS] if kind is bool else _words(kind):
            if (word := as_number(text).lower()) not in known:
                two = name == "response" and (self._taken.task != "ramp" or "ramp_interval" in self._given)
                known = known[2:] if two else known  # yes and no are of one interval
                wanted = "true or false" if kind is bool else f"one of {', '.join(map(repr, known))}"
                raise InputError(
                    f"{where}: expected {wanted}, got {text!r}; say what stands for them, as with --value "
                    f"{name}:{known[0]}=THEIRS"
                )
            return TRUTHS[word] if kind is bool else word
        value = text if kind is str else self._number(name, text, line, where)
        try:
            if name == "rate" and "direction" not in self._given:
                check_value(own, abs(float(value)))  # the sign is the direction
            elif not own.metadata.get("pattern"):  # names are made fit later
                check_value(own, value)
        except ValueError as error:
            raise InputError(f"{where}: {told_of_file(error)}") from None
        return value

    def values(self, cells: Cells, line: Row, unknown: Collection[str]) -> dict[str, Any]:
        """Return what a row's cells stand for, without those that are empty and have a default.

        Of columns without a default that are taken, only the `unknown` may be empty.
        """
        values = {}
        for each in dataclasses.fields(self._taken.record):
            name, required = each.name, each.default is dataclasses.MISSING
            value = None if name == "simulated" else self.value(name, cells, line)
            if value is None and required and name in self._given and name not in unknown:
                where = self._table.place(line, self._taken.columns.get(name, name))
                raise InputError(f"{where}: no {name}; expected one in each row with an answer")
            if value is not None or (required and name != "simulated"):
                values[name] = value
        return values

    def answers(self, cells: Cells, line: Row) -> list[Cells]:
        """Return the cells of each trial that a row stands for: its own, or by its counts of answers."""
        right = self.value("correct", cells, line) if self._taken.judged else None
        if right is not None:
            first = right == (self.value("ramp_interval", cells, line) == 1)
            return [cells | {"response": ("first" if first else "second", cells["correct"][1])}]
        if not self._taken.counted:
            return [cells]
        name, answer, word, other = COUNTS[self._taken.task]
        column = cells[name][1]
        number, total = (self.value(each, cells, line) for each in (name, "n_trials"))
        if number is None or total is None or number > total:
            where = self._table.place(line, column)
            raise InputError(f"{where}: expected {name} of n_trials, got {number} of {total}")
        trials = (word,) * number + (other,) * (total - number)
        return [cells | {answer: (each, column)} for each in trials]

    def _number(self, name: str, text: str, line: Row, where: str) -> float:
        number = number_in(text, where, line.path in self.decimal_commas)
        unit = self._fields[name].metadata.get("unit", "1")
        number *= UNITS[unit][self._units[name]] if name in self._units else 1.0
        if self._kinds[name] is not int:
            return number
        if not math.isfinite(number) or abs(number - round(number)) > 1e-6:
            raise InputError(f"{where}: expected a whole number, got {shown(text)}")
        return round(number)

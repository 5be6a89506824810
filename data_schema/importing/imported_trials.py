"""The trials of another program's table: what follows from its cells, and what stays unknown."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_request import COUNTS, ImportRequest
from evenlight.data_schema.importing.imported_order import Rows, put_in_order
from evenlight.data_schema.importing.imported_ramps import complete_ramps
from evenlight.data_schema.importing.source_cells import CellReader, Cells, missing_column, rows_of_cells
from evenlight.data_schema.mapping import nullable_fields, record_from_mapping
from evenlight.data_schema.printed import first_few
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.recordings.ramp_values import Values
from evenlight.data_schema.recordings.rating_scale import RatingScale, scale_for
from evenlight.data_schema.storage.foreign_tables import ForeignTable, Row
from evenlight.data_schema.storage.tables import as_number

# A row in which all of these are empty is no trial.
ANSWERS = {
    "rating": ("rating",),
    "comparison": ("response", "chosen"),
    "search": ("found",),
    "ramp": ("response",),
}
# One of each group is needed, beside what must be known of each trial and does not follow from others.
NEEDED = {
    "comparison": (("response", "chosen"),),
    "ramp": (("initial_luminance", "factor"), ("rate", "final_luminance")),
}
NEXT_LINE = "\n  "
FOLLOWS = {"ramp": ("screen", "factor", "initial_luminance", "final_luminance", "rate", "is_catch")}


def imported_trials(
    table: ForeignTable, taken: ImportRequest
) -> tuple[list[tuple[Row, Any]], list[str], dict[str, str]]:
    """Return the trials of a table, each with its row; what is to be said of the rows; participants' ids.

    The ids are by the texts that stand for them; those of participants who may be named there are codes.

    Raises
    ------
    InputError
        If something is missing, or many rows cannot be trials; it names file, line, column and value.
    """
    task, record = taken.task, taken.record
    _require_columns(table, taken)
    wanted = wanted_rows(table, taken)
    if not wanted:
        asked = " and ".join(f"{theirs}={' or '.join(known)}" for theirs, known in taken.only.items())
        raise InputError(f"{table.path}: none of {len(table.rows)} rows has --only {asked}")
    cells = list(rows_of_cells(dataclasses.replace(table, rows=tuple(wanted)), taken))
    _require_occurring(table, taken, cells)
    reader, own = CellReader(table, taken, cells), Rows(table, taken)
    several = own.sound(cells, lambda line, each: reader.answers(each, line))
    cells = [(line, each) for line, one in several for each in one]
    has_answer = [_has_answer(reader, task, line, each) for line, each in cells]
    answered = list(itertools.compress(cells, has_answer))
    if not answered:
        names = " or ".join(repr(taken.columns.get(name, name)) for name in ANSWERS[task])
        raise InputError(f"{table.path}: none of {len(cells)} rows has an answer in {names}")
    empty = {row.path for row, _ in table.rows} - {row.path for row, _ in answered}
    if empty:
        raise InputError(
            f"{min(empty)}: no row of it is a trial, as those of the other files are; expected the same "
            "columns in all files"
        )
    unknown = {"search_time", *FOLLOWS.get(task, ()), *nullable_fields(record)}
    own.rows = own.sound(answered, lambda line, each: reader.values(each, line, unknown))
    told = _completed(own, reader.blanked)
    ids, ordered = put_in_order(own)
    told += ordered
    keys = {each.name: file_key(each) for each in dataclasses.fields(record)}

    def trial(line: Row, values: Values) -> Any:
        plain = {keys[name]: value for name, value in values.items()} | {"simulated": taken.simulated}
        return record_from_mapping(record, plain, table.place(line))

    trials = own.sound(own.rows, trial)
    told = [f"  {words}" for words in told]
    told += ["numbers have decimal commas"] if reader.decimal_commas else []
    if len(wanted) < len(table.rows):
        told.append(f"left out by --only: {len(table.rows) - len(wanted)} of {len(table.rows)} rows")
    unanswered = [line for (line, _), there in zip(cells, has_answer, strict=True) if not there]
    if unanswered:
        numbers = [line.beside(cells[0][0]) for line in dict.fromkeys(unanswered)]
        places = f"{table.counted}{'s' * (len(numbers) > 1)} {first_few(numbers)}"
        answer = f"row{'s' * (len(unanswered) > 1)} without {'a rating' if task == 'rating' else 'an answer'}"
        told.append(f"skipped {len(unanswered)} {answer} ({places})")
    if own.impossible:
        whys = [why.removeprefix(f"{table.path}, ") for _, why in sorted(own.impossible.items())]
        told.append(f"left out {len(whys)} of {len(table.rows)} rows, as their values are impossible:")
        told.append(f"  {first_few(whys, between=NEXT_LINE)}")
    left, who = {each.participant_id for _, each in trials}, "participant_id"
    people = dict.fromkeys(reader.value(who, each, line) for line, each in answered)
    lost = [each for each in people if each and ids.get(each, each) not in left]
    told += [f"{first_few(lost)} ha{'s' if len(lost) == 1 else 've'} no trial left"] if lost else []
    return trials, told, ids


def wanted_rows(table: ForeignTable, taken: ImportRequest) -> list[tuple[Row, dict[str, str]]]:
    """Return the rows that `only` asks for; all where it asks for none."""
    asked = [(theirs, set(map(as_number, known))) for theirs, known in taken.only.items()]
    return [
        row
        for row in table.rows
        if all(as_number(table.cell(row[1], name)) in known for name, known in asked)
    ]


def _has_answer(reader: CellReader, task: str, line: Row, cells: Cells) -> bool:
    try:
        return any(reader.value(name, cells, line) is not None for name in ANSWERS[task])
    except InputError:  # it has one that cannot be, and is told with the other impossible rows
        return True


def _require_occurring(table: ForeignTable, taken: ImportRequest, cells: list[tuple[Row, Cells]]) -> None:
    """Refuse a value of theirs that no row has: it may be written otherwise."""
    for name, meanings in taken.values.items():
        there = [own[name] for _, own in cells if name in own and own[name][0]]
        texts = dict.fromkeys(text for text, _ in there)
        labels = {table.labels.get(column, {}).get(text) for text, column in there}
        if not set(map(as_number, meanings)) & {*map(as_number, texts), *labels}:
            unused = next(iter(meanings))
            raise InputError(
                f"{table.path}: {unused!r} of --value {name}:{meanings[unused]}={unused} is nowhere; "
                f"there are {first_few(list(map(repr, texts)))}"
            )


def _require_columns(table: ForeignTable, taken: ImportRequest) -> None:
    record, follows, needed = taken.record, FOLLOWS.get(taken.task, ()), NEEDED.get(taken.task, ())
    if "n_correct" in taken.given or (taken.counted and "ramp_interval" in taken.given):
        raise InputError(
            f"{table.path}: counts do not tell which interval was answered in each trial of two intervals; "
            "give a row for each trial"
        )
    free = {"session_id", "trial_index", "simulated", "repetition", *follows, *nullable_fields(record)}
    must = [(f.name,) for f in dataclasses.fields(record) if f.default is dataclasses.MISSING]
    for names in [*(one for one in must if one[0] not in free), *needed]:
        if not taken.given.intersection(names):
            raise missing_column(table, taken, names)


def _completed(own: Rows, blanked: set[tuple[str, Row]]) -> list[str]:
    """Fill in what follows of each row, and return it in words."""
    taken, place, told = own.taken, own.table.place, list[str]()
    if taken.counted:
        number, answer, yes, no = COUNTS[taken.task]
        told = [f"{answer}: {yes} in {number} of n_trials trials, {no} in the others"]
    if taken.judged:
        told = ["response: the interval of the ramp where it is correct, else the other"]
    if taken.task == "rating":
        column = taken.columns.get("rating", "rating")
        given = [(place(row, column), values["rating"]) for row, values in own.rows]
        scale = scale_for(given, taken.scale)
        own.rows = own.sound(own.rows, lambda row, each: _on_scale(each, scale, place(row, column)))
    if taken.task == "comparison":
        own.rows = [(row, _with_interval(values)) for row, values in own.rows]
    if taken.task == "search":
        told += _censored(own, blanked)
    if taken.task == "ramp":
        told += complete_ramps(own)
    return told


def _on_scale(values: Values, scale: RatingScale, where: str) -> Values:
    if why := scale.refusal(values["rating"]):
        raise InputError(f"{where}: {why}")
    return values


def _with_interval(values: Values) -> Values:
    if None not in (values["ours_interval"], values.get("chosen")) and values["response"] is None:
        ours_chosen = values.pop("chosen") == "ours"
        values["response"] = "first" if ours_chosen == (values["ours_interval"] == 1) else "second"
    return values


def _censored(own: Rows, blanked: set[tuple[str, Row]]) -> Iterator[str]:
    """Give what was not found the time limit for its time, unless it ended before, or may have."""
    lost = [values for _, values in own.rows if not values["found"]]
    wrong = sum((values["search_time"] or values["time_limit"]) < values["time_limit"] for values in lost)
    limits, unknown, column = list[float](), list[Row](), own.taken.columns.get("search_time", "search_time")

    def timed(row: Row, values: Values) -> Values:
        time, limit = values["search_time"], values["time_limit"]
        if time is None and values["found"]:
            raise InputError(f"{own.table.place(row, column)}: found, but no search_time")
        if time is None and (wrong or ("search_time", row) in blanked):
            unknown.append(row)
            return values
        limits.extend([limit] * (time is None))
        return values if values["found"] else values | {"search_time": min(time or limit, limit)}

    own.rows = [each for each in own.sound(own.rows, timed) if each[1]["search_time"] is not None]
    if not own.rows:
        raise InputError(f"{own.table.path}: no row has a time in {column!r}, or a limit for it")
    if wrong:
        yield f"found: {_searches(wrong)} ended before the time limit, with a wrong answer"
    if limits:
        limit = f"the limit of {limits[0]:g} s" if len(set(limits)) == 1 else "their limits"
        have = "has" if len(limits) == 1 else "have"
        yield f"search_time: {_searches(len(limits))} {have} no time: taken as lasting to {limit}"
    if unknown:
        why = "others ended before the limit" if wrong else "--missing says that it is unknown"
        lines = f"{own.table.counted}{'s' * (len(unknown) > 1)}"
        yield (
            f"search_time: left out {_searches(len(unknown))} and a time, as {why}; give the limit where "
            f"they lasted to it ({lines} {first_few([row.beside(unknown[0]) for row in unknown])})"
        )


def _searches(number: int) -> str:
    return f"{number} search{'es' * (number > 1)} without success"

"""The trials of another program's table: what follows from its cells, and what stays unknown."""

from __future__ import annotations

import dataclasses
import itertools
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_mapping import UNITS, ImportMapping, ImportRequest, fields_by_name
from evenlight.data_schema.importing.imported_ramps import complete_ramps
from evenlight.data_schema.importing.source_cells import CellReader, Cells, rows_of_cells
from evenlight.data_schema.importing.source_tables import Row, SourceTable
from evenlight.data_schema.mapping import nullable_fields, record_from_mapping
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.recordings.participant_ids import participant_codes, participant_id_in
from evenlight.data_schema.recordings.session import TASKS
from evenlight.data_schema.recordings.viewing import name_in, repetitions

MOST_SHOWN = 8  # lines that are listed
COPIED_RAMPS = 10  # rows in the same order that agree in every cell by no chance (choice)
_DATE = re.compile(r"\d{4}[-./]\d{1,2}[-./]\d{1,2}|\d{1,2}[-./]\d{1,2}[-./]\d{4}")
ONLY_SESSION = "01"  # of rows that name none
SESSION = ("participant_id", "session_id")
# A row in which all of these are empty is no trial.
ANSWERS = {
    "rating": ("rating",),
    "comparison": ("response", "chosen"),
    "search": ("found",),
    "ramp": ("response",),
}
# What is answered about: a further answer about it is a repetition.
ITEMS = {
    "rating": (*SESSION, "sequence", "version"),
    "comparison": (*SESSION, "sequence"),
    "search": ("participant_id", "sequence", "keypoint", "version"),
}
# One of each group is needed, beside what must be known of each trial and does not follow from others.
NEEDED = {
    "comparison": (("response", "chosen"),),
    "ramp": (("initial_luminance", "factor"), ("rate", "final_luminance")),
}
FOLLOWS = {"ramp": ("screen", "factor", "initial_luminance", "final_luminance", "rate", "is_catch")}


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows on their way to trials: line in the file, and values by our attributes, None if unknown."""

    table: SourceTable
    taken: ImportMapping
    rows: list[tuple[Row, dict[str, Any]]]

    def where(self, line: Row, name: str) -> str:
        """Return file, line and column of a value."""
        return self.table.place(line, self.taken.columns.get(name, name))


def imported_trials(
    table: SourceTable, taken: ImportMapping, request: ImportRequest
) -> tuple[list[tuple[Row, Any]], list[str], dict[str, str]]:
    """Return the trials of a table, each with its row; what is to be said of the rows; participants' ids.

    The ids are by the texts that stand for them; those of participants who may be named there are codes.

    Raises
    ------
    InputError
        If something is missing, or a row cannot be a trial; it names file, line, column and value.
    """
    task, record = request.task, TASKS[request.task].trial
    _require_columns(table, taken, task)
    wanted = wanted_rows(table, taken)
    if not wanted:
        asked = " and ".join(f"{theirs}={' or '.join(known)}" for theirs, known in taken.only.items())
        raise InputError(f"{table.path}: none of {len(table.rows)} rows has --only {asked}")
    cells = list(rows_of_cells(dataclasses.replace(table, rows=tuple(wanted)), taken))
    _require_occurring(table, taken, cells)
    reader = CellReader(table, taken, cells)
    answered = [
        any(reader.value(name, own, line) is not None for name in ANSWERS[task]) for line, own in cells
    ]
    if not any(answered):
        names = " or ".join(repr(taken.columns.get(name, name)) for name in ANSWERS[task])
        raise InputError(f"{table.path}: none of {len(cells)} rows has an answer in {names}")
    kept_rows = [(line, reader.values(own, line)) for line, own in itertools.compress(cells, answered)]
    own_rows = _Rows(table, taken, kept_rows)
    _require_values(own_rows, task)
    ids = _renamed(own_rows, "participant_id")
    who = [] if coded(ids) else _changed("participant_id", ids)
    told = [
        f"  {words}" for words in (*who, *_identity(own_rows), *_of_task(own_rows, task, request.display))
    ]
    told += ["numbers have decimal commas"] if reader.decimal_commas else []
    if len(wanted) < len(table.rows):
        told.append(f"left out by --only: {len(table.rows) - len(wanted)} of {len(table.rows)} rows")
    _require_answers(table, [line for line, _ in kept_rows])
    unanswered = [line for (line, _), there in zip(cells, answered, strict=True) if not there]
    if unanswered:
        numbers = [line.beside(cells[0][0]) for line in dict.fromkeys(unanswered)]
        rows = f"{len(unanswered)} row{'s' * (len(unanswered) > 1)}"
        places = f"{table.counted}{'s' * (len(numbers) > 1)} {first_few(numbers)}"
        lacking = "a rating" if task == "rating" else "an answer"
        told.append(f"skipped {rows} without {lacking} ({places})")
    keys = {field.name: file_key(field) for field in dataclasses.fields(record)}
    trials = []
    for line, values in own_rows.rows:
        plain = {keys[name]: value for name, value in values.items()} | {"simulated": request.simulated}
        trials.append((line, record_from_mapping(record, plain, table.place(line))))
    return trials, told, ids


def coded(ids: dict[str, str]) -> bool:
    """Return whether the ids of some participants are codes that were given to them."""
    return any(participant_id_in(text) is None for text in ids)


def _require_occurring(table: SourceTable, taken: ImportMapping, cells: list[tuple[Row, Cells]]) -> None:
    """Refuse a value of theirs that no row has: it may be written otherwise."""
    for name, meanings in taken.values.items():
        there = dict.fromkeys(own[name][0] for _, own in cells if name in own and own[name][0])
        unused = next((text for text in meanings if text not in there), None)
        if unused is not None and not meanings.keys() & there.keys():
            raise InputError(
                f"{table.path}: {unused!r} of --value {name}:{meanings[unused]}={unused} is nowhere; "
                f"there are {first_few(list(map(repr, there)))}"
            )


def wanted_rows(table: SourceTable, taken: ImportMapping) -> list[tuple[Row, dict[str, str]]]:
    """Return the rows that `only` asks for; all where it asks for none."""
    only = taken.only.items()
    return [row for row in table.rows if all(table.cell(row[1], theirs) in known for theirs, known in only)]


def _require_answers(table: SourceTable, answered: list[Row]) -> None:
    """Refuse a file without any trial: its columns may be named otherwise than those of the others."""
    missing = {row.path for row, _ in table.rows} - {row.path for row in answered}
    if missing:
        raise InputError(
            f"{min(missing)}: no row of it is a trial, as those of the other files are; expected the same "
            "columns in all files"
        )


def first_few(names: list[str]) -> str:
    """Return names, and how many there would be more.

    >>> first_few([str(number) for number in range(12)])
    '0, 1, 2, 3, 4, 5, 6, 7 and 4 more'
    """
    more = f" and {len(names) - MOST_SHOWN} more" if len(names) > MOST_SHOWN else ""
    return ", ".join(names[:MOST_SHOWN]) + more


def _require_columns(table: SourceTable, taken: ImportMapping, task: str) -> None:
    record, follows = TASKS[task].trial, FOLLOWS.get(task, ())
    free = {"session_id", "trial_index", "simulated", "repetition", *follows, *nullable_fields(record)}
    must = [(f.name,) for f in dataclasses.fields(record) if f.default is dataclasses.MISSING]
    for names in [*(one for one in must if one[0] not in free), *NEEDED.get(task, ())]:
        if not taken.given.intersection(names):
            _require_unit_of(table, record, names)
            raise InputError(
                f"{table.path}: no column {' or '.join(names)}; name the one that it is with --column "
                f"{names[0]}=THEIRS, or give --constant {names[0]}=VALUE; its columns are "
                f"{', '.join(table.columns)}"
            )


def _require_unit_of(table: SourceTable, record: type[Any], names: tuple[str, ...]) -> None:
    for column in table.columns:
        if column.lower() in names:
            unit = fields_by_name(record)[column.lower()].metadata.get("unit", "1")
            raise InputError(
                f"{table.path}: the unit of {column!r} is not known; give it with --unit "
                f"{column.lower()}=UNIT, one of {', '.join(UNITS.get(unit, {}))}"
            )


def _require_values(own: _Rows, task: str) -> None:
    fields = dataclasses.fields(TASKS[task].trial)
    told = {"search_time", *FOLLOWS.get(task, ()), *nullable_fields(TASKS[task].trial)}
    must = [f.name for f in fields if f.name in own.taken.given and f.default is dataclasses.MISSING]
    for line, values in own.rows:
        for name in must:
            if values[name] is None and name not in told:
                raise InputError(
                    f"{own.where(line, name)}: no {name}; expected one in each row with an answer"
                )


def _identity(own: _Rows) -> Iterator[str]:
    if "session_id" not in own.taken.given:
        yield f"session_id: {ONLY_SESSION}, as none is named"
    for name in ("session_id", "sequence"):
        if name in own.taken.given:
            yield from _changed(name, _renamed(own, name))
    numbered = "trial_index" in own.taken.given
    if not numbered:
        yield "trial_index: the order of rows"
    counts: Counter[tuple[str, str]] = Counter()
    for _, values in own.rows:
        values["session_id"] = values["session_id"] or ONLY_SESSION
        session = (values["participant_id"], values["session_id"])
        values["trial_index"] = values["trial_index"] if numbered else counts[session]
        counts[session] += 1
    _require_different(
        own,
        (*SESSION, "trial_index"),
        "; name a column that counts all trials, or none (--column trial_index=), or leave out practice "
        "rows with --only",
    )


def _renamed(own: _Rows, name: str) -> dict[str, str]:
    """Give all rows names fit for files, and return them by the texts; refuse two that are nearly one."""
    first: dict[str, tuple[str, Row]] = {}
    for line, values in own.rows:
        text = values[name] or ""
        where, plain = own.where(line, name), unicodedata.normalize("NFKC", text)
        if name == "participant_id" and _DATE.fullmatch(plain):
            raise InputError(f"{where}: {text!r} looks like a date; expected a code such as P01")
        if not re.search(r"[^\W_]", plain) or "@" in plain:
            raise InputError(f"{where}: expected a code of letters and digits as {name}, got {text!r}")
        alike = re.sub(r"[\W_]+", "_" if name == "sequence" else "", plain).casefold().strip("_")
        other, before = first.setdefault(alike if name == "sequence" else alike.lstrip("0"), (text, line))
        if other != text:
            raise InputError(
                f"{where}: {text!r}, and {other!r} of {own.table.counted} {before.beside(line)}, would be "
                f"one {name}; write them alike if they are, else so that letters or digits differ"
            )
    texts = [text for text, _ in first.values()]
    fit = dict(zip(texts, _fit_names(texts, name), strict=True))
    for _, values in own.rows:
        values[name] = fit.get(values[name], values[name])
    return fit


def _fit_names(texts: list[str], name: str) -> list[str]:
    if name == "sequence":
        return [name_in(text) for text in texts]
    plain = [participant_id_in(text) for text in texts]
    if name == "session_id":  # nobody's name: one without a digit, such as "pre", stays
        plain = [re.sub("[^0-9A-Za-z]", "", each) if each.isascii() else None for each in texts]
    ids = [each for each in plain if each]
    return ids if len(ids) == len(texts) else participant_codes(len(texts), "P" * (name == "participant_id"))


def _changed(name: str, fit: dict[str, str]) -> list[str]:
    changed = [f"{new} for {text!r}" for text, new in fit.items() if new != text]
    return [f"{name}: {first_few(changed)}"] if changed else []


def _require_different(own: _Rows, names: tuple[str, ...], advice: str = "") -> None:
    first: dict[tuple[Any, ...], Row] = {}
    for line, values in own.rows:
        key = tuple(values[name] for name in names)
        before = first.setdefault(key, line)
        if before != line:
            same = ", ".join(f"{name} {value}" for name, value in zip(names, key, strict=True))
            raise InputError(
                f"{own.table.place(line)}: {same} is there already, in "
                f"{own.table.counted} {before.beside(line)}{advice}"
            )


def _of_task(own: _Rows, task: str, display: Display | None) -> Iterator[str]:
    given, item = own.taken.given, ITEMS.get(task, ())
    if item and "repetition" not in given:
        yield from _repetitions(own, item)
    if task == "rating" and "trial_index" in given and "place_in_pair" not in given:
        _place_in_pairs(own)
        yield "place_in_pair: by trial_index"
    if task == "comparison":
        _choose_intervals(own)
    if task == "search":
        yield from _censor(own)
    if task in ("ramp", "search"):
        _refuse_copied_rows(own)
    if task == "ramp":
        yield from complete_ramps(own.rows, own.table, own.taken, display)


def _repetitions(own: _Rows, item: tuple[str, ...]) -> Iterator[str]:
    numbered, search = "trial_index" in own.taken.given, "search_time" in own.taken.given
    if not (numbered or search):  # measured times tell copies
        _require_different(
            own,
            item,
            "; if it is a repetition, name the column that counts them (--column repetition=THEIRS) or "
            "the order of trials (--column trial_index=THEIRS), else take it out",
        )
    elif not search:
        _refuse_copies(own, item)
    rows = [values for _, values in own.rows]
    rows.sort(key=lambda values: (values["session_id"], values["trial_index"]))
    items = [tuple(values[name] for name in item) for values in rows]
    for values, number in zip(rows, repetitions(items), strict=True):
        values["repetition"] = number
    if max(values["repetition"] for values in rows) > 1:
        yield f"repetition: by {'trial_index' if numbered else 'the order of rows'}"
    elif not search and len(set(items)) < len(items):
        yield "repetition: 1 in all rows, as most was answered once; further answers count as repeated rows"


def _refuse_copies(own: _Rows, item: tuple[str, ...]) -> None:
    """Refuse a further answer that is an earlier one, in the measured time too."""
    first: dict[tuple[Any, ...], Row] = {}
    names = [name for name in item if name != "session_id"]
    for line, values in own.rows:
        answer = [values.get(name) for name in ("rating", "response", "chosen")]
        time = values.get("response_time")
        before = first.setdefault((*(values[name] for name in names), *answer, time), line)
        if time is not None and before != line:
            raise InputError(
                f"{own.table.place(line)}: the same item, answer and response time as in "
                f"{own.table.counted} {before.beside(line)}; a copy? take it out, or name the column of "
                "repetitions (--column repetition=THEIRS)"
            )


def _refuse_copied_rows(own: _Rows) -> None:
    """Refuse many rows on end that a participant has before, in all cells but the index."""
    cells, index = dict(own.table.rows), own.taken.columns.get("trial_index")
    people: dict[str, list[Row]] = {}
    for line, values in own.rows:
        people.setdefault(values["participant_id"], []).append(line)
    for lines in people.values():
        kinds = [tuple(text for name, text in cells[line].items() if name != index) for line in lines]
        first: dict[tuple[Any, ...], int] = {}
        for end in range(COPIED_RAMPS, len(lines) + 1):
            block, start = tuple(kinds[end - COPIED_RAMPS : end]), end - COPIED_RAMPS
            before = first.setdefault(block, start)
            if start - before >= COPIED_RAMPS and len(set(block)) > 2:
                was, now = (
                    f"{lines[one].number} to {lines[one + COPIED_RAMPS - 1].beside(lines[start])}"
                    for one in (before, start)
                )
                raise InputError(
                    f"{own.table.place(lines[start])}: {own.table.counted}s {now} are {was} again, but for "
                    "the index; a copy? take it out"
                )


def _place_in_pairs(own: _Rows) -> None:
    pairs: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for _, values in sorted(own.rows, key=lambda row: row[1]["trial_index"]):
        key = tuple(values[name] for name in (*SESSION, "sequence", "repetition"))
        pairs.setdefault(key, []).append(values)
    for pair in pairs.values():
        versions = list(dict.fromkeys(values["version"] for values in pair))
        if len(versions) == 2:
            for values in pair:
                values["place_in_pair"] = versions.index(values["version"]) + 1


def _choose_intervals(own: _Rows) -> None:
    for _, values in own.rows:
        if None not in (values["ours_interval"], values.get("chosen")) and values["response"] is None:
            ours_chosen = values.pop("chosen") == "ours"
            values["response"] = "first" if ours_chosen == (values["ours_interval"] == 1) else "second"


def _censor(own: _Rows) -> Iterator[str]:
    """Give what was not found the time limit for its time, unless it ended before: with a wrong answer."""
    lost = [values for _, values in own.rows if not values["found"] and values["time_limit"] is not None]
    for values in lost:
        values["search_time"] = min(values["search_time"] or values["time_limit"], values["time_limit"])
    if wrong := sum(values["search_time"] < values["time_limit"] for values in lost):
        searches = f"{wrong} search{'es' * (wrong > 1)}"
        yield f"found: {searches} without success ended before the time limit, with a wrong answer"

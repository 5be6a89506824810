"""Who answered, in which order, and what is a repetition or a copy, in another program's table."""

from __future__ import annotations

import dataclasses
import re
import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_request import ImportRequest
from evenlight.data_schema.printed import first_few
from evenlight.data_schema.recordings.participant_ids import are_codes, ids_for, numbered_codes
from evenlight.data_schema.recordings.viewing import in_sessions, name_in, repetitions
from evenlight.data_schema.storage.foreign_tables import ForeignTable, Row

Given = TypeVar("Given")
Made = TypeVar("Made")
MOST_LEFT_OUT, SHARE_LEFT_OUT = 3, 0.05  # impossible rows; more say that a column is misunderstood (choice)
FEW_REPETITIONS = 4  # of an item; of more, some have the same answer and time in ms by chance
COPIED_ROWS = 10  # timed rows in the same order that agree in every cell by no chance (choice)
_DATE = re.compile(r"(\d{4}[-./]\d{1,2}[-./]\d{1,2}|\d{1,2}[-./]\d{1,2}[-./]\d{4})([T ][\d:.]+)?")
ONLY_SESSION = "01"  # of rows that name none
SESSION = ("participant_id", "session_id")
# What is answered about: a further answer about it is a repetition.
ITEMS = {
    "rating": (*SESSION, "sequence", "version"),
    "comparison": (*SESSION, "sequence"),
    "search": ("participant_id", "sequence", "keypoint", "version"),
    "ramp": (*SESSION, "screen", "direction", "initial_luminance", "rate", "duration"),
}
ANSWER = ("rating", "response", "chosen", "response_time")  # the time last
TIMED = ("search", "ramp")  # whose rows are copies only where ten on end are
TIMES = ("response_time", "onset", "search_time")


@dataclass(slots=True)
class Rows:
    """Rows on their way to trials: their place, and values by our attributes, None if unknown."""

    table: ForeignTable
    taken: ImportRequest
    rows: list[tuple[Row, dict[str, Any]]] = field(default_factory=list)
    impossible: dict[Row, str] = field(default_factory=dict)
    lost: int = 0  # trials that are impossible, of those that the rows stand for

    def sound(
        self, rows: list[tuple[Row, Given]], make: Callable[[Row, Given], Made]
    ) -> list[tuple[Row, Made]]:
        """Return what is made of rows; a few of which it cannot be become impossible, many are refused."""
        made, problems = list[tuple[Row, Made]](), dict[Row, str]()
        for line, values in rows:
            try:
                made.append((line, make(line, values)))
            except InputError as error:
                problems.setdefault(line, str(error))
        for_all = len(rows) + self.lost
        self.impossible, self.lost = problems | self.impossible, for_all - len(made)
        number = len(self.impossible) - 1
        if self.lost > max(MOST_LEFT_OUT, SHARE_LEFT_OUT * for_all) or 0 < for_all <= 2 * self.lost:
            others = f" (and {number} other row{'s' * (number > 1)})" if number else ""
            raise InputError(self.impossible[min(self.impossible)] + others)
        return made

    def in_order(self) -> list[tuple[Row, dict[str, Any]]]:
        """Return the rows in the order of sessions and trials, or of the file where it is not known yet."""
        return sorted(self.rows, key=lambda row: in_sessions(row[1]))

    def groups(self, *names: str) -> dict[tuple[Any, ...], list[tuple[Row, dict[str, Any]]]]:
        """Return the rows that agree in some values, in their order."""
        groups: dict[tuple[Any, ...], list[tuple[Row, dict[str, Any]]]] = {}
        for row in self.in_order():
            groups.setdefault(tuple(row[1].get(name) for name in names), []).append(row)
        return groups

    def require_different(self, names: tuple[str, ...], advice: str, what: str = "") -> None:
        """Refuse rows that agree in some values, of which the last is known."""
        for key, (first, *others) in self.groups(*names).items():
            if others and key[-1] is not None:
                own = ", ".join(f"{name} {value}" for name, value in zip(names, key, strict=True))
                same = what or own
                raise InputError(
                    f"{self.table.place(others[0][0])}: {same} is there already, in "
                    f"{self.table.counted} {first[0].beside(others[0][0])}{advice}"
                )


def put_in_order(own: Rows) -> tuple[dict[str, str], list[str]]:
    """Give all rows ids, places and repetitions; return participants' ids by text, and what is told."""
    ids = _fit_names(own, "participant_id")
    told = [] if are_codes(ids) else _changed_names("participant_id", ids)
    return ids, [*told, *_numbered_trials(own), *_what_is_repeated(own)]


def _fit_names(own: Rows, name: str) -> dict[str, str]:
    """Give all rows names fit for files, and return them by the texts; refuse two that are nearly one."""
    first: dict[str, tuple[str, Row]] = {}
    for line, values in own.rows:
        text = values[name] or ""
        where = own.table.place(line, own.taken.columns.get(name, name))
        plain = unicodedata.normalize("NFKC", text)
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
    fit = ids_for(texts) if name == "participant_id" else {text: name_in(text) for text in texts}
    if name == "session_id":  # nobody's name: one without a digit, such as "pre", stays
        plain_names = [re.sub("[^0-9A-Za-z]", "", text) for text in texts]
        fit_texts = plain_names if "".join(texts).isascii() else numbered_codes(len(texts))
        fit = dict(zip(texts, fit_texts, strict=True))
    for _, values in own.rows:
        values[name] = fit.get(values[name], values[name])
    return fit


def _changed_names(name: str, fit: dict[str, str]) -> list[str]:
    changed = [f"{new} for {text!r}" for text, new in fit.items() if new != text]
    return [f"{name}: {first_few(changed)}"] if changed else []


def _numbered_trials(own: Rows) -> Iterator[str]:
    if "session_id" not in own.taken.given:
        yield f"session_id: {ONLY_SESSION}, as none is named"
    for name in ("session_id", "sequence"):
        if name in own.taken.given:
            yield from _changed_names(name, _fit_names(own, name))
    for _, values in own.rows:
        values["session_id"] = values["session_id"] or ONLY_SESSION
    if "trial_index" not in own.taken.given:
        yield "trial_index: the order of rows"
        for rows in own.groups(*SESSION).values():
            for place, (_, values) in enumerate(rows):
                values["trial_index"] = place
    own.require_different(
        (*SESSION, "trial_index"),
        "; name a column that counts all trials, or none (--column trial_index=), or leave out practice "
        "rows with --only",
    )


def _what_is_repeated(own: Rows) -> Iterator[str]:
    task, given = own.taken.task, own.taken.given
    if task in TIMED:
        _refuse_copied_rows(own)
    if "repetition" in {each.name for each in dataclasses.fields(own.taken.record)} - given:
        yield from _repetitions(own, ITEMS[task])
    if task == "rating" and "trial_index" in given and "place_in_pair" not in given:
        yield "place_in_pair: by trial_index"
        for pair in own.groups(*SESSION, "sequence", "repetition").values():
            versions = list(dict.fromkeys(values["version"] for _, values in pair))
            for _, values in pair if len(versions) == 2 else ():
                values["place_in_pair"] = versions.index(values["version"]) + 1


def _repetitions(own: Rows, item: tuple[str, ...]) -> Iterator[str]:
    numbered, timed = "trial_index" in own.taken.given, own.taken.task in TIMED
    if not (numbered or timed or own.taken.counted):
        own.require_different(
            item,
            "; if it is a repetition, name the column that counts them (--column repetition=THEIRS) or "
            "the order of trials (--column trial_index=THEIRS), else take it out",
        )
    rows = [values for _, values in own.rows]
    items = [tuple(values.get(name) for name in item) for values in rows]
    if not timed and len(items) <= FEW_REPETITIONS * len(set(items)):
        own.require_different(
            (*(name for name in item if name != "session_id"), *ANSWER),
            "; a copy? take it out, or name the column of repetitions (--column repetition=THEIRS)",
            "the same item, answer and response time",
        )
    numbers = repetitions(rows, item)
    if max(numbers) > 1:
        yield f"repetition: by {'trial_index' if numbered else 'the order of rows'}"
    elif own.taken.task == "ramp":
        return  # a staircase repeats some by chance: they are not counted
    elif not timed and len(set(items)) < len(items):
        yield "repetition: 1 in all rows, as most was answered once; further answers count as repeated rows"
    for values, number in zip(rows, numbers, strict=True):
        values["repetition"] = number


def _refuse_copied_rows(own: Rows) -> None:
    """Refuse many rows with measured times that a participant has before on end, in all cells but the index.

    Without times they agree by chance: levels and answers of limits, or of any fixed order, do.
    """
    cells, index = dict(own.table.rows), own.taken.columns.get("trial_index")
    for rows in own.groups("participant_id").values():
        lines = [line for line, values in rows if any(values.get(name) is not None for name in TIMES)]
        kinds = [tuple(text for name, text in cells[line].items() if name != index) for line in lines]
        first: dict[tuple[Any, ...], int] = {}
        for end in range(COPIED_ROWS, len(lines) + 1):
            block, start = tuple(kinds[end - COPIED_ROWS : end]), end - COPIED_ROWS
            before = first.setdefault(block, start)
            if start - before >= COPIED_ROWS and len(set(block)) > 2:
                was, now = (
                    f"{lines[one].number} to {lines[one + COPIED_ROWS - 1].beside(lines[start])}"
                    for one in (before, start)
                )
                raise InputError(
                    f"{own.table.place(lines[start])}: {own.table.counted}s {now} are {was} again, but for "
                    "the index; a copy? take it out"
                )

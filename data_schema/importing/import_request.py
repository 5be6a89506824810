"""What another program's columns, units and values stand for, from options or a small TOML."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import unknown_key
from evenlight.data_schema.quantities import count, described, file_key
from evenlight.data_schema.recordings.session import TASKS
from evenlight.data_schema.storage.text_files import read_toml

# What options say, by their names: their form, and their help. Those of columns are tables in a TOML file.
OPTIONS = {
    "column": ("OURS=THEIRS", "Name of a column in the file, for one of ours."),
    "unit": ("OURS=UNIT", "Unit of a column, such as search_time=ms."),
    "value": ("OURS:VALUE=THEIRS", "What a value is called in the file, such as version:ours=TBM."),
    "constant": ("OURS=VALUE", "One value for all rows, where the file has no such column."),
    "wide": ("OURS=PATTERN", "Columns that hold an answer each, as rating={sequence}_{version}."),
    "only": ("THEIRS=VALUE", "Take only the rows with this value."),
}
SETTINGS = {
    "names": ("A,B,C", "Names of the columns, where no row has them."),
    "scale": ("LOWEST..HIGHEST", "Scale of ratings, as 1..7 or 1..5:0.5 (steps)."),
    "missing": ("TEXT", "What stands for no value, such as - or 999."),
    "participant_from": ("REGEX", r"What finds the participant in the file's name, such as '(\d+)_'."),
    "encoding": ("NAME", "Encoding of a text, such as cp1252, where it is not seen."),
    "sheet": ("NAME", "Sheet of a workbook, where it is not the first that has cells."),
}
TABLES = {name if name in ("wide", "only") else f"{name}s": name for name in OPTIONS}
# Factor from each unit to that of the record; those of "/s" are shares of the initial luminance.
UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "cd/m^2": {"cd/m^2": 1.0, "cd/m2": 1.0, "nit": 1.0, "fL": 3.4262591},
    "cd/m^2/s": {"cd/m^2/s": 1.0, "cd/m2/s": 1.0, "nit/s": 1.0, "1/s": 1.0, "%/s": 0.01},
    "deg": {"deg": 1.0, "rad": 57.29577951308232},
    "arcmin": {"arcmin": 1.0, "arcsec": 1 / 60, "deg": 60.0},
    "1": {"1": 1.0, "%": 0.01},
}
RELATIVE_RATES = ("1/s", "%/s")
# Rows for several trials: the column that counts an answer, of n_trials; the answer, and the other one.
COUNTS = {"ramp": ("n_yes", "response", "yes", "no"), "comparison": ("n_ours", "chosen", "ours", "baseline")}
BESIDE = {"ramp": ("n_yes", "n_correct", "n_trials", "correct"), "comparison": ("n_ours", "n_trials")}
_Field = dataclasses.Field[Any]


@dataclass(frozen=True, slots=True)
class ImportRequest:
    """What is imported, and what another program's table means, by our attributes."""

    task: str
    paths: tuple[Path, ...]  # of one table, or of several that are alike
    display: Display | None = None  # None if it is unknown what was looked at
    simulated: bool = False  # whether simulated observers answered
    columns: dict[str, str] = field(default_factory=dict)  # theirs, or a path into JSON; empty for none
    units: dict[str, str] = field(default_factory=dict)  # of their numbers
    values: dict[str, dict[str, str]] = field(default_factory=dict)  # our value for each of theirs
    constants: dict[str, str] = field(default_factory=dict)  # what holds for all rows
    wide: dict[str, str] = field(default_factory=dict)  # pattern of columns, as `{sequence}_{version}`
    only: dict[str, list[str]] = field(default_factory=dict)  # by their column: what a row must have
    settings: dict[str, list[str]] = field(default_factory=dict)  # how it is read, by `SETTINGS`

    @property
    def record(self) -> type[Any]:
        """The record of the task's trials."""
        return TASKS[self.task].trial

    @property
    def scale(self) -> str:
        """The scale of ratings that was asked for, as `1..7`; empty if they are to show it."""
        return self.settings.get("scale", [""])[-1]

    @property
    def fields(self) -> dict[str, _Field]:
        """The fields that a table may fill, by attribute and by file key: a trial's, and those beside it."""
        own = [each for each in dataclasses.fields(self.record) if each.name != "simulated"]
        own += [each for each in dataclasses.fields(BesideTrials) if each.name in BESIDE.get(self.task, ())]
        return {each.name: each for each in own} | {file_key(each): each for each in own}

    @property
    def counted(self) -> bool:
        """Whether a row stands for several trials."""
        return self.task in COUNTS and COUNTS[self.task][0] in self.columns

    @property
    def judged(self) -> bool:
        """Whether the answer of a ramp follows from its interval, and whether it was correct."""
        return "correct" in self.columns and "response" not in self.columns

    @property
    def given(self) -> set[str]:
        """Our attributes that the table fills, in all of its rows or some."""
        named = (name for pattern in self.wide.values() for name in re.findall(r"\{(\w+)\}", pattern))
        in_patterns = (self.fields[name].name for name in named if name in self.fields)
        answer = COUNTS[self.task][1:2] if self.counted or self.judged else ()
        return {*self.columns, *self.constants, *self.wide, *in_patterns, *answer}


@dataclass(frozen=True, slots=True)
class BesideTrials:
    """Columns that answers follow from, beside those of a trial's record."""

    correct: bool = described("whether the interval with the ramp was named")
    n_correct: int = count("trials with the right one of two intervals")
    n_yes: int = count("trials with the answer yes")
    n_ours: int = count("trials in which the modulated version was chosen")
    n_trials: int = count("trials that the row stands for", maximum=10000)


def import_request(
    request: ImportRequest, options: Mapping[str, Iterable[str]], path: Path | None = None
) -> ImportRequest:
    """Return a request with what options, and a TOML file, say about a table.

    Options, by the names of `OPTIONS` and `SETTINGS`, override the file, whose tables are [columns], [units],
    [values.OURS], [constants], [wide] and [only]; settings are its keys.

    Raises
    ------
    InputError
        For a column that a trial has not, a unit that it cannot be in, or an option of another form.
    """
    fields, made = request.fields, dataclasses.replace(request)
    overridden = {text.partition("=")[0] for text in options.get("only", ())}
    said = [
        (where, name, text)
        for where, name, text in (_file_options(path) if path else ())
        if not (name in SETTINGS and options.get(name))
        and not (name == "only" and text.partition("=")[0] in overridden)
    ]
    said += [(f"--{name.replace('_', '-')}", name, text) for name, texts in options.items() for text in texts]
    for where, name, text in said:
        if name in SETTINGS:
            _require_setting(name, text, where)
            texts = re.split(r"\s*,\s*", text.strip()) if name == "names" else [text]
            made.settings.setdefault(name, []).extend(texts)
            continue
        ours, found, theirs = text.partition("=")
        ours, _, our_value = ours.partition(":") if name == "value" else (ours, "", "")
        if not found or not ours or (name == "value") != bool(our_value):
            raise InputError(f"{where}: expected {OPTIONS[name][0]}, got {text!r}")
        if name == "only":
            made.only.setdefault(ours, []).append(theirs)
            continue
        if ours not in fields:
            problem = unknown_key(ours, {each.name: each for each in fields.values()})
            raise InputError(f"{where} {text}: {problem.replace('key', 'column', 1)}")
        own = fields[ours]
        if name == "value":
            made.values.setdefault(own.name, {})[theirs] = our_value
            continue
        if name == "unit":
            _require_unit(own, theirs, where)
        getattr(made, name if name == "wide" else f"{name}s")[own.name] = theirs
    return made


def _file_options(path: Path) -> Iterator[tuple[str, str, str]]:
    """Yield what a TOML file says as options say it, each with its place."""
    known = {**TABLES, **dict.fromkeys(SETTINGS)}
    content = read_toml(path, f"a mapping with the tables {', '.join(TABLES)}")
    for table, entries in content.items():
        if table in SETTINGS and not isinstance(entries, dict):
            texts = entries if isinstance(entries, list) else [entries]
            yield from ((f"{path}, {table}", table, str(text)) for text in texts)
            continue
        if table not in TABLES or not isinstance(entries, dict):
            problem = unknown_key(table, known).replace("key", "table", 1)
            right = "a text, or a list of texts" if table in SETTINGS else f"the table [{table}]"
            raise InputError(f"{path}: {f'expected {right}' if table in known else problem}")
        for ours, theirs in entries.items():
            pairs = theirs if isinstance(theirs, dict) and theirs else {"": theirs}
            for value, each in pairs.items():
                for one in each if isinstance(each, list) else [each]:
                    yield f"{path}, [{table}]", TABLES[table], f"{ours}{':' * bool(value)}{value}={one}"


def _require_setting(name: str, text: str, where: str) -> None:
    """Refuse a pattern or an encoding that is none."""
    try:
        groups = re.compile(text).groups if name == "participant_from" else 1
        "".encode(text if name == "encoding" else "utf-8")
    except (re.error, LookupError, RecursionError, OverflowError):
        groups = 0
    if groups != 1:
        right = "an encoding" if name == "encoding" else "a regular expression with one group"
        raise InputError(f"{where}: expected {right}, got {text!r}")


def _require_unit(own: _Field, unit: str, where: str) -> None:
    known = UNITS.get(own.metadata.get("unit", ""), {})
    if unit not in known:
        right = f"one of {', '.join(known)}" if known else "none: it has no unit"
        raise InputError(f"{where} {own.name}={unit}: expected {right}")

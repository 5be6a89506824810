"""What another program's columns, units and values stand for, from options or a small TOML."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import unknown_key
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.storage.text_files import read_toml

# What an option says, by its name, which is also that of its table in a TOML file but for the plural.
OPTIONS = {
    "column": "OURS=THEIRS",
    "unit": "OURS=UNIT",
    "value": "OURS:OURVALUE=THEIRVALUE",
    "constant": "OURS=VALUE",
    "wide": "OURS=PATTERN",
    "only": "THEIRS=VALUE",
}
TABLES = {"columns": "column", "units": "unit", "values": "value", "constants": "constant", "wide": "wide",
          "only": "only"}  # fmt: skip
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
_Field = dataclasses.Field[Any]


@dataclass(frozen=True, slots=True)
class ImportMapping:
    """What another program's table means; all but `only` keyed by the attribute of our record.

    Attributes
    ----------
    record : type
        Of the trials.
    columns : dict of str to str
        Their column, or a path into its JSON; empty for a column of theirs that is not to be taken.
    units : dict of str to str
        Unit of their numbers.
    values : dict of str to dict of str to str
        Our value for each of theirs.
    constants : dict of str to str
        What holds for all rows.
    wide : dict of str to str
        Pattern of columns that hold one of ours each, as `{sequence}_{version}`.
    only : dict of str to list of str
        Values of a column of theirs, of which a row must have one to be taken.
    """

    record: type[Any]
    columns: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    values: dict[str, dict[str, str]] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    wide: dict[str, str] = field(default_factory=dict)
    only: dict[str, list[str]] = field(default_factory=dict)

    @property
    def given(self) -> set[str]:
        """Our attributes that the table fills, in all of its rows or some."""
        fields = fields_by_name(self.record)
        named = (name for pattern in self.wide.values() for name in re.findall(r"\{(\w+)\}", pattern))
        in_patterns = (fields[name].name for name in named if name in fields)
        return {*self.columns, *self.constants, *self.wide, *in_patterns}


@dataclass(frozen=True, slots=True)
class ImportRequest:
    """What is imported.

    Attributes
    ----------
    paths : tuple of Path
        The files of the table, one or several.
    task : str
        One of the built-in tasks.
    mapping : ImportMapping
        What its columns mean, as far as they were named.
    display : Display or None
        What was looked at; None if unknown.
    simulated : bool
        Whether simulated observers answered.
    scale : str
        Of ratings, as `1..7`; empty if they are to show it.
    """

    paths: tuple[Path, ...]
    task: str
    mapping: ImportMapping
    display: Display | None = None
    simulated: bool = False
    scale: str = ""


def fields_by_name(record: type[Any]) -> dict[str, _Field]:
    """Return the fields of a trial's record that a table may fill, by attribute and by file key."""
    fields = [each for each in dataclasses.fields(record) if each.name != "simulated"]
    return {each.name: each for each in fields} | {file_key(each): each for each in fields}


def import_mapping(
    record: type[Any], options: Mapping[str, Iterable[str]], path: Path | None = None
) -> ImportMapping:
    """Return what options, and a TOML file, say about a table.

    Parameters
    ----------
    record : type
        Of the trials.
    options : mapping of str to iterable of str
        By names of `OPTIONS`; they override the file.
    path : Path, optional
        TOML with the tables [columns], [units], [values.OURS], [constants], [wide], [only].

    Raises
    ------
    InputError
        For a column that a trial has not, a unit that it cannot be in, or an option of another form.
    """
    mapping, fields = ImportMapping(record), fields_by_name(record)
    said = [*_file_options(path)] if path else []
    overridden = {text.partition("=")[0] for text in options.get("only", ())}
    said = [one for one in said if one[1] != "only" or one[2].partition("=")[0] not in overridden]
    said += [(f"--{name}", name, text) for name, texts in options.items() for text in texts]
    for where, name, text in said:
        ours, found, theirs = text.partition("=")
        ours, _, our_value = ours.partition(":") if name == "value" else (ours, "", "")
        if not found or not ours or (name == "value") != bool(our_value):
            raise InputError(f"{where}: expected {OPTIONS[name]}, got {text!r}")
        if name == "only":
            mapping.only.setdefault(ours, []).append(theirs)
            continue
        if ours not in fields:
            problem = unknown_key(ours, {each.name: each for each in fields.values()})
            raise InputError(f"{where} {text}: {problem.replace('key', 'column', 1)}")
        own = fields[ours]
        if name == "value":
            mapping.values.setdefault(own.name, {})[theirs] = our_value
            continue
        if name == "unit":
            _require_unit(own, theirs, where)
        getattr(mapping, name if name == "wide" else f"{name}s")[own.name] = theirs
    return mapping


def _file_options(path: Path) -> Iterable[tuple[str, str, str]]:
    content = read_toml(path, f"a mapping with the tables {', '.join(TABLES)}")
    for table, entries in content.items():
        if table not in TABLES or not isinstance(entries, dict):
            problem = unknown_key(table, TABLES).replace("key", "table", 1)
            raise InputError(f"{path}: {problem if table not in TABLES else f'expected the table [{table}]'}")
        for ours, theirs in entries.items():
            where = f"{path}, [{table}]"
            pairs = (
                {f"{ours}:{key}": each for key, each in theirs.items()} if isinstance(theirs, dict) else {}
            )
            for key, each in (pairs or {ours: theirs}).items():
                for one in each if isinstance(each, list) else [each]:
                    yield where, TABLES[table], f"{key}={one}"


def _require_unit(own: _Field, unit: str, where: str) -> None:
    known = UNITS.get(own.metadata.get("unit", ""), {})
    if unit not in known:
        right = f"one of {', '.join(known)}" if known else "none: it has no unit"
        raise InputError(f"{where} {own.name}={unit}: expected {right}")

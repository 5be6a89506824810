"""Which kind of record a file holds: told by its name, or by the keys that are in it."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from fnmatch import fnmatchcase
from pathlib import Path

from evenlight.data_schema.brightness_track import TRACK_COLUMNS
from evenlight.data_schema.mapping import keys_of
from evenlight.data_schema.record_kind import FileFormat, RecordKind
from evenlight.data_schema.record_kinds import BRIGHTNESS_TRACK, KINDS

LIKENESS = 0.5  # share of keys that a file must have in common with a record to be taken for one


def kinds_by_name(path: Path) -> list[RecordKind]:
    """Return the kinds of record that a file of this name may hold: of those with the longest pattern.

    >>> [kind.name for kind in kinds_by_name(Path("lab/my.search.design.toml"))]
    ['search_design']
    """
    fitting = {
        kind.name: max((len(p) for p in kind.file_names if fnmatchcase(path.name, p)), default=0)
        for kind in KINDS
    }
    longest = max(fitting.values())
    return [kind for kind in KINDS if longest and fitting[kind.name] == longest]


def kind_by_keys(file_format: FileFormat, keys: Collection[str]) -> RecordKind | None:
    """Return the kind of record that has most of these keys, or None if none has enough.

    A misspelt or missing key among several does not matter: the file is to be recognized, then checked.

    >>> kind_by_keys(FileFormat.TOML, {"kind", "base_power_w", "name"}).name
    'power_model'
    """
    best = likeliest((kind for kind in KINDS if kind.file_format is file_format), keys)
    return best if best and _likeness(best, keys) >= LIKENESS else None


def likeliest(kinds: Iterable[RecordKind], keys: Collection[str]) -> RecordKind | None:
    """Return which of some kinds has most of these keys; the first of several, None if there is no kind."""
    return max(kinds, key=lambda kind: _likeness(kind, keys), default=None)


def _likeness(kind: RecordKind, keys: Collection[str]) -> float:
    """Return the keys in common as a share of those found or required."""
    if kind is BRIGHTNESS_TRACK:
        known = required = set(TRACK_COLUMNS)
    else:
        known, required = map(set, keys_of(kind.record))
    return len(known & set(keys)) / max(len(required | set(keys)), 1)

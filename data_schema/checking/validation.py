"""Checking whatever is at a path: a file, a data set, a folder of results, or a folder of all these."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path

from evenlight.data_schema.checking.dataset_checks import check_dataset, is_dataset
from evenlight.data_schema.checking.file_checks import CheckedFile, check_file
from evenlight.data_schema.checking.results_checks import compare_results
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import keys_of
from evenlight.data_schema.record_kinds import KINDS, FileFormat, RecordKind
from evenlight.data_schema.storage.text_files import parse_json, read_text, read_toml
from evenlight.data_schema.tracks.brightness_track import TRACK_COLUMNS, BrightnessTrack

KNOWN = (
    "a data set (dataset_description.json, sub-* folders), results of `evenlight optimize` or "
    "`evenlight fit`, or a display, power model, rate limit or design file"
)
LIKENESS = 0.5  # share of keys that a file must have in common with a record to be taken for one


def validate(path: Path) -> Iterator[CheckedFile]:
    """Yield every file at a path, with all that is wrong with it.

    Parameters
    ----------
    path : Path
        A file; or a folder, which is searched through. A file that its name does not identify is recognized
        by its keys; files that are no record are yielded without words, hidden ones not at all.

    Raises
    ------
    InputError
        If there is nothing at the path, or a single file that is no record.
    """
    if path.is_dir():
        yield from _check_folder(path)
        return
    kind = _kind_of(path)
    if kind is None:
        read_text(path, KNOWN)  # if it cannot be read, that is what is wrong
        raise InputError(f"{path}: nothing that Evenlight knows; expected {KNOWN}")
    yield check_file(path, kind)


def _check_folder(folder: Path) -> Iterator[CheckedFile]:
    """Yield the files of a folder and of those in it."""
    if is_dataset(folder):
        yield from _check_dataset_folder(folder)
        return
    files, folders = _members(folder)
    checked = [_check_member(path) for path in files]
    compare_results(checked)
    yield from checked
    for inner in folders:
        yield from _check_folder(inner)


def _check_dataset_folder(dataset: Path) -> Iterator[CheckedFile]:
    """Yield the files of a data set, and then whatever else lies in its folders."""
    done = set()
    for checked in check_dataset(dataset):
        done.add(checked.path)
        yield checked
    waiting = [dataset]
    while waiting:
        files, folders = _members(waiting.pop(0))
        yield from (_check_member(path) for path in files if path not in done)
        waiting += folders


def _members(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the files and the folders in a folder, in order; without hidden ones, and links to folders."""
    try:
        paths = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror or error})") from error
    folders = [path for path in paths if path.is_dir()]
    return [p for p in paths if p not in folders], [p for p in folders if not p.is_symlink()]


def _check_member(path: Path) -> CheckedFile:
    """Return a file of a folder, checked if it is a record."""
    try:
        kind = _kind_of(path)
    except InputError:
        kind = None  # no record, as far as its name tells, and not readable as one
    return check_file(path, kind) if kind else CheckedFile(path, "")


def _kind_of(path: Path) -> RecordKind | None:
    """Return the kind of record that a file holds, by its name or by its keys; None if it is none."""
    named = kinds_by_name(path)
    if len(named) == 1:
        return named[0]
    formats = {f".{member.value}": member for member in FileFormat}
    found = formats.get(path.suffix.lower())
    if named and found:
        try:
            return likeliest(named, _keys_in(path, found))
        except InputError:
            return named[0]  # it is to be that, and cannot be read as anything
    return kind_by_keys(found, _keys_in(path, found)) if found else None


def _keys_in(path: Path, file_format: FileFormat) -> set[str]:
    """Return the outermost keys, or the columns, of a text file."""
    if file_format is FileFormat.TOML:
        return set(read_toml(path, KNOWN))
    text = read_text(path, KNOWN)
    if file_format is FileFormat.CSV:
        return set(next(csv.reader(io.StringIO(text[:10_000])), []))
    if file_format is FileFormat.JSON_LINES:
        text = text.partition("\n")[0]
    content = parse_json(text, str(path), KNOWN)
    return set(content) if isinstance(content, dict) else set()


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
    if kind.record is BrightnessTrack:
        known = required = set(TRACK_COLUMNS)
    else:
        known, required = map(set, keys_of(kind.record))
    return len(known & set(keys)) / max(len(required | set(keys)), 1)

"""Checking whatever is at a path: a file, a data set, a folder of results, or a folder of all these."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from evenlight.data_schema.dataset_checks import check_dataset, is_dataset
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.file_checks import CheckedFile, check_file
from evenlight.data_schema.kind_recognition import kind_by_keys, kinds_by_name, likeliest
from evenlight.data_schema.record_kind import FileFormat, RecordKind
from evenlight.data_schema.results_checks import compare_results
from evenlight.data_schema.text_files import parse_json, read_text, read_toml

KNOWN = (
    "a data set (dataset_description.json, sub-* folders), results of `evenlight optimize` or "
    "`evenlight fit`, or a display, power model, rate limit or design file"
)


def validate(path: Path) -> Iterator[CheckedFile]:
    """Yield every file at a path, with all that is wrong with it.

    Parameters
    ----------
    path : Path
        A file; or a folder, which is searched through. What its name does not say a file is told by its
        keys; files that are no record are yielded without words, hidden ones not at all.

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

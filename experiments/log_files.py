"""Folders of logs: held by one program at a time, and read back line by line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from evenlight.data_schema.append_log import sync_folder
from evenlight.data_schema.dataset_layout import LOCK
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.text_files import parse_json, read_text


def hold_folder(folder: Path) -> FileLock:
    """Return the lock of a session's folder, held; the folder is made if it is not there.

    Raises
    ------
    InputError
        If another program holds it, or it cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for parent in (folder.parent, folder.parent.parent):
            sync_folder(parent)
        lock = FileLock(folder / LOCK)
        lock.acquire(timeout=0)
    except Timeout:
        raise InputError(f"{folder}: another program is writing this session; wait until it ends") from None
    except OSError as error:
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another with --out"
        ) from error
    return lock


def read_lines(cls: type[Any], path: Path) -> list[Any]:
    """Return the records of a log, one per line; none where there is no log yet."""
    if not path.exists():
        return []
    text = read_text(path, f"one {cls.__name__} per line")
    lines = ((number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip())
    return [_record(cls, line, f"{path}, line {number}") for number, line in lines]


def _record(cls: type[Any], line: str, where: str) -> Any:
    """Return the record of one line."""
    return record_from_mapping(cls, parse_json(line, where, f"a {cls.__name__}"), where)

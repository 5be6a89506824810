"""Logs that only grow: one record per line, on the disk before the call returns."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record


class AppendLog:
    """A file of records, one per line; what is in it is never changed.

    Parameters
    ----------
    path : Path
        The file; it is made if it is not there. Its last line must be whole (`mend_last_line`).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror or error}") from error
        sync_folder(path.parent)

    def append(self, record: Any) -> None:
        """Write a record as one line, and return when it is on the disk.

        Raises
        ------
        InputError
            If it cannot be written whole, for instance on a full disk; nothing of it remains then, and what
            was in the file before stays.
        """
        line = record_line(record).encode()
        before = os.fstat(self._handle).st_size
        try:
            written = os.write(self._handle, line)
            if written < len(line):  # the disk took a part: the next attempt says why it takes no more
                os.write(self._handle, line[written:])
            os.fsync(self._handle)
        except OSError as error:
            os.ftruncate(self._handle, before)
            raise InputError(
                f"cannot write {self.path}: {error.strerror or error}; what was recorded before is safe, "
                "go on with --resume when there is room"
            ) from error

    def close(self) -> None:
        """Close the file."""
        os.close(self._handle)


def record_line(record: Any) -> str:
    """Return a record as one line of JSON, its end included."""
    return json.dumps(mapping_from_record(record), allow_nan=False, ensure_ascii=False) + "\n"


def mend_last_line(path: Path) -> str | None:
    """Make the last line of a log whole after a crash, and return what was torn off, if anything.

    A line without its end that is JSON nevertheless lacks only the end, and gets it: no record is lost. Any
    other is cut off the file and returned, for the caller to keep.
    """
    if not path.exists():
        return None
    try:
        content = path.read_bytes()
        if not content or content.endswith(b"\n"):
            return None
        start = content.rfind(b"\n") + 1
        torn = content[start:]
        with path.open("r+b") as stream:
            if _is_json(torn):
                stream.seek(0, os.SEEK_END)
                stream.write(b"\n")
                torn = b""
            else:
                stream.truncate(start)
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise InputError(f"cannot mend {path}: {error.strerror or error}") from error
    return torn.decode(errors="backslashreplace") or None


def _is_json(text: bytes) -> bool:
    """Return whether some bytes are one whole JSON object."""
    try:
        return isinstance(json.loads(text), dict)
    except ValueError:
        return False


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the system can: without its name a new file is lost."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folders
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

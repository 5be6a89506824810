"""Files that only grow, a JSON line or a table row per record: on the disk before the call returns."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.tables import columns_of, csv_text

# Windows would write another end of line, but for the last flag.
_APPENDING = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0)


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
            self._handle = os.open(path, _APPENDING, 0o666)
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
        try:
            _append_whole(self._handle, record_line(record))
        except OSError as error:
            raise InputError(
                f"cannot write {self.path}: {error.strerror or error}; what was recorded before is safe, "
                "resume when there is room"
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
        with open_input(path, "a log") as log:
            content = log.read()
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
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
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


class AppendedRows(AbstractContextManager["AppendedRows"]):
    """A new CSV table of one class of records.

    Parameters
    ----------
    path : Path
        The file; one that is there is not touched.
    cls : type
        The class of the records.

    Raises
    ------
    InputError
        If the file is there already, or cannot be made.
    """

    def __init__(self, path: Path, cls: type[Any]) -> None:
        self._path = path
        try:
            self._handle: int | None = os.open(path, _APPENDING | os.O_EXCL, 0o666)
        except FileExistsError:
            raise InputError(
                f"{path}: is there already, and measured data are never overwritten; name another file"
            ) from None
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror or error}") from None
        self._write(csv_text(columns_of(cls), []))

    def append(self, records: Iterable[Any], *, to_disk: bool = True) -> None:
        """Write records as rows, and return when they are on the disk.

        Parameters
        ----------
        records : iterable
            The records.
        to_disk : bool, optional
            Whether to wait for the disk. Without it a crash of the program loses nothing, one of the computer
            the last seconds; between two flips of a display there is no time for more.

        Raises
        ------
        InputError
            If they cannot be written whole; nothing of them remains then, and what was there before stays.
        """
        rows = [list(mapping_from_record(record).values()) for record in records]
        if rows:
            self._write(csv_text([], rows).removeprefix("\n"), to_disk=to_disk)

    def close(self) -> None:
        """Close the file; more than once does nothing."""
        if self._handle is not None:
            handle, self._handle = self._handle, None
            os.close(handle)

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self, text: str, *, to_disk: bool = True) -> None:
        if self._handle is None:
            raise ValueError(f"{self._path} is closed")
        try:
            _append_whole(self._handle, text, to_disk=to_disk)
        except OSError as error:
            raise InputError(
                f"cannot write {self._path}: {error.strerror or error}; what was read before is in it"
            ) from None


def _append_whole(handle: int, text: str, *, to_disk: bool = True) -> None:
    """Write some text at the end of a file whole, or nothing of it."""
    before = os.fstat(handle).st_size
    data = text.encode()
    try:
        while data:  # a disk may take a part: the next attempt says why it takes no more
            data = data[os.write(handle, data) :]
        if to_disk:
            os.fsync(handle)
    except OSError:
        os.ftruncate(handle, before)
        raise

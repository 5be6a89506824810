"""Tables that grow while something is measured: what has been read is on the disk, whatever happens next."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.text_files import columns_of, csv_text


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
            self._handle: int | None = os.open(
                path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL, 0o644
            )
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
        """Write some text whole, or nothing of it."""
        if self._handle is None:
            raise ValueError(f"{self._path} is closed")
        before = os.fstat(self._handle).st_size
        data = text.encode()
        try:
            while data:  # a disk may take a part: the next attempt says why it takes no more
                data = data[os.write(self._handle, data) :]
            if to_disk:
                os.fsync(self._handle)
        except OSError as error:
            os.ftruncate(self._handle, before)
            raise InputError(
                f"cannot write {self._path}: {error.strerror or error}; what was read before is in it"
            ) from None

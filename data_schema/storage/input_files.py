"""Opening files to read: plain files only, because a pipe, a device or a socket may hang or never end."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_sizes import require_size

# Opening a pipe waits for its other end, but for this flag; Windows has neither the pipes nor the flag.
_WITHOUT_WAITING = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def open_input(path: Path, what: str, most: int | None = None) -> BinaryIO:
    """Open a plain file to read its bytes.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What is expected in it, for the error.
    most : int, optional
        How large it may be [bytes].

    Raises
    ------
    InputError
        If there is none, it is something else than a plain file, it is too large, or it cannot be opened.
    """
    try:
        handle = os.open(path, os.O_RDONLY | _WITHOUT_WAITING)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected {what}") from None
    except OSError as error:
        reason = _kind_at(path) or f"cannot be read ({error.strerror or error})"
        raise InputError(f"{path}: {reason}; expected {what}") from error
    except ValueError as error:  # a null character, say
        raise InputError(f"{str(path)!r}: is no name of a file ({error}); expected {what}") from None
    found = os.fstat(handle)  # before it is a stream, which no folder can be
    try:
        if not stat.S_ISREG(found.st_mode):
            raise InputError(f"{path}: {_kind_at(path) or 'is no file'}; expected {what}")
        if most is not None:
            require_size(found.st_size, most, path, "bytes")
    except InputError:
        os.close(handle)
        raise
    return os.fdopen(handle, "rb")


def require_plain_file(path: Path, what: str) -> None:
    """Raise `InputError` where `open_input` would, for libraries that open the file themselves."""
    open_input(path, what).close()


def _kind_at(path: Path) -> str:
    """Return what is at a path instead of a plain file, in words; nothing if that cannot be told."""
    try:
        kind = _KINDS.get(stat.S_IFMT(path.stat().st_mode))
    except OSError:
        return ""
    return f"is {kind}" if kind else ""

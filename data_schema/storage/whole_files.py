"""Files and folders that appear whole, or not at all; what is on its way has a place of its own beside them.

What will be `NAME` is `.partial.NAME`, under a lock, until it is done. The system releases the lock of a
killed program, and the next to write `NAME` clears what it left.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from filelock import FileLock, Timeout

from evenlight.data_schema.errors import ArgumentError, InputError

LOCKED, PARTIAL = ".lock.{}", ".partial.{}"  # beside what is written
LONGEST_WAIT = 60.0  # [s]
BUSY = "another program is writing it; wait until it ends, or give another name"
EARLIER = ".earlier.{}"  # what is replaced, in the moment between two renames
ON_THE_WAY = tuple(name.format("") for name in (LOCKED, PARTIAL, EARLIER))  # as such names begin


def write_whole(path: Path, content: bytes | str | Iterable[bytes] | Callable[[BinaryIO], None]) -> None:
    """Write a file, given whole, in parts or by what writes it, so that it is there completely or not at all.

    Characters that are none (from file names in another encoding) are written as escapes.

    Raises
    ------
    InputError
        If the folder cannot be written, naming it and the system's reason.
    """
    if isinstance(content, str):
        content = content.encode(errors="backslashreplace")
    with _told_of(path), written_whole(path) as partial:
        handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        try:
            if callable(content):
                with os.fdopen(handle, "wb", closefd=False) as file:
                    content(file)
                content = ()
            for part in [content] if isinstance(content, bytes) else content:
                left = memoryview(part)
                while left:  # a disk may take some of it: the next attempt says why it takes no more
                    left = left[os.write(handle, left) :]
            os.fsync(handle)
        finally:
            os.close(handle)


def require_free(out: Path, *, force: bool) -> None:
    """Refuse to write over what is there, but for a file that may go."""
    if out.exists() and not (force and out.is_file()):
        right = "give `force` to replace it, or another name" if out.is_file() else "give the name of a file"
        raise ArgumentError("out", f"{out}: is there already; {right}")


def make_folder(folder: Path, mode: int = 0o777) -> None:
    """Make a folder if it is not there; raise `InputError` where it cannot be."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another folder"
        ) from error


@contextmanager
def recording_folder(folder: Path, begun: str) -> Iterator[None]:
    """Make a new or empty folder for what is recorded, and take it away if the block fails before it begins.

    Parameters
    ----------
    folder : Path
        The folder.
    begun : str
        Name of the file in it that is there as soon as something was recorded.
    """
    created = _topmost_missing(folder)
    make_folder(folder)
    try:
        yield
    except BaseException:
        if not (folder / begun).exists():
            for path in folder.iterdir():
                _remove(path)
            _remove_empty(folder, created)
        raise


@contextmanager
def written_whole(target: Path, wait: float | None = None) -> Iterator[Path]:
    """Yield where to write a file or a folder, which becomes `target` when the block ends well.

    If the block fails or is interrupted, nothing of it remains and `target` is as it was. What other programs
    see there is all of the earlier or all of the new; of a folder, between two renames, nothing.

    Parameters
    ----------
    target : Path
        What is written, and replaced if it is there.
    wait : float, optional
        How long to wait for another program that writes it [s]; else a minute.

    Raises
    ------
    InputError
        At once, before any work is done, if another program writes it, or it cannot be written.
    """
    place = Path(os.path.realpath(target))
    with held_place(place, target, LONGEST_WAIT if wait is None else wait):
        partial = place.with_name(PARTIAL.format(place.name))
        earlier = place.with_name(EARLIER.format(place.name))
        with _told_of(target):
            if not os.path.lexists(place):
                _move_if_there(earlier, place)  # killed between two renames
            _remove(partial)
            _remove(earlier)
        try:
            yield partial
            with _told_of(target):
                _put(partial, place, earlier)
        finally:
            _remove(partial)
            if os.path.lexists(place):  # else the earlier is all that there is
                _remove(earlier)


@contextmanager
def held_place(place: Path, named: Path, wait: float = 0.0) -> Iterator[None]:
    """Hold the place of a file or folder, which need not be there, against other programs.

    Folders above it are made; those that are empty at the end go again.
    """
    created = None
    try:
        with _told_of(named):
            created = _topmost_missing(place.parent)
            if place.parent.is_file():
                raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
            place.parent.mkdir(parents=True, exist_ok=True)
            lock = _locked(place.with_name(LOCKED.format(place.name)), f"{named}: {BUSY}", wait)
        try:
            yield
        finally:
            with suppress(OSError):  # Windows removes no file that is open
                Path(lock.lock_file).unlink()
            lock.release()
    finally:
        _remove_empty(place.parent, created)


def _put(partial: Path, place: Path, earlier: Path) -> None:
    if not place.is_dir() or not partial.is_dir():
        partial.replace(place)
        return
    shutil.copymode(place, partial)
    try:
        place.replace(earlier)
        partial.replace(place)
    except BaseException:
        if not place.exists():
            _move_if_there(earlier, place)
        raise


def _move_if_there(earlier: Path, place: Path) -> None:
    if earlier.exists():
        earlier.replace(place)


@contextmanager
def _told_of(named: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write {named}: {error.strerror or error}") from error


def held_lock(path: Path, busy: str, longest_wait: float = 0.0) -> FileLock:
    """Return a lock, held until its `release`; the system releases that of a killed program.

    Parameters
    ----------
    path : Path
        Its file.
    busy : str
        What is said if another program holds it all the time.
    longest_wait : float, optional
        How long to wait for it [s].

    Raises
    ------
    InputError
        If another program holds it, or its file cannot be written: in a folder of someone else, say.
    """
    try:
        return _locked(path, busy, longest_wait)
    except (OSError, NotImplementedError) as error:  # the latter of a file system without locks
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"cannot write to the folder {path.parent}: {reason}; choose another as `out`"
        ) from error


def _locked(path: Path, busy: str, longest_wait: float) -> FileLock:
    lock = FileLock(path)
    try:
        lock.acquire(timeout=longest_wait, poll_interval=0.02)
    except Timeout:
        raise InputError(busy) from None
    return lock


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _topmost_missing(folder: Path) -> Path | None:
    """Return the topmost folder that would have to be made for `folder` to be there."""
    return next((part for part in reversed([folder, *folder.parents]) if not part.exists()), None)


def _remove_empty(folder: Path, topmost: Path | None) -> None:
    """Remove the folders that were made for nothing, from `folder` up to `topmost`; none if that is None."""
    for part in (folder, *folder.parents) if topmost else ():
        with suppress(OSError):  # it was never made, or holds something of another program
            part.rmdir()
        if part == topmost:
            return

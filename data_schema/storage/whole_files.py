"""Files and folders of results that appear whole, or not at all.

A folder that a later run may replace as a whole is known by a seal: its SHA-256, in a file beside it.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file

SEAL = ".sha256"


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file so that it is there completely or not at all, whatever happens on the way.

    Characters that are none (from file names in another encoding) are written as escapes.

    Raises
    ------
    InputError
        If the folder cannot be written, naming it and the system's reason.
    """
    if isinstance(content, str):
        content = content.encode(errors="backslashreplace")
    created = None
    try:
        created = _topmost_missing(path.parent)
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            Path(name).chmod(0o644)
            Path(name).replace(path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except BaseException as error:
        _remove_empty(path.parent, created)
        if isinstance(error, OSError):
            raise InputError(f"cannot write {path}: {error.strerror or error}") from error
        raise


def make_folder(folder: Path) -> None:
    """Make a folder if it is not there; raise `InputError` where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another folder"
        ) from error


@contextmanager
def results_folder(folder: Path, replacing: Collection[str] = ()) -> Iterator[Path]:
    """Yield an empty folder for results; when the block ends well, its files are moved into `folder`.

    If the block fails or is interrupted, nothing of it remains and `folder` is as it was.

    Parameters
    ----------
    folder : Path
        Where the results go; files of the same name are replaced, others stay.
    replacing : collection of str
        Names of sub-folders of the results that replace earlier ones as a whole.

    Raises
    ------
    InputError
        At once, before any work is done, if `folder` cannot be written.
    """
    created = None
    try:
        created = _topmost_missing(folder)
        folder.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(dir=folder, prefix=".partial-"))
    except OSError as error:
        _remove_empty(folder, created)
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another folder"
        ) from error
    try:
        yield staging
        _move_into(staging, folder, replacing)
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        _remove_empty(folder, created)
        raise
    shutil.rmtree(staging, ignore_errors=True)


def _move_into(staging: Path, folder: Path, replacing: Collection[str]) -> None:
    """Move every file of the staging folder to its place; if one cannot be, put all back as they were."""
    replaced = Path(tempfile.mkdtemp(dir=staging, prefix=".replaced-"))
    undo: list[Callable[[], object]] = []
    parts = [p for p in sorted(staging.rglob("*")) if p.is_file()]
    try:
        for name in replacing:
            if (folder / name).is_dir():
                # Noted beforehand: an interruption may come between the move and the note.
                undo.append(partial(_put_back, replaced / name, folder / name))
                (folder / name).replace(replaced / name)
        for number, part in enumerate(parts):
            target = folder / part.relative_to(staging)
            _make_folders(target.parent, undo)
            if target.is_file():
                undo.append(partial(_put_back, replaced / str(number), target))
                target.replace(replaced / str(number))
            else:
                undo.append(partial(_remove_file, target))
            part.replace(target)
    except BaseException as error:
        for step in reversed(undo):
            step()
        if isinstance(error, OSError):
            raise InputError(f"cannot write to the folder {folder}: {error.strerror or error}") from error
        raise


def _put_back(earlier: Path, target: Path) -> None:
    """Move something back to its place, unless it has not left it."""
    if earlier.exists():
        earlier.replace(target)


def _remove_file(path: Path) -> None:
    """Remove a file if it is there; a folder in its place is not ours."""
    if path.is_file():
        path.unlink()


def _make_folders(folder: Path, undo: list[Callable[[], object]]) -> None:
    """Make a folder and those above it, and note how to undo it."""
    for part in reversed([folder, *folder.parents]):
        if not part.exists():
            undo.append(partial(_remove_folder, part))
            part.mkdir()


def _remove_folder(path: Path) -> None:
    """Remove a folder, unless it was never made or holds something of another program."""
    with suppress(OSError):
        path.rmdir()


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


def seal(folder: Path) -> None:
    """Write the SHA-256 of a folder beside it: `NAME.sha256`."""
    write_whole(_seal_of(folder), sha256_of_file(folder) + "\n")


def require_sealed(folder: Path, maker: str) -> None:
    """Raise `InputError` if a folder that is to be replaced holds what its maker did not make, or is changed.

    Parameters
    ----------
    folder : Path
        Which would be replaced; it need not be there.
    maker : str
        What makes such folders, for the message.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    beside = _seal_of(folder)
    if not beside.is_file() or beside.read_text(errors="replace").strip() != sha256_of_file(folder):
        raise InputError(
            f"{folder} holds data that no {maker} made, or that were changed since; choose another folder"
        )


def _seal_of(folder: Path) -> Path:
    """Return the file that holds the seal of a folder."""
    return folder.with_name(folder.name + SEAL)

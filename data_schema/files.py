"""Writing without halves: a file or a folder of results appears whole, or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from data_schema.errors import InputError


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file so that it is there completely or not at all, whatever happens on the way.

    Raises
    ------
    InputError
        If the folder cannot be written, naming it and the system's reason.
    """
    if isinstance(content, str):
        content = content.encode()
    try:
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
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error


@contextmanager
def results_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder for results; when the block ends well, its files are moved into `folder`.

    If the block fails or is interrupted, nothing of it remains and `folder` is as it was.

    Raises
    ------
    InputError
        At once, before any work is done, if `folder` cannot be written.
    """
    created = None
    try:
        created = next((p for p in reversed([folder, *folder.parents]) if not p.exists()), None)
        folder.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(dir=folder, prefix=".partial-"))
    except OSError as error:
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another with --out"
        ) from error
    try:
        yield staging
        _move_into(staging, folder)
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        if created is not None:
            _remove_empty(folder, created)
        raise


def _move_into(staging: Path, folder: Path) -> None:
    """Move every file of the staging folder to its place, then remove it."""
    try:
        for part in sorted(p for p in staging.rglob("*") if p.is_file()):
            target = folder / part.relative_to(staging)
            target.parent.mkdir(parents=True, exist_ok=True)
            part.replace(target)
    except OSError as error:
        raise InputError(f"cannot write to the folder {folder}: {error.strerror or error}") from error
    shutil.rmtree(staging)


def _remove_empty(folder: Path, topmost: Path) -> None:
    """Remove the folders that were created for nothing, from `folder` up to `topmost`."""
    for part in (folder, *folder.parents):
        try:
            part.rmdir()
        except OSError:
            return
        if part == topmost:
            return

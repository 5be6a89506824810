"""Files and folders of results that appear whole, or not at all.

A folder that a later run may replace as a whole is known by a seal: its SHA-256, in a file beside it.
"""

from __future__ import annotations

import glob
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.provenance import sha256_of_file

SEAL = ".sha256"
TRIES = 3  # to put a folder in the place of another
_PARTIAL = re.compile(r"\.partial-[a-z0-9_]{8}")  # as `tempfile` makes them


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


def require_free(out: Path, *, force: bool) -> None:
    """Refuse to write over what is there, but for a file that may go."""
    if out.exists() and not (force and out.is_file()):
        right = "give `force` to replace it, or another name" if out.is_file() else "give the name of a file"
        raise ArgumentError("out", f"{out}: is there already; {right}")


def make_folder(folder: Path) -> None:
    """Make a folder if it is not there; raise `InputError` where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
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
                _remove_file(path)
            _remove_empty(folder, created)
        raise


@contextmanager
def results_folder(folder: Path, replacing: Collection[str] = ()) -> Iterator[Path]:
    """Yield an empty folder for results; when the block ends well, its files are moved into `folder`.

    If the block fails or is interrupted, nothing of it remains and `folder` is as it was. What a run that
    was killed left there goes when the next one begins.

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
        staging, held = _staging_in(folder)
    except OSError as error:
        _remove_empty(folder, created)
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another folder"
        ) from error
    try:
        yield staging
        _move_into(staging, folder, replacing)
        created = None
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if held is not None:
            os.close(held)
        _remove_empty(folder, created)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder that takes the place of `folder` in one step when the block ends well.

    What another process sees there is all of the earlier folder or all of the new one; for the moment between
    two renames, nothing.

    Parameters
    ----------
    folder : Path
        What is replaced; what it holds is gone then. It need not be there.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    make_folder(folder.parent)
    try:
        _bring_back(folder)
        staging, held = _staging_in(folder.parent)
    except OSError as error:
        raise InputError(f"cannot write to the folder {folder.parent}: {error.strerror or error}") from error
    fresh = staging / "fresh"
    try:
        fresh.mkdir()
        yield fresh
        _swap(fresh, folder, staging)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if held is not None:
            os.close(held)


def _swap(fresh: Path, folder: Path, staging: Path) -> None:
    for tries in range(TRIES):  # another process may do the same at the same time
        earlier = Path(tempfile.mkdtemp(dir=staging, prefix=".replaced-")) / folder.name
        try:
            if folder.exists():
                folder.replace(earlier)
            fresh.replace(folder)
        except BaseException as error:
            if not folder.exists():
                _put_back(earlier, folder)
            if not isinstance(error, OSError):
                raise
            if tries == TRIES - 1:
                raise InputError(f"cannot write the folder {folder}: {error.strerror or error}") from error
        else:
            return


def _bring_back(folder: Path) -> None:
    """Bring back a folder whose replacement was killed between its two renames."""
    for earlier in folder.parent.glob(f".partial-*/.replaced-*/{glob.escape(folder.name)}"):
        partial_folder = earlier.parents[1]
        if folder.exists() or not is_partial(partial_folder):
            continue
        with suppress(OSError):  # it is held: its process is between the two
            held = _held(partial_folder)
            earlier.replace(folder)
            if held is not None:
                os.close(held)


def _staging_in(folder: Path) -> tuple[Path, int | None]:
    """Make a folder for results to come, and clear those that killed runs left beside it.

    Returns it with the handle that holds its lock, which the system lets go however the run ends. It gets
    its name when it is held: whatever has such a name and is not held is dead.
    """
    for left in folder.glob(".partial-*"):
        # Earlier results lie in it if the run was killed while it put its own in their place: they stay.
        if is_partial(left) and not any(left.glob(".replaced-*/*")):
            with suppress(OSError):
                dead = _held(left)
                if dead is not None:
                    shutil.rmtree(left, ignore_errors=True)
                    os.close(dead)
    fresh = folder / Path(tempfile.mkdtemp(dir=folder, prefix=".begun-")).name  # absolute since Python 3.12
    held = None
    with suppress(OSError):  # a file system without locks: what is left there stays
        held = _held(fresh)
    staging = fresh.with_name(fresh.name.replace(".begun-", ".partial-"))
    return fresh.rename(staging), held


def is_partial(path: Path) -> bool:
    """Return whether something is a folder for results that were still to come when their run was killed."""
    return bool(_PARTIAL.fullmatch(path.name)) and path.is_dir() and not path.is_symlink()


def _held(folder: Path) -> int | None:
    """Return a handle of a folder that no other program holds; None where the system has no such locks.

    Raises
    ------
    OSError
        If another program holds it.
    """
    try:
        import fcntl
    except ImportError:  # on Windows
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise
    return handle


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
    if not beside.is_file() or beside.read_text(encoding="utf-8", errors="replace").strip() != sha256_of_file(
        folder
    ):
        raise InputError(
            f"{folder} holds data that no {maker} made, or that were changed since; choose another folder"
        )


def _seal_of(folder: Path) -> Path:
    return folder.with_name(folder.name + SEAL)

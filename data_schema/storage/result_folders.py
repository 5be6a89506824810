"""Folders of results: each appears whole, and takes the place of an earlier result of its command only.

`SHA256SUMS` in it names the command and binds the files: `sha256sum -c SHA256SUMS` checks them.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.whole_files import (
    ON_THE_WAY,
    held_place,
    make_folder,
    write_whole,
    written_whole,
)

SUMS = "SHA256SUMS"
OF_SYSTEM = (".DS_Store", "Thumbs.db", "desktop.ini")  # desktops leave them in any folder
NAMED = 4  # files that a refusal names
_MADE_BY = "# evenlight "  # as the first line begins


@dataclass(frozen=True, slots=True)
class Asked:
    """What a command was asked, whose results go to a folder."""

    out: Path
    inputs: tuple[Path, ...]  # files and folders that were named; those that lie in `out` stay there
    write: Callable[[Path], None]  # writes what was asked into the results, before they appear


_asked: ContextVar[Asked | None] = ContextVar("asked", default=None)


@contextmanager
def result_folder(out: Path, command: str, *, force: bool = False, wait: float = 0.0) -> Iterator[Path]:
    """Yield an empty folder for results, which takes the place of `out` when the block ends well.

    A file in `out` that was named to the command, such as the film of a track, stays there.

    Parameters
    ----------
    out : Path
        Where the results go.
    command : str
        What makes them: an earlier result of it is replaced.
    force : bool, optional
        Whether anything else that is there is removed, too; standard error says what.
    wait : float, optional
        How long to wait for another program that writes there [s].

    Raises
    ------
    InputError
        At once, before any work is done, if `out` holds anything else, or cannot be written.
    """
    _require_apart(out)
    with written_whole(out, wait) as folder:
        before = _others_in(out, command)
        kept = [name for name in before if _is_input(out / name, out)]
        _require_own(out, command, [name for name in before if name not in kept], force=force)
        folder.mkdir()
        yield folder
        _write_asked(out, folder)
        _write_sums(folder, command)
        later = [name for name in _others_in(out, command) if name not in before]
        for name in (*kept, *later):  # what came meanwhile is not lost either
            _carry_over(out / name, folder / name, force=force)
        _tell_removed(out, [name for name in before if name not in kept])


@contextmanager
def growing_folder(out: Path, command: str, files: Collection[str], *, force: bool = False) -> Iterator[None]:
    """Hold a folder in which each result of a command is a folder, beside some files about all of them.

    Parameters
    ----------
    out, command, force : Path, str, bool
        As of `result_folder`.
    files : collection of str
        Names of the files beside the results.
    """
    _require_apart(out)
    with held_place(Path(os.path.realpath(out)), out):
        others = _others_beside(out, command, files)
        _require_own(out, command, others, force=force)
        for name in others:
            (out / name).unlink(missing_ok=True)
        _tell_removed(out, others)
        make_folder(out)
        _write_sums(out, command, names=())
        yield
        _write_asked(out, out)


@contextmanager
def asked_of_command(asked: Asked) -> Iterator[None]:
    """Let a command's results know what was asked of it."""
    token = _asked.set(asked)
    try:
        yield
    finally:
        _asked.reset(token)


@contextmanager
def new_folder(folder: Path, there: str) -> Iterator[Path]:
    """Yield an empty folder for data, which appears under its own name when the block ends well.

    Only its owner can read it, unless it was there before, empty, with other permissions.

    Parameters
    ----------
    folder : Path
        A folder that is not there, or empty.
    there : str
        What is said if it holds anything.

    Raises
    ------
    InputError
        If it holds anything, or cannot be written.
    """
    _require_apart(folder)
    with written_whole(folder, wait=0.0) as fresh:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(there)
        fresh.mkdir(0o700)
        yield fresh


def _write_asked(out: Path, folder: Path) -> None:
    asked = _asked.get()
    if asked is not None and asked.out == out:
        asked.write(folder)


def _is_input(path: Path, out: Path) -> bool:
    """Return whether a file in `out` was named to the command, itself or by a folder around it."""
    asked = _asked.get()
    if asked is None or asked.out != out:
        return False
    own = {path.resolve(), *path.resolve().parents} - {out.resolve(), *out.resolve().parents}
    return not own.isdisjoint(named.resolve() for named in asked.inputs)


def _carry_over(path: Path, target: Path, *, force: bool) -> None:
    if target.exists():  # the sums have the new one: of loss curves, say
        if not force:
            raise InputError(f"{path}: a result has its name; give another folder, or `force` to replace it")
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        target.hardlink_to(path)
    except OSError:  # a file system without links
        shutil.copy2(path, target)


def files_in(folder: Path) -> tuple[str, ...]:
    """Return the files of a folder of results, as paths below it."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_symlink() or not path.is_dir())
    return tuple(path.relative_to(folder).as_posix() for path in paths if path.name not in OF_SYSTEM)


def _require_apart(out: Path) -> None:
    """Refuse a folder that cannot become another one: that of the user, or of a disk."""
    place, home = Path(os.path.realpath(out)), Path(os.path.expanduser("~"))  # noqa: PTH111 - there may be none
    if any(own == place or place in own.parents for own in (Path.cwd(), home)) or os.path.ismount(place):
        raise ArgumentError(
            "out", f"{out}: is a folder in use; give the name of one to make, such as {out / 'results'}"
        )


def _require_own(out: Path, command: str, others: list[str], *, force: bool) -> None:
    if others and not force:
        raise ArgumentError(
            "out",
            f"{out}: holds other things than a result of `evenlight {command}`: {_listed(others)}; what is "
            "new or changed there would be lost: give another folder, or `force` to remove it",
        )


def _tell_removed(out: Path, others: list[str]) -> None:
    if others:
        print(f"evenlight: note: {out}: removed {_listed(others)}", file=sys.stderr)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _others_in(out: Path, command: str) -> list[str]:
    """Return the files in a folder that no earlier result of a command has, or not so."""
    if not out.exists():
        return []
    if not out.is_dir():
        raise ArgumentError("out", f"{out}: is a file; give the name of a folder")
    own = _sums_of(out, command) or {}
    return [
        name
        for name in files_in(out)
        if name != SUMS
        and (name not in own or (out / name).is_symlink() or own[name] != sha256_of_file(out / name))
    ]


def _others_beside(out: Path, command: str, files: Collection[str]) -> list[str]:
    """Return the files of a growing folder that are in no result, and not among those beside the results."""
    own = files if _sums_of(out, command) is not None else ()
    results = {
        path.parent for path in out.rglob(SUMS) if path.parent != out and _sums_of(path.parent, command)
    }
    loose = [name for name in files_in(out) if results.isdisjoint((out / name).parents)]
    done = [name for name in loose if not any(part.startswith(ON_THE_WAY) for part in Path(name).parts)]
    return [name for name in done if name not in (*own, SUMS)]


def changed_in(folder: Path) -> list[str]:
    """Return the files of a result that are others than when it was written; one may have been removed."""
    known = _sums_of(folder) or {}
    return [
        name
        for name, sum_ in known.items()
        if (folder / name).is_file() and sha256_of_file(folder / name) != sum_
    ]


def _sums_of(folder: Path, command: str = "") -> dict[str, str] | None:
    """Return the files of a result with their SHA-256; None if there is no result of the command."""
    if not (folder / SUMS).is_file():
        return None
    with open_input(folder / SUMS, "the files of a result") as stream:
        first, *lines = stream.read().decode(errors="surrogateescape").split("\n")
    if not first.startswith(f"{_MADE_BY}{command}" + ":" * bool(command)):
        return None
    return {_plain(line): line.removeprefix("\\")[:64] for line in lines if line}


def _write_sums(folder: Path, command: str, names: Collection[str] | None = None) -> None:
    lines = [f"{_MADE_BY}{command}: the files of this result; a folder that holds others is not replaced"]
    for name in files_in(folder) if names is None else names:
        line = f"{sha256_of_file(folder / name)}  {name}"
        escaped = line.replace("\\", r"\\").replace("\n", r"\n")
        lines.append(line if escaped == line else f"\\{escaped}")
    write_whole(folder / SUMS, "".join(f"{line}\n" for line in lines).encode(errors="surrogateescape"))


def _plain(line: str) -> str:
    """Return the name in a line of `sha256sum`, which begins with a backslash where the name is escaped."""
    if not line.startswith("\\"):
        return line[66:]
    return line[67:].replace(r"\\", "\0").replace(r"\n", "\n").replace("\0", "\\")

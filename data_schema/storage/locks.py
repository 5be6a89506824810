"""Locks of folders: one program at a time writes a session or a data set."""

from __future__ import annotations

from pathlib import Path

from filelock import FileLock, Timeout

from evenlight.data_schema.errors import InputError


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
    lock = FileLock(path)
    try:
        lock.acquire(timeout=longest_wait)
    except Timeout:
        raise InputError(busy) from None
    except (OSError, NotImplementedError) as error:  # the latter of a file system without locks
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"cannot write to the folder {path.parent}: {reason}; choose another with --out"
        ) from error
    return lock

"""Arrays that take long to make, kept in the user's cache between runs; it may be deleted at any time."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

OLD = 14 * 86400.0  # [s]
LONGEST_WAIT = 300.0  # [s] for another process that makes the same


def cache_folder() -> Path:
    """Return where the arrays are kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "evenlight"


def kept(name: str) -> NDArray[Any] | None:
    """Return the array that was kept under a name, or None if there is none that can be read."""
    try:
        array: NDArray[Any] = np.load(cache_folder() / f"{name}.npy", allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    return array


@contextlib.contextmanager
def one_at_a_time(group: str) -> Iterator[None]:
    """Let one process at a time make what is kept under the names of a group; the next finds it made.

    Where there can be no lock, or the other takes too long, both make it.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, Timeout):
            cache_folder().mkdir(parents=True, exist_ok=True)
            lock = FileLock(cache_folder() / f"{group}.lock")
            lock.acquire(timeout=LONGEST_WAIT)
            stack.callback(lock.release)
        yield


def keep(name: str, array: NDArray[Any], instead_of: str) -> None:
    """Keep an array under a name, as a whole or not at all, and let go of old ones with names of a pattern.

    Where that cannot be, it is made anew next time.
    """
    folder = cache_folder()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".part", delete=False) as part:
            try:
                np.save(part, array)
                part.close()
                Path(part.name).chmod(0o644)
                Path(part.name).replace(folder / f"{name}.npy")
            except BaseException:
                Path(part.name).unlink(missing_ok=True)
                raise
        for old in folder.glob(f"{instead_of}.npy"):
            # Another version of Evenlight may be in use beside this one, and keep its own.
            if time.time() - old.stat().st_mtime > OLD:
                old.unlink(missing_ok=True)

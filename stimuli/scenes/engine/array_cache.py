"""Arrays that take long to make, in the user's cache between runs, and the sources that they are made from.

The cache may be deleted at any time.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.stimuli import fractal_noise, sequence_format, shaders

OLD = 14 * 86400.0  # [s]
LONGEST_WAIT = 300.0  # [s] for another process that makes the same
SCENES = Path(__file__).parents[1]


def cache_folder() -> Path:
    """Return where the arrays are stored: in XDG_CACHE_HOME if set, else where the system has caches."""
    own = {"win32": "AppData/Local", "darwin": "Library/Caches"}.get(sys.platform, ".cache")
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / own) / "evenlight"


def cached_array(name: str) -> NDArray[Any] | None:
    """Return the array that was stored under a name, or None if there is none that can be read."""
    try:
        array: NDArray[Any] = np.load(cache_folder() / f"{name}.npy", allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    return array


@contextlib.contextmanager
def one_at_a_time(group: str) -> Iterator[None]:
    """Let one process at a time make what is stored under the names of a group; the next finds it made.

    Where there can be no lock, or the other takes too long, both make it.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, Timeout):
            cache_folder().mkdir(parents=True, exist_ok=True)
            lock = FileLock(cache_folder() / f"{group}.lock")
            lock.acquire(timeout=LONGEST_WAIT)
            stack.callback(lock.release)
        yield


def store_array(name: str, array: NDArray[Any], instead_of: str) -> None:
    """Store an array under a name, whole or not at all, and delete old ones with names of a pattern.

    Where that fails, the array is made again next time.
    """
    folder, content = cache_folder(), io.BytesIO()
    np.save(content, array)
    with contextlib.suppress(OSError, InputError):
        write_whole(folder / f"{name}.npy", content.getvalue())
        for old in folder.glob(f"{instead_of}.npy"):
            # Another version of Evenlight may be in use beside this one, and keep its own.
            if time.time() - old.stat().st_mtime > OLD:
                old.unlink(missing_ok=True)


@cache
def scenes_sha256() -> str:
    """Return the SHA-256 of the scenes' source: geometry, textures, light, drawing, encoding.

    What other packages do, and the graphics driver, is not in it: provenance has their versions.
    """
    digest = hashlib.sha256()
    files = [*sorted(SCENES.rglob("*.py")), *sorted(shaders.FOLDER.glob("*.glsl"))]
    for file in [*files, Path(fractal_noise.__file__), Path(sequence_format.__file__)]:
        name = file.relative_to(SCENES.parent).as_posix()
        digest.update(name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def light_sources() -> list[Path]:
    """Return the source files that compute the light: light that is stored is valid for these alone."""
    folder = SCENES / "engine" / "light"
    others = {folder / "seen_patches.py", folder / "found_ground.py"}  # which look at patches alone
    return sorted({*folder.glob("*.py")} - others)

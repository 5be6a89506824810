"""How large inputs may be, checked by what their headers say before memory is taken.

A small file may promise gigabytes. `--large-ok` lifts the limits, as does its variable of the environment.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, BinaryIO

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from numpy.lib.npyio import NpzFile

LARGE_OK = "EVENLIGHT_LARGE_OK"
MOST_PIXELS = 1 << 26  # of a frame, an image or a texture: 8192 x 8192
MOST_SCENE_PIXELS = 1 << 28  # of the textures of a scene together: 16 of 4096 x 4096
MOST_NUMBERS = 1 << 24  # of an array in loss curves: 8 hours at 30 frames a second, at 19 factors
MOST_BYTES = 1 << 28  # of a table, a text or a glTF file: 256 MiB; films have no limit


def most_allowed(most: int) -> int:
    """Return a limit; what no file reaches where large ones are allowed."""
    return 1 << 62 if os.environ.get(LARGE_OK) else most


def require_size(found: int, most: int, where: object, of: str) -> None:
    """Raise `InputError` if something is larger than may be.

    >>> require_size(8, 7, "a.png", "pixels")
    Traceback (most recent call last):
    evenlight.data_schema.errors.InputError: a.png: it has 8 pixels; need at most 7, or `large_ok`
    """
    if found > most_allowed(most):
        raise InputError(f"{where}: it has {found} {of}; need at most {most}, or `large_ok`")


def require_array_size(stream: BinaryIO, most: int, where: object) -> None:
    """Raise `InputError` if an array in NumPy's format has more numbers than may be, by its header."""
    import numpy as np

    form = np.lib.format
    read = {1: form.read_array_header_1_0, 2: form.read_array_header_2_0}
    shape, _, kind = read[form.read_magic(stream)[0]](stream)
    require_size(-(-kind.itemsize // 8) * int(np.prod(shape, dtype=object)), most, where, "numbers")


def require_array_sizes(arrays: NpzFile, most: int, where: object) -> None:
    """Raise `InputError` if an array in an npz file has more numbers than may be."""
    archive: Any = arrays.zip
    for name in archive.namelist():
        with archive.open(name) as stream:
            require_array_size(stream, most, where)

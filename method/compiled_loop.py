"""Loops that Numba compiles once per machine, and again when any source changes that they may be made of."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.codegen import get_host_cpu_features

# Vectors as wide as the registers, for all that Numba compiles hereafter. LLVM takes 256 of 512 bits, as the
# first processors that had 512 slowed down with them; those with VBMI2 (from 2019 on) do not.
_config, _features = cast(Any, numba.config), cast(Any, get_host_cpu_features)()
if _config.CPU_FEATURES is None and "+avx512vbmi2" in _features:
    _config.CPU_FEATURES = f"{_features},-prefer-256-bit"

Loop = TypeVar("Loop", bound=Callable[..., Any])


def compiled_loop(**options: Any) -> Callable[[Loop], Loop]:
    """Return a decorator that compiles a loop, with options of `numba.njit`, and keeps its machine code.

    Numba looks only whether the file that a loop stands in has changed, not those of the loops and constants
    that it uses. Here they count too: a loop uses none but those of the modules in its own folder.
    """

    def decorate(function: Loop) -> Loop:
        loop = numba.njit(cache=True, **options)(function)
        if loop is not function:  # with NUMBA_DISABLE_JIT it is
            kept = loop._cache._cache_file
            sources = _sources_sha256(Path(function.__code__.co_filename).parent)
            kept._source_stamp = kept._source_stamp, sources
        return cast(Loop, loop)

    return decorate


@cache
def _sources_sha256(folder: Path) -> str:
    """Return the SHA-256 of what the constants and the loops of a folder's modules are made of."""
    digest = hashlib.sha256(np.__version__.encode())
    for file in (Path(__file__), *sorted(folder.glob("*.py"))):
        digest.update(f"{file.name}\0".encode() + file.read_bytes())
    return digest.hexdigest()

"""Whether the graphics processor has done what it was given, without waiting for it.

moderngl has no fences: OpenGL's own (3.2 and later) are called. Where they cannot be found, time must do:
what was given is taken for done when one asks for the second time, a refresh later than the first.
"""

from __future__ import annotations

import contextlib
import ctypes
import sys
from functools import lru_cache
from typing import Any, NamedTuple

_COMMANDS_COMPLETE, _FLUSH = 0x9117, 0x1
_SIGNALED = (0x911A, 0x911C)  # already, or while it was asked
_LIBRARIES = ("libOpenGL.so.0", "libGL.so.1")  # each hands on to the thread's context, of EGL or of GLX
_PATIENCE = 2  # times that one is asked without fences


class _Calls(NamedTuple):
    """OpenGL's functions."""

    fence: Any
    wait: Any
    delete: Any


class Fence:
    """Behind all that the thread's context has been given so far; of that thread only."""

    def __init__(self) -> None:
        calls = _calls()
        self._asked = 0
        self._sync = None if calls is None else calls.fence(_COMMANDS_COMPLETE, 0)

    def passed(self) -> bool:
        """Return whether all before it is done; never waits."""
        calls = _calls()
        self._asked += 1
        if calls is None or not self._sync:
            return self._asked >= _PATIENCE
        return calls.wait(self._sync, _FLUSH, 0) in _SIGNALED

    def release(self) -> None:
        """Let go of it."""
        calls = _calls()
        if calls is not None and self._sync:
            calls.delete(self._sync)
        self._sync = None


@lru_cache(maxsize=1)
def _calls() -> _Calls | None:
    """Return the functions, or None where they cannot be found."""
    if sys.platform == "win32":
        return None  # there each context has its own, and moderngl does not tell which
    for name in _LIBRARIES:
        with contextlib.suppress(OSError, AttributeError):
            library = ctypes.CDLL(name)
            fence, wait, delete = library.glFenceSync, library.glClientWaitSync, library.glDeleteSync
            fence.restype, fence.argtypes = ctypes.c_void_p, [ctypes.c_uint, ctypes.c_uint]
            wait.restype, wait.argtypes = ctypes.c_uint, [ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64]
            delete.restype, delete.argtypes = None, [ctypes.c_void_p]
            return _Calls(fence, wait, delete)
    return None

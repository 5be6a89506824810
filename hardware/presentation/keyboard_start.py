"""How the driver of PsychoPy's keyboard starts under Linux without bringing Python down."""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

STARTING = 0.2  # in which the driver's thread has started, on a busy machine too [s]


@contextmanager
def safe_keyboard_start() -> Iterator[None]:
    """Hold the interpreter's lock while PsychHID's thread starts, for a keyboard that is opened within.

    Where a user may not have real-time priority, that thread says so on standard output, and does not take
    the lock: Python crashed in two of five starts.
    """
    try:
        hid = importlib.import_module("psychtoolbox.hid") if sys.platform == "linux" else None
    except ImportError:
        hid = None
    if hid is None:
        yield
        return
    start, library = hid.Keyboard.queue_start, ctypes.PyDLL(None)  # calls through PyDLL keep the lock

    def held(device: Any) -> None:
        start(device)
        library.usleep(round(STARTING * 1e6))

    hid.Keyboard.queue_start = held
    try:
        yield
    finally:
        hid.Keyboard.queue_start = start

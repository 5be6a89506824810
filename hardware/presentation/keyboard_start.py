"""How the driver of PsychoPy's keyboard starts under Linux without bringing Python down."""

from __future__ import annotations

import ctypes
import importlib
import io
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

LAST_WORDS = "realtime priority"  # of what the thread says where it may not have any
LOOKS = 100_000  # microseconds to one look at what it said: rarely in the midst of its words
PATIENCE = 5.0  # for its words to come, on a busy machine too [s]


@contextmanager
def safe_keyboard_start() -> Iterator[None]:
    """Keep the interpreter's lock while PsychHID's thread starts, for a keyboard that is opened within.

    Where a user may not have real-time priority, that thread says so with Python's `print` and does not take
    the lock first: Python crashes unless the thread that started it has it then. What it says is caught.
    """
    try:
        hid = importlib.import_module("psychtoolbox.hid") if sys.platform == "linux" else None
    except ImportError:
        hid = None
    if hid is None or _may_have_priority():
        yield
        return
    start = hid.Keyboard.queue_start
    hid.Keyboard.queue_start = lambda device: _started(start, device)
    try:
        yield
    finally:
        hid.Keyboard.queue_start = start


def _may_have_priority() -> bool:
    """Return whether a thread may have real-time priority: one tries."""
    granted = []

    def ask() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(os.sched_get_priority_min(os.SCHED_RR)))
            granted.append(True)
        except OSError:
            granted.append(False)

    asking = threading.Thread(target=ask)
    asking.start()
    asking.join()
    return granted[0]


def _started(start: Any, device: Any) -> None:
    """Start the queue of a keyboard, and keep the lock until its thread has said what it lacks."""
    library, interval = ctypes.PyDLL(None), sys.getswitchinterval()  # calls through PyDLL keep the lock
    sys.setswitchinterval(2 * PATIENCE)  # no other thread of Python is given it either
    try:
        with redirect_stdout(io.StringIO()) as said:
            start(device)
            for _ in range(round(PATIENCE * 1e6 / LOOKS)):
                library.usleep(LOOKS)
                if LAST_WORDS in said.getvalue():
                    library.usleep(LOOKS)
                    break
    finally:
        sys.setswitchinterval(interval)

"""How the driver of PsychoPy's keyboard starts under Linux without bringing Python down."""

from __future__ import annotations

import ctypes
import importlib
import os
import platform
import struct
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from typing import Any

SET_SCHEDULER = {"x86_64": 144, "aarch64": 119}  # numbers of the system call sched_setscheduler
NO_NEW_PRIVILEGES, SECCOMP, FILTER = 38, 22, 2  # of prctl(2)
LOAD, EQUAL, RETURN = 0x20, 0x15, 0x06  # instructions of a filter
ALLOW, ANSWER_ZERO = 0x7FFF0000, 0x00050000  # what a filter returns
LATEST_WORDS = 2_000_000  # microseconds until a thread that was not quietened has surely spoken


@contextmanager
def safe_keyboard_start() -> Iterator[None]:
    """Start PsychHID's thread without its complaint, for a keyboard that is opened within.

    Where that thread may not have more priority than the process (a user without real-time priority, a
    process that has the highest), it says so with Python's `print` and does not take the interpreter's lock
    first, of which Python crashes. Here its request for priority is answered as granted, with no effect but
    that it says nothing (seccomp(2)); elsewhere nothing changes.
    """
    try:
        hid = importlib.import_module("psychtoolbox.hid") if sys.platform == "linux" else None
    except ImportError:
        hid = None
    if hid is None or _in_a_thread(_gets_priority):
        yield
        return
    start = hid.Keyboard.queue_start
    hid.Keyboard.queue_start = lambda device: _in_a_thread(lambda: _start_quietly(start, device))
    try:
        yield
    finally:
        hid.Keyboard.queue_start = start


def _in_a_thread(act: Callable[[], Any]) -> Any:
    """Return what a function returns, or raise what it raises, in a thread of its own that then ends."""
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(act).result()


def _gets_priority() -> bool:
    """Ask for what PsychHID's thread asks for, one above its own priority; return whether it was granted."""
    own = os.sched_getparam(0).sched_priority
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(own + 1))
    except OSError:
        return False
    return True


def _start_quietly(start: Callable[[Any], Any], device: Any) -> None:
    """Start the queue of a keyboard, whose thread inherits the filter of the one that starts it."""
    if _answer_requests_for_priority():
        start(device)
        return
    with redirect_stdout(StringIO()):  # writing there keeps the lock, as calls through PyDLL do
        start(device)
        ctypes.PyDLL(None).usleep(LATEST_WORDS)


def _answer_requests_for_priority() -> bool:
    """Have the system answer this thread's later requests for a priority with 0; return whether it does."""
    number = SET_SCHEDULER.get(platform.machine())
    if number is None:
        return False
    steps = [(LOAD, 0, 0, 0), (EQUAL, 0, 1, number), (RETURN, 0, 0, ANSWER_ZERO), (RETURN, 0, 0, ALLOW)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    program = ctypes.create_string_buffer(struct.pack("HP", len(steps), ctypes.addressof(code)))
    control = ctypes.CDLL(None).prctl
    return bool(control(NO_NEW_PRIVILEGES, 1, 0, 0, 0) == 0 and control(SECCOMP, FILTER, program) == 0)

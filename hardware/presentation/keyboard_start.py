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
from contextlib import contextmanager, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any

SET_SCHEDULER = {"x86_64": 144, "aarch64": 119}  # numbers of the system call sched_setscheduler
NO_NEW_PRIVILEGES, SECCOMP, FILTER = 38, 22, 2  # of prctl(2)
LOAD, EQUAL, RETURN = 0x20, 0x15, 0x06  # instructions of a filter
ALLOW, ANSWER_ZERO = 0x7FFF0000, 0x00050000  # what a filter returns
THREADS = Path("/proc/self/task")
LATEST_WORDS = 2_000_000  # microseconds until a thread that was not quietened has surely spoken


@contextmanager
def safe_keyboard_start() -> Iterator[None]:
    """Start PsychHID's thread without its complaint, for a keyboard that is opened within.

    Where that thread may not have more priority than the process (a user without real-time priority, a
    process that has the highest), it says so with Python's `print` and does not take the interpreter's lock
    first, of which Python crashes. So its request for priority is answered as granted, with no effect
    (seccomp(2)), and the thread is given that priority from here, where it may have it.
    """
    try:
        hid = importlib.import_module("psychtoolbox.hid") if sys.platform == "linux" else None
    except ImportError:
        hid = None
    if hid is None:
        yield
        return
    start = hid.Keyboard.queue_start

    def start_without_a_word(device: Any) -> None:
        before = set(THREADS.iterdir())
        # PsychHID's thread inherits the filter of the one that starts it.
        with ThreadPoolExecutor(1) as threads:
            threads.submit(_start_quietly, start, device).result()
        above_own = os.sched_getparam(0).sched_priority + 1
        priority = os.sched_param(min(above_own, os.sched_get_priority_max(os.SCHED_FIFO)))
        for thread in set(THREADS.iterdir()) - before:
            with suppress(OSError):
                os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, priority)

    hid.Keyboard.queue_start = start_without_a_word
    try:
        yield
    finally:
        hid.Keyboard.queue_start = start


def _start_quietly(start: Callable[[Any], Any], device: Any) -> None:
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

"""PsychHID's thread starts with its request for priority answered; elsewhere nothing is changed."""

import os
import sys
import threading
import types
from pathlib import Path

import pytest

from evenlight.hardware.presentation import keyboard_start
from evenlight.hardware.presentation.keyboard_start import safe_keyboard_start

REALTIME = (os.SCHED_FIFO, os.sched_param(1)) if sys.platform == "linux" else ()
needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="PsychHID's thread has no words elsewhere")


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What PsychHID was asked; the thread of its stand-in asks for priority as the real one does."""
    told: list[str] = []

    def ask() -> None:
        try:
            os.sched_setscheduler(0, *REALTIME)
            told.append(f"policy {os.sched_getscheduler(0)}")
        except OSError:
            told.append("refused")  # the real one prints, of which Python crashes

    class Keyboard:
        def queue_start(self) -> None:
            thread = threading.Thread(target=ask)
            thread.start()
            thread.join()

    hid = types.SimpleNamespace(Keyboard=Keyboard)
    monkeypatch.setitem(sys.modules, "psychtoolbox", types.ModuleType("psychtoolbox"))
    monkeypatch.setitem(sys.modules, "psychtoolbox.hid", hid)
    return told


@pytest.fixture
def no_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keyboard_start, "_gets_priority", lambda: False)


def open_keyboard() -> None:
    sys.modules["psychtoolbox.hid"].Keyboard().queue_start()


@needs_linux
@pytest.mark.usefixtures("no_priority")
def test_a_request_for_priority_is_answered_with_no_other_effect(heard: list[str]) -> None:
    with safe_keyboard_start():
        open_keyboard()
    assert heard == [f"policy {os.sched_getscheduler(0)}"]


@needs_linux
def test_where_the_process_has_the_highest_priority_the_thread_gets_none_above_it(
    heard: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    highest = os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO))
    monkeypatch.setattr(os, "sched_getparam", lambda process: highest)
    with safe_keyboard_start():
        open_keyboard()
    assert heard == [f"policy {os.sched_getscheduler(0)}"]


@needs_linux
@pytest.mark.usefixtures("no_priority")
def test_the_thread_that_opens_the_keyboard_is_not_filtered(heard: list[str]) -> None:
    before = _own_status()
    assert len(before) == 2
    with safe_keyboard_start():
        open_keyboard()
    assert _own_status() == before


@needs_linux
@pytest.mark.usefixtures("no_priority")
def test_without_filters_the_lock_is_kept_until_the_thread_has_spoken(
    heard: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    slept: list[int] = []
    library = types.SimpleNamespace(usleep=slept.append)
    monkeypatch.setattr("platform.machine", lambda: "a machine of tomorrow")
    monkeypatch.setattr("ctypes.PyDLL", lambda name: library)
    with safe_keyboard_start():
        open_keyboard()
    assert len(heard) == 1
    assert slept == [2_000_000]


@pytest.mark.usefixtures("no_priority")
def test_it_is_as_it_was_after_a_keyboard_that_does_not_open(heard: list[str]) -> None:
    keyboard = sys.modules["psychtoolbox.hid"].Keyboard
    start = keyboard.queue_start
    with pytest.raises(OSError, match="no keyboard"), safe_keyboard_start():
        raise OSError("no keyboard")
    assert keyboard.queue_start is start


@pytest.mark.parametrize("here", ["another system", "no PsychHID", "priority is granted"])
@pytest.mark.usefixtures("no_priority")
def test_elsewhere_nothing_is_changed(heard: list[str], monkeypatch: pytest.MonkeyPatch, here: str) -> None:
    keyboard = sys.modules["psychtoolbox.hid"].Keyboard
    start = keyboard.queue_start
    if here == "another system":
        monkeypatch.setattr(sys, "platform", "win32")
    elif here == "no PsychHID":
        monkeypatch.setitem(sys.modules, "psychtoolbox.hid", None)
    else:
        monkeypatch.setattr(keyboard_start, "_gets_priority", lambda: True)
    with safe_keyboard_start():
        assert keyboard.queue_start is start


def _own_status() -> list[str]:
    """Return what the kernel says of this thread's filters and privileges."""
    lines = Path("/proc/thread-self/status").read_text().splitlines()
    return [line for line in lines if line.startswith(("Seccomp:", "NoNewPrivs:"))]

"""PsychHID's thread starts with its request for priority answered; elsewhere nothing is changed."""

import os
import sys
import threading
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from evenlight.hardware.presentation.keyboard_start import safe_keyboard_start

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="PsychHID's thread has no words elsewhere")
ON_LINUX = sys.platform == "linux"


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """What PsychHID was asked; the thread of its stand-in asks for more priority than any, and stays."""
    told: list[str] = []
    asked, end = threading.Event(), threading.Event()

    def ask() -> None:
        policy = os.sched_getscheduler(0)
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(100))
            told.append("granted")
        except OSError:
            told.append("refused")  # the real one prints, of which Python crashes
        assert os.sched_getscheduler(0) == policy
        asked.set()
        end.wait(60)

    class Keyboard:
        def queue_start(self) -> None:
            threads.append(threading.Thread(target=ask if ON_LINUX else asked.set))
            threads[-1].start()
            asked.wait(60)

    threads: list[threading.Thread] = []
    hid = types.SimpleNamespace(Keyboard=Keyboard)
    monkeypatch.setitem(sys.modules, "psychtoolbox", types.ModuleType("psychtoolbox"))
    monkeypatch.setitem(sys.modules, "psychtoolbox.hid", hid)
    yield told
    end.set()
    for thread in threads:
        thread.join()


def open_keyboard() -> None:
    sys.modules["psychtoolbox.hid"].Keyboard().queue_start()


@needs_linux
def test_a_request_for_priority_is_answered_with_no_other_effect(heard: list[str]) -> None:
    with safe_keyboard_start():
        open_keyboard()
    assert heard == ["granted"]


@needs_linux
@pytest.mark.parametrize(("own", "given"), [(0, 1), (50, 51), (99, 99)])
def test_the_thread_is_given_what_it_asked_for_from_outside(
    heard: list[str], monkeypatch: pytest.MonkeyPatch, own: int, given: int
) -> None:
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "sched_getparam", lambda process: os.sched_param(own))
    told = os.sched_setscheduler
    before = _own_status()

    def set_scheduler(thread: int, policy: int, param: os.sched_param) -> None:
        if thread == 0:
            told(thread, policy, param)
        else:
            asked.append((policy, param.sched_priority))
            assert _own_status() == before  # a thread with the filter would be answered, and nothing done
            raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", set_scheduler)
    with safe_keyboard_start():
        open_keyboard()
    assert heard == ["granted"]
    assert set(asked) == {(os.SCHED_FIFO, given)}  # the thread that started it may still be ending


@needs_linux
def test_the_thread_that_opens_the_keyboard_is_not_filtered(heard: list[str]) -> None:
    before = _own_status()
    assert len(before) == 2
    with safe_keyboard_start():
        open_keyboard()
    assert _own_status() == before


@needs_linux
def test_without_filters_the_lock_is_kept_until_the_thread_has_spoken(
    heard: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    slept: list[tuple[int, bool]] = []
    output = sys.stdout
    library = types.SimpleNamespace(usleep=lambda time: slept.append((time, sys.stdout is output)))
    monkeypatch.setattr("platform.machine", lambda: "a machine of tomorrow")
    monkeypatch.setattr("ctypes.PyDLL", lambda name: library)
    with safe_keyboard_start():
        open_keyboard()
    assert heard == ["refused"]
    assert slept == [(2_000_000, False)]
    assert sys.stdout is output


def test_it_is_as_it_was_after_a_keyboard_that_does_not_open(heard: list[str]) -> None:
    keyboard = sys.modules["psychtoolbox.hid"].Keyboard
    start = keyboard.queue_start
    with pytest.raises(OSError, match="no keyboard"), safe_keyboard_start():
        raise OSError("no keyboard")
    assert keyboard.queue_start is start


@pytest.mark.parametrize("here", ["another system", "no PsychHID"])
def test_elsewhere_nothing_is_changed(heard: list[str], monkeypatch: pytest.MonkeyPatch, here: str) -> None:
    keyboard = sys.modules["psychtoolbox.hid"].Keyboard
    start = keyboard.queue_start
    if here == "another system":
        monkeypatch.setattr(sys, "platform", "win32")
    else:
        monkeypatch.setitem(sys.modules, "psychtoolbox.hid", None)
    with safe_keyboard_start():
        assert keyboard.queue_start is start


def _own_status() -> list[str]:
    """Return what the kernel says of this thread's filters and privileges."""
    lines = Path("/proc/thread-self/status").read_text().splitlines()
    return [line for line in lines if line.startswith(("Seccomp:", "NoNewPrivs:"))]

"""PsychHID's thread starts while the interpreter's lock is kept; elsewhere nothing is changed."""

import os
import sys
import types
from typing import Any

import pytest

from evenlight.hardware.presentation import keyboard_start
from evenlight.hardware.presentation.keyboard_start import LAST_WORDS, PATIENCE, safe_keyboard_start

START_INTERVAL = sys.getswitchinterval()


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What a stand-in of PsychHID was asked, and how long the C library then slept, in order."""
    asked: list[Any] = []

    class Keyboard:
        def queue_start(self) -> None:
            asked.append("started")

    class Library:
        """Calls through `ctypes.PyDLL` keep the lock, those through `ctypes.CDLL` let it go."""

        def __init__(self, name: object) -> None:
            assert name is None  # the process itself, with its C library

        def usleep(self, microseconds: int) -> None:
            assert sys.getswitchinterval() > PATIENCE  # no other thread is given the lock
            asked.append(microseconds)
            if len(asked) == 4:  # the third look
                print(f"PsychHID: no {LAST_WORDS}")

    hid = types.ModuleType("psychtoolbox.hid")
    hid.Keyboard = Keyboard
    monkeypatch.setitem(sys.modules, "psychtoolbox", types.ModuleType("psychtoolbox"))
    monkeypatch.setitem(sys.modules, "psychtoolbox.hid", hid)
    monkeypatch.setattr(keyboard_start, "ctypes", types.SimpleNamespace(PyDLL=Library))
    monkeypatch.setattr(sys, "platform", "linux")
    return asked


@pytest.fixture
def no_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refused)


def open_keyboard() -> None:
    sys.modules["psychtoolbox.hid"].Keyboard().queue_start()


@pytest.mark.usefixtures("no_priority")
def test_the_lock_is_kept_until_the_thread_has_spoken(
    told: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    with safe_keyboard_start():
        open_keyboard()
    assert told == ["started", *[100_000] * 4]  # the last lets it finish
    assert sys.getswitchinterval() == START_INTERVAL
    assert capsys.readouterr().out == ""
    open_keyboard()
    assert told[5:] == ["started"]


@pytest.mark.usefixtures("no_priority")
def test_a_thread_that_says_nothing_is_waited_for_in_vain(
    told: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keyboard_start, "LAST_WORDS", "what it never says")
    with safe_keyboard_start():
        open_keyboard()
    assert told == ["started", *[100_000] * 50]  # 5 s


@pytest.mark.usefixtures("no_priority")
def test_it_is_as_it_was_after_a_keyboard_that_does_not_open(told: list[Any]) -> None:
    with pytest.raises(OSError, match="no keyboard"), safe_keyboard_start():
        raise OSError("no keyboard")
    open_keyboard()
    assert told == ["started"]


@pytest.mark.parametrize("here", ["another system", "no PsychHID", "priority is granted"])
@pytest.mark.usefixtures("no_priority")
def test_elsewhere_nothing_is_changed(told: list[Any], monkeypatch: pytest.MonkeyPatch, here: str) -> None:
    keyboard = sys.modules["psychtoolbox.hid"].Keyboard
    if here == "another system":
        monkeypatch.setattr(sys, "platform", "win32")
    elif here == "no PsychHID":
        monkeypatch.setitem(sys.modules, "psychtoolbox.hid", None)
    else:
        monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    with safe_keyboard_start():
        keyboard().queue_start()
    assert told == ["started"]

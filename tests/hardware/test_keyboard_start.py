"""PsychHID's thread starts while the interpreter's lock is held; elsewhere nothing is changed."""

import sys
import types
from typing import Any

import pytest

from evenlight.hardware.presentation import keyboard_start
from evenlight.hardware.presentation.keyboard_start import safe_keyboard_start


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
            asked.append(microseconds)

    hid = types.ModuleType("psychtoolbox.hid")
    hid.Keyboard = Keyboard
    monkeypatch.setitem(sys.modules, "psychtoolbox", types.ModuleType("psychtoolbox"))
    monkeypatch.setitem(sys.modules, "psychtoolbox.hid", hid)
    monkeypatch.setattr(keyboard_start, "ctypes", types.SimpleNamespace(PyDLL=Library))
    return asked


def open_keyboard() -> None:
    sys.modules["psychtoolbox.hid"].Keyboard().queue_start()


def test_the_lock_is_held_until_the_thread_has_started(
    told: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    with safe_keyboard_start():
        open_keyboard()
    assert told == ["started", 200_000]  # 0.2 s
    open_keyboard()
    assert told[2:] == ["started"]


def test_it_is_as_it_was_after_a_keyboard_that_does_not_open(
    told: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(OSError, match="no keyboard"), safe_keyboard_start():
        raise OSError("no keyboard")
    open_keyboard()
    assert told == ["started"]


@pytest.mark.parametrize("lacking", ["Linux", "PsychHID"])
def test_elsewhere_nothing_is_changed(told: list[Any], monkeypatch: pytest.MonkeyPatch, lacking: str) -> None:
    monkeypatch.setattr(sys, "platform", "linux" if lacking == "PsychHID" else "win32")
    keyboard = sys.modules["psychtoolbox.hid"].Keyboard
    if lacking == "PsychHID":
        monkeypatch.setitem(sys.modules, "psychtoolbox.hid", None)
    with safe_keyboard_start():
        keyboard().queue_start()
    assert told == ["started"]

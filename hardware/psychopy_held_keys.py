"""Which keys are down, as pyglet reports it to PsychoPy's window."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from typing import Any

from evenlight.hardware.psychopy_window import PsychoPyWindow


class PsychoPyHeldKeys(AbstractContextManager["PsychoPyHeldKeys"]):
    """The keys over a window of PsychoPy.

    News of them arrives with the flips, which is when pyglet asks the system for what happened. Times of
    single presses come from `PsychoPyKeyboard`, which is more exact.

    Parameters
    ----------
    window : PsychoPyWindow
        The window, open.
    """

    def __init__(self, window: PsychoPyWindow) -> None:
        self._handle: Any = window.handle()
        self._name: Any = sys.modules["pyglet.window"].key.symbol_string
        self._down: set[str] = set()
        self._handlers = {
            "on_key_press": self._on_press,
            "on_key_release": self._on_release,
            "on_deactivate": self._down.clear,  # what is released elsewhere is not heard of
        }
        self._handle.push_handlers(**self._handlers)

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are down now."""
        return frozenset(self._down)

    def close(self) -> None:
        """Listen no longer."""
        if self._handle.context is not None:  # pyglet has none of a window that is closed
            self._handle.remove_handlers(**self._handlers)

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_press(self, symbol: int, _: int) -> None:
        """Take a key that goes down; those who listened before hear of it too."""
        self._down.add(self._name(symbol).lower())

    def _on_release(self, symbol: int, _: int) -> None:
        """Take a key that goes up."""
        self._down.discard(self._name(symbol).lower())

"""Keyboard, held keys and mouse, through PsychoPy's precise keyboard backend and pyglet's window."""

from __future__ import annotations

import math
import sys
from typing import Any

from evenlight.hardware.presentation.psychopy_window import PsychoPyWindow
from evenlight.hardware.protocols import ContextDevice, KeyPress


class PsychoPyKeyboard(ContextDevice):
    """All keyboards of the computer as one, on the clock of `PsychoPyWindow`.

    Open the window first. `psychopy.event` is not used: it polls with the frames, and hangs on some systems.
    """

    def __init__(self) -> None:
        from psychopy import logging
        from psychopy.hardware import keyboard

        self._clock = logging.defaultClock
        self._keyboard = keyboard.Keyboard(clock=self._clock)
        self._taken_until = -math.inf

    def pressed(self) -> list[KeyPress]:
        """Return the keys pressed since the last call, in order; return at once."""
        # A press counts when the key goes down. PsychoPy gives it once more when the key is let go; a key let
        # go before it was asked for, within a long frame, is among those only.
        held = self._keyboard.getKeys(waitRelease=False, clear=True)
        keys = [*held, *self._keyboard.getKeys(waitRelease=True, clear=True)]
        times = {(key.name, float(key.rt)) for key in keys}
        presses = [KeyPress(name, time) for name, time in times if time > self._taken_until]
        self._taken_until = max([self._taken_until, *(press.time for press in presses)])
        return sorted(presses, key=lambda press: press.time)

    def clear(self) -> None:
        """Forget what was pressed until now."""
        self._keyboard.clearEvents()
        self._taken_until = float(self._clock.getTime())

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""
        return {"keyboard": f"psychopy.hardware.keyboard, backend {self._keyboard.getBackend()}"}

    def close(self) -> None:
        """Let go of the device."""
        self._keyboard.stop()


class PsychoPyHeldKeys(ContextDevice):
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

    def _on_press(self, symbol: int, _: int) -> None:
        """Take a key that goes down; those who listened before hear of it too."""
        self._down.add(self._name(symbol).lower())

    def _on_release(self, symbol: int, _: int) -> None:
        """Take a key that goes up."""
        self._down.discard(self._name(symbol).lower())


class PsychoPyPointer(ContextDevice):
    """The mouse over a window of PsychoPy.

    The window takes the mouse for itself: its arrow is hidden and held in the middle, so that it can be moved
    without end. Where the system refuses that, movements count up to the window's edge. They arrive with the
    flips, which is when pyglet asks the system for what happened.

    Parameters
    ----------
    window : PsychoPyWindow
        The window, open.
    """

    def __init__(self, window: PsychoPyWindow) -> None:
        self._handle: Any = window.handle()
        self._right = self._up = 0.0
        self._handle.push_handlers(on_mouse_motion=self._on_motion, on_mouse_drag=self._on_drag)
        self._handle.set_exclusive_mouse(True)

    def moved(self) -> tuple[float, float]:
        """Return how far it moved since the last call, to the right and up [pixels]; return at once."""
        movement = self._right, self._up
        self._right = self._up = 0.0
        return movement

    def close(self) -> None:
        """Give the mouse back to the system."""
        if self._handle.context is not None:  # pyglet has none of a window that is closed
            self._handle.set_exclusive_mouse(False)
            self._handle.remove_handlers(on_mouse_motion=self._on_motion, on_mouse_drag=self._on_drag)

    def _on_motion(self, x: int, y: int, right: float, up: float) -> None:
        """Take a movement; pyglet counts upwards. Those who listened before hear of it too."""
        self._right += right
        self._up += up

    def _on_drag(self, x: int, y: int, right: float, up: float, *_: object) -> None:
        """Take a movement with a button pressed."""
        self._on_motion(x, y, right, up)

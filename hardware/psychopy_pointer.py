"""The mouse, as pyglet reports it to PsychoPy's window."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from evenlight.hardware.psychopy_window import PsychoPyWindow


class PsychoPyPointer(AbstractContextManager["PsychoPyPointer"]):
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

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_motion(self, x: int, y: int, right: float, up: float) -> None:
        """Take a movement; pyglet counts upwards. Those who listened before hear of it too."""
        self._right += right
        self._up += up

    def _on_drag(self, x: int, y: int, right: float, up: float, *_: object) -> None:
        """Take a movement with a button pressed."""
        self._on_motion(x, y, right, up)

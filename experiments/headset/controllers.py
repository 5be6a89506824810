"""Controllers and the operator's keyboard of a session in a headset, as the keys that a rig names."""

from __future__ import annotations

from dataclasses import replace

from evenlight.data_schema.recordings.rig import Keys
from evenlight.experiments.stage import SessionStopped
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.hardware.protocols import ContextDevice, KeyPress, ResponseDevice

TRIGGER, MENU = "trigger", "menu"
STICK_LEFT, STICK_RIGHT = "stick_left", "stick_right"
PAUSE, NEXT, STOP = "f1", "f2", "f3"  # keys of the operator, besides `headset_window.RECENTRE`
OPERATOR_KEYS = "F1 pause, F2 next, F3 stop, F4 straight ahead"


class HeadsetKeys(ContextDevice):
    """What a participant presses on controllers, and an operator on the keyboard over the mirror.

    The menu button and F1 are the rig's pause key. Trigger, stick and F2 mean something else on a page, at a
    question and in a search, and keep their names.

    Parameters
    ----------
    window : HeadsetWindow
        The headset's.
    keyboard : ResponseDevice
        The operator's, or that of a simulated participant; the rig's own keys answer, too.
    keys : Keys
        The rig's.
    """

    def __init__(self, window: HeadsetWindow, keyboard: ResponseDevice, keys: Keys) -> None:
        self._name = "keys"
        self._window, self._keyboard, self._keys = window, keyboard, keys

    def pressed(self) -> list[KeyPress]:
        """Return what was pressed since the last call, in order, or raise `SessionStopped`."""
        presses = sorted([*self._window.presses(), *self._keyboard.pressed()], key=lambda press: press.time)
        if any(press.name == STOP for press in presses):
            raise SessionStopped("by the operator")
        pause = self._keys.pause
        return [replace(press, name=pause) if press.name in (MENU, PAUSE) else press for press in presses]

    def clear(self) -> None:
        """Forget what was pressed until now, but for the key that stops."""
        self.pressed()

    def apparatus(self) -> dict[str, str]:
        """Return what the keyboard says of itself; the headset speaks for its controllers."""
        return self._keyboard.apparatus()

    def close(self) -> None:
        """Let go of the keyboard."""
        super().close()
        self._keyboard.close()

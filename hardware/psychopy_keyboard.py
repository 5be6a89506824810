"""The keyboard, through PsychoPy and its precise backend: key presses carry the driver's own times."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager

from evenlight.hardware.protocols import KeyPress


class PsychoPyKeyboard(AbstractContextManager["PsychoPyKeyboard"]):
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

    def __exit__(self, *_: object) -> None:
        self.close()

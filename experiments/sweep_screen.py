"""The screen of a sweep: uniform, in plain codes without dithering, at a brightness factor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rig import Rig
from evenlight.experiments.stage import PausePressed
from evenlight.experiments.sweep_schedule import Level
from evenlight.hardware.protocols import Backlight, ResponseDevice, Window
from evenlight.hardware.simulated_panel import SimulatedPanel
from evenlight.stimuli.dithering import luminance_of_codes

READ_BACK = (16, 16)  # [pixels] of the middle of the screen
LOOK_EVERY = 0.02  # [s] at the keys, while nothing changes on the screen


@dataclass(frozen=True, slots=True)
class Shown:
    """A level as it is shown: the pixel value of the display's nearest code, and the factor achieved."""

    pixel_value: float
    achieved_factor: float


class SweepScreen:
    """Shows levels: plain codes without dithering, on a window or, in a rehearsal, on a simulated panel.

    Parameters
    ----------
    rig : Rig
        Bits, pause key.
    time : (callable, callable)
        The clock [s], and what waits on it.
    window : Window, optional
        Where it is shown; a rehearsal without one shows nothing.
    keyboard : ResponseDevice, optional
        For the pause key.
    backlight : Backlight, optional
        What makes brightness factors; without one pixels do, where the display is known.
    display : Display, optional
        The display, as it was measured before.
    panel : SimulatedPanel, optional
        A simulated panel that shows the same.
    rehearsed : bool, optional
        Whether waiting takes no time, and nobody sits at the keys.
    """

    def __init__(
        self,
        rig: Rig,
        time: tuple[Callable[[], float], Callable[[float], None]],
        *,
        window: Window | None = None,
        keyboard: ResponseDevice | None = None,
        backlight: Backlight | None = None,
        display: Display | None = None,
        panel: SimulatedPanel | None = None,
        rehearsed: bool = False,
    ) -> None:
        self._rig, (self.now, self._wait), self._rehearsed = rig, time, rehearsed
        self._window, self._keyboard, self._backlight = window, keyboard, backlight
        self._display, self._panel = display, panel
        self._bits = window.bits() if window else rig.bits

    @property
    def makes_factors(self) -> bool:
        """Whether brightness factors can be shown: by a backlight, or by pixels of a known display."""
        return self._backlight is not None or self._display is not None

    def show(self, level: Level) -> Shown:
        """Show a level.

        Raises
        ------
        InstrumentError
            If the backlight has no such factor.
        InputError
            If the window shows another code than it was given.
        """
        factor = 1.0 if level.factor is None else level.factor
        codes = (1 << self._bits) - 1
        if self._backlight is not None:
            achieved = self._backlight.set_factor(factor)
            code = round(level.pixel_value * codes)
        elif level.factor is None or self._display is None:
            code, achieved = round(level.pixel_value * codes), 1.0
        else:
            code, achieved = _dimmed_white(factor, self._display, self._bits)
        self._draw(code, codes)
        if self._panel is not None:
            self._panel.show(code / codes)
        return Shown(code / codes, achieved)

    def wait(self, seconds: float) -> None:
        """Keep the level for some time [s]. Raises `PausePressed` if the pause key was pressed."""
        if self._rehearsed:
            self._wait(seconds)
            return
        end = self.now() + seconds
        while True:
            if self._keyboard and any(k.name == self._rig.keys.pause for k in self._keyboard.pressed()):
                raise PausePressed
            left = end - self.now()
            if left <= 0:
                return
            if self._window is not None:
                self._window.flip()  # one that nobody looks after for minutes is taken for dead
            self._wait(min(left, LOOK_EVERY))

    def _draw(self, code: int, codes: int) -> None:
        """Fill the window with a code, and check what was drawn."""
        if self._window is None:
            return
        value = code / codes
        for _ in range(2):  # both buffers, which flips show in turn
            self._window.framebuffer().clear(value, value, value, 1.0)
            drawn = self._window.read_codes(READ_BACK)
            self._window.flip()
        if not (drawn == code).all():
            raise InputError(f"the window was to show code {code} of {codes}, and shows {drawn.ravel()[0]}")


def _dimmed_white(factor: float, display: Display, bits: int) -> tuple[int, float]:
    """Return the code whose luminance is nearest to that of white at a brightness factor, and its factor."""
    emitted = luminance_of_codes(np.arange(2**bits), display, bits) - display.reflected_luminance
    code = int(np.argmin(np.abs(emitted - factor * display.peak_luminance)))
    return code, float(emitted[code] / display.peak_luminance)

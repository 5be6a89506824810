"""What a session shows on: the window, and what stands behind its brightness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from evenlight.data_schema.display import Display
from evenlight.data_schema.rig import Rig
from evenlight.experiments.brightness import Brightness
from evenlight.experiments.screenshots import Screenshots
from evenlight.hardware.protocols import Window
from evenlight.stimuli.field_renderer import Field, FieldRenderer

LONGEST_SETTLING = 0.25  # [s] that a backlight is waited for before a picture


@dataclass(frozen=True, slots=True)
class Showing:
    """What a session shows on, handed to whoever shows something of their own.

    Attributes
    ----------
    window : Window
        The window.
    rig : Rig
        Refresh rate, dithering, actuator, keys.
    display : Display
        The rig's calibrated display.
    brightness : Brightness
        Pixels, or the backlight behind them.
    screenshots : Screenshots
        Pictures of the screens.
    take_pause : callable
        Raises `PausePressed` if the pause key was pressed.
    """

    window: Window
    rig: Rig
    display: Display
    brightness: Brightness
    screenshots: Screenshots
    take_pause: Callable[[], None]

    def show(self, fields: FieldRenderer, field: Field, refresh: int, kind: str = "", text: str = "") -> None:
        """Show a field for one refresh; a screenshot is taken of those that have a kind."""
        fields.draw(self.window.framebuffer(), field, refresh)
        if kind:
            self.screenshots.take(self.window, kind, text)
        self.window.flip()
        self.brightness.after_flip()
        self.take_pause()


def settle(on: Showing, fields: FieldRenderer, factor: float, ground: float) -> None:
    """Show a uniform field until the backlight has the factor of a picture; pixels have it at once.

    Parameters
    ----------
    on : Showing
        What is shown on.
    fields : FieldRenderer
        Draws the field.
    factor : float
        b of the picture that comes, in (0, 1].
    ground : float
        L of the field [cd/m^2].
    """
    begun, refresh = on.window.now(), 0
    while on.window.now() - begun < LONGEST_SETTLING:
        on.brightness.of_picture(factor)  # again and again: a backlight takes a setting only now and then
        if on.brightness.takes_pixels():
            return
        on.show(fields, Field(ground), refresh)
        refresh += 1

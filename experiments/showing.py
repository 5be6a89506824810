"""What a session shows on: the window, its screenshots, and pixels or a backlight for its brightness."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator, Corner, PhotodiodePatch, Rig
from evenlight.hardware.protocols import Backlight, Window
from evenlight.method.contrast.luminance import dimmed_luminance, displayed_luminance
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.renderers import AnyFieldRenderer

if TYPE_CHECKING:
    import moderngl

LONGEST_SETTLING = 0.25  # [s] that a backlight is waited for before a picture
ROUNDING = 1e-9  # of a time or a factor that was computed
IMAGE = -1.0  # in place of a pixel value, of an image: no uniform screen has it


@dataclass(frozen=True, slots=True)
class Screen:
    """What a session shows on, handed to the players of clips, searches and flashes."""

    window: Window  # the window
    rig: Rig  # refresh rate, dithering, actuator, keys
    display: Display  # the rig's calibrated display
    brightness: Brightness  # pixels, or the backlight behind them
    screenshots: Screenshots  # pictures of the screens
    take_pause: Callable[[], None]  # raises `PausePressed` if the pause key was pressed
    # is told, before a flip, what kind of stimulus it shows; for triggers
    mark: Callable[[str], None] = lambda stimulus: None

    def show(
        self, fields: AnyFieldRenderer, field: Field, refresh: int, kind: str = "", text: str = ""
    ) -> None:
        """Show a field for one refresh; a screenshot is taken of those that have a kind."""
        fields.draw(self.window.framebuffer(), field, refresh)
        self.flip(kind, text)
        self.take_pause()

    def flip(self, kind: str = "", text: str = "") -> float:
        """Show what is drawn, and return when it appeared [s]; a screenshot is taken of what has a kind."""
        if kind:
            self.screenshots.take(self.window, kind, text)
        flip = self.window.flip()
        self.brightness.after_flip()
        return flip


def settle(on: Screen, fields: AnyFieldRenderer, factor: float, ground: float) -> None:
    """Show a uniform field until the backlight has the factor of a picture; pixels have it at once.

    Parameters
    ----------
    on : Screen
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


def draw_patch(
    framebuffer: moderngl.Framebuffer, size: tuple[int, int], patch: PhotodiodePatch, *, lit: bool
) -> None:
    """Draw the corner that a photodiode looks at.

    Parameters
    ----------
    framebuffer : moderngl.Framebuffer
        Where to.
    size : (int, int)
        Width and height of the window [pixels].
    patch : PhotodiodePatch
        Which corner, how large.
    lit : bool
        Whether it is white, black otherwise.
    """
    side = min(patch.size, *size)
    left = size[0] - side if patch.corner in (Corner.TOP_RIGHT, Corner.BOTTOM_RIGHT) else 0
    bottom = size[1] - side if patch.corner in (Corner.TOP_LEFT, Corner.TOP_RIGHT) else 0
    framebuffer.clear(*(float(lit),) * 3, 1.0, viewport=(left, bottom, side, side))


class Screenshots:
    """Takes one picture of each kind of screen.

    Parameters
    ----------
    folder : Path or None
        Where the pictures go; None to take none.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._taken: set[str] = set()
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def take(self, window: Window, kind: str, text: str = "") -> None:
        """Save what is drawn, before its flip, unless there is one of this kind and text already."""
        name = "-".join([kind, *re.findall(r"\w+", text.strip().partition("\n")[0].lower())[:6]])
        if self._folder is None or name in self._taken:
            return
        from PIL import Image

        codes = window.read_codes() * 255 / ((1 << window.bits()) - 1)
        Image.fromarray(np.rint(codes).astype(np.uint8)).save(self._folder / f"{name}.png")
        self._taken.add(name)


class Brightness:
    """Divides a luminance between pixels and backlight.

    Parameters
    ----------
    display : Display
        The display.
    actuator : Actuator
        What follows a field's luminance.
    backlight : Backlight or None
        The backlight, if there is one; at full brightness where pixels are the actuator.
    clock : callable
        The window's clock [s].
    """

    def __init__(
        self,
        display: Display,
        actuator: Actuator,
        backlight: Backlight | None,
        clock: Callable[[], float],
    ) -> None:
        self._display, self._clock = display, clock
        self._backlight = backlight
        self._by_backlight = backlight is not None and actuator is Actuator.BACKLIGHT
        if actuator is Actuator.BACKLIGHT and backlight is None:
            raise ValueError("the actuator is the backlight, and none was handed in")
        if backlight:
            backlight.set_factor(1.0)
        self._asked = 1.0  # the factor last set, before the device took its nearest step
        self._wanted = 1.0  # the factor to be set as soon as the device takes it
        self._falling = False  # to a factor for other pixels than those shown
        self._set_at = clock()
        self._pixel_value: float | None = None  # of the field shown; None for one that is made by pixels
        self._later: float | None = None

    def by_pixels(self, luminance: float) -> float:
        """Take the backlight to full, and return the luminance L that the pixels are to draw [cd/m^2]."""
        self._change(1.0, None)
        return luminance

    def of_screen(self, luminance: float, pixel_value: float) -> float:
        """Set the backlight for a uniform screen, and return the luminance L to be drawn at b = 1 [cd/m^2].

        Parameters
        ----------
        luminance : float
            L that is to reach the eye, reflected light included [cd/m^2].
        pixel_value : float
            L' of the screen, in [0, 1].
        """
        if not self._by_backlight:
            return luminance
        full = float(displayed_luminance(pixel_value, self._display))
        reflected = self._display.reflected_luminance
        self._change((luminance - reflected) / (full - reflected), pixel_value)
        return full

    def of_picture(self, factor: float) -> float:
        """Set the backlight for an image, and return the brightness factor that its pixels are dimmed by.

        Parameters
        ----------
        factor : float
            b that the image is to have, in (0, 1].
        """
        if not self._by_backlight:
            return factor
        self._change(factor, IMAGE)
        return 1.0

    def after_flip(self) -> None:
        """Brighten the backlight, where that had to wait for other pixels."""
        if self._later is not None:
            self._set(self._later)
            self._later = None

    def reported(self) -> float | None:
        """Return the brightness factor that the backlight reports; None where pixels make the brightness."""
        return self._backlight.read_factor() if self._backlight and self._by_backlight else None

    def reached(self) -> bool:
        """Return whether the backlight reports, to a step, the factor that is wanted."""
        if self._backlight is None or not self._by_backlight:
            return True
        return (
            self._later is None
            and abs(self._backlight.read_factor() - self._wanted) <= self._backlight.step()
        )

    def takes_pixels(self) -> bool:
        """Return whether other pixels may be shown; not while the backlight is on its way down for them."""
        self._falling = self._falling and not self.reached()
        return not self._falling

    def seen(self, drawn: float) -> float:
        """Return the luminance L that reaches the eye where pixels draw one at b = 1 [cd/m^2]."""
        factor = self.reported()
        if factor is None:
            return drawn
        return float(dimmed_luminance(drawn - self._display.reflected_luminance, factor, self._display))

    def _change(self, factor: float, pixel_value: float | None) -> None:
        """Set the backlight now, or after the next flip.

        Between two screens of other pixel values the backlight falls before the pixels change and rises
        after it, so that no flash disturbs adaptation.
        """
        if not self._by_backlight:
            return
        self._wanted, self._later = factor, None
        if pixel_value != self._pixel_value:
            self._falling = factor <= self._asked
            self._later = None if self._falling else factor
        if self._later is None:
            self._set(factor)
        self._pixel_value = pixel_value

    def _set(self, factor: float) -> None:
        """Set the backlight, but no more often than it takes."""
        assert self._backlight is not None
        due = self._set_at + self._backlight.min_interval()
        if abs(factor - self._asked) < ROUNDING or self._clock() < due - ROUNDING:
            return
        self._backlight.set_factor(factor)
        self._asked, self._set_at = factor, self._clock()

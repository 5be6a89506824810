"""What makes the luminance of a field: the pixels at full backlight, or the backlight behind them."""

from __future__ import annotations

from collections.abc import Callable

from evenlight.data_schema.display import Display
from evenlight.data_schema.rig import Actuator
from evenlight.hardware.protocols import Backlight
from evenlight.method.luminance import dimmed_luminance, displayed_luminance

ROUNDING = 1e-9  # of a time or a factor that was computed
IMAGE = -1.0  # in place of a pixel value, of an image: no uniform screen has it


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

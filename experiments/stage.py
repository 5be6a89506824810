"""Where a session happens: pages, ramps and questions, on a window or without one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hardware.protocols import KeyPress

KEY_DECIMALS = 6  # of a response time [s]: what a key's time says, without the rounding of a difference


class PausePressed(Exception):  # noqa: N818 - it is no error: somebody pressed the pause key
    """The pause key was pressed while something was shown."""


@dataclass(frozen=True, slots=True)
class RampInterval:
    """A uniform field: constant, changing linearly in luminance, constant again.

    Attributes
    ----------
    initial_luminance, final_luminance : float
        L before and after the ramp, reflected light included [cd/m^2].
    pixel_value : float
        L' of the uniform screen at full brightness, in [0, 1]; what the pixels show if the backlight makes
        the brightness.
    adaptation, duration, hold : float
        Constant luminance before the ramp, the ramp, constant luminance after it [s].
    noise_seed : int
        Of the dithering noise.
    label : str
        Number of the interval, shown during the adaptation; empty for none.
    """

    initial_luminance: float
    final_luminance: float
    pixel_value: float
    adaptation: float
    duration: float
    hold: float
    noise_seed: int
    label: str = ""


@dataclass(frozen=True, slots=True)
class ShownInterval:
    """What the display showed of an interval.

    Attributes
    ----------
    onset : float
        When the first frame appeared, on the stage's clock [s].
    flip_times : tuple of float
        Of each frame, since the first [s].
    intended_luminance : tuple of float
        Of each frame [cd/m^2].
    probe_frames, probe_luminance : tuple of int, tuple of float
        Frames that were read back, and their mean luminance [cd/m^2].
    backlight_factors : tuple of float
        As the backlight reported; empty where pixels make the brightness.
    frames_dropped : int
        Refreshes that passed without a new frame.
    """

    onset: float
    flip_times: tuple[float, ...]
    intended_luminance: tuple[float, ...]
    probe_frames: tuple[int, ...] = ()
    probe_luminance: tuple[float, ...] = ()
    backlight_factors: tuple[float, ...] = ()
    frames_dropped: int = 0


class Stage(Protocol):
    """Shows what a session asks for, and takes the keys pressed."""

    def now(self) -> float:
        """Return the time on the stage's clock [s]."""

    def apparatus(self) -> dict[str, str]:
        """Return what the devices say of themselves."""

    def prepare(self, pages: Sequence[str], questions: Sequence[str]) -> None:
        """Set some texts before the session begins.

        Raises
        ------
        InputError
            If one of them cannot be shown: it does not fit, or has letters that the font lacks.
        """

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> KeyPress:
        """Show a page of text until one of some keys is pressed, and return which and when."""

    def ask(self, question: str, keys: Sequence[str], luminance: float) -> KeyPress:
        """Show a question on a field of some luminance until one of the keys is pressed.

        The time of the key press returned counts from the first flip that showed the question. Raises
        `PausePressed` if the pause key was pressed.
        """

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        """Show an interval. Raises `PausePressed` if the pause key was pressed meanwhile."""

    def wait(self, seconds: float, luminance: float) -> None:
        """Show a uniform field for a time [s]. Raises `PausePressed` if the pause key was pressed."""

    def close(self) -> None:
        """Close window and devices."""

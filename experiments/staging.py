"""Opening a session's stage: with a person or a simulated observer, on a window or without one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.rig import Actuator, Rig
from evenlight.experiments.blind_stage import BlindStage
from evenlight.experiments.participants import PressKey
from evenlight.experiments.ring_views import OffscreenPainter
from evenlight.experiments.stage import Stage
from evenlight.experiments.timed_logs import utc_now
from evenlight.experiments.window_stage import WindowStage
from evenlight.hardware.clocks import RefreshClock
from evenlight.hardware.rig import (
    backlights_smallest_factor,
    open_backlight,
    open_keyboard,
    open_pointer,
    open_window,
)
from evenlight.hardware.simulated_keyboard import SimulatedKeyboard


@dataclass(frozen=True, slots=True)
class Staging:
    """How a session is staged.

    Attributes
    ----------
    simulation : str or None
        None with a person; "data" without a window, "visual" through the window, with a simulated observer.
    real_time : bool
        Whether a rehearsal that is seen goes at the pace of a session.
    screenshots : Path or None
        Folder for a picture of every kind of screen.
    """

    simulation: str | None = None
    real_time: bool = False
    screenshots: Path | None = None

    @property
    def simulated(self) -> bool:
        """Whether a simulated observer answers."""
        return self.simulation is not None

    def utc(self) -> str:
        """Return the time of day; empty in a rehearsal, which is the same whenever it is run."""
        return "" if self.simulated else utc_now()


def smallest_factor(staging: Staging, rig: Rig) -> float:
    """Return the lowest brightness factor that a session may ask for; 0 where pixels make the brightness.

    A rehearsal without a window opens no device of the computer, which may be another than the rig's: there
    any factor will do, unless the backlight is a simulated one.
    """
    elsewhere = staging.simulation == "data" and rig.backlight != "simulated"
    if elsewhere or rig.actuator is Actuator.PIXELS:
        return 0.0
    return backlights_smallest_factor(rig)


@contextmanager
def open_stage(
    staging: Staging, rig: Rig, display: Display, page_luminance: float
) -> Iterator[tuple[Stage, PressKey | None]]:
    """Yield the stage of a session, and what presses the keys of a rehearsal; None where a person does.

    Parameters
    ----------
    staging : Staging
        With a person or a simulated observer, on a window or without one.
    rig : Rig
        The devices.
    display : Display
        The rig's calibrated display.
    page_luminance : float
        Of the ground of pages [cd/m^2].
    """
    if staging.simulation == "data":
        frames = RefreshClock(rig.refresh_rate)
        keyboard = SimulatedKeyboard(frames.now)
        with BlindStage(rig, frames, keyboard, lambda: OffscreenPainter(display)) as blind:
            yield blind, keyboard.queue
        return
    counted = staging.simulated and not staging.real_time
    clock = RefreshClock(rig.refresh_rate) if counted else None
    window = open_window(rig, clock, rehearsal=staging.simulated)
    try:
        simulated = SimulatedKeyboard(window.now) if staging.simulated else None
        keys = simulated or open_keyboard()
        backlight = open_backlight(rig, window.now)
        mouse = (lambda: None) if staging.simulated else (lambda: open_pointer(window))
        stage = WindowStage(
            window, keys, rig, display, page_luminance, backlight, staging.screenshots, open_pointer=mouse
        )
    except BaseException:
        window.close()
        raise
    with stage:
        yield stage, simulated.queue if simulated else None

"""The window of a rig, on a screen or in a headset, with the keys over it; imported when they are opened."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import SLOWEST_DISPLAY, Eye, Rig
from evenlight.hardware.protocols import HeldKeys, Pointer, ResponseDevice, Window
from evenlight.hardware.simulated.clocks import RefreshClock

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display
    from evenlight.hardware.presentation.headset_views import HeadsetFacts
    from evenlight.hardware.presentation.headset_window import HeadsetWindow, OperatorKeys

SIMULATED_HEADSET = "simulated:openxr"
FASTEST_DISPLAY = 500.0  # [Hz] flips that come faster wait for nothing
LARGEST_DEVIATION = 0.02  # of the refresh rate: a ramp of 5 s would last 0.1 s more or less


def open_window(
    rig: Rig,
    refresh_clock: RefreshClock | None = None,
    *,
    rehearsal: bool = False,
    headset: HeadsetWindow | None = None,
) -> Window:
    """Return the rig's window: on a screen, or in a headset.

    Parameters
    ----------
    rig : Rig
        The rig.
    refresh_clock : RefreshClock, optional
        A clock that goes with the flips, for a rehearsal at full speed; else the computer's.
    rehearsal : bool, optional
        Whether any refresh rate will do, as where no one watches.
    headset : HeadsetWindow, optional
        The rig's headset, if it is open: it is the window.

    Raises
    ------
    InputError
        If there is no such window, or, except in a rehearsal, a screen's refresh rate is not the rig's.
    InstrumentError
        If the headset's runtime goes away.
    """
    if rig.in_headset:
        in_headset = headset or open_headset(rig, waits=refresh_clock is None)
        try:
            in_headset.begin(rig.eye, refresh_clock)
        except BaseException:
            in_headset.close()
            raise
        return in_headset
    from evenlight.hardware.presentation.psychopy_window import PsychoPyWindow

    window = PsychoPyWindow(rig, refresh_clock)
    if refresh_clock is None and not rehearsal:
        try:
            require_refresh_rate(rig, window.measure_refresh_rate())
        except InputError:
            window.close()
            raise
    return window


def open_headset(rig: Rig, *, waits: bool = True, gaze: bool = False) -> HeadsetWindow:
    """Return the rig's headset, open but for its first frame: at the OpenXR runtime, or a made-up one.

    Parameters
    ----------
    rig : Rig
        A rig in a headset; `window_size` is the size of each eye's picture, which then is all that it sees,
        unless `full_screen` lets the headset say.
    waits : bool, optional
        Whether frames of a made-up one take their time; else its clock goes with the frames. Those of a
        runtime always do.
    gaze : bool, optional
        Whether its runtime is asked where the eyes look, for a log.

    Raises
    ------
    InputError
        If there is no runtime, no headset, or no OpenGL.
    """
    eye_size = None if rig.full_screen else rig.window_size
    if rig.screen == SIMULATED_HEADSET:
        from evenlight.hardware.simulated.headset import EYE_SIZE, SimulatedHeadset

        return SimulatedHeadset(eye_size or EYE_SIZE, rig.refresh_rate, real_time=waits)
    from evenlight.hardware.presentation.openxr_headset import OpenXRHeadset

    return OpenXRHeadset(eye_size, gaze=gaze)


def with_headset(rig: Rig, display: Display, facts: HeadsetFacts) -> tuple[Rig, Display]:
    """Return the rig with the headset's refresh rate, and the display with its pixels per degree.

    Those are of the middle of the picture of the eye that counts, straight ahead, as large as it is drawn; of
    its focus view if there is one, for that is where it looks.

    Raises
    ------
    InputError
        If the headset has a refresh rate that no display has.
    """
    from evenlight.hardware.presentation.headset_views import centre_pixels_per_degree

    if not SLOWEST_DISPLAY <= facts.refresh_rate <= FASTEST_DISPLAY:
        raise InputError(
            f"the runtime {facts.runtime} says that its headset shows {facts.refresh_rate:g} Hz, and "
            f"displays {SLOWEST_DISPLAY:g} to {FASTEST_DISPLAY:g}: close what slows the computer down"
        )
    fov, size = facts.sharpest(rig.eye is Eye.RIGHT)
    width = size[0] if rig.full_screen else rig.window_size[0]
    pixels_per_degree = centre_pixels_per_degree(fov, width)
    return (
        dataclasses.replace(rig, refresh_rate=facts.refresh_rate),
        dataclasses.replace(display, pixels_per_degree=pixels_per_degree),
    )


def require_display(rig: Rig) -> None:
    """Raise `InputError` if PsychoPy, a display or the rig's screen are missing: no window can open.

    Of a headset nothing is asked here: it is opened before anything else.
    """
    if rig.in_headset:
        return
    from evenlight.hardware.presentation import psychopy_window

    psychopy_window.require_display(rig)


def open_window_of_any_rate(rig: Rig) -> tuple[Window, Rig]:
    """Return the rig's window, and the rig with the refresh rate that the window is found to have.

    A window that does not wait for a display, as on a virtual screen, keeps the rig's.
    """
    from evenlight.hardware.presentation.psychopy_window import PsychoPyWindow

    window = PsychoPyWindow(rig)
    rate = window.measure_refresh_rate()
    if not SLOWEST_DISPLAY <= rate <= FASTEST_DISPLAY:
        return window, rig
    return window, dataclasses.replace(rig, refresh_rate=rate)


def open_keyboard(window: Window) -> ResponseDevice:
    """Return the computer's keyboard over a window of `open_window`; of a headset, over its mirror."""
    if (keys := _operator_keys(window)) is not None:
        return keys
    from evenlight.hardware.presentation.psychopy_window import PsychoPyKeyboard

    return PsychoPyKeyboard()


def open_pointer(window: Window) -> Pointer | None:
    """Return the computer's mouse as it moves over a window of `open_window`; None for any other window."""
    from evenlight.hardware.presentation.psychopy_window import PsychoPyPointer, PsychoPyWindow

    return PsychoPyPointer(window) if isinstance(window, PsychoPyWindow) else None


def open_held_keys(window: Window) -> HeldKeys | None:
    """Return which keys are down over a window of `open_window`; None for any other window."""
    if (keys := _operator_keys(window)) is not None:
        return keys
    from evenlight.hardware.presentation.psychopy_window import PsychoPyHeldKeys, PsychoPyWindow

    return PsychoPyHeldKeys(window) if isinstance(window, PsychoPyWindow) else None


def _operator_keys(window: Window) -> OperatorKeys | None:
    from evenlight.hardware.presentation.headset_window import HeadsetWindow, OperatorKeys

    return OperatorKeys(window) if isinstance(window, HeadsetWindow) else None


def require_refresh_rate(rig: Rig, measured: float) -> None:
    """Refuse a rig whose refresh rate is not the window's: its ramps would be slower or faster than meant.

    >>> from evenlight.hardware.rig_files import load_rig
    >>> require_refresh_rate(load_rig("simulated")[0], 59.94)
    """
    if abs(measured / rig.refresh_rate - 1) > LARGEST_DEVIATION:
        raise InputError(
            f"the rig {rig.name!r} has a refresh rate of {rig.refresh_rate:g} Hz, and the window shows "
            f"{measured:.1f} Hz: set `refresh_rate_hz` to the display's, or the display to the rig's"
        )

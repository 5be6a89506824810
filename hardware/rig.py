"""The rig file, and the devices that it names: the one place that chooses a driver, and imports it."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable
from pathlib import Path

from data_schema.errors import InputError
from data_schema.rig import SLOWEST_DISPLAY, Rig
from data_schema.text_files import read_toml_record
from hardware.clocks import RefreshClock
from hardware.protocols import Backlight, HeldKeys, Pointer, ResponseDevice, Window

RIGS = Path(__file__).parent / "rigs"
FASTEST_DISPLAY = 500.0  # [Hz] flips that come faster wait for nothing
LARGEST_DEVIATION = 0.02  # of the refresh rate: a ramp of 5 s would last 0.1 s more or less


def load_rig(name_or_path: str) -> tuple[Rig, str]:
    """Return the rig of a preset (`simulated`) or of a toml file, and its display.

    Parameters
    ----------
    name_or_path : str
        A preset, or a toml file.

    Returns
    -------
    rig : Rig
        The rig, as the file has it.
    display : str
        Its display, to be loaded: a preset's name, or a path, which a rig gives relative to its own file.

    Raises
    ------
    InputError
        If there is neither a preset nor a file of that name, or the file is no rig.

    >>> rig, display = load_rig("simulated")
    >>> rig.refresh_rate, display
    (60.0, 'varjo-xr3')
    """
    path = _rig_file(name_or_path)
    rig = read_toml_record(Rig, path)
    is_file = rig.display.endswith(".toml") or "/" in rig.display
    return rig, str(path.parent / rig.display) if is_file else rig.display


def rig_names() -> list[str]:
    """Return the names of the rigs that come with Evenlight.

    >>> rig_names()
    ['desk', 'simulated']
    """
    return sorted(path.name.split(".")[0] for path in RIGS.glob("*.rig.toml"))


def open_window(rig: Rig, refresh_clock: RefreshClock | None = None, *, rehearsal: bool = False) -> Window:
    """Return the rig's window.

    Parameters
    ----------
    rig : Rig
        The rig.
    refresh_clock : RefreshClock, optional
        A clock that goes with the flips, for a rehearsal at full speed; else the computer's.
    rehearsal : bool, optional
        Whether any refresh rate will do, as where nobody looks.

    Raises
    ------
    InputError
        If there is no such window, or, but for a rehearsal, it has not the rig's refresh rate.
    """
    from hardware.psychopy_window import PsychoPyWindow

    window = PsychoPyWindow(rig, refresh_clock)
    if refresh_clock is None and not rehearsal:
        try:
            require_refresh_rate(rig, window.measure_refresh_rate())
        except InputError:
            window.close()
            raise
    return window


def open_window_of_any_rate(rig: Rig) -> tuple[Window, Rig]:
    """Return the rig's window, and the rig with the refresh rate that the window is found to have.

    A window that does not wait for a display, as on a virtual screen, keeps the rig's.
    """
    from hardware.psychopy_window import PsychoPyWindow

    window = PsychoPyWindow(rig)
    rate = window.measure_refresh_rate()
    if not SLOWEST_DISPLAY <= rate <= FASTEST_DISPLAY:
        return window, rig
    return window, dataclasses.replace(rig, refresh_rate=rate)


def open_keyboard() -> ResponseDevice:
    """Return the computer's keyboard; the window must be open."""
    from hardware.psychopy_keyboard import PsychoPyKeyboard

    return PsychoPyKeyboard()


def open_pointer(window: Window) -> Pointer | None:
    """Return the computer's mouse as it moves over a window of `open_window`; None for any other window."""
    from hardware.psychopy_pointer import PsychoPyPointer
    from hardware.psychopy_window import PsychoPyWindow

    return PsychoPyPointer(window) if isinstance(window, PsychoPyWindow) else None


def open_held_keys(window: Window) -> HeldKeys | None:
    """Return which keys are down over a window of `open_window`; None for any other window."""
    from hardware.psychopy_held_keys import PsychoPyHeldKeys
    from hardware.psychopy_window import PsychoPyWindow

    return PsychoPyHeldKeys(window) if isinstance(window, PsychoPyWindow) else None


def open_backlight(rig: Rig, clock: Callable[[], float]) -> Backlight | None:
    """Return the rig's backlight on a clock [s], or None if it names none."""
    if rig.backlight == "none":
        return None
    from hardware import backlights

    if rig.backlight == "simulated":
        return backlights.SimulatedBacklight(clock)
    return backlights.SysfsBacklight(rig.backlight.removeprefix("sysfs:"))


def backlights_smallest_factor(rig: Rig) -> float:
    """Return the lowest brightness factor of the rig's backlight, 0 if it names none.

    The device is opened for it, and left as it was found.

    >>> import dataclasses
    >>> rig = dataclasses.replace(load_rig("simulated")[0], backlight="simulated")
    >>> round(1 / backlights_smallest_factor(rig))  # 12 bits
    4095
    """
    backlight = open_backlight(rig, lambda: 0.0)
    if backlight is None:
        return 0.0
    try:
        return backlight.smallest_factor()
    finally:
        backlight.close()


def require_refresh_rate(rig: Rig, measured: float) -> None:
    """Refuse a rig whose refresh rate is not the window's: its ramps would be slower or faster than meant.

    >>> require_refresh_rate(load_rig("simulated")[0], 59.94)
    """
    if abs(measured / rig.refresh_rate - 1) > LARGEST_DEVIATION:
        raise InputError(
            f"the rig {rig.name!r} has a refresh rate of {rig.refresh_rate:g} Hz, and the window shows "
            f"{measured:.1f} Hz: set `refresh_rate_hz` to the display's, or the display to the rig's"
        )


def _rig_file(name_or_path: str) -> Path:
    """Return the file of a rig."""
    if name_or_path in rig_names():
        return RIGS / f"{name_or_path}.rig.toml"
    path = Path(name_or_path)
    if not path.exists():
        hint = difflib.get_close_matches(name_or_path, rig_names(), n=1)
        guess = f"did you mean {hint[0]!r}? " if hint else ""
        raise InputError(
            f"{name_or_path}: no such rig; {guess}give a preset ({', '.join(rig_names())}) or a toml file"
        )
    return path

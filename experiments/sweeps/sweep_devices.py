"""What a sweep runs on: a screen that shows levels, and the instruments that look at it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.sessions.staging import Staging
from evenlight.experiments.stage import PausePressed
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.protocols import (
    Backlight,
    InstrumentError,
    LuminanceMeter,
    PowerMeter,
    ResponseDevice,
    Window,
)
from evenlight.hardware.rig import (
    is_simulated,
    open_backlight,
    open_luminance_meter,
    open_power_meter,
    open_swept_backlight,
)
from evenlight.hardware.rig_windows import open_keyboard, open_window
from evenlight.hardware.simulated.clocks import RefreshClock, WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedBacklight, SimulatedPanel, Simulation
from evenlight.stimuli.dithering import luminance_of_codes

READ_BACK = (16, 16)  # [pixels] of the middle of the screen
Result = TypeVar("Result")
LOOK_EVERY = 0.02  # [s] at the keys, while nothing changes on the screen


@dataclass(frozen=True, slots=True)
class SweepLevel:
    """What a screen shows."""

    pixel_value: float  # L' of a uniform screen
    factor: float | None  # brightness factor b; None at full brightness, where pixel values are swept


@dataclass(frozen=True, slots=True)
class SweepDevices:
    """The screen and the instruments of a sweep."""

    screen: SweepScreen  # what shows the levels
    luminance_meter: LuminanceMeter | None  # aimed at the screen
    power_meter: PowerMeter | None  # in the panel's supply
    apparatus: dict[str, str]  # what they say of themselves


def names_of_meters(rig: Rig, task: str, *, rehearsed: bool) -> tuple[str, str]:
    """Return the luminance meter and the power meter that a sweep opens; in a rehearsal, simulated ones.

    Raises
    ------
    InputError
        If the rig has not the meter that the sweep needs.
    """
    needed, key = (
        (rig.luminance_meter, "luminance_meter")
        if task == "luminance-sweep"
        else (rig.power_meter, "power_meter")
    )
    if needed == "none":
        raise InputError(
            f"the rig {rig.name!r} names no {key.replace('_', ' ')}, and {task} needs one: set `{key}`, as "
            "`evenlight measure list` has them"
        )
    if task == "power-sweep" and rig.luminance_meter.startswith("csv:"):
        raise InputError(
            f"the rig {rig.name!r} has a table in place of a luminance meter, and no table has readings of a "
            "power sweep: set `luminance_meter` to a meter, or to none"
        )
    power = rig.power_meter if task == "power-sweep" else "none"
    if not rehearsed:
        return rig.luminance_meter, power
    rehearse = [n if n == "none" or is_simulated(n) else "simulated" for n in (rig.luminance_meter, power)]
    return rehearse[0], rehearse[1]


@dataclass(frozen=True, slots=True)
class SweepSetting:
    """What a sweep is made with."""

    rig: Rig  # what the devices are
    task: str  # "luminance-sweep" or "power-sweep"
    staging: Staging  # in earnest, or rehearsed with or without a window
    display: Display | None  # as it was measured before; a simulated panel has its luminances
    seed: int  # of simulated noise


@contextmanager
def open_sweep_devices(
    setting: SweepSetting, ask: Callable[[str], str] | None = None
) -> Iterator[SweepDevices]:
    """Yield the devices of a sweep, open.

    Parameters
    ----------
    setting : SweepSetting
        What they are for.
    ask : callable, optional
        Asks the person who reads a meter.

    Raises
    ------
    InputError
        If the rig has not what the sweep needs.
    InstrumentError
        If an instrument does not answer as it should.
    """
    rig, task, staging = setting.rig, setting.task, setting.staging
    display = setting.display
    luminance_name, power_name = names_of_meters(rig, task, rehearsed=staging.simulated)
    with ExitStack() as stack:
        clock = RefreshClock(rig.refresh_rate) if staging.simulation == "visual" else None
        window = None
        if staging.simulation != "data":
            window = open_window(rig, clock, rehearsal=True)  # any rate will do: nothing moves
            stack.callback(window.close)
        now, wait = _time(window, clock, rig.refresh_rate)
        simulation = None
        if staging.simulated or any(is_simulated(n) for n in (luminance_name, power_name)):
            simulation = Simulation(_panel(display, now), np.random.default_rng(setting.seed), now, wait)
        by_luminance = task == "power-sweep" and luminance_name == "none"
        backlight = _backlight(rig, staging, simulation, now, by_luminance=by_luminance)
        if backlight is not None:
            stack.callback(backlight.close)
        watched = None if staging.simulated else window
        keyboard = SimulatedKeyboard(now) if watched is None else open_keyboard(watched)
        stack.callback(keyboard.close)
        luminance_meter = power_meter = None
        if luminance_name != "none":
            luminance_meter = stack.enter_context(open_luminance_meter(luminance_name, now, simulation, ask))
        if power_name != "none":
            power_meter = stack.enter_context(open_power_meter(power_name, now, simulation))
        screen = SweepScreen(
            rig,
            (now, wait),
            window=window,
            keyboard=keyboard,
            backlight=backlight,
            display=display,
            panel=simulation.panel if simulation else None,
            rehearsed=staging.simulated,
        )
        apparatus = window.apparatus() if window else {}
        for kind, meter in (("luminance meter", luminance_meter), ("power meter", power_meter)):
            apparatus |= {f"{kind}: {k}": v for k, v in (meter.apparatus() if meter else {}).items()}
        yield SweepDevices(screen, luminance_meter, power_meter, apparatus)


def _time(
    window: Window | None, clock: RefreshClock | None, refresh_rate: float
) -> tuple[Callable[[], float], Callable[[float], None]]:
    """Return the clock of a sweep, and what waits on it: in a rehearsal, waiting takes no time."""
    if window is None:
        waiting = WaitingClock()
        return waiting.now, waiting.wait
    if clock is None:
        return window.now, time.sleep

    def let_pass(seconds: float) -> None:
        clock.advance(math.ceil(seconds * refresh_rate))

    return clock.now, let_pass


def _panel(display: Display | None, now: Callable[[], float]) -> SimulatedPanel:
    """Return a simulated panel with the luminances of a display, where it is known."""
    if display is None:
        return SimulatedPanel(PanelPhysics(), now)
    physics = PanelPhysics(
        peak_luminance=display.peak_luminance,
        black_level=display.black_level,
        gamma=display.gamma,
        reflected_luminance=display.reflected_luminance,
    )
    return SimulatedPanel(physics, now)


def _backlight(
    rig: Rig,
    staging: Staging,
    simulation: Simulation | None,
    now: Callable[[], float],
    *,
    by_luminance: bool,
) -> Backlight | None:
    """Return the backlight of a sweep: the rig's; in a rehearsal, that of the simulated panel.

    Its factors are its own, for what light they make is what is measured; `by_luminance` makes them shares of
    luminance, by the rig's curve, where no meter tells what light there was.
    """
    stands_in = rig.backlight == "none" or (staging.simulated and not is_simulated(rig.backlight))
    if simulation is not None and stands_in:
        return SimulatedBacklight(now, follow=simulation.panel.set_backlight)
    opener = open_backlight if by_luminance else open_swept_backlight
    return opener(rig, now, simulation)


@dataclass(frozen=True, slots=True)
class AchievedLevel:
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
        Whether waiting takes no time, and no person sits at the keys.
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
        self._grey = (0.0, 0.0, 0.0)  # what the window is filled with

    @property
    def makes_factors(self) -> bool:
        """Whether brightness factors can be shown: by a backlight, or by pixels of a known display."""
        return self._backlight is not None or self._display is not None

    def show(self, level: SweepLevel) -> AchievedLevel:
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
        return AchievedLevel(code / codes, achieved)

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
            if self._in_headset():
                self._keep()  # which waits for the next frame
                continue
            if self._window is not None:
                self._window.flip()  # a window that is not served for minutes is taken for dead
            self._wait(min(left, LOOK_EVERY))

    def while_shown(self, read: Callable[[], Result]) -> Result:
        """Return what an instrument reads, while a headset is given the level's frames as it wants them."""
        if self._rehearsed or not self._in_headset():
            return read()
        with ThreadPoolExecutor(1) as reader:
            reading = reader.submit(read)
            shown = True
            while not reading.done():
                shown = self._keep() and shown
        if not shown:
            raise InstrumentError(
                "the headset showed nothing: cover the sensor between its lenses, and close its menu"
            )
        return reading.result()

    def _in_headset(self) -> bool:
        return self._window is not None and self._window.eyes() is not None

    def _keep(self) -> bool:
        """Show the level for another refresh of a headset; return whether the runtime shows it."""
        assert self._window is not None
        eyes = self._window.eyes()
        self._window.framebuffer().clear(*self._grey, 1.0)
        self._window.flip()
        return eyes is not None and eyes.visible

    def _draw(self, code: int, codes: int) -> None:
        """Fill the window with a code, and check what was drawn."""
        self._grey = (code / codes,) * 3
        if self._window is None:
            return
        for _ in range(2):  # both buffers, which flips show in turn
            self._window.framebuffer().clear(*self._grey, 1.0)
            drawn = self._window.read_codes(READ_BACK)
            self._window.flip()
        if not (drawn == code).all():
            raise InputError(f"the window was to show code {code} of {codes}, and shows {drawn.ravel()[0]}")


def _dimmed_white(factor: float, display: Display, bits: int) -> tuple[int, float]:
    """Return the code whose luminance is nearest to that of white at a brightness factor, and its factor."""
    emitted = luminance_of_codes(np.arange(2**bits), display, bits) - display.reflected_luminance
    code = int(np.argmin(np.abs(emitted - factor * display.peak_luminance)))
    return code, float(emitted[code] / display.peak_luminance)

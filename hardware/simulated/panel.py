"""A display panel and its backlight as physics has them, for simulated instruments to look at.

The panel has gamma, black level, warm-up, drift and power. Nothing here is an instrument: noise, range and
digits are those of the meter that looks.
"""

from __future__ import annotations

import bisect
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from evenlight.hardware.backlights import SteppedBacklight

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, slots=True)
class PanelPhysics:
    """What is true of a simulated panel."""

    # at full backlight, warm [cd/m^2]
    peak_luminance: float = 200.0
    black_level: float = 0.2
    gamma: float = 2.2  # γ, from pixel value to luminance
    reflected_luminance: float = 0.0  # of the lit room, in its surface [cd/m^2]
    # luminance goes with this power of the factor that the backlight is set to; 1 is linear
    backlight_exponent: float = 1.0
    warm_up_share: float = -0.06  # by which share the luminance of a cold panel differs from a warm one's
    warm_up_time: float = 300.0  # in which 63 % of the way to warm is made [s]
    # share of the luminance by which it changes every hour, ageing and room temperature together
    drift_per_hour: float = 0.0
    lag: float = 0.005  # in which the backlight makes 63 % of a change [s]
    base_power: float = 0.2945  # at zero luminance [W]
    # slope of power over the luminance that the backlight makes [W m^2/cd]
    power_per_luminance: float = 0.001858
    # share by which power at full luminance lies above the line: LEDs lose efficiency with current
    droop: float = 0.0


@dataclass(frozen=True, slots=True)
class _Shown:
    pixel_value: float  # of a uniform screen; of an image, that whose luminance is its mean
    from_factor: float  # that the backlight had at that moment
    factor: float  # that it goes to
    sync: bool


class SimulatedPanel:
    """A panel that remembers what it showed when, so that an instrument can look at any past moment.

    Parameters
    ----------
    physics : PanelPhysics
        What is true of it.
    clock : callable
        Time since it was switched on, cold [s].
    transfer : callable, optional
        Share of the peak from pixel value, in place of the gamma curve.

    >>> time = [0.0]
    >>> panel = SimulatedPanel(PanelPhysics(warm_up_share=0.0), lambda: time[0])
    >>> panel.show(1.0); panel.set_backlight(0.5)
    >>> time[0] = 1.0
    >>> round(panel.luminance(), 3), round(panel.power(), 4)  # 0.2945 + 0.001858 * 100
    (100.0, 0.4803)
    """

    def __init__(
        self,
        physics: PanelPhysics,
        clock: Callable[[], float],
        transfer: Callable[[float], float] | None = None,
    ) -> None:
        self.physics, self._clock = physics, clock
        self._transfer = transfer or (lambda pixel_value: float(pixel_value**physics.gamma))
        self._lock = threading.Lock()  # an emulated instrument looks from another thread
        self._times = [-math.inf]
        self._shown = [_Shown(0.0, 1.0, 1.0, False)]

    def show(self, pixel_value: float) -> None:
        """Show a uniform screen of a pixel value L' from now on."""
        self._change(pixel_value=pixel_value)

    def set_backlight(self, factor: float) -> None:
        """Set the backlight to a factor, which it reaches with its lag."""
        self._change(factor=factor)

    def set_sync(self, level: bool) -> None:
        """Set the synchronisation line, which the frames are marked on."""
        self._change(sync=level)

    def luminance(self, time: float | None = None) -> float:
        """Return the luminance that reaches a meter, now or at a past time [cd/m^2]."""
        physics, (time, shown, factor) = self.physics, self._at(time)
        span = physics.peak_luminance - physics.black_level
        emitted = self._transfer(shown.pixel_value) * span + physics.black_level
        return self._light(factor) * self._warmth(time) * emitted + physics.reflected_luminance

    def power(self, time: float | None = None) -> float:
        """Return the power that the panel takes, now or at a past time, whatever the pixels [W]."""
        physics, (time, _, factor) = self.physics, self._at(time)
        light = self._light(factor)
        bent = light * (1 + physics.droop * (light - 1))
        return physics.base_power + physics.power_per_luminance * physics.peak_luminance * bent

    def sync(self, time: float | None = None) -> bool:
        """Return the level of the synchronisation line, now or at a past time."""
        return self._at(time)[1].sync

    def forget_before(self, time: float) -> None:
        """Forget what was shown before a time, which will not be asked for again [s]."""
        with self._lock:
            place = max(bisect.bisect_right(self._times, time) - 1, 0)
            del self._times[:place], self._shown[:place]

    def _light(self, factor: float) -> float:
        return float(factor**self.physics.backlight_exponent)

    def _warmth(self, time: float) -> float:
        physics = self.physics
        cold = physics.warm_up_share * math.exp(-max(time, 0.0) / physics.warm_up_time)
        return (1 + cold) * (1 + physics.drift_per_hour * time / 3600)

    def _at(self, time: float | None) -> tuple[float, _Shown, float]:
        time = self._clock() if time is None else time
        with self._lock:
            place = max(bisect.bisect_right(self._times, time) - 1, 0)
            shown, since = self._shown[place], self._times[place]
        left = math.exp(-(time - since) / self.physics.lag)
        return time, shown, shown.factor + (shown.from_factor - shown.factor) * left

    def _change(
        self, pixel_value: float | None = None, factor: float | None = None, sync: bool | None = None
    ) -> None:
        now, before, reached = self._at(None)
        after = _Shown(
            pixel_value=before.pixel_value if pixel_value is None else pixel_value,
            from_factor=reached,
            factor=before.factor if factor is None else factor,
            sync=before.sync if sync is None else sync,
        )
        with self._lock:
            self._times.append(now)
            self._shown.append(after)


@dataclass(frozen=True, slots=True)
class Simulation:
    """What simulated instruments share."""

    panel: SimulatedPanel  # what they look at
    rng: np.random.Generator  # of their noise
    clock: Callable[[], float]  # the computer's clock [s], which the panel has too
    wait: Callable[[float], None]  # waits for some time [s]: for a reading, for a panel to settle


class SimulatedBacklight(SteppedBacklight):
    """A backlight with steps that follows what is set with a first-order lag.

    Parameters
    ----------
    clock : callable
        The window's clock [s].
    steps : int, optional
        How many there are above 0.
    time_constant : float, optional
        In which 63 % of a change is made [s].
    min_interval : float, optional
        Shortest time between two settings [s].
    follow : callable, optional
        Is called with each factor that is set: a simulated panel, which the light comes from.

    >>> time = [0.0]
    >>> backlight = SimulatedBacklight(lambda: time[0], steps=100, time_constant=0.01)
    >>> backlight.set_factor(0.503)
    0.5
    >>> time[0] = 0.01
    >>> round(backlight.read_factor(), 3)  # 0.5 + 0.5 / e
    0.684
    """

    _name = "the simulated backlight"

    def __init__(
        self,
        clock: Callable[[], float],
        steps: int = 4095,
        time_constant: float = 0.005,
        min_interval: float = 0.01,
        follow: Callable[[float], None] | None = None,
    ) -> None:
        self._min_interval = min_interval
        self._clock, self._follow, self._time_constant = clock, follow, time_constant
        self._steps = self._found = steps
        self._start, self._target, self._set_at = 1.0, 1.0, clock()

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        left = math.exp(-(self._clock() - self._set_at) / self._time_constant)
        return self._target + (self._start - self._target) * left

    def _set(self, step: int) -> None:
        self._start, self._set_at = self.read_factor(), self._clock()
        self._target = step / self._steps
        if self._follow is not None:
            self._follow(self._target)

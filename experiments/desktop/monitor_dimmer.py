"""Moves a monitor's backlight by what is on it, below what its user has set, within the rate limit.

What the user sets counts as full: the loss is that beside the picture at that brightness, and the factor is a
share of it. Whoever moves the backlight meanwhile (keys, a slider, a daemon) is right: the ceiling goes with
them, and the factor below it stays. Where that would be above full, it is dimmed no lower than what they set.
While it rests, what they set is the ceiling. A desktop dims while nobody is there, and sets back what it
found: so does the ceiling. A panel that is off, or does not answer, is waited for.

Decision (docs/decisions/rate-constraint.md): the limit is on what a step of the factor changes in the picture
on screen. Which one that is nobody knows between two looks, so a step keeps the limit of every picture up to
a white one. It is made in whole steps of the device, the time of each counted from the end of the last, and
only where the device, read right before, is where it was set to.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.hardware.protocols import Backlight, InstrumentError
from evenlight.method.rate_limit import ScalarRateLimit, furthest_factor

SHORTEST = 0.05  # [s] between two settings: below 0.2 % of a picture's light, by the published limit
HALF_A_STEP = 0.51  # of the backlight's steps: from here on somebody else has set it,
AS_SET = 1e-4  # of a factor; or from here, where the widest of its steps is more than that
ROUNDING = 1e-6  # of a step
WAY = np.linspace(0.0, 1.0, 2001)  # to full, in steps that nobody sees
SAME = 0.006, 0.05  # of full, and of where it stands: desktops set back whole percentages
# A device goes to its nearest step, which is no further than its widest one if so much less is asked for.
ALMOST_HALF, MARGIN = 0.49, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class ScreenLight:
    """A picture on a monitor, as far as dimming goes."""

    luminance: float  # Ī at full backlight [cd/m^2]
    loss: Array  # (K,): 𝓛_c at each knot of the backlight, beside full backlight


@dataclass(frozen=True, slots=True)
class FilmFrame:
    """What the track of a film wants while a frame of it is on screen."""

    factor: float  # share of what the user has set
    luminance: float  # Ī at full backlight [cd/m^2]


def limit_of_any_picture(rate_limit: ScalarRateLimit, white: float) -> ScalarRateLimit:
    """Return the limit [cd/m^2/s] of a white picture that keeps that of each darker one, too.

    A step Δb in Δt changes a picture by Ī Δb / Δt: its share of the limit is largest where ΔL(b·Ī) / Ī is
    least.

    >>> [limit_of_any_picture(lambda x: 2 + x, 100.0)(x) for x in (10.0, 100.0)]
    [12.0, 102.0]
    """
    lights = [float(light) for light in np.geomspace(1e-4, 1.0, 500) * white]
    least = np.minimum.accumulate([rate_limit(light) / light for light in lights])

    def limit(emitted: float) -> float:
        darker = float(least[max(bisect_right(lights, emitted) - 1, 0)])
        return min(rate_limit(emitted), emitted * darker)

    return limit


@dataclass(eq=False)
class MonitorDimmer:
    """One monitor's backlight."""

    backlight: Backlight  # open; its factors are shares of luminance
    clock: Callable[[], float]  # [s]
    rate_limit: ScalarRateLimit  # ΔL [cd/m^2/s] of b·Ī [cd/m^2]
    white: float  # Ī of a white picture at full backlight [cd/m^2]
    knots: Array  # (K,): factors of the loss of each picture, rising to 1
    target_loss: float  # share of the visible contrast that each picture may lose
    lowest: float  # share of what the user has set
    resting: bool = True  # until it has seen a picture
    film: FilmFrame | None = None  # what is wanted in place of the loss

    def __post_init__(self) -> None:
        self.ceiling = self.set_to = self.backlight.read_factor()
        self._changed, self._before = self.clock(), self.white
        self._of_any = limit_of_any_picture(self.rate_limit, self.white)
        self._loss, self._goal = np.zeros(len(self.knots)), self.ceiling
        self._asked: tuple[object, ...] = (None,) * 6  # of which that is the goal
        self._floor = 0.0  # set by a user who found full backlight dimmed too far
        # Where it stood when somebody lowered it, with what was the ceiling and the floor.
        self._lowered: list[tuple[float, float, float]] = []
        self.absent = ""  # why it can be neither read nor set
        self._room = self.backlight.step()
        self._shortest = max(SHORTEST, self.backlight.min_interval())

    @property
    def factor(self) -> float:
        """The share of what the user has set."""
        return min(self.set_to / self.ceiling, 1.0) if self.ceiling > 0 else 1.0

    @property
    def loss(self) -> float:
        """𝓛_c of the picture now, beside the brightness that the user has set; 0 before the first."""
        return float(self.loss_at(np.array([self.factor]))[0])

    @property
    def goal(self) -> float:
        """Where the backlight is wanted: at the lowest factor that loses no more than the target."""
        asked = self._loss, self.ceiling, self._floor, self.target_loss, self.resting, self.film
        if any(now is not before for now, before in zip(asked, self._asked, strict=True)):
            self._asked, self._goal = asked, self._wanted()
        return self._goal

    def _wanted(self) -> float:
        if self.resting or not self.ceiling > 0:
            return self.ceiling
        lowest = max(self.lowest * self.ceiling, self._floor, self.backlight.smallest_factor())
        lowest = min(lowest, self.ceiling)
        if self.film is not None:
            return max(self.film.factor * self.ceiling, lowest)
        factors = lowest + (self.ceiling - lowest) * WAY
        above = np.flatnonzero(self.loss_at(factors / self.ceiling) > self.target_loss)
        return float(factors[min(above[-1] + 1, len(WAY) - 1)]) if len(above) else lowest

    @property
    def reached(self) -> bool:
        """Whether the backlight is where it is wanted, to the nearest of its steps."""
        return not round((self.goal - self.set_to) / self._room)

    def due(self, now: float) -> float:
        """Return when to set it next [s]: when the limit has let it go a whole number of its steps."""
        light, limit = self._light_and_limit()
        slowest = limit(max(self.set_to - self._room, 0.0) * light) * (1 - MARGIN)
        interval = self._room * light / slowest if slowest > 0 else self._shortest
        wait = math.ceil(self._shortest / interval) * interval * (1 + 10 * ROUNDING)
        return max(self._changed + wait, now + self._shortest / 2)

    def see(self, light: ScreenLight) -> None:
        """Take note of what is on the monitor now."""
        self._loss, self.resting = light.loss, False

    def notice_user(self) -> bool:
        """Take a brightness that somebody else has set for what counts as full; return whether it is so."""
        try:
            found = self.backlight.read_factor()
            self.absent = "" if found >= self.backlight.smallest_factor() * (1 - ROUNDING) else "it is off"
        except InstrumentError as error:
            found, self.absent = self.set_to, str(error)
        if self.absent or abs(found - self.set_to) <= min(HALF_A_STEP * self._room, AS_SET):
            return False
        share = 1.0 if self.resting else self.factor
        full = found / share if share > 0 else found
        before = self.set_to, self.ceiling, self._floor
        near = max(self._room, min(SAME[0], SAME[1] * found))
        self.ceiling = min(full, 1.0)
        self._floor = 0.0 if full <= 1 + self._room else found
        while self._lowered and self._lowered[-1][0] < found - near:
            self._lowered.pop()
        if found < self.set_to:
            self._lowered.append(before)
        elif self._lowered and self._lowered[-1][0] <= found + near:
            _, self.ceiling, self._floor = self._lowered.pop()
        self.set_to, self._changed = found, self.clock()
        return True

    def step(self) -> bool:
        """Set the backlight as near to where it is wanted as the limit allows; return whether its user had.

        What they have set since the last reading is kept, and not set over. One step of the device is as
        small as any, however long it takes; more at a time make up for no longer standstill.
        """
        steps = round((self.goal - self.set_to) / self._room)
        passed = (self.clock() - self._changed) * (1 - MARGIN)
        at_once = self._allowed(steps, min(passed, 2 * self._shortest))
        count = max(at_once, min(self._allowed(steps, passed), 1))
        self._before = self._light_and_limit()[0]
        wanted = self.set_to + math.copysign((count - ALMOST_HALF) * self._room, steps)
        wanted = min(max(wanted, self.backlight.smallest_factor()), 1.0)
        if not steps or not count:
            return False
        if self.notice_user():
            return True
        try:
            self.set_to = self.set_to if self.absent else self.backlight.set_factor(wanted)
        except InstrumentError as error:  # it is off, or its user has set it at this moment
            self.absent = str(error)
        self._changed = self.clock()
        return False

    def _allowed(self, steps: int, passed: float) -> int:
        """Return how many steps of the device the limit allows after some time [s]."""
        light, limit = self._light_and_limit()
        goal = self.set_to + steps * self._room
        furthest = furthest_factor(self.set_to, goal, (self._before, light), passed, limit)
        return int(abs(furthest - self.set_to) / self._room + ROUNDING)

    def _light_and_limit(self) -> tuple[float, ScalarRateLimit]:
        if self.film is None or self.resting:
            return self.white, self._of_any
        return self.film.luminance, self.rate_limit

    def loss_at(self, shares: Array) -> Array:
        """Return 𝓛_c of the picture at shares of what the user has set, beside that."""
        kept = 1 - float(np.interp(self.ceiling, self.knots, self._loss))
        if not kept > 0:  # of a ceiling so low that nothing is visible
            return np.zeros(len(shares))
        beside = 1 - (1 - np.interp(shares * self.ceiling, self.knots, self._loss)) / kept
        return np.asarray(np.clip(beside, 0.0, 1.0))

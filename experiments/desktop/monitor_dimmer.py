"""Moves a monitor's backlight by what is on it, below what its user has set, within the rate limit.

What the user sets counts as full: the loss is that beside the picture at that brightness, and the factor is a
share of it. Whoever moves the backlight meanwhile (keys, a slider, a daemon) is right: the ceiling goes with
them, and the factor below it stays. Where that would be above full, it is dimmed no lower than what they set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.hardware.protocols import Backlight
from evenlight.method.rate_limit import ScalarRateLimit, furthest_factor

DARKEST = 1.0  # [cd/m^2] of a picture: in a black one no step would be seen, but in the next picture
SHORTEST = 0.02  # [s] between two settings
REACHED = 1e-4  # of a factor
HALF_A_STEP = 0.51  # of the backlight's steps: from here on somebody else has set it
LATE = 1.0  # [s] that a device may be in telling what it was set to


@dataclass(frozen=True, slots=True, eq=False)
class ScreenLight:
    """A picture on a monitor, as far as dimming goes."""

    luminance: float  # Ī at full backlight [cd/m^2]
    loss: Array  # (K,): 𝓛_c at each knot of the backlight, beside full backlight


class MonitorDimmer:
    """One monitor's backlight.

    Parameters
    ----------
    backlight : Backlight
        Open; its factors are shares of luminance.
    rate_limit : function
        ΔL [cd/m^2/s] of b·Ī [cd/m^2].
    knots : array, (K,)
        Factors b of the loss of each picture, rising to 1.
    target_loss : float
        The share of the visible contrast that each picture may lose.
    lowest : float
        The lowest share of what the user has set.
    """

    def __init__(
        self,
        backlight: Backlight,
        rate_limit: ScalarRateLimit,
        knots: Array,
        target_loss: float,
        lowest: float,
    ) -> None:
        self._backlight, self._rate_limit, self._knots = backlight, rate_limit, knots
        self._target, self._lowest = target_loss, lowest
        self.interval = max(backlight.min_interval(), SHORTEST)
        self.ceiling = self.set_to = backlight.read_factor()
        self._path = [(-np.inf, self.set_to)]  # when it was set, and to what
        self._light: ScreenLight | None = None
        self._before, self._changed = 0.0, -np.inf
        self._floor = 0.0  # set by a user who found full backlight dimmed too far
        self.resting = False

    @property
    def factor(self) -> float:
        """The share of what the user has set."""
        return min(self.set_to / self.ceiling, 1.0) if self.ceiling > 0 else 1.0

    @property
    def loss(self) -> float:
        """𝓛_c of the picture now, beside the brightness that the user has set; 0 before the first."""
        return 0.0 if self._light is None else float(self._loss_at(np.array([self.set_to]))[0])

    @property
    def goal(self) -> float:
        """Where the backlight is wanted: at the lowest factor that loses no more than the target."""
        if self.resting or self._light is None:
            return self.ceiling
        lowest = max(self._lowest * self.ceiling, self._floor, self._backlight.smallest_factor())
        lowest = min(lowest, self.ceiling)
        at = np.concatenate(
            [[lowest], self._knots[(self._knots > lowest) & (self._knots < self.ceiling)], [self.ceiling]]
        )
        loss = self._loss_at(at)
        above = np.flatnonzero(loss > self._target)
        if not len(above):
            return lowest
        k = int(above[-1])
        share = (loss[k] - self._target) / (loss[k] - loss[k + 1])
        return float(at[k] + share * (at[k + 1] - at[k]))

    @property
    def reached(self) -> bool:
        """Whether the backlight is where it is wanted."""
        return abs(self.set_to - self.goal) <= REACHED

    def see(self, light: ScreenLight) -> None:
        """Take note of what is on the monitor now."""
        self._light = light

    def notice_user(self, now: float) -> bool:
        """Take a brightness that somebody else has set for what counts as full; return whether it is so."""
        found = self._set_by_others(now)
        if found is None:
            return False
        share = self.factor
        full = found / share if share > 0 else found
        self.ceiling = min(full, 1.0)
        self._floor = 0.0 if self.resting or full <= 1 + self._backlight.step() else found
        self.set_to, self._path = found, [(now, found)]
        return True

    def _set_by_others(self, now: float) -> float | None:
        """Return where somebody else has set the backlight; None if nobody has.

        A device may be late to tell what it was set to: where it was within the last second is its own way,
        but for what it has told to be past.
        """
        while len(self._path) > 1 and self._path[1][0] <= now - LATE:
            del self._path[0]
        found, room = self._backlight.read_factor(), HALF_A_STEP * self._backlight.step()
        for k in reversed(range(len(self._path))):
            between = [factor for _, factor in self._path[k : k + 2]]
            if min(between) - room <= found <= max(between) + room:
                del self._path[:k]
                return None
        return found

    def step(self, now: float) -> bool:
        """Set the backlight as near to where it is wanted as the limit allows; return whether it was set.

        Somebody else may have moved it since the last look: that is kept, and not set over.
        """
        if self._set_by_others(now) is not None:
            return False
        goal, light = self.goal, DARKEST if self._light is None else max(self._light.luminance, DARKEST)
        passed = min(now - self._changed, 2 * self.interval)  # standing still saves up no jump
        luminance, self._before = (self._before or light, light), light
        furthest = furthest_factor(self.set_to, goal, luminance, passed, self._rate_limit)
        wanted = min(goal, furthest) if goal > self.set_to else max(goal, furthest)
        if wanted == self.set_to:
            return False
        achieved = self._backlight.set_factor(max(wanted, self._backlight.smallest_factor()))
        self._path.append((now, achieved))
        self.set_to, self._changed = wanted, now
        return True

    def _loss_at(self, factors: Array) -> Array:
        """Return 𝓛_c of the picture at factors of the backlight, beside the ceiling."""
        assert self._light is not None
        kept = 1 - float(np.interp(self.ceiling, self._knots, self._light.loss))
        if not kept > 0:  # of a ceiling so low that nothing is visible
            return np.zeros(len(factors))
        beside = 1 - (1 - np.interp(factors, self._knots, self._light.loss)) / kept
        return np.asarray(np.clip(beside, 0.0, 1.0))

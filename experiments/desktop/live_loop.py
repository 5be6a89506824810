"""Dims a desktop: looks at the monitors a few times a second, and moves each backlight between."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from evenlight.experiments.desktop.live_state import LiveState, MonitorState
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer
from evenlight.experiments.desktop.screens import WatchedScreen

LOOKS = 0.25  # [s] between two
TOLD = 2.0  # [s] between two states that are kept


@dataclass(frozen=True, slots=True)
class Monitor:
    """A monitor: what looks at it, and what moves its backlight."""

    backlight: str
    screen: WatchedScreen
    dimmer: MonitorDimmer
    bring_back: Callable[[float], None]  # is told the brightness that its user has set


class LiveLoop:
    """The work of `evenlight live`.

    Parameters
    ----------
    monitors : sequence of Monitor
        Each with its own backlight.
    clock, sleep : callable
        Time [s], and what waits [s].
    resting : callable
        Says why nothing is to be dimmed now; empty for no reason.
    tell, keep : callable
        Is told what happens; is given the state.
    watts : float, optional
        That a factor of 1 takes of a monitor [W].
    """

    def __init__(
        self,
        monitors: Sequence[Monitor],
        clock: Callable[[], float],
        sleep: Callable[[float], None],
        resting: Callable[[float], str],
        tell: Callable[[str], None],
        keep: Callable[[LiveState], None],
        watts: float | None = None,
    ) -> None:
        self._monitors, self._clock, self._sleep = monitors, clock, sleep
        self._resting, self._tell, self._keep, self._watts = resting, tell, keep, watts
        self._begun = self._counted = clock()
        self._work = time.process_time()
        self._look_at = self._tell_at = self._begun
        self._why = ""
        self._mean, self._saved = 0.0, 0.0
        self.paused = False

    def run_once(self) -> None:
        """Look if that is due, move the backlights, and wait for what comes next."""
        now = self._clock()
        if now >= self._look_at:
            self._look(now)
            self._look_at = max(self._look_at + LOOKS, now)
        moving = [one.dimmer for one in self._monitors if not one.dimmer.reached]
        for dimmer in moving:
            dimmer.step(now)
        until = min([self._look_at, *(now + dimmer.interval for dimmer in moving)])
        self._sleep(max(until - self._clock(), 0.0))

    def _look(self, now: float) -> None:
        why = "paused" if self.paused else self._resting(now)
        if why != self._why:
            self._tell(f"resting: {why}" if why else "dimming again")
            self._why = why
        for one in self._monitors:
            if one.dimmer.notice_user(now):
                one.bring_back(one.dimmer.ceiling)
                self._tell(f"{one.backlight} was set to {one.dimmer.set_to:.0%}: kept")
            one.dimmer.resting = bool(why)
            if not why:
                one.dimmer.see(one.screen.look(now))
        self._count(now)
        if now >= self._tell_at:
            self._keep(self.state(now))
            self._tell_at = now + TOLD

    def _count(self, now: float) -> None:
        passed, self._counted = now - self._counted, now
        for one in self._monitors:
            self._mean += passed * one.dimmer.factor / len(self._monitors)
            if self._watts is not None:
                self._saved += self._watts * (one.dimmer.ceiling - one.dimmer.set_to) * passed / 3600

    def state(self, now: float) -> LiveState:
        """Return what is now."""
        seconds = now - self._begun
        monitors = tuple(
            MonitorState(one.backlight, one.dimmer.ceiling, one.dimmer.factor, one.dimmer.loss, self._why)
            for one in self._monitors
        )
        saved = None if self._watts is None else self._saved
        mean = self._mean / max(self._counted - self._begun, 1e-9)
        return LiveState(os.getpid(), seconds, mean, saved, time.process_time() - self._work, monitors)

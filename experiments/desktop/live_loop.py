"""Dims a desktop: looks at the monitors a few times a second, and moves each backlight between."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from evenlight.experiments.desktop.live_state import PAUSED, DayTotal, LiveState, MonitorState, day
from evenlight.experiments.desktop.loss_target import LossTarget
from evenlight.experiments.desktop.monitor_dimmer import FilmFrame, MonitorDimmer
from evenlight.experiments.desktop.screens import WatchedScreen, processor_time

LOOKS = 0.25  # [s] between two
TOLD = 2.0  # [s] between two states that are kept


@dataclass(slots=True)
class Monitor:
    """A monitor: what looks at it, and what moves its backlight."""

    backlight: str
    screen: WatchedScreen
    dimmer: MonitorDimmer
    bring_back: Callable[[float], None]  # is told the brightness that its user has set
    film: Callable[[float], FilmFrame | None] = lambda _: None  # what a film's track wants
    target: LossTarget | None = None  # moves the loss by a budget
    resting: str = ""  # why it is not dimmed


@dataclass(eq=False)
class LiveLoop:
    """The work of `evenlight live`."""

    monitors: Sequence[Monitor]
    clock: Callable[[], float]  # [s]
    sleep: Callable[[float], None]
    resting: Callable[[float], str]  # why nothing is to be dimmed now; empty for no reason
    tell: Callable[[str], None]
    keep: Callable[[LiveState], None]
    watts: float | None = None  # that a factor of 1 takes of a monitor [W]
    measured: Iterator[float | None] = field(default_factory=lambda: itertools.repeat(None))  # by a meter [W]
    today: DayTotal = field(default_factory=DayTotal)  # what was counted before
    paused: bool = False

    def __post_init__(self) -> None:
        self._look_at = self._tell_at = self._counted = self.clock()
        self._work = processor_time()

    def run_once(self) -> None:
        """Look if that is due, move the backlights, and wait for what comes next."""
        now = self.clock()
        for one in self.monitors:
            one.dimmer.film = one.film(now)
        if now >= self._look_at:
            self._look(now)
            self._look_at = max(self._look_at + LOOKS, now)
        due = [self._look_at]
        for one in self.monitors:
            if not one.dimmer.absent and (one.dimmer.film is not None or not one.dimmer.reached):
                self._keep(one, one.dimmer.step())
                due.append(one.dimmer.due(self.clock()))
        self.sleep(max(min(due) - self.clock(), 0.0))

    def _look(self, now: float) -> None:
        why, passed = PAUSED if self.paused else self.resting(now), now - self._counted
        for one in self.monitors:
            self._keep(one, one.dimmer.notice_user())
            reason = one.dimmer.absent or why or self._look_at_one(one, now, passed)
            one.dimmer.resting = bool(reason)
            if reason != one.resting:
                self.tell(f"{one.backlight} " + (f"rests: {reason}" if reason else "is dimmed again"))
            one.resting = reason
        self._count(now, passed)
        if now >= self._tell_at:
            self.keep(self.state())
            self._tell_at = now + TOLD

    def _keep(self, one: Monitor, by_user: bool) -> None:
        if by_user:
            one.bring_back(one.dimmer.ceiling)
            self.tell(f"{one.backlight} was set to {one.dimmer.set_to:.0%}: kept")

    def _look_at_one(self, one: Monitor, now: float, passed: float) -> str:
        """See what is on a monitor; return why it is not to be dimmed."""
        if one.dimmer.film is not None:
            return ""
        if (light := one.screen.look(now)) is None:
            return "there is no picture of its monitor"
        one.dimmer.see(light)
        if one.target is not None:
            one.target.move(passed)
        return ""

    def _count(self, now: float, passed: float) -> None:
        if self.today.day != day():
            self.today = DayTotal()
        before, self._counted, self._work = self._work, now, processor_time()
        below = sum(one.dimmer.ceiling - one.dimmer.set_to for one in self.monitors)
        self.today.seconds += passed
        self.today.dimmed += passed * sum(one.dimmer.factor for one in self.monitors) / len(self.monitors)
        self.today.saved_wh += (self.watts or 0.0) * below * passed / 3600
        self.today.work_s += self._work - before

    def state(self) -> LiveState:
        """Return what is now."""
        monitors = tuple(
            MonitorState(
                one.backlight, one.dimmer.ceiling, one.dimmer.factor, one.dimmer.loss,
                f"rests: {one.resting}" if one.resting else "by a film's track" if one.dimmer.film else "",
            )
            for one in self.monitors
        )  # fmt: skip
        return LiveState(os.getpid(), self.today, self.watts is not None, monitors, next(self.measured))

"""Follows a player until it ends, and sums up how far behind the picture the backlight was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.quantities import quantity
from evenlight.experiments.follow.limited_backlight import LimitedBacklight
from evenlight.experiments.follow.mpv_player import MpvPlayer

WORTH_SAYING = 0.5  # [s] that the backlight takes to catch up
SHOWN_EVERY = 0.5  # [s] of what is shown without a backlight
ON_TARGET = 0.01  # of the factor wanted


@dataclass(frozen=True, slots=True)
class FollowedSetting:
    """One setting of the backlight, a row of the log."""

    time: float = quantity("s", "since the begin")
    position: float | None = quantity("s", "of the film, on screen; empty without the film")
    frame: int | None = quantity("1", "on screen; empty without the film")
    wanted_factor: float = quantity("1", "factor of that frame")
    set_factor: float = quantity("1", "factor that the rate limit allowed")
    achieved_factor: float = quantity("1", "factor of the backlight's nearest step")
    behind_picture: float | None = quantity(
        "s", "how long after its frame appeared the wanted factor was first there; empty in other settings"
    )


@dataclass(eq=False)
class FollowLoop:
    """A backlight that follows a player."""

    player: MpvPlayer
    follower: LimitedBacklight
    clock: Callable[[], float]  # the player's [s]
    tell: Callable[[str], None]  # is told what happens
    keep: Callable[[FollowedSetting], None]  # is given every setting

    def __post_init__(self) -> None:
        self._begun = self._looked = self.clock()
        self._jumps, self._away = -1, False
        self._frame: int | None = None
        self._awaited = False  # whether the frame on screen is new, and its factor not yet reached
        self._n_new = 0  # frames that came one after the other
        self._shown_at: float | None = None
        self._last: FollowedSetting | None = None
        self._n_settings, self._watched, self._on_target, self._off = 0, 0.0, 0.0, 0.0
        self.delays: list[float] = []  # how long after it appeared each new frame had its factor [s]

    def run(self, show: Callable[[str], None], there: Callable[[], None] = lambda: None) -> None:
        """Follow until the player ends.

        Parameters
        ----------
        show : callable
            Is shown what is set, some times a second.
        there : callable, optional
            Is called once, when the backlight is first where the film wants it.
        """
        due, awaited = self.clock(), True
        while not self.player.ended():
            due = max(due + self.follower.interval, self.clock())
            self.player.wait(max(due - self.clock(), 0.0))
            self.follow_once()
            if awaited and self._frame is not None and self.follower.reached(self._frame):
                awaited = False
                there()
            self._show(show)

    def glide_back(self) -> None:
        """Go back to the brightness of before, within the limit."""
        self._say_way("the player has ended: back to the brightness of before (Ctrl-C: at once)", None)
        while not self.follower.reached(None):
            self.player.wait(self.follower.interval)
            self._set(None, None, self.clock())

    def follow_once(self) -> None:
        """Set the backlight for what is on screen now."""
        now, state = self.clock(), self.player.state
        position = state.position(now)
        if position is not None:
            self._set(state.frame(position), position, now)
            if state.jumps != self._jumps:
                where = "at" if self._jumps < 0 or self._away else "seek to"
                self._jumps = state.jumps
                self._say_way(f"{where} {_minutes(position)}: catching up", self._frame)
            self._away = False
            self._judge(now)
        elif state.plays_film is False:
            if not self._away:
                self._say_way(
                    f"the player plays {state.playing or 'nothing'}: back to the brightness of before", None
                )
            self._set(None, None, now)
            self._away = True
        self._looked = now

    def _set(self, frame: int | None, position: float | None, now: float) -> None:
        """Take the next step towards what a frame wants, and keep it."""
        if frame != self._frame:
            self._awaited = frame is not None and self._jumps == self.player.state.jumps
            self._n_new += self._awaited
            self._frame = frame
        if not self.follower.step(frame, now):
            return
        behind, speed = None, self.player.state.speed()
        if self._awaited and frame is not None and position is not None and self.follower.reached(frame):
            self._awaited = False
            if speed > 0:
                behind = self.clock() - now + (position - float(self.follower.film.times[frame])) / speed
                self.delays.append(behind)
        self._n_settings += 1
        self._last = FollowedSetting(
            now - self._begun, position, frame, self.follower.wanted(frame), self.follower.factor,
            self.follower.achieved, behind,
        )  # fmt: skip
        self.keep(self._last)

    def _judge(self, now: float) -> None:
        """Count how long the backlight is where the film wants it."""
        wanted = self.follower.wanted(self._frame)
        self._off = abs(self.follower.factor - wanted)
        self._watched += now - self._looked
        self._on_target += (now - self._looked) * (self._off <= ON_TARGET * wanted)

    def _say_way(self, words: str, frame: int | None) -> None:
        """Say how long the way to a frame's factor takes, if that is long."""
        seconds = self.follower.seconds_to(frame, self.player.state.speed())
        if seconds > WORTH_SAYING:
            self.tell(f"{words}, about {seconds:.0f} s at the rate limit")

    def _show(self, show: Callable[[str], None]) -> None:
        now = self.clock()
        last = self._last
        if last is not None and (self._shown_at is None or now - self._shown_at >= SHOWN_EVERY):
            self._shown_at = now
            where = "no film" if last.position is None else f"{_minutes(last.position)} frame {last.frame}"
            show(f"{where}: factor {last.set_factor:.4f} of {last.wanted_factor:.4f} wanted")

    def summary(self) -> str:
        """Return how it went, in one line."""
        words = f"{self._n_settings} settings"
        if self._watched:
            words += (
                f"; within {ON_TARGET:.0%} of the factor wanted for {self._on_target / self._watched:.0%} of "
                f"the time with the film, {self._off:.3f} off at its end"
            )
        if not self.delays:
            return words
        low, median, high, late = 1e3 * np.percentile(self.delays, [25, 50, 75, 95])
        return (
            f"{words}; backlight behind the picture by {median:.1f} ms (median), {late:.1f} ms (95 %), "
            f"jitter {high - low:.1f} ms (interquartile range) in {len(self.delays)} of {self._n_new} "
            "frames; the others had their factor already, or the limit kept it from them; the delays of "
            "screen and backlight are not in it"
        )


def _minutes(position: float) -> str:
    """Return a position in a film [s] in minutes and seconds.

    >>> _minutes(83.4)
    '1:23.4'
    """
    return f"{int(position // 60)}:{position % 60:04.1f}"

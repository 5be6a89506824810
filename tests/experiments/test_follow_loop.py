"""A backlight that follows a film: which frame is on screen, and no step faster than the rate limit."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.experiments.follow.follow_loop import FollowedSetting, FollowLoop
from evenlight.experiments.follow.limited_backlight import (
    FilmLight,
    LimitedBacklight,
)
from evenlight.experiments.follow.playback_state import PlaybackState
from evenlight.experiments.follow.watchdog import watched_backlight
from evenlight.hardware.simulated.panel import SimulatedBacklight
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.rate_limit import rate_limit_at, scalar_rate_limit

RATE, PEAK = 25.0, 100.0
FLAT = RateLimit("flat", "d", "", RateLimitForm.RATE, (2.0,), (1e-3, 1000.0))  # 2 cd/m^2/s at any luminance
PAPERS = load_rate_limit("surace2025")


def film(factors: Sequence[float], luminance: Sequence[float] | float = 50.0) -> FilmLight:
    """A film of 25 frames a second."""
    b = np.asarray(factors, dtype=float)
    return FilmLight(
        np.arange(len(b)) / RATE,
        np.full(len(b), 1 / RATE),
        b,
        np.broadcast_to(luminance, b.shape).astype(float),
        PEAK,
    )


class ScriptedPlayer:
    """A player on its own clock, which tells its film as mpv does: each frame when the one before appears."""

    def __init__(self, light: FilmLight) -> None:
        self.state = PlaybackState(light.times, lambda path, folder: path == "film")
        self._times, self.now, self._told = light.times, 0.0, -1.0
        self._position, self.speed, self.playing, self.over = 0.0, 1.0, True, False
        self._say("working-directory", "/")
        self._say("path", "film")
        self.go(0.0)

    def _say(self, name: str, value: Any) -> None:
        self.state.take({"event": "property-change", "name": name, "data": value}, self.now)

    def go(self, position: float) -> None:
        """Seek, as mpv tells it."""
        self._position = position
        self.state.take({"event": "seek"}, self.now)
        for name, value in (("core-idle", True), ("seeking", True)):
            self._say(name, value)
        self._say("time-pos", float(self._times[self._frame()]))
        self._say("seeking", False)
        self._say("core-idle", not self.playing)
        self._told = -1.0

    def play(self, *, playing: bool) -> None:
        self.playing = playing
        self._say("core-idle", not playing)

    def run_at(self, speed: float) -> None:
        self.speed = speed
        self._say("speed", speed)

    def change_file(self, path: str | None) -> None:
        self.state.take({"event": "start-file"}, self.now)
        self._say("path", path)
        if path == "film":
            self.go(0.0)

    def _frame(self) -> int:
        return max(int(np.searchsorted(self._times, self._position + 1e-9, side="right")) - 1, 0)

    def wait(self, seconds: float) -> None:
        """Let time pass, and tell each frame at its very moment."""
        end = self.now + seconds
        while self.playing and self.state.playing == "film":
            following = self._frame() + 1
            announced = self._times[min(following, len(self._times) - 1)]
            if announced != self._told:
                self._told = announced
                self._say("time-pos", float(announced))
            if following == len(self._times):
                break
            moment = self.now + (self._times[following] - self._position) / self.speed
            if moment > end:
                break
            self.now, self._position = moment, float(self._times[following])
        if self.playing and self.state.playing == "film":
            self._position += (end - self.now) * self.speed
        self.now = end

    def ended(self) -> bool:
        return self.over


class Desk:
    """A scripted player, a simulated backlight, and every step that is taken."""

    def __init__(
        self, light: FilmLight, limit: RateLimit = FLAT, steps: int = 4095, found: float | None = None
    ) -> None:
        self.light, self.limit, self.said = light, limit, list[str]()
        self.player = ScriptedPlayer(light)
        self.backlight = SimulatedBacklight(lambda: self.player.now, steps, time_constant=1e-9)
        if found is not None:
            self.backlight.set_factor(found)
            self.player.now += 1.0
        self.follower = LimitedBacklight(self.backlight, light, scalar_rate_limit(limit))
        self.steps: list[tuple[float, float, float]] = []  # time, Ī on screen, factor
        inner = self.follower.step

        def noted(frame: int | None, now: float) -> bool:
            moved = inner(frame, now)
            luminance = light.white if frame is None else light.luminance[frame]
            self.steps.append((now, float(luminance), self.follower.factor))
            return moved

        self.follower.step = noted  # type: ignore[method-assign] # what is taken, as it is taken
        self.settings: list[FollowedSetting] = []
        self.following = FollowLoop(
            self.player, self.follower, lambda: self.player.now, self.said.append, self.settings.append
        )

    def run(self, seconds: float, interval: float = 0.01) -> None:
        for _ in range(round(seconds / interval)):
            self.player.wait(interval)
            self.following.follow_once()

    def largest_share_of_limit(self) -> float:
        """The largest rate of a step as a share of its limit, as docs/decisions/rate-constraint.md has it.

        A step takes the time since the one before, but no longer than a frame lasts.
        """
        shares = [0.0]
        changed = -math.inf
        for (_, i1, b1), (now, i2, b2) in zip(self.steps[:-1], self.steps[1:], strict=True):
            if b1 != b2:
                limit = min(rate_limit_at(self.limit, [b1 * i1, b2 * i2]).tolist())
                change = abs(b2 - b1) * (i1 + i2) / 2
                shares.append(change / limit / min(now - changed, 1 / RATE) if change else 0.0)
                changed = now
        return max(shares)


def test_the_picture_is_the_frame_before_the_one_that_the_player_names() -> None:
    """mpv names frame k when frame k - 1 appears; between messages the clock goes on, not past frame k."""
    state = PlaybackState(np.arange(10) * 0.04, lambda path, folder: True)
    for name, value in (
        ("working-directory", "/"),
        ("path", "film"),
        ("core-idle", False),
        ("time-pos", 0.16),
        ("time-pos", 0.2),
    ):
        state.take({"event": "property-change", "name": name, "data": value}, 5.0)
    assert state.position(5.0) == pytest.approx(0.16)
    assert state.position(5.03) == pytest.approx(0.19)
    assert [state.frame(state.position(now) or 0.0) for now in (5.0, 5.03, 5.05)] == [4, 4, 5]
    assert state.position(9.0) == 0.2  # the player says no more: it shows frame 5 and waits
    state.take({"event": "property-change", "name": "core-idle", "data": True}, 5.02)
    assert state.position(7.0) == 0.2  # a player that is paused shows the frame that it named


def test_a_late_message_hardly_moves_the_clock_and_a_speed_moves_it_faster() -> None:
    state = PlaybackState(np.arange(100) * 0.04, lambda path, folder: True)

    def say(name: str, value: Any, now: float) -> None:
        state.take({"event": "property-change", "name": name, "data": value}, now)

    for name, value in (
        ("path", "film"),
        ("working-directory", "/"),
        ("time-pos", 0.0),
        ("core-idle", False),
    ):
        say(name, value, 0.0)
    for k in range(1, 6):
        say("time-pos", 0.04 * k, 0.04 * (k - 1))
    say("time-pos", 0.24, 0.23)  # 30 ms late: a tenth of it counts
    assert state.position(0.23) == pytest.approx(0.227)
    say("speed", 2.0, 0.23)
    assert state.position(0.235) == pytest.approx(0.237)


@pytest.mark.parametrize(
    ("zero", "rebases", "named"), [(3600.0, True, 2.0), (0.0, True, 3602.0), (3600.0, False, 3602.0)]
)
def test_positions_count_from_the_first_stamp_of_the_file(zero: float, rebases: bool, named: float) -> None:
    """A player counts from any stamp, its zero, or from none, and says so."""
    state = PlaybackState(np.arange(5.0), lambda path, folder: True, start=3600.0)
    said = {
        "working-directory": "/",
        "path": "film",
        "rebase-start-time": rebases,
        "demuxer-start-time": zero,
    }
    for name, value in (said | {"time-pos": named}).items():
        state.take({"event": "property-change", "name": name, "data": value}, 0.0)
    assert state.position(0.0) == 2.0


@pytest.mark.parametrize(("path", "idle"), [(None, True), ("another", False)])
def test_without_the_film_there_is_no_position(path: str | None, idle: bool) -> None:
    state = PlaybackState(np.arange(5.0), lambda path, folder: path == "film")
    assert state.plays_film is None
    for name, value in (("working-directory", "/"), ("path", path), ("idle-active", idle), ("time-pos", 1.0)):
        state.take({"event": "property-change", "name": name, "data": value}, 0.0)
    assert (state.plays_film, state.position(1.0)) == (False, None)


def test_after_a_seek_it_moves_as_fast_as_the_limit_allows_and_says_how_long() -> None:
    """From 0.9 to 0.3 at Ī = 50 cd/m^2 and 2 cd/m^2/s: 0.6 · 50 / 2 = 15 s."""
    desk = Desk(film([0.9] * 100 + [0.3] * 1000), found=0.9)
    desk.run(1.0)
    assert desk.said == []
    assert desk.follower.factor == 0.9
    desk.player.go(5.0)
    desk.run(14.9)
    assert desk.said == ["seek to 0:05.0: catching up, about 15 s at the rate limit"]
    assert desk.follower.factor == pytest.approx(0.3 + 0.1 * 2 / 50, abs=0.002)
    desk.run(0.2)
    assert desk.follower.factor == 0.3
    assert desk.largest_share_of_limit() == pytest.approx(1.0, abs=1e-6)


def test_what_it_takes_to_catch_up_counts_that_the_film_goes_on() -> None:
    """The film falls by 0.02 a second and the backlight by 0.04: 0.2 take 10 s, at pause 5 s."""
    desk = Desk(film(0.7 - 0.02 / RATE * np.arange(500)), found=0.9)
    assert desk.follower.seconds_to(0, 1.0) == pytest.approx(10.0, abs=0.5)
    assert desk.follower.seconds_to(0, 0.0) == pytest.approx(5.0, abs=0.5)


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_once_there_it_follows_every_frame_of_a_track_within_the_limit(speed: float) -> None:
    """0.9 of the limit: 1.8 cd/m^2/s at Ī = 50 are 0.036 a second."""
    b = 0.8 - 0.036 / RATE * np.arange(100)
    desk = Desk(film(b), found=0.8)
    desk.player.run_at(speed)
    desk.run(3.02)
    assert [one.wanted_factor for one in desk.settings] == [one.set_factor for one in desk.settings]
    assert desk.settings[-1].frame == int(3.02 * speed * RATE)
    assert desk.settings[-1].set_factor == b[int(3.02 * speed * RATE)]


def test_a_film_at_another_speed_does_not_move_the_backlight_faster_than_the_limit() -> None:
    desk = Desk(film(0.8 - 0.036 / RATE * np.arange(200)), found=0.8)
    desk.player.run_at(4.0)
    desk.run(1.5)
    assert desk.follower.factor > desk.follower.wanted(149) + 0.1
    assert desk.largest_share_of_limit() <= 1.0


def test_at_pause_it_holds_the_factor_of_the_picture() -> None:
    desk = Desk(film(0.8 - 0.036 / RATE * np.arange(200)), found=0.8)
    desk.run(2.0)
    desk.player.play(playing=False)
    desk.run(0.1)
    held, settings_made = desk.follower.factor, len(desk.settings)
    desk.run(5.0)
    assert (desk.follower.factor, len(desk.settings)) == (held, settings_made)
    assert held == pytest.approx(0.8 - 0.036 * 2.0, abs=2 * 0.036 / RATE)


def test_a_film_that_waits_begins_when_the_light_is_there() -> None:
    """From 0.9 to 0.8 at Ī = 50 and 2 cd/m^2/s it is 2.5 s."""
    desk = Desk(film([0.8] * 100), found=0.9)
    player, begun = desk.player, []
    player.play(playing=False)

    def there() -> None:
        begun.append((player.now, desk.follower.factor))
        player.play(playing=True)
        player.over = len(begun) > 0

    began = player.now
    desk.following.run(lambda words: None, there)
    assert begun == [(pytest.approx(began + 2.5, abs=0.1), 0.8)]
    assert {setting.frame for setting in desk.settings} == {0}


def test_another_file_and_the_end_bring_the_brightness_of_before_back_within_the_limit() -> None:
    """White of 100 cd/m^2 counts then: from 0.4 to 0.5 it is 0.1 · 100 / 2 = 5 s."""
    desk = Desk(film([0.4] * 2000), found=0.5)
    desk.run(4.0)  # from 0.5 to 0.4 at Ī = 50: 2.5 s
    assert desk.follower.factor == 0.4
    desk.player.change_file("another")
    desk.run(5.1)
    assert (
        desk.said[-1]
        == "the player plays another: back to the brightness of before, about 5 s at the rate limit"
    )
    assert desk.follower.factor == desk.follower.found == pytest.approx(0.5, abs=1 / 4095)
    desk.player.change_file("film")
    desk.run(4.0)
    assert desk.follower.factor == 0.4
    desk.player.over, begun = True, desk.player.now
    desk.following.run(desk.said.append)
    assert desk.player.now == begun
    desk.following.glide_back()
    assert desk.player.now - begun == pytest.approx(5.0, abs=0.1)
    assert desk.follower.reached(None)
    assert desk.largest_share_of_limit() <= 1.0


ACTIONS = st.lists(
    st.tuples(
        st.sampled_from(["go", "pause", "play", "speed", "file", "wait"]),
        st.floats(0.0, 1.0),
        st.floats(0.0, 1.0),
    ),
    min_size=1,
    max_size=10,
)


@given(
    actions=ACTIONS,
    found=st.floats(0.05, 1.0),
    interval=st.floats(0.01, 0.4),
    limit=st.sampled_from([FLAT, PAPERS]),
    shots=st.lists(st.tuples(st.floats(0.2, 1.0), st.sampled_from([0.0, 0.01, 3.0, 60.0])), min_size=1),
)
@settings(max_examples=60)
def test_no_step_is_faster_than_the_limit_whatever_the_player_does(
    actions: list[tuple[str, float, float]],
    found: float,
    interval: float,
    limit: RateLimit,
    shots: list[tuple[float, float]],
) -> None:
    """Seeks, pauses, speeds, files, cuts to black, slow backlights; factors that jump as no track may."""
    shots = [shot for shot in shots for _ in range(10)]
    desk = Desk(film([b for b, _ in shots], [light for _, light in shots]), limit, steps=100, found=found)
    for action, size, seconds in actions:
        if action == "go":
            desk.player.go(size * float(desk.light.times[-1]))
        elif action in ("pause", "play"):
            desk.player.play(playing=action == "play")
        elif action == "speed":
            desk.player.run_at(0.25 + 7.75 * size)
        elif action == "file":
            desk.player.change_file("film" if size > 0.5 else "another")
        desk.run(max(seconds, interval), interval)
    assert desk.largest_share_of_limit() <= 1.0
    for one in desk.settings:  # and the backlight is at its step nearest to that
        assert abs(one.achieved_factor - one.set_factor) <= 0.5 / 100 + 1e-9


def test_the_delay_is_that_from_the_picture_to_the_setting() -> None:
    """Frames come every 40 ms, settings every 30 ms from 30 ms on: frames 1, 2, 3 wait for 20, 10, 0 ms."""
    desk = Desk(film(0.8 - 1e-4 * np.arange(100)), found=0.8)
    desk.run(0.121, 0.03)
    assert [one.frame for one in desk.settings][-3:] == [1, 2, 3]
    assert [round(1e3 * delay, 6) for delay in desk.following.delays] == [20.0, 10.0, 0.0]
    # Linear between 0, 10 and 20 ms: 95 % at 10 + 0.9 · 10, the quartiles at 5 and 15.
    words = "by 10.0 ms (median), 19.0 ms (95 %), jitter 10.0 ms (interquartile range) in 3 of 3 frames"
    assert words in desk.following.summary()


def test_the_summary_says_how_long_it_was_on_target_and_how_far_off_it_was_at_the_end() -> None:
    """0.06 a second wanted and 0.04 a second allowed: b = 0.8 - 0.04 · 5.02 in frame 125, which wants 0.5.

    It is within 1 % of 0.8 - 0.06 t while 0.02 t <= 0.008 - 0.0006 t: for 0.39 s, 8 % of the time.
    """
    desk = Desk(film(0.8 - 0.06 / RATE * np.arange(200)), found=0.8)
    desk.run(5.02)
    words = r"within 1% of the factor wanted for 8% of the time with the film, (0\.\d{3}) off at its end; "
    said = re.search(words, desk.following.summary())
    assert said is not None
    assert float(said[1]) == pytest.approx(0.0992, abs=0.001)  # settings come every 10 ms


def test_a_program_that_was_held_up_has_saved_up_no_jump() -> None:
    """A frame of 0.04 s allows 2 · 0.04 / 50 = 0.0016; the first from a white screen 2 · 0.04 / 75."""
    desk = Desk(film([0.3] * 1000), found=0.8)
    desk.run(0.01)
    assert desk.said == ["at 0:00.0: catching up, about 12 s at the rate limit"]
    steps = [desk.follower.found - desk.follower.factor]
    for _ in range(2):
        before = desk.follower.factor
        desk.run(2.0, 2.0)
        steps.append(before - desk.follower.factor)
    assert steps == pytest.approx([0.08 / 75, 0.0016, 0.0016], rel=1e-6)


def test_the_log_has_every_setting(tmp_path: Path) -> None:
    desk = Desk(film(0.8 - 1e-4 * np.arange(100)), found=0.8, steps=100)
    desk.run(0.121, 0.03)
    with AppendedRows(tmp_path / "log.csv", FollowedSetting) as log:
        log.append(desk.settings)
    header, *rows = (tmp_path / "log.csv").read_text().splitlines()
    assert header == "time_s,position_s,frame,wanted_factor,set_factor,achieved_factor,behind_picture_s"
    assert len(rows) == len(desk.settings)
    cells = [float(cell) for cell in rows[-1].split(",")]
    assert cells == pytest.approx([0.12, 0.12, 3, 0.7997, 0.7997, 0.8, 0.0], abs=1e-9)


def test_a_film_darker_than_the_backlight_can_be_is_refused() -> None:
    with pytest.raises(InputError, match=r"down to the factor 0\.2, and this backlight.*to 0\.5"):
        Desk(film([0.2, 0.5]), steps=2)


def test_a_backlight_with_its_measured_curve_is_set_by_share_of_light(tmp_path: Path) -> None:
    """A square law: 25 of 100 cd/m^2 at half of its steps."""
    path = tmp_path / "brightness.csv"
    path.write_text("factor,achieved_factor,luminance_cd_m2\n0.2,0.2,4\n0.5,0.5,25\n1,1,100\n")
    with watched_backlight("simulated", str(path)) as backlight:
        follower = LimitedBacklight(backlight, film([0.25]), scalar_rate_limit(FLAT))
        assert follower.found == pytest.approx(1.0, abs=1e-6)
        for tick in range(2000):
            follower.step(0, tick * 0.1)
        assert follower.achieved == pytest.approx(0.25, abs=backlight.step())


def test_a_black_screen_begins_at_the_lowest_step() -> None:
    """From off no relative change leads up: the step to the lowest factor is free, those after it are not."""
    backlight = SimulatedBacklight(lambda: 1.0, steps=100)
    backlight.read_factor = lambda: 0.0  # type: ignore[method-assign] # it is off
    follower = LimitedBacklight(backlight, film([0.5]), scalar_rate_limit(FLAT))
    assert (follower.found, follower.achieved) == (0.0, 0.01)
    follower.step(None, 1.0)
    assert follower.reached(None)

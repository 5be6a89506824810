"""A monitor's backlight by what is on it: below what its user has set, and never faster than the limit."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stepped_panel import SteppedPanel

from evenlight.experiments.desktop.loss_target import LossTarget
from evenlight.experiments.desktop.monitor_dimmer import FilmFrame, MonitorDimmer, ScreenLight
from evenlight.hardware.backlight_curve import BacklightCurve, LinearizedBacklight
from evenlight.hardware.protocols import InstrumentError

KNOTS = np.linspace(0.1, 1.0, 10)
SQUARE = BacklightCurve((0.1, 0.5, 1.0), (2.0, 50.0, 200.0))  # of the light of a panel's steps
FINE = 0.7 / 2000  # of its goals, from 0.3 to 1
STRAIGHT = ScreenLight(50.0, (1 - KNOTS) * 0.2)  # 2 % lost at 0.9 of full backlight, 4 % at 0.8


class Desk:
    """A dimmer on a clock of its own, and every setting that it made."""

    def __init__(self, steps: int = 10_000, limit: Callable[[float], float] = lambda _: 2.0) -> None:
        self.now = 0.0
        self.backlight = SteppedPanel(steps) if steps else LinearizedBacklight(SteppedPanel(200), SQUARE)
        self.dimmer = MonitorDimmer(self.backlight, lambda: self.now, limit, 50.0, KNOTS, 0.04, 0.3)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.dimmer.step()
            self.now = self.dimmer.due(self.now)


def test_it_goes_to_the_lowest_brightness_that_loses_what_it_may() -> None:
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    assert desk.dimmer.goal == pytest.approx(0.8, abs=FINE)
    desk.run(8.0)  # 0.2 of 50 cd/m^2, at 2 cd/m^2/s: 5 s
    assert desk.dimmer.reached
    assert desk.backlight.read_factor() == pytest.approx(0.8, abs=1e-3)
    assert desk.dimmer.loss == pytest.approx(0.04, abs=1e-3)
    desk.dimmer.see(ScreenLight(50.0, np.zeros(10)))  # nothing to lose
    assert desk.dimmer.goal == pytest.approx(0.3)
    desk.dimmer.see(ScreenLight(50.0, np.append(np.full(9, 0.5), 0.0)))  # all is lost at once
    assert desk.dimmer.goal == pytest.approx(1 - 0.1 * 0.04 / 0.5, abs=FINE)


def test_loss_counts_beside_the_brightness_that_its_user_has_set() -> None:
    """At 0.9 of the backlight 0.98 are left, at 0.8 0.96: of the user's picture, 2/98 are lost."""
    desk = Desk()
    desk.backlight.set_factor(0.9)
    desk.dimmer.see(STRAIGHT)
    assert desk.dimmer.notice_user()
    assert desk.dimmer.ceiling == pytest.approx(0.9)
    assert desk.dimmer.loss == 0
    assert desk.dimmer.goal == pytest.approx(1 - (1 - 0.98 * 0.96) / 0.2, abs=FINE)


def test_what_its_user_sets_is_kept_and_not_set_over() -> None:
    """Dimmed to 0.8 of 1, then set to 0.6: that is 0.8 of 0.75."""
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    desk.backlight.set_factor(0.6)
    assert desk.dimmer.notice_user()
    assert desk.backlight.read_factor() == pytest.approx(0.6)
    assert not desk.dimmer.notice_user()
    assert desk.dimmer.ceiling == pytest.approx(0.75, abs=1e-3)
    assert desk.dimmer.set_to == pytest.approx(0.6)
    desk.backlight.set_factor(1.0)
    desk.dimmer.notice_user()
    assert desk.dimmer.ceiling == 1.0  # there is no more


def test_its_user_may_raise_what_full_backlight_was_dimmed_to() -> None:
    """Full is 1, dimmed to 0.8 and raised to 0.9: no lower from then on, until it is lowered."""
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    desk.backlight.set_factor(0.9)
    assert desk.dimmer.notice_user()
    desk.run(8.0)
    assert desk.backlight.read_factor() == 0.9
    desk.backlight.set_factor(0.85)
    assert desk.dimmer.notice_user()
    desk.run(8.0)
    assert desk.dimmer.loss == pytest.approx(0.04, abs=1e-3)
    assert desk.dimmer.factor < 0.85


def test_it_moves_in_steps_of_the_device_as_far_apart_as_the_limit_asks() -> None:
    """Of 0.01 of 50 cd/m^2, at 2 cd/m^2/s: one each quarter of a second, from 1 to 0.8 and back."""
    desk = Desk(steps=100)
    desk.dimmer.see(STRAIGHT)
    at, moments = 1.0, []
    for goal_is_full in (False, True):
        desk.dimmer.resting = goal_is_full
        while not desk.dimmer.reached:
            desk.dimmer.step()
            if desk.backlight.read_factor() != at:
                assert abs(desk.backlight.read_factor() - at) == pytest.approx(0.01)
                at = desk.backlight.read_factor()
                moments.append(desk.now)
            desk.now = desk.dimmer.due(desk.now)
    assert len(moments) == 40
    assert np.diff(moments) == pytest.approx(0.25, rel=0.1)
    assert min(np.diff(moments)) >= 0.25


def test_a_film_with_a_track_is_dimmed_by_it_at_the_light_of_its_frames() -> None:
    """0.5 of a ceiling of 0.8; in 10 cd/m^2, 2 cd/m^2/s are 0.2 a second: two seconds."""
    desk = Desk()
    desk.backlight.set_factor(0.8)
    desk.dimmer.notice_user()
    desk.dimmer.see(STRAIGHT)
    desk.dimmer.film = FilmFrame(0.5, 10.0)
    assert desk.dimmer.goal == pytest.approx(0.4)
    desk.run(1.0)
    assert desk.dimmer.set_to == pytest.approx(0.6, abs=0.03)
    desk.run(1.5)
    assert desk.dimmer.reached
    desk.dimmer.resting = True
    assert desk.dimmer.goal == pytest.approx(0.8)


def test_its_user_wins_against_a_film_s_track() -> None:
    """Full is 1, and 0.5 of it was raised to 0.6; a frame of 0.1 is shown at 0.3, the lowest."""
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.dimmer.film = FilmFrame(0.1, 10.0)
    assert desk.dimmer.goal == 0.3
    desk.dimmer.film = FilmFrame(0.5, 10.0)
    desk.run(4.0)
    desk.backlight.set_factor(0.6)
    assert desk.dimmer.notice_user()
    assert desk.dimmer.reached
    assert desk.dimmer.set_to == 0.6


@pytest.mark.parametrize("fails", [False, True])
def test_a_panel_that_is_off_is_waited_for(fails: bool) -> None:
    """It reads 0, or not at all; switched on, it is where it was left."""
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(2.0)
    left, read = desk.dimmer.set_to, desk.backlight.read_factor

    def asleep() -> float:
        if fails:
            raise InstrumentError("says nothing")
        return 0.0

    for _ in range(3):
        desk.backlight.read_factor = asleep  # type: ignore[method-assign]
        assert not desk.dimmer.notice_user()
        assert not desk.dimmer.step()
        assert desk.dimmer.absent == ("says nothing" if fails else "it is off")
        desk.now += 2.0
        desk.backlight.read_factor = read  # type: ignore[method-assign]
        assert not desk.dimmer.notice_user()
        assert not desk.dimmer.absent
    assert (desk.dimmer.ceiling, desk.dimmer.set_to) == (1.0, left)


def test_a_panel_that_refuses_a_setting_is_tried_again(monkeypatch) -> None:
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.now = 1.0

    def refuses(factor: float) -> float:
        raise InstrumentError("was set to step 7, and says 9")

    with monkeypatch.context() as patched:
        patched.setattr(desk.backlight, "set_factor", refuses)
        assert not desk.dimmer.step()
    assert desk.dimmer.absent == "was set to step 7, and says 9"
    assert not desk.dimmer.notice_user()
    assert not desk.dimmer.absent
    desk.run(0.5)
    assert desk.backlight.read_factor() < 1.0


def test_what_a_desktop_has_dimmed_and_sets_back_is_as_it_was_before() -> None:
    """Of 0.6, in two steps down while nobody is there; then a lock screen has nothing to lose."""
    desk = Desk()
    desk.backlight.set_factor(0.6)
    desk.dimmer.notice_user()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    before = desk.dimmer.set_to
    for factor in (0.8 * before, 0.3 * before):
        desk.backlight.set_factor(factor)
        assert desk.dimmer.notice_user()
    desk.dimmer.see(ScreenLight(50.0, np.zeros(10)))
    desk.run(8.0)
    assert desk.dimmer.factor == pytest.approx(0.3, abs=1e-3)
    for factor in (0.5 * before, before + 0.004):  # as a whole percentage
        desk.backlight.set_factor(factor)
        assert desk.dimmer.notice_user()
    assert desk.dimmer.ceiling == 0.6
    desk.backlight.set_factor(0.3)  # and lower by its user, who means it
    desk.dimmer.notice_user()
    assert desk.dimmer.ceiling < 0.6


def test_at_rest_it_goes_back_within_the_limit() -> None:
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    desk.dimmer.resting = True
    desk.run(2.5)  # 2 cd/m^2/s of 50: 0.1
    assert desk.backlight.read_factor() == pytest.approx(0.9, abs=2e-3)
    desk.backlight.set_factor(0.7)  # of which nothing is to be dimmed now
    assert desk.dimmer.notice_user()
    assert desk.dimmer.reached
    desk.backlight.set_factor(0.9)
    desk.dimmer.notice_user()
    desk.run(4.0)
    assert desk.backlight.read_factor() == 1.0


losses = st.lists(st.floats(0.0, 1.0), min_size=9, max_size=9)
limits = st.sampled_from([lambda x: 2.0, lambda x: 0.3 * x**0.5, lambda x: 0.05 * x])


@settings(deadline=None)
@given(
    st.lists(st.tuples(losses, st.floats(0.001, 3.0), st.none() | st.floats(0.01, 1.0)), max_size=12),
    limits,
    st.sampled_from([0, 10, 100, 10_000]),
)
def test_no_setting_is_faster_than_the_limit_of_any_picture_whatever_is_shown_and_set(
    shown: list[tuple[list[float], float, float | None]], limit: Callable[[float], float], steps: int
) -> None:
    """Between two settings, its user's before the first, for pictures of 0.01 to 50 cd/m^2."""
    desk, set_at = Desk(steps, limit=limit), 0.0
    dimmer, at = desk.dimmer, 1.0
    for loss, seconds, by_user in shown:
        dimmer.see(ScreenLight(50.0, np.append(np.sort(loss)[::-1], 0.0)))
        if by_user is not None:
            desk.backlight.set_factor(max(by_user, desk.backlight.smallest_factor()))
            if dimmer.notice_user():
                set_at, at = desk.now, desk.backlight.read_factor()
        end = desk.now + seconds
        while desk.now < end:
            dimmer.step()
            if (found := desk.backlight.read_factor()) != at:
                for light in (0.01, 1.0, 7.0, 50.0):
                    rate = abs(found - at) * light / (desk.now - set_at)
                    assert rate <= min(limit(at * light), limit(found * light)) * (1 + 1e-6)
                set_at, at = desk.now, found
            assert 0 < dimmer.set_to <= 1
            desk.now += 0.02


def test_a_budget_is_met_over_ten_minutes_of_changing_pictures() -> None:
    """Pictures that lose more and less, a minute each: constant dimming is what the mean comes to."""
    desk = Desk(limit=lambda x: 2.0)
    target = LossTarget(desk.dimmer, lambda ceiling: 0.7, 0.3)
    used = []
    for minute in range(40):
        desk.dimmer.see(ScreenLight(50.0, (1 - KNOTS) ** 2 * (0.2, 0.9)[minute % 2]))
        for _ in range(240):
            target.move(0.25)
            desk.run(0.25)
            used.append(desk.dimmer.factor)
    of_each = np.convolve(used, np.full(2400, 1 / 2400), "valid")
    assert np.abs(of_each - 0.7).max() < 0.02
    assert np.std(used) > 0.05  # and it moves

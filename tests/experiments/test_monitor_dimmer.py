"""A monitor's backlight by what is on it: below what its user has set, and never faster than the limit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stepped_panel import SteppedPanel

from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer, ScreenLight

KNOTS = np.linspace(0.1, 1.0, 10)
STRAIGHT = ScreenLight(50.0, (1 - KNOTS) * 0.2)  # 2 % lost at 0.9 of full backlight, 4 % at 0.8


class Desk:
    """A dimmer on a clock of its own, and every setting that it made."""

    def __init__(self, steps: int = 10_000, target: float = 0.04, lowest: float = 0.3) -> None:
        self.now = 0.0
        self.backlight = SteppedPanel(steps)
        self.dimmer = MonitorDimmer(self.backlight, lambda light: 2.0, KNOTS, target, lowest)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.dimmer.step(self.now)
            self.now += self.dimmer.interval


def test_it_goes_to_the_lowest_brightness_that_loses_what_it_may() -> None:
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    assert desk.dimmer.goal == pytest.approx(0.8)
    desk.run(8.0)  # 0.2 of 50 cd/m^2, at 2 cd/m^2/s: 5 s
    assert desk.dimmer.reached
    assert desk.backlight.read_factor() == pytest.approx(0.8, abs=1e-3)
    assert desk.dimmer.loss == pytest.approx(0.04, abs=1e-3)
    desk.dimmer.see(ScreenLight(50.0, np.zeros(10)))  # nothing to lose
    assert desk.dimmer.goal == pytest.approx(0.3)
    desk.dimmer.see(ScreenLight(50.0, np.append(np.full(9, 0.5), 0.0)))  # all is lost at once
    assert desk.dimmer.goal == pytest.approx(1 - 0.1 * 0.04 / 0.5)


def test_loss_counts_beside_the_brightness_that_its_user_has_set() -> None:
    """At 0.9 of the backlight 0.98 are left, at 0.8 0.96: of the user's picture, 2/98 are lost."""
    desk = Desk()
    desk.backlight.set_factor(0.9)
    desk.dimmer.see(STRAIGHT)
    assert desk.dimmer.notice_user(desk.now)
    assert desk.dimmer.ceiling == pytest.approx(0.9)
    assert desk.dimmer.loss == 0
    assert desk.dimmer.goal == pytest.approx(1 - (1 - 0.98 * 0.96) / 0.2)


def test_what_its_user_sets_is_kept_and_not_set_over() -> None:
    """Dimmed to 0.8 of 1, then set to 0.6: that is 0.8 of 0.75."""
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    desk.backlight.set_factor(0.6)
    assert not desk.dimmer.step(desk.now)
    assert desk.backlight.read_factor() == pytest.approx(0.6)
    assert desk.dimmer.notice_user(desk.now)
    assert not desk.dimmer.notice_user(desk.now)
    assert desk.dimmer.ceiling == pytest.approx(0.75, abs=1e-3)
    assert desk.dimmer.set_to == pytest.approx(0.6)
    desk.backlight.set_factor(1.0)
    desk.dimmer.notice_user(desk.now)
    assert desk.dimmer.ceiling == 1.0  # there is no more


def test_its_user_may_raise_what_full_backlight_was_dimmed_to() -> None:
    """Full is 1, dimmed to 0.8 and raised to 0.9: no lower from then on, until it is lowered."""
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    desk.backlight.set_factor(0.9)
    assert desk.dimmer.notice_user(desk.now)
    desk.run(8.0)
    assert desk.backlight.read_factor() == 0.9
    desk.backlight.set_factor(0.85)
    assert desk.dimmer.notice_user(desk.now)
    desk.run(8.0)
    assert desk.dimmer.loss == pytest.approx(0.04, abs=1e-3)
    assert desk.dimmer.factor < 0.85


def test_its_user_wins_against_a_step_that_was_just_made() -> None:
    """At 2 of 5 cd/m^2 each second it is at 0.92 after 0.2 s, and is set to where it was after 0.1 s."""
    desk = Desk()
    desk.dimmer.see(ScreenLight(5.0, STRAIGHT.loss))
    desk.run(0.2)
    desk.dimmer.notice_user(desk.now)
    at = desk.dimmer.set_to
    desk.backlight.set_factor(at + 0.04)
    assert not desk.dimmer.step(desk.now)
    assert desk.dimmer.notice_user(desk.now)
    assert desk.dimmer.set_to == pytest.approx(at + 0.04, abs=1e-4)


def test_at_rest_it_goes_back_within_the_limit() -> None:
    desk = Desk()
    desk.dimmer.see(STRAIGHT)
    desk.run(8.0)
    desk.dimmer.resting = True
    desk.run(2.5)  # 2 cd/m^2/s of 50: 0.1
    assert desk.backlight.read_factor() == pytest.approx(0.9, abs=2e-3)
    desk.run(4.0)
    assert desk.backlight.read_factor() == 1.0


pictures = st.tuples(st.floats(0.0, 300.0), st.lists(st.floats(0.0, 1.0), min_size=9, max_size=9))


@settings(deadline=None)
@given(
    st.lists(st.tuples(pictures, st.floats(0.001, 3.0), st.none() | st.floats(0.01, 1.0)), max_size=12),
    st.sampled_from([100, 10_000]),
)
def test_no_setting_is_faster_than_the_limit_whatever_is_shown_and_set(
    shown: list[tuple[tuple[float, list[float]], float, float | None]], steps: int
) -> None:
    """Between two settings of its own, in luminance; the device's own steps are rounding."""
    desk = Desk(steps)
    dimmer = desk.dimmer
    for (luminance, loss), seconds, by_user in shown:
        dimmer.see(ScreenLight(luminance, np.append(np.sort(loss)[::-1], 0.0)))
        if by_user is not None:
            desk.backlight.set_factor(max(by_user, 1 / steps))
            dimmer.notice_user(desk.now)
        end, before, at = desk.now + seconds, dimmer.set_to, -np.inf
        first = True
        while desk.now < end:
            if dimmer.step(desk.now):
                passed = min(desk.now - at, 2 * dimmer.interval)
                rate = abs(dimmer.set_to - before) * luminance / passed
                assert first or rate <= 2.0 * (1 + 1e-6)
                before, at, first = dimmer.set_to, desk.now, False
            assert 0 < dimmer.set_to <= 1
            desk.now += dimmer.interval
        assert dimmer.set_to <= max(dimmer.ceiling, before) + 1e-12


def test_a_device_that_tells_late_where_it_is_is_not_taken_for_its_user() -> None:
    """It tells the setting of half a second ago; from outside of its way it is somebody else."""
    desk = Desk()
    told, own = [1.0], desk.backlight.read_factor
    desk.backlight.read_factor = lambda: told[max(len(told) - 25, 0)]  # type: ignore[method-assign]
    desk.dimmer.see(STRAIGHT)
    for _ in range(300):
        desk.dimmer.step(desk.now)
        assert not desk.dimmer.notice_user(desk.now)
        desk.now += desk.dimmer.interval
        told.append(own())
    assert desk.backlight.read_factor() < 0.82
    told[-25:] = [0.5] * 25
    assert desk.dimmer.notice_user(desk.now)


def test_a_black_picture_lets_the_backlight_not_jump() -> None:
    """At 2 cd/m^2/s a picture of 1 cd/m^2 or less takes 20 ms for 0.04."""
    desk = Desk()
    desk.dimmer.see(ScreenLight(0.0, np.zeros(10)))
    for _ in range(3):
        before = desk.dimmer.set_to
        desk.dimmer.step(desk.now)
        assert 0 < before - desk.dimmer.set_to <= 2.0 * 2 * desk.dimmer.interval
        desk.now += desk.dimmer.interval

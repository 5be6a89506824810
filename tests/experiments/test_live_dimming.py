"""The live controller: within the rate limit however late the losses come, and still where none comes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.controller_tuning import frame_gains, stable_slope
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.control import LiveRefresh
from evenlight.experiments.playback.live_dimming import LONGEST, LiveDimmer
from evenlight.experiments.playback.live_record import LiveDimming
from evenlight.experiments.playback.play_options import LiveOptions, WalkOptions
from evenlight.experiments.playback.walk_request import require_walk
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import allowed_rate, largest_rate_ratio, modulation_rate, scalar_rate_limit

LIMIT = scalar_rate_limit(load_rate_limit("surace2025"))
OTHER = replace(load_display("varjo-xr3"), name="other", peak_luminance=250.0)
RATE = 60.0


class LateMeter:
    """Knows the loss of content, strength · (1 - b), some refreshes after it was asked."""

    name = "made up"

    def __init__(
        self, strength: list[float], delays: list[int], luminance: Sequence[float] = (40.0,)
    ) -> None:
        self._strength, self._delays, self._luminance = strength, delays, luminance
        self._refresh, self._asked, self._drawn = -1, 0, -1
        self._answer: float | None = None
        self._due = 0

    def mean_luminance(self) -> float:
        self._drawn += 1
        return self._luminance[min(self._drawn, len(self._luminance) - 1)]

    def channel_means(self) -> np.ndarray:
        """Gray, of a display with black at 0 and a peak of 104.4 cd/m^2."""
        luminance = self._luminance[min(self._drawn, len(self._luminance) - 1)]
        return np.full(3, luminance / 104.4)

    def begin(self, factor: float) -> bool:
        if self._answer is not None:
            return False
        strength = self._strength[min(self._refresh, len(self._strength) - 1)]
        self._answer = strength * (1 - factor)
        self._due = self._refresh + self._delays[self._asked % len(self._delays)]
        self._asked += 1
        return True

    def result(self) -> float | None:
        self._refresh += 1
        if self._answer is None or self._refresh < self._due:
            return None
        answer, self._answer = self._answer, None
        return answer

    def close(self) -> None:
        """Nothing to let go of."""


def dimmed(
    meter: LateMeter,
    refreshes: int,
    gains: tuple[float, float, float] = (0.2, 0.01, 0.05),
    first: float = 0.6,
) -> list[LiveRefresh]:
    """What the dimmer does in so many refreshes."""
    controller = Controller(ControllerSettings(0.05, *gains), LIMIT)
    dimmer = LiveDimmer(controller, meter, first, 1 / RATE)
    for k in range(refreshes):
        dimmer.next_factor(k / RATE)
        dimmer.note(k / RATE)
    return dimmer.rows


@settings(max_examples=40)
@given(
    st.lists(st.sampled_from([0.0, 0.1, 0.5, 1.0]), min_size=5, max_size=60),
    st.lists(st.integers(1, 20), min_size=1, max_size=6),
    st.tuples(*[st.sampled_from([0.0, 0.05, 1.0, 10.0])] * 3),
)
def test_no_refresh_is_faster_than_the_limit_however_late_losses_are(
    strength: list[float], delays: list[int], gains: tuple[float, float, float]
) -> None:
    factors = np.array([row.factor for row in dimmed(LateMeter(strength, delays), 80, gains)])
    rate = np.abs(np.diff(factors)) * 40.0 * RATE
    limit = [min(LIMIT(a * 40.0), LIMIT(b * 40.0)) for a, b in pairwise(factors)]
    assert (rate <= np.array(limit) * (1 + 1e-6)).all()
    assert factors.min() >= 0.2
    assert factors.max() <= 1


@pytest.mark.parametrize("late", [1, 6])
@pytest.mark.parametrize("seconds", [0.02, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("ends", [(5.0, 60.0), (60.0, 5.0)])
def test_no_refresh_is_faster_than_the_limit_while_the_content_changes(
    late: int, seconds: float, ends: tuple[float, float]
) -> None:
    """And the log says so, refresh by refresh, by the definition that holds offline."""
    share = np.clip((np.arange(200) / RATE - 0.5) / seconds, 0, 1)
    luminance = ends[0] + share * (ends[1] - ends[0])
    rows = dimmed(
        LateMeter([1.0] * 60 + [0.0] * 60 + [1.0], [late], luminance.tolist()), 200, (0.0, 1.0, 0.0)
    )
    factors = np.array([row.factor for row in rows])
    rate = modulation_rate(factors, luminance, np.full(200, 1 / RATE))
    allowed = allowed_rate(factors, luminance, lambda light: np.array([LIMIT(x) for x in light]))
    assert largest_rate_ratio(rate, allowed) <= 1 + 1e-6
    assert largest_rate_ratio(rate, allowed) > 0.9  # the limit is what holds it
    np.testing.assert_allclose([row.mean_luminance for row in rows], luminance)
    np.testing.assert_allclose([row.rate for row in rows[1:]], rate[:-1], atol=1e-9)
    np.testing.assert_allclose([row.rate_limit for row in rows[1:]], allowed[:-1], rtol=1e-9)


@settings(max_examples=30)
@given(
    st.lists(st.sampled_from([0.0, 0.01, 1.0, 30.0, 100.0]), min_size=2, max_size=30),
    st.lists(st.floats(0.5, 4.0), min_size=1, max_size=20),
    st.integers(1, 5),
)
def test_cuts_and_dropped_refreshes_break_no_limit_either(
    luminance: list[float], waits: list[float], late: int
) -> None:
    """Pictures take 0.5 to 4 refreshes to draw, and appear at the first refresh after."""
    controller = Controller(ControllerSettings(0.05, 1.0, 0.5, 0.5), LIMIT)
    dimmer = LiveDimmer(controller, LateMeter([1.0, 0.0] * 20, [late], luminance), 0.6, 1 / RATE)
    flip = drawn = 0.0
    for k in range(40):
        drawn = flip + waits[k % len(waits)] / RATE if k else 0.0
        flip = math.ceil(drawn * RATE - 1e-9) / RATE
        dimmer.next_factor(drawn + 1 / RATE if k else 0.0)
        dimmer.note(flip)
    for before, row in pairwise(dimmer.rows):
        light, passed = (before.mean_luminance + row.mean_luminance) / 2, row.flip_time - before.flip_time
        limit = min(LIMIT(one.factor * one.mean_luminance) for one in (before, row))
        assert abs(row.factor - before.factor) * light <= limit * passed * (1 + 1e-6)
        assert row.rate_limit == limit
        assert abs(row.rate) <= limit * (1 + 1e-6)


def test_a_display_that_shows_pictures_faster_than_it_should_is_seen_in_the_log() -> None:
    dimmer = LiveDimmer(Controller(ControllerSettings(0.05), LIMIT), LateMeter([1.0], [1]), 0.3, 1 / RATE)
    for k in range(20):
        dimmer.next_factor(k / RATE)
        dimmer.note(k / RATE / 2)
    assert max(abs(row.rate) / row.rate_limit for row in dimmer.rows[1:]) == pytest.approx(2, rel=1e-6)


@pytest.mark.parametrize("late", [1, 6, 12])
@pytest.mark.parametrize("gains", [(0.0, 0.4, 0.0), (0.5, 0.3, 0.0)])
def test_the_live_loop_rings_above_its_stable_slope_and_settles_below(
    late: int, gains: tuple[float, float, float]
) -> None:
    """The margins are those of a loop whose frames are the answers, and whose delay is one of them."""
    chosen = ControllerSettings(0.05, *gains, gain_rate=RATE)
    edge = stable_slope(frame_gains(chosen, late / RATE))

    def away(slope: float) -> np.ndarray:
        rest = 1 - 0.05 / slope
        dimmer = LiveDimmer(
            Controller(chosen, lambda _: 1e9), LateMeter([slope], [late]), rest + 1e-4, 1 / RATE
        )
        for k in range(150 * late):
            dimmer.next_factor(k / RATE)
            dimmer.note(k / RATE)
        return np.abs([row.factor - rest for row in dimmer.rows])

    settling, ringing = away(0.96 * edge), away(1.04 * edge)
    assert settling[-20 * late :].max() < 0.2 * settling[: 20 * late].max()
    assert ringing[-20 * late :].max() > 5 * ringing[: 20 * late].max()


def test_while_a_loss_is_late_the_factor_stands() -> None:
    """The fourth answer takes 90 refreshes; the factor goes where the third sent it, and stays."""
    rows = dimmed(LateMeter([0.3], [1, 1, 1, 90, 1]), 60)
    factors = np.array([row.factor for row in rows])
    assert (np.diff(factors[2:4]) != 0).all()
    assert np.ptp(factors[6:]) == 0
    assert {row.measured_refresh for row in rows[6:]} == {rows[6].measured_refresh}


def test_it_comes_to_the_target_and_stays_there() -> None:
    for delays in ([1], [6], [1, 9, 3]):
        rows = dimmed(LateMeter([0.2], delays), 2000)
        assert rows[-1].contrast_loss == pytest.approx(0.05, abs=2e-3)
        assert np.ptp([row.factor for row in rows[-300:]]) < 2e-3  # it does not ring


def test_with_prompt_losses_it_does_what_the_controller_does_offline(make_curves) -> None:
    strength = 0.2 + 0.1 * np.sin(np.arange(300) / 30)
    curves = make_curves(strength, luminance=40.0, frames_per_second=RATE)
    controller = Controller(ControllerSettings(0.05), LIMIT)
    offline = control_curves(curves, controller, 0.6).factors
    live = np.array([row.factor for row in dimmed(LateMeter(strength.tolist(), [1]), 300)])
    # Live, a frame's loss is known a refresh later.
    np.testing.assert_allclose(live[1:], offline[:-1], atol=2e-3)


def test_after_a_long_pause_no_long_step_is_made_up_for() -> None:
    rows = dimmed(LateMeter([1.0], [1, 1, 200, 1, 1]), 205, first=0.3)
    factors = np.array([row.factor for row in rows])
    assert factors[204] - factors[202] <= LIMIT(12.5) / 40.0 * LONGEST


def test_the_log_says_what_was_known() -> None:
    rows = dimmed(LateMeter([0.3], [3]), 12)
    assert [row.contrast_loss for row in rows[:3]] == [None] * 3
    assert [row.measured_refresh for row in rows[3:9]] == [0, 0, 0, 3, 3, 3]
    assert rows[3].contrast_loss == pytest.approx(0.3 * 0.4)
    # Loss, factor and refresh belong together; the second way is measured at its end, before it gets there.
    assert [row.measured_factor for row in rows[3:6]] == [0.6] * 3
    assert rows[9].measured_factor == pytest.approx(rows[8].factor)
    assert rows[9].contrast_loss == pytest.approx(0.3 * (1 - rows[8].factor))
    assert rows[6].factor != rows[8].factor


def test_a_controller_that_cannot_be_is_refused() -> None:
    walk = WalkOptions(scene="house", seconds=2.0)
    with pytest.raises(InputError, match=r"--target-loss must lie in 0 to 1, got 1\.5"):
        require_walk(walk, LiveOptions(1.5))
    with pytest.raises(InputError, match="give --target-loss or --budget with it"):
        require_walk(replace(walk, out=Path("somewhere")), LiveOptions())
    with pytest.raises(InputError, match="was fitted on"):
        LiveDimming.asked_for(LiveOptions(0.1), OTHER, None)
    accepted = LiveDimming.asked_for(LiveOptions(0.1), OTHER, None, other_display_ok=True)
    assert accepted.controller.settings.target_loss == 0.1

"""The online controller, and the one that looks ahead: steps, limits, changing content, gain."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from time import process_time

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import LimitCurve
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import (
    ControlledTrack,
    control_ahead,
    control_curves,
)
from evenlight.method.online.controller import (
    Controller,
    ControllerSettings,
    ControllerState,
    FrameMeasurement,
)
from evenlight.method.online.gain import LOSS_EXPONENT, NO_GAIN, GainMonitor, gain_warning
from evenlight.method.online.governor import GovernorSettings, frame_costs, governor_of, horizon_errors
from evenlight.method.online.lookahead import (
    DEBT_REACTION,
    ForeseenFrame,
    LookaheadController,
    LookaheadSettings,
)
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.power import power
from evenlight.method.preset_files import load_power_model, load_rate_limit
from evenlight.method.rate_limit import largest_rate_ratio, rate_limit_at, scalar_rate_limit

PAPER = scalar_rate_limit(load_rate_limit("surace2025"))


def free(_: float) -> float:
    """No limit that matters."""
    return 1e9


def run(
    curves: LossCurves,
    start: float | None = None,
    limit: Callable[[float], float] = PAPER,
    **chosen: float | None,
) -> ControlledTrack:
    return control_curves(
        curves, Controller(ControllerSettings(**{"target_loss": 0.1, **chosen}), limit), start
    )


def test_one_step_by_hand() -> None:
    # Gains per second (1 Hz). Loss 0.3 against 0.1: e = 0.2, it was 0 0.5 s ago. K_p e = 0.04, K_d de/dt =
    # 0.05 · 0.4 = 0.02, integral 0.5 + 0.01 · 0.2 · 0.5 = 0.501: 0.561.
    controller = Controller(ControllerSettings(0.1, gain_rate=1.0), free)
    first = controller.start(0.5, FrameMeasurement(loss=0.1, luminance=50.0, duration=0.5))
    second = controller.step(first, FrameMeasurement(loss=0.3, luminance=50.0, duration=0.5))
    assert second.factor == pytest.approx(0.561, abs=1e-12)
    assert second.integral == pytest.approx(0.501, abs=1e-12)
    assert not second.limited


def test_the_first_state_makes_its_terms_add_up_to_the_factor() -> None:
    # The first frame has loss 0.3 against 0.1: e = 0.2. The terms of the state, K_p e + I, must
    # be the factor it was started with, 0.5; with K_p = 0.2 the integral term is I = 0.5 - 0.2 · 0.2 = 0.46.
    # The next frame has the same error, so that only the integral moves on: K_i e Δt = 0.01 · 0.2 · 0.5 =
    # 0.001 (gains per second), and b = 0.2 · 0.2 + 0.461 = 0.501.
    controller = Controller(ControllerSettings(0.1, gain_rate=1.0), free)
    first = controller.start(0.5, FrameMeasurement(loss=0.3, luminance=50.0, duration=0.5))
    assert first.integral == pytest.approx(0.46, abs=1e-12)
    second = controller.step(first, FrameMeasurement(loss=0.3, luminance=50.0, duration=0.5))
    assert second.factor == pytest.approx(0.501, abs=1e-12)


def test_gains_per_frame_by_hand() -> None:
    # For frames of 1/25 s, in a video of 12.5 Hz: each frame counts twice in K_i, half in K_d.
    controller = Controller(ControllerSettings(0.1, 0.0, 0.01, 0.05, gain_rate=25.0), free)
    first = controller.start(0.5, FrameMeasurement(0.1, 50.0, 0.08))
    second = controller.step(first, FrameMeasurement(0.3, 50.0, 0.08))
    assert second.factor == pytest.approx(0.5 + 2 * 0.01 * 0.2 + 0.05 * 0.2 / 2, abs=1e-12)


def test_a_step_within_the_limit_by_hand() -> None:
    # ΔL = 2 cd/m^2/s on a luminance of (40 + 60) / 2: b may change by 2 · 0.1 / 50 = 0.004.
    controller = Controller(ControllerSettings(0.1, gain_rate=1.0), lambda luminance: 2.0)
    first = controller.start(0.5, FrameMeasurement(0.1, 40.0, 0.1))
    second = controller.step(first, FrameMeasurement(0.6, 60.0, 0.04))
    assert second.factor == pytest.approx(0.504, abs=1e-9)
    assert second.limited


def test_the_lower_limit_of_the_two_ends_counts() -> None:
    # ΔL = 3 %/s of b·Ī: the dark frame that comes (Ī = 1) allows 0.03 · b · 1 · 0.1 / 25.5.
    controller = Controller(ControllerSettings(0.1, gain_rate=1.0), lambda luminance: 0.03 * luminance)
    first = controller.start(0.5, FrameMeasurement(0.1, 50.0, 0.1))
    second = controller.step(first, FrameMeasurement(0.9, 1.0, 0.1))
    step = second.factor - 0.5
    assert step == pytest.approx(0.03 * second.factor * 1.0 * 0.1 / 25.5, rel=1e-6)


def test_between_black_frames_the_factor_is_free_and_beside_one_it_is_frozen() -> None:
    controller = Controller(ControllerSettings(0.1, gain_rate=1.0), lambda luminance: 0.03 * luminance)
    black = controller.start(0.5, FrameMeasurement(0.1, 0.0, 0.1))
    assert controller.step(black, FrameMeasurement(0.6, 0.0, 0.1)).factor > 0.6
    assert controller.step(black, FrameMeasurement(0.6, 50.0, 0.1)).factor == 0.5


@pytest.mark.parametrize("name", ["surace2025", "rate", "log_log"])
def test_the_limit_at_one_luminance_is_the_limit(name: str) -> None:
    paper = load_rate_limit("surace2025")
    form = {"rate": RateLimitForm.RATE, "log_log": RateLimitForm.LOG_LOG}.get(name)
    bare = replace(paper, band_luminance=(), band_lower=(), band_upper=(), point_luminance=(), point_rate=())
    limit = paper if form is None else replace(bare, form=form)
    luminance = np.concatenate([[0.0], np.geomspace(1e-3, 500.0, 300), paper.luminance_range])
    one_by_one = [scalar_rate_limit(limit, 1.5)(light) for light in luminance.tolist()]
    np.testing.assert_allclose(one_by_one, rate_limit_at(limit, luminance + 1.5), rtol=1e-12)


def test_the_lower_edge_of_the_band_can_be_obeyed_instead() -> None:
    limit = load_rate_limit("surace2025")
    safe = scalar_rate_limit(limit, curve=LimitCurve.SAFE)
    luminance = np.geomspace(1.0, 300.0, 50)
    expected = rate_limit_at(limit, luminance, LimitCurve.SAFE)
    np.testing.assert_allclose([safe(light) for light in luminance.tolist()], expected, rtol=1e-12)
    bare = RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))
    with pytest.raises(InputError, match="no band"):
        scalar_rate_limit(bare, curve=LimitCurve.SAFE)


HUNDREDTHS = st.integers(0, 100).map(lambda k: k / 100)


@settings(max_examples=60)  # of up to 25 steps each
@given(
    st.lists(st.tuples(HUNDREDTHS, st.sampled_from([0.0, 0.1, 5.0, 60.0, 104.0])), min_size=2, max_size=25),
    st.sampled_from([0.0, 0.05, 0.2, 0.5]),
    st.sampled_from([1.0, 90.0, None]),
)
@example([(0.0, 0.0), (0.12, 0.0), (0.0, 0.0)], 0.0, 1.0)  # rounding left the factor below its bound
def test_no_content_makes_it_break_the_rate_limit_or_the_bounds(
    make_curves: Callable[..., LossCurves],
    content: list[tuple[float, float]],
    target: float,
    rate: float | None,
) -> None:
    strength, luminance = (np.array(part) for part in zip(*content, strict=True))
    curves = make_curves(strength, luminance=luminance)
    track = run(curves, target_loss=target, gain_rate=rate, proportional=5.0, integral=1.0)
    assert largest_rate_ratio(track.rate, track.rate_limit) <= 1
    assert track.factors.min() >= 0.2
    assert track.factors.max() <= 1


def steps_of(
    make_curves: Callable[..., LossCurves], losses: list[float], seconds: float, rate: float
) -> LossCurves:
    """Content whose loss at factor 0 jumps: in turn bright with little to lose, dark with much."""
    frames = round(seconds * rate)
    strength = np.repeat(losses, frames)
    luminance = np.where(strength > np.mean(losses), 15.0, 60.0)
    return make_curves(strength, luminance=luminance, frames_per_second=rate)


@pytest.mark.parametrize("limit", [PAPER, free], ids=["rate limit", "no limit"])
@pytest.mark.parametrize(
    ("strong", "rate"), [(0.15, 12.5), (0.4, 12.5), (1.0, 5.0), (1.0, 12.5), (0.4, 90.0)]
)
def test_it_does_not_ring_on_a_step_between_bright_and_dark(
    make_curves: Callable[..., LossCurves], strong: float, rate: float, limit: Callable[[float], float]
) -> None:
    seconds = 40.0
    curves = steps_of(make_curves, [0.12, strong, 0.12], seconds, rate)
    track = run(curves, target_loss=0.08, limit=limit)
    frames = round(seconds * rate)
    goals = factor_at_loss(curves, np.full(curves.n_frames, 0.08))
    for part in range(1, 3):
        piece = slice(part * frames, (part + 1) * frames)
        way = np.sign(goals[piece][-1] - track.factors[part * frames - 1])
        beyond = (track.factors[piece] - goals[piece]) * way
        assert beyond.max() <= 0.01  # no overshoot to speak of
        after_kick = np.diff(track.factors[piece][3:]) * way
        assert after_kick.min() >= -2e-4  # nor any way back; the first frames may have the kick of K_d


@pytest.mark.parametrize(("strong", "rate"), [(0.3, 12.5), (0.6, 5.0), (0.6, 12.5), (1.0, 5.0), (1.0, 60.0)])
def test_after_ten_seconds_at_a_bound_it_recovers_without_overshoot(
    make_curves: Callable[..., LossCurves], rate: float, strong: float
) -> None:
    # Content that loses nothing for 10 s drives the factor to its lowest; so much that it stays at 1, to the
    # top.
    target = 0.1
    for held, bound in ((0.01, 0.2), (5.0, 1.0)):
        ten, long = round(10 * rate), round(70 * rate)
        strength = np.concatenate([np.full(ten, held), np.full(long, strong)])
        curves = make_curves(np.minimum(strength, 1.0), luminance=50.0, frames_per_second=rate)
        if held > 1:  # a loss above the target at any factor but 1
            loss = np.array(curves.loss)
            loss[:ten, :-1] = 0.9
            curves = replace(curves, loss=loss)
        track = run(curves, start=bound, target_loss=target)
        assert track.factors[:ten] == pytest.approx(bound, abs=0.01 if held > 1 else 1e-9)
        loss = track.contrast_loss[ten:]
        beyond = (target - loss) if bound == 0.2 else (loss - target)
        assert beyond.max() <= 0.02
        assert abs(loss[-1] - target) <= 0.02


def test_the_rate_limit_winds_nothing_up(make_curves: Callable[..., LossCurves]) -> None:
    # Half a minute at the limit with a large error: an integral that took it up would carry the factor far
    # on.
    curves = steps_of(make_curves, [0.15, 0.9], 60.0, 25.0)
    track = run(curves, integral=0.1)  # ten times as eager
    assert track.limited.mean() > 0.2
    assert (0.1 - track.contrast_loss[1500:]).max() <= 0.02


def test_it_does_the_same_at_any_frame_rate_unless_asked_to_count_frames(
    make_curves: Callable[..., LossCurves],
) -> None:
    ends = {}
    for rate in (5.0, 25.0, 90.0):
        curves = steps_of(make_curves, [0.2, 0.5], 10.0, rate)
        same, counting = run(curves, limit=free), run(curves, limit=free, gain_rate=None)
        quarter = round(12.5 * rate)
        ends[rate] = (same.factors[quarter], counting.factors[quarter])
    by_time, by_frames = (np.array(column) for column in zip(*ends.values(), strict=True))
    assert np.ptp(by_time) < 0.05
    assert np.ptp(by_frames) > 0.15


def test_on_still_content_it_reaches_the_target(make_curves: Callable[..., LossCurves]) -> None:
    track = run(make_curves(np.full(1500, 0.3)), start=0.4)
    assert track.contrast_loss[-1] == pytest.approx(0.1, abs=1e-3)
    assert not track.limited[-100:].any()


def test_it_starts_where_the_first_frame_has_the_target_loss(make_curves: Callable[..., LossCurves]) -> None:
    curves = make_curves([0.2, 0.2])
    assert run(curves).factors[0] == pytest.approx(0.5, abs=1e-9)  # 0.2 (1 - b) = 0.1
    assert run(curves, target_loss=0.9).factors[0] == 0.2
    assert run(curves, start=0.9).factors[0] == 0.9


def test_losses_are_those_of_the_curves(make_curves: Callable[..., LossCurves]) -> None:
    curves = make_curves(np.linspace(0.1, 0.6, 50), exponent=1.7)
    track = run(curves)
    np.testing.assert_array_equal(track.contrast_loss, loss_and_slope(curves, track.factors)[0])
    assert track.mean_factor == pytest.approx(np.mean(track.factors), rel=1e-12)


def test_bad_settings_are_refused_with_what_would_be_right(make_curves: Callable[..., LossCurves]) -> None:
    with pytest.raises(ValueError, match="target_loss"):
        ControllerSettings(1.5)
    with pytest.raises(ValueError, match=r"lowest_factor < highest_factor, got 0\.5 and 0\.5"):
        ControllerSettings(0.1, lowest_factor=0.5, highest_factor=0.5)
    with pytest.raises(InputError, match=r"first factor must lie in 0\.2 to 1, got 0\.1"):
        run(make_curves([0.2]), start=0.1)
    with pytest.raises(InputError, match=r"begin at 0\.2"):
        run(make_curves([0.2]), lowest_factor=0.1)


def test_a_video_of_one_frame_has_one_factor(make_curves: Callable[..., LossCurves]) -> None:
    track = run(make_curves([0.2]))
    assert len(track.factors) == 1
    assert track.rate.tolist() == [0.0]


DARK_TO_WHITE = st.sampled_from([0.0, 5e-324, 1e-4, 0.1, 60.0, 104.4])


@settings(max_examples=80)
@given(
    st.lists(st.tuples(st.sampled_from([0.0, 0.02, 0.3, 1.0]), DARK_TO_WHITE), min_size=2, max_size=20),
    st.tuples(*[st.sampled_from([0.0, 0.05, 1.0, 20.0])] * 3),
    st.sampled_from([5.0, 90.0, 1000.0]),
)
@example(
    [(1.0, 0.0), (1.0, 60.0), (0.0, 60.0)], (1.0, 0.05, 0.05), 5.0
)  # the last digit was a step of its own
@example([(1.0, 60.0), (1.0, 1e-4)] * 10, (1.0, 0.05, 0.05), 5.0)  # steps of some hundred last digits
def test_no_extremes_of_content_and_gains_make_it_break_the_rate_limit(
    make_curves: Callable[..., LossCurves],
    content: list[tuple[float, float]],
    gains: tuple[float, float, float],
    rate: float,
) -> None:
    strength, luminance = (np.array(part) for part in zip(*content, strict=True))
    curves = make_curves(strength, luminance=luminance, frames_per_second=rate)
    p, i, d = gains
    for start in (0.2, 0.9999999, 1.0):
        track = run(curves, start=start, proportional=p, integral=i, derivative=d)
        assert largest_rate_ratio(track.rate, track.rate_limit) <= 1
        assert track.factors.min() >= 0.2
        assert track.factors.max() <= 1


def test_a_frozen_factor_stays_to_its_last_digit() -> None:
    """Beside a black frame ΔL is 0: whatever the terms add up to, the sum must not leave a last digit."""
    controller = Controller(ControllerSettings(0.1, 0.0, 1.0, 0.0), lambda luminance: 0.03 * luminance)
    for integral in np.linspace(-2.0, 0.0, 300).tolist():
        black = ControllerState(0.7, integral, 0.0, luminance=0.0, duration=0.1)
        assert controller.step(black, FrameMeasurement(0.9, 60.0, 0.1)).factor == 0.7


# --- lookahead

LIMIT, LCD = load_rate_limit("surace2025"), load_power_model("surace2025")


RATE = 10.0

MakeCurves = Callable[..., LossCurves]


def ahead(
    curves: LossCurves,
    seconds: float,
    budget: float | None = 0.5,
    horizon: float = 60.0,
    target: float | None = None,
) -> ControlledTrack:
    """The track with some lookahead."""
    settings = ControllerSettings(0.0 if target is None else target)
    asked = None if budget is None else GovernorSettings(budget, BudgetUnit.FACTOR, horizon)
    costs = None if asked is None else frame_costs(curves, asked, LCD)
    controller, look = Controller(settings, PAPER), LookaheadSettings(seconds, horizon)
    return control_ahead(curves, controller, look, budget, None, costs, target is not None)


def pid(curves: LossCurves, budget: float, horizon: float = 60.0) -> ControlledTrack:
    """The track of the PID controller."""
    asked = GovernorSettings(budget, BudgetUnit.FACTOR, horizon)
    first = float(loss_and_slope(curves, np.full(curves.n_frames, budget))[0][0])
    controller = Controller(ControllerSettings(first), PAPER)
    governed = (governor_of(controller, asked), frame_costs(curves, asked, LCD))
    return control_curves(curves, controller, budget, None, governed)


def scenes(make_curves: MakeCurves, seconds: float, seed: int = 1) -> LossCurves:
    """A film: cuts after 3 to 12 s, each time to other light and other detail."""
    rng, strength, light = np.random.default_rng(seed), [], []
    while len(strength) < seconds * RATE:
        frames = round(rng.uniform(3.0, 12.0) * RATE)
        strength += [rng.uniform(0.06, 0.2)] * frames
        light += [rng.uniform(8.0, 60.0)] * frames
    n = round(seconds * RATE)
    return make_curves(
        np.array(strength[:n]), exponent=1.5, luminance=np.array(light[:n]), frames_per_second=RATE
    )


def sd_ratio(curves: LossCurves, factors: np.ndarray) -> float:
    """The SD of the loss over that of constant dimming by the mean factor; frames of equal duration."""
    constant = np.full(curves.n_frames, min(float(np.mean(factors)), 1.0))
    ours, same = (loss_and_slope(curves, np.asarray(b))[0] for b in (factors, constant))
    return float(np.std(ours) / np.std(same))


@pytest.mark.parametrize("seconds", [0.0, 0.5, 2.0])
def test_no_frame_beyond_the_lookahead_changes_a_factor(make_curves: MakeCurves, seconds: float) -> None:
    """To the last bit. The frame that begins `seconds` later is the last that is known."""
    one, other = (scenes(make_curves, 13.5, seed) for seed in (1, 2))
    known = 100 + round(seconds * RATE)
    loss, light = one.loss.copy(), one.mean_luminance.copy()
    loss[known + 1 :], light[known + 1 :] = other.loss[known + 1 :], other.mean_luminance[known + 1 :]
    changed = replace(one, loss=loss, mean_luminance=light)
    tracks = [ahead(curves, seconds, horizon=10.0) for curves in (one, changed)]
    np.testing.assert_array_equal(tracks[0].factors[:101], tracks[1].factors[:101])
    assert (tracks[0].factors[101:] != tracks[1].factors[101:]).any()
    loss[known] = other.loss[known] * 1.5
    seen = ahead(replace(one, loss=loss, mean_luminance=light), seconds, horizon=10.0)
    assert seen.targets[100] != tracks[0].targets[100]  # the factor may be at its limit either way


@pytest.mark.slow
def test_two_seconds_close_half_of_the_gap(make_curves: MakeCurves) -> None:
    """Between the PID controller with its governor and the optimizer, which knows the whole film.

    A dialogue, cut every 4 s: the best is to turn about in the middle of each shot; the buffer tells when.
    """
    dark = np.arange(300) // 20 % 2 == 1  # at 5 Hz
    curves = make_curves(np.where(dark, 0.16, 0.1), 1.5, np.where(dark, 15.0, 50.0), 5.0)
    request = Request(0.5, BudgetUnit.FACTOR, LCD, LIMIT)
    online, offline = pid(curves, 0.5), SplittingSolver().solve(pose(curves, request)).factors
    planned = ahead(curves, 2.0)
    gap = sd_ratio(curves, online.factors), sd_ratio(curves, offline)
    assert gap[0] - gap[1] > 0.1
    assert sd_ratio(curves, planned.factors) < (gap[0] + gap[1]) / 2
    used, every = planned.factors, np.ones(curves.n_frames)
    errors = horizon_errors(used, every, curves.durations, (0.5, 60.0))
    assert errors is not None
    assert errors.either_way < 0.01
    assert abs(planned.mean_factor - 0.5) < 0.01


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_no_content_makes_it_break_the_rate_limit_or_the_bounds_of_lookahead(
    make_curves: MakeCurves, seconds: float
) -> None:
    """Black, white and dark frames in turn, with nothing or everything to lose."""
    rng = np.random.default_rng(3)
    for budget in (0.21, 0.5, 0.99):
        strength, light = rng.choice([0.0, 0.02, 0.3, 1.0], 150), rng.choice([0.0, 1e-4, 5.0, 100.0], 150)
        curves = make_curves(strength, luminance=light, frames_per_second=float(rng.choice([5.0, 90.0])))
        track = ahead(curves, seconds, budget, horizon=3.0)
        assert largest_rate_ratio(track.rate, track.rate_limit) <= 1
        assert track.factors.min() >= 0.2
        assert track.factors.max() <= 1.0


def test_the_first_frame_sets_the_level_for_a_tenth_of_the_horizon(make_curves: MakeCurves) -> None:
    """By hand: at the budget of 0.5 they lose 0.1 and 0.05; the first counts as 6 s, the second 0.1 s."""
    track = ahead(make_curves(np.array([0.2, 0.1]), frames_per_second=RATE), 0.0)
    assert track.targets.tolist() == pytest.approx([0.1, (6 * 0.1 + 0.1 * 0.05) / 6.1], rel=1e-9)


def test_what_stays_the_same_is_held_where_it_has_the_target_loss(make_curves: MakeCurves) -> None:
    """By hand: 0.2 (1 - b) = 0.08 at b = 0.6."""
    curves = make_curves(np.full(300, 0.2), frames_per_second=RATE)
    track = ahead(curves, 1.0, budget=None, target=0.08)
    assert track.factors == pytest.approx(0.6, abs=1e-6)
    assert ahead(curves, 1.0, budget=0.7).factors == pytest.approx(0.7, abs=1e-6)  # the level of the budget


def test_the_level_pays_a_debt_back_by_hand(make_curves: MakeCurves) -> None:
    """A frame at 0.9 for 1 s owes 0.4 s of factor; ŝ = 0.2, T = H/15: the level rises by 0.2 · 0.4 / T."""
    horizon = 30.0
    asked = GovernorSettings(0.5, BudgetUnit.FACTOR, horizon)
    curves = make_curves(np.full(2, 0.2), frames_per_second=1.0)
    cost = frame_costs(curves, asked, LCD)[0]
    controller = Controller(ControllerSettings(0.0), PAPER)
    planner = LookaheadController(
        controller, LookaheadSettings(0.0, horizon), curves.factors, 0.9, level_is_given=False
    )
    frame = ForeseenFrame(curves.loss[0], 40.0, 1.0, cost)
    first, second = planner.push(frame)[0], planner.push(frame)[0]
    assert first.target_loss == pytest.approx(0.1)
    assert second.target_loss == pytest.approx(0.1 + 0.2 * 0.4 * DEBT_REACTION / horizon)
    assert second.state.factor < 0.9


def test_it_sets_out_before_a_cut_and_not_before_it_knows(make_curves: MakeCurves) -> None:
    """From content that needs 0.5 to content that needs 0.75, after 20 s; the rate limit takes seconds."""
    strength = np.repeat([0.16, 0.32], 200)
    curves = make_curves(strength, luminance=np.full(400, 40.0), frames_per_second=RATE)
    knows, blind = (ahead(curves, s, budget=None, target=0.08).factors for s in (2.0, 0.0))
    assert knows[:180] == pytest.approx(0.5, abs=1e-6)
    assert knows[199] > 0.51
    assert blind[:200] == pytest.approx(0.5, abs=1e-6)
    assert 0.7 < knows[-1] < 0.75  # what was before is expected back until a horizon has passed


def test_frames_are_handed_out_when_enough_is_known(make_curves: MakeCurves) -> None:
    """Frames of 0.1 and 0.5 s: one is due once the frame after the last known one begins too late."""
    curves = make_curves(np.full(6, 0.2), frames_per_second=RATE)
    controller = Controller(ControllerSettings(0.08), PAPER)
    planner = LookaheadController(controller, LookaheadSettings(0.5), curves.factors, 0.6)
    counts = [
        len(planner.push(ForeseenFrame(curves.loss[0], 40.0, seconds)))
        for seconds in (0.1, 0.1, 0.5, 0.1, 0.5, 0.1)
    ]
    # Ends at 0.1, 0.2, 0.7 (those from 0 and 0.1 are due), 0.8 (from 0.2), 1.3 (from 0.7), 1.4 (from 0.8).
    assert counts == [0, 0, 2, 1, 1, 1]
    assert len(planner.finish()) == 1


@pytest.mark.real_time
@pytest.mark.parametrize("rate", [25.0, 90.0])
def test_a_frame_takes_less_than_a_millisecond(make_curves: MakeCurves, rate: float) -> None:
    """Of the processor, the median, with 2 s ahead; a factor of 3 is left to a slow machine."""
    wave = np.sin(np.arange(round(6 * rate)) / rate)
    curves = make_curves(0.3 + 0.2 * wave, luminance=40 - 20 * wave, frames_per_second=rate)
    controller = Controller(ControllerSettings(0.08), PAPER)
    planner = LookaheadController(controller, LookaheadSettings(2.0), curves.factors, 0.6)
    times = [process_time()]
    for losses, light in zip(curves.loss, curves.mean_luminance.tolist(), strict=True):
        planner.push(ForeseenFrame(losses, light, 1 / rate))
        times.append(process_time())
    steps = [after - before for before, after in itertools.pairwise(times)][round(3 * rate) :]
    assert np.median(steps) < 3e-3


@pytest.mark.parametrize(
    ("unit", "budget", "scale"),
    [(BudgetUnit.FACTOR, 0.5, 1.0), (BudgetUnit.POWER, 0.6, 1.0), (BudgetUnit.WATT, 1.0, 1.69)],
)
def test_any_budget_is_met_over_its_horizon(
    make_curves: MakeCurves, unit: BudgetUnit, budget: float, scale: float
) -> None:
    """Over every 20 s, to 3 % of what full brightness takes (1.69 W)."""
    curves = scenes(make_curves, 60.0)
    asked = GovernorSettings(budget, unit, 20.0)
    controller, costs = (
        Controller(ControllerSettings(0.0), PAPER),
        frame_costs(curves, asked, LCD),
    )
    track = control_ahead(curves, controller, LookaheadSettings(2.0, 20.0), 0.5, None, costs, False)
    watts = power(LCD, track.factors, curves.channel_means)
    full = power(LCD, np.ones(curves.n_frames), curves.channel_means)
    used = {BudgetUnit.FACTOR: track.factors, BudgetUnit.POWER: watts / full, BudgetUnit.WATT: watts}[unit]
    errors = horizon_errors(used, np.ones(curves.n_frames), curves.durations, (budget, 20.0))
    assert errors is not None
    assert errors.either_way < 0.03 * scale
    assert largest_rate_ratio(track.rate, track.rate_limit) <= 1


# --- gain


def test_by_definition_where_the_loss_is_as_it_takes_it_to_be() -> None:
    """Loss k (1 - b)^1.5 of content k: that of constant dimming is known exactly; means over all 40 s."""
    rng = np.random.default_rng(1)
    content, factors = rng.uniform(0.05, 0.3, 400), rng.uniform(0.4, 0.8, 400)
    loss = content * (1 - factors) ** LOSS_EXPONENT
    monitor = GainMonitor(40.0)
    for k in range(400):
        assert monitor.ratio is None  # before a horizon has passed
        monitor.take(factors[k], loss[k], 0.1)
    constant = content * (1 - factors.mean()) ** LOSS_EXPONENT
    assert monitor.ratio == pytest.approx(loss.std() / constant.std(), rel=1e-9)


def test_it_warns_of_constant_dimming_and_not_of_a_loss_that_stays() -> None:
    dull, even = GainMonitor(10.0), GainMonitor(10.0)
    for k in range(200):
        strength = 0.1 + 0.05 * (k % 2)
        dull.take(0.5, strength * 0.5**LOSS_EXPONENT, 0.1)
        even.take(1 - (0.05 / strength) ** (1 / LOSS_EXPONENT), 0.05, 0.1)
    assert dull.ratio == pytest.approx(1.0)
    assert gain_warning(dull.ratio) is not None
    assert even.ratio == pytest.approx(0.0, abs=1e-6)
    assert gain_warning(even.ratio) is None


def test_it_says_nothing_where_nothing_is_known() -> None:
    still = GainMonitor(1.0)
    for _ in range(30):
        still.take(0.5, 0.03, 0.1)  # nothing changes: there is nothing to gain, nor to lose
    assert still.ratio is None
    assert gain_warning(None) is None
    assert gain_warning(NO_GAIN - 1e-9) is None

"""Hard cases of time and of length: steps of no length, days of video, a hundred thousand frames."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from example_tracks import HEADER

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
    read_track,
    write_track,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves, write_loss_curves
from evenlight.method.choices import SolverName
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.objective import pairwise_spread, proximal_spread
from evenlight.method.optimizer.optimize import feasible_blend, is_feasible, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import make_solver
from evenlight.method.preset_files import load_power_model, load_rate_limit
from evenlight.method.rate_limit import largest_rate_ratio, scalar_rate_limit
from evenlight.stimuli.video.video_source import frame_times, uniform_times

MANY = 100_000  # frames: 55 minutes at 30 Hz


def posed(curves: LossCurves, budget: float = 0.5):
    power, limit = load_power_model("surace2025"), load_rate_limit("surace2025")
    request = Request(budget, BudgetUnit.FACTOR, power, limit)
    return pose(curves, request)


def test_the_pair_sum_of_a_hundred_thousand_frames() -> None:
    ranks = np.random.default_rng(0).permutation(MANY)
    losses = 0.5 + ranks / 2**20  # in float64 without rounding
    # Of 0 to N - 1, pairs differ by (N + 1) / 3 on average.
    exact = float(Fraction(MANY + 1, 3) / 2**20)
    assert pairwise_spread(losses) == pytest.approx(exact, rel=1e-13)


def test_a_common_level_leaves_no_rounding_behind() -> None:
    losses = np.full(MANY, 0.1)
    weights = np.arange(1.0 - MANY, MANY, 2.0)
    assert pairwise_spread(losses) == 0.0
    assert np.ptp(proximal_spread(losses + 1e-17 * weights, 1.0)) == 0.0


def test_a_hundred_thousand_frames_go_through_in_memory_of_the_curves(make_curves) -> None:
    rng = np.random.default_rng(1)
    strength = 0.5 + 0.2 * np.sin(np.arange(MANY) / 300)
    curves = make_curves(strength, luminance=20 + 10 * rng.random(MANY), knots=5)
    factors = factor_at_loss(curves, np.full(MANY, 0.2))
    np.testing.assert_allclose(loss_and_slope(curves, factors)[0], 0.2, atol=1e-12)
    problem = posed(curves)
    wild = np.clip(factors - problem.budget_error(factors), 0.2, 1)
    blend = feasible_blend(problem, wild - problem.budget_error(wild))
    assert is_feasible(problem, blend)
    assert problem.objective(blend) < problem.objective(problem.baseline())


@pytest.mark.parametrize("duration", [1e-9, 1e-6])
def test_frames_of_next_to_no_length(make_curves, duration) -> None:
    curves = make_curves([0.2, 0.5, 0.6, 0.3, 0.8, 0.1], luminance=[5, 10, 50, 100, 30, 20])
    curves = replace(curves, durations=np.array([0.04, duration, 0.04, duration, 0.04, 5.0]))
    problem = posed(curves)
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    assert is_feasible(problem, answer.factors)
    assert abs(np.diff(answer.factors)[1]) <= duration
    assert lower_bound(problem, answer) <= problem.objective(answer.factors) + 1e-9
    assert abs(problem.budget_error(answer.factors)) < 1e-9


def test_a_track_of_a_video_that_starts_late(make_curves) -> None:
    start = 86_400.0
    curves = make_curves(np.linspace(0.2, 0.8, 50), frames_per_second=240.0)
    late = replace(curves, times=curves.times + start)
    first, second = (optimize(posed(c), make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
                     for c in (curves, late))  # fmt: skip
    np.testing.assert_array_equal(first.factors, second.factors)


@pytest.mark.parametrize("duration", [1e-9, 1e-6, 0.04])
def test_the_controller_keeps_the_limit_in_steps_near_rounding(make_curves, duration) -> None:
    limit = load_rate_limit("surace2025")
    # A factor above 0.5 has steps of 1.1e-16. 3 %/s let it go 1e-12 in a frame of 1e-9 s, and rounding to the
    # nearest factor oversteps that by up to 5e-5 of it.
    curves = make_curves(np.tile([0.9, 0.1], 40), luminance=np.tile([100.0, 3.0], 40))
    curves = replace(curves, durations=np.full(80, duration))
    track = control_curves(
        curves, Controller(ControllerSettings(0.3, gain_rate=None), scalar_rate_limit(limit)), 0.5
    )
    assert np.any(track.rate != 0)
    assert largest_rate_ratio(track.rate, track.rate_limit) <= 1 + 1e-6


def test_durations_of_zero_are_refused_and_time_stamps_must_rise(make_curves) -> None:
    with pytest.raises(ValueError, match="a duration above 0 s, got 1 and 0"):
        Frame(1.0, 0.0, np.zeros((8, 8, 3), np.uint8))
    curves = make_curves([0.2, 0.5, 0.6])
    with pytest.raises(ValueError, match="durations must be above 0 s, got 0"):
        replace(curves, durations=np.array([0.04, 0.0, 0.04]))
    with pytest.raises(ValueError, match="times must rise from frame to frame"):
        replace(curves, times=np.array([0.0, 0.04, 0.04]))


def test_equal_time_stamps_hide_a_frame_and_nothing_else() -> None:
    ticks = [0, 33, 33, 66, 100]
    times = frame_times(ticks, Fraction(1, 1000))
    assert times.durations.tolist().count(0.0) == 1
    assert times.shown == 4
    assert times.durations.sum() == pytest.approx(0.1 + np.median([33, 33, 34]) / 1000)


def test_a_day_of_video_keeps_its_frame_rate() -> None:
    frames = 24 * 3600 * 30
    times = uniform_times(frames, Fraction(30)).times[-100:]
    np.testing.assert_allclose(np.diff(times), 1 / 30, rtol=1e-8)


def test_files_give_back_every_bit(make_curves, tmp_path) -> None:
    rng = np.random.default_rng(2)
    odd = np.concatenate([[5e-324, 1e-310, 1 / 3, 0.1 + 0.2], rng.random(20)])
    curves = replace(make_curves(np.sort(odd)), visible_contrast=odd)
    write_loss_curves(tmp_path / "curves.npz", curves)
    again = read_loss_curves(tmp_path / "curves.npz")
    for name in ("times", "durations", "factors", "loss", "visible_contrast", "mean_luminance"):
        np.testing.assert_array_equal(getattr(again, name), getattr(curves, name))
    header = replace(HEADER, budget=1 / 3)
    factors = np.maximum(odd, 1e-3)
    rate = np.append(np.diff(factors), 0.0) / 3
    track = BrightnessTrack(86_400 + np.arange(24) / 240, factors, odd, 1e4 * odd, rate, 1 + odd, odd, header)
    write_track(tmp_path / "track.csv", track)
    back = read_track(tmp_path / "track.csv")
    for name in ("times", "factors", "contrast_loss", "mean_luminance", "rate", "rate_limit", "power"):
        np.testing.assert_array_equal(getattr(back, name), getattr(track, name))
    assert back.header.budget == 1 / 3

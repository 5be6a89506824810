"""Hard cases of time and of length: steps of no length, days of video, a hundred thousand frames."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from evenlight.data_schema.tracks.brightness_track import (
    BudgetUnit,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves
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

"""Hard cases of loss curves, budgets and limits: flat, jumping, rising curves, ends of the range."""

from dataclasses import replace

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import SolverName
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.governor import GovernorSettings, frame_costs, governor_of
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.objective import pairwise_spread, proximal_spread
from evenlight.method.optimizer.optimize import Problem, is_feasible, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import make_solver
from evenlight.method.preset_files import load_power_model
from evenlight.method.rate_limit import largest_rate_ratio, rate_limit_at, scalar_rate_limit

OLED = PowerModel("o", PanelKind.OLED, 0.1, red_power=0.3, green_power=1.0, blue_power=0.4)
KNOTS = 17


def limit_of(rate: float) -> RateLimit:
    """The same rate at all luminances from 0.001 cd/m^2 on."""
    return RateLimit("flat", "d", "", RateLimitForm.RATE, (rate,), (1e-3, 1e6))


def with_losses(make_curves, losses: np.ndarray, **others) -> LossCurves:
    """Curves with the given losses at their knots, (N, 17)."""
    made = make_curves(np.full(len(losses), 0.5), knots=KNOTS, **others)
    return replace(made, loss=losses)


def solved(problem: Problem) -> np.ndarray:
    """An answer, once it has shown that it is one, and that the bound lies below it."""
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    assert is_feasible(problem, answer.factors)
    assert lower_bound(problem, answer) <= problem.objective(answer.factors) + 1e-9
    return answer.factors


def posed(curves: LossCurves, budget: float = 0.5, rate: float = 5.0) -> Problem:
    return pose(curves, Request(budget, BudgetUnit.FACTOR, load_power_model("surace2025"), limit_of(rate)))


def test_flat_curves_leave_nothing_to_gain(make_curves) -> None:
    levels = np.array([0.1, 0.4, 0.4, 0.0, 0.9, 1.0])
    curves = with_losses(make_curves, np.repeat(levels[:, None], KNOTS, axis=1))
    problem = posed(curves)
    assert problem.objective(solved(problem)) == pytest.approx(pairwise_spread(levels), abs=1e-12)
    assert factor_at_loss(curves, np.full(6, 0.3)).min() >= 0.2


@pytest.mark.slow
def test_curves_that_jump(make_curves) -> None:
    factors = np.linspace(0.2, 1, KNOTS)
    jumps = np.array([0.3, 0.45, 0.6, 0.8, 0.5, 0.35])
    curves = with_losses(make_curves, np.where(factors < jumps[:, None], 0.7, 0.0))
    problem = posed(curves, budget=0.55, rate=50.0)
    assert problem.objective(solved(problem)) < 0.9 * problem.objective(problem.baseline())


def test_curves_that_rise_and_fall(make_curves) -> None:
    rng = np.random.default_rng(5)
    losses = rng.random((8, KNOTS))
    curves = with_losses(make_curves, losses)
    reachable = losses[:, -1] <= 0.5
    assert reachable.any()
    found = factor_at_loss(curves, np.full(8, 0.5))
    for way in np.linspace(0, 1, 50):  # no factor above the one found loses more
        assert (loss_and_slope(curves, found + way * (1 - found))[0] <= 0.5 + 1e-12)[reachable].all()
    problem = posed(curves)
    assert problem.objective(solved(problem)) <= problem.objective(problem.baseline()) + 1e-12


def test_losses_below_all_floats(make_curves) -> None:
    losses = np.linspace(3e-308, 0, KNOTS) * np.linspace(0.1, 1, 5)[:, None]
    curves = with_losses(make_curves, losses)
    for wanted in (-1.0, 0.0, 1e-308, 0.5):
        found = factor_at_loss(curves, np.full(5, wanted))
        assert ((found >= 0.2) & (found <= 1)).all()
    solved(posed(curves))


@pytest.mark.slow
@pytest.mark.parametrize(
    "budget", [0.2, 0.2 + 1e-12, 0.2 + 1e-9, 0.2 + 1e-6, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12, 1.0]
)
def test_a_budget_a_hair_from_the_ends(make_curves, budget) -> None:
    rng = np.random.default_rng(6)
    problem = posed(make_curves(rng.uniform(0, 0.9, 30), luminance=rng.uniform(1, 100, 30)), budget)
    factors = solved(problem)
    assert abs(problem.budget_error(factors)) < 1e-9
    assert factors.min() >= 0.2 - 1e-12
    assert factors.max() <= 1 + 1e-12


def test_a_rate_limit_of_zero_somewhere_or_everywhere(make_curves) -> None:
    curves = make_curves([0.2, 0.5, 0.6, 0.3, 0.8, 0.1], luminance=[5, 10, 50, 100, 0, 20])
    still = posed(curves, rate=0.0)
    factors = solved(still)
    # The black frame joins two pairs of steps that are not free: nothing moves.
    assert np.ptp(factors) == 0
    assert factors[0] == pytest.approx(0.5, abs=1e-9)
    assert largest_rate_ratio(np.zeros(6), np.zeros(6)) == 0.0
    coefficients = (5.0, -20.0)  # a line that meets 0 at 41.25 cd/m^2
    falling = RateLimit("falling", "d", "", RateLimitForm.RATE, coefficients, (10.0, 60.0))
    assert rate_limit_at(falling, [45.0, 60.0]).tolist() == [0.0, 0.0]
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), falling)
    solved(pose(curves, request))


def test_ties_in_the_order_of_the_losses() -> None:
    tied = np.full(8, 0.3)
    np.testing.assert_allclose(proximal_spread(tied, 0.01), tied, atol=1e-15)
    assert pairwise_spread(tied) == 0.0
    mixed = np.array([0.3, 0.1, 0.3, 0.1, 0.3])  # two values: 6 of the 10 pairs differ, by 0.2
    assert pairwise_spread(mixed) == pytest.approx(0.2 * 6 / 10, abs=1e-16)


@pytest.mark.parametrize("unit", [BudgetUnit.POWER, BudgetUnit.WATT])
@pytest.mark.parametrize("base_power", [0.0, 0.1])
def test_a_black_video_on_an_oled_panel(make_curves, unit, base_power) -> None:
    panel = replace(OLED, base_power=base_power)
    curves = make_curves([0.0, 0.0], luminance=0.0)
    with pytest.raises(InputError, match="the video is black throughout: dimming an OLED panel saves no"):
        pose(curves, Request(0.6, unit, panel, limit_of(5.0)))


def test_a_video_that_is_black_in_part_on_an_oled_panel(make_curves) -> None:
    curves = make_curves([0.3, 0.0, 0.0, 0.7], luminance=[60, 0, 0, 30])
    problem = pose(curves, Request(0.6, BudgetUnit.POWER, OLED, limit_of(5.0)))
    assert problem.budget_weights.tolist()[1:3] == [0.0, 0.0]
    solved(problem)


def test_a_night_before_the_day_on_an_oled_panel_online(make_curves) -> None:
    """20 s of night, in which nothing can be used, and 80 s of day, which takes twice what is due."""
    light = np.repeat([0.1, 52.2], [200, 800])
    day, window = 1.7 * 52.2 / 104.4, 200
    asked = GovernorSettings(OLED.base_power + 0.5 * day, BudgetUnit.WATT, 20.0)
    curves = make_curves(np.full(1000, 0.2), luminance=light, frames_per_second=10.0)
    controller = Controller(ControllerSettings(0.03), lambda _: 1e9)
    governed = (governor_of(controller, asked), frame_costs(curves, asked, OLED))
    factors = control_curves(curves, controller, 0.5, None, governed).factors
    used = factors * day * light / 52.2
    assert np.convolve(used, np.ones(window) / window, "valid").max() < 0.6 * day
    assert factors[window:].min() > 0.4
    assert np.ptp(factors[-2 * window :]) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("luminance", [1e-300, 1e-6, 1e-4, 1e4, 1e6])
def test_luminances_of_any_size(make_curves, luminance) -> None:
    strength = np.array([0.2, 0.5, 0.6, 0.3])
    curves = make_curves(strength, luminance=luminance)
    settings = ControllerSettings(0.2)
    limit = limit_of(0.03 * luminance) if luminance > 1e-3 else limit_of(1.0)
    track = control_curves(curves, Controller(settings, scalar_rate_limit(limit)))
    assert largest_rate_ratio(track.rate, track.rate_limit) <= 1 + 1e-9
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), limit)
    solved(pose(curves, request))


@pytest.mark.slow
def test_bright_frames_and_dark_ones_have_steps_of_one_scale(make_curves) -> None:
    rng = np.random.default_rng(7)
    strength, exponent = rng.uniform(0.1, 0.9, 40), rng.uniform(0.5, 2, 40)
    mixed = rng.choice([0.0, 1e-300, 1e-6, 1e-4, 1.0, 50.0, 1e4, 1e6], 40)
    speed = (mixed[:-1] + mixed[1:]) / 2 * 25  # slopes of the rates, in cd/m^2/s per factor
    assert speed.max() / speed[speed > 0].min() > 1e12  # a compiled SLSQP crashed on the like of them
    for luminance in (np.full(40, 1e6), mixed):
        problem = posed(make_curves(strength, exponent, luminance), rate=30.0)
        for name in (SolverName.SPLITTING, SolverName.SLSQP):
            answer = optimize(problem, make_solver(name, np.random.default_rng(0)))
            assert is_feasible(problem, answer.factors)
        assert answer.iterations < 60  # with slopes of 2.5e7 SLSQP took 160 for the first


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_budgets_in_watt_at_the_ends_whatever_the_panel(make_curves, size) -> None:
    panel = PowerModel("p", PanelKind.LCD, 0.3 * size, power_per_luminance=size / 750, peak_luminance=750.0)
    curves = make_curves([0.2, 0.5, 0.7])
    for share in (0.2, 1.0):
        watt = panel.base_power + share * panel.power_per_luminance * panel.peak_luminance
        # A watt is rounded to 1e-22 or to 1e-11, as the panel is: no difference in watt allows for both.
        assert (np.spacing(watt) > 1e-12) == (size == 1e5)
        for budget in (watt * (1 - 2e-16), watt, watt * (1 + 2e-16)):
            request = Request(budget, BudgetUnit.WATT, panel, limit_of(5.0))
            assert pose(curves, request).baseline_factor == pytest.approx(share, abs=1e-12)

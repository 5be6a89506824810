"""Rate limits with dips, zeros and steep stretches, long frames, ends of the budget: answers stay answers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import SolverName
from evenlight.method.optimizer.calm import calmed
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import Problem, feasible_blend, is_feasible, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import make_solver
from evenlight.method.preset_files import load_power_model, load_rate_limit


def odd_problem(make_curves, seed: int) -> tuple[Problem, np.random.Generator]:
    """A few frames, often seconds long, of any luminance, under a rate limit that winds up and down."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    curves = make_curves(
        rng.uniform(0, 0.9, n),
        exponent=rng.uniform(0.4, 2.5, n),
        luminance=np.where(rng.random(n) < 0.1, 0.0, rng.uniform(0.01, 100, n)),
        frames_per_second=float(10 ** rng.uniform(-2, 1.5)),
        knots=int(rng.integers(2, 20)),
    )
    form = list(RateLimitForm)[int(rng.integers(3))]
    coefficients = tuple(rng.normal(0, 1.5, int(rng.integers(1, 6))).tolist())
    if form is RateLimitForm.RATE:  # one that is below 0 everywhere is refused; the first is its mean
        coefficients = (abs(coefficients[0]), *coefficients[1:])
    limit = RateLimit("odd", "d", "", form, coefficients, (1.0, 100.0))
    budget = float(rng.choice([0.2, 1.0, rng.uniform(0.2, 1.0)]))
    return pose(curves, Request(budget, BudgetUnit.FACTOR, load_power_model("surace2025"), limit)), rng


@pytest.mark.slow
@settings(max_examples=20)
@given(seed=st.integers(0, 100_000))
def test_every_answer_is_feasible_and_no_feasible_track_goes_below_the_bound(make_curves, seed) -> None:
    problem, rng = odd_problem(make_curves, seed)
    answer = optimize(problem, make_solver(SolverName.SPLITTING, rng))
    assert is_feasible(problem, answer.factors)
    assert is_feasible(problem, calmed(problem, answer.factors, 0.1))
    bound = lower_bound(problem, answer)
    assert type(bound) is float
    assert bound <= problem.objective(answer.factors) + 1e-12
    for _ in range(60):
        wild = rng.uniform(0.2, 1.0, len(answer.factors))
        wild = np.clip(wild - problem.budget_error(wild), 0.2, 1.0)
        track = feasible_blend(problem, wild)
        if is_feasible(problem, track):
            assert bound <= problem.objective(track) + 1e-9


def test_the_bound_knows_that_a_limit_with_a_dip_can_be_jumped_over(make_curves) -> None:
    # The limit 0.1 (L - 25)² is 0 at 25 cd/m², but for frames of 10 s the step from 12.5 to 37.5 keeps it at
    # both its ends: 25 cd/m² in 10 s are 2.5, and 0.1 · 12.5² is 15.6. There the losses are equal.
    low, high = 1.0, 100.0
    z = np.linspace(-1, 1, 50)
    luminance = (high + low) / 2 + z * (high - low) / 2
    fit = np.polynomial.legendre.legfit(z, 0.1 * (luminance - 25) ** 2, 2)
    limit = RateLimit("dip", "d", "", RateLimitForm.RATE, tuple(fit.tolist()), (low, high))
    curves = make_curves([0.2, 0.6], luminance=50.0, frames_per_second=0.1)
    problem = pose(curves, Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), limit))
    jump = np.array([0.25, 0.75])
    assert is_feasible(problem, jump)
    assert problem.objective(jump) < 1e-12
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    assert lower_bound(problem, answer) <= problem.objective(jump) + 1e-9


@pytest.mark.parametrize("budget", [0.2, 1.0])
@pytest.mark.parametrize("name", [SolverName.SPLITTING, SolverName.SLSQP])
def test_where_only_constant_dimming_fits_the_bound_is_its_objective(make_curves, budget, name) -> None:
    curves = make_curves([0.2, 0.5, 0.6, 0.3], luminance=[5, 10, 50, 100])
    limit = load_rate_limit("surace2025")
    problem = pose(curves, Request(budget, BudgetUnit.FACTOR, load_power_model("surace2025"), limit))
    answer = optimize(problem, make_solver(name, np.random.default_rng(0)))
    # Less than the slope of a curve times the tolerance of the budget, 1e-9, is left to choose.
    only = problem.objective(problem.baseline())
    assert only - 1e-8 < lower_bound(problem, answer) <= only


def test_a_frame_without_a_share_in_the_budget_leaves_a_choice(make_curves) -> None:
    curves = make_curves([0.2, 0.5, 0.6, 0.3], luminance=[5, 10, 50, 100])
    brief = replace(curves, durations=np.array([1.0, 1e-10, 1.0, 1.0]))
    limit = RateLimit("fast", "d", "", RateLimitForm.RATE, (1e9,), (1.0, 100.0))
    problem = pose(brief, Request(0.2, BudgetUnit.FACTOR, load_power_model("surace2025"), limit))
    moved = np.array([0.2, 0.2 + 0.002, 0.2, 0.2])  # uses 7e-14 more than the budget
    assert is_feasible(problem, moved)
    assert problem.objective(moved) < problem.objective(problem.baseline()) - 1e-4
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    step = replace(answer, factors=moved)
    assert lower_bound(problem, step) <= problem.objective(moved)
    assert lower_bound(problem, answer) <= problem.objective(moved)


def test_an_answer_without_dual_variables_gets_a_bound_too(make_curves) -> None:
    share = 1 / (1 + np.exp(-np.linspace(-8, 8, 60)))
    curves = make_curves(0.2 + 0.5 * share, exponent=1.3, luminance=60 - 50 * share, frames_per_second=2.0)
    limit = load_rate_limit("surace2025")
    problem = pose(curves, Request(0.3, BudgetUnit.FACTOR, load_power_model("surace2025"), limit))
    answer = optimize(problem, make_solver(SolverName.SLSQP, np.random.default_rng(0)))
    assert answer.frame_weights is None
    assert 0 < lower_bound(problem, answer) <= problem.objective(answer.factors)


def test_a_mean_factor_is_no_budget_for_an_oled_panel(make_curves) -> None:
    oled = PowerModel("o", PanelKind.OLED, 0.1, red_power=1.0, green_power=1.0, blue_power=1.0)
    request = Request(0.5, BudgetUnit.FACTOR, oled, load_rate_limit("surace2025"))
    with pytest.raises(InputError, match="says nothing of the power of an OLED panel"):
        pose(make_curves([0.2, 0.3]), request)


@pytest.mark.parametrize("luminance", [1e-4, 1e4, 1e-300])
def test_very_dark_and_very_bright_frames(make_curves, luminance) -> None:
    curves = make_curves([0.2, 0.5, 0.6, 0.3], luminance=luminance)
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), load_rate_limit("surace2025"))
    problem = pose(curves, request)
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    assert is_feasible(problem, answer.factors)
    assert lower_bound(problem, answer) <= problem.objective(answer.factors) + 1e-12

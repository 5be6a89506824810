"""Answers of every solver are answers: budget, rate limit, bounds, baseline; no feasible nudge is better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from general_solvers import SequentialConvexSolver, by_clarabel, by_highs, comparators, pair_sum_rows
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from threadpoolctl import threadpool_info, threadpool_limits

import evenlight
from benchmarks.optimizer_problems import made_curves, mean_factor_problem
from evenlight.analysis.tracks import optimization
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, TrackHeader
from evenlight.method.choices import ModulatedLuminance, SolverName
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer import splitting
from evenlight.method.optimizer.evaluate import RunRecord, SolverAnswer, summarize, track_of
from evenlight.method.optimizer.lower_bound import _best_over_prices, _rate_table, _Tangent, lower_bound
from evenlight.method.optimizer.objective import pairwise_spread, weight_of_pairs
from evenlight.method.optimizer.optimize import Problem, Solution, feasible_blend, is_feasible, optimize, pose
from evenlight.method.optimizer.request import Request, require_possible
from evenlight.method.optimizer.slsqp import _slack, _slack_slope, slsqp_from
from evenlight.method.optimizer.splitting import (
    BLOCK,
    FAR_TO_NEAR,
    LONG,
    MEDIUM,
    SETTLED,
    SplittingSolver,
    coarse_problem,
    make_solver,
    refined_solution,
)
from evenlight.method.preset_files import load_power_model, load_rate_limit

SOLVERS = [SolverName.SPLITTING, SolverName.SLSQP]  # test_optimize.py has the slower ones


def two_scenes(make_curves, n=40, frames_per_second=2.0):
    """A bright scene that loses little, then a dark one that loses much, with a soft passage between."""
    share = 1 / (1 + np.exp(-(np.arange(n) - n / 2) / 3))
    return make_curves(
        0.2 + 0.5 * share, exponent=1.3, luminance=60 - 50 * share, frames_per_second=frames_per_second
    )


def solve(problem: Problem, name: SolverName) -> Solution:
    return optimize(problem, make_solver(name, np.random.default_rng(1)))


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("budget", [0.2, 0.3, 0.5, 0.8, 1.0])
def test_budget_rate_limit_and_bounds_are_met_and_the_baseline_is_not_better(
    make_curves, make_problem, name, budget
) -> None:
    problem = make_problem(two_scenes(make_curves), budget)
    factors = solve(problem, name).factors
    assert np.mean(factors) == pytest.approx(budget, abs=1e-9)
    assert problem.rate_ratio(factors) <= 1 + 1e-9
    assert factors.min() >= 0.2 - 1e-12
    assert factors.max() <= 1 + 1e-12
    assert problem.objective(factors) <= problem.objective(problem.baseline()) + 1e-12


@pytest.mark.parametrize("name", SOLVERS)
def test_no_feasible_nudge_improves_the_answer(make_curves, make_problem, name) -> None:
    problem = make_problem(two_scenes(make_curves, 40), 0.5)
    answer = solve(problem, name).factors
    rng = np.random.default_rng(2)
    for scale in (1e-3, 1e-2):
        for _ in range(50):
            nudge = np.convolve(rng.standard_normal(40), np.ones(7) / 7, "same")
            nudged = answer + scale * (nudge - nudge.mean())
            feasible = feasible_blend(problem, np.clip(nudged, 0.2, 1.0))
            if abs(problem.budget_error(feasible)) < 1e-9:
                assert problem.objective(feasible) >= problem.objective(answer) - 2e-6


def test_the_two_solvers_agree(make_curves, make_problem) -> None:
    problem = make_problem(two_scenes(make_curves), 0.5)
    ours, paper = (problem.objective(solve(problem, name).factors) for name in SOLVERS)
    assert ours <= paper + 1e-6
    assert ours == pytest.approx(paper, abs=1e-4)


def test_without_a_binding_limit_all_frames_lose_the_same_by_hand(make_curves, make_problem) -> None:
    # Losses 0.2 (1 - b) and 0.6 (1 - b) are equal, at a mean factor of 0.5, where 1 - b is 0.75 and 0.25.
    curves = make_curves([0.2, 0.6], frames_per_second=0.01)
    problem = make_problem(curves, 0.5, relative_rate=10.0)
    for name in SOLVERS:
        factors = solve(problem, name).factors
        np.testing.assert_allclose(factors, [0.25, 0.75], atol=1e-4)
        assert problem.objective(factors) < 1e-4


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("n", [1, 2, 7])
def test_a_static_clip_gets_a_constant_track(make_curves, make_problem, name, n) -> None:
    factors = solve(make_problem(make_curves(np.full(n, 0.4)), 0.5), name).factors
    np.testing.assert_allclose(factors, 0.5, atol=2e-3 if name is SolverName.SLSQP else 1e-12)


@pytest.mark.parametrize("name", SOLVERS)
def test_frames_that_lose_nothing_keep_the_baseline(make_curves, make_problem, name) -> None:
    problem = make_problem(make_curves(np.zeros(20)), 0.4)
    assert problem.objective(solve(problem, name).factors) == 0.0


@pytest.mark.parametrize("name", SOLVERS)
def test_a_limit_of_zero_leaves_only_a_constant(make_curves, make_problem, name) -> None:
    curves = two_scenes(make_curves, 30)
    frozen = RateLimit("frozen", "d", "", RateLimitForm.RATE, (0.0,), (1.0, 100.0))
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), frozen)
    factors = solve(pose(curves, request), name).factors
    np.testing.assert_allclose(factors, 0.5, atol=1e-9)


def test_a_cut_between_black_and_white_moves_within_the_limit_of_the_black(make_curves, make_problem) -> None:
    curves = make_curves(
        [0.0] * 20 + [0.6] * 20 + [0.1] * 20, luminance=[0.2] * 20 + [100.0] * 20 + [30.0] * 20
    )
    problem = make_problem(curves, 0.5)
    factors = solve(problem, SolverName.SPLITTING).factors
    assert problem.rate_ratio(factors) <= 1 + 1e-9
    # Across the cut the change of 50 cd/m^2 per unit of factor must stay below 3 % of 0.1 cd/m^2 per second.
    assert abs(factors[20] - factors[19]) < 0.03 * 0.1 * 0.04 / 50 * 1.1
    assert problem.objective(factors) < problem.objective(problem.baseline())


def test_frames_without_any_light_are_free_to_move(make_curves, make_problem) -> None:
    problem = make_problem(make_curves([0.3, 0.3, 0.3, 0.3], luminance=0.0), 0.5)
    assert problem.rate_ratio(np.array([0.2, 0.8, 0.2, 0.8])) == 0.0
    assert problem.objective(solve(problem, SolverName.SPLITTING).factors) == 0.0


def test_slsqp_refuses_a_long_video_and_names_the_other_solver(make_curves, make_problem) -> None:
    with pytest.raises(InputError, match="at most 500 frames, this video has 501; use the solver splitting"):
        solve(make_problem(make_curves(np.full(501, 0.3)), 0.5), SolverName.SLSQP)


@pytest.mark.parametrize(("budget", "least"), [(0.3, 0.9), (0.5, 0.0), (0.8, 0.0)])
def test_the_lower_bound_lies_below_what_any_solver_finds(make_curves, make_problem, budget, least) -> None:
    problem = make_problem(two_scenes(make_curves), budget)
    ours = solve(problem, SolverName.SPLITTING)
    bound = lower_bound(problem, ours)
    assert least * problem.objective(ours.factors) <= bound <= problem.objective(ours.factors)
    for seed in range(3):
        other = optimize(problem, make_solver(SolverName.SLSQP, np.random.default_rng(seed)))
        assert bound <= problem.objective(other.factors)


def test_the_search_for_a_price_ends_where_none_lifts_the_bound_above_a_known_one() -> None:
    def search(known: float) -> list[float]:
        tried = []

        def bound(price: float) -> _Tangent:
            tried.append(0.5 - 0.01 * (price - 3) ** 2)
            return _Tangent(price, tried[-1], -0.02 * (price - 3))

        assert _best_over_prices(SimpleNamespace(bound=bound), 0.0, 1.0, 30, 1e-6, known).value == max(tried)
        return tried

    assert search(0.4) == search(-np.inf)
    assert 0.49999 < max(search(0.4)) <= 0.5
    assert len(search(0.6)) < len(search(0.4))


def test_a_second_w_along_chords_lifts_a_poor_bound(make_curves, make_problem, monkeypatch) -> None:
    problem = make_problem(two_scenes(make_curves), 0.5)
    ours = solve(problem, SolverName.SPLITTING)
    assert ours.frame_weights is not None
    poor = replace(ours, frame_weights=0.5 * ours.frame_weights)
    backwards = replace(ours, frame_weights=ours.frame_weights[::-1].copy())
    assert lower_bound(problem, backwards) <= problem.objective(ours.factors)
    both = lower_bound(problem, poor)
    monkeypatch.setattr("evenlight.method.optimizer.lower_bound.ENOUGH", -np.inf)  # the first will do
    assert lower_bound(problem, poor) < both <= problem.objective(ours.factors)


def test_the_frame_weights_lie_in_the_permutahedron(make_curves, make_problem) -> None:
    # Sums of the k largest entries are at most those of the k largest order weights, and all add up to 0.
    problem = make_problem(two_scenes(make_curves), 0.5)
    weights = solve(problem, SolverName.SPLITTING).frame_weights
    assert weights is not None
    n = len(weights)
    largest = np.cumsum(np.sort(weights)[::-1])
    allowed = np.cumsum(np.arange(n - 1, -n, -2) / n)
    assert (largest <= allowed + 1e-9).all()
    assert largest[-1] == pytest.approx(0, abs=1e-9)


def test_a_share_of_power_becomes_the_factor_that_takes_it_by_hand(make_curves, make_weber_limit) -> None:
    # Full power 0.2945 + 0.001858 · 750 = 1.688 W; half of it, 0.844 W, needs b = (0.844 - 0.2945) / 1.3935.
    curves = make_curves([0.2, 0.3])
    request = Request(0.5, BudgetUnit.POWER, load_power_model("surace2025"), make_weber_limit(0.03))
    assert pose(curves, request).baseline_factor == pytest.approx((0.844 - 0.2945) / 1.3935, abs=1e-12)
    watts = replace(request, budget=0.844, budget_unit=BudgetUnit.WATT)
    assert pose(curves, watts).baseline_factor == pytest.approx((0.844 - 0.2945) / 1.3935, abs=1e-12)


@pytest.mark.parametrize(
    ("budget", "unit", "says"),
    [
        (0.1, BudgetUnit.FACTOR, r"the budget 0.1 \(factor\) cannot be met.*0.2 to 1"),
        (1.2, BudgetUnit.FACTOR, r"the budget 1.2 \(factor\) cannot be met.*0.2 to 1"),
        (0.1, BudgetUnit.POWER, r"the budget 0.1 \(power\) cannot be met.*0.3396 to 1"),
        (3.0, BudgetUnit.WATT, r"the budget 3 \(watt\) cannot be met.*0.5732 to 1.688"),
    ],
)
def test_an_impossible_budget_says_which_are_possible(
    make_curves, make_weber_limit, budget, unit, says
) -> None:
    request = Request(budget, unit, load_power_model("surace2025"), make_weber_limit(0.03))
    with pytest.raises(InputError, match=says):
        pose(make_curves([0.2, 0.3]), request)


WHITE_OF_3_W = PowerModel("o", PanelKind.OLED, 0.2, red_power=0.5, green_power=1.0, blue_power=1.5)


@pytest.mark.parametrize(
    ("budget", "unit"),
    [
        (0.2, BudgetUnit.WATT),  # black alone
        (0.1, BudgetUnit.WATT),
        (3.201, BudgetUnit.WATT),
        (0.249, BudgetUnit.POWER),  # (0.2 + 0.2 · 3) / 3.2, of white
        (1.001, BudgetUnit.POWER),
        (0.5, BudgetUnit.FACTOR),
    ],
)
def test_on_an_oled_what_no_content_meets_is_refused_at_once(make_weber_limit, budget, unit) -> None:
    with pytest.raises(InputError, match=f"the budget {budget:g}|the budget unit factor") as refused:
        require_possible(Request(budget, unit, WHITE_OF_3_W, make_weber_limit(0.03)), 0.2)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("budget", "unit"),
    [(0.201, BudgetUnit.WATT), (3.2, BudgetUnit.WATT), (0.25, BudgetUnit.POWER), (1.0, BudgetUnit.POWER)],
)
def test_on_an_oled_what_some_content_meets_is_not(make_weber_limit, budget, unit) -> None:
    require_possible(Request(budget, unit, WHITE_OF_3_W, make_weber_limit(0.03)), 0.2)


def test_on_an_oled_a_bright_frame_costs_more_of_the_budget(make_curves, make_weber_limit) -> None:
    oled = PowerModel("o", PanelKind.OLED, 0.1, red_power=1.0, green_power=1.0, blue_power=1.0)
    curves = make_curves([0.2, 0.3], luminance=[10.44, 31.32])  # channel means 0.1 and 0.3
    problem = pose(curves, Request(0.4, BudgetUnit.POWER, oled, make_weber_limit(0.03)))
    np.testing.assert_allclose(problem.budget_weights, [0.25, 0.75])


def test_uneven_frame_durations_weigh_by_time(make_curves, make_weber_limit) -> None:
    curves = replace(make_curves([0.2, 0.3]), times=np.array([0.0, 0.1]), durations=np.array([0.1, 0.3]))
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), make_weber_limit(0.03))
    np.testing.assert_allclose(pose(curves, request).budget_weights, [0.25, 0.75])


def test_the_white_field_may_stand_for_the_content(make_curves, make_weber_limit) -> None:
    request = Request(
        0.5,
        BudgetUnit.FACTOR,
        load_power_model("surace2025"),
        make_weber_limit(0.03),
        modulated=ModulatedLuminance.WHITE_FIELD,
    )
    np.testing.assert_array_equal(pose(make_curves([0.2, 0.3]), request).luminance, 104.4)


def steep(luminance: np.ndarray) -> np.ndarray:
    """A rate limit that rises by more than the margin from bin to bin of the table."""
    return (np.asarray(luminance) / 5.0) ** 200


def test_the_table_of_the_lower_bound_is_nowhere_below_the_rate_limit(make_curves, make_problem) -> None:
    """Else the bound would be of a narrower problem. Wherever in a segment of its curve a factor lies."""
    light = np.linspace(9.76, 60.0, 400)  # anywhere in their bins; the first segment is 140.8 bins wide
    problem = make_problem(two_scenes(make_curves, 400), 0.5)
    problem = replace(problem, luminance=light, rate_limit=steep)
    table, highest = _rate_table(problem)
    knots = problem.curves.factors
    for frame, light in enumerate(problem.luminance):
        place = np.floor(table.place[frame] + table.offset).astype(int)
        bins = np.clip(place, 0, len(table.highest) - 1)
        for segment in range(len(knots) - 1):
            factors = np.linspace(knots[segment], knots[segment + 1], 9)
            assert table.highest[bins[segment]] >= steep(factors * light).max()
        assert highest[frame] >= steep(light * np.linspace(knots[0], 1.0, 50)).max()


def test_the_derivative_of_the_slack_is_that_of_finite_differences(make_curves, make_problem) -> None:
    problem = make_problem(two_scenes(make_curves, 8), 0.5)
    factors, reach = np.random.default_rng(3).uniform(0.3, 0.9, 8), problem.step_reach()
    nudge = 1e-6
    ends = [(factors - nudge * e, factors + nudge * e) for e in np.eye(8)]
    changes = [_slack(problem, reach, after) - _slack(problem, reach, before) for before, after in ends]
    by_difference = np.stack(changes, axis=1) / (2 * nudge)
    np.testing.assert_allclose(_slack_slope(problem, reach, factors), by_difference, rtol=1e-3, atol=1e-6)


# --- general solvers

GENERAL = [by_highs, by_clarabel]

RNG = np.random.default_rng(0)


@given(st.lists(st.integers(0, 9), min_size=1, max_size=24))
def test_the_network_sorts(values) -> None:
    wires = list(values)
    for i, j in comparators(len(wires)):
        wires[i], wires[j] = min(wires[i], wires[j]), max(wires[i], wires[j])
    assert wires == sorted(values)


@settings(max_examples=25)
@given(st.integers(2, 12), st.booleans(), st.integers(0, 1000))
def test_the_least_cost_of_the_rows_is_the_pair_sum(n, even, seed) -> None:
    rng = np.random.default_rng(seed)
    weights = np.ones(n) if even else rng.uniform(0.1, 3.0, n)
    loss = rng.random(n).round(1)
    rows = pair_sum_rows(weights)
    held = [(value, value) for value in loss] + [(None, None)] * (len(rows.cost) - n)
    found = linprog(
        rows.cost, A_ub=rows.below, b_ub=np.zeros(rows.below.shape[0]),
        A_eq=rows.equal if rows.equal.shape[0] else None,
        b_eq=np.zeros(rows.equal.shape[0]) if rows.equal.shape[0] else None, bounds=held,
    )  # fmt: skip
    assert found.fun == pytest.approx(pairwise_spread(loss, weights) * weight_of_pairs(weights), abs=1e-7)


@pytest.mark.parametrize("solver", GENERAL)
def test_a_general_solver_agrees_with_ours_on_convex_curves(make_curves, make_problem, solver) -> None:
    share = 1 / (1 + np.exp(-np.linspace(-5, 5, 14)))
    curves = make_curves(0.2 + 0.5 * share, luminance=60 - 50 * share, frames_per_second=0.5)
    problem = make_problem(curves, 0.5)
    for importance in (None, 0.5 + share / share.mean() / 2):
        weighted = replace(problem, importance=importance)
        theirs = optimize(weighted, SequentialConvexSolver(solver))
        ours = optimize(weighted, SplittingSolver())
        assert weighted.objective(theirs.factors) == pytest.approx(weighted.objective(ours.factors), abs=2e-5)
        assert lower_bound(weighted, theirs) <= weighted.objective(ours.factors) + 1e-12


@pytest.mark.parametrize("solver", GENERAL)
@pytest.mark.parametrize("budget", [0.2, 0.2001, 0.9, 1.0])
def test_a_general_solver_keeps_the_limits_near_the_ends_of_the_budget(
    make_curves, make_problem, solver, budget
) -> None:
    problem = make_problem(make_curves([0.1, 0.4, 0.3, 0.6, 0.0, 0.2], luminance=30.0), budget)
    answer = optimize(problem, SequentialConvexSolver(solver))
    assert is_feasible(problem, answer.factors)
    assert problem.objective(answer.factors) <= problem.objective(problem.baseline())


def test_only_the_default_takes_a_start() -> None:
    with pytest.raises(InputError, match="a start is for the solver splitting, not for slsqp"):
        make_solver(SolverName.SLSQP, RNG, np.array([0.5]))


@pytest.mark.parametrize("n", [30, 60])
def test_the_dense_solver_of_short_videos_has_a_bound_on_its_iterations(monkeypatch, n) -> None:
    taken, most = [], 40

    def counting(problem: Problem, start, tolerance, iterations):
        factors, used = slsqp_from(problem, start, tolerance, iterations)
        taken.append(used)
        return factors, used

    monkeypatch.setattr(splitting, "slsqp_from", counting)
    monkeypatch.setattr(splitting, "DENSE_EFFORT", most * n**3)
    optimize(mean_factor_problem(made_curves(n, np.random.default_rng(3), 0.5), 0.5), SplittingSolver())
    assert most / 2 < sum(taken) <= 1.5 * most  # half as many again take the best of them to the end


def long_video(make_curves, n=1600):
    i = np.arange(n)
    return make_curves(
        0.4 + 0.2 * np.sin(i / 70) + 0.02 * np.sin(i / 3), luminance=30 + 20 * np.cos(i / 90), knots=17
    )


def test_a_start_from_an_earlier_track_saves_iterations_and_loses_nothing(make_curves, make_problem) -> None:
    curves = long_video(make_curves)
    earlier = optimize(make_problem(curves, 0.5), SplittingSolver()).factors
    edited = make_problem(curves, 0.52)
    cold, warm = optimize(edited, SplittingSolver()), optimize(edited, SplittingSolver(earlier))
    assert warm.iterations < 0.7 * cold.iterations
    assert edited.objective(warm.factors) <= edited.objective(cold.factors) * (1 + 1e-3)
    assert edited.objective(cold.factors) <= edited.objective(warm.factors) * (1 + 1e-3)


def test_a_start_that_breaks_every_limit_still_gives_an_answer(make_curves, make_problem) -> None:
    problem = make_problem(long_video(make_curves, 700), 0.5)
    wild = optimize(problem, SplittingSolver(start=np.tile([0.0, 9.0], 350)))
    assert is_feasible(problem, wild.factors)


def test_coarse_to_fine_ends_where_a_full_search_does(make_curves, make_problem) -> None:
    problem = make_problem(long_video(make_curves), 0.5)
    quick, full = optimize(problem, SplittingSolver()), optimize(problem, SplittingSolver(stages=FAR_TO_NEAR))
    assert problem.objective(quick.factors) <= problem.objective(full.factors) * 1.002


@pytest.mark.parametrize("n", [1, BLOCK, BLOCK + 1, 3 * BLOCK - 1])
def test_a_coarse_problem_has_budget_and_weights_of_the_full_one(make_curves, make_problem, n) -> None:
    problem = make_problem(make_curves(np.linspace(0.1, 0.6, n)), 0.5)
    problem = replace(
        problem, importance=np.linspace(0.5, 1.5, n) if n > 1 else None, allowances=np.full(n - 1, 2.0)
    )
    coarse = coarse_problem(problem)
    assert coarse.budget_weights.sum() == pytest.approx(1.0)
    assert coarse.curves.durations.sum() == pytest.approx(problem.curves.durations.sum())
    fine = refined_solution(problem, optimize(coarse, SplittingSolver(stages=FAR_TO_NEAR)))
    assert is_feasible(problem, fine.factors)


def test_the_bound_says_as_much_of_a_long_video_as_of_a_short_one(make_curves, make_problem) -> None:
    share = []
    for n in (1500, 6000):
        i = np.arange(n)
        curves = make_curves(0.4 + 0.25 * np.sin(i / 100), luminance=30.0, knots=17)
        problem = make_problem(curves, 0.5)
        answer = optimize(problem, SplittingSolver())
        share.append(lower_bound(problem, answer) / problem.objective(answer.factors))
    assert min(share) > 0.7
    assert share[1] > share[0] - 0.1


# --- more searches


def test_more_searches_are_no_worse_and_the_default_takes_more_than_one() -> None:
    problem = mean_factor_problem(made_curves(LONG + 20, np.random.default_rng(3), 0.5), 0.5)
    answers = [optimize(problem, SplittingSolver(searches=k)).factors for k in (1, 2, 3)]
    objectives = [problem.objective(factors) for factors in answers]
    assert all(is_feasible(problem, factors) for factors in answers)
    assert objectives == sorted(objectives, reverse=True)
    assert LONG + 20 <= MEDIUM <= SETTLED
    best = problem.objective(optimize(problem, SplittingSolver()).factors)
    assert best == objectives[2] < objectives[0] * 0.999


# --- evaluate


@pytest.fixture
def summary_with(make_curves):
    """A function that summarizes an answer with a lower bound that is given as a share of the objective."""
    curves = make_curves([0.2, 0.3, 0.5, 0.6], luminance=30.0, frames_per_second=5.0)
    limit = load_rate_limit("surace2025")
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), limit)
    problem = pose(curves, request)
    factors = problem.baseline()
    header = TrackHeader("v", "d", "f", "p", "r", 0.5, BudgetUnit.FACTOR, "splitting", Provenance())
    track = track_of(problem, request, factors, header)

    def summary(share):
        bound = problem.objective(factors) * share
        return summarize(problem, request, SolverAnswer(bound, 1, "default"), track, RunRecord(0, 0, 0))

    return summary


@pytest.mark.parametrize("share", [1.0001, 2.0, np.inf])
def test_a_bound_above_the_objective_of_an_answer_is_refused(summary_with, share) -> None:
    with pytest.raises(RuntimeError, match=r"lower bound .* is above .*, which an answer has"):
        summary_with(share)


def test_a_bound_above_the_objective_by_rounding_counts_as_the_objective(summary_with) -> None:
    summary = summary_with(1 + 1e-13)
    assert summary.lower_bound == summary.objective
    assert summary_with(0.5).lower_bound == pytest.approx(0.5 * summary.objective)


@dataclass(frozen=True)
class OffTheBudget:
    """A solver whose answer uses more, or less, than the budget."""

    by: float

    def solve(self, problem: Problem) -> Solution:
        answer = SplittingSolver().solve(problem)
        return replace(answer, factors=answer.factors + self.by)


def test_an_answer_is_held_to_the_budget_that_the_bound_covers(make_curves, make_problem) -> None:
    problem = make_problem(make_curves(np.linspace(0.2, 0.3, 4), luminance=30.0), 0.5)
    for by in (1e-7, -1e-7):
        with pytest.raises(RuntimeError, match="broke: budget"):
            optimize(problem, OffTheBudget(by))
    answer = optimize(problem, OffTheBudget(5e-10))
    assert lower_bound(problem, answer) <= problem.objective(answer.factors)


# --- one blas thread


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_long_sum_is_the_same_bit_for_bit_and_the_threads_are_given_back() -> None:
    """Threads are used from 10 000 terms on, and each adds up its own share of them."""
    values = np.random.default_rng(1).normal(size=200_000)
    found = []
    for count in (1, 2, 3):
        with threadpool_limits(limits=count, user_api="blas"):
            found.append(one_blas_thread(np.dot)(values, values[::-1].copy()))
            assert threads() == {count}
    assert len(set(found)) == 1


def test_a_track_is_optimized_and_certified_in_one_thread(
    make_curves: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    for name in ("optimize_problem", "lower_bound"):
        work = getattr(optimization, name)
        monkeypatch.setattr(
            optimization, name, lambda *given, work=work: (seen.append(threads()), work(*given))[1]
        )
    with threadpool_limits(limits=2, user_api="blas"):
        evenlight.optimize(make_curves(np.linspace(0.1, 0.2, 5)), 0.5)
    assert seen == [{1}, {1}]


@pytest.mark.parametrize("name", SOLVERS)
def test_the_scene_that_loses_more_gets_more_light(make_curves, make_problem, name) -> None:
    factors = solve(make_problem(two_scenes(make_curves), 0.5), name).factors
    assert factors[-10:].mean() > factors[:10].mean() + 0.1


def test_a_curve_that_jumps_and_one_that_is_not_monotone_are_survived(make_curves, make_problem) -> None:
    curves = two_scenes(make_curves, 50)
    loss = curves.loss.copy()
    loss[10] = np.where(curves.factors < 0.6, 0.9, 0.0)
    loss[30] = 0.3 + 0.3 * np.sin(20 * curves.factors)
    problem = make_problem(replace(curves, loss=loss), 0.5)
    factors = solve(problem, SolverName.SPLITTING).factors
    assert problem.objective(factors) <= problem.objective(problem.baseline())
    assert problem.rate_ratio(factors) <= 1 + 1e-9


def test_ten_thousand_frames_each_get_their_own_factor(make_curves, make_problem) -> None:
    i = np.arange(10_000)
    curves = make_curves(
        0.4 + 0.2 * np.sin(i / 700) + 0.02 * np.sin(i / 9), luminance=30 + 20 * np.cos(i / 900)
    )
    problem = make_problem(curves, 0.5)
    factors = solve(problem, SolverName.SPLITTING).factors
    assert abs(np.mean(factors) - 0.5) < 1e-9
    assert problem.rate_ratio(factors) <= 1 + 1e-9
    assert problem.objective(factors) < 0.6 * problem.objective(problem.baseline())
    assert len(np.unique(factors)) > 9_000

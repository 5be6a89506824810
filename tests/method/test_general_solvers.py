"""General solvers and starts: the pair sum's rows are exact, others agree, an earlier track helps."""

import dataclasses

import numpy as np
import pytest
from general_solvers import SequentialConvexSolver, by_clarabel, by_highs, comparators, pair_sum_rows
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from evenlight.data_schema.errors import InputError
from evenlight.method.choices import SolverName
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.objective import pairwise_spread, weight_of_pairs
from evenlight.method.optimizer.optimize import is_feasible, optimize
from evenlight.method.optimizer.splitting import (
    BLOCK,
    FAR_TO_NEAR,
    SplittingSolver,
    coarse_problem,
    make_solver,
    refined_solution,
)

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


@pytest.mark.slow
@pytest.mark.parametrize("solver", GENERAL)
def test_a_general_solver_agrees_with_ours_on_convex_curves(make_curves, make_problem, solver) -> None:
    share = 1 / (1 + np.exp(-np.linspace(-5, 5, 14)))
    curves = make_curves(0.2 + 0.5 * share, luminance=60 - 50 * share, frames_per_second=0.5)
    problem = make_problem(curves, 0.5)
    for importance in (None, 0.5 + share / share.mean() / 2):
        weighted = dataclasses.replace(problem, importance=importance)
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
def test_a_coarse_problem_has_the_budget_and_the_weights_of_the_full_one(
    make_curves, make_problem, n
) -> None:
    problem = make_problem(make_curves(np.linspace(0.1, 0.6, n)), 0.5)
    problem = dataclasses.replace(
        problem, importance=np.linspace(0.5, 1.5, n) if n > 1 else None, allowances=np.full(n - 1, 2.0)
    )
    coarse = coarse_problem(problem)
    assert coarse.budget_weights.sum() == pytest.approx(1.0)
    assert coarse.curves.durations.sum() == pytest.approx(problem.curves.durations.sum())
    fine = refined_solution(problem, optimize(coarse, SplittingSolver(stages=FAR_TO_NEAR)))
    assert is_feasible(problem, fine.factors)


@pytest.mark.slow
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

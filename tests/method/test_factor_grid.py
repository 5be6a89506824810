"""Tracks over a grid of factors: the cheapest there are, within the limits, and good to start from."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.optimizer_peers import SAME, best_of
from benchmarks.optimizer_problems import curves_of, mean_factor_problem, odd_problems
from evenlight.method.optimizer.chain import nearest_feasible
from evenlight.method.optimizer.factor_grid import FactorGrid, _improved, distance_from, grid_starts
from evenlight.method.optimizer.optimize import is_feasible, optimize
from evenlight.method.optimizer.splitting import SHORTEST, SplittingSolver

KNOTS = np.linspace(0.2, 1.0, 17)


def rising(n, seed, speed=0.02, budget=0.5):
    """Curves that rise and fall at random, with steps long enough for the rate limit to leave room."""
    rng = np.random.default_rng(seed)
    loss = rng.uniform(0.0, 0.7, (n, len(KNOTS)))
    loss[:, -1] = 0.0
    return mean_factor_problem(curves_of(loss, rng.uniform(1.0, 90.0, n), KNOTS, speed), budget)


def test_the_distance_from_a_track_is_the_mean_over_its_frames_as_printed() -> None:
    problem = rising(12, 1)
    grid, loss = FactorGrid.of(problem), problem.loss(problem.baseline())
    by_hand = np.abs(grid.loss[:, :, None] - loss).mean(axis=2)
    np.testing.assert_allclose(distance_from(problem, grid.loss, loss), by_hand, atol=1e-12)


@pytest.mark.slow
def test_the_starts_keep_all_limits_and_the_best_of_them_leads_further_down_than_slsqp() -> None:
    problem = rising(12, 2)
    starts = grid_starts(problem)
    assert starts
    assert all(is_feasible(problem, start) for start in starts)
    objectives = [problem.objective(start) for start in starts]
    assert objectives == sorted(objectives)
    assert objectives[0] < best_of(problem, 3, 1)  # SLSQP's, in the nearest of many optima


@pytest.mark.slow
@settings(max_examples=4)
@given(st.integers(0, 10**6))
def test_improved_tracks_keep_all_limits_and_none_becomes_worse(seed: int) -> None:
    problem = rising(12, seed)
    grid = FactorGrid.of(problem)
    somewhere = np.random.default_rng(seed).uniform(0.2, 1.0, 12)
    track = nearest_feasible(problem, problem.baseline(), somewhere, 1.0)
    for _ in range(2):  # the second time there is little to gain and all to lose
        better = _improved(grid, track)
        assert is_feasible(problem, better)
        assert problem.objective(better) <= problem.objective(track)
        track = better


def test_the_grid_of_a_band_lies_about_its_track_and_within_the_bounds() -> None:
    problem = rising(12, 4)
    track = np.linspace(0.2, 1.0, 12)
    factors = FactorGrid.about(problem, track, 0.1).cells.factors
    np.testing.assert_allclose(factors[:, 0], np.maximum(track - 0.1, 0.2))
    np.testing.assert_allclose(factors[:, -1], np.minimum(track + 0.1, 1.0))
    assert (np.diff(factors, axis=1) > 0).all()


def test_under_a_limit_too_tight_for_any_cell_there_are_none() -> None:
    assert grid_starts(rising(12, 3, speed=1e9)) == []


def test_a_budget_at_its_end_leaves_nothing_to_start_from() -> None:
    problem = rising(12, 3, budget=0.2)
    for start in grid_starts(problem):
        np.testing.assert_allclose(start, 0.2, atol=12 * 1e-9)  # the tolerance of the budget, in one frame


@pytest.mark.slow
def test_where_the_limit_allows_a_few_cells_per_step_ours_is_no_worse_than_slsqps_best() -> None:
    # Of curves that rise and fall, 62 frames: the four searches alone, and pushes, end 0.03 above.
    problem = odd_problems(np.random.default_rng(12), (SHORTEST + 1, SHORTEST + 5), 1)[0]
    ours = problem.objective(optimize(problem, SplittingSolver()).factors)
    assert ours <= best_of(problem, 3, 1) + SAME * problem.objective(problem.baseline())


def test_the_grid_is_about_four_times_finer_than_a_step_that_the_rate_limit_allows() -> None:
    """Else nothing could move on it. A step reaches ΔL Δt / Ī; the count of cells is rounded to a 16th."""
    n, light, rate = 300, 40.0, 2.0  # frames, [cd/m^2], [Hz]
    loss = np.tile(np.linspace(0.5, 0.0, len(KNOTS)), (n, 1))
    problem = mean_factor_problem(curves_of(loss, np.full(n, light), KNOTS, rate), 0.5)
    step = problem.rate_limit(KNOTS * light).max() / rate / light
    cells = FactorGrid.of(problem).cells.factors[0]
    assert 129 < len(cells) < 1025  # the bounds of the grid do not decide
    assert np.diff(cells).max() == pytest.approx(step / 4, rel=0.1)

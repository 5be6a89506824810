"""Tracks over a grid of factors: the cheapest there are, within the limits, and good to start from."""

import itertools

import numpy as np
import pytest

from analysis.benchmarks.optimizer_peers import SAME, best_of
from analysis.benchmarks.optimizer_problems import curves_of, mean_factor_problem, odd_problems
from method.factor_grid import Grid, _cheapest, _distance, grid_starts
from method.optimize import is_feasible, optimize
from method.splitting import SHORTEST, SplittingSolver

KNOTS = np.linspace(0.2, 1.0, 17)


def rising(n, seed, speed=0.02, budget=0.5):
    """Curves that rise and fall at random, with steps long enough for the rate limit to leave room."""
    rng = np.random.default_rng(seed)
    loss = rng.uniform(0.0, 0.7, (n, len(KNOTS)))
    loss[:, -1] = 0.0
    return mean_factor_problem(curves_of(loss, rng.uniform(1.0, 90.0, n), KNOTS, speed), budget)


def cheapest_by_trying_all(cost, limit, reach, spacing):
    """Every track within the limits of both ends of every step, one by one."""
    n, cells = cost.shape
    found = np.inf
    for track in itertools.product(range(cells), repeat=n):
        steps = [abs(track[i + 1] - track[i]) * spacing for i in range(n - 1)]
        ends = [min(limit[i, track[i]], limit[i + 1, track[i + 1]]) for i in range(n - 1)]
        if all(s <= r * e for s, r, e in zip(steps, reach, ends, strict=True)):
            found = min(found, sum(cost[i, k] for i, k in enumerate(track)))
    return found


@pytest.mark.parametrize("seed", range(6))
def test_no_track_of_the_grid_within_the_limit_is_cheaper(seed) -> None:
    rng = np.random.default_rng(seed)
    cost, limit = rng.random((5, 5)), rng.uniform(0.2, 3.0, (5, 5))
    reach = np.where(rng.random(4) < 0.2, np.inf, rng.uniform(0.1, 1.5, 4))
    track = _cheapest(cost, limit, reach, 0.3)
    ends = np.minimum(limit[range(4), track[:-1]], limit[range(1, 5), track[1:]])
    assert (np.abs(np.diff(track)) * 0.3 <= reach * ends).all()
    assert cost[range(5), track].sum() == pytest.approx(cheapest_by_trying_all(cost, limit, reach, 0.3))


def test_the_distance_from_a_track_is_the_mean_over_its_frames_as_printed() -> None:
    problem = rising(12, 1)
    grid, loss = Grid.of(problem), problem.loss(problem.baseline())
    by_hand = np.abs(grid.loss[:, :, None] - loss).mean(axis=2)
    np.testing.assert_allclose(_distance(grid, loss), by_hand, atol=1e-12)


def test_the_starts_keep_all_limits_and_the_best_is_first() -> None:
    problem = rising(40, 2)
    starts = grid_starts(problem)
    assert starts
    assert all(is_feasible(problem, start) for start in starts)
    objectives = [problem.objective(start) for start in starts]
    assert objectives == sorted(objectives)
    assert objectives[0] < problem.objective(problem.baseline())


def test_under_a_limit_too_tight_for_any_cell_there_are_none() -> None:
    assert grid_starts(rising(12, 3, speed=1e9)) == []


def test_a_budget_at_its_end_leaves_nothing_to_start_from() -> None:
    problem = rising(12, 3, budget=0.2)
    for start in grid_starts(problem):
        np.testing.assert_allclose(start, 0.2, atol=12 * 1e-9)  # the tolerance of the budget, in one frame


def test_above_the_frames_that_slsqp_polishes_often_ours_is_no_worse_than_its_best() -> None:
    problem = odd_problems(np.random.default_rng(7), (SHORTEST + 1, SHORTEST + 5), 1)[0]
    ours = problem.objective(optimize(problem, SplittingSolver()).factors)
    assert ours <= best_of(problem, 6, 1) + SAME * problem.objective(problem.baseline())

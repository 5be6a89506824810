"""The cheapest track through a grid of factors: none of all tracks is cheaper, and none breaks a limit."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from evenlight.method.optimizer.factor_grid import GridCells, bins_within, cheapest_track

FRAMES, CHOICES = 5, 4
FINE = 512  # bins: most sums of the hand-made grids have their own


def made_cells(seed: int) -> GridCells:
    """Cells at uneven factors; the limit changes slowly with the factor, one step is free, one shut."""
    rng = np.random.default_rng(seed)
    factors = np.sort(rng.uniform(0.2, 1.0, (FRAMES, CHOICES)), axis=1)
    share = rng.uniform(0.5, 2.0, FRAMES)
    used = share[:, None] * (factors - factors[:, rng.integers(1, CHOICES - 1)].mean())
    limit = rng.uniform(1.0, 1.5, (FRAMES, 1)) + 0.3 * rng.uniform(-1, 1, (FRAMES, 1)) * factors
    reach = rng.choice([0.1, 0.2, 0.4, 0.8, np.inf], FRAMES - 1)
    return GridCells(factors, used, limit, reach)


def is_within_limits(cells: GridCells, track):
    """Whether each step keeps the rate limit of both of its ends; for one track or for many, (..., N)."""
    frame = np.arange(track.shape[-1])
    steps, limit = np.abs(np.diff(cells.factors[frame, track])), cells.limit[frame, track]
    return (steps <= cells.reach * np.minimum(limit[..., 1:], limit[..., :-1]) + 1e-12).all(axis=-1)


def cost_by_trying_all(cost, cells: GridCells, miss: float) -> float:
    """The least cost of all tracks within the limits that miss the budget by no more than this."""
    frame, tracks = np.arange(FRAMES), np.array(list(itertools.product(range(CHOICES), repeat=FRAMES)))
    missed = np.abs(cells.used[frame, tracks].sum(axis=1))
    kept = is_within_limits(cells, tracks) & (missed <= miss)
    return float(cost[frame, tracks].sum(axis=1)[kept].min(initial=np.inf))


@pytest.mark.slow
@given(st.integers(0, 10**6))
@example(7712)  # even the lowest cells use more than the budget
@example(8141)
@example(16979)
def test_no_track_that_uses_the_budget_is_cheaper(seed: int) -> None:
    cells, frame = made_cells(seed), np.arange(FRAMES)
    cost = np.random.default_rng([seed, 1]).random((FRAMES, CHOICES))
    size = bins_within(cells.used, FINE).size
    track = cheapest_track(cost, cells, FINE)
    if track is None:
        assert cost_by_trying_all(cost, cells, size) == np.inf
        return
    assert is_within_limits(cells, track)
    assert abs(cells.used[frame, track].sum()) <= 3 * size
    # Ways that meet in one bin are held for one, so that a hair beyond the last bins decides nothing.
    assert cost[frame, track].sum() <= cost_by_trying_all(cost, cells, size) + 1e-12
    assert cost[frame, track].sum() >= cost_by_trying_all(cost, cells, 4 * size) - 1e-12


@given(st.integers(0, 10**6))
def test_frames_that_use_no_budget_need_no_bins(seed: int) -> None:
    cells = made_cells(seed)._replace(used=np.zeros((FRAMES, CHOICES)))
    cost = np.random.default_rng([seed, 1]).random((FRAMES, CHOICES))
    track, cheapest = cheapest_track(cost, cells, 1), cost_by_trying_all(cost, cells, 0.0)
    found = np.inf if track is None else cost[np.arange(FRAMES), track].sum()
    assert found == pytest.approx(cheapest)


@given(st.integers(0, 10**6), st.integers(4, 64))
def test_whatever_the_limits_and_the_bins_a_track_keeps_the_limits_and_misses_by_a_few_bins(
    seed: int, bins: int
) -> None:
    rng = np.random.default_rng(seed)
    factors = np.sort(rng.uniform(0.2, 1.0, (12, 9)), axis=1)
    cells = GridCells(
        factors, factors - rng.uniform(0.4, 0.8), rng.uniform(0, 2, (12, 9)), rng.uniform(0, 1, 11) ** 2
    )
    track = cheapest_track(rng.random((12, 9)), cells, bins)
    if track is not None:
        assert is_within_limits(cells, track)
        assert abs(cells.used[np.arange(12), track].sum()) <= 3 * bins_within(cells.used, bins).size


@pytest.mark.parametrize("seed", range(3))
def test_coarse_bins_give_away_some_budget_but_keep_the_cheaper_of_the_ways_that_meet(seed: int) -> None:
    frame, cost = np.arange(12), np.random.default_rng(seed).random((12, 17))
    factors = np.tile(np.linspace(0.2, 1.0, 17), (12, 1))
    cells = GridCells(factors, factors - 0.6, np.ones((12, 17)), np.full(11, 0.2))
    coarse, fine = (cheapest_track(cost, cells, bins) for bins in (8, 2048))
    assert coarse is not None
    assert fine is not None
    assert cost[frame, coarse].sum() <= cost[frame, fine].sum()


def test_a_budget_between_two_tracks_is_used_where_a_price_would_miss_it_by_hand() -> None:
    # Low and high cost nothing, in between 1 each; with a price all four frames go low or all go high, for a
    # step reaches one cell only. The budget is the middle: two low, two high and one step through each cell.
    factors = np.tile([0.2, 0.6, 1.0], (5, 1))
    cost = np.tile([0.0, 1.0, 0.0], (5, 1))
    cells = GridCells(factors, factors - 0.6, np.ones((5, 3)), np.full(4, 0.45))
    track = cheapest_track(cost, cells, 64)
    assert track is not None
    assert track.tolist() in ([0, 0, 1, 2, 2], [2, 2, 1, 0, 0])


def test_frames_without_a_share_in_the_budget_go_where_they_cost_least() -> None:
    factors = np.tile([0.2, 0.5, 0.8], (3, 1))
    used = (factors - 0.5) * np.array([1.0, 0.0, 1.0])[:, None]
    cost = np.array([[1.0, 0.0, 1.0], [0.0, 2.0, 3.0], [1.0, 0.0, 1.0]])
    track = cheapest_track(cost, GridCells(factors, used, np.zeros((3, 3)), np.full(2, np.inf)), 16)
    assert track is not None
    assert track.tolist() == [1, 0, 1]


def test_where_no_step_is_long_enough_there_is_no_track() -> None:
    factors = np.array([[0.2, 0.3], [0.8, 0.9]])
    cells = GridCells(factors, factors - 0.55, np.ones((2, 2)), np.array([0.1]))
    assert cheapest_track(np.zeros((2, 2)), cells, 16) is None


@pytest.mark.parametrize("budget", [0.19, 1.01])
def test_a_budget_beyond_all_cells_has_no_track(budget: float) -> None:
    factors = np.tile(np.linspace(0.2, 1.0, 5), (6, 1))
    cells = GridCells(factors, factors - budget, np.ones((6, 5)), np.ones(5))
    assert cheapest_track(np.zeros((6, 5)), cells, 32) is None


@pytest.mark.parametrize("budget", [0.2, 1.0])
def test_a_budget_at_its_end_leaves_one_track(budget: float) -> None:
    factors = np.tile(np.linspace(0.2, 1.0, 5), (6, 1))
    cost = np.random.default_rng(1).random((6, 5))
    track = cheapest_track(cost, GridCells(factors, factors - budget, np.ones((6, 5)), np.ones(5)), 32)
    assert track is not None
    np.testing.assert_array_equal(factors[0, track], budget)

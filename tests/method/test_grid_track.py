"""Tracks over a grid of factors and chains of cells: none of all is cheaper, none breaks a limit."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, minimize

from benchmarks.optimizer_peers import SAME, best_of
from benchmarks.optimizer_problems import curves_of, mean_factor_problem, odd_problems
from evenlight.data_schema.arrays import Array
from evenlight.method.optimizer.cell_chain import (
    ChainCosts,
    FrameBlocks,
    RateTable,
    cheapest_chain,
    make_blocks,
)
from evenlight.method.optimizer.chain import ChainLimits, minimize_chain, nearest_feasible
from evenlight.method.optimizer.factor_grid import (
    FactorGrid,
    GridCells,
    _improved,
    bins_within,
    cheapest_track,
    distance_from,
    grid_starts,
)
from evenlight.method.optimizer.optimize import is_feasible, optimize
from evenlight.method.optimizer.splitting import SHORTEST, SplittingSolver

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


# --- factor grid

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


# --- cell chain

KNOTS_OF_CELL_CHAIN = np.linspace(0.2, 1.0, 5)

STEPS = 160  # of a fine grid of factors


def cheapest_on_a_grid(costs: ChainCosts, places: int) -> float:
    """The least cost of all chains on a grid that move some places per frame at most: all are allowed."""
    grid = np.linspace(0.2, 1.0, STEPS + 1)
    value = np.zeros(STEPS + 1)
    for loss, weight, share in zip(costs.loss, costs.weights, costs.share, strict=True):
        padded = np.pad(value, places, constant_values=np.inf)
        value = np.lib.stride_tricks.sliding_window_view(padded, 2 * places + 1).min(axis=1)
        value = value + weight * np.interp(grid, KNOTS_OF_CELL_CHAIN, loss) + costs.price * share * grid
    return float(value.min())


def made(seed: int, n: int) -> ChainCosts:
    rng = np.random.default_rng(seed)
    loss = np.sort(rng.uniform(0, 1, (n, len(KNOTS_OF_CELL_CHAIN))), axis=1)[:, ::-1].copy()
    return ChainCosts(
        loss, rng.normal(0, 1, n), np.full(n, 1 / n), float(rng.normal(0, 3)), KNOTS_OF_CELL_CHAIN
    )


def bound(costs: ChainCosts, places: int, block_moves: float, per_knot: int) -> tuple[float, float]:
    n = len(costs.weights)
    step = places * 0.8 / STEPS
    rates = RateTable(
        np.ones(1), np.zeros(n), np.zeros(len(KNOTS_OF_CELL_CHAIN) - 1)
    )  # a rate limit of 1 everywhere
    blocks = FrameBlocks(*make_blocks(np.full(n - 1, step), block_moves * step, 0.2))
    return cheapest_chain(costs, rates, np.full(n - 1, step), blocks, per_knot)


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.integers(2, 24), st.sampled_from([0, 1, 3, 7, 20]), st.integers(1, 40))
def test_no_chain_costs_less_whatever_the_blocks_and_cells(seed, n, moves, per_knot) -> None:
    costs = made(seed, n)
    assert bound(costs, 4, moves + 0.5, per_knot)[0] <= cheapest_on_a_grid(costs, 4) + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_with_a_block_for_each_frame_and_fine_cells_it_is_nearly_reached(seed) -> None:
    costs = made(seed, 12)
    least, scale = cheapest_on_a_grid(costs, 4), float(np.abs(costs.weights).sum())
    assert least - bound(costs, 4, 0.5, 2000)[0] < 0.01 * scale


def test_frames_about_an_anchor_save_only_where_they_can_be() -> None:
    # The middle frame is cheapest at the lowest factor. The others are within 0.02 of it: in the first
    # segment, or as blocks are counted the second, and there they cost the same everywhere.
    loss = np.array([[1.0, 1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 0.0, 0.0]])
    costs = ChainCosts(loss, np.array([-1.0, -10.0, -1.0]), np.full(3, 1 / 3), 0.0, KNOTS_OF_CELL_CHAIN)
    assert bound(costs, 4, 2.5, 10)[0] == pytest.approx(-12.0, abs=1e-12)


def test_the_budget_used_is_the_slope_of_the_cost_over_the_price() -> None:
    costs = made(3, 12)
    nudged = costs._replace(price=costs.price + 1e-6)
    least, used = bound(costs, 4, 0.5, 50)
    assert (bound(nudged, 4, 0.5, 50)[0] - least) / 1e-6 == pytest.approx(used, abs=1e-4)


def test_blocks_hold_every_frame_once_and_end_where_the_factor_may_move_too_far() -> None:
    start, anchor, spread = make_blocks(np.array([0.1, 0.1, 5.0, 0.1]), 0.25, 0.2)
    assert start.tolist() == [0, 3, 5]
    assert anchor.tolist() == [1, 3]
    assert spread.tolist() == [26, 1]  # 0.1 + 5 from frame 1 to frame 3, in segments of 0.2


# --- chain


def random_chain(seed: int, n: int) -> tuple[Array, Array, ChainLimits]:
    """A chain on which every constant is feasible: slopes about 1, offsets outwards, a common box."""
    rng = np.random.default_rng(seed)
    curvature = rng.uniform(0.1, 3, n)
    gradient = -curvature * rng.uniform(-0.3, 1.3, n)
    limits = ChainLimits(
        down_slope=1 / (1 + rng.uniform(0, 0.1, n - 1)),
        down_offset=-rng.uniform(0, 0.05, n - 1),
        up_slope=1 + rng.uniform(0, 0.1, n - 1),
        up_offset=rng.uniform(0, 0.05, n - 1),
        low=rng.uniform(0.1, 0.3, n),
        high=rng.uniform(0.5, 1.0, n),
    )
    return curvature, gradient, limits


def as_constraints(limits: ChainLimits, n: int) -> list[LinearConstraint]:
    """The limits on steps as A x <= c, row by row."""
    rows, bounds = [], []
    for i in range(n - 1):
        up = np.zeros(n)
        up[i], up[i + 1] = -limits.up_slope[i], 1
        down = np.zeros(n)
        down[i], down[i + 1] = limits.down_slope[i], -1
        rows += [up, down]
        bounds += [limits.up_offset[i], -limits.down_offset[i]]
    return [LinearConstraint(np.array(rows), -np.inf, np.array(bounds))] if rows else []


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 10))
def test_no_worse_than_a_general_solver_and_within_the_limits(seed: int, n: int) -> None:
    curvature, gradient, limits = random_chain(seed, n)

    def cost(x: Array) -> float:
        return float(np.sum(curvature / 2 * x**2 + gradient * x))

    x = minimize_chain(curvature, gradient, limits)
    assert (x >= limits.low - 1e-12).all()
    assert (x <= limits.high + 1e-12).all()
    assert (x[1:] <= limits.up_slope * x[:-1] + limits.up_offset + 1e-12).all()
    assert (x[1:] >= limits.down_slope * x[:-1] + limits.down_offset - 1e-12).all()
    reference = minimize(
        cost,
        np.clip(np.full(n, 0.4), limits.low, limits.high),
        jac=lambda x: curvature * x + gradient,
        method="SLSQP",
        bounds=list(zip(limits.low, limits.high, strict=True)),
        constraints=as_constraints(limits, n),
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert cost(x) <= reference.fun + 1e-9


def test_two_values_pulled_apart_share_the_gap_by_hand() -> None:
    # (x - 0)² + (y - 1)² with |y - x| <= 0.2: by symmetry about 1/2, x = 0.4 and y = 0.6.
    limits = ChainLimits(np.ones(1), np.array([-0.2]), np.ones(1), np.array([0.2]), np.zeros(2), np.ones(2))
    x = minimize_chain(np.full(2, 2.0), np.array([0.0, -2.0]), limits)
    np.testing.assert_allclose(x, [0.4, 0.6], atol=1e-12)


def test_optimality_over_a_hundred_thousand_values() -> None:
    n = 100_000
    target = 0.5 + 0.3 * np.sin(np.arange(n) / 800)
    relative = 0.0005
    limits = ChainLimits(
        np.full(n - 1, 1 / (1 + relative)),
        np.zeros(n - 1),
        np.full(n - 1, 1 + relative),
        np.zeros(n - 1),
        np.full(n, 0.2),
        np.ones(n),
    )
    x = minimize_chain(np.ones(n), -target, limits)
    ratio = np.abs(np.diff(np.log(x))) / np.log1p(relative)
    assert ratio.max() <= 1 + 1e-9
    # Scaling a stretch as a whole, x -> (1 + e) x, keeps every ratio limit, so its
    # derivative Σ (x - t) x is 0.
    # Stretches end where a step is within its limit.
    ends = np.flatnonzero(ratio < 1 - 1e-6)
    stretch = np.add.reduceat((x - target) * x, np.concatenate([[0], ends + 1]))
    np.testing.assert_allclose(stretch, 0, atol=1e-9)

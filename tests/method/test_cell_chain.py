"""The cheapest chain of cells costs no more than any chain of factors, and little less than the cheapest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.method.optimizer.cell_chain import (
    ChainCosts,
    FrameBlocks,
    RateTable,
    cheapest_chain,
    make_blocks,
)

KNOTS = np.linspace(0.2, 1.0, 5)
STEPS = 160  # of a fine grid of factors


def cheapest_on_a_grid(costs: ChainCosts, places: int) -> float:
    """The least cost of all chains on a grid that move some places per frame at most: all are allowed."""
    grid = np.linspace(0.2, 1.0, STEPS + 1)
    value = np.zeros(STEPS + 1)
    for loss, weight, share in zip(costs.loss, costs.weights, costs.share, strict=True):
        padded = np.pad(value, places, constant_values=np.inf)
        value = np.lib.stride_tricks.sliding_window_view(padded, 2 * places + 1).min(axis=1)
        value = value + weight * np.interp(grid, KNOTS, loss) + costs.price * share * grid
    return float(value.min())


def made(seed: int, n: int) -> ChainCosts:
    rng = np.random.default_rng(seed)
    loss = np.sort(rng.uniform(0, 1, (n, len(KNOTS))), axis=1)[:, ::-1].copy()
    return ChainCosts(loss, rng.normal(0, 1, n), np.full(n, 1 / n), float(rng.normal(0, 3)), KNOTS)


def bound(costs: ChainCosts, places: int, block_moves: float, per_knot: int) -> tuple[float, float]:
    n = len(costs.weights)
    step = places * 0.8 / STEPS
    rates = RateTable(np.ones(1), np.zeros(n), np.zeros(len(KNOTS) - 1))  # a rate limit of 1 everywhere
    blocks = FrameBlocks(*make_blocks(np.full(n - 1, step), block_moves * step, 0.2))
    return cheapest_chain(costs, rates, np.full(n - 1, step), blocks, per_knot)


@pytest.mark.slow
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

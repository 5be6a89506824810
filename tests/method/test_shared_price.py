"""How a budget for many videos is shared out: by hand, as printed, and beside one optimization of all."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.optimizer.objective import pairwise_spread
from evenlight.method.optimizer.optimize import joined_curves, joints, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.shared_price import (
    QUANTILES,
    BudgetTable,
    _costs,
    _difference,
    loss_quantiles,
    shared_budgets,
)
from evenlight.method.optimizer.splitting import FAR_TO_NEAR, SplittingSolver
from evenlight.method.preset_files import load_power_model


def even(losses, weight=1.0, frames=1.0, budgets=(0.2, 0.6, 1.0)) -> BudgetTable:
    """A video all of whose frames lose the same at each of some budgets."""
    return BudgetTable(np.array(budgets), np.repeat(np.array(losses)[:, None], QUANTILES, 1), weight, frames)


def test_two_videos_that_can_lose_alike_do():
    """One loses 0.2 · (1 - b), the other 0.1 · (1 - b): alike at a mean of 0.5 where 2(1 - b) = 1 - c."""
    tables = [even((0.16, 0.08, 0.0)), even((0.08, 0.04, 0.0))]
    b, c = shared_budgets(tables, 0.5)
    assert b + c == pytest.approx(1.0, abs=1e-9)
    assert 0.2 * (1 - b) == pytest.approx(0.1 * (1 - c), abs=0.003)  # to the steps of the price
    assert b > c


@given(st.lists(st.floats(0.5, 100), min_size=2, max_size=6), st.floats(0.21, 0.99), st.data())
@settings(max_examples=60)
def test_all_together_have_the_budget_and_differ_no_more_than_with_equal_ones(weights, budget, data):
    falling = arrays(float, 3, elements=st.floats(0, 0.3)).map(lambda a: np.sort(a)[::-1])
    tables = [even(data.draw(falling), weight, frames=weight) for weight in weights]
    found = shared_budgets(tables, budget)
    assert np.dot(weights, found) / np.sum(weights) == pytest.approx(budget, abs=1e-9)
    assert found.min() >= 0.2 - 1e-12
    assert found.max() <= 1 + 1e-12
    equal = np.full(len(weights), budget)
    assert _difference(tables, found) <= _difference(tables, equal) + 1e-12


@given(arrays(float, (3, 2), elements=st.floats(0, 0.5)), arrays(float, 3, elements=st.floats(0.5, 9)))
def test_cost_and_difference_are_those_of_the_double_sum(losses, frames):
    """E|l - X| and E|X - Y|, as they stand in the docstring, over all pairs of videos."""
    tables = [even(np.sort(a)[::-1], 1.0, n, (0.2, 1.0)) for a, n in zip(losses, frames, strict=True)]
    chosen = np.array([0.2, 1.0, 0.2])
    at = np.array([tables[0].losses[0, 0], tables[1].losses[1, 0], tables[2].losses[0, 0]])
    shares = frames / frames.sum()
    double_sum = sum(p * q * abs(x - y) for p, x in zip(shares, at, strict=True)
                     for q, y in zip(shares, at, strict=True))  # fmt: skip
    assert _difference(tables, chosen) == pytest.approx(double_sum, abs=1e-12)
    costs = _costs(tables, [table.budgets for table in tables], chosen)
    for v, table in enumerate(tables):
        for k in range(2):
            mean = sum(q * abs(table.losses[k, 0] - y) for q, y in zip(shares, at, strict=True))
            assert costs[v][k] == pytest.approx(frames[v] * mean, abs=1e-12)


def test_quantiles_count_frames_by_their_weights():
    found = loss_quantiles(np.array([0.3, 0.1]), np.array([0.5, 1.5]))
    assert np.unique(found, return_counts=True)[1].tolist() == [QUANTILES * 3 // 4, QUANTILES // 4]


def test_a_budget_that_all_together_cannot_have_is_refused():
    with pytest.raises(InputError, match=r"shared budget 0\.1 cannot be met.*0\.2 to 1"):
        shared_budgets([even((0.1, 0.05, 0.0))], 0.1)


def test_the_price_comes_near_one_optimization_of_all_frames(make_curves, make_weber_limit):
    """Five made videos of unlike losses, a generous limit: within 5 % of the joint optimum of spread."""
    rng = np.random.default_rng(3)
    curves = [
        make_curves(strength * (1 + 0.3 * rng.random(40)), exponent)
        for strength, exponent in ((0.05, 1.0), (0.1, 1.5), (0.2, 1.0), (0.3, 2.0), (0.15, 1.2))
    ]
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), make_weber_limit(0.5))
    solver = SplittingSolver(stages=FAR_TO_NEAR)  # one search: of all frames it is as good to 0.1 %
    whole = pose(joined_curves(curves), request, joints(curves))
    joint = whole.objective(optimize(whole, solver).factors)
    factors = np.geomspace(0.2, 1.0, 9)
    tables = []
    for one in curves:
        problem = pose(one, request)
        at = [replace(problem, baseline_factor=float(f)) for f in factors]
        losses = [loss_quantiles(p.loss(optimize(p, solver).factors)) for p in at]
        tables.append(BudgetTable(factors, np.array(losses), float(one.durations.sum()), one.n_frames))
    losses, equal = [], []
    for one, budget in zip(curves, shared_budgets(tables, 0.5), strict=True):
        for some, own in ((losses, float(budget)), (equal, 0.5)):
            problem = pose(one, replace(request, budget=own))
            some.append(problem.loss(optimize(problem, solver).factors))
    shared = pairwise_spread(np.concatenate(losses))
    assert joint * (1 - 1e-6) <= shared <= 1.05 * joint
    assert shared < 0.7 * pairwise_spread(np.concatenate(equal))

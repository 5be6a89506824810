"""What is minimized: spread and level; definitions, proximal steps, certificates, all tracks of a grid."""

import dataclasses
import itertools

import numpy as np
import pytest
from exhaustive_search import _tracks, from_all_tracks
from general_solvers import SequentialConvexSolver, by_highs
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.optimizer_problems import curves_of, mean_factor_problem
from evenlight.data_schema.errors import InputError
from evenlight.method.choices import ObjectiveName
from evenlight.method.optimizer.calm import calmed
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.objective import (
    LEAST_WEIGHT,
    SPREAD,
    LargestLoss,
    Objective,
    Spread,
    objective_named,
    pairwise_spread,
    proximal_spread,
)
from evenlight.method.optimizer.optimize import Problem, feasible_blend, is_feasible, optimize
from evenlight.method.optimizer.splitting import FAR_TO_NEAR, NEAR, SplittingSolver

losses = arrays(np.float64, st.integers(2, 30), elements=st.floats(0, 1))


def spread_as_printed(loss: np.ndarray) -> float:
    """Eq. 6, transcribed: the double sum over i < j, over its number of pairs."""
    n = len(loss)
    return sum(abs(loss[i] - loss[j]) for i in range(n) for j in range(i + 1, n)) / (n * (n - 1) / 2)


@given(losses)
def test_matches_equation_as_printed(loss: np.ndarray) -> None:
    assert pairwise_spread(loss) == pytest.approx(spread_as_printed(loss), abs=1e-12)


@given(losses, st.floats(-5, 5))
def test_a_common_level_of_loss_costs_nothing(loss: np.ndarray, level: float) -> None:
    assert pairwise_spread(loss + level) == pytest.approx(pairwise_spread(loss), abs=1e-12)


def test_equal_losses_have_no_spread_at_all() -> None:
    assert pairwise_spread(np.full(999, 0.1)) == 0.0


def test_a_single_frame_has_no_pairs() -> None:
    assert pairwise_spread([0.3]) == 0.0


@given(losses, st.floats(1e-3, 1.0), st.integers(0, 1000))
def test_no_nudge_improves_the_proximal_point(values: np.ndarray, strength: float, seed: int) -> None:
    def cost(v: np.ndarray) -> float:
        n = len(v)
        return strength * spread_as_printed(v) * n * (n - 1) / 2 + float(np.sum((v - values) ** 2)) / 2

    best = proximal_spread(values, strength)
    rng = np.random.default_rng(seed)
    for scale in (1e-3, 1e-1):
        assert cost(best) <= cost(best + scale * rng.standard_normal(len(values))) + 1e-9


# --- objectives with a level

OBJECTIVES: list[Objective] = [SPREAD, Spread(0.5), Spread(5.0), LargestLoss()]

KNOTS = np.linspace(0.2, 1.0, 17)


def falling(n, seed, speed=0.5, minimized: Objective = SPREAD, budget=0.5):
    """Made loss curves that fall with the factor, convex, under the published rate limit."""
    rng = np.random.default_rng(seed)
    loss = rng.uniform(0.1, 0.8, (n, 1)) * ((1 - KNOTS) / 0.8) ** rng.uniform(1.0, 1.8, (n, 1))
    problem = mean_factor_problem(curves_of(loss, rng.uniform(5.0, 90.0, n), KNOTS, speed), budget)
    return dataclasses.replace(problem, minimized=minimized)


def as_printed(objective: Objective, loss, weights):
    """Each objective by its definition, slowly."""
    counting = [k for k in range(len(loss)) if weights[k] > 0]
    if isinstance(objective, LargestLoss):
        return max(loss[k] for k in counting)
    pairs = list(itertools.combinations(counting, 2))
    total = sum(weights[i] * weights[j] for i, j in pairs)
    spread = sum(weights[i] * weights[j] * abs(loss[i] - loss[j]) for i, j in pairs) / total if pairs else 0.0
    mean = sum(weights[k] * loss[k] for k in counting) / sum(weights)
    return spread + (objective.level_weight or 0.0) * mean


def drawn(seed, n):
    """Losses and weights, some of them 0 and one at least not."""
    rng = np.random.default_rng(seed)
    weights = rng.uniform(0.2, 2.0, n) * (rng.random(n) < 0.8)
    weights[0] = 1.0
    return rng.uniform(0, 1, n), weights


@given(st.integers(0, 10**6), st.integers(1, 7))
@settings(max_examples=30)
def test_the_objectives_match_their_definitions_one_by_one_and_by_rows(seed, n) -> None:
    loss, weights = drawn(seed, n)
    for objective in OBJECTIVES:
        expected = as_printed(objective, loss, weights)
        assert objective.value(loss, weights) == pytest.approx(expected, abs=1e-12)
        # The largest sum over the set of weights is the objective; no weight is beyond the largest.
        w = objective.frame_weights(loss, weights)
        assert w @ loss == pytest.approx(objective.size(weights) * expected, abs=1e-9)
        assert (np.abs(w) <= objective.largest_weights(weights) + 1e-9).all()


@given(st.integers(0, 10**6), st.integers(1, 6), st.floats(0.0, 0.5))
@settings(max_examples=5)
def test_no_step_from_a_proximal_point_is_better(seed, n, strength) -> None:
    values, weights = drawn(seed, n)
    rng = np.random.default_rng(seed)
    for objective in OBJECTIVES:
        scale = strength * objective.size(weights)

        def cost(v, objective=objective, scale=scale):
            return scale * objective.value(v, weights) + weights @ (v - values) ** 2 / 2

        found = objective.proximal(values, strength, weights)
        for size in (1e-3, 1e-1):
            steps = size * rng.standard_normal((20, n))
            assert min(cost(found + step) for step in steps) >= cost(found) - 1e-8


@given(st.integers(0, 10**6), st.integers(1, 7))
@example(1663, 5)
@settings(max_examples=10)
def test_what_a_proximal_step_takes_away_is_below_the_objective_for_all_losses(seed, n) -> None:
    """So it is a valid w for the certificate (Moreau).

    A frame that counts for nothing weighs LEAST_WEIGHT in a step: it moves ranks, at most Σω, and means,
    at most 5.
    """
    values, weights = drawn(seed, n)
    rng = np.random.default_rng(seed)
    slack = n * LEAST_WEIGHT * (5 + 2 * weights.sum())
    for objective in OBJECTIVES:
        w = weights * (5 * values - objective.proximal(5 * values, 1.0, weights))
        for other in rng.uniform(0, 1, (20, n)):
            assert w @ other <= objective.size(weights) * objective.value(other, weights) + slack


@pytest.fixture
def coarse_bound(monkeypatch):
    """Fewer cells: a bound that is quicker, and valid too."""
    monkeypatch.setattr("evenlight.method.optimizer.lower_bound.LEAST_VISITS", 20_000)


@pytest.mark.parametrize(
    ("weighted", "n", "objective"),
    [
        (False, 5, OBJECTIVES[1]),
        (False, 4, OBJECTIVES[3]),
        (True, 5, OBJECTIVES[3]),
        (True, 4, OBJECTIVES[2]),
    ],
)
def test_the_solvers_agree_and_every_certificate_holds(coarse_bound, weighted, n, objective) -> None:
    problem = falling(n, n, minimized=objective)
    if weighted:
        _, weights = drawn(n, n)
        problem = dataclasses.replace(problem, importance=weights / weights.mean())
    answers = [optimize(problem, solver) for solver in (SplittingSolver(), SequentialConvexSolver(by_highs))]
    ours, linear = (problem.objective(answer.factors) for answer in answers)
    assert ours <= linear + 1e-6
    assert linear <= ours + 1e-3 * problem.objective(problem.baseline())
    assert all(0 <= lower_bound(problem, answer) <= ours + 1e-12 for answer in answers)


def better_tracks(problem: Problem, than: float, cells: int) -> list[np.ndarray]:
    """Return all tracks over a grid, the last frame by the budget, that keep the limits and are better."""
    grid, n = np.linspace(0.2, 1.0, cells), problem.curves.n_frames
    chosen = np.stack(np.meshgrid(*[grid] * (n - 1)), axis=-1).reshape(-1, n - 1)
    tracks = np.column_stack([chosen, n * problem.baseline_factor - chosen.sum(axis=1)])
    tracks = tracks[(tracks[:, -1] >= 0.2) & (tracks[:, -1] <= 1)]
    knots = problem.curves.factors
    losses = [np.interp(b, knots, loss) for b, loss in zip(tracks.T, problem.curves.loss, strict=True)]
    values = np.array([problem.value(loss) for loss in np.stack(losses, axis=1)])
    return [track for track in tracks[values < than] if problem.rate_ratio(track) <= 1]


@pytest.mark.parametrize("objective", [OBJECTIVES[1], OBJECTIVES[3]])
def test_no_track_of_three_frames_is_better(objective) -> None:
    problem = falling(3, 5, minimized=objective)
    ours = problem.objective(optimize(problem, SplittingSolver()).factors)
    assert not better_tracks(problem, ours - 1e-9, 161)
    assert better_tracks(problem, ours + 0.01, 161)  # which looks about where the answer is


def test_certificates_of_random_short_problems_lie_below_all_that_is_tried(coarse_bound) -> None:
    rng = np.random.default_rng(8)
    for seed in range(12):
        n, objective = int(rng.integers(2, 7)), OBJECTIVES[seed % 4]
        problem = falling(n, seed, speed=float(rng.choice([0.05, 1.0])), minimized=objective)
        bound = lower_bound(problem, optimize(problem, SplittingSolver(stages=NEAR)))
        for _ in range(5):
            nudge = rng.uniform(-0.3, 0.3, n)
            track = feasible_blend(problem, problem.baseline() + (nudge - nudge.mean()) * 0.9)
            assert not is_feasible(problem, track) or bound <= problem.objective(track) + 1e-12


def test_two_frames_get_the_light_that_each_objective_asks_for_by_hand() -> None:
    # Two free frames, of losses 0.2 (1-b) / 0.8 and 0.6 (1-b) / 0.8: they are equal at factors of 0.25 and
    # 0.75, where the largest is least, too; the mean alone gives all of the light to the second.
    loss = np.outer([0.2, 0.6], (1 - KNOTS) / 0.8)
    free = mean_factor_problem(curves_of(loss, np.full(2, 50.0), KNOTS, 0.001), 0.5)
    for objective, expected in (
        (SPREAD, [0.25, 0.75]), (LargestLoss(), [0.25, 0.75]), (Spread(100.0), [0.2, 0.8]),
    ):  # fmt: skip
        problem = dataclasses.replace(free, minimized=objective)
        np.testing.assert_allclose(optimize(problem, SplittingSolver()).factors, expected, atol=1e-4)


def test_a_calm_track_keeps_its_share_of_what_is_minimized() -> None:
    problem = falling(40, 3, speed=2.0, minimized=LargestLoss())
    best = optimize(problem, SplittingSolver(stages=FAR_TO_NEAR)).factors
    calm = calmed(problem, best, 0.2)
    base = problem.objective(problem.baseline())
    assert problem.objective(calm) <= problem.objective(best) + 0.2 * (base - problem.objective(best)) + 1e-12


@pytest.mark.parametrize(
    ("name", "level_weight", "says"),
    [
        (ObjectiveName.SPREAD_AND_MEAN, None, "needs `level_weight` above 0"),
        (ObjectiveName.SPREAD_AND_MEAN, 0.0, "must lie above 0 and up to 1e\\+06, got 0"),
        (ObjectiveName.SPREAD_AND_MEAN, float("nan"), "must lie above 0.*got nan"),
        (ObjectiveName.MINIMAX, 0.5, "0.5 is for the objective spread\\+mean, not for minimax"),
    ],
)
def test_a_level_weight_that_is_missing_or_has_no_place_is_refused(name, level_weight, says) -> None:
    with pytest.raises(InputError, match=says):
        objective_named(name, level_weight)


def frozen(problem: Problem) -> Problem:
    """The same under a rate limit of 0 everywhere."""
    return dataclasses.replace(problem, rate_limit=np.zeros_like)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize(
    "hold",
    [
        frozen,
        lambda p: dataclasses.replace(p, allowances=np.zeros(len(p.luminance) - 1)),
        lambda p: dataclasses.replace(p, baseline_factor=p.lowest_factor + 1e-13),
        lambda p: dataclasses.replace(p, baseline_factor=1 - 1e-13),
    ],
    ids=["limit 0", "allowances 0", "lowest budget", "highest budget"],
)
def test_where_only_constant_dimming_is_possible_the_bound_equals_it(objective, hold) -> None:
    problem = hold(falling(9, 4, minimized=objective))
    answer = optimize(problem, SplittingSolver())
    value = problem.objective(problem.baseline())
    assert lower_bound(problem, answer) == pytest.approx(value, rel=1e-6, abs=1e-6)
    assert problem.objective(answer.factors) == pytest.approx(value, rel=1e-6, abs=1e-6)


def rising_and_falling(n: int, seed: int, speed: float) -> Problem:
    """Random loss curves, and a random budget."""
    rng, knots = np.random.default_rng(seed), np.linspace(0.2, 1.0, 17)
    loss = rng.uniform(0, 0.7, (n, 17))
    loss[:, -1] = 0.0
    return mean_factor_problem(curves_of(loss, rng.uniform(1, 90, n), knots, speed), rng.uniform(0.3, 0.9))


def test_no_track_of_a_dense_grid_is_better_where_losses_rise_and_fall() -> None:
    problem = rising_and_falling(3, 22, 0.1)
    ours = problem.objective(optimize(problem, SplittingSolver()).factors)
    assert not better_tracks(problem, ours - 1e-9, 161)
    assert better_tracks(problem, ours + 0.01, 161)


@pytest.mark.parametrize(("n", "seed"), [(2, 1), (3, 22), (5, 2), (7, 19)])
def test_looking_at_all_tracks_finds_little_that_is_better(n, seed) -> None:
    """Where losses rise and fall there are local optima; of seven frames, all tracks have one 1 % lower."""
    problem = rising_and_falling(n, seed, 0.5)
    answer = optimize(problem, SplittingSolver())
    ours, least = problem.objective(answer.factors), from_all_tracks(problem, answer)
    assert ours <= least + 0.02 * problem.objective(problem.baseline())
    assert ours == pytest.approx(least, abs=1e-6) or n == 7


@pytest.mark.parametrize(("seed", "n"), [(1, 2), (2, 3), (3, 4)])
def test_the_tracks_looked_at_are_all_those_of_the_grid_within_the_limits(seed, n) -> None:
    problem = rising_and_falling(n, seed, 0.2)
    cells = np.linspace(np.full(n, 0.2), np.ones(n), 9, axis=1)
    found = _tracks(problem, cells, 10**6)
    assert found is not None
    expected = [
        track
        for track in itertools.product(range(9), repeat=n)
        if abs(problem.budget_error(cells[0][list(track)])) <= 0.05 + 1e-12
        and problem.rate_ratio(cells[0][list(track)]) <= 1
    ]
    assert {*map(tuple, found.tolist())} == {*expected}

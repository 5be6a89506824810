"""What is minimized: spread, level and the worst measure; definitions, proximal steps, certificates."""

import dataclasses
import itertools
from typing import get_type_hints

import numpy as np
import pytest
from exhaustive_search import _tracks, from_all_tracks
from general_solvers import SequentialConvexSolver, by_highs
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.text import Text

import evenlight
from benchmarks.optimizer_problems import curves_of, mean_factor_problem
from evenlight.analysis.tracks.dimming_options import DimmedOn
from evenlight.analysis.tracks.track_words import outcome_in_words
from evenlight.data_schema.errors import InputError
from evenlight.method.choices import ObjectiveName
from evenlight.method.contrast.measures import measures_named
from evenlight.method.optimizer.calm import calmed, taut_string
from evenlight.method.optimizer.evaluate import reversals
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.objective import (
    SPREAD,
    LargestLoss,
    Objective,
    Spread,
    objective_named,
    pairwise_spread,
    proximal_spread,
)
from evenlight.method.optimizer.optimize import Problem, feasible_blend, is_feasible, optimize
from evenlight.method.optimizer.robust import Measures, optimize_robustly
from evenlight.method.optimizer.splitting import FAR_TO_NEAR, NEAR, SplittingSolver
from evenlight.method.preset_files import PRESETS

losses = arrays(np.float64, st.integers(2, 30), elements=st.floats(0, 1))


def spread_as_printed(loss: np.ndarray) -> float:
    """Eq. 6, transcribed: the double sum over i < j, over its number of pairs."""
    n = len(loss)
    return sum(abs(loss[i] - loss[j]) for i in range(n) for j in range(i + 1, n)) / (n * (n - 1) / 2)


@given(losses)
def test_matches_equation_as_printed(loss: np.ndarray) -> None:
    assert pairwise_spread(loss) == pytest.approx(spread_as_printed(loss), abs=1e-12)


@pytest.mark.slow
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
@settings(max_examples=10)
def test_what_a_proximal_step_takes_away_is_below_the_objective_for_all_losses(seed, n) -> None:
    """So it is a valid w for the certificate (Moreau)."""
    values, weights = drawn(seed, n)
    rng = np.random.default_rng(seed)
    for objective in OBJECTIVES:
        w = weights * (5 * values - objective.proximal(5 * values, 1.0, weights))
        for other in rng.uniform(0, 1, (20, n)):
            assert w @ other <= objective.size(weights) * objective.value(other, weights) + 1e-9


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


# --- robust

FAST = SplittingSolver(stages=FAR_TO_NEAR)

N = 24


@pytest.fixture(scope="module")
def measures(make_curves, make_problem):
    """A function that makes the problem of one clip for some strengths of loss, a row for each measure."""

    def made(strengths):
        curves = [make_curves(row, frames_per_second=0.5) for row in np.atleast_2d(strengths)]
        return Measures(tuple(make_problem(own, 0.5) for own in curves))

    return made


def test_measures_that_contradict_each_other_leave_constant_dimming(measures) -> None:
    # What the one measure loses in a frame, the other loses in its mirror image: every track and its mirror
    # image have mirrored shares, and a blend of the two, constant dimming for mirrored frames, is no worse.
    strengths = np.where(np.arange(N) % 2, 0.2, 0.5)
    both = measures([strengths, strengths[::-1]])
    found, bound, _ = optimize_robustly(both, FAST)
    assert both.worst(found.factors) == pytest.approx(1.0, abs=0.01)
    assert bound > 0.95
    alone = [FAST.solve(problem).factors for problem in both.problems]
    assert both.shares(alone[0])[0] < 0.95
    assert both.worst(alone[0]) > 1.05


def test_one_measure_twice_is_that_measure(measures) -> None:
    strengths = np.linspace(0.2, 0.6, N)
    twice = measures([strengths, strengths])
    found, *_ = optimize_robustly(twice, FAST)
    alone = twice.problems[0].objective(FAST.solve(twice.problems[0]).factors)
    assert twice.worst(found.factors) <= alone / twice.baselines()[0] + 1e-9


def test_the_worst_is_no_worse_than_by_any_measure_alone_and_none_goes_below_the_bound(measures) -> None:
    rng = np.random.default_rng(7)
    three = measures(rng.uniform(0.1, 0.6, (3, N)) * np.linspace(0.5, 1.5, N))
    found, bound, _ = optimize_robustly(three, FAST)
    worst, first = three.worst(found.factors), three.problems[0]
    assert is_feasible(first, found.factors)
    assert worst <= min(three.worst(FAST.solve(problem).factors) for problem in three.problems) + 1e-12
    assert 0.9 * worst < bound < worst + 1e-9  # as computed: not held to the worst
    for _ in range(200):  # feasible tracks about the answer, and about constant dimming
        about = found.factors if rng.random() < 0.5 else first.baseline()
        push = np.cumsum(rng.normal(0, 10 ** rng.uniform(-4, -1.5), N))
        other = np.clip(about + push - push.mean(), 0.2, 1.0)
        other = feasible_blend(first, np.clip(other - first.budget_error(other), 0.2, 1.0))
        if is_feasible(first, other):
            assert three.worst(other) >= bound


def test_a_calm_robust_track_gives_up_its_share_of_the_worst(measures) -> None:
    rng = np.random.default_rng(7)
    three = measures(rng.uniform(0.1, 0.6, (3, N)))
    found, bound, bounds = optimize_robustly(three, FAST)
    calm = calmed(three.problems[0], found.factors, 0.1, three.worst)
    assert three.worst(calm) <= 0.9 * three.worst(found.factors) + 0.1 + 1e-12
    worst, each = three.outcome(("a", "b", "c"), calm, bound, bounds)
    assert worst.name == "worst of a, b, c"
    assert worst.value == pytest.approx(max(m.value / m.baseline for m in each))
    assert worst.baseline == 1
    assert worst.bound <= three.worst(found.factors)
    for wrong in (
        (worst.value + 1e-6, bounds),
        (bound, (*bounds[:2], each[2].value + 1e-6)),
    ):
        with pytest.raises(RuntimeError, match=r"the lower bound .* is above"):
            three.outcome(("a", "b", "c"), calm, *wrong)


def test_frames_alike_by_all_measures_keep_constant_dimming(measures) -> None:
    alike = measures(np.full((2, N), 0.3))
    np.testing.assert_allclose(optimize_robustly(alike, FAST)[0].factors, 0.5)


def test_a_robust_track_tells_what_it_does_by_each_measure() -> None:
    rng = np.random.default_rng(3)
    frames = [
        np.clip(0.5 + s * rng.standard_normal((24, 32, 1)), 0, 1).repeat(3, 2) for s in (0.05, 0.2, 0.4)
    ]
    made = evenlight.optimize(frames, 0.5, fps=0.2, robust=True, measures="relative,absolute")
    worst, each = made.outcome.minimized, made.outcome.by_measure
    assert [own.name for own in each] == ["relative", "absolute"]
    assert made.outcome.contrast_model == "relative"
    assert each[0].value == pytest.approx(made.objective, abs=1e-12)
    assert worst.bound <= worst.value <= worst.baseline == 1
    assert made.gap == 1 - worst.bound / worst.value
    says = f"the worst of relative, absolute was minimized: {100 * worst.value:.1f} % of constant dimming's"
    assert says[1:] in outcome_in_words(made.outcome)
    drawn = " ".join(text.get_text() for text in made.plot("track").findobj(Text))
    assert says[1:] in drawn
    assert "measure_absolute" in made.outcome.provenance.inputs


def test_what_makes_no_robust_track_is_refused_in_one_line(measures, make_curves, command, tmp_path) -> None:
    with pytest.raises(InputError, match="two measures or more"):
        measures_named(["castle"])
    with pytest.raises(InputError, match="each once"):
        measures_named(["castle", "castle"])
    with pytest.raises(InputError, match="no measure 'castel'; give one of"):
        measures_named(["relative", "castel"])
    with pytest.raises(InputError, match="two measures or more, got 1"):
        measures(np.full((1, N), 0.1))
    with pytest.raises(InputError, match="leave out robust"):
        evenlight.optimize(make_curves(np.ones(4) / 2), 0.5, robust=True, measures="relative,castle")
    for more, words in (
        (
            ("--robust", "--contrast-model", "as-printed", "--with", "b.mp4"),
            "leave out --with, --contrast-model",
        ),
        (("--robust", "--objective", "minimax"), "leave out --objective"),
        (("--measures", "relative,castle"), "is for --robust"),
        (("--robust", "--measures", "soft,,"), "two measures or more, each once, got soft\n"),
    ):
        result = command("optimize", "sunrise", "--budget", 0.5, "--out", tmp_path / "o", *more)
        assert result.code == 2
        assert words in result.err
        assert result.err.count("\n") == 1


def test_the_help_lists_every_preset_of_the_contrast_model() -> None:
    presets = [path.name.partition(".")[0] for path in PRESETS.glob("*.contrast_model.toml")]
    assert presets
    asked = get_type_hints(DimmedOn, include_extras=True)["contrast_model"]
    assert all(f" {name}" in asked.__metadata__[0].help for name in presets)


# --- calm


def flickering(make_curves, n=200):
    """Two scenes whose contrast loss trembles from frame to frame."""
    rng = np.random.default_rng(4)
    share = 1 / (1 + np.exp(-(np.arange(n) - n / 2) / 8))
    return make_curves(0.3 + 0.3 * share + 0.03 * rng.standard_normal(n), frames_per_second=5.0)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.02, 0.1])
def test_it_is_calmer_feasible_and_keeps_the_gain(make_curves, make_problem, share) -> None:
    problem = make_problem(flickering(make_curves), 0.5)
    best = SplittingSolver().solve(problem).factors
    calm = calmed(problem, best, share)
    assert np.abs(np.diff(calm)).sum() < 0.9 * np.abs(np.diff(best)).sum()
    assert abs(problem.budget_error(calm)) < 1e-9
    assert problem.rate_ratio(calm) <= 1 + 1e-9
    gain = problem.objective(problem.baseline()) - problem.objective(best)
    assert problem.objective(calm) <= problem.objective(best) + share * gain


def test_a_share_of_nothing_changes_nothing(make_curves, make_problem) -> None:
    problem = make_problem(flickering(make_curves, 40), 0.5)
    best = SplittingSolver().solve(problem).factors
    np.testing.assert_array_equal(calmed(problem, best, 0.0), best)


def test_it_no_longer_runs_at_the_limit_and_turns_back_less_often(make_curves, make_problem) -> None:
    problem = make_problem(flickering(make_curves), 0.5)
    best = SplittingSolver(stages=FAR_TO_NEAR).solve(problem).factors
    calm = calmed(problem, best, 0.05)

    def at_the_limit(factors):
        rate = np.abs(np.diff(factors)) * 50.0 * 5.0  # luminance 50, 5 frames a second
        limit = 0.03 * 50.0 * np.minimum(factors[:-1], factors[1:])
        return np.mean(rate >= 0.99 * limit)

    assert at_the_limit(best) > 0.5
    assert at_the_limit(calm) == 0
    assert reversals(calm) <= 0.5 * reversals(best)
    gain = problem.objective(problem.baseline()) - problem.objective(best)
    assert problem.objective(calm) <= problem.objective(best) + 0.05 * gain


def test_another_objective_can_be_kept(make_curves, make_problem) -> None:
    problem = make_problem(flickering(make_curves, 40), 0.5)
    best = SplittingSolver(stages=FAR_TO_NEAR).solve(problem).factors

    def value(factors):
        return float(np.ptp(problem.loss(factors)))  # the widest difference, not the mean one

    calm = calmed(problem, best, 0.1, value)
    assert value(calm) <= value(best) + 0.1 * (value(problem.baseline()) - value(best))


paths = arrays(np.float64, st.integers(2, 25), elements=st.floats(0.2, 1.0))


@pytest.mark.slow
@given(paths, st.floats(1e-3, 0.3))
def test_the_string_stays_in_its_tube_and_is_no_longer_than_the_path(values, radius) -> None:
    times = np.arange(len(values), dtype=float)
    string = taut_string(times, values, radius)
    assert (np.abs(string - values) <= radius + 1e-9).all()
    assert string[0] == values[0]
    assert string[-1] == pytest.approx(values[-1], abs=1e-12)

    def length(path):
        return float(np.hypot(np.diff(times), np.diff(path)).sum())

    assert length(string) <= length(values) + 1e-9
    rng = np.random.default_rng(0)
    for _ in range(20):  # no other path in the tube is shorter
        other = values + radius * rng.uniform(-1, 1, len(values))
        other[0], other[-1] = values[0], values[-1]
        assert length(string) <= length(other) + 1e-9
        assert length(string) <= length((string + other) / 2) + 1e-9

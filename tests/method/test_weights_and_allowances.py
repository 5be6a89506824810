"""Frames that count differently, steps that may be faster or not at all, clips that share a budget."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, VideoSection
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.objective import order_weights, pairwise_spread, proximal_spread
from evenlight.method.optimizer.optimize import clip_of, is_feasible, joined_curves, joints, optimize, pose
from evenlight.method.optimizer.request import Request, frame_weights, step_allowances
from evenlight.method.optimizer.splitting import FAR_TO_NEAR, SplittingSolver
from evenlight.method.preset_files import load_power_model, load_rate_limit

LIMIT = load_rate_limit("surace2025")
ONE_SEARCH = SplittingSolver(stages=FAR_TO_NEAR)


def weighted_spread(loss: np.ndarray, weights: np.ndarray) -> float:
    """Σ_{i<j} ω_i ω_j |u_i - u_j| / Σ_{i<j} ω_i ω_j, as printed."""
    pairs = list(itertools.combinations(range(len(loss)), 2))
    total = sum(weights[i] * weights[j] for i, j in pairs)
    return sum(weights[i] * weights[j] * abs(loss[i] - loss[j]) for i, j in pairs) / total if total else 0.0


def some_frames(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 20))
    return rng.uniform(0, 1, n).round(1), np.where(rng.random(n) < 0.2, 0.0, 10 ** rng.uniform(-3, 2, n))


@given(st.integers(0, 10_000))
def test_the_weighted_spread_matches_the_double_sum(seed) -> None:
    loss, weights = some_frames(seed)
    assert pairwise_spread(loss, weights) == pytest.approx(
        weighted_spread(loss, weights), rel=1e-9, abs=1e-12
    )


@given(st.integers(0, 10_000))
def test_a_frame_of_weight_two_counts_as_if_it_were_there_twice(seed) -> None:
    # Twice the frame adds a pair with itself, whose difference is 0: the sums agree, the number of pairs not.
    loss, _ = some_frames(seed)
    twice = np.append(loss, loss[0])
    weights = np.ones(len(loss))
    weights[0] = 2
    n = len(twice)
    pairs = n * (n - 1) / 2 - 1
    assert pairwise_spread(loss, weights) * pairs == pytest.approx(pairwise_spread(twice) * (pairs + 1))


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.floats(1e-3, 1.0))
def test_no_nudge_improves_the_weighted_proximal_point(seed, strength) -> None:
    start, weights = some_frames(seed)
    weights = weights[:9] + 1e-3
    start = start[:9]

    def cost(v: np.ndarray) -> float:
        pairs = np.triu(np.outer(weights, weights) * np.abs(np.subtract.outer(v, v)), 1)
        return strength * float(pairs.sum()) + float(weights @ (v - start) ** 2) / 2

    best, rng = proximal_spread(start, strength, weights), np.random.default_rng(seed)
    for scale in (1e-4, 1e-2, 1.0):
        assert cost(best) <= cost(best + scale * rng.standard_normal(len(start))) * (1 + 1e-9) + 1e-9


def odd_curves(make_curves, rng, n):
    return make_curves(
        rng.uniform(0.05, 0.9, n), exponent=rng.uniform(0.5, 2, n), luminance=rng.uniform(1, 90, n),
        frames_per_second=float(10 ** rng.uniform(-1.5, 1.0)), knots=9,
    )  # fmt: skip


@pytest.mark.slow
@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_answers_keep_odd_weights_and_allowances_and_no_track_goes_below_the_bound(
    make_curves, make_problem, seed
) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    problem = make_problem(odd_curves(make_curves, rng, n), float(rng.uniform(0.25, 0.95)))
    weights = rng.choice([0.0, 0.5, 1.0, 7.0], n) + 1e-9
    problem = dataclasses.replace(
        problem,
        importance=weights / weights.mean(),
        allowances=rng.choice([0.0, 0.3, 1.0, 50.0, np.inf], n - 1),
    )
    answer = optimize(problem, ONE_SEARCH)
    assert is_feasible(problem, answer.factors)
    held = problem.allowances == 0
    assert (np.diff(answer.factors)[held] == 0).all()
    bound = lower_bound(problem, answer)
    assert bound <= problem.objective(answer.factors) + 1e-12
    for _ in range(40):  # tracks that keep the limits by construction: they move at free steps only
        parts = np.cumsum(np.append(0, np.isinf(problem.allowances)))
        wild = rng.uniform(0.2, 1.0, parts[-1] + 1)[parts]
        wild = np.clip(wild - problem.budget_error(wild), 0.2, 1.0)
        if is_feasible(problem, wild):
            assert bound <= problem.objective(wild) + 1e-9


def test_a_held_section_is_constant_and_a_freed_cut_is_used(make_curves, make_problem) -> None:
    loss = [0.2] * 30 + [0.7] * 30
    curves = make_curves(
        loss, luminance=40.0, knots=9
    )  # at 3 % per second of 40 cd/m², next to nothing in 2.4 s
    tight = make_problem(curves, 0.5)
    cut = step_allowances(
        curves, [VideoSection(1.2, 1.21, allowance=1e4), VideoSection(0.2, 0.6, allowance=0.0)]
    )
    assert cut is not None
    assert cut[29] == 1e4  # frame 30 appears at 1.2 s: the step to it is the 29th
    assert (cut[4:14] == 0).all()
    freed = dataclasses.replace(tight, allowances=cut)
    before, after = (optimize(p, ONE_SEARCH) for p in (tight, freed))
    assert np.ptp(after.factors[4:15]) == 0
    assert after.factors[30] - after.factors[29] > 0.3
    assert freed.objective(after.factors) < 0.1 * tight.objective(before.factors)
    assert freed.rate_ratio(after.factors) <= 1 + 1e-9


def test_a_scene_that_counts_for_nothing_gives_its_light_to_the_others(make_curves, make_problem) -> None:
    curves = make_curves([0.2, 0.4, 0.9], frames_per_second=0.001)
    problem = make_problem(curves, 0.5, relative_rate=10.0)
    ignored = dataclasses.replace(problem, importance=np.array([1.5, 1.5, 0.0]))
    factors = optimize(ignored, SplittingSolver()).factors
    loss = ignored.loss(factors)
    assert loss[0] == pytest.approx(loss[1], abs=1e-6)
    assert optimize(problem, SplittingSolver()).factors[2] > factors[2] - 1e-6


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        ([VideoSection(0.0, 1.0, 2.0), VideoSection(0.5, 2.0, 1.0)], "from 0.5 to 2 s overlaps"),
        ([VideoSection(90.0, 91.0, 2.0)], "from 90 to 91 s holds no frame"),
        ([VideoSection(0.0, 90.0, 0.0)], "every frame the weight 0"),
    ],
)
def test_sections_that_do_not_fit_are_refused(make_curves, sections, says) -> None:
    with pytest.raises(InputError, match=says):
        frame_weights(make_curves(np.full(100, 0.3)), sections)


def test_clips_share_the_budget_and_no_step_is_limited_between_them(make_curves, make_weber_limit) -> None:
    clips = [make_curves([0.1] * 20), make_curves([0.6] * 60)]
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), make_weber_limit(0.001))
    problem = pose(joined_curves(clips), request, joints(clips))
    factors = optimize(problem, ONE_SEARCH).factors
    # Equal losses 0.1 (1 - b) = 0.6 (1 - b') with b/4 + 3 b'/4 = 1/2 need b < 0.2: it stays at 0.2, b' = 0.6.
    np.testing.assert_allclose(factors, [0.2] * 20 + [0.6] * 60, atol=2e-3)
    assert np.mean(factors) == pytest.approx(0.5, abs=1e-9)
    second = clip_of(problem, clips[1], 20)
    assert second.rate_ratio(factors[20:]) <= 1 + 1e-9
    assert second.allowances is not None
    assert np.isfinite(second.allowances).all()


def test_a_black_clip_of_a_shared_budget_has_a_mean_though_no_share_in_the_power(make_curves) -> None:
    clips = [make_curves([0.1] * 4), make_curves([0.6] * 6)]
    problem = pose(
        joined_curves(clips), Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), LIMIT)
    )
    problem = dataclasses.replace(problem, budget_weights=np.repeat([0.25, 0.0], [4, 6]))
    second = clip_of(problem, clips[1], 4)
    np.testing.assert_allclose(second.budget_weights, np.full(6, 1 / 6))
    assert second.budget_weights @ np.full(6, 0.4) == pytest.approx(0.4)


@pytest.mark.parametrize("unit", [BudgetUnit.POWER, BudgetUnit.WATT])
def test_on_an_oled_panel_the_budget_is_met_in_watts_and_certified(
    make_curves, make_weber_limit, unit
) -> None:
    oled = PowerModel("o", PanelKind.OLED, 0.1, red_power=0.5, green_power=0.8, blue_power=1.2)
    share = 1 / (1 + np.exp(-np.linspace(-6, 6, 120)))
    curves = make_curves(0.3 + 0.3 * share, exponent=1.3, luminance=60 - 20 * share, frames_per_second=4.0)
    request = Request(0.55, BudgetUnit.POWER, oled, make_weber_limit(0.03))
    full = 0.1 + float(np.mean(curves.channel_means @ [0.5, 0.8, 1.2]))
    if unit is BudgetUnit.WATT:
        request = dataclasses.replace(request, budget=0.55 * full, budget_unit=unit)
    problem = pose(curves, request)
    answer = optimize(problem, ONE_SEARCH)
    used = 0.1 + float(np.mean(answer.factors * (curves.channel_means @ [0.5, 0.8, 1.2])))
    assert used == pytest.approx(0.55 * full, abs=1e-9)
    bound = lower_bound(problem, answer)
    assert 0.5 * problem.objective(answer.factors) < bound <= problem.objective(answer.factors)


def test_weights_outside_the_permutahedron_cannot_lift_the_bound(make_curves, make_problem) -> None:
    share = 1 / (1 + np.exp(-np.linspace(-8, 8, 80)))
    problem = make_problem(make_curves(0.2 + 0.5 * share, exponent=1.3, frames_per_second=2.0), 0.4)
    answer = optimize(problem, ONE_SEARCH)
    assert answer.frame_weights is not None
    for scale in (2.0, 50.0):
        greedy = dataclasses.replace(answer, frame_weights=scale * answer.frame_weights + 0.3)
        assert lower_bound(problem, greedy) <= problem.objective(answer.factors) + 1e-12


def test_order_weights_of_equal_frames_are_those_of_ginis_mean_difference() -> None:
    np.testing.assert_array_equal(order_weights(np.ones(4)), [-3, -1, 1, 3])

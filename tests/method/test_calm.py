"""A calm track gives up a share of the gain for fewer turns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.method.optimizer.calm import calmed, taut_string
from evenlight.method.optimizer.evaluate import reversals
from evenlight.method.optimizer.splitting import FAR_TO_NEAR, SplittingSolver


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

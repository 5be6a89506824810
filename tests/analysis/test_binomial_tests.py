"""Claims about counts of answers: exact tests, intervals and odds are what others get for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats
from statsmodels.stats.proportion import binom_tost, proportion_confint

from evenlight.analysis.inference.binomial_tests import (
    answers_for_equivalence,
    answers_to_find,
    bayes_factor,
    bayes_factor_within,
    clopper_pearson,
    difference_power,
    equivalence_p,
    equivalence_power,
    exact_p,
    interval_coverage,
    lower_critical,
    margin_shown,
    mid_p_interval,
    posterior_within,
    smallest_margin,
    smallest_margin_ever,
    smallest_share_found,
)

counts = st.integers(1, 90).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
margins = st.floats(0.02, 0.48)


@given(counts)
def test_the_exact_p_is_the_sum_of_both_tails(count: tuple[int, int]) -> None:
    k, n = count
    tail = sum(math.comb(n, j) for j in range(min(k, n - k) + 1)) / 2**n
    assert exact_p(k, n) == pytest.approx(min(1.0, 2 * tail), rel=1e-9)


@pytest.mark.slow
@given(counts)
def test_the_interval_of_clopper_and_pearson_is_that_of_statsmodels_and_scipy(count: tuple[int, int]) -> None:
    k, n = count
    found = clopper_pearson(k, n)
    assert found == pytest.approx(proportion_confint(k, n, method="beta"), abs=1e-9)
    theirs = stats.binomtest(k, n).proportion_ci(method="exact")
    assert found == pytest.approx((theirs.low, theirs.high), abs=1e-9)


@given(counts)
def test_the_mid_p_interval_has_two_and_a_half_percent_in_either_mid_p_tail(count: tuple[int, int]) -> None:
    k, n = count
    low, high = mid_p_interval(k, n)
    if k:
        assert stats.binom.sf(k, n, low) + stats.binom.pmf(k, n, low) / 2 == pytest.approx(0.025, abs=1e-9)
    else:
        assert low == 0
    if k < n:
        below = stats.binom.cdf(k - 1, n, high) + stats.binom.pmf(k, n, high) / 2
        assert below == pytest.approx(0.025, abs=1e-9)
    else:
        assert high == 1
    outer = clopper_pearson(k, n)
    assert outer[0] <= low <= k / n <= high <= outer[1]


@given(counts, margins)
def test_equivalence_is_that_of_statsmodels(count: tuple[int, int], margin: float) -> None:
    k, n = count
    p_value = binom_tost(k, n, 0.5 - margin, 0.5 + margin)[0]
    assert equivalence_p(k, n, margin) == pytest.approx(p_value, abs=1e-12)


@given(counts)
def test_the_smallest_margin_is_where_the_equivalence_test_turns(count: tuple[int, int]) -> None:
    k, n = count
    margin = smallest_margin(k, n)
    if margin + 1e-6 < 0.5:
        assert equivalence_p(k, n, margin + 1e-6) <= 0.05
    assert equivalence_p(k, n, min(margin, 0.5) - 1e-6) > 0.05


@pytest.mark.parametrize(("k", "n"), [(0, 1), (9, 17), (17, 17), (31, 68), (3, 40)])
def test_bayes_factors_are_ratios_of_integrated_likelihoods(k: int, n: int) -> None:
    margin = 0.15

    def likelihood(p: float) -> float:
        return float(stats.binom.pmf(k, n, p))

    def integral(low: float, high: float) -> float:
        return float(integrate.quad(likelihood, low, high, epsabs=0, epsrel=1e-10)[0])

    low, inside, high = (
        integral(0, 0.5 - margin),
        integral(0.5 - margin, 0.5 + margin),
        integral(0.5 + margin, 1),
    )
    everywhere = low + inside + high
    assert bayes_factor(k, n) == pytest.approx(likelihood(0.5) / everywhere, rel=1e-8)
    within = (inside / (2 * margin)) / ((low + high) / (1 - 2 * margin))
    assert bayes_factor_within(k, n, margin) == pytest.approx(within, rel=1e-7)
    assert posterior_within(k, n, margin) == pytest.approx(inside / everywhere, rel=1e-8)


def test_bayes_factors_stay_finite_for_thousands_of_answers() -> None:
    even = bayes_factor(5000, 10000)
    assert math.isfinite(even)
    assert math.isfinite(bayes_factor_within(5000, 10000, 0.15))
    assert even > 50  # sqrt(2 n / pi) = 79.8 for an even division, by Stirling
    assert bayes_factor(0, 10000) == 0.0


@pytest.mark.parametrize("n", [1, 5, 17, 68])
@pytest.mark.parametrize("share", [0.5, 0.65, 0.9])
def test_power_is_the_chance_of_the_outcomes_that_the_tests_call_different_or_equal(
    n: int, share: float
) -> None:
    chances = stats.binom.pmf(np.arange(n + 1), n, share)
    different = [exact_p(k, n) <= 0.05 for k in range(n + 1)]
    assert float(difference_power(n, share)) == pytest.approx(chances[different].sum(), abs=1e-12)
    equal = [equivalence_p(k, n, 0.2) <= 0.05 for k in range(n + 1)]
    assert float(equivalence_power(n, share, 0.2)) == pytest.approx(chances[equal].sum(), abs=1e-12)


def test_neither_test_errs_more_often_than_five_percent_with_any_number_of_answers() -> None:
    n = np.arange(1, 301)
    assert difference_power(n, 0.5).max() <= 0.05
    for margin in (0.1, 0.15, 0.25):
        for side in (-1, 1):
            assert equivalence_power(n, 0.5 + side * margin, margin).max() <= 0.05


def test_seventeen_answers_are_told_from_a_coin_nearly_as_often_as_they_may() -> None:
    # 4 or fewer and 13 or more of 17: 2 · (1 + 17 + 136 + 680 + 2380) / 2^17.
    assert float(difference_power(17, 0.5)) == 2 * 3214 / 2**17
    assert lower_critical(17) == 4


def test_the_intervals_of_seventeen_answers_hold_the_truth_as_often_as_they_should() -> None:
    everywhere, middle = np.linspace(0.001, 0.999, 999), np.linspace(0.2, 0.8, 601)
    assert interval_coverage(17, everywhere, mid_p=False).min() >= 0.95
    assert interval_coverage(17, everywhere, mid_p=True).min() >= 0.92
    inside = interval_coverage(17, middle, mid_p=True)
    # Of one share in a hundred the coverage is 98.04 %: an interval of so few answers moves in steps.
    assert inside.max() < 0.981
    assert np.mean((inside > 0.92) & (inside < 0.98)) > 0.985
    assert 0.945 < inside.mean() < 0.96


def test_coverage_is_what_counting_gives() -> None:
    rng = np.random.default_rng(4)
    drawn = rng.binomial(12, 0.3, 20_000)
    ends = np.array([mid_p_interval(k, 12) for k in range(13)])[drawn]
    counted = np.mean((ends[:, 0] <= 0.3) & (ends[:, 1] >= 0.3))
    # Standard error sqrt(0.05 · 0.95 / 20000) = 0.0015; four of them.
    assert float(interval_coverage(12, [0.3], mid_p=True)[0]) == pytest.approx(counted, abs=0.006)


@pytest.mark.parametrize("share", [0.6, 0.65, 0.8, 0.95])
def test_the_answers_that_find_a_share_do_so_from_there_on(share: float) -> None:
    n = answers_to_find(share, 0.8)
    assert n is not None
    assert difference_power(np.arange(n, 4 * n), share).min() >= 0.8
    assert float(difference_power(n - 1, share)) < 0.8


@pytest.mark.parametrize("margin", [0.1, 0.15, 0.3])
def test_the_answers_that_show_equivalence_do_so_from_there_on(margin: float) -> None:
    n = answers_for_equivalence(margin, 0.8)
    assert n is not None
    assert equivalence_power(np.arange(n, 4 * n), 0.5, margin).min() >= 0.8
    assert float(equivalence_power(n - 1, 0.5, margin)) < 0.8


def test_what_no_number_of_answers_shows_has_no_number() -> None:
    assert answers_to_find(0.505, 0.8) is None  # (2.8 / 0.01)² = 78 400
    assert answers_for_equivalence(0.005, 0.8) is None  # (2.9 / 0.01)² = 85 600
    assert smallest_share_found(5, 0.8) is None


def test_seventeen_answers_show_no_narrower_margin_than_a_quarter_and_find_no_share_below_four_fifths() -> (
    None
):
    margin = stats.beta.ppf(0.95, 10, 8) - 0.5
    assert smallest_margin_ever(17) == pytest.approx(margin, abs=1e-12)
    assert not any(equivalence_p(k, 17, margin - 1e-6) <= 0.05 for k in range(18))
    assert any(equivalence_p(k, 17, margin + 1e-6) <= 0.05 for k in range(18))
    found = smallest_share_found(17, 0.8)
    assert found is not None
    assert stats.binom.sf(12, 17, found) + stats.binom.cdf(4, 17, found) == pytest.approx(0.8, abs=1e-9)


@pytest.mark.parametrize("n", [8, 17, 60])
def test_the_margin_shown_with_a_power_has_that_power_and_none_smaller_has(n: int) -> None:
    margin = margin_shown(n, 0.8)
    assert float(equivalence_power(n, 0.5, margin + 1e-6)) >= 0.8
    assert float(equivalence_power(n, 0.5, margin - 1e-6)) < 0.8
    assert margin_shown(1, 0.8) == 0.5

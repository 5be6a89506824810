"""Claims about Kaplan-Meier curves: right by hand and by two libraries, honest where half is not reached."""

import warnings

import numpy as np
import pytest
from scipy import stats
from statsmodels.duration.survfunc import SurvfuncRight

from evenlight.analysis.inference.survival_curves import (
    NO_UPPER_END,
    NOT_REACHED,
    TOO_FEW,
    kaplan_meier,
    restricted_mean,
)


def drawn(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Times with ties, some of them censored at different limits."""
    rng = np.random.default_rng(seed)
    times, limits = np.round(np.exp(rng.normal(2.5, 1.0, n)), 1), rng.choice([20.0, 30.0], n)
    return np.minimum(times, limits), times <= limits


def test_the_curve_is_the_product_of_the_shares_that_go_on() -> None:
    # 5 searched; found at 1 and 2 (of 5, then 4), one given up at 2.5, found at 3 (of the 2 left), one at 9.
    curve = kaplan_meier(np.array([1.0, 2.0, 2.5, 3.0, 9.0]), np.array([True, True, False, True, False]))
    assert curve.times.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(curve.survival, [4 / 5, 4 / 5 * 3 / 4, 4 / 5 * 3 / 4 * 1 / 2])
    assert curve.median.value == 3.0


@pytest.mark.parametrize("seed", range(6))
def test_curve_and_interval_are_those_of_scipy(seed: int) -> None:
    times, found = drawn(seed, 17)
    curve = kaplan_meier(times, found)
    theirs = stats.ecdf(stats.CensoredData.right_censored(times, ~found)).sf
    np.testing.assert_allclose(curve.survival, theirs.evaluate(curve.times))
    band = theirs.confidence_interval(method="log-log")
    some = curve.survival > 0
    np.testing.assert_allclose(curve.low[some], band.low.evaluate(curve.times)[some])
    np.testing.assert_allclose(curve.high[some], band.high.evaluate(curve.times)[some])


@pytest.mark.parametrize("seed", range(12))
def test_the_median_of_an_odd_number_and_its_interval_are_those_of_statsmodels(seed: int) -> None:
    times, found = drawn(seed, 17)
    curve = kaplan_meier(times, found)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # theirs takes logarithms of 0 on its way
        theirs = SurvfuncRight(times, found.astype(int))
        ends = theirs.quantile_ci(0.5, method="cloglog")
        median = theirs.quantile(0.5)
    assert curve.median.value == (None if np.isnan(median) else median)
    assert curve.median.ci_low == ends[0]
    assert curve.median.ci_high == (None if np.isinf(ends[1]) else ends[1])


def test_the_median_of_an_even_number_is_the_usual_one() -> None:
    assert kaplan_meier(np.array([1.0, 2.0, 5.0, 9.0]), np.ones(4, bool)).median.value == 3.5


@pytest.mark.parametrize("n", [8, 12, 17, 34])
def test_the_interval_of_the_median_holds_it_in_92_to_98_percent_exactly(n: int) -> None:
    # Without censoring the ends are the a-th and b-th time, so that the median lies between them if a to
    # b - 1 of the n times are below it: a sum of binomial probabilities. 17: 96.9 %.
    curve = kaplan_meier(np.arange(1.0, n + 1), np.ones(n, bool))
    assert curve.median.ci_low is not None
    assert curve.median.ci_high is not None
    below = stats.binom(n, 0.5)
    coverage = below.cdf(curve.median.ci_high - 1) - below.cdf(curve.median.ci_low - 1)
    assert 0.92 <= coverage <= 0.98


def test_a_limit_beyond_the_interval_does_not_change_it() -> None:
    times = np.arange(1.0, 18.0)
    whole = kaplan_meier(times, np.ones(17, bool))
    cut = kaplan_meier(np.minimum(times, 14.5), times < 14.5)
    assert (cut.median.value, cut.median.ci_low) == (whole.median.value, whole.median.ci_low)
    assert cut.median.ci_high == whole.median.ci_high


def test_a_median_that_is_not_reached_is_a_flag_and_no_number() -> None:
    times = np.array([5.0, 8.0, 30.0, 30.0, 30.0, 30.0, 30.0])
    curve = kaplan_meier(times, times < 30)
    assert (curve.median.value, curve.median.flag) == (None, NOT_REACHED)
    assert curve.median.ci_low == 5.0


def test_just_half_found_leaves_the_median_open() -> None:
    times = np.array([1.0, 2.0, 3.0, 30.0, 30.0, 30.0])
    assert kaplan_meier(times, times < 30).median.flag == NOT_REACHED


def test_an_upper_end_that_is_not_reached_is_flagged() -> None:
    times = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 30.0, 30.0, 30.0, 30.0, 30.0])
    curve = kaplan_meier(times, times < 30)
    assert curve.median.value == 6.0
    assert (curve.median.ci_high, curve.median.flag) == (None, NO_UPPER_END)


def test_nothing_found_has_no_curve_and_no_median() -> None:
    curve = kaplan_meier(np.full(17, 30.0), np.zeros(17, bool))
    assert (curve.times.size, curve.median.value, curve.median.flag) == (0, None, NOT_REACHED)
    assert curve.times.size == 0
    assert restricted_mean(curve, 30.0) == 30.0


@pytest.mark.parametrize("n", [1, 5])
def test_so_few_times_have_no_interval(n: int) -> None:
    # All of 5 lie on one side of the median in 2 / 32 = 6.2 % of samples: no interval holds it in 95 %.
    curve = kaplan_meier(np.arange(1.0, n + 1), np.ones(n, bool))
    assert curve.median.value == (n + 1) / 2
    assert (curve.median.ci_low, curve.median.ci_high, curve.median.flag) == (None, None, TOO_FEW)


def test_all_times_equal_have_that_median() -> None:
    curve = kaplan_meier(np.full(17, 4.0), np.ones(17, bool))
    assert (curve.median.value, curve.median.ci_low, curve.median.ci_high) == (4.0, 4.0, 4.0)


@pytest.mark.parametrize("seed", range(3))
def test_with_one_limit_the_restricted_mean_is_the_mean_with_that_limit_put_in(seed: int) -> None:
    times = np.minimum(np.random.default_rng(seed).lognormal(2.5, 1.0, 17), 30.0)
    assert restricted_mean(kaplan_meier(times, times < 30), 30.0) == pytest.approx(times.mean())

"""The smallest difference that so many ratings would mostly find."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evenlight.analysis.rating.rating_power import POWER, likely_differences, smallest_difference

SUPPORT = np.arange(-4, 5)


@settings(max_examples=40)
@given(st.floats(-2, 2), st.floats(0.6, 1.6))
def test_the_differences_drawn_have_the_mean_and_the_spread_asked_for(mean: float, sd: float) -> None:
    p = likely_differences(mean, sd)
    assert p.sum() == pytest.approx(1.0)
    assert p @ SUPPORT == pytest.approx(mean, abs=1e-3)
    assert p @ SUPPORT**2 - (p @ SUPPORT) ** 2 == pytest.approx(sd**2, abs=1e-3)


def test_of_differences_of_0_and_1_the_power_is_that_of_a_binomial_test() -> None:
    # Hardly any SD: the smallest spread of a mean m is 0 or 1 with P(1) = m. All that differ have one sign,
    # and six of them give p = 2 / 64: at least six of 17 are wanted with a probability of 80 %.
    found = smallest_difference(17, 1e-6, np.random.default_rng(1))
    shares = np.linspace(0.3, 0.6, 301)
    needed = shares[np.argmax(stats.binom.sf(5, 17, shares) >= POWER)]
    # 333 experiments know the power to 0.022, which rises by 17 P(5 of 16) per unit of the mean.
    assert found == pytest.approx(needed, abs=3 * 0.022 / (17 * stats.binom.pmf(5, 16, needed)))


def test_many_pairs_find_what_the_t_test_finds() -> None:
    # 80 % power at 5 % needs (z.975 + z.80) standard errors: 2.80 SD / sqrt(n). 333 experiments know the
    # power to 0.022, ln(difference) to 0.022 / 0.78 (2.80 times the normal density at z.80): three times that
    # is 8 %, and some more upwards because whole numbers keep the test below its 5 %.
    found = smallest_difference(60, 1.2, np.random.default_rng(1))
    assert found is not None
    assert 0.92 < found / (2.80 * 1.2 / np.sqrt(60)) < 1.12


def test_five_pairs_find_nothing_and_six_only_what_all_agree_in() -> None:
    rng = np.random.default_rng(1)
    assert smallest_difference(5, 1.0, rng) is None
    six = smallest_difference(6, 1.0, rng)
    assert six is not None
    assert six > 1.8  # all six must be above 0: 0.8 ^ (1/6) of a normal lie above -1.8 SD


def test_without_a_spread_there_is_no_smallest_difference() -> None:
    assert smallest_difference(17, 0.0, np.random.default_rng(1)) is None


def test_on_a_wider_scale_the_smallest_difference_is_as_many_standard_deviations() -> None:
    # 60 pairs: 2.80 SD / sqrt(n), as above; however long the scale is, and in whatever steps.
    for largest, spread, step in ((100.0, 25.0, 1.0), (100.0, 2.0, 0.1), (1e9, 3.0, 1e-6), (1.0, 0.2, 0.01)):
        found = smallest_difference(60, spread, np.random.default_rng(1), step, largest)
        assert found is not None
        assert 0.92 < found / (2.80 * spread / np.sqrt(60)) < 1.12

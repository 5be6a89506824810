"""The rate of the modulation, and what limits it."""

import numpy as np
import pytest

from evenlight.method.rate_limit import allowed_rate, largest_rate_ratio, modulation_rate


def test_only_the_modulation_counts_not_a_cut_in_the_content() -> None:
    rate = modulation_rate(np.array([0.5, 0.5]), np.array([1.0, 100.0]), np.array([0.04, 0.04]))
    assert rate.tolist() == [0.0, 0.0]


def test_rate_of_a_step_by_hand() -> None:
    # The factor rises by 0.1 on frames of 20 and 40 cd/m^2: 0.1 · 30 cd/m^2 within 0.5 s is 6 cd/m^2/s.
    rate = modulation_rate(np.array([0.4, 0.5]), np.array([20.0, 40.0]), np.array([0.5, 0.1]))
    assert rate[0] == pytest.approx(6.0)


def test_the_lower_limit_of_the_two_ends_counts() -> None:
    allowed = allowed_rate(np.array([0.5, 1.0]), np.array([10.0, 10.0]), lambda luminance: 0.03 * luminance)
    assert allowed[0] == pytest.approx(0.03 * 5.0)


def test_no_change_is_allowed_even_where_the_limit_is_zero() -> None:
    assert largest_rate_ratio(np.array([0.0, 0.0]), np.array([0.0, 0.0])) == 0.0


def test_a_change_where_the_limit_is_zero_is_infinitely_too_fast() -> None:
    assert largest_rate_ratio(np.array([1e-9]), np.array([0.0])) == np.inf

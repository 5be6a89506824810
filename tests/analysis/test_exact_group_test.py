"""The exact test between two groups, against all divisions and against scipy."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evenlight.analysis.inference.exact_tests import group_p_value, subset_counts

scores = st.lists(st.integers(-4, 4), min_size=1, max_size=5)


@settings(max_examples=40)
@given(scores, scores)
def test_p_is_the_share_of_all_divisions_with_such_a_difference_of_means(
    first: list[int], second: list[int]
) -> None:
    everybody = np.array(first + second)
    gaps = []
    for members in itertools.combinations(range(everybody.size), len(first)):
        inside = np.isin(np.arange(everybody.size), members)
        gaps.append(abs(everybody[inside].mean() - everybody[~inside].mean()))
    found = abs(np.mean(first) - np.mean(second))
    assert group_p_value(first, second) == pytest.approx(np.mean(np.array(gaps) >= found - 1e-9))


def test_two_groups_of_one_size_agree_with_scipy() -> None:
    first, second = np.array([2, 0, 1, 3, 1, 1]), np.array([0, -1, 0, 1, -2, 0])

    def gap(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
        return np.asarray(np.mean(x, axis=axis) - np.mean(y, axis=axis))

    oracle = stats.permutation_test((first, second), gap, n_resamples=np.inf, vectorized=True)
    assert group_p_value(first, second) == pytest.approx(oracle.pvalue, abs=1e-12)


def test_200_people_are_counted_exactly() -> None:
    counts, lowest = subset_counts(np.array([1] * 100 + [-1] * 100))
    assert lowest == -100
    assert counts.sum() == pytest.approx(2.0**200)
    # Subsets of two with sum 0: one of each sign.
    assert counts[2, 100] == 100 * 100


def test_groups_that_are_all_alike_do_not_differ() -> None:
    assert group_p_value([3, 3], [3, 3, 3]) == 1.0


def test_an_empty_group_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one each"):
        group_p_value([], [1])

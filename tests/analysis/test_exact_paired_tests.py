"""Exact tests of paired differences, against all 2^n choices of signs and against scipy."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evenlight.analysis.inference.exact_tests import (
    ZeroHandling,
    sign_flip_p_values,
    sign_flip_test,
    sign_test,
    signed_rank_test,
)

# Few, so that all choices of signs can be listed; with zeros and ties, as ratings have them.
differences = st.lists(st.integers(-4, 4), min_size=1, max_size=8)


def listed_p(weights: np.ndarray, found: float, mid_p: bool = False) -> float:
    """P(|Σ ± weight| >= |found|), every choice of signs written out."""
    sums = np.abs([signs @ weights for signs in itertools.product((-1, 1), repeat=len(weights))])
    beyond, equal = np.mean(sums > abs(found) + 1e-9), np.mean(np.abs(sums - abs(found)) < 1e-9)
    # Twice the one-sided mid-p; of a sum of 0 it is 1.
    return float(beyond + (0.5 * equal if mid_p and found else equal))


@settings(max_examples=40)
@given(differences, st.booleans())
def test_the_sign_flip_test_is_the_share_of_all_choices_of_signs(d: list[int], mid_p: bool) -> None:
    assert sign_flip_test(d, mid_p).p_value == pytest.approx(listed_p(np.abs(d), sum(d), mid_p), abs=1e-12)


@settings(max_examples=40)
@given(differences, st.sampled_from(ZeroHandling))
def test_the_signed_rank_test_is_the_share_of_all_choices_of_signs_of_midranks(
    d: list[int], zeros: ZeroHandling
) -> None:
    used = np.array([x for x in d if x or zeros is ZeroHandling.PRATT])
    ranks = np.array([np.sum(np.abs(used) < abs(x)) + (np.sum(np.abs(used) == abs(x)) + 1) / 2 for x in used])
    signed = float(np.sum(ranks * np.sign(used)))
    tested = signed_rank_test(d, zeros)
    assert tested.statistic == pytest.approx(signed)
    assert tested.p_value == pytest.approx(listed_p(ranks[used != 0], signed), abs=1e-12)
    assert (tested.n, tested.n_different) == (len(d), sum(x != 0 for x in d))


@settings(max_examples=40)
@given(differences)
def test_the_sign_test_is_the_binomial_test_of_the_pairs_that_differ(d: list[int]) -> None:
    plus, different = sum(x > 0 for x in d), sum(x != 0 for x in d)
    expected = stats.binomtest(plus, different).pvalue if different else 1.0
    assert sign_test(d).p_value == pytest.approx(expected, abs=1e-12)


def test_the_sign_flip_test_agrees_with_scipy() -> None:
    d = np.array([2, -1, 0, 1, 3, 1, -2, 0, 1, 1])
    oracle = stats.permutation_test(
        (d,), np.mean, permutation_type="samples", n_resamples=np.inf, vectorized=True, axis=0
    )
    assert sign_flip_test(d).p_value == pytest.approx(oracle.pvalue, abs=1e-12)


def test_the_signed_rank_test_of_17_pairs_agrees_with_scipy() -> None:
    d = np.random.default_rng(3).permutation(np.arange(1, 18)) * np.array([1, 1, -1] * 5 + [1, 1])
    assert signed_rank_test(d).p_value == pytest.approx(stats.wilcoxon(d, method="exact").pvalue, abs=1e-12)


@pytest.mark.parametrize(("zeros", "name"), [(ZeroHandling.PRATT, "pratt"), (ZeroHandling.DROPPED, "wilcox")])
def test_the_signed_rank_test_with_ties_and_zeros_agrees_with_scipy(zeros: ZeroHandling, name: str) -> None:
    d = np.array([2, -1, 0, 1, 3, 1, -2, 0, 1, 1])
    every_sign = stats.PermutationMethod(n_resamples=2**10)
    oracle = stats.wilcoxon(d, zero_method=name, method=every_sign)
    assert signed_rank_test(d, zeros).p_value == pytest.approx(oracle.pvalue, abs=1e-12)


def test_many_sets_at_once_have_the_p_values_of_each_by_itself() -> None:
    sets = np.random.default_rng(1).integers(-4, 5, (50, 17))
    for mid_p in (False, True):
        each = [sign_flip_test(d, mid_p).p_value for d in sets]
        np.testing.assert_allclose(sign_flip_p_values(sets, mid_p), each, rtol=1e-12)


def test_no_more_than_5_percent_of_the_signs_are_rejected_whatever_the_sizes() -> None:
    # The level of an exact test given the sizes of the differences: all signs of all 715 sets of 9 sizes 0-4.
    signs = np.array(list(itertools.product((-1, 1), repeat=9)))
    worst = 0.0
    for sizes in itertools.islice(itertools.combinations_with_replacement(range(5), 9), 0, None, 5):
        worst = max(worst, float(np.mean(sign_flip_p_values(signs * np.array(sizes)) <= 0.05)))
    assert 0.03 < worst <= 0.05


def test_200_pairs_are_exact_too() -> None:
    assert sign_test([1] * 60).p_value == 2.0**-59
    d = np.array([2, -1, 1, 0, 3, -2, 1, -1, 0, -2] * 20)
    # Sums of equal parity: the normal approximation takes the step of 2 between them half each way.
    half = float(stats.norm.sf((d.sum() - 1) / math.sqrt(np.sum(d**2))))
    assert sign_flip_test(d).p_value == pytest.approx(2 * half, abs=0.002)


def test_pairs_that_are_all_alike_cannot_speak_for_either_side() -> None:
    for tested in (sign_flip_test([0] * 17), signed_rank_test([0] * 17), sign_test([0] * 17)):
        assert (tested.p_value, tested.n_different, tested.smallest_p) == (1.0, 0, 1.0)
    assert sign_flip_test([0] * 17, mid_p=True).p_value == 1.0
    assert signed_rank_test([0] * 17, ZeroHandling.DROPPED).p_value == 1.0


def test_one_pair_shows_nothing() -> None:
    assert sign_flip_test([4]).p_value == 1.0


def test_no_p_is_smaller_than_the_pairs_that_differ_allow() -> None:
    tested = sign_flip_test([1] * 5 + [0] * 12)
    assert tested.p_value == tested.smallest_p == 2 * 0.5**5


@pytest.mark.parametrize(("bad", "words"), [([0.5, 1.0], "whole numbers"), ([], "at least one")])
def test_what_cannot_be_enumerated_is_refused(bad: list[float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        sign_flip_test(bad)

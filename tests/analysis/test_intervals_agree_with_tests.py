"""Where an exact test gives p, the 95 % interval beside it excludes "no difference" exactly where p < 5 %."""

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evenlight.analysis.comparison.comparison_shares import Choices, estimate_share
from evenlight.analysis.inference.exact_intervals import joined, sign_flip_interval
from evenlight.analysis.inference.exact_tests import sign_flip_test, sign_test
from evenlight.analysis.inference.paired_effects import exact_mean_difference, superiority
from evenlight.analysis.rating.rating_pairs import MEAN, SUPERIORITY, Sample, compared_pairs
from evenlight.analysis.search.search_pairs import SearchPairs, detections

ratings = st.lists(st.integers(-4, 4), min_size=1, max_size=20)
answered = st.lists(
    st.integers(1, 6).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), min_size=2, max_size=20
)


def excludes(low: float | None, high: float | None, null: float) -> bool:
    """Whether an interval, with its ends, lies beside "no difference"; one that is missing does not."""
    return low is not None and high is not None and (low > null or high < null)


def rated(differences: Sequence[int]):
    """What is said of the differences between ratings."""
    return compared_pairs(Sample({f"{k:02d}": Fraction(own) for k, own in enumerate(differences)}))


def compared(answers: Sequence[tuple[int, int]]):
    """What is said of people who chose ours so often, of so many answers."""
    chosen, total = np.array(answers).T
    return estimate_share(Choices(tuple(map(str, range(len(answers)))), chosen, total), 0.15).difference


def searched(one: int, other: int, n: int):
    """What is said of n pairs, in so many of which the ring was found in one version alone."""
    ours, k = np.arange(n) < one, np.arange(n)
    baseline = (k >= one) & (k < one + other)
    nothing = np.zeros(n, np.int64)
    return detections(SearchPairs(k, nothing, ours, baseline, nothing, ours & False, nothing / 1.0, 0))


def agrees_of_ratings(differences: Sequence[int], step: float = 1.0) -> None:
    scores = np.array(differences)
    mean, better = exact_mean_difference(scores, step), superiority(scores)
    assert excludes(mean.ci_low, mean.ci_high, 0) == (sign_flip_test(scores).p_value < 0.05)
    assert excludes(better.ci_low, better.ci_high, 0.5) == (sign_test(scores).p_value < 0.05)


@pytest.mark.parametrize(
    "differences",
    [
        [1] * 5 + [0] * 12,  # p = 1/16, yet Student's interval with pseudo pairs was 0.04 to 0.55
        [1, 1, 1, 1, 1],
        [-1] * 6 + [0] * 3,
        [2] * 17,
        [0] * 17,
    ],
)
def test_a_mean_difference_of_ratings(differences: list[int]) -> None:
    found = rated(differences)
    for what, null in ((MEAN, 0.0), (SUPERIORITY, 0.5)):
        effect = found[what]
        assert effect.p_value is not None
        assert excludes(effect.ci_low, effect.ci_high, null) == (effect.p_value < 0.05)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(ratings, st.sampled_from([1.0, 1 / 2, 1 / 3, 1 / 12]))
def test_any_mean_difference_of_ratings(differences: list[int], step: float) -> None:
    agrees_of_ratings(differences, step)


@pytest.mark.parametrize("n", range(1, 7))
def test_every_mean_difference_of_few_ratings(n: int) -> None:
    for differences in itertools.combinations_with_replacement((-2, -1, 0, 1, 3), n):
        agrees_of_ratings(differences)


@pytest.mark.parametrize("n", [*range(1, 13), 17, 34])
def test_every_share_of_one_answer_each(n: int) -> None:
    for k in range(n + 1):  # 0 of 5: p = 1/16, yet the mid-p interval was 0 to 0.45
        found = compared([(1, 1)] * k + [(0, 1)] * (n - k))
        assert found.p_value == pytest.approx(stats.binomtest(k, n).pvalue)
        assert excludes(found.ci_low, found.ci_high, 0.5) == (found.p_value < 0.05)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(answered)
def test_any_share_of_several_answers_each(answers: list[tuple[int, int]]) -> None:
    found = compared(answers)
    assert excludes(found.ci_low, found.ci_high, 0.5) == (found.p_value < 0.05)


@pytest.mark.parametrize("people", range(2, 9))
def test_every_share_of_few_people_with_two_answers(people: int) -> None:
    for counts in itertools.combinations_with_replacement(range(3), people):
        found = compared([(c, 2) for c in counts])
        assert excludes(found.ci_low, found.ci_high, 0.5) == (found.p_value < 0.05)


@pytest.mark.parametrize("n", [5, 6, 17])
def test_every_difference_of_detections_at_a_location(n: int) -> None:
    for one in range(n + 1):  # 5 and 0 of 17: p = 1/16, yet the interval was 0.02 to 0.51
        for other in range(n + 1 - one):
            found = searched(one, other, n)
            assert excludes(found.ci_low, found.ci_high, 0) == (found.p_value < 0.05)


def not_rejected(scores: np.ndarray, sizes: np.ndarray, delta: Fraction) -> bool:
    """Whether all choices of signs, one by one, leave a ratio of sums unrejected."""
    rest = scores * delta.denominator - sizes * delta.numerator
    signs = np.array(list(itertools.product((-1, 1), repeat=rest.size)))
    return bool(np.mean(np.abs(signs @ rest) >= abs(rest.sum())) > 0.05)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-3, 3), st.integers(1, 4)), min_size=6, max_size=9),
    st.fractions(-4, 4, max_denominator=12),
)
def test_the_interval_holds_exactly_what_the_sign_flip_test_does_not_reject(
    people: list[tuple[int, int]], delta: Fraction
) -> None:
    scores, sizes = np.array(people).T
    low, high = sign_flip_interval(scores, sizes)
    ends = [Fraction(end).limit_denominator(100) for end in (low, high)]
    for tried in (delta, *ends, ends[0] - Fraction(1, 10**6), ends[1] + Fraction(1, 10**6)):
        assert not_rejected(scores, sizes, tried) == (ends[0] <= tried <= ends[1])


def test_six_different_people_have_their_extremes() -> None:
    # 2.5 % of 64 choices is less than two: only "nobody turned" lies beyond, so the least subset mean stays.
    assert sign_flip_interval(np.array([3, -1, 4, 1, 5, 9])) == (-1.0, 9.0)


def test_many_people_have_the_normal_interval() -> None:
    # 1000 differences of ± 1, 530 of them up: 0.06 ± 1.96 / √(1000 + 1.96²), from (d - δ)² = 1.96² (…)/n.
    scores = np.repeat([1, -1], [530, 470])
    z = stats.norm.ppf(0.975)
    root = math.sqrt(1 / (1000 + z**2) - 0.06**2 / (1000 + z**2) + z**2 * 0.06**2 / 1000 / (1000 + z**2))
    assert sign_flip_interval(scores) == pytest.approx((0.06 - z * root, 0.06 + z * root), abs=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("up", range(524, 538))
def test_many_people_have_an_interval_that_agrees_with_the_exact_test(up: int) -> None:
    scores = np.repeat([1, -1], [up, 1000 - up])  # p < 5 % from 532 on; as normal, from 531 on
    assert excludes(*sign_flip_interval(scores), 0) == (stats.binomtest(up, 1000).pvalue < 0.05)
    chosen, total = np.repeat([1, 0], [up, 1000 - up]), np.ones(1000, np.int64)
    assert excludes(*sign_flip_interval(chosen, total, 0.5), 0.5) == (sign_flip_test(scores).p_value < 0.05)


@pytest.mark.parametrize("n", [14, 15])
def test_few_people_are_listed_and_more_are_counted_with_the_same_result(n: int) -> None:
    scores, sizes = np.arange(n) % 5 - 1, 1 + np.arange(n) % 3
    low, high = sign_flip_interval(scores, sizes)
    for end, outwards in ((low, -1), (high, 1)):
        edge = Fraction(end).limit_denominator(100)
        assert not_rejected(scores, sizes, edge)
        assert not not_rejected(scores, sizes, edge + outwards * Fraction(1, 10**4))


@pytest.mark.parametrize("people", [6, 17])
def test_thousands_of_answers_of_few_people_are_quick_and_agree(people: int) -> None:
    chosen = np.array([4000 + 37 * k for k in range(people)])
    chosen[0] = 3000
    total = np.full(people, 8000)
    p_value = sign_flip_test(2 * chosen - total).p_value
    assert excludes(*sign_flip_interval(chosen, total, 0.5), 0.5) == (p_value < 0.05)


def test_a_person_with_nearly_all_answers_leaves_open_all_but_the_side() -> None:
    total = np.array([60_000, *[20] * 19])
    low, high = sign_flip_interval(total // 2 + 5, total, 0.5)  # everybody above one half: p = 2^-19
    assert (low, high) == (pytest.approx(0.5), math.inf)
    assert low > 0.5


def test_thousands_of_people_without_a_difference() -> None:
    assert sign_flip_interval(np.zeros(5000, np.int64)) == (0.0, 0.0)


def test_an_interval_that_is_joined_never_crosses_where_the_exact_one_does_not() -> None:
    assert joined((0.1, 0.2), (-0.3, 0.4)) == (0.1, 0.4)
    assert joined((-0.2, -0.1), (-0.3, 0.4)) == (-0.3, -0.1)
    assert joined((-0.2, 0.1), (0.05, 0.4)) == (-0.2, 0.4)

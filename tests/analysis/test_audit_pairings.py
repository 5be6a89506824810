"""Every pairing of ratings that agrees with two histograms, and the p that they can have."""

from itertools import combinations, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evenlight.analysis.audit.conventions import SCORES
from evenlight.analysis.audit.pairings import (
    DIFFERENCES,
    PairedTest,
    PValueRange,
    Verdict,
    differences_of,
    holm,
    p_ranges,
    paired_p_values,
    reachable_differences,
)

ratings_of_six = st.lists(st.integers(1, 5), min_size=6, max_size=6)


def histogram(values, of=SCORES) -> list[int]:
    return [list(values).count(v) for v in of]


def by_permuting(baseline, ours) -> set[tuple[int, ...]]:
    """Every order of one against the other, written out."""
    return {
        tuple(histogram([o - b for o, b in zip(order, baseline, strict=True)], DIFFERENCES))
        for order in set(permutations(ours))
    }


# 25 pairs of histograms reach every kind of table; each costs 720 permutations.
@settings(max_examples=25, deadline=None)
@given(ratings_of_six, ratings_of_six)
def test_reachable_differences_are_those_of_all_permutations(baseline, ours) -> None:
    found = reachable_differences(np.array([histogram(baseline)]), np.array([histogram(ours)]))
    assert len(np.unique(found, axis=0)) == len(found)
    assert {tuple(row) for row in found.tolist()} == by_permuting(baseline, ours)


def test_several_histograms_give_what_each_pair_gives() -> None:
    firsts, seconds = [[1, 1, 2, 3], [2, 2, 2, 1]], [[3, 4, 4, 5], [1, 5, 5, 5], [2, 2, 2, 2]]
    together = reachable_differences(
        np.array([histogram(v) for v in firsts]), np.array([histogram(v) for v in seconds])
    )
    expected = set().union(*(by_permuting(b, o) for b, o in product(firsts, seconds)))
    assert {tuple(row) for row in together.tolist()} == expected


def test_thirty_one_people_still_fit_and_thirty_two_are_refused() -> None:
    most = np.array([[0, 0, 31, 0, 0]])
    assert reachable_differences(most, most)[0].tolist() == [0, 0, 0, 0, 31, 0, 0, 0, 0]
    with pytest.raises(ValueError, match="at most 31"):
        reachable_differences(np.array([[0, 0, 32, 0, 0]]), np.array([[0, 0, 32, 0, 0]]))
    with pytest.raises(ValueError, match="same number of people"):
        reachable_differences(most, np.array([[0, 0, 30, 0, 0]]))


def test_squares_reach_from_sorted_alike_to_sorted_against_each_other() -> None:
    # Rearrangement inequality: no pairing has a smaller or a larger sum of squared differences.
    baseline, ours = np.array([1, 2, 2, 3, 3, 4, 5, 5]), np.array([2, 2, 3, 4, 4, 4, 5, 5])
    found = reachable_differences(np.array([histogram(baseline)]), np.array([histogram(ours)]))
    squares = found @ DIFFERENCES**2
    assert squares.min() == np.sum((ours - baseline) ** 2)
    assert squares.max() == np.sum((ours - baseline[::-1]) ** 2)
    assert np.unique(found @ DIFFERENCES).tolist() == [ours.sum() - baseline.sum()]


def p_by_all_signs(scores) -> float:
    """The share of choices of signs at least as far from 0, each written out."""
    sums = [abs(np.dot(signs, np.abs(scores))) for signs in product((-1, 1), repeat=len(scores))]
    return float(np.mean(np.array(sums) >= abs(np.sum(scores)) - 1e-9))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(-4, 4), min_size=7, max_size=7))
def test_exact_p_values_are_those_of_all_signs(differences) -> None:
    d = np.array(differences)
    ranked = np.sign(d) * stats.rankdata(np.abs(d))
    kept = d[d != 0]
    expected = {
        PairedTest.SIGN_FLIP: p_by_all_signs(d),
        PairedTest.SIGNED_RANK: p_by_all_signs(ranked),
        PairedTest.SIGNED_RANK_DROPPED: p_by_all_signs(np.sign(kept) * stats.rankdata(np.abs(kept))),
        PairedTest.SIGN: stats.binomtest(int((d > 0).sum()), kept.size).pvalue if kept.size else 1.0,
    }
    for test, p in expected.items():
        assert paired_p_values(d[None, :], test)[0] == pytest.approx(p, abs=1e-12), test


def test_the_t_test_is_scipys() -> None:
    differences = np.array([[0, 1, 1, 2, -1], [-4, 0, 0, 0, 3], [1, 2, 3, 4, 4]])
    expected = stats.ttest_1samp(differences, 0, axis=1).pvalue
    np.testing.assert_allclose(paired_p_values(differences, PairedTest.T), expected, rtol=1e-12)


def test_a_t_test_of_equal_differences_has_no_p_and_does_not_count() -> None:
    assert np.isnan(paired_p_values(np.array([[1, 1, 1], [0, 0, 0]]), PairedTest.T)).all()
    alike, others = [0, 0, 0, 0, 0, 3, 0, 0, 0], [0, 0, 0, 0, 1, 1, 1, 0, 0]
    found = p_ranges(np.array([alike, others]))
    t = stats.ttest_1samp([0, 1, 2], 0).pvalue
    assert found[PairedTest.T] == PValueRange(pytest.approx(t), pytest.approx(t))
    assert found[PairedTest.SIGN_FLIP] == PValueRange(0.25, 0.5)  # 2 / 2³ of three, 2 / 2² of two


def test_ranges_are_the_extremes_over_all_permutations() -> None:
    baseline, ours = [1, 2, 3, 3, 4, 4], [3, 3, 4, 4, 5, 5]
    found = p_ranges(reachable_differences(np.array([histogram(baseline)]), np.array([histogram(ours)])))
    tried = np.array([np.array(order) - baseline for order in set(permutations(ours))])
    for test, p_range in found.items():
        p = paired_p_values(tried, test)
        assert (p_range.low, p_range.high) == pytest.approx((np.nanmin(p), np.nanmax(p))), test


def test_differences_are_counted_out_in_order() -> None:
    counts = np.array([[1, 0, 0, 0, 2, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 0, 4, 0]])
    assert differences_of(counts).tolist() == [[-4, 0, 0, 4], [3, 3, 3, 3]]


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.001, 0.05, Verdict.DIFFERS),  # 5 % exactly is enough, as in every other test
        (0.001, 0.0501, Verdict.OPEN),
        (0.05, 1.0, Verdict.OPEN),
        (0.0501, 1.0, Verdict.NOT_SHOWN),
    ],
)
def test_a_verdict_holds_for_every_pairing(low: float, high: float, verdict: Verdict) -> None:
    assert PValueRange(low, high).verdict is verdict


def holm_by_closed_testing(p_values) -> list[float]:
    """The largest Bonferroni p of all groups of hypotheses that one belongs to (Marcus et al. 1976)."""
    groups = [g for size in range(1, len(p_values) + 1) for g in combinations(range(len(p_values)), size)]
    bonferroni = {g: min(1.0, len(g) * min(p_values[k] for k in g)) for g in groups}
    return [max(p for g, p in bonferroni.items() if k in g) for k in range(len(p_values))]


def test_holm_ranges_are_the_extremes_over_every_choice_within_the_ranges() -> None:
    ranges = [PValueRange(0.002, 0.3), PValueRange(0.01, 0.02), PValueRange(0.04, 0.9)]
    choices = product(*(np.geomspace(r.low, r.high, 7) for r in ranges))
    adjusted = np.array([holm_by_closed_testing(p) for p in choices])
    for k, found in enumerate(holm(ranges)):
        assert (found.low, found.high) == pytest.approx((adjusted[:, k].min(), adjusted[:, k].max()))

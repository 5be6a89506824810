"""The paper's table of ratings: what every pairing says, and what holds over all sequences."""

from itertools import permutations

import numpy as np
import pytest
from scipy import stats

from evenlight.analysis.audit.conventions import SCORES, PrintedMean
from evenlight.analysis.audit.pairings import DIFFERENCES, MAIN_TEST, PairedTest, PValueRange, Verdict
from evenlight.analysis.audit.table_ratings import (
    SequenceRatings,
    correlations,
    participant_totals,
    ratings_behind,
    table_ratings,
)


@pytest.fixture(scope="module")
def table() -> dict[str, SequenceRatings]:
    return {r.sequence: r for r in table_ratings()}


def test_sums_are_fixed_by_the_printed_means(table) -> None:
    # 3.59 · 17 = 61.03, 3.76 · 17 = 63.92, ...; a printed digit is 0.17 of a sum.
    sums = {"library": (61, 64), "gym": (55, 63), "living_room": (65, 71), "basement": (59, 73)}
    for sequence, (baseline, ours) in sums.items():
        r = table[sequence]
        assert np.unique(r.baseline @ SCORES).tolist() == [baseline]
        assert np.unique(r.ours @ SCORES).tolist() == [ours]
        assert r.mean_differences == ((ours - baseline) / 17,)


def test_every_pairing_of_a_row_has_the_extremes_of_the_rearrangement_inequality(table) -> None:
    for r in table.values():
        sides = [[np.repeat(SCORES, h) for h in side] for side in (r.baseline, r.ours)]
        alike = [np.sum((o - b) ** 2) for b in sides[0] for o in sides[1]]
        against = [np.sum((o[::-1] - b) ** 2) for b in sides[0] for o in sides[1]]
        squares = r.differences @ DIFFERENCES**2
        assert (squares.min(), squares.max()) == (min(alike), max(against))


def test_the_t_test_ranges_from_the_smallest_to_the_largest_sum_of_squares(table) -> None:
    # Basement: differences add up to 14. Smallest: 3 zeros and 14 ones, so Σd² = 14.
    d = [0] * 3 + [1] * 14
    assert table["basement"].ranges[PairedTest.T].low == pytest.approx(stats.ttest_1samp(d, 0).pvalue)
    # Any differences that add up to 14, 14 of them of one sign: only 2 of 2^14 choices are as extreme.
    assert table["basement"].ranges[PairedTest.SIGN_FLIP].low == 2 / 2**14


def test_the_verdicts_are_those_that_the_page_tells(table) -> None:
    assert {s: r.ranges[MAIN_TEST].verdict for s, r in table.items()} == {
        "library": Verdict.NOT_SHOWN,
        "gym": Verdict.OPEN,
        "living_room": Verdict.OPEN,
        "basement": Verdict.DIFFERS,
    }
    # The library's three points of difference need at least three people, if no one differs the other way:
    # 2 / 2³. With more of them the p of the mean is larger still.
    assert table["library"].ranges[MAIN_TEST].low == 0.25
    agreeing = (PairedTest.T, PairedTest.SIGNED_RANK)
    assert all(r.ranges[t].verdict is r.ranges[MAIN_TEST].verdict for r in table.values() for t in agreeing)
    assert table["basement"].ranges[PairedTest.SIGN].verdict is Verdict.OPEN


def test_a_t_test_at_the_needed_correlation_has_a_p_of_five_percent(table) -> None:
    # In the living room both standard deviations are known; t of a mean difference at correlation r.
    r = table["living_room"]
    found = correlations(r)
    assert found.needed_low == pytest.approx(found.needed_high)
    first, second = np.repeat(SCORES, r.baseline[0]), np.repeat(SCORES, r.ours[0])
    spreads = first.std(ddof=1), second.std(ddof=1)
    variance = spreads[0] ** 2 + spreads[1] ** 2 - 2 * found.needed_low * spreads[0] * spreads[1]
    t = (second.mean() - first.mean()) / np.sqrt(variance / 17)
    assert 2 * stats.t.sf(t, 16) == pytest.approx(0.05)


def test_unpaired_tests_lie_between_the_ends_of_the_paired_t_test(table) -> None:
    # Unrelated ratings are a pairing of correlation 0, which lies between the extremes.
    for r in table.values():
        welch, exact = r.unpaired
        assert r.ranges[PairedTest.T].low < welch.low <= welch.high < r.ranges[PairedTest.T].high
        assert 0 < exact.low <= exact.high <= 1


def test_numbers_that_no_ratings_have_are_refused_with_what_was_printed() -> None:
    possible, impossible = PrintedMean("4.00", "0.00", 5), PrintedMean("4.50", "0.10", 5)
    with pytest.raises(ValueError, match=r"attic, ours: no 5 ratings .* mean 4\.50 .* error 0\.10"):
        ratings_behind("attic", possible, impossible)


def test_everybody_alike_is_refused_as_no_t_test_has_a_value() -> None:
    with pytest.raises(ValueError, match="all differences are alike"):
        ratings_behind("attic", PrintedMean("3.00", "0.00", 4), PrintedMean("4.00", "0.00", 4))


def small(sequence: str, baseline: list[list[int]], ours: list[list[int]]) -> SequenceRatings:
    """Return ratings of a few people, with several possibilities for each version."""
    sides = [np.array([[v.count(s) for s in SCORES] for v in side]) for side in (baseline, ours)]
    nothing = PValueRange(1.0, 1.0)
    return SequenceRatings(sequence, *sides, np.zeros((0, 9), np.int64), {}, (nothing, nothing))


def test_totals_are_the_extremes_over_all_orders_of_all_possibilities() -> None:
    # 2, 4, 4, 4 and 3, 3, 3, 5 add up to 14, as do 2, 3, 4, 5: the same mean, other totals.
    several = [[2, 3, 4, 5], [2, 4, 4, 4], [3, 3, 3, 5]]
    a, b = small("a", [[1, 2, 4, 5]], [[2, 3, 3, 5]]), small("b", [[2, 2, 3, 5]], several)
    squares = {
        int(np.sum((np.array(x) - np.array([1, 2, 4, 5]) - np.array(y) + np.array(z)) ** 2))
        for x in permutations([2, 3, 3, 5])
        for y in permutations([2, 2, 3, 5])
        for possible in several
        for z in set(permutations(possible))
    }
    totals = participant_totals([a, b], np.random.default_rng(1))
    assert np.sum(totals.least_even**2) == max(squares)
    assert np.sum(totals.most_even**2) == min(squares)
    assert totals.mean == (13 - 12 + 14 - 12) / 4 / 2


@pytest.mark.slow
def test_totals_of_the_paper_are_as_even_as_whole_numbers_can_be(table) -> None:
    totals = participant_totals(list(table.values()), np.random.default_rng(5))
    # Differences of 3, 8, 6 and 14 points: 31 for 17 people, so 14 twos and 3 ones.
    assert totals.bound_met
    assert sorted(totals.most_even.tolist()) == [1] * 3 + [2] * 14
    assert totals.least_even.sum() == 31
    assert totals.p_range(PairedTest.SIGN_FLIP).low == 2 / 2**17
    assert totals.p_range(PairedTest.T).verdict is Verdict.OPEN

"""Claims about pairs of searches: McNemar's test exactly, the stratified Cox model, ties and separation."""

import dataclasses
import math

import numpy as np
import pytest
from made_searches import SearchTruth, made_table
from scipy import stats
from statsmodels.duration.hazard_regression import PHReg
from statsmodels.stats.contingency_tables import mcnemar

from evenlight.analysis.inference.fixed_effects import student_effect
from evenlight.analysis.search.search_pairs import (
    SearchFlag,
    SearchPairs,
    detection_change,
    detections,
    difference_interval,
    exchanged,
    hazard_ratio,
    matched_pairs,
    mcnemar_p,
)
from evenlight.analysis.search.search_trials import SearchTable

CELLS = [(one, other) for one in range(18) for other in range(18 - one)]  # of 17 pairs


def table(seed: int = 1, **truth: float) -> SearchTable:
    settings = {"participants": 9, "locations": 6, "middle": 15.0, **truth}
    return made_table(SearchTruth(**settings), np.random.default_rng(seed))


def pairs_of(first: list[int], people: list[int], later: list[int]) -> SearchPairs:
    """Pairs in which both rings were found, but for those where it is not known which came first."""
    known = np.array(first) != 0
    return SearchPairs(
        np.array(people),
        np.zeros(len(first), np.int64),
        known,
        known,
        np.array(first),
        np.zeros(len(first), bool),
        np.array(later, dtype=float),
        0,
    )


def two_trials(ours: tuple[float, bool], baseline: tuple[float, bool]) -> SearchPairs:
    """One person's pair at one location, from time and success of either search."""
    every = table()
    pair = every.some((every.participant == 0) & (every.location == 0))
    times = np.where(pair.ours, ours[0], baseline[0])
    found = np.where(pair.ours, ours[1], baseline[1])
    return matched_pairs(dataclasses.replace(pair, times=times, found=found))


@pytest.mark.parametrize(
    ("ours", "baseline", "first", "tied"),
    [
        ((3.0, True), (5.0, True), 1, False),
        ((5.0, True), (3.0, True), -1, False),
        ((5.0, True), (30.0, False), 1, False),
        ((30.0, True), (30.0, False), 1, False),  # at the last moment, but found
        ((25.0, True), (20.0, False), 0, False),  # the other was given up before
        ((30.0, False), (30.0, False), 0, False),
        ((5.0, True), (5.0, True), 0, True),
    ],
)
def test_it_is_known_which_was_found_first(
    ours: tuple[float, bool], baseline: tuple[float, bool], first: int, tied: bool
) -> None:
    pair = two_trials(ours, baseline)
    assert (pair.first.tolist(), pair.tied.tolist()) == ([first], [tied])


def test_a_search_without_partner_is_counted_and_left_out() -> None:
    every = table()
    pairs = matched_pairs(every.some(np.arange(every.times.size) != 7))
    assert pairs.unpaired == 1
    assert pairs.first.size == 9 * 6 - 1


@pytest.mark.parametrize("seed", range(3))
def test_the_hazard_ratio_is_that_of_the_cox_model_stratified_by_person_and_location(seed: int) -> None:
    data = table(seed, version=-0.4)
    strata = data.participant * len(data.locations) + data.location
    design = np.column_stack([data.ours, data.visit])
    cox = PHReg(data.times, design, status=data.found.astype(int), strata=strata).fit()
    assert hazard_ratio(matched_pairs(data)).estimate == pytest.approx(cox.params[0], abs=1e-5)


def test_with_two_orders_it_is_the_mean_of_two_log_odds() -> None:
    # Ours at the later visit: first in 6 of 8 pairs; at the earlier one: in 3 of 4.
    first, later = [1] * 6 + [-1] * 2 + [1] * 3 + [-1], [1] * 8 + [-1] * 4
    found = hazard_ratio(pairs_of(first, list(range(12)), later))
    assert found.estimate == pytest.approx((math.log(6 / 2) + math.log(3 / 1)) / 2)


def test_of_independent_pairs_the_standard_error_is_the_binomial_one() -> None:
    # Without a covariate: variance of the log-odds 1/9 + 1/5; sandwich over 14 people: 14 / 13 of it.
    found = hazard_ratio(pairs_of([1] * 9 + [-1] * 5, list(range(14)), [0] * 14))
    assert found.standard_error == pytest.approx(math.sqrt((1 / 9 + 1 / 5) * 14 / 13))
    assert found.ci_high is not None
    assert found.estimate is not None
    half = stats.t.ppf(0.975, 13) * found.standard_error
    assert found.ci_high - found.estimate == pytest.approx(half)


def test_pairs_of_one_person_count_together() -> None:
    # Each person's pairs always go the same way: 12 times as many pairs say no more.
    people, first = list(range(10)), [1] * 6 + [-1] * 4
    few = hazard_ratio(pairs_of(first, people, [0] * 10))
    many = hazard_ratio(pairs_of(first * 12, people * 12, [0] * 120))
    assert many.standard_error == pytest.approx(few.standard_error, rel=0.06)


def test_people_who_are_alike_by_chance_leave_an_interval() -> None:
    # Each of eight people: ours first at 3 of 4 locations. Independent pairs: 1/24 + 1/8.
    found = hazard_ratio(pairs_of([1, 1, 1, -1] * 8, np.repeat(range(8), 4).tolist(), [0] * 32))
    assert found.standard_error == pytest.approx(math.sqrt(1 / 24 + 1 / 8))
    assert found.ci_low is not None
    assert found.ci_high is not None
    assert found.ci_low < (found.estimate or 0.0) < found.ci_high


def test_interval_and_p_of_a_hazard_ratio_agree() -> None:
    for ours in range(4, 14):
        found = hazard_ratio(pairs_of([1] * ours + [-1] * (17 - ours), list(range(17)), [0] * 17))
        assert found.ci_low is not None
        assert found.ci_high is not None
        assert found.p_value is not None
        assert (found.p_value <= 0.05) == (not found.ci_low <= 0 <= found.ci_high)


def test_a_difference_of_shares_without_a_pair_that_differs_has_no_interval() -> None:
    change = detection_change(pairs_of([1, -1] * 4, [0, 0, 1, 1, 2, 2, 3, 3], [0] * 8))
    assert (change.value, change.ci_low, change.ci_high, change.p_value) == (0.0, None, None, None)
    assert "in no pair" in change.flag


def test_one_pair_that_differs_does_not_pass_for_certainty() -> None:
    # One ring of 68 is lost in the baseline alone: independent pairs leave the difference open.
    found = np.ones(68, bool)
    pairs = pairs_of([1] * 68, np.repeat(range(17), 4).tolist(), [0] * 68)
    change = detection_change(dataclasses.replace(pairs, found_ours=found, found_baseline=np.arange(68) > 0))
    assert change.ci_high is not None
    half = stats.t.ppf(0.975, 16) * math.sqrt(2 / 70 + 1 / 70 - (1 / 70) ** 2) / math.sqrt(70)
    assert change.ci_high == pytest.approx(1 / 68 + half)


def test_ties_say_nothing_and_are_counted() -> None:
    first, people = [1, 1, 1, -1, 1, -1], [0, 1, 2, 3, 4, 5]
    without = pairs_of(first, people, [0] * 6)
    tied = pairs_of([*first, 0, 0], [*people, 6, 7], [0] * 8)
    tied = dataclasses.replace(tied, tied=np.array([False] * 6 + [True] * 2))
    assert tied.counts["both after the same time (left out)"] == 2
    assert hazard_ratio(tied).estimate == hazard_ratio(without).estimate
    assert hazard_ratio(tied).standard_error == hazard_ratio(without).standard_error


@pytest.mark.parametrize(("first", "flag"), [(1, SearchFlag.OURS_FIRST), (-1, SearchFlag.BASELINE_FIRST)])
def test_separation_is_a_flag_and_no_number(first: int, flag: SearchFlag) -> None:
    pairs = pairs_of([first] * 17, list(range(17)), [1, -1] * 8 + [1])
    found = hazard_ratio(pairs)
    assert (found.estimate, found.ci_low) == (None, None)
    assert found.flags == (flag,)
    assert exchanged(pairs, pairs.first).p_value == pytest.approx(2.0**-16)  # 2 of 2^17 choices of signs


def test_nothing_known_is_a_flag_and_no_number() -> None:
    pairs = pairs_of([0] * 4, [0, 0, 1, 1], [1, -1, 1, -1])
    found = hazard_ratio(pairs)
    assert found.estimate is None
    assert found.flags == (SearchFlag.NO_FIRST,)
    assert exchanged(pairs, pairs.first).p_value == 1.0


def test_an_order_that_separates_is_left_out_of_the_model_instead_of_running_to_infinity() -> None:
    # Whatever came later was found first: no finite effect of the visit, and none of the version beside it.
    first, later = [1] * 5 + [-1] * 5, [1] * 5 + [-1] * 5
    assert hazard_ratio(pairs_of(first, list(range(10)), later)).estimate == pytest.approx(0.0, abs=1e-8)


def test_one_person_has_an_interval_of_that_person_and_a_flag() -> None:
    found = hazard_ratio(pairs_of([1, 1, 1, -1], [0] * 4, [0] * 4))
    assert found.flags == (SearchFlag.ONE_PERSON,)
    assert found.standard_error == pytest.approx(math.sqrt(1 / 3 + 1))
    change = detection_change(pairs_of([1, 1, 1, -1], [0] * 4, [0] * 4))
    assert (change.ci_low, change.ci_high) == (None, None)


def test_an_end_of_a_ratio_beyond_a_million_is_none_and_said() -> None:
    # As of two people with ours first in 3 of 4 pairs: ln 3 ± 12.7 √(1/3 + 1), to seven millions.
    found = student_effect("ours", math.log(3), math.sqrt(4 / 3), 1).shown(math.exp)
    assert found.value == pytest.approx(3.0)
    assert found.ci_low == pytest.approx(3.0 * math.exp(-stats.t.ppf(0.975, 1) * math.sqrt(4 / 3)))
    assert found.ci_high is None
    assert found.flag == "the interval has no upper end"


def test_the_exact_test_exchanges_whole_people() -> None:
    # Three people with sums 2, 2 and 2: 2 of 8 choices of signs are as extreme, however many pairs there are.
    pairs = pairs_of([1] * 6, [0, 0, 1, 1, 2, 2], [1, -1] * 3)
    assert exchanged(pairs, pairs.first).p_value == 0.25


@pytest.mark.parametrize(("one", "other"), [(0, 0), (3, 9), (0, 5), (8, 8)])
def test_mcnemars_test_is_that_of_statsmodels(one: int, other: int) -> None:
    theirs = mcnemar([[4, one], [other, 7]], exact=True).pvalue
    assert mcnemar_p(one, other) == pytest.approx(min(theirs, 1.0))


@pytest.mark.slow
def test_mcnemars_test_rejects_at_most_5_percent_exactly() -> None:
    # All divisions of 17 pairs, at each chance of a discordant pair: it is exact given their number.
    sizes = []
    for discordant in np.linspace(0.05, 1.0, 20):
        chances = probabilities(discordant / 2, discordant / 2)
        sizes.append(sum(p for p, cell in zip(chances, CELLS, strict=True) if mcnemar_p(*cell) <= 0.05))
    assert max(sizes) <= 0.05
    assert max(sizes) > 0.02  # and is not one that never rejects


def probabilities(one: float, other: float) -> np.ndarray:
    """Of all divisions of 17 pairs."""
    rest = 1 - one - other
    return np.array([stats.multinomial.pmf([a, b, 17 - a - b], 17, [one, other, rest]) for a, b in CELLS])


@pytest.mark.parametrize(
    ("one", "other"), [(0.15, 0.15), (0.2, 0.2), (0.3, 0.3), (0.1, 0.3), (0.05, 0.4), (0.0, 0.25)]
)
def test_the_interval_of_a_difference_of_shares_holds_it_in_92_to_98_percent_exactly(
    one: float, other: float
) -> None:
    # With less than 15 % to either side nearly all of 17 pairs agree, and every interval holds more often.
    held = [low <= one - other <= high for low, high in (difference_interval(17, *cell) for cell in CELLS)]
    assert 0.92 <= float(probabilities(one, other) @ held) <= 0.98


def test_the_difference_of_the_shares_found_is_that_of_the_pairs() -> None:
    pairs = dataclasses.replace(
        pairs_of([1, 1, -1, 0, 0], [0, 1, 2, 3, 4], [0] * 5),
        found_ours=np.array([True, True, False, True, False]),
        found_baseline=np.array([False, False, True, True, False]),
    )
    found = detections(pairs)
    assert pairs.more.tolist() == [1, 1, -1, 0, 0]
    assert (found.value, found.p_value) == (0.2, 1.0)  # 2 of 3
    assert detection_change(pairs).value == pytest.approx(0.2)

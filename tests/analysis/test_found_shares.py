"""The interval of the share found is of people, not of their searches: by hand, and by its coverage."""

import numpy as np
import pytest
from found_share_coverage import coverage
from made_searches import SearchTruth, made_table, task_data, trials_of

from evenlight.analysis.search.search_numbers import study_of
from evenlight.analysis.search.search_pairs import clustered_share, found_over_time


@pytest.mark.parametrize("people", [2, 5, 17])
@pytest.mark.parametrize("searches", [1, 4, 42])
def test_where_nobody_found_anything_the_interval_is_that_of_people(people: int, searches: int) -> None:
    who = np.repeat(np.arange(people), searches)
    nobody, everybody = (clustered_share(np.full(who.size, found), who) for found in (False, True))
    assert (nobody.value, nobody.ci_low) == (0.0, 0.0)
    assert nobody.ci_high == pytest.approx(1 - 0.025 ** (1 / people))
    assert (everybody.ci_low, everybody.ci_high) == (pytest.approx(0.025 ** (1 / people)), 1.0)


def test_the_table_says_so_of_four_people_who_found_nothing() -> None:
    table = made_table(SearchTruth(participants=4, locations=3, middle=1e6), np.random.default_rng(1))
    rows = study_of(task_data(trials_of(table)))[0].rows
    (row,) = [r for r in rows if (r.table, r.what) == ("detections", "rings found, ours")]
    assert (row.value, row.n) == (0.0, 12)
    assert row.ci_high == pytest.approx(1 - 0.025**0.25)  # 0.60; of 12 independent searches it would be 0.26


def test_one_ring_found_does_not_narrow_the_interval_to_that_of_searches() -> None:
    who = np.repeat(np.arange(17), 21)
    one = clustered_share(np.arange(who.size) == 0, who)
    assert one.ci_high is not None
    assert one.ci_high > 0.05  # 357 independent searches would leave 0.016


def test_nothing_is_found_before_the_search_begins() -> None:
    times, shares = found_over_time(made_table(SearchTruth(), np.random.default_rng(3)), limit=30.0)
    assert (times[0], times[-1], *shares[:, 0]) == (0.0, 30.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("people", [2, 5, 10, 17])
@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.97])
@pytest.mark.parametrize("share", [0.01, 0.05, 0.5, 0.95])
def test_the_interval_holds_the_share_of_people_who_are_alike_or_not(
    people: int, correlation: float, share: float
) -> None:
    # 300 sets: a coverage of 94 % falls below 88 % in one of ten thousand such studies.
    held, _ = coverage(people, correlation, share, 300)
    assert held >= 0.88

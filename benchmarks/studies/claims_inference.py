"""The primary tests keep their level, and the intervals hold the truth: a short form of `inference_levels`.

Bounds are those that a level of 5 %, or a coverage of 95 %, passes in all but one of ten thousand studies.
`rates` also fails where the report prints other numbers than were counted.
"""

import itertools

import pytest
from inference_levels import FOUND, TASKS, populations, rates
from scipy import stats

SETS = 40
# Of the many people who tell what is true: a ninth tells it three times as roughly, to 0.015 of a rating and
# 0.01 of a share, a tenth of what eight people leave open at most: a coverage of 95 % stays above 94 %.
MANY = 1 / 9
FITTED = 16  # of the search, whose model takes a while; without an effect only


def most(sets: int) -> float:
    """Largest share of errors that a true one of 5 % gives."""
    return float(stats.binom.ppf(1 - 1e-4, sets, 0.05)) / sets


@pytest.mark.parametrize("task", TASKS)
def test_the_primary_tests_err_in_5_percent_and_their_intervals_agree(task: str) -> None:
    every, sets = populations([task], MANY), SETS
    if task == "search":
        every, sets = itertools.islice(every, 1), FITTED
    for population in every:
        for question, found in rates(population, 8, sets).items():
            assert found.held >= 1 - most(sets), (population.name, question)
            assert found.contradictions == 0
            if population.effect == 0 and question != FOUND:
                assert found.rejected <= most(sets), question


def test_an_effect_is_found() -> None:
    """Else a test that never rejects would pass."""
    (_, some, _) = populations(["comparison"])
    assert rates(some, 17, SETS)["all"].rejected > 0.3  # 0.65 ± 0.08 of 1000 sets

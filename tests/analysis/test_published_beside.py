"""The paper's numbers beside ours: what agreement can show, and when a number is met."""

import pytest

from evenlight.analysis.reproduction.published_beside import (
    CHOSEN,
    DIFFERENCE,
    LAG_RATIO,
    SLOPE,
    Dependence,
    key_figures,
    mark,
    marked,
    meets,
    pairs,
)
from evenlight.data_schema.analysis_results import Origin, Statistic


def row(what: str, value: float | None, origin: Origin, ends=(None, None), group: str = "gym") -> Statistic:
    return Statistic("t", group, what, value, "1", origin, *ends, None if ends[0] is None else 0.95)


def test_answers_of_people_are_independent_and_those_of_simulated_people_circular() -> None:
    for what in (DIFFERENCE, CHOSEN, SLOPE):
        assert mark(what, Origin.RECORDED, drawn=True)[0] is Dependence.INDEPENDENT
        assert mark(what, Origin.SIMULATED, drawn=True)[0] is Dependence.CIRCULAR


def test_a_recorded_rate_limit_is_not_the_papers() -> None:
    assert mark(LAG_RATIO, Origin.COMPUTED, drawn=True) == (Dependence.PARTLY, "budgets and rate limit")
    assert mark(LAG_RATIO, Origin.COMPUTED, drawn=False) == (Dependence.PARTLY, "budgets")


def test_a_flag_says_what_makes_a_number_before_what_else_is_to_be_said() -> None:
    own = marked(row(LAG_RATIO, 1.1, Origin.COMPUTED), drawn=False)
    assert own.flag == "partly determined: budgets"
    assert marked(row(CHOSEN, 0.5, Origin.RECORDED), drawn=True).flag == ""


@pytest.mark.parametrize(
    ("ours", "met"),
    [
        (row(CHOSEN, 0.474, Origin.SIMULATED), True),  # printed 47 %, so 46.5 to 47.5 %
        (row(CHOSEN, 0.48, Origin.SIMULATED), False),
        (row(CHOSEN, 0.6, Origin.SIMULATED, (0.4, 0.8)), True),
        (row(CHOSEN, 0.6, Origin.SIMULATED, (0.5, 0.8)), False),
    ],
)
def test_a_number_is_met_within_our_interval_or_its_rounding(ours: Statistic, met: bool) -> None:
    assert meets(row(CHOSEN, 0.47, Origin.PUBLISHED), ours) is met


def test_each_printed_number_is_held_against_ours_of_the_same_sequence() -> None:
    rows = [
        row(CHOSEN, 0.47, Origin.PUBLISHED), row(CHOSEN, 0.53, Origin.PUBLISHED, group="attic"),
        row(SLOPE, 0.26, Origin.AUTHORS), row("rate limit", 0.3, Origin.RECORDED),
        row(CHOSEN, 0.47, Origin.SIMULATED), row("mean rating, ours", 3.7, Origin.PUBLISHED),
    ]  # fmt: skip
    assert [(theirs.value, ours.value) for theirs, ours in pairs(rows)] == [(0.47, 0.47), (0.26, 0.3)]
    met, independent = key_figures([rows], drawn=False)
    assert (met.value, met.beside) == ("1 of 2", "0 of 1 independent, 1 of 1 circular")
    assert independent.value == "1 of 2"

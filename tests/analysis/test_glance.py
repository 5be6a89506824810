"""The table at a glance: what agreement of a printed number and ours can show."""

import pytest

from evenlight.analysis.reproduction.glance import Dependence, GlanceLine
from evenlight.data_schema.analysis_results import Origin, Statistic


def number(value: float, low: float | None = None, high: float | None = None) -> Statistic:
    return Statistic(
        "t", "gym", "gain", value, "1", Origin.RECORDED, low, high, None if low is None else 0.95
    )


def line(theirs: Statistic, ours: Statistic | None, dependence: Dependence, none: float | None) -> GlanceLine:
    return GlanceLine("Table 1", theirs, ours, dependence, "by that", none)


@pytest.mark.parametrize(
    ("ours", "sign"),
    [(number(0.2), "same"), (number(-0.2), "opposite"), (number(0.2, 0.1, 0.3), "same"),
     (number(0.2, -0.1, 0.5), "same, unclear"), (number(-0.2, -0.5, 0.1), "opposite, unclear"), (None, None)],
)  # fmt: skip
def test_the_sign_is_that_of_the_effect_and_unclear_where_the_interval_has_both(
    ours: Statistic | None, sign: str | None
) -> None:
    for dependence in (Dependence.INDEPENDENT, Dependence.PARTLY):
        assert line(number(0.5), ours, dependence, 0.0).sign == sign


def test_a_circular_number_and_one_without_a_side_have_no_sign() -> None:
    assert line(number(0.5), number(0.4), Dependence.CIRCULAR, 0.0).sign is None
    assert line(number(0.5), number(0.4), Dependence.INDEPENDENT, None).sign is None


def test_a_ratio_that_is_one_to_the_digits_shown_is_no_agreement() -> None:
    assert line(number(1.75), number(1.0003), Dependence.PARTLY, 1.0).sign == "no difference"
    assert line(number(1.75), number(1.06), Dependence.PARTLY, 1.0).sign == "same"


@pytest.mark.parametrize("value", [0.988, 1.03])
def test_a_number_without_interval_near_no_effect_has_no_sign(value: float) -> None:
    assert line(number(1.75), number(value), Dependence.PARTLY, 1.0).sign == "unclear"
    # With an interval, the interval tells.
    held = number(value, value - 0.005, value + 0.005)
    assert line(number(1.75), held, Dependence.PARTLY, 1.0).sign == ("same" if value > 1 else "opposite")

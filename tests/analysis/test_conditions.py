"""Directions and durations: their effects are ratios, and the rate limit is that of one of them."""

from dataclasses import replace

import numpy as np
import pytest
from example_ramps import THRESHOLD

from evenlight.analysis.calibration.rate_limit.conditions import Condition, ConditionEffect
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_thresholds
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at

DISPLAY = Display("bench", 104.4, 0.2, 1.95, 72.28)
LEVELS = (10.0, 20.0, 40.0, 70.0, 100.0)
LINE = RateLimitOptions(RateLimitForm.LOG_LOG, degree=1)
FIVE, TEN = Condition(Direction.DOWN, 5.0), Condition(Direction.DOWN, 10.0)
RISING = Condition(Direction.UP, 5.0)
Ratios = dict[Condition, float]


def thresholds(
    ratios: Ratios,
    people: int = 8,
    levels: tuple[float, ...] = LEVELS,
    rng: np.random.Generator | None = None,
    personal: float = 0.0,
) -> list[Threshold]:
    """Participants who notice 3 %/s of any luminance, times their own factor and that of the condition.

    With a generator, each threshold has its standard error of 0.15, and each participant's ratios scatter by
    `personal`.
    """
    rows = []
    for p in range(people):
        own = np.exp(0.3 * (p - (people - 1) / 2) / people)
        for condition, ratio in ratios.items():
            mine = np.exp(personal * rng.standard_normal()) if rng else 1.0
            for L in levels:
                rate = 0.03 * L * own * ratio * mine * (np.exp(0.15 * rng.standard_normal()) if rng else 1)
                rows.append(row(f"{p:02d}", L, float(rate), condition))
    return rows


def row(
    who: str, L: float, rate: float, condition: Condition, task: Procedure = Procedure.YES_NO
) -> Threshold:
    return replace(
        THRESHOLD, participant_id=who, luminance=L, threshold=rate, ci_low=rate * 0.75, ci_high=rate * 1.34,
        standard_error_ln=0.15, direction=condition.direction, ramp_duration=condition.ramp_duration,
        procedure=task,
    )  # fmt: skip


@pytest.mark.parametrize("form", [RateLimitForm.LOG_LOG, RateLimitForm.RATE])
def test_exact_ratios_are_recovered_and_the_curve_is_that_of_the_lowest_condition(
    form: RateLimitForm,
) -> None:
    # Of a limit on amount: ten seconds have half the rate of five. Rising ramps need 1.3 times the rate.
    options = RateLimitOptions(form, degree=1)
    fit = fit_thresholds(thresholds({FIVE: 1.0, TEN: 0.5, RISING: 1.3}), DISPLAY, options)
    assert fit.reference == TEN
    assert {effect.condition: effect.ratio for effect in fit.effects} == pytest.approx(
        {FIVE: 2.0, RISING: 2.6}
    )
    assert [effect.ratio_of_equal_amounts for effect in fit.effects] == [2.0, 2.0]
    expected = [0.015 * L for L in LEVELS]
    # On the rate's own scale the known errors are shares of the rate, so that low thresholds weigh more: with
    # an SD of 0.09 between people (weights e^{-2u}), less than 2 % below the geometric mean.
    assert rate_limit_at(fit.limit, LEVELS).tolist() == pytest.approx(expected, rel=0.02)
    assert set(np.round(fit.limit.point_rate, 9)) <= {round(t.threshold, 9) for t in thresholds({TEN: 0.5})}


def test_the_reference_can_be_chosen_and_is_said() -> None:
    rows = thresholds({FIVE: 1.0, TEN: 0.5, RISING: 1.3})
    lowest = fit_thresholds(rows, DISPLAY, LINE)
    assert "The limit is that of falling ramps of 10 s, whose thresholds are the lowest" in lowest.notes[0]
    rising = fit_thresholds(rows, DISPLAY, RateLimitOptions(RateLimitForm.LOG_LOG, 1, direction=Direction.UP))
    assert rising.reference == RISING
    assert "rising ramps of 5 s, as was asked for" in rising.notes[0]
    five = fit_thresholds(rows, DISPLAY, RateLimitOptions(RateLimitForm.LOG_LOG, 1, ramp_duration=5.0))
    assert five.reference == FIVE  # lower than the rising ramps of 5 s
    words = next(effect.in_words for effect in five.effects if effect.condition == TEN)
    assert words.startswith("falling ramps of 10 s have 0.50 x the threshold rate of falling ramps of 5 s (")
    assert words.endswith("1.00 would be a limit on the rate, 0.50 one on the amount of change")


def test_one_condition_has_no_effects_and_nothing_to_say_of_them() -> None:
    fit = fit_thresholds(thresholds({FIVE: 1.0}), DISPLAY, LINE)
    assert fit.reference == FIVE
    assert fit.effects == ()
    assert not any("The limit is that of" in note for note in fit.notes)


@pytest.mark.slow
@pytest.mark.parametrize("personal", [0.0, 0.3])
def test_the_interval_of_a_ratio_holds_the_truth_even_if_people_differ_in_it(personal: float) -> None:
    # 60 experiments of 8 people: 95 % show as 86 to 100 % in 999 of 1000 studies.
    rng = np.random.default_rng(6)
    inside = []
    for _ in range(60):
        rows = thresholds({FIVE: 1.0, TEN: 0.7}, rng=rng, personal=personal)
        fit = fit_thresholds(rows, DISPLAY, RateLimitOptions(RateLimitForm.LOG_LOG, 1, ramp_duration=5.0))
        inside.append(fit.effects[0].ci_low <= 0.7 <= fit.effects[0].ci_high)
    assert np.mean(inside) >= 0.86


def test_a_condition_that_is_not_there_is_named_with_those_that_are() -> None:
    options = RateLimitOptions(RateLimitForm.LOG_LOG, 1, direction=Direction.UP, ramp_duration=20.0)
    for rows in (thresholds({FIVE: 1.0}), thresholds({FIVE: 1.0, TEN: 0.5})):
        with pytest.raises(
            InputError, match=r"no usable threshold of rising ramps of 20 s; there are falling"
        ) as e:
            fit_thresholds(rows, DISPLAY, options)
        assert "\n" not in str(e.value)


def test_conditions_that_share_no_luminance_cannot_be_told_from_the_curve() -> None:
    rows = thresholds({FIVE: 1.0}, levels=LEVELS[:2]) + thresholds({TEN: 0.5}, levels=LEVELS[2:])
    with pytest.raises(InputError, match="cannot be separated from the curve's shape"):
        fit_thresholds(rows, DISPLAY, RateLimitOptions(degree=4))


def test_an_interval_wider_than_a_ratio_of_100_is_no_interval() -> None:
    assert "(0.50 to 2.00)" in ConditionEffect(FIVE, TEN, 1.0, 0.5, 2.0).in_words
    assert "(not bounded)" in ConditionEffect(FIVE, TEN, 1.0, 1e-10, 5e21).in_words

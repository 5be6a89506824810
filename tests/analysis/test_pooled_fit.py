"""The pooled fit of the paper, and what it does to participants who differ."""

import math

import numpy as np
import pytest

from evenlight.analysis.calibration.level_estimates import logistic_threshold
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.method.psychometric import PsychometricFunction, yes_probability

RATES = np.geomspace(0.5, 16.0, 11)


def expected_answers(functions: list[PsychometricFunction], n: int = 10_000) -> RampCounts:
    """As many answers "yes" as the functions give on average: no chance in it."""
    mean = np.mean([yes_probability(RATES, function) for function in functions], axis=0)
    return RampCounts(RATES, np.round(mean * n).astype(np.int64), np.full(RATES.size, n))


def test_a_logistic_function_without_asymptotes_is_recovered() -> None:
    counts = expected_answers([PsychometricFunction(3.0, 1.6)])
    assert logistic_threshold(counts) == pytest.approx(3.0, rel=1e-3)


def test_pooling_participants_who_differ_moves_the_75_percent_point_up() -> None:
    # Thresholds e^{±0.4} about 3: pooled, the mean of two logistic functions crosses 75 % where
    # (ψ1 + ψ2)/2 = 0.75 (bisection), above 3. A logistic function through that mixture cannot follow its
    # flanks, and comes to lie between the participants' 3 and the mixture's crossing.
    people = [PsychometricFunction(3.0 * math.exp(d), 1.6) for d in (-0.4, 0.4)]
    low, high = 3.0, 6.0
    for _ in range(60):
        middle = (low + high) / 2
        mean = np.mean([yes_probability(middle, person) for person in people])
        low, high = (middle, high) if mean < 0.75 else (low, middle)
    assert low > 1.05 * 3.0
    found = logistic_threshold(expected_answers(people))
    assert found is not None
    assert 1.05 * 3.0 < found < low


@pytest.mark.parametrize("yes", [0, 4])
def test_answers_that_are_all_alike_have_no_most_likely_threshold(yes: int) -> None:
    counts = RampCounts(RATES, np.full(RATES.size, yes), np.full(RATES.size, 4))
    assert logistic_threshold(counts) is None


def test_separated_answers_put_the_threshold_into_the_gap() -> None:
    counts = RampCounts(RATES, np.where(RATES > 3.0, 4, 0), np.full(RATES.size, 4))
    found = logistic_threshold(counts)
    assert found is not None
    assert RATES[RATES < 3].max() < found < RATES[RATES > 3].min()

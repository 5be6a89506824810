"""Signal detection: d′, criterion and bias from answers, by hand and as published."""

import math
from dataclasses import replace

import pytest
from example_ramps import CHOICE
from scipy import special

from evenlight.analysis.calibration.psychometric.signal_detection import (
    TWO_INTERVAL_D_PRIME,
    criterion_of,
    interval_bias_of,
    interval_biases,
    rate_of_d_prime,
)
from evenlight.data_schema.recordings.ramp import RampTrial, Response
from evenlight.method.psychometric import PsychometricFunction, yes_probability


def choices(first_of_first: int, first_of_second: int, n: int) -> list[RampTrial]:
    """Answers "first" to so many of n ramps in the first interval, and of n in the second."""
    return [
        replace(CHOICE, ramp_interval=ramp, response=Response.FIRST if i < said else Response.SECOND)
        for ramp, said in ((1, first_of_first), (2, first_of_second))
        for i in range(n)
    ]


def test_75_percent_right_of_two_intervals_is_a_d_prime_of_0_954() -> None:
    assert pytest.approx(0.954, abs=5e-4) == TWO_INTERVAL_D_PRIME


@pytest.mark.parametrize(
    ("false_alarms", "d_prime"),
    [(0.01, 3.00), (0.02, 2.73), (0.05, 2.32), (0.10, 1.96), (0.20, 1.52), (0.30, 1.20), (0.50, 0.67)],
)
def test_the_d_prime_of_75_percent_yes_falls_with_the_false_alarms(
    false_alarms: float, d_prime: float
) -> None:
    # z(0.75) - z(FA); a million catch trials make the log-linear correction vanish.
    n = 1_000_000
    assert criterion_of(round(false_alarms * n), n).d_prime_at_threshold == pytest.approx(d_prime, abs=0.006)


def test_who_prefers_neither_interval_has_no_bias() -> None:
    bias = interval_bias_of(choices(15, 5, 20))
    assert bias.bias == pytest.approx(0.0, abs=1e-12)
    assert bias.first_share == 0.5


def test_who_leans_to_the_first_interval_has_a_bias_above_0() -> None:
    # P("second" | second) = 10.5/21 = 0.5, P("second" | first) = 1.5/21: c = -(0 + z(1/14)) / 2.
    bias = interval_bias_of(choices(19, 10, 20))
    assert bias.bias == pytest.approx(-special.ndtri(1.5 / 21) / 2)
    assert bias.first_share == 29 / 40


def test_a_participant_who_always_says_first_has_a_finite_bias() -> None:
    bias = interval_bias_of(choices(20, 20, 20))
    assert bias.bias == pytest.approx(-special.ndtri(0.5 / 21))
    assert interval_biases([]) == {}


def test_ramps_in_one_interval_only_still_give_a_bias() -> None:
    assert math.isfinite(interval_bias_of(choices(3, 0, 4)[:4]).bias)


@pytest.mark.parametrize("criterion", [0.5, 1.0, 1.645])
def test_the_rate_of_d_prime_1_is_answered_with_yes_as_often_as_the_criterion_says(criterion: float) -> None:
    function = PsychometricFunction(2.0, 1.5, guess_rate=0.01, lapse_rate=0.02)
    rate = rate_of_d_prime(1.0, function, criterion)
    assert rate is not None
    attentive = replace(function, lapse_rate=0.0)
    assert float(yes_probability(rate, attentive)) == pytest.approx(float(special.ndtr(1.0 - criterion)))


def test_the_criterion_moves_the_75_percent_point_but_not_the_rate_of_d_prime_1() -> None:
    # Two people with the same eye, d' = (rate / 2)^1.5, and false alarms of 2 and 20 %: their answers follow
    # Φ(d' - c). The raw 75 % rates differ by (2.73/1.52)^(1/1.5) = 1.48, the rates of d' = 1 do not.
    raw, compared = [], []
    for false_alarms in (0.02, 0.20):
        c = -float(special.ndtri(false_alarms))
        raw.append(2 * (c + float(special.ndtri(0.75))) ** (1 / 1.5))
        # A logistic function through the two points that matter: 75 %, and the d' = 1 point at rate 2.
        low = float(special.ndtr(1.0 - c))
        logits = [float(special.logit((p - false_alarms) / (1 - false_alarms))) for p in (low, 0.75)]
        width = 2 * math.log(19) * math.log(raw[-1] / 2.0) / (logits[1] - logits[0])
        function = PsychometricFunction(raw[-1], width, false_alarms)
        compared.append(rate_of_d_prime(1.0, function, c))
    assert raw[0] / raw[1] == pytest.approx((2.73 / 1.52) ** (1 / 1.5), rel=0.01)
    assert compared == pytest.approx([2.0, 2.0])


def test_a_d_prime_that_the_function_does_not_reach_has_no_rate() -> None:
    eager = PsychometricFunction(2.0, 1.5, guess_rate=0.3)
    assert rate_of_d_prime(1.0, eager, criterion=2.5) is None  # Φ(-1.5) = 7 % lies below the guess rate
    looking, lapsing = (PsychometricFunction(2.0, 1.5, 0.5, lapses) for lapses in (0.0, 0.1))
    assert rate_of_d_prime(4.0, lapsing) == rate_of_d_prime(4.0, looking) is not None

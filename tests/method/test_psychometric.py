"""The psychometric function, of answers yes or no and of two intervals."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from evenlight.method.psychometric import (
    THRESHOLD_D_PRIME,
    PsychometricFunction,
    log_likelihood,
    rate_at,
    two_interval_function,
    yes_probability,
)

functions = st.builds(
    PsychometricFunction,
    threshold=st.floats(0.01, 100.0),
    width=st.floats(0.2, 6.0),
    guess_rate=st.floats(0.0, 0.7),
    lapse_rate=st.floats(0.0, 0.2),
)


@pytest.mark.slow
@given(functions)
def test_the_threshold_is_the_75_percent_point_of_who_guesses_as_much_and_never_lapses(
    function: PsychometricFunction,
) -> None:
    attentive = dataclasses.replace(function, lapse_rate=0.0)
    assert float(yes_probability(function.threshold, attentive)) == pytest.approx(0.75, abs=1e-12)
    rise = (0.75 - function.guess_rate) / (1 - function.guess_rate)
    with_lapses = function.guess_rate + (1 - function.guess_rate - function.lapse_rate) * rise
    assert float(yes_probability(function.threshold, function)) == pytest.approx(with_lapses, abs=1e-12)


@given(functions)
def test_nothing_to_see_gives_the_guess_rate_and_everything_to_see_one_minus_the_lapse_rate(
    function: PsychometricFunction,
) -> None:
    assert float(yes_probability(0.0, function)) == function.guess_rate
    assert float(yes_probability(1e300, function)) == pytest.approx(1 - function.lapse_rate, abs=1e-12)


@given(functions)
def test_the_width_lies_between_5_and_95_percent_of_the_rise(function: PsychometricFunction) -> None:
    rise = 1 - function.guess_rate - function.lapse_rate
    slow, fast = rate_at(function.guess_rate + rise * np.array([0.05, 0.95]), function)
    assert math.log(fast / slow) == pytest.approx(function.width, rel=1e-9)


@given(functions, st.floats(-2.0, 2.0))
def test_the_inverse_gives_the_rate_back(function: PsychometricFunction, widths: float) -> None:
    rate = function.threshold * math.exp(widths * function.width / 2)
    assert float(rate_at(yes_probability(rate, function), function)) == pytest.approx(rate, rel=1e-6)


@given(functions)
def test_it_rises_with_the_rate(function: PsychometricFunction) -> None:
    rates = function.threshold * np.geomspace(1e-3, 1e3, 60)
    assert (np.diff(yes_probability(np.concatenate([[0.0], rates]), function)) >= 0).all()


@given(functions)
def test_the_likelihood_is_that_of_the_binomial_as_written(function: PsychometricFunction) -> None:
    rates = function.threshold * np.array([0.7, 1.0, 1.3])
    yes, n = np.array([1, 5, 7]), np.array([8, 8, 8])
    p = yes_probability(rates, function)
    as_written = sum(k * math.log(q) + (m - k) * math.log1p(-q) for k, m, q in zip(yes, n, p, strict=True))
    assert log_likelihood(function, rates, yes, n) == pytest.approx(as_written, rel=1e-9)


def test_a_saturated_cell_keeps_its_logarithm() -> None:
    # Without guessing, ψ(x) = F(x) -> e^z far below threshold, so that ln ψ is the logit z itself:
    # z = 2 ln 19 · ln(rate/threshold)/width + ln 3, -590 here, where 1 - ψ rounds to 1 and e^z to 1e-256.
    function = PsychometricFunction(threshold=1.0, width=1.0)
    rate = math.exp(-100.0)
    logit = 2 * math.log(19) * -100.0 + math.log(3)
    assert log_likelihood(function, [rate], [1], [1]) == pytest.approx(logit, rel=1e-12)
    assert log_likelihood(function, [1 / rate], [0], [1]) == pytest.approx(
        -(2 * math.log(19) * 100.0 + math.log(3)), rel=1e-12
    )


def test_an_impossible_answer_has_likelihood_zero_and_one_that_never_came_costs_nothing() -> None:
    function = PsychometricFunction(threshold=1.0, width=1.0)  # never guesses
    assert log_likelihood(function, [0.0], [1], [4]) == -math.inf
    assert log_likelihood(function, [0.0], [0], [4]) == 0.0


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"threshold": 0.0}, "threshold must be above 0 and finite, got 0"),
        ({"width": math.inf}, "width must be above 0 and finite, got inf"),
        ({"guess_rate": 0.75}, r"guess_rate must lie in 0 to below 0\.75, got 0\.75"),
        ({"lapse_rate": 0.25}, r"lapse_rate must lie in 0 to below 0\.25, got 0\.25"),
        ({"guess_rate": math.nan}, "guess_rate must lie in 0 to below"),
    ],
)
def test_a_function_without_a_75_percent_point_is_refused(changed: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PsychometricFunction(**{"threshold": 1.0, "width": 1.0, **changed})


def test_a_probability_that_is_never_reached_has_no_rate() -> None:
    with pytest.raises(ValueError, match=r"must lie in 0\.1 to 0\.95, got 0\.05"):
        rate_at(0.05, PsychometricFunction(1.0, 1.0, guess_rate=0.1, lapse_rate=0.05))


# --- two intervals

YES_NO = PsychometricFunction(3.0, width=1.6, guess_rate=0.07, lapse_rate=0.0)


def d_prime_two_intervals(rate: float, yes_no: PsychometricFunction) -> float:
    """Of somebody without lapses: z(hits) - z(false alarms)."""
    return float(special.ndtri(yes_probability(rate, yes_no)) - special.ndtri(yes_no.guess_rate))


def test_75_percent_of_two_intervals_are_a_d_prime_of_0_954() -> None:
    assert pytest.approx(0.954, abs=5e-4) == THRESHOLD_D_PRIME  # sqrt(2) z(0.75)
    two = two_interval_function(YES_NO)
    assert d_prime_two_intervals(two.threshold, YES_NO) == pytest.approx(THRESHOLD_D_PRIME, abs=1e-9)
    assert float(yes_probability(two.threshold, two)) == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("false_alarms", "yes"),
    [(0.01, 0.085), (0.02, 0.136), (0.05, 0.245), (0.10, 0.372), (0.20, 0.545), (0.30, 0.666), (0.50, 0.830)],
)
def test_the_share_of_yes_at_the_two_interval_threshold_follows_the_criterion(
    false_alarms: float, yes: float
) -> None:
    # Φ(z(FA) + 0.954): by hand for 10 %: Φ(-1.282 + 0.954) = Φ(-0.328) = 0.372.
    yes_no = PsychometricFunction(3.0, width=1.6, guess_rate=false_alarms)
    two = two_interval_function(yes_no)
    assert float(yes_probability(two.threshold, yes_no)) == pytest.approx(yes, abs=6e-4)


def test_near_the_threshold_the_logistic_shape_is_that_of_signal_detection() -> None:
    # P(right) = Φ(d' / sqrt(2)); the slopes agree at the threshold, and within 25 % of it both to 0.01.
    two = two_interval_function(YES_NO)
    for rate in two.threshold * np.array([0.8, 0.9, 1.1, 1.25]):
        exact = float(special.ndtr(d_prime_two_intervals(float(rate), YES_NO) / np.sqrt(2)))
        assert float(yes_probability(rate, two)) == pytest.approx(exact, abs=0.01)


def test_the_threshold_is_free_of_the_criterion() -> None:
    # The same d' at every rate of interest, asked with criteria of 2 and 20 % false alarms: yes/no thresholds
    # that differ by a factor, two-interval thresholds that do not.
    slope = 2.0  # d' = 1 at rate 1, growing with the logarithm

    def asked(false_alarms: float) -> PsychometricFunction:
        """The logistic yes/no function through this eye's 50 and 75 % points."""
        z = special.ndtri(false_alarms)
        at = [float(np.exp((special.ndtri(p) - z - 1) / slope)) for p in (0.5, 0.75)]
        probe = PsychometricFunction(at[1], 1.0, false_alarms)
        width = float(np.log(at[0] / at[1]) / np.log(rate_at(0.5, probe) / at[1]))
        return PsychometricFunction(at[1], width, false_alarms)

    cautious, eager = asked(0.02), asked(0.2)
    assert cautious.threshold / eager.threshold > 1.7
    ratio = two_interval_function(cautious).threshold / two_interval_function(eager).threshold
    assert ratio == pytest.approx(1.0, abs=0.15)  # the shape is logistic in one, normal in the other


def test_lapses_show_half_as_often_and_do_not_change_what_is_seen() -> None:
    # The same rise F(ln rate), once with lapses of 10 % and once without: the same rate has a d' of 0.954.
    two = two_interval_function(dataclasses.replace(YES_NO, lapse_rate=0.1))
    assert two.lapse_rate == pytest.approx(0.05)
    assert dataclasses.replace(two, lapse_rate=0.0) == two_interval_function(YES_NO)


def test_who_never_says_yes_to_nothing_is_taken_for_one_in_a_hundred() -> None:
    never, seldom = (PsychometricFunction(3.0, 1.6, guess) for guess in (0.0, 0.01))
    assert two_interval_function(never) == two_interval_function(seldom)

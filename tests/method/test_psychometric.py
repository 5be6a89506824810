"""The psychometric function: its 75 % point, its inverse, and its likelihood where it saturates."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.method.psychometric import PsychometricFunction, log_likelihood, rate_at, yes_probability

functions = st.builds(
    PsychometricFunction,
    threshold=st.floats(0.01, 100.0),
    width=st.floats(0.2, 6.0),
    guess_rate=st.floats(0.0, 0.7),
    lapse_rate=st.floats(0.0, 0.2),
)


@pytest.mark.slow
@given(functions)
def test_the_threshold_is_the_raw_75_percent_point_whatever_the_asymptotes(
    function: PsychometricFunction,
) -> None:
    assert float(yes_probability(function.threshold, function)) == pytest.approx(0.75, abs=1e-12)


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

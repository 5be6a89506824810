"""One eye asked in two ways: the yes/no function and that of a choice between two intervals."""

import dataclasses

import numpy as np
import pytest
from scipy import special

from evenlight.method.psychometric import (
    THRESHOLD_D_PRIME,
    PsychometricFunction,
    rate_at,
    two_interval_function,
    yes_probability,
)

YES_NO = PsychometricFunction(3.0, width=1.6, guess_rate=0.07, lapse_rate=0.0)


def d_prime(rate: float, yes_no: PsychometricFunction) -> float:
    """Of somebody without lapses: z(hits) - z(false alarms)."""
    return float(special.ndtri(yes_probability(rate, yes_no)) - special.ndtri(yes_no.guess_rate))


def test_75_percent_of_two_intervals_are_a_d_prime_of_0_954() -> None:
    assert pytest.approx(0.954, abs=5e-4) == THRESHOLD_D_PRIME  # sqrt(2) z(0.75)
    two = two_interval_function(YES_NO)
    assert d_prime(two.threshold, YES_NO) == pytest.approx(THRESHOLD_D_PRIME, abs=1e-9)
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
        exact = float(special.ndtr(d_prime(float(rate), YES_NO) / np.sqrt(2)))
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
    lapsing = dataclasses.replace(YES_NO, lapse_rate=0.1)
    attentive = dataclasses.replace(
        YES_NO, threshold=float(rate_at(0.07 + 0.83 * (0.75 - 0.07) / 0.93, lapsing))
    )
    two = two_interval_function(lapsing)
    assert two.lapse_rate == pytest.approx(0.05)
    assert two.threshold == pytest.approx(two_interval_function(attentive).threshold)


def test_who_never_says_yes_to_nothing_is_taken_for_one_in_a_hundred() -> None:
    never, seldom = (PsychometricFunction(3.0, 1.6, guess) for guess in (0.0, 0.01))
    assert two_interval_function(never) == two_interval_function(seldom)

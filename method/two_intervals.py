"""One eye, asked in two ways: "did it change?" and "in which of two intervals?" (signal detection)."""

from __future__ import annotations

import dataclasses
import math

from scipy import special

from evenlight.method.psychometric import (
    THRESHOLD_PROBABILITY,
    WIDTH_LOGITS,
    PsychometricFunction,
    rate_at,
)

TWO_INTERVAL_GUESS_RATE = 0.5  # right by chance
THRESHOLD_D_PRIME = math.sqrt(2) * float(special.ndtri(THRESHOLD_PROBABILITY))  # 0.954
LEAST_FALSE_ALARM_RATE = 0.01  # below it the criterion, and with it d', would run off to infinity


def two_interval_function(yes_no: PsychometricFunction) -> PsychometricFunction:
    """Return the function of a choice between two intervals, for who has a given function in yes/no.

    Equal-variance signal detection (Green & Swets 1966): without lapses P("yes") = Φ(d' - c) with the
    criterion c = -z(γ), and P(right) = Φ(d' / √2). So the threshold is the rate at which d' is 0.954, which
    for most people lies below the rate of 75 % "yes". The shape is taken to be logistic again, with the
    slope at the threshold that d' has there. Who did not look is right by chance in half of the cases: lapses
    show half as often.

    Parameters
    ----------
    yes_no : PsychometricFunction
        In yes/no; its guess rate is taken for at least 1 %.

    >>> two = two_interval_function(PsychometricFunction(2.0, width=1.6, guess_rate=0.05))
    >>> two.guess_rate, two.threshold < 2.0
    (0.5, True)
    """
    false_alarms = max(yes_no.guess_rate, LEAST_FALSE_ALARM_RATE)
    asked = dataclasses.replace(yes_no, guess_rate=false_alarms)
    z = THRESHOLD_D_PRIME + float(special.ndtri(false_alarms))
    yes = float(special.ndtr(z))
    rise = (yes - false_alarms) / (1 - false_alarms)  # F of the yes/no function, which lapses leave alone
    rate = float(rate_at(false_alarms + (1 - false_alarms - yes_no.lapse_rate) * rise, asked))
    yes_slope = (1 - false_alarms) * rise * (1 - rise) * WIDTH_LOGITS / yes_no.width  # of ln(rate)
    d_prime_slope = yes_slope / _density(z)
    slope = _density(THRESHOLD_D_PRIME / math.sqrt(2)) / math.sqrt(2) * d_prime_slope
    lapse = yes_no.lapse_rate / 2
    room = 1 - TWO_INTERVAL_GUESS_RATE - lapse
    own_rise = (THRESHOLD_PROBABILITY - TWO_INTERVAL_GUESS_RATE) / room
    return PsychometricFunction(
        threshold=rate,
        width=float(room * own_rise * (1 - own_rise) * WIDTH_LOGITS / slope),
        guess_rate=TWO_INTERVAL_GUESS_RATE,
        lapse_rate=lapse,
    )


def _density(z: float) -> float:
    """Return the density of the standard normal distribution."""
    return math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)

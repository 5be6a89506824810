"""The psychometric function: how often a ramp of some rate is seen (Section 3.4), and its inverse.

The same eye can be asked in two ways: "did it change?" (yes/no) and "in which of two intervals?" (2IFC);
`two_interval_function` relates the two by signal detection.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

THRESHOLD_PROBABILITY = 0.75  # "probability of 75 % of detecting the change", Section 3.4
WIDTH_LOGITS = 2 * np.log(19.0)  # logit(0.95) - logit(0.05): the width in units of the logistic's scale
TWO_INTERVAL_GUESS_RATE = 0.5  # right by chance
THRESHOLD_D_PRIME = math.sqrt(2) * float(special.ndtri(THRESHOLD_PROBABILITY))  # 0.954
LEAST_FALSE_ALARM_RATE = 0.01  # below it the criterion, and with it d', would run off to infinity


@dataclass(frozen=True, slots=True)
class PsychometricFunction:
    """A logistic function of ln(rate), between an asymptote for guessing and one for lapses.

    ψ(x) = γ + (1 - γ - λ) F(x), x = ln(rate), F logistic. Its place is given by the rate at which somebody
    who never lapses, γ + (1 - γ) F, answers with 75 %: what the paper calls detected in 75 % of the trials
    (docs/decisions/threshold-definition.md). A function can be called: `function(rate)` is ψ there.
    """

    threshold: float  # rate at which P("yes") = 0.75 without lapses [cd/m^2/s]
    width: float  # ln(rate) between 5 % and 95 % of the rise
    guess_rate: float = 0.0  # γ, P("yes") with nothing to see; below 0.75
    lapse_rate: float = 0.0  # λ, P("no") with everything to see; below 0.25

    def __post_init__(self) -> None:
        for name in ("threshold", "width"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be above 0 and finite, got {getattr(self, name):g}")
        for name, limit in (("guess_rate", THRESHOLD_PROBABILITY), ("lapse_rate", 1 - THRESHOLD_PROBABILITY)):
            if not 0 <= getattr(self, name) < limit:
                raise ValueError(f"{name} must lie in 0 to below {limit:g}, got {getattr(self, name):g}")

    def __call__(self, rate: ArrayLike) -> NDArray[np.float64]:
        """Return ψ for ramps of a rate [cd/m^2/s], as `yes_probability`.

        >>> PsychometricFunction(threshold=2.0, width=1.5)([0.0, 2.0]).tolist()
        [0.0, 0.75]
        """
        return yes_probability(rate, self)

    @property
    def slope(self) -> float:
        """How steeply ψ rises at the threshold: dψ / d ln(rate).

        >>> PsychometricFunction(threshold=2.0, width=2 * np.log(19.0)).slope  # F (1 - F) at F = 0.75
        0.1875
        """
        rise = 1 - self.guess_rate - self.lapse_rate
        share = float(special.expit(threshold_logit(self.guess_rate)))
        return float(rise * share * (1 - share) * WIDTH_LOGITS / self.width)


def threshold_logit(guess_rate: ArrayLike) -> NDArray[np.float64]:
    """Return the logit of F at the threshold, where γ + (1 - γ) F = 0.75: ln((0.75 - γ) / 0.25).

    >>> threshold_logit([0.25, 0.5]).round(12).tolist()
    [0.69314718056, 0.0]
    """
    return np.asarray(np.log((THRESHOLD_PROBABILITY - np.asarray(guess_rate)) / (1 - THRESHOLD_PROBABILITY)))


def yes_probability(rate: ArrayLike, function: PsychometricFunction) -> NDArray[np.float64]:
    """Return ψ, the probability to answer "yes, it changed", for ramps of a rate.

    Parameters
    ----------
    rate : array_like, any shape
        Rate of the luminance change [cd/m^2/s], at least 0; at 0 (a catch trial) ψ is the guess rate.
    function : PsychometricFunction
        The observer's.

    >>> observer = PsychometricFunction(threshold=2.0, width=1.5, guess_rate=0.1, lapse_rate=0.05)
    >>> yes_probability([0.0, 2.0, 1e300], observer).round(12).tolist()  # F = 0.65 / 0.9 at the threshold
    [0.1, 0.713888888889, 0.95]
    """
    rise = 1 - function.guess_rate - function.lapse_rate
    return np.asarray(function.guess_rate + rise * special.expit(_logit_of_rise(rate, function)))


def rate_at(probability: ArrayLike, function: PsychometricFunction) -> NDArray[np.float64]:
    """Return the rate that is answered with "yes" with a given probability: the inverse of ψ.

    Parameters
    ----------
    probability : array_like, any shape
        P("yes"), from the guess rate (rate 0) to one minus the lapse rate (an infinite rate).
    function : PsychometricFunction
        The observer's.

    Returns
    -------
    array, shape of probability
        Rate [cd/m^2/s].

    >>> float(rate_at(0.75, PsychometricFunction(threshold=2.0, width=1.5, guess_rate=0.1)))
    2.0
    """
    wanted = np.asarray(probability, dtype=np.float64)
    low, high = function.guess_rate, 1 - function.lapse_rate
    if not ((wanted >= low) & (wanted <= high)).all():
        raise ValueError(f"the probability must lie in {low:g} to {high:g}, got {wanted}")
    logit = special.logit((wanted - low) / (high - low)) - threshold_logit(function.guess_rate)
    return np.asarray(function.threshold * np.exp(logit * function.width / WIDTH_LOGITS))


def log_likelihood(
    function: PsychometricFunction, rate: ArrayLike, n_yes: ArrayLike, n_trials: ArrayLike
) -> float:
    """Return the log-likelihood of answer counts, without the binomial coefficients.

    It stays finite and exact where ψ rounds to 0 or 1: ψ = γ(1 - F) + (1 - λ)F and its complement are added
    up as logarithms.

    Parameters
    ----------
    function : PsychometricFunction
        The observer's.
    rate, n_yes, n_trials : array_like (m,)
        Rate [cd/m^2/s], answers "yes" and trials at each.

    >>> half = PsychometricFunction(threshold=1.0, width=1.0)
    >>> round(log_likelihood(half, [1.0], [3], [4]), 6)  # 3 ln 0.75 + ln 0.25
    -2.249341
    """
    logit = _logit_of_rise(rate, function)
    n_yes, n_trials = np.asarray(n_yes), np.asarray(n_trials)
    rises, stays = special.log_expit(logit), special.log_expit(-logit)
    with np.errstate(divide="ignore"):  # an asymptote of exactly 0 has the logarithm -inf, which adds nothing
        ln_guess, ln_lapse = np.log(function.guess_rate), np.log(function.lapse_rate)
    yes = np.logaddexp(ln_guess + stays, np.log1p(-function.lapse_rate) + rises)
    no = np.logaddexp(np.log1p(-function.guess_rate) + stays, ln_lapse + rises)
    return float(np.sum(_times(n_yes, yes) + _times(n_trials - n_yes, no)))


def _logit_of_rise(rate: ArrayLike, function: PsychometricFunction) -> NDArray[np.float64]:
    """Return the logit of F at a rate; -inf at rate 0."""
    with np.errstate(divide="ignore"):  # ln 0 = -inf is meant: nothing to see
        distance = np.log(np.asarray(rate, dtype=np.float64)) - np.log(function.threshold)
    return np.asarray(WIDTH_LOGITS * distance / function.width + threshold_logit(function.guess_rate))


def _times(count: NDArray[np.int64], logarithm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return count · logarithm, with 0 · (-inf) = 0: what never happened costs nothing."""
    return np.where(count > 0, count * np.where(count > 0, logarithm, 0.0), 0.0)


def two_interval_function(yes_no: PsychometricFunction) -> PsychometricFunction:
    """Return the psychometric function of a 2IFC task, for an observer with a given one in yes/no.

    Equal-variance signal detection (Green & Swets 1966): without lapses P("yes") = Φ(d' - c) with the
    criterion c = -z(γ), and P(right) = Φ(d' / √2). So the threshold is the rate at which d' is 0.954, which
    for most people lies below the rate of 75 % "yes". The shape is taken to be logistic again, with the
    slope at the threshold that d' has there. An observer who did not look is right by chance in half of the
    trials: lapses show half as often.

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
    return PsychometricFunction(
        threshold=rate,
        width=float(TWO_INTERVAL_GUESS_RATE / 4 * WIDTH_LOGITS / slope),  # at the threshold F is 1/2
        guess_rate=TWO_INTERVAL_GUESS_RATE,
        lapse_rate=yes_no.lapse_rate / 2,
    )


def _density(z: float) -> float:
    return math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)

"""Whether a participant's thresholds drifted: practice lowers them, fatigue raises them.

A deviance over rates cannot tell: where the order of the trials is random, a drift only makes the function
flatter. The order tells. For small drifts δ of ln(threshold) from the first trial to the last, the answers'
residuals go with time times the slope of ψ; the score of δ, with the parts explained by each level's
threshold and width taken out, is compared with its own standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction, yes_probability

LARGEST_LN_RATIO = 3.0  # a first-order estimate beyond a factor of 20 says only that the drift is large
LEAST_INFORMATION = 1e-3  # a standard error of 30 in ln(threshold): nothing is known


@dataclass(frozen=True, slots=True)
class TimedAnswers:
    """Answers at one level in the order of the trials, and the function fitted to them.

    Attributes
    ----------
    function : PsychometricFunction
        Fitted.
    rates : array (n,)
        Of each trial [cd/m^2/s].
    success : array (n,)
        1 or 0.
    times : array (n,)
        Place of each trial among all of the participant's, from 0 to 1.
    """

    function: PsychometricFunction
    rates: Array
    success: Array
    times: Array


@dataclass(frozen=True, slots=True)
class Drift:
    """How a participant's thresholds moved from the first trial to the last.

    Attributes
    ----------
    ratio : float
        Threshold at the end over that at the beginning, to first order.
    ci_low, ci_high : float
        95 % interval.
    p_value : float
        Probability of a drift as clear as this one without any.
    """

    ratio: float
    ci_low: float
    ci_high: float
    p_value: float


def drift_of(levels: Sequence[TimedAnswers]) -> Drift | None:
    """Return the drift of one participant's thresholds, over all levels; None if no answer tells.

    Parameters
    ----------
    levels : sequence of TimedAnswers
        Of the participant.
    """
    score = information = 0.0
    for level in levels:
        own = _score(level)
        score, information = score + own[0], information + own[1]
    if information < LEAST_INFORMATION:
        return None
    error = information**-0.5
    change = float(np.clip(score / information, -LARGEST_LN_RATIO, LARGEST_LN_RATIO))
    half = 1.96 * error
    ends = np.exp(np.clip([change, change - half, change + half], -50, 50))
    return Drift(float(ends[0]), float(ends[1]), float(ends[2]), float(2 * special.ndtr(-abs(score * error))))


def _score(level: TimedAnswers) -> tuple[float, float]:
    """Return the score of δ at one level and its variance.

    Everything is divided by the standard deviation of an answer, so that least squares take the nuisance
    parts out.
    """
    f = level.function
    probability = np.clip(yes_probability(level.rates, f), 1e-9, 1 - 1e-9)
    distance = WIDTH_LOGITS / f.width * (np.log(level.rates) - np.log(f.threshold))
    rise = special.expit(distance + f.threshold_logit)
    spread = np.sqrt(probability * (1 - probability))
    by_threshold = -(1 - f.guess_rate - f.lapse_rate) * rise * (1 - rise) * WIDTH_LOGITS / f.width / spread
    nuisance = np.column_stack([by_threshold, by_threshold * distance])
    moved = level.times * by_threshold
    own = moved - nuisance @ np.linalg.lstsq(nuisance, moved, rcond=None)[0]
    return float(own @ ((level.success - probability) / spread)), float(own @ own)

"""What a participant's answers say apart from the criterion: d′, criterion, bias (equal variances).

Yes/no: z(P("yes")) is d′ minus the criterion, which the catch trials give. Two intervals: the differences of
two observations decide, so that z(P(right)) is d′ / √2, and there is no criterion but a leaning to one of
the intervals (docs/decisions/yes-no-task.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import special, stats

from evenlight.analysis.wording import percent
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial, Response
from evenlight.data_schema.threshold import Threshold
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, PsychometricFunction, rate_at

COMPARED_D_PRIME = 1.0
MANY_FALSE_ALARMS = 0.3  # d' of 75 % "yes" is 1.2 there, half of what it is at 5 %
DIFFERENT_LEVELS = 0.01  # probability of as different levels by chance, below which it is reported
Z_THRESHOLD = float(special.ndtri(THRESHOLD_PROBABILITY))
TWO_INTERVAL_D_PRIME = math.sqrt(2) * Z_THRESHOLD  # 0.954: 75 % right


@dataclass(frozen=True, slots=True)
class Criterion:
    """How readily a participant says "yes" (signal detection, equal variances)."""

    false_alarm_rate: float  # "yes" in catch trials, as counted
    criterion: float  # its distance from the mean of "nothing changed", z(1 - FA), in standard deviations
    # d' of a ramp that is noticed in 75 % of the trials, z(0.75) + z(1 - FA); 75 % right of two intervals
    # stands for 0.95
    d_prime_at_threshold: float


@dataclass(frozen=True, slots=True)
class IntervalBias:
    """How a participant leans to one of two intervals."""

    first_share: float  # share of answers "first"
    # c = -(z(P("second" | second)) + z(P("second" | first))) / 2: above 0 if they lean to the first
    bias: float


def criterion_of(catch_yes: int, catch_trials: int) -> Criterion:
    """Return a participant's criterion from the catch trials.

    Shares of 0 and 1 are kept off infinity by the log-linear correction (yes + 0.5) / (trials + 1) of Hautus
    (1995).

    >>> never = criterion_of(0, 99)  # corrected: 0.005
    >>> round(never.criterion, 3), round(never.d_prime_at_threshold, 3)  # z(0.995), and z(0.75) = 0.674 more
    (2.576, 3.25)
    """
    criterion = -_z(catch_yes, catch_trials)
    return Criterion(catch_yes / catch_trials, criterion, criterion + Z_THRESHOLD)


def interval_bias_of(trials: Iterable[RampTrial]) -> IntervalBias:
    """Return the leaning to one of two intervals, from trials of a two-interval choice; at least one."""
    answers = [(trial.ramp_interval, trial.response is Response.SECOND) for trial in trials]
    shares = []
    for interval in (1, 2):
        second = [answer for ramp, answer in answers if ramp == interval]
        shares.append(_z(sum(second), len(second)))
    first = sum(not answer for _, answer in answers)
    return IntervalBias(first / len(answers), -(shares[0] + shares[1]) / 2)


def interval_biases(trials: Iterable[RampTrial]) -> dict[str, IntervalBias]:
    """Return the leaning of each participant who chose between two intervals."""
    chosen: dict[str, list[RampTrial]] = {}
    for trial in trials:
        if trial.procedure is Procedure.TWO_INTERVAL:
            chosen.setdefault(trial.participant_id, []).append(trial)
    return {who: interval_bias_of(own) for who, own in chosen.items()}


def rate_of_d_prime(
    d_prime: float, function: PsychometricFunction, criterion: float | None = None
) -> float | None:
    """Return the rate [cd/m^2/s] at which a participant's d′ has some value; None where it never has.

    Who lapses did not look: lapses leave it alone, as they do the threshold.

    Parameters
    ----------
    d_prime, function : float, PsychometricFunction
        Which d′, and the function of the participant at a level.
    criterion : float, optional
        z(1 - FA) in yes/no; none for the choice between two intervals.

    >>> two = PsychometricFunction(threshold=2.0, width=1.5, guess_rate=0.5)
    >>> round(rate_of_d_prime(TWO_INTERVAL_D_PRIME, two), 9)
    2.0
    """
    z = d_prime / math.sqrt(2) if criterion is None else d_prime - criterion
    share = float(special.ndtr(z))
    if not function.guess_rate < share < 1:
        return None
    return float(rate_at(share, replace(function, lapse_rate=0.0)))


def _z(count: int, total: int) -> float:
    """Return z of a share, kept off infinity by the log-linear correction."""
    return float(special.ndtri((count + 0.5) / (total + 1)))


def false_alarm_warnings(
    criteria: Mapping[str, Criterion], thresholds: Iterable[Threshold]
) -> tuple[str, ...]:
    """Return what is wrong with answers to catch trials: too many "yes", or not the same at all levels."""
    rates = {who: own.false_alarm_rate for who, own in criteria.items()}
    many = [f"{who} ({percent(rate, 0)})" for who, rate in rates.items() if rate > MANY_FALSE_ALARMS]
    warnings = []
    if many:
        warnings.append(
            f"participants {', '.join(many)} say yes to many catch trials: their thresholds depend on the "
            "guess rate; compare threshold_d_prime_1, or ask for two intervals"
        )
    counts: dict[float, list[float]] = {}
    for t in thresholds:
        if t.level_false_alarm_rate is not None:
            yes = t.level_false_alarm_rate * t.level_n_catch
            at_level = counts.setdefault(t.luminance, [0.0, 0.0])
            at_level[0] += yes
            at_level[1] += t.level_n_catch - yes
    table = np.array(list(counts.values()))
    if len(table) > 1 and (table.sum(axis=0) > 0).all():
        p = float(stats.chi2_contingency(table).pvalue)
        if p < DIFFERENT_LEVELS:
            warnings.append(
                f"false alarms differ between the luminances (p = {p:.2g}): the fits take each participant's "
                "for the same at all of them; see level_false_alarm_rate in thresholds.csv"
            )
    return tuple(warnings)

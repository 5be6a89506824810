"""Detection thresholds: one psychometric fit per participant and luminance level (Section 3.4); drift.

Practice lowers thresholds, fatigue raises them. A deviance over rates cannot show that: if the order of the
trials is random, a drift only makes the function flatter. The order shows it. For small drifts δ of
ln(threshold) from the first trial to the last, the answers' residuals go with time times the slope of ψ; the
score of δ, with the parts explained by each level's threshold and width taken out, is compared with its own
standard deviation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.psychometric.goodness_of_fit import (
    POOR_FIT_P,
    GoodnessOfFit,
    goodness_of_fit,
)
from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    FINE_NODES,
    PsychometricFit,
    PsychometricPrior,
    fit_psychometric,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampCounts,
    RampLevelKey,
    catch_counts,
    group_by_participant_and_level,
    ramp_counts,
)
from evenlight.analysis.calibration.psychometric.signal_detection import (
    COMPARED_D_PRIME,
    TWO_INTERVAL_D_PRIME,
    criterion_of,
    interval_biases,
    rate_of_d_prime,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction, yes_probability

UNUSABLE = (ThresholdFlag.ALL_YES, ThresholdFlag.ALL_NO, ThresholdFlag.FALSE_ALARMS)


MAX_FALSE_ALARM_RATE = 0.5  # above it, "yes" is said more often than not to nothing at all
LARGEST_LN_RATIO = 3.0  # a first-order estimate beyond a factor of 20 says only that the drift is large
LEAST_INFORMATION = 1e-3  # a standard error of 30 in ln(threshold): nothing is known


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """A threshold with the fit that it comes from: what a figure of one psychometric function needs.

    Attributes
    ----------
    threshold, fit : Threshold, PsychometricFit
        The record; answers, fitted function, posterior.
    goodness : GoodnessOfFit or None
        How well the function describes the answers; None with too few rates to judge by.
    """

    threshold: Threshold
    fit: PsychometricFit
    goodness: GoodnessOfFit | None = None

    @property
    def without_drift(self) -> ThresholdFit:
        """The same of trials whose order is unknown."""
        return dataclasses.replace(
            self, threshold=dataclasses.replace(self.threshold, drift_ratio=None, drift_p=None)
        )


@dataclass(frozen=True, slots=True)
class _Person:
    """What is a participant's and not a level's."""

    d_prime: float | None = None
    criterion: float | None = None
    drift: Drift | None = None


def fit_thresholds_of(
    trials: Iterable[RampTrial],
    prior: PsychometricPrior | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
    judge: bool = True,
    fine: tuple[int, int, int, int] = FINE_NODES,
) -> list[ThresholdFit]:
    """Fit a threshold for every participant and level of some trials.

    A participant's catch trials inform the guess rate at all levels: whether to say "yes" without seeing
    anything is a matter of the person's criterion, not of the luminance (docs/decisions/yes-no-task.md).

    Parameters
    ----------
    trials : iterable of RampTrial
        Of one or more participants and sessions.
    prior : PsychometricPrior, optional
        For every fit.
    report : callable, optional
        Called with the fits done and their total.
    judge : bool
        Whether to judge each fit by Monte Carlo, which takes about as long as the fit itself.
    fine : tuple of int
        Nodes of the grid that integrates a posterior.
    """
    groups = group_by_participant_and_level(trials)
    everything = [trial for group in groups.values() for trial in group]
    catches = catch_counts(everything)
    ramps = {key: [t for t in group if not t.is_catch] for key, group in groups.items()}
    ramps = {key: group for key, group in ramps.items() if group}
    found = {}
    for done, (key, group) in enumerate(ramps.items(), start=1):
        caught = catches.get(key[0], (0, 0)) if key[1].procedure is Procedure.YES_NO else (0, 0)
        counts = ramp_counts(group, *caught)
        found[key] = fit_psychometric(counts, prior, fine), goodness_of_fit(counts, prior) if judge else None
        report(done, len(ramps))
    times = trial_times(everything)
    people = {
        (who, task): _person(who, task, ramps, found, catches, times)
        for who, task in dict.fromkeys((who, level.procedure) for who, level in ramps)
    }
    records = {
        key: _record(key, fit, goodness, people[key[0], key[1].procedure])
        for key, (fit, goodness) in found.items()
    }
    return [
        ThresholdFit(_with_own_catches(records[key], groups[key]), fit, goodness)
        for key, (fit, goodness) in found.items()
    ]


Ramps = dict[tuple[str, RampLevelKey], list[RampTrial]]
Fits = dict[tuple[str, RampLevelKey], tuple[PsychometricFit, GoodnessOfFit | None]]
TrialKey = tuple[str, str, int]


def _person(
    who: str,
    task: Procedure,
    ramps: Ramps,
    fits: Fits,
    catches: dict[str, tuple[int, int]],
    times: dict[TrialKey, float],
) -> _Person:
    """Return criterion and drift of a participant in one task."""
    own = {key: group for key, group in ramps.items() if key[0] == who and key[1].procedure is task}
    drift = drift_of([_timed(fits[key][0], group, times) for key, group in own.items()])
    if task is Procedure.TWO_INTERVAL:
        answered = [trial for group in own.values() for trial in group]
        return _Person(TWO_INTERVAL_D_PRIME, interval_biases(answered)[who].bias, drift)
    if who not in catches:
        return _Person(drift=drift)
    criterion = criterion_of(*catches[who])
    return _Person(criterion.d_prime_at_threshold, criterion.criterion, drift)


def trial_times(trials: Iterable[RampTrial]) -> dict[TrialKey, float]:
    """Return the place of each trial among all of its participant's, from 0 (first) to 1 (last).

    Sessions follow each other in order of their names.
    """
    keys: dict[str, set[TrialKey]] = {}
    for trial in trials:
        keys.setdefault(trial.participant_id, set()).add(_key(trial))
    return {
        key: place / max(len(own) - 1, 1) for own in keys.values() for place, key in enumerate(sorted(own))
    }


def _key(trial: RampTrial) -> TrialKey:
    """Return what names a trial."""
    return trial.participant_id, trial.session_id, trial.trial_index


def _timed(fit: PsychometricFit, ramps: Sequence[RampTrial], times: dict[TrialKey, float]) -> TimedAnswers:
    """Return the answers at a level in time."""
    return TimedAnswers(
        fit.function,
        np.array([trial.rate for trial in ramps]),
        np.array([float(trial.success) for trial in ramps]),
        np.array([times[_key(trial)] for trial in ramps]),
    )


def flag_of(counts: RampCounts, threshold: float, fit_p: float | None = None) -> ThresholdFlag:
    """Return why a threshold should be looked at before use: the gravest reason first.

    Where the guess rate is known, answers that are right no more often than guesses count as "no".

    >>> even = RampCounts(np.array([1.0, 2.0]), np.array([0, 4]), np.array([4, 4]))
    >>> flag_of(even, 1.4).value
    'separated'
    """
    if (counts.n_yes == counts.n_trials).all():
        return ThresholdFlag.ALL_YES
    if counts.n_yes.sum() <= (counts.guess_rate or 0.0) * counts.n_trials.sum():
        return ThresholdFlag.ALL_NO
    if (counts.false_alarm_rate or 0.0) > MAX_FALSE_ALARM_RATE:
        return ThresholdFlag.FALSE_ALARMS
    if threshold < counts.rates[0]:
        return ThresholdFlag.BELOW_RANGE
    if threshold > counts.rates[-1]:
        return ThresholdFlag.ABOVE_RANGE
    fastest_no = counts.rates[counts.n_yes < counts.n_trials].max()
    slowest_yes = counts.rates[counts.n_yes > 0].min()
    if fastest_no < slowest_yes:
        return ThresholdFlag.SEPARATED
    poor = fit_p is not None and fit_p < POOR_FIT_P
    return ThresholdFlag.POOR_FIT if poor else ThresholdFlag.NONE


def _with_own_catches(threshold: Threshold, group: Sequence[RampTrial]) -> Threshold:
    """Return a threshold with the catch trials of its level, which `false_alarm_rate` takes together."""
    catches = [trial.success for trial in group if trial.is_catch]
    rate = sum(catches) / len(catches) if catches else None
    return dataclasses.replace(threshold, level_n_catch=len(catches), level_false_alarm_rate=rate)


def _record(
    key: tuple[str, RampLevelKey], fit: PsychometricFit, goodness: GoodnessOfFit | None, person: _Person
) -> Threshold:
    """Return the record of a fitted threshold."""
    counts, (participant, level) = fit.counts, key
    threshold = fit.function.threshold
    two = level.procedure is Procedure.TWO_INTERVAL
    known = two or person.criterion is not None
    compared = (
        rate_of_d_prime(COMPARED_D_PRIME, fit.function, None if two else person.criterion) if known else None
    )
    fit_p = goodness.p_value if goodness else None
    return Threshold(
        participant_id=participant,
        screen=level.screen,
        factor=level.factor,
        luminance=level.luminance,
        threshold=threshold,
        ci_low=float(np.exp(fit.ln_threshold.ci_low)),
        ci_high=float(np.exp(fit.ln_threshold.ci_high)),
        standard_error_ln=fit.ln_threshold.sd,
        width=fit.function.width,
        guess_rate=fit.guess_rate.mean,
        lapse_rate=fit.lapse_rate.mean,
        false_alarm_rate=counts.false_alarm_rate,
        n_trials=int(counts.n_trials.sum()),
        n_catch=counts.catch_trials,
        flag=flag_of(counts, threshold, fit_p),
        direction=level.direction,
        ramp_duration=level.ramp_duration,
        procedure=level.procedure,
        d_prime=person.d_prime,
        criterion=person.criterion,
        threshold_d_prime_1=compared,
        deviance=goodness.deviance if goodness else None,
        deviance_p=fit_p,
        drift_ratio=person.drift.ratio if person.drift else None,
        drift_p=person.drift.p_value if person.drift else None,
    )


@dataclass(frozen=True, slots=True)
class TimedAnswers:
    """Answers at one level in the order of the trials, and the function fitted to them.

    Attributes
    ----------
    function : PsychometricFunction
        Fitted.
    rates, success, times : array (n,)
        Rate of each trial [cd/m^2/s]; 1 or 0; its place among all of the participant's, from 0 to 1.
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
    ratio, ci_low, ci_high : float
        Threshold at the end over that at the beginning, to first order, and its 95 % confidence interval.
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

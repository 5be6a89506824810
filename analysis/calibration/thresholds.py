"""Detection thresholds: one psychometric fit per participant and luminance level (Section 3.4)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.calibration.goodness_of_fit import POOR_FIT_P, GoodnessOfFit, goodness_of_fit
from evenlight.analysis.calibration.posterior_grid import PsychometricPrior, RampCounts
from evenlight.analysis.calibration.psychometric_fit import PsychometricFit, fit_psychometric
from evenlight.analysis.calibration.ramp_counts import (
    RampLevelKey,
    catch_counts,
    group_by_participant_and_level,
    ramp_counts,
)
from evenlight.analysis.calibration.signal_detection import (
    COMPARED_D_PRIME,
    TWO_INTERVAL_D_PRIME,
    criterion_of,
    interval_biases,
    rate_of_d_prime,
)
from evenlight.analysis.measurement.drift import Drift, TimedAnswers, drift_of
from evenlight.data_schema.ramp import Procedure, RampTrial
from evenlight.data_schema.threshold import Threshold, ThresholdFlag

MAX_FALSE_ALARM_RATE = 0.5  # above it, "yes" is said more often than not to nothing at all


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """A threshold with the fit that it comes from: what a figure of one psychometric function needs.

    Attributes
    ----------
    threshold : Threshold
        The record.
    fit : PsychometricFit
        Answers, fitted function, posterior.
    goodness : GoodnessOfFit or None
        How well the function describes the answers; None with too few rates to judge by.
    """

    threshold: Threshold
    fit: PsychometricFit
    goodness: GoodnessOfFit | None = None


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
        found[key] = fit_psychometric(counts, prior), goodness_of_fit(counts, prior) if judge else None
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

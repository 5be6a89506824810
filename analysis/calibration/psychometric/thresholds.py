"""Detection thresholds: one psychometric fit per participant and luminance level (Section 3.4); drift.

Practice lowers thresholds, fatigue raises them. A deviance over rates cannot show that: if the order of the
trials is random, a drift only makes the function flatter. The order shows it. For small drifts δ of
ln(threshold) from the first trial to the last, the answers' residuals go with time times the slope of ψ; the
score of δ, with the parts explained by each level's threshold and width taken out, is compared with its own
standard deviation.
"""

from __future__ import annotations

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
    fit_psychometric,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampCounts,
    RampLevelKey,
    Repeats,
    TrialKey,
    catch_counts,
    counts_by_participant_and_level,
    group_by_participant_and_level,
    key_of_trial,
    level_of_threshold,
)
from evenlight.analysis.calibration.psychometric.signal_detection import (
    COMPARED_D_PRIME,
    TWO_INTERVAL_D_PRIME,
    criterion_of,
    interval_bias_of,
    rate_of_d_prime,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction, threshold_logit, yes_probability

UNUSABLE = (ThresholdFlag.ALL_YES, ThresholdFlag.ALL_NO, ThresholdFlag.FALSE_ALARMS)
MAX_FALSE_ALARM_RATE = 0.5  # above it, "yes" is said more often than not to nothing at all
LARGEST_LN_RATIO = 3.0  # a first-order estimate beyond a factor of 20 says only that the drift is large
LEAST_INFORMATION = 1e-3  # a standard error of 30 in ln(threshold): nothing is known


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """A threshold with the fit that it comes from: what a figure of one psychometric function needs."""

    threshold: Threshold
    fit: PsychometricFit
    goodness: GoodnessOfFit | None = None  # None with too few rates to judge by


def level_of_fit(fit: ThresholdFit) -> RampLevelKey:
    """Return the level that a fit belongs to."""
    return level_of_threshold(fit.threshold)


def fit_thresholds_of(
    trials: Iterable[RampTrial],
    report: Callable[[int, int], None] = lambda done, total: None,
    judge: bool = True,
    fine: tuple[int, int, int, int] = FINE_NODES,
    repeats: Repeats | None = None,
) -> list[ThresholdFit]:
    """Fit a threshold for every participant and level of some trials.

    A participant's catch trials inform the guess rate at all levels: whether to say "yes" without seeing
    anything is a matter of the person's criterion, not of the luminance (docs/decisions/yes-no-task.md).

    Parameters
    ----------
    trials : iterable of RampTrial
        Of one or more participants and sessions.
    report : callable, optional
        Called with the fits done and their total.
    judge : bool
        Whether to judge each fit by Monte Carlo, which takes about as long as the fit itself.
    fine : tuple of int
        Nodes of the grid that integrates a posterior.
    repeats : Repeats, optional
        That the last answer is given again in some of the trials, which the fits leave out.
    """
    groups = group_by_participant_and_level(trials)
    everything = [trial for group in groups.values() for trial in group]
    catches = catch_counts(everything)
    counted = counts_by_participant_and_level(everything, repeats)
    ramps = {key: [trial for trial in groups[key] if not trial.is_catch] for key in counted}
    found = {}
    for done, (key, counts) in enumerate(counted.items(), start=1):
        found[key] = fit_psychometric(counts, fine), goodness_of_fit(counts) if judge else None
        report(done, len(counted))
    times = _trial_times(everything)
    people = {}  # what is a participant's and not a level's
    for who, task in dict.fromkeys((who, level.procedure) for who, level in ramps):
        own = [key for key in ramps if key[0] == who and key[1].procedure is task]
        drift = drift_of([timed_answers(found[key][0].function, ramps[key], times) for key in own])
        bias = _bias(task, catches.get(who), [trial for key in own for trial in ramps[key]])
        people[who, task] = bias, drift
    return [
        ThresholdFit(_record(key, fits, groups[key], *people[key[0], key[1].procedure]), *fits)
        for key, fits in found.items()
    ]


def _bias(
    task: Procedure, catches: tuple[int, int] | None, answers: Sequence[RampTrial]
) -> tuple[float | None, float | None]:
    """Return d′ at the threshold, and the criterion or the leaning to one of the intervals."""
    if task is Procedure.TWO_INTERVAL:
        return TWO_INTERVAL_D_PRIME, interval_bias_of(answers).bias
    if catches is None:
        return None, None
    criterion = criterion_of(*catches)
    return criterion.d_prime_at_threshold, criterion.criterion


TimedAnswers = tuple[PsychometricFunction, Array, Array, Array]  # as `drift_of` takes them


def _trial_times(trials: Iterable[RampTrial]) -> dict[TrialKey, float]:
    """Return the place of each trial among all of its participant's, from 0 (first) to 1 (last).

    Sessions follow each other in order of their names.
    """
    keys: dict[str, set[TrialKey]] = {}
    for trial in trials:
        keys.setdefault(trial.participant_id, set()).add(key_of_trial(trial))
    return {
        key: place / max(len(own) - 1, 1) for own in keys.values() for place, key in enumerate(sorted(own))
    }


def timed_answers(
    function: PsychometricFunction, ramps: Sequence[RampTrial], times: dict[TrialKey, float]
) -> TimedAnswers:
    """Return the answers at one level with their places in time, as `drift_of` takes them."""
    rates = np.array([trial.rate for trial in ramps])
    success = np.array([float(trial.success) for trial in ramps])
    return function, rates, success, np.array([times[key_of_trial(trial)] for trial in ramps])


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


def _record(
    key: tuple[str, RampLevelKey],
    fits: tuple[PsychometricFit, GoodnessOfFit | None],
    group: Sequence[RampTrial],
    bias: tuple[float | None, float | None],
    drift: tuple[float, float] | None,
) -> Threshold:
    (participant, level), (fit, goodness), (d_prime, criterion) = key, fits, bias
    counts = fit.counts
    threshold = fit.function.threshold
    two = level.procedure is Procedure.TWO_INTERVAL
    compared = None
    if criterion is not None:
        compared = rate_of_d_prime(COMPARED_D_PRIME, fit.function, None if two else criterion)
    fit_p = goodness.p_value if goodness else None
    catches = [trial.success for trial in group if trial.is_catch]  # at this level alone
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
        d_prime=d_prime,
        criterion=criterion,
        threshold_d_prime_1=compared,
        deviance=goodness.deviance if goodness else None,
        deviance_p=fit_p,
        drift_ratio=drift[0] if drift else None,
        drift_p=drift[1] if drift else None,
        level_n_catch=len(catches),
        level_false_alarm_rate=sum(catches) / len(catches) if catches else None,
    )


def drift_of(levels: Iterable[TimedAnswers]) -> tuple[float, float] | None:
    """Return how one participant's thresholds moved, to first order; None if no answer tells.

    Those at the end of the trials over those at their beginning, and the p value of no drift. Of each level:
    the function fitted, and of its trials the rate [cd/m^2/s], 1 or 0 for the answer, and the place among all
    of the participant's, from 0 to 1.
    """
    score, information = np.reshape([drift_score(*level) for level in levels], (-1, 2)).sum(axis=0).tolist()
    if information < LEAST_INFORMATION:
        return None
    change = float(np.clip(score / information, -LARGEST_LN_RATIO, LARGEST_LN_RATIO))
    return float(np.exp(change)), float(2 * special.ndtr(-abs(score * information**-0.5)))


def drift_score(f: PsychometricFunction, rates: Array, success: Array, times: Array) -> tuple[float, float]:
    """Return the score at one level of a change of ln(threshold) over time, and its variance.

    Everything is divided by the standard deviation of an answer, so that least squares take the nuisance
    parts out.
    """
    probability = np.clip(yes_probability(rates, f), 1e-9, 1 - 1e-9)
    distance = WIDTH_LOGITS / f.width * (np.log(rates) - np.log(f.threshold))
    rise = special.expit(distance + threshold_logit(f.guess_rate))
    spread = np.sqrt(probability * (1 - probability))
    by_threshold = -(1 - f.guess_rate - f.lapse_rate) * rise * (1 - rise) * WIDTH_LOGITS / f.width / spread
    nuisance = np.column_stack([by_threshold, by_threshold * distance])
    moved = times * by_threshold
    own = moved - nuisance @ np.linalg.lstsq(nuisance, moved, rcond=None)[0]
    return float(own @ ((success - probability) / spread)), float(own @ own)

"""Detection thresholds: one psychometric fit per participant and luminance level (Section 3.4)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from analysis.posterior_grid import PsychometricPrior, RampCounts
from analysis.psychometric_fit import PsychometricFit, fit_psychometric
from data_schema.ramp import RampTrial, Response
from data_schema.threshold import Threshold, ThresholdFlag

MAX_FALSE_ALARM_RATE = 0.5  # above it, "yes" is said more often than not to nothing at all


@dataclass(frozen=True, slots=True)
class RampLevelKey:
    """A luminance level of the experiment: screen, initial brightness factor, initial luminance [cd/m^2]."""

    screen: str
    factor: float
    luminance: float


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """A threshold with the fit that it comes from: what a figure of one psychometric function needs.

    Attributes
    ----------
    threshold : Threshold
        The record.
    fit : PsychometricFit
        Answers, fitted function, posterior.
    """

    threshold: Threshold
    fit: PsychometricFit


@dataclass(frozen=True, slots=True)
class Criterion:
    """How readily a participant says "yes" (signal detection, equal variances).

    Attributes
    ----------
    false_alarm_rate : float
        "Yes" in catch trials, as counted.
    criterion : float
        Distance of the criterion from the mean of "nothing changed", z(1 - FA), in standard deviations.
    d_prime_at_threshold : float
        d′ of a ramp that is noticed in 75 % of the trials: z(0.75) + z(1 - FA); 0.95 is what 75 % correct in
        a true two-interval choice stands for.
    """

    false_alarm_rate: float
    criterion: float
    d_prime_at_threshold: float


def fit_thresholds_of(
    trials: Iterable[RampTrial],
    prior: PsychometricPrior | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
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
    """
    groups = group_by_participant_and_level(trials)
    catches = catch_counts(trial for group in groups.values() for trial in group)
    ramps = {key: [t for t in group if not t.is_catch] for key, group in groups.items()}
    ramps = {key: group for key, group in ramps.items() if group}
    fits = []
    for done, ((participant, level), group) in enumerate(ramps.items(), start=1):
        counts = ramp_counts(group, *catches.get(participant, (0, 0)))
        fit = fit_psychometric(counts, prior)
        fits.append(ThresholdFit(_record(participant, level, fit), fit))
        report(done, len(ramps))
    return fits


def group_by_participant_and_level(
    trials: Iterable[RampTrial],
) -> dict[tuple[str, RampLevelKey], list[RampTrial]]:
    """Return the trials of each participant at each level, in order of participant, screen and factor."""
    groups: dict[tuple[str, RampLevelKey], list[RampTrial]] = {}
    for trial in trials:
        level = RampLevelKey(trial.screen, trial.factor, trial.initial_luminance)
        groups.setdefault((trial.participant_id, level), []).append(trial)
    order = {"white": 0, "gray": 1}
    return dict(
        sorted(
            groups.items(),
            key=lambda item: (item[0][0], order.get(item[0][1].screen, 2), -item[0][1].factor),
        )
    )


def group_by_level(trials: Iterable[RampTrial]) -> dict[RampLevelKey, list[RampTrial]]:
    """Return the trials of all participants at each level."""
    groups: dict[RampLevelKey, list[RampTrial]] = {}
    for trial in trials:
        level = RampLevelKey(trial.screen, trial.factor, trial.initial_luminance)
        groups.setdefault(level, []).append(trial)
    return groups


def catch_counts(trials: Iterable[RampTrial]) -> dict[str, tuple[int, int]]:
    """Return, for each participant, the answers "yes" in catch trials and the catch trials."""
    counts: dict[str, tuple[int, int]] = {}
    for trial in trials:
        if trial.is_catch:
            yes, total = counts.get(trial.participant_id, (0, 0))
            counts[trial.participant_id] = (yes + (trial.response is Response.YES), total + 1)
    return counts


def ramp_counts(ramps: Sequence[RampTrial], catch_yes: int = 0, catch_trials: int = 0) -> RampCounts:
    """Return the answers to ramps of one level, counted by rate."""
    rates, index = np.unique([trial.rate for trial in ramps], return_inverse=True)
    yes = np.array([trial.response is Response.YES for trial in ramps])
    return RampCounts(
        rates=rates,
        n_yes=np.bincount(index, yes, minlength=rates.size).astype(np.int64),
        n_trials=np.bincount(index, minlength=rates.size).astype(np.int64),
        catch_yes=catch_yes,
        catch_trials=catch_trials,
    )


def flag_of(counts: RampCounts, threshold: float) -> ThresholdFlag:
    """Return why a threshold should be looked at before use: the gravest reason first.

    >>> even = RampCounts(np.array([1.0, 2.0]), np.array([0, 4]), np.array([4, 4]))
    >>> flag_of(even, 1.4).value
    'separated'
    """
    if (counts.n_yes == counts.n_trials).all():
        return ThresholdFlag.ALL_YES
    if (counts.n_yes == 0).all():
        return ThresholdFlag.ALL_NO
    if (counts.false_alarm_rate or 0.0) > MAX_FALSE_ALARM_RATE:
        return ThresholdFlag.FALSE_ALARMS
    if threshold < counts.rates[0]:
        return ThresholdFlag.BELOW_RANGE
    if threshold > counts.rates[-1]:
        return ThresholdFlag.ABOVE_RANGE
    fastest_no = counts.rates[counts.n_yes < counts.n_trials].max()
    slowest_yes = counts.rates[counts.n_yes > 0].min()
    return ThresholdFlag.SEPARATED if fastest_no < slowest_yes else ThresholdFlag.NONE


def criterion_of(catch_yes: int, catch_trials: int) -> Criterion:
    """Return a participant's criterion from the catch trials.

    Shares of 0 and 1 are kept off infinity by the log-linear correction (yes + 0.5) / (trials + 1) of Hautus
    (1995).

    >>> never = criterion_of(0, 99)  # corrected: 0.005
    >>> round(never.criterion, 3), round(never.d_prime_at_threshold, 3)  # z(0.995), and z(0.75) = 0.674 more
    (2.576, 3.25)
    """
    corrected = (catch_yes + 0.5) / (catch_trials + 1)
    criterion = -float(special.ndtri(corrected))
    return Criterion(catch_yes / catch_trials, criterion, criterion + float(special.ndtri(0.75)))


def _record(participant: str, level: RampLevelKey, fit: PsychometricFit) -> Threshold:
    """Return the record of a fitted threshold."""
    counts = fit.counts
    threshold = fit.function.threshold
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
        flag=flag_of(counts, threshold),
    )

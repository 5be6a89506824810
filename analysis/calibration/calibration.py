"""The calibration: from the trials of a data set to thresholds and the rate limit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from evenlight.analysis.calibration.level_estimates import LevelEstimates, estimate_levels
from evenlight.analysis.calibration.limit_models import Answers, LimitModels, fit_models
from evenlight.analysis.calibration.psychometric.goodness_of_fit import FEW_TRIALS, joint_p_value
from evenlight.analysis.calibration.psychometric.ramp_counts import catch_counts
from evenlight.analysis.calibration.psychometric.serial_dependence import (
    CLEAR_REPEATS,
    SerialDependence,
    serial_dependence,
)
from evenlight.analysis.calibration.psychometric.session_drift import SessionDrift, session_drift
from evenlight.analysis.calibration.psychometric.signal_detection import (
    Criterion,
    IntervalBias,
    criterion_of,
    false_alarm_warnings,
    interval_biases,
)
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE, ThresholdFit, fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import RateLimitFit
from evenlight.analysis.integrity.concern import LEVEL, Concern, ConcernKind, ordered
from evenlight.analysis.integrity.gate import checked
from evenlight.analysis.ramp_loading import RampData
from evenlight.analysis.wording import percent
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial
from evenlight.data_schema.threshold import ThresholdFlag

CLEAR_P = 0.01  # drifts and misfits of a participant that come by chance less often are reported
NO_CATCH_TRIALS = "there are no catch trials: the prior, not the data, sets the false-alarm rate"


@dataclass(frozen=True, slots=True)
class ParticipantSummary:
    """How consistently a participant answered, over all levels."""

    n_thresholds: int
    n_usable: int  # thresholds that went into the rate limit
    deviance_p: float | None  # of the summed deviance, by Monte Carlo; None with too few rates to judge by
    drift_ratio: float | None  # threshold at the end over that at the beginning
    drift_p: float | None  # how probable as clear a drift is by chance


@dataclass(frozen=True, slots=True, repr=False)
class ThresholdFits:
    """What the trials say without a curve: all that is left where no rate limit can be had.

    Attributes
    ----------
    data, thresholds : RampData, tuple of ThresholdFit
        The trials; a threshold per participant and level.
    criteria : dict of str to Criterion
        How readily each participant says "yes"; without those who had no catch trials.
    interval_biases : dict of str to IntervalBias
        How each participant leans to one of two intervals; empty in yes/no.
    procedure : Procedure
        The task whose answers were fitted.
    concerns : tuple of Concern
        What is wrong with the trials; the warnings begin with them.
    """

    data: RampData
    thresholds: tuple[ThresholdFit, ...]
    criteria: dict[str, Criterion]
    interval_biases: dict[str, IntervalBias]
    procedure: Procedure
    concerns: tuple[Concern, ...]

    def __repr__(self) -> str:
        who, n = len(self.data.participant_ids), len(self.thresholds)
        return f"<{type(self).__name__} of {who} participants: {n} thresholds, {self.procedure.value}>"

    @property
    def participants(self) -> dict[str, ParticipantSummary]:
        """How consistently each participant answered."""
        return _participants(self.thresholds)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the results should know."""
        return self._warnings()

    def _warnings(self, of_curve: tuple[str, ...] = (), shape: tuple[str, ...] = ()) -> tuple[str, ...]:
        asked = self.procedure is Procedure.YES_NO
        said = (
            *(concern.words for concern in self.concerns),
            *of_curve,
            *self.data.warnings,
            *((NO_CATCH_TRIALS,) if asked and not self.criteria else ()),
            *false_alarm_warnings(self.criteria, (fit.threshold for fit in self.thresholds)),
            *_of_participants(self.data.participant_ids, self.participants),
            *_small_samples(self.thresholds),
            *shape,
        )
        return tuple(dict.fromkeys(said))


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Calibration(ThresholdFits):
    """Everything that the trials say: what the files and figures are made from.

    Attributes
    ----------
    models : LimitModels
        The population's curve by each model.
    levels : tuple of LevelEstimates
        The population's threshold at each level, estimated in three ways.
    serial : SerialDependence or None
        How answers go with what came before; None where the order of trials is not known, or of few trials.
    drift : SessionDrift or None
        How thresholds move within a session; None where the order of trials is not known.
    """

    models: LimitModels
    levels: tuple[LevelEstimates, ...]
    serial: SerialDependence | None
    drift: SessionDrift | None

    @property
    def rate_limit(self) -> RateLimitFit:
        """The population's curve, of the model that was chosen."""
        return self.models.fit

    @property
    def excluded_participants(self) -> dict[str, str]:
        """Participants of whom nothing went into the rate limit, and why, as flags."""
        curve, flags = self.rate_limit, dict[str, set[str]]()
        joint = self.models.chosen is RateLimitModel.JOINT  # leaves out nobody for answers that are all alike
        used = {t.participant_id for t in curve.used}
        for t in curve.excluded:
            if t.participant_id not in used:
                why = ThresholdFlag.FALSE_ALARMS if joint else t.flag
                flags.setdefault(t.participant_id, set()).add(why.value)
        return {who: ", ".join(sorted(why)) for who, why in flags.items()}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the results should know."""
        return self._warnings(self.models.first_notes, self.rate_limit.notes)


class NoRateLimitError(InputError):
    """Answers without a rate limit: what is wrong with them is said first, and why no curve can be had.

    Attributes
    ----------
    fits : ThresholdFits
        The thresholds all the same.
    """

    def __init__(self, fits: ThresholdFits, why: InputError) -> None:
        seen = [concern.words for concern in fits.concerns if concern.threatens]
        no_limit = str(why).partition("; test ")[0] if seen else str(why)
        super().__init__("; ".join([*seen, f"no rate limit can be had: {no_limit}"]))
        self.fits = fits


def calibrate(
    data: RampData,
    options: RateLimitOptions | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Calibration:
    """Fit thresholds and the rate limit to the ramp trials of a data set.

    Parameters
    ----------
    data : RampData
        The trials.
    options : RateLimitOptions, optional
        Model, form and degree of the rate limit.
    report : callable, optional
        Called with what is done and the total: of the psychometric fits, then of the joint model's stages.

    Raises
    ------
    NoRateLimitError
        If no curve can be fitted, for instance to so few luminances; it has the thresholds.
    InputError
        If not the one that was asked for.
    """
    options = options or RateLimitOptions()
    data, concerns = checked(data)
    trials, procedure = trials_of_one_task(data.trials, options.procedure)
    thresholds = tuple(fit_thresholds_of(trials, report=report))
    serial, repeats = serial_dependence(trials, thresholds) if data.order_known else (None, None)
    if repeats:
        thresholds = tuple(fit_thresholds_of(trials, report=report, repeats=repeats))
    drift = session_drift(trials, thresholds) if data.order_known else None
    if not data.order_known:
        thresholds = tuple(
            replace(fit, threshold=replace(fit.threshold, drift_ratio=None, drift_p=None))
            for fit in thresholds
        )
    concerns = ordered((*concerns, *_drifts(_participants(thresholds)), *_serial(serial), *_within(drift)))
    fits: dict[str, Any] = {
        "data": data,
        "thresholds": thresholds,
        "criteria": {who: criterion_of(*counts) for who, counts in catch_counts(trials).items()},
        "interval_biases": interval_biases(trials),
        "procedure": procedure,
        "concerns": concerns,
    }
    try:
        own = [fit.threshold for fit in thresholds]
        models = fit_models(Answers(trials, own, data.display, repeats), options, report)
    except InputError as error:
        wanted = (options.degree, options.direction, options.ramp_duration)
        if any(concern.threatens for concern in concerns) or wanted == (None, None, None):
            raise NoRateLimitError(ThresholdFits(**fits), error) from error
        raise  # another curve was asked for than the answers have
    return Calibration(**fits, models=models, levels=estimate_levels(thresholds), serial=serial, drift=drift)


def trials_of_one_task(
    trials: Sequence[RampTrial], procedure: Procedure | None
) -> tuple[tuple[RampTrial, ...], Procedure]:
    """Return the trials of one task, and which it is.

    Raises
    ------
    InputError
        If there are trials of both and none is named, or none of the one named.
    """
    tasks = sorted({trial.procedure.value for trial in trials})
    if procedure is None:
        if len(tasks) > 1:
            raise InputError(
                f"the data set holds trials of {' and '.join(tasks)}, whose thresholds do not compare; "
                f"choose the procedure {tasks[0]} or {tasks[1]}"
            )
        return tuple(trials), Procedure(tasks[0])
    if procedure.value not in tasks:
        raise InputError(f"the data set holds no trials of {procedure.value}; it holds {' and '.join(tasks)}")
    return tuple(trial for trial in trials if trial.procedure is procedure), procedure


def _participants(thresholds: Iterable[ThresholdFit]) -> dict[str, ParticipantSummary]:
    own: dict[str, list[ThresholdFit]] = {}
    for fit in thresholds:
        own.setdefault(fit.threshold.participant_id, []).append(fit)
    return {
        who: ParticipantSummary(
            n_thresholds=len(fits),
            n_usable=sum(fit.threshold.flag not in UNUSABLE for fit in fits),
            deviance_p=joint_p_value([fit.goodness for fit in fits if fit.goodness]),
            drift_ratio=fits[0].threshold.drift_ratio,
            drift_p=fits[0].threshold.drift_p,
        )
        for who, fits in own.items()
    }


def _drifts(participants: dict[str, ParticipantSummary]) -> tuple[Concern, ...]:
    """Return whose thresholds moved from the beginning of the trials to their end, beyond chance of any."""
    level = LEVEL / max(len(participants), 1)
    return tuple(
        Concern(ConcernKind.HALVES, _drift_in_words(who, person))
        for who, person in participants.items()
        if person.drift_p is not None and person.drift_p < level
    )


def _serial(serial: SerialDependence | None) -> tuple[Concern, ...]:
    """Return how answers go with the one before, or with the ramp before, beyond chance."""
    words = []
    if serial and serial.repeat_p < CLEAR_REPEATS:
        words.append(
            f"in {percent(serial.repeat_share, 0)} of the ramps the last answer is given again, whatever is "
            f"seen (p = {serial.repeat_p:.2g}): the fits leave that out, or the limit would be too high"
        )
    if serial and serial.previous_ramp_p < LEVEL:
        way = "more" if serial.previous_ramp > 0 else "less"
        words.append(
            f"after fast ramps changes are reported {way} often than after slow ones "
            f"(p = {serial.previous_ramp_p:.2g}), which the fits do not take out"
        )
    return tuple(Concern(ConcernKind.SERIAL, own) for own in words)


def _within(drift: SessionDrift | None) -> tuple[Concern, ...]:
    """Return how thresholds move within sessions, beyond chance, and what that does to the limit."""
    if drift is None or drift.p >= LEVEL:
        return ()
    words = (
        f"from a session's first ramp to its last thresholds change by × {drift.ratio:.2f} "
        f"({drift.ci_low:.2f} to {drift.ci_high:.2f}, p = {drift.p:.2g}): the limit is that of the middle, "
        f"and {percent(1 - drift.lowest, 0)} lower at the {'beginning' if drift.ratio > 1 else 'end'}"
    )
    return (Concern(ConcernKind.HALVES, words),)


def _drift_in_words(who: str, person: ParticipantSummary) -> str:
    return (
        f"participant {who}: thresholds at the end of the trials are {person.drift_ratio:.2f} x those at "
        f"their beginning (p = {person.drift_p:.2g})"
    )


def _of_participants(everyone: Sequence[str], fitted: dict[str, ParticipantSummary]) -> list[str]:
    """Return who has no threshold, who a single one, and whose answers drift or follow no function."""
    why = "catch trials only, or the other task than the one that is fitted"
    warnings = [f"participant {who} has no threshold: {why}" for who in everyone if who not in fitted]
    warnings += [
        f"participant {who} has a single level, which says nothing about the curve's shape"
        for who, person in fitted.items()
        if person.n_thresholds == 1
    ]
    for who, person in fitted.items():
        if person.drift_p is not None and person.drift_ratio and person.drift_p < CLEAR_P:
            warnings.append(_drift_in_words(who, person))
        if person.deviance_p is not None and person.deviance_p < CLEAR_P:
            warnings.append(
                f"participant {who}: the answers do not look like those of logistic functions (summed "
                f"deviance, Monte Carlo p = {person.deviance_p:.2g})"
            )
    return warnings


def _small_samples(thresholds: Sequence[ThresholdFit]) -> tuple[str, ...]:
    few = sum(fit.threshold.n_trials < FEW_TRIALS for fit in thresholds)
    if 2 * few <= len(thresholds):
        return ()
    return (
        f"{few} of {len(thresholds)} thresholds rest on fewer than {FEW_TRIALS} ramps, where the deviance of "
        "a single level shows gross misfits only; the participants' summed deviance tells more",
    )

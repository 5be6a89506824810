"""The rate limit by each model that leads from answers to a curve: joint, individual, pooled.

One is chosen; the others are fitted to the same ramps and shown beside it (docs/decisions/which-model.md).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from evenlight.analysis.calibration.joint.joint_fit import JointFit, fit_joint
from evenlight.analysis.calibration.level_estimates import fit_pooled
from evenlight.analysis.calibration.psychometric.ramp_counts import Repeats, joined_luminances
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.conditions import condition_of, conditions_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    RateLimitOptions,
    falling_stretches,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import (
    RateLimitFit,
    fit_thresholds,
    limit_record,
    require_within_rates,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import BandKind, RateLimitForm, RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import RampTrial
from evenlight.data_schema.threshold import Threshold

NAME = "calibration"
FEW_LEVELS = {
    1: "one level makes no curve: the limit is a constant, known there alone",
    2: "two levels make no curve: the limit is a straight line in log-log, and its band that of a line",
}
FEW_PEOPLE = 4  # with three, the joint model's band is too wide for use in a third of the data sets
MOSTLY_PRIOR = (
    f"fewer than {FEW_PEOPLE} participants: how far people differ, and with it much of the band's width, "
    "comes from other studies rather than from these answers"
)
FEW_POOLED = (
    f"The curve of fewer than {FEW_PEOPLE} participants pooled has no band: how its points scatter tells "
    "nothing of how people differ."
)


@dataclass(frozen=True, slots=True)
class Answers:
    """What the models are fitted to: trials of one task, the thresholds fitted to them, and their display."""

    trials: Sequence[RampTrial]
    thresholds: Sequence[Threshold]
    display: Display
    repeats: Repeats | None = None  # trials in which the last answer was given again, if clearly


@dataclass(frozen=True, slots=True)
class LimitModels:
    """The rate limit by each model."""

    chosen: RateLimitModel  # whose curve is the rate limit
    fits: dict[RateLimitModel, RateLimitFit]  # always with the chosen one
    missing: dict[RateLimitModel, str] = field(default_factory=dict)  # why others cannot be fitted
    joint: JointFit | None = None  # what else the joint model tells, where it can be fitted

    @property
    def fit(self) -> RateLimitFit:
        """The chosen model's curve."""
        return self.fits[self.chosen]

    @property
    def others(self) -> dict[RateLimitModel, RateLimitFit]:
        """The curves of the models beside the chosen one."""
        return {model: fit for model, fit in self.fits.items() if model is not self.chosen}

    @property
    def levels(self) -> int:
        """How many levels the limit rests on."""
        here = self.fit.reference
        return _levels(t for t in self.fit.used if here in (None, condition_of(t)))

    @property
    def first_notes(self) -> tuple[str, ...]:
        """What has to be said first of the chosen curve: known too badly for use, or no curve at all."""
        words, notes = self.fit.limit.wide_band, []
        if words:
            notes.append(
                f"the rate limit is not for use: {words} (`evenlight optimize --accept-wide-band` uses it)"
            )
        if self.levels in FEW_LEVELS:
            notes.append(FEW_LEVELS[self.levels])
        if self.chosen is RateLimitModel.JOINT and 1 < _people(self.fit.used) < FEW_PEOPLE:
            notes.append(MOSTLY_PRIOR)
        return tuple(notes)


def _levels(thresholds: Iterable[Threshold]) -> int:
    """Return how many levels were measured: of a display measured again, luminances differ slightly."""
    return len({(t.screen, t.factor) for t in thresholds})


def _people(thresholds: Iterable[Threshold]) -> int:
    return len({t.participant_id for t in thresholds})


def fit_models(
    answers: Answers, options: RateLimitOptions, report: Callable[[int, int], None]
) -> LimitModels:
    """Fit the chosen model, then the others to the same ramps; report the joint model's stages, and how many.

    Raises
    ------
    InputError
        If the chosen model cannot be fitted.
    """
    require_within_rates(answers.thresholds)
    fits: dict[RateLimitModel, RateLimitFit] = {}
    missing: dict[RateLimitModel, str] = {}
    joint = None
    # Which ramps the limit is for, the chosen model tells; for pooled answers the individual one does.
    first = RateLimitModel.INDIVIDUAL if options.model is RateLimitModel.POOLED else options.model
    for model in (first, *(other for other in RateLimitModel if other is not first)):
        try:
            if model is RateLimitModel.JOINT:
                joint = fit_joint(answers.trials, _joint_options(answers, options), report, answers.repeats)
                fits[model] = _joint_limit(joint, answers, options)
            elif model is RateLimitModel.INDIVIDUAL:
                fits[model] = fit_thresholds(answers.thresholds, answers.display, options, NAME)
            else:
                curve = fit_pooled(answers.trials, answers.display, options)
                fits[model] = _pooled_limit(curve, answers, fits.get(RateLimitModel.INDIVIDUAL))
        except InputError as error:
            if model is options.model:
                raise
            missing[model] = str(error)
        reference = fits[model].reference if model in fits else None
        if model is first and reference is not None:
            options = dataclasses.replace(options, **reference.of_limit)
    known = {model: _with_function(fit, joint) for model, fit in fits.items()}
    return LimitModels(options.model, known, missing, joint)


def _with_function(fit: RateLimitFit, joint: JointFit | None) -> RateLimitFit:
    """Return a fit whose limit has the psychometric function that its thresholds are points of.

    Answers pooled over people are nobody's: their function is flattened by how people differ.
    """
    if fit.limit.model is RateLimitModel.POOLED or not fit.own:
        return fit
    width, ends = float(np.exp(np.mean(np.log([t.width for t in fit.own])))), None
    guess, lapse = np.mean([(t.guess_rate, t.lapse_rate) for t in fit.own], axis=0).tolist()
    if fit.limit.model is RateLimitModel.JOINT and joint and joint.options.sigmoid is Sigmoid.LOGISTIC:
        width, ends, lapse = joint.width, joint.width_range, joint.lapse_rate
    spread = None
    if fit.participant_sd is not None and fit.limit.form is not RateLimitForm.RATE:  # whose SDs are of rates
        spread = float(np.hypot(fit.participant_sd, fit.residual_sd or 0.0))
    limit = dataclasses.replace(
        fit.limit, width=width, width_range=ends, participant_sd=spread, guess_rate=guess, lapse_rate=lapse
    )
    return dataclasses.replace(fit, limit=limit)


def _joint_options(answers: Answers, options: RateLimitOptions) -> RateLimitOptions:
    """Return the joint model's options; with one or two levels the shape is no question."""
    options = dataclasses.replace(options, model=RateLimitModel.JOINT)
    levels = min(_levels(answers.thresholds), len(set(joined_luminances(answers.thresholds))))
    if options.form is None and options.degree is None and levels in FEW_LEVELS:
        return dataclasses.replace(options, form=RateLimitForm.LOG_LOG, degree=levels - 1)
    return options


def _joint_limit(joint: JointFit, answers: Answers, options: RateLimitOptions) -> RateLimitFit:
    """Return the joint model's curve, with its simultaneous band."""
    counted = tuple(t for t in answers.thresholds if t.participant_id not in joint.left_out)
    own = [t for t in counted if condition_of(t) == joint.reference]
    points = [t for t in own if t.flag not in UNUSABLE]
    luminance = sorted(set(joined_luminances(own)))
    # Between two levels no answer tells how the curve bends: the band is that of the line, which is said.
    of_line = slice(None, None, joint.band_luminance.size - 1) if _levels(own) == 2 else slice(None)
    edges = joint.band_luminance, joint.simultaneous_lower, joint.simultaneous_upper
    at, lower, upper = (values[of_line] for values in edges)
    limit = limit_record(
        (NAME, answers.display),
        joint.basis,
        joint.coefficients,
        (at, lower, upper),
        (np.array([t.luminance for t in points]), np.array([t.threshold for t in points])),
        options,
        condition_number=max(1.0, float(np.linalg.cond(joint.basis.design(luminance)))),
        procedure=counted[0].procedure,
        model=RateLimitModel.JOINT,
        band_kind=BandKind.SIMULTANEOUS,
        monotone=options.monotone,
        **joint.reference.of_limit,
    )
    return RateLimitFit(
        limit=limit,
        residual_df=len(luminance) - len(limit.coefficients),
        residual_sd=joint.level_sd.value,
        participant_sd=joint.participant_sd.value if len(joint.participants) > 1 else None,
        falling=falling_stretches(joint.basis, joint.coefficients),
        used=counted,
        excluded=tuple(t for t in answers.thresholds if t.participant_id in joint.left_out),
        notes=joint.notes,
        reference=joint.reference,
        effects=joint.effects,
    )


def _pooled_limit(pooled: RateLimitFit, answers: Answers, individual: RateLimitFit | None) -> RateLimitFit:
    """Return the curve through the pooled answers as the limit of its task and ramps."""
    conditions = conditions_of(answers.thresholds)
    reference = individual.reference if individual else conditions[0] if len(conditions) == 1 else None
    limit = dataclasses.replace(
        pooled.limit,
        procedure=answers.thresholds[0].procedure,
        model=RateLimitModel.POOLED,
        **(reference.of_limit if reference else {}),
    )
    notes = pooled.notes
    if _people(answers.thresholds) < FEW_PEOPLE:
        limit = dataclasses.replace(limit, band_luminance=(), band_lower=(), band_upper=())
        notes = (FEW_POOLED, *notes)
    return dataclasses.replace(
        pooled, limit=limit, notes=notes, used=tuple(answers.thresholds), reference=reference
    )

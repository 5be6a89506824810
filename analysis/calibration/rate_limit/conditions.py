"""Conditions of the ramp experiment, and the mixed model of thresholds with them.

A condition is which way the luminance goes, and for how long. A limit on the rate alone would give ramps of
every duration the same threshold rate; a limit on the amount, as some studies find (Knau 2000, J. Opt. Soc.
Am. A 17, 1382: about the same total change for shallow and steep gradients), would halve it where the
duration doubles. So the rate limit holds for one condition, the reference, and the others are reported as
ratios to it (docs/decisions/ramp-conditions.md). The model has a curve over luminance, a factor for each
participant and one for each condition.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from evenlight.analysis.calibration.psychometric.ramp_counts import joined_luminances
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    CurveBasis,
    RateLimitOptions,
    basis_for,
    bounds,
)
from evenlight.analysis.inference.mixed_model import GroupedEstimates, MixedModelFit, fit_mixed_model
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Direction
from evenlight.data_schema.threshold import Threshold

LEAST_PARTICIPANTS = 3  # to tell how the effect differs between them


@dataclass(frozen=True, slots=True)
class Condition:
    """A direction and a duration of ramps [s]."""

    direction: Direction
    ramp_duration: float

    @property
    def words(self) -> str:
        """What it is, for a sentence.

        >>> Condition(Direction.DOWN, 5.0).words
        'falling ramps of 5 s'
        """
        return _ramps(self.direction, self.ramp_duration)

    @property
    def of_limit(self) -> dict[str, Any]:
        """The fields of a rate limit or of its options that name the ramps."""
        return {"direction": self.direction, "ramp_duration": self.ramp_duration}


@dataclass(frozen=True, slots=True)
class ConditionEffect:
    """The thresholds of a condition as a multiple of the reference's."""

    condition: Condition
    reference: Condition
    ratio: float  # of the threshold rates
    ci_low: float  # its 95 % confidence interval
    ci_high: float

    @property
    def ratio_of_equal_amounts(self) -> float:
        """The ratio that the same total change at threshold would give."""
        return self.reference.ramp_duration / self.condition.ramp_duration

    @property
    def in_words(self) -> str:
        """What was found, as a sentence."""
        known = bounds(self.ci_low, self.ci_high, ".2f")
        words = (
            f"{self.condition.words} have {self.ratio:.2f} x the threshold rate of {self.reference.words} "
            f"({known})"
        )
        if self.condition.ramp_duration != self.reference.ramp_duration:
            words += (
                f"; 1.00 would be a limit on the rate, {self.ratio_of_equal_amounts:.2f} one on the amount "
                "of change"
            )
        return words


def condition_of(threshold: Threshold) -> Condition:
    """Return the condition of a threshold."""
    return Condition(threshold.direction, threshold.ramp_duration)


def conditions_of(thresholds: Iterable[Threshold]) -> tuple[Condition, ...]:
    """Return the conditions of some thresholds: falling before rising, short before long."""
    found = {condition_of(threshold) for threshold in thresholds}
    return tuple(sorted(found, key=lambda c: (c.direction is not Direction.DOWN, c.ramp_duration)))


def allowed_references(conditions: Sequence[Condition], options: RateLimitOptions) -> tuple[Condition, ...]:
    """Return the conditions that a rate limit may be for: all, or those that the options name.

    Raises
    ------
    InputError
        If there is none.
    """
    allowed = tuple(
        condition
        for condition in conditions
        if options.direction in (None, condition.direction)
        and options.ramp_duration in (None, condition.ramp_duration)
    )
    if conditions and not allowed:
        there = ", ".join(condition.words for condition in conditions)
        wanted = _ramps(options.direction, options.ramp_duration)
        raise InputError(f"no usable threshold of {wanted}; there are {there}")
    return allowed


def _ramps(direction: Direction | None, duration: float | None) -> str:
    way = {None: "", Direction.DOWN: "falling ", Direction.UP: "rising "}[direction]
    return f"{way}ramps" + (f" of {duration:g} s" if duration else "")


def _effect_of(
    pair: tuple[Condition, Condition],
    ln_ratio: float,
    model_error: float,
    residuals: Array,
    thresholds: Sequence[Threshold],
) -> ConditionEffect:
    """Return the effect of a condition with its confidence interval (Student's t over participants).

    The model's standard error assumes the same ratio for everyone. Where three participants or more saw
    both conditions, the scatter of their own ratios gives another, and the larger one is stated.
    `pair`: the condition and the reference; `residuals`: ln(threshold) minus the reference's curve.
    """
    condition, reference = pair
    own: dict[str, dict[Condition, list[float]]] = {}
    for value, threshold in zip(residuals.tolist(), thresholds, strict=True):
        own.setdefault(threshold.participant_id, {}).setdefault(condition_of(threshold), []).append(value)
    differences = [
        float(np.mean(seen[condition]) - np.mean(seen[reference]))
        for seen in own.values()
        if condition in seen and reference in seen
    ]
    return effect_with_interval(pair, ln_ratio, model_error, differences)


def effect_with_interval(
    pair: tuple[Condition, Condition], ln_ratio: float, model_error: float, differences: Sequence[float]
) -> ConditionEffect:
    """Return an effect with its interval, given the participants' own ln(ratio), up to a constant."""
    error, n = model_error, len(differences)
    if n >= LEAST_PARTICIPANTS:
        error = max(error, float(np.std(differences, ddof=1)) / n**0.5)
    half = float(special.stdtrit(max(n - 1, 1), 0.975)) * error
    low, middle, high = np.exp(np.clip([ln_ratio - half, ln_ratio, ln_ratio + half], -50, 50)).tolist()
    return ConditionEffect(*pair, middle, low, high)


# A curve, the mixed model that it is of, and the thresholds fitted. The model has the curve's coefficients
# first, then the effects of the conditions.
FittedCurve = tuple[CurveBasis, MixedModelFit, GroupedEstimates]


def model_of_thresholds(
    used: Sequence[Threshold], options: RateLimitOptions
) -> tuple[FittedCurve, Condition, tuple[ConditionEffect, ...]]:
    """Return the curve of the reference condition, which that is, and the others' effects in ln(rate).

    The polynomial of the rate itself has no additive effect in ln(rate): it is fitted to the reference's
    thresholds alone, the effects come from the polynomial of ln(rate).
    """
    conditions = conditions_of(used)
    if len(conditions) < 2:
        allowed_references(conditions, options)
        return _model(used, options, conditions[0])[0], conditions[0], ()
    logarithmic = options
    if options.form is RateLimitForm.RATE:
        logarithmic = dataclasses.replace(options, form=RateLimitForm.LN_RATE)
    allowed = allowed_references(conditions, options)
    reference = allowed[0]
    curve, effects = _model(used, logarithmic, reference)
    ratios = {effect.condition: effect.ratio for effect in effects if effect.condition in allowed}
    lowest = min(ratios, key=lambda condition: ratios[condition], default=reference)
    if ratios.get(lowest, 1.0) < 1.0:
        reference = lowest
        curve, effects = _model(used, logarithmic, reference)
    if options.form is RateLimitForm.RATE:
        curve, _ = _model([t for t in used if condition_of(t) == reference], options, reference)
    return curve, reference, effects


def _model(
    used: Sequence[Threshold], options: RateLimitOptions, reference: Condition
) -> tuple[FittedCurve, tuple[ConditionEffect, ...]]:
    luminance = np.array([t.luminance for t in used])
    basis = basis_for(luminance, options, len(set(joined_luminances(used))))
    own = [condition_of(t) for t in used]
    others = [condition for condition in conditions_of(used) if condition != reference]
    is_other = np.array([[float(c == other) for other in others] for c in own]).reshape(len(own), len(others))
    design = np.column_stack([basis.design(luminance), is_other])
    _require_distinct(design, others)
    rates = np.array([t.threshold for t in used])
    errors = np.array([t.standard_error_ln for t in used])
    if basis.form is RateLimitForm.RATE:
        errors = errors * rates  # first order: d(rate) = rate d(ln rate)
    _, groups = np.unique([t.participant_id for t in used], return_inverse=True)
    data = GroupedEstimates(basis.ordinate(rates), errors, design, groups.astype(np.int64))
    model = fit_mixed_model(data)
    size = basis.degree + 1
    residuals = data.values - design[:, :size] @ model.coefficients[:size]
    deviations = np.sqrt(np.diag(model.covariance))
    effects = tuple(
        _effect_of((other, reference), float(ln_ratio), float(error), residuals, used)
        for other, ln_ratio, error in zip(others, model.coefficients[size:], deviations[size:], strict=True)
    )
    return (basis, model, data), effects


def _require_distinct(design: Array, others: Sequence[Condition]) -> None:
    """Refuse conditions whose effect cannot be separated from the curve's shape."""
    if others and np.linalg.matrix_rank(design) < design.shape[1]:
        raise InputError(
            f"the effect of {others[0].words} cannot be separated from the curve's shape: the conditions "
            "share too few luminances; measure them at the same levels, fit them apart, or give a "
            "lower degree"
        )

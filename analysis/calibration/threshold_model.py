"""The mixed model of thresholds: a curve over luminance, a factor for each participant and condition."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.calibration.conditions import (
    Condition,
    ConditionEffect,
    allowed_references,
    condition_of,
    conditions_of,
    effect_of,
    indicators,
)
from evenlight.analysis.calibration.rate_limit_curve import (
    CurveBasis,
    LuminanceAbscissa,
    RateLimitOptions,
    basis_for,
)
from evenlight.analysis.inference.mixed_model import GroupedEstimates, MixedModelFit, fit_mixed_model
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.ramp import Direction
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.threshold import Threshold


@dataclass(frozen=True, slots=True)
class ThresholdModel:
    """The mixed model of thresholds of one or several conditions.

    Attributes
    ----------
    basis : CurveBasis
        Of the curve.
    model : MixedModelFit
        The curve's coefficients first, then the effects of the conditions.
    data : GroupedEstimates
        What it was fitted to.
    luminance : array (n,)
        At which each threshold was entered [cd/m^2].
    reference : Condition or None
        Whose curve it is; None without thresholds.
    effects : tuple of ConditionEffect
        Of the other conditions.
    """

    basis: CurveBasis
    model: MixedModelFit
    data: GroupedEstimates
    luminance: NDArray[np.float64]
    reference: Condition | None
    effects: tuple[ConditionEffect, ...] = ()


def model_of_thresholds(used: Sequence[Threshold], options: RateLimitOptions) -> ThresholdModel:
    """Return the curve of the reference condition, and the other conditions' effects in ln(rate).

    The polynomial of the rate itself has no additive effect in ln(rate): it is fitted to the reference's
    thresholds alone, the effects come from the polynomial of ln(rate).
    """
    conditions = conditions_of(used)
    if len(conditions) < 2:
        allowed_references(conditions, options)
        return _model(used, options, conditions[0] if conditions else None)
    logarithmic = options
    if options.form is RateLimitForm.RATE:
        logarithmic = dataclasses.replace(options, form=RateLimitForm.LN_RATE)
    allowed = allowed_references(conditions, options)
    found = _model(used, logarithmic, allowed[0])
    ratios = {effect.condition: effect.ratio for effect in found.effects if effect.condition in allowed}
    lowest = min(ratios, key=lambda condition: ratios[condition], default=allowed[0])
    if ratios.get(lowest, 1.0) < 1.0:
        found = _model(used, logarithmic, lowest)
    if options.form is not RateLimitForm.RATE:
        return found
    own = [t for t in used if condition_of(t) == found.reference]
    return dataclasses.replace(_model(own, options, found.reference), effects=found.effects)


def _model(
    used: Sequence[Threshold], options: RateLimitOptions, reference: Condition | None
) -> ThresholdModel:
    """Return the mixed model with a given reference."""
    L = abscissae(used, options)
    basis = basis_for(L, options)
    others = [condition for condition in conditions_of(used) if condition != reference]
    data = _grouped(used, L, basis, indicators(used, others))
    _require_distinct(data.design, others)
    model = fit_mixed_model(data)
    size = basis.degree + 1
    residuals = data.values - data.design[:, :size] @ model.coefficients[:size]
    errors = np.sqrt(np.diag(model.covariance))
    effects = tuple(
        effect_of((other, reference), float(ln_ratio), float(error), residuals, used)
        for other, ln_ratio, error in zip(others, model.coefficients[size:], errors[size:], strict=True)
        if reference is not None
    )
    return ThresholdModel(basis, model, data, L, reference, effects)


def abscissae(thresholds: Sequence[Threshold], options: RateLimitOptions) -> NDArray[np.float64]:
    """Return the luminance at which each threshold is entered [cd/m^2].

    Mean and final luminance depend on the threshold itself. To keep its error off the abscissa, they are
    taken for each level at the geometric mean of the participants' thresholds there.
    """
    initial = np.array([t.luminance for t in thresholds])
    share = {LuminanceAbscissa.INITIAL: 0.0, LuminanceAbscissa.MEAN: 0.5, LuminanceAbscissa.FINAL: 1.0}
    if not initial.size or options.abscissa is LuminanceAbscissa.INITIAL:
        return initial
    change = np.array([(1 if t.direction is Direction.UP else -1) * t.ramp_duration for t in thresholds])
    _, level = np.unique(np.column_stack([initial, change]), axis=0, return_inverse=True)
    ln_rates = np.log([t.threshold for t in thresholds])
    typical = np.exp(np.bincount(level, ln_rates) / np.bincount(level))[level]
    return np.asarray(initial + share[options.abscissa] * change * typical)


def _grouped(
    thresholds: Sequence[Threshold],
    luminance: NDArray[np.float64],
    basis: CurveBasis,
    conditions: NDArray[np.float64],
) -> GroupedEstimates:
    """Return the thresholds as the mixed model takes them."""
    rates = np.array([t.threshold for t in thresholds])
    errors = np.array([t.standard_error_ln for t in thresholds])
    if basis.form is RateLimitForm.RATE:
        errors = errors * rates  # first order: d(rate) = rate d(ln rate)
    _, groups = np.unique([t.participant_id for t in thresholds], return_inverse=True)
    design = np.column_stack([basis.design(luminance), conditions])
    return GroupedEstimates(basis.ordinate(rates), errors, design, groups.astype(np.int64))


def band_df(data: GroupedEstimates) -> float:
    """Return the degrees of freedom of the band: of the participants, or of one participant's scatter.

    The curve's height is a mean over participants, so its variance is known from P values only.
    """
    if data.n_groups > 1:
        return float(data.n_groups - 1)
    df = data.values.size - data.design.shape[1]
    return float(df) if df > 0 else float("inf")


def _require_distinct(design: NDArray[np.float64], others: Sequence[Condition]) -> None:
    """Refuse conditions whose effect cannot be told from the curve's shape."""
    if others and np.linalg.matrix_rank(design) < design.shape[1]:
        raise InputError(
            f"the effect of {others[0].words} cannot be told from the curve's shape: the conditions share "
            "too few luminances; measure them at the same levels, fit them apart, or give a lower --degree"
        )

"""The joint model: one hierarchical model from all answers to the rate limit, with a simultaneous band.

P(success) = ψ(rate; threshold, width, guess, lapse), and
ln threshold_pl = f(L_l) + effects of conditions + u_p + v_pl, u_p ~ N(0, σ_u²), v_pl ~ N(0, τ²).
No threshold of a single participant is estimated first: everyone counts as far as their answers go, also who
answered all alike (docs/decisions/joint-model.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evenlight.analysis.calibration.joint.answer_tables import AnswerTables, answer_tables
from evenlight.analysis.calibration.joint.curve_bands import (
    band_luminances,
    drawn_curves,
    narrowed_to_rising,
    pointwise_band,
    simultaneous_band,
)
from evenlight.analysis.calibration.joint.marginal_likelihood import smoothed
from evenlight.analysis.calibration.joint.participant_factors import (
    ParticipantFactor,
    SpreadEstimate,
    condition_effects,
    participant_factors,
    spread_estimate,
)
from evenlight.analysis.calibration.joint.polynomial_shape import (
    ShapeScore,
    fitted_polynomial,
    scored_shapes,
)
from evenlight.analysis.calibration.joint.population_curve import (
    PopulationCurve,
    curve_prior,
    luminance_groups,
    population_curve,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import catch_counts
from evenlight.analysis.calibration.psychometric.thresholds import MAX_FALSE_ALARM_RATE
from evenlight.analysis.calibration.rate_limit.conditions import (
    Condition,
    ConditionEffect,
    allowed_references,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    CurveBasis,
    RateLimitOptions,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import condition_notes, shape_notes
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import RampTrial

CURVES_DRAWN = 4000  # Monte Carlo error of a 95 % band's level: 0.3 %
SEED = 1
STAGES = 4  # of the fit, for a progress bar


@dataclass(frozen=True, slots=True)
class JointFit:
    """The population's rate limit from all answers, and what has to be known to trust it.

    Attributes
    ----------
    basis, coefficients : CurveBasis, array (degree + 1,)
        The polynomial of ln(rate).
    band_luminance : array (97,)
        Where the bands are sampled [cd/m^2]; a single one where the answers are at one luminance.
    simultaneous_lower, simultaneous_upper, pointwise_lower, pointwise_upper : array (97,)
        Edges [cd/m^2/s]: of the whole curve, and of the curve at each luminance. Not of the polynomial:
        they hold the uncertainty of the shape.
    participant_sd, level_sd : SpreadEstimate
        σ_u between participants, and τ of a participant's levels about their own curve, in ln(rate).
    width, lapse_rate : float
        The median person's width, and the mean lapse rate.
    participants : tuple of ParticipantFactor
        One per participant counted.
    shapes : tuple of ShapeScore
        Predictive scores of the shapes.
    reference, effects : Condition, tuple of ConditionEffect
        The ramps that the curve is for, and how the thresholds of others compare.
    falls_surely : bool
        Whether a curve that does not fall was asked for, and none lies within the simultaneous band.
    left_out : tuple of str
        Participants with too many false alarms.
    n_trials : int
        Ramps answered.
    notes : tuple of str
        What a reader should know, as sentences.
    """

    basis: CurveBasis
    coefficients: Array
    band_luminance: Array
    simultaneous_lower: Array
    simultaneous_upper: Array
    pointwise_lower: Array
    pointwise_upper: Array
    participant_sd: SpreadEstimate
    level_sd: SpreadEstimate
    width: float
    lapse_rate: float
    participants: tuple[ParticipantFactor, ...]
    shapes: tuple[ShapeScore, ...]
    reference: Condition
    effects: tuple[ConditionEffect, ...]
    falls_surely: bool
    left_out: tuple[str, ...]
    n_trials: int
    notes: tuple[str, ...]


def fit_joint(
    trials: Sequence[RampTrial],
    options: RateLimitOptions | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> JointFit:
    """Fit the joint model to the answers of all participants in one task.

    Parameters
    ----------
    trials : sequence of RampTrial
        Ramps and catch trials of one task, without practice and flagged trials.
    options : RateLimitOptions, optional
        Shape, band, condition.
    report : callable, optional
        Called with the stages done and their number.

    Raises
    ------
    InputError
        If no answers are left, all answers are alike, or the shape asked for needs more luminances.
    """
    options = options or RateLimitOptions()
    counted, left_out = _without_false_alarmers(trials)
    tables = answer_tables(counted)
    _require_threshold(tables, counted)
    report(1, STAGES)
    population, reference, others = _population(tables, options)
    report(2, STAGES)
    smooth = smoothed(population.tables, population.central.spread.level_sd)
    shapes, shape = scored_shapes(population, smooth, (options.form, options.degree))
    found = fitted_polynomial(shape, population, smooth, options.monotone)
    report(3, STAGES)
    draws = population.draws(CURVES_DRAWN, np.random.default_rng(SEED))
    effects = condition_effects(population, draws, (reference, others))
    fit = JointFit(
        basis=shape.basis,
        coefficients=found[: shape.basis.degree + 1],
        **_bands(population, draws, (shape.basis, found), options),
        **_people(population),
        shapes=shapes,
        reference=reference,
        effects=effects,
        left_out=left_out,
        n_trials=sum(not trial.is_catch for trial in counted),
        notes=(),
    )
    report(STAGES, STAGES)
    spare = int(luminance_groups(tables.luminance).max()) - shape.basis.degree
    return replace(fit, notes=_notes(fit, options, spare))


def _without_false_alarmers(trials: Sequence[RampTrial]) -> tuple[list[RampTrial], tuple[str, ...]]:
    """Return the trials without those who say "yes" to nothing more often than not, and who these are."""
    tasks = sorted({trial.procedure.value for trial in trials})
    if len(tasks) > 1:
        raise InputError(
            f"answers of {' and '.join(tasks)} do not compare (75 % of what?), and make no common rate "
            f"limit; choose the procedure {tasks[0]} or {tasks[1]}"
        )
    left_out = tuple(
        sorted(who for who, (yes, n) in catch_counts(trials).items() if yes > MAX_FALSE_ALARM_RATE * n)
    )
    counted = [trial for trial in trials if trial.participant_id not in left_out]
    if all(trial.is_catch for trial in counted):
        raise InputError(
            f"no ramps are left to fit, got {len(trials)} trials and {len(left_out)} participants with more "
            f"than {MAX_FALSE_ALARM_RATE:.0%} false alarms; a rate limit needs answers to ramps"
        )
    return counted, left_out


def _require_threshold(tables: AnswerTables, trials: Sequence[RampTrial]) -> None:
    """Refuse answers that are all alike: they only bound the threshold."""
    if not tables.all_alike.all():
        return
    ramps = [trial.success for trial in trials if not trial.is_catch]
    share = sum(ramps) / len(ramps)
    advice = "slower" if share > 0.9 else "faster" if share < 0.6 else "slower and faster"
    raise InputError(
        f"no participant's answers show a threshold, {sum(ramps)} of {len(ramps)} ramps detected: each "
        f"always gave one answer, or was right by chance at best; test {advice} ramps"
    )


def _population(
    tables: AnswerTables, options: RateLimitOptions
) -> tuple[PopulationCurve, Condition, tuple[Condition, ...]]:
    """Return the posterior of the curve, the condition that it is for, and the others."""
    of_levels = [Condition(level.direction, level.ramp_duration) for level in tables.levels]
    allowed = allowed_references(tuple(dict.fromkeys(of_levels)), options)
    population, others = _with_reference(tables, of_levels, allowed[0])
    effects = population.central.mean[population.prior.n_shape :].tolist()
    lower = {one: by for one, by in zip(others, effects, strict=True) if one in allowed and by < 0}
    if not lower:
        return population, allowed[0], others
    reference = min(lower, key=lambda one: lower[one])
    population, others = _with_reference(tables, of_levels, reference)
    return population, reference, others


def _with_reference(
    tables: AnswerTables, of_levels: Sequence[Condition], reference: Condition
) -> tuple[PopulationCurve, tuple[Condition, ...]]:
    """Return the posterior of a condition's curve, and the other conditions, whose effects come after it."""
    others = tuple(one for one in dict.fromkeys(of_levels) if one != reference)
    indicators = np.array([[float(own == one) for one in others] for own in of_levels])
    prior = curve_prior(tables, indicators.reshape(len(of_levels), len(others)))
    return population_curve(tables, prior), others


def _bands(
    population: PopulationCurve, draws: Array, fitted: tuple[CurveBasis, Array], options: RateLimitOptions
) -> dict[str, Any]:
    """Return the bands' luminances and edges [cd/m^2/s]; they hold the fitted polynomial too.

    A band within which every curve falls somewhere stays as it is: the answers speak against what was asked.
    """
    basis, coefficients = fitted
    luminance = band_luminances(population.tables.luminance)
    curves = drawn_curves(population, draws, luminance)
    curve = np.full(luminance.size, coefficients[0])
    if basis.degree:
        curve = basis.design(luminance) @ coefficients[: basis.degree + 1]
    bands: dict[str, Any] = {"band_luminance": luminance}
    for kind, band in (("pointwise", pointwise_band), ("simultaneous", simultaneous_band)):
        lower, upper = band(curves, options.band_level)
        narrowed = narrowed_to_rising(lower, upper) if options.monotone else (lower, upper)
        bands["falls_surely"] = narrowed is None  # in the end of the simultaneous one
        lower, upper = narrowed or (lower, upper)
        bands[f"{kind}_lower"] = basis.rate(np.minimum(lower, curve))
        bands[f"{kind}_upper"] = basis.rate(np.maximum(upper, curve))
    return bands


def _people(population: PopulationCurve) -> dict[str, Any]:
    """Return what is found of the participants: spreads, width, lapse rate, factors."""
    spreads, central = [node.spread for node in population.nodes], population.central
    lapses = (central.evaluation.of_nodes * population.tables.lapse_rate).sum(axis=1)
    return {
        "participant_sd": spread_estimate([one.participant_sd for one in spreads], population.weights),
        "level_sd": spread_estimate([one.level_sd for one in spreads], population.weights),
        "width": float(np.exp(central.spread.width_mean)),
        "lapse_rate": float(lapses.mean()),
        "participants": participant_factors(population),
    }


def _notes(fit: JointFit, options: RateLimitOptions, spare: int) -> tuple[str, ...]:
    """Return what a reader of the curve should know."""
    notes = []
    if fit.left_out:
        notes.append(
            f"Left out for saying yes in more than {MAX_FALSE_ALARM_RATE:.0%} of the catch trials: "
            f"{', '.join(fit.left_out)}."
        )
    alike = [person.participant_id for person in fit.participants if person.all_alike]
    if alike:
        notes.append(
            f"All answers of {', '.join(alike)} are alike: they bound the threshold from one side, and count "
            "as far as that goes."
        )
    if len(fit.participants) == 1:
        notes.append(
            "One participant: how far the population's curve lies from theirs is not known from these "
            "answers; the band's width rests on what other studies found of differences between people."
        )
    if fit.falls_surely:
        notes.append(
            "The answers speak against a curve that does not fall: none lies within the simultaneous band. "
            "The band is that of free curves, widened to hold this one; fit without --monotone."
        )
    elif options.monotone:
        notes.append(
            "The curve was kept from falling; the band is the part of that of free curves in which such a "
            "curve can run."
        )
    if fit.basis.degree:
        notes += shape_notes(fit.basis, fit.coefficients, spare)
    chosen = options.direction is not None or options.ramp_duration is not None
    return (*notes, *condition_notes(fit.reference, fit.effects, chosen))

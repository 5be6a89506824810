"""The joint model: one hierarchical model from all answers to the rate limit, with a simultaneous band.

P(success) = ψ(rate; threshold, width, guess, lapse), and
ln threshold_pl = f(L_l) + effects of conditions + u_p + v_pl, u_p ~ N(0, σ_u²), v_pl ~ N(0, τ²).
No threshold of a single participant is estimated first: everyone counts as far as their answers go, also who
answered all alike (docs/decisions/joint-model.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy import special

from evenlight.analysis.calibration.joint.marginal_likelihood import (
    AnswerTables,
    SmoothTables,
    answer_tables,
    smoothed,
)
from evenlight.analysis.calibration.joint.polynomial_shape import (
    ShapeScore,
    compared_shapes,
)
from evenlight.analysis.calibration.joint.population_curve import (
    PopulationCurve,
    PriorScales,
    curve_prior,
    luminance_groups,
    population_curve,
    smooth_basis,
    width_sd,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import Repeats, catch_counts
from evenlight.analysis.calibration.psychometric.thresholds import MAX_FALSE_ALARM_RATE
from evenlight.analysis.calibration.rate_limit.conditions import (
    Condition,
    ConditionEffect,
    allowed_references,
    effect_with_interval,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    CurveBasis,
    RateLimitOptions,
    band_luminances,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import condition_notes, shape_notes
from evenlight.analysis.wording import percent
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import RampTrial

CURVES_DRAWN = 4000  # Monte Carlo error of a 95 % band's level: 0.3 %
SEED = 1
STAGES = 4  # of the fit, for a progress bar
CURVE_STEP = 0.05  # ln units of a coefficient, over which participants' deviations are differenced
NORMAL_95 = float(special.ndtri(0.975))
LEAST_INFORMATION = 1.0  # on ln(ratio): a standard error of 1; less says nothing of a participant's effect


@dataclass(frozen=True, slots=True)
class JointFit:
    """The population's rate limit from all answers, and what has to be known to trust it.

    The bands are not those of the polynomial: they hold the uncertainty of the shape.
    """

    basis: CurveBasis  # of the polynomial of ln(rate)
    coefficients: Array  # (degree + 1,)
    # Where the bands are sampled [cd/m^2], (97,); a single one where the answers are at one luminance
    band_luminance: Array
    simultaneous_lower: Array  # edges of the whole curve [cd/m^2/s], (97,)
    simultaneous_upper: Array
    pointwise_lower: Array  # and of the curve at each luminance
    pointwise_upper: Array
    participant_sd: SpreadEstimate  # σ_u between participants, in ln(rate)
    level_sd: SpreadEstimate  # τ of a participant's levels about their own curve
    width: float  # the median person's
    width_range: tuple[float, float]  # and its 95 % credible interval
    lapse_rate: float  # mean
    participants: tuple[ParticipantFactor, ...]  # those counted
    shapes: tuple[ShapeScore, ...]  # compared
    reference: Condition  # the ramps that the curve is for
    effects: tuple[ConditionEffect, ...]  # how the thresholds of others compare
    falls_surely: bool  # whether one that does not fall was asked for, and none lies within the band
    left_out: tuple[str, ...]  # participants with too many false alarms
    n_trials: int  # ramps answered
    notes: tuple[str, ...]  # what a reader should know, as sentences
    population: PopulationCurve = field(repr=False)  # the posterior that all this is of
    options: RateLimitOptions  # with the ramps that the curve is for
    refit: Callable[..., PopulationCurve] = field(
        repr=False
    )  # to the same answers, with other options, scales


def fit_joint(
    trials: Sequence[RampTrial],
    options: RateLimitOptions | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
    repeats: Repeats | None = None,
    scales: PriorScales | None = None,
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
    repeats : Repeats, optional
        That the last answer is given again in some of the trials.
    scales : PriorScales, optional
        Those of the priors.

    Raises
    ------
    InputError
        If no answers are left, all answers are alike, or the shape asked for needs more luminances.
    """
    options, scales = options or RateLimitOptions(), scales or PriorScales()
    counted, left_out = _without_false_alarmers(trials)
    tables = answer_tables(counted, repeats, scales.lapse, options.sigmoid)
    _require_threshold(tables, counted)
    report(1, STAGES)
    population, reference, others = _population(tables, options, scales)
    report(2, STAGES)
    smooth = smoothed(population.tables, population.central.spread.level_sd)
    shapes, shape, found = compared_shapes(population, smooth, options)
    report(3, STAGES)
    draws = population.draws(CURVES_DRAWN, np.random.default_rng(SEED))
    effects = _condition_effects(population, draws, (reference, others))
    fit = JointFit(
        basis=shape.basis,
        coefficients=found[: shape.basis.degree + 1],
        **_bands(population, draws, (shape.basis, found), options),
        **_people(population, smooth),
        shapes=shapes,
        reference=reference,
        effects=effects,
        left_out=left_out,
        n_trials=sum(not trial.is_catch for trial in counted),
        notes=(),
        population=population,
        options=replace(options, **reference.of_limit),
        refit=partial(_refitted, counted, repeats),
    )
    report(STAGES, STAGES)
    spare = int(luminance_groups(tables.luminance).max()) - shape.basis.degree
    return replace(fit, notes=_notes(fit, options, spare))


def _refitted(
    counted: Sequence[RampTrial],
    repeats: Repeats | None,
    options: RateLimitOptions,
    scales: PriorScales | None = None,
) -> PopulationCurve:
    scales = scales or PriorScales()
    return _population(answer_tables(counted, repeats, scales.lapse, options.sigmoid), options, scales)[0]


def _without_false_alarmers(trials: Sequence[RampTrial]) -> tuple[list[RampTrial], tuple[str, ...]]:
    """Leave out those who say "yes" to nothing more often than not, and tell who these are."""
    left_out = tuple(
        sorted(who for who, (yes, n) in catch_counts(trials).items() if yes > MAX_FALSE_ALARM_RATE * n)
    )
    counted = [trial for trial in trials if trial.participant_id not in left_out]
    if all(trial.is_catch for trial in counted):
        raise InputError(
            f"no ramps are left to fit, got {len(trials)} trials and {len(left_out)} participants with more "
            f"than {percent(MAX_FALSE_ALARM_RATE, 0)} false alarms; a rate limit needs answers to ramps"
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
    tables: AnswerTables, options: RateLimitOptions, scales: PriorScales
) -> tuple[PopulationCurve, Condition, tuple[Condition, ...]]:
    """Return the posterior of the curve, the condition that it is for, and the others."""
    of_levels = [Condition(level.direction, level.ramp_duration) for level in tables.levels]
    allowed = allowed_references(tuple(dict.fromkeys(of_levels)), options)
    population, others = _with_reference(tables, of_levels, allowed[0], scales)
    effects = population.central.mean[population.prior.n_shape :].tolist()
    lower = {one: by for one, by in zip(others, effects, strict=True) if one in allowed and by < 0}
    if not lower:
        return population, allowed[0], others
    reference = min(lower, key=lambda one: lower[one])
    population, others = _with_reference(tables, of_levels, reference, scales)
    return population, reference, others


def _with_reference(
    tables: AnswerTables, of_levels: Sequence[Condition], reference: Condition, scales: PriorScales
) -> tuple[PopulationCurve, tuple[Condition, ...]]:
    """Return the posterior of a condition's curve, and the other conditions, whose effects come after it."""
    others = tuple(one for one in dict.fromkeys(of_levels) if one != reference)
    indicators = np.array([[float(own == one) for one in others] for own in of_levels])
    prior = curve_prior(tables, indicators.reshape(len(of_levels), len(others)), scales)
    return population_curve(tables, prior), others


def _bands(
    population: PopulationCurve, draws: Array, fitted: tuple[CurveBasis, Array], options: RateLimitOptions
) -> dict[str, Any]:
    """Return the bands' luminances and edges [cd/m^2/s]; they hold the fitted polynomial too.

    A band within which every curve falls somewhere stays as it is: the answers speak against what was asked.
    """
    basis, coefficients = fitted
    measured = population.tables.luminance
    luminance = band_luminances(float(measured.min()), float(measured.max()))
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


def _people(population: PopulationCurve, smooth: SmoothTables) -> dict[str, Any]:
    spreads, central = [node.spread for node in population.nodes], population.central
    people = _participant_factors(population, smooth)
    ends = central.spread.width_mean + NORMAL_95 * width_sd(population) * np.array([-1.0, 1.0])
    return {
        "participant_sd": _spread_estimate([one.participant_sd for one in spreads], population.weights),
        "level_sd": _spread_estimate([one.level_sd for one in spreads], population.weights),
        "width": float(np.exp(central.spread.width_mean)),
        "width_range": tuple(np.exp(ends).tolist()),
        "lapse_rate": float(np.mean([person.lapse_rate for person in people])),
        "participants": people,
    }


def _notes(fit: JointFit, options: RateLimitOptions, spare: int) -> tuple[str, ...]:
    notes = []
    if fit.left_out:
        notes.append(
            f"Left out for saying yes in more than {percent(MAX_FALSE_ALARM_RATE, 0)} of the catch trials: "
            f"{', '.join(fit.left_out)}."
        )
    alike = [person.participant_id for person in fit.participants if person.all_alike]
    if alike:
        notes.append(
            f"The answers of {', '.join(alike)} are all alike, or no better than guesses: they bound the "
            "threshold from one side, and count as far as that goes."
        )
    if len(fit.participants) == 1:
        notes.append(
            "One participant: how far the population's curve lies from theirs is not known from these "
            "answers; the band's width rests on what other studies found of differences between people."
        )
    if fit.falls_surely:
        notes.append(
            "The answers speak against a curve that does not fall: none lies within the simultaneous band. "
            "The band is that of free curves, widened to hold this one; let it fall."
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


@dataclass(frozen=True, slots=True)
class SpreadEstimate:
    """A standard deviation of ln(threshold): posterior median and 95 % credible interval."""

    value: float
    ci_low: float
    ci_high: float


@dataclass(frozen=True, slots=True)
class ParticipantFactor:
    """A participant's thresholds as a multiple of the population's curve, e^{u_p}."""

    participant_id: str
    factor: float  # posterior median
    ci_low: float  # 95 % credible interval, of person and curve together
    ci_high: float
    width: float  # of the psychometric function
    lapse_rate: float  # posterior mean and standard deviation
    lapse_sd: float
    all_alike: bool  # whether all answers were alike: they bound the factor from one side only


def drawn_curves(population: PopulationCurve, coefficients: Array, luminance: Array) -> Array:
    """Return ln(rate) of curves at luminances, (curves, luminances), of coefficients drawn, (curves, q)."""
    n_shape = population.prior.n_shape
    columns = smooth_basis(population.tables.luminance).design(luminance)[:, :n_shape]
    return np.asarray(coefficients[:, :n_shape] @ columns.T)


def pointwise_band(curves: Array, level: float) -> tuple[Array, Array]:
    """Return the edges between which the curve lies at a luminance, for each of them."""
    lower, upper = np.quantile(curves, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return lower, upper


def simultaneous_band(curves: Array, level: float) -> tuple[Array, Array]:
    """Return the edges between which the whole curve lies: mean ± c · standard deviation.

    c is the quantile of the largest deviation of a curve anywhere, in standard deviations there.

    >>> straight = np.linspace(-1, 1, 201)[:, None] * np.ones((1, 3))  # curves that move as a whole
    >>> lower, upper = simultaneous_band(straight, 0.9)
    >>> upper.round(6).tolist()
    [0.9, 0.9, 0.9]
    """
    middle, sd = curves.mean(axis=0), curves.std(axis=0)
    largest = np.max(np.abs(curves - middle) / sd, axis=1)
    half = float(np.quantile(largest, level)) * sd
    return middle - half, middle + half


def narrowed_to_rising(lower: Array, upper: Array) -> tuple[Array, Array] | None:
    """Return the part of a band that a curve which does not fall can run through; None if none can.

    If such a curve lies in the band, it is at least the lower edge's highest value so far, and at most the
    upper edge's lowest value from there on.

    >>> narrowed = narrowed_to_rising(np.array([1.0, 0.5, 2.0]), np.array([3.0, 5.0, 4.0]))
    >>> [edge.tolist() for edge in narrowed]
    [[1.0, 1.0, 2.0], [3.0, 4.0, 4.0]]
    >>> narrowed_to_rising(np.array([2.0, 0.5]), np.array([3.0, 1.0])) is None
    True
    """
    highest = np.maximum.accumulate(lower)
    lowest = np.minimum.accumulate(upper[::-1])[::-1]
    return (highest, lowest) if (highest <= lowest).all() else None


def _participant_factors(population: PopulationCurve, smooth: SmoothTables) -> tuple[ParticipantFactor, ...]:
    """Return the factor of each participant, over all sizes of the spreads and all curves.

    Where the curve lay lower, a participant would lie higher above it: an interval at the fitted curve alone
    is too narrow, of few people by a third. How far they move with it is taken to first order.
    """
    tables = population.tables
    u = max((node.evaluation.u for node in population.nodes), key=len)
    masses = np.zeros((len(tables.participants), u.size))
    for node, weight in zip(population.nodes, population.weights, strict=True):
        seen = node.evaluation
        low = round((seen.u[0] - u[0]) / (u[1] - u[0]))
        masses[:, low : low + seen.u.size] += weight * seen.of_u
    seen = population.central.evaluation
    widths = np.exp((seen.of_nodes * tables.ln_width).sum(axis=1))
    lapses = (seen.of_nodes * tables.lapse_rate).sum(axis=1)
    lapse_sds = np.sqrt((seen.of_nodes * (tables.lapse_rate - lapses[:, None]) ** 2).sum(axis=1))
    moves = _moved_by_curve(population, smooth)
    ends = [np.exp(_with_normal(u, own, sd)).tolist() for own, sd in zip(masses, moves, strict=True)]
    return tuple(
        ParticipantFactor(who, middle, low, high, width, lapse, lapse_sd, alike)
        for who, (low, middle, high), width, lapse, lapse_sd, alike in zip(
            tables.participants,
            ends,
            *(own.tolist() for own in (widths, lapses, lapse_sds, tables.all_alike)),
            strict=True,
        )
    )


def _moved_by_curve(population: PopulationCurve, smooth: SmoothTables) -> Array:
    """Return how far each participant's mean deviation moves with the curve: its standard deviation, (P,)."""
    central, prior = population.central, population.prior
    ordinates = prior.design @ central.at - np.log(population.tables.luminance)

    def deviations(f: Array) -> Array:
        seen = smooth.evaluate(f, central.spread)
        return np.asarray(seen.of_u @ seen.u)

    middle = deviations(ordinates)
    moved = (deviations(ordinates + CURVE_STEP * column) for column in prior.design.T)
    slopes = np.array([(there - middle) / CURVE_STEP for there in moved])  # (q, P)
    offs = [node.mean - node.at for node in population.nodes]
    covariances = [np.linalg.inv(node.precision) for node in population.nodes]
    spread = sum(
        weight * (own + np.outer(off, off))
        for weight, own, off in zip(population.weights, covariances, offs, strict=True)
    )
    return np.asarray(np.sqrt(np.einsum("qp,qr,rp->p", slopes, spread, slopes)))


def _with_normal(nodes: Array, masses: Array, sd: float) -> Array:
    """Return the ends and the median of masses at nodes, the ends of their sum with a normal variable.

    >>> _with_normal(np.array([-0.1, 0.0, 0.1]), np.array([0.01, 0.98, 0.01]), 1.0).round(2).tolist()
    [-1.96, 0.0, 1.96]
    """
    middle = _quantiles(nodes, masses)[1]
    finer = np.concatenate(
        [nodes[0] - np.arange(5, 0, -0.05) * sd, nodes, nodes[-1] + np.arange(0.05, 5, 0.05) * sd]
    )
    below = special.ndtr((finer[:, None] - nodes) / sd) @ (masses / masses.sum())
    low, high = np.interp((0.025, 0.975), below, finer)
    return np.array([low, middle, high])


def _spread_estimate(values: Sequence[float], weights: Array) -> SpreadEstimate:
    """Return the estimate of a standard deviation from the masses of its values."""
    distinct, place = np.unique(np.asarray(values, dtype=np.float64), return_inverse=True)
    masses = np.asarray(np.bincount(place, weights), dtype=np.float64)
    low, middle, high = np.exp(_quantiles(np.log(distinct), masses)).tolist()
    return SpreadEstimate(middle, low, high)


def _quantiles(nodes: Array, masses: Array) -> Array:
    """Return 2.5, 50 and 97.5 % points; half of a node's mass lies below the node."""
    cumulative = (np.cumsum(masses) - masses / 2) / masses.sum()
    return np.interp([0.025, 0.5, 0.975], cumulative, nodes)


def _condition_effects(
    population: PopulationCurve, draws: Array, conditions: tuple[Condition, Sequence[Condition]]
) -> tuple[ConditionEffect, ...]:
    """Return the effects of conditions, given as in `_population`, from coefficients drawn, (n, q).

    The posterior assumes the same ratio for everyone. Where three participants or more saw both conditions,
    the scatter of their own ratios gives another error, and the larger one is stated.
    """
    reference, others = conditions
    found = []
    for k, condition in enumerate(others):
        column = draws[:, population.prior.n_shape + k]
        own = _own_differences(population, condition, reference)
        pair = condition, reference
        found.append(effect_with_interval(pair, float(column.mean()), float(column.std()), own))
    return tuple(found)


def _own_differences(population: PopulationCurve, condition: Condition, reference: Condition) -> list[float]:
    """Return how far each participant's own effect of a condition lies from everyone's, to first order."""
    seen, levels = population.central.evaluation, population.tables.levels
    of_levels = [Condition(level.direction, level.ramp_duration) for level in levels]
    estimates = []
    for one in (condition, reference):
        cells = np.array([own == one for own in of_levels])
        slope, information = seen.slope[cells].sum(axis=0), seen.cell_information[cells].sum(axis=0)
        known = information > LEAST_INFORMATION
        estimates.append(np.where(known, slope / np.where(known, information, 1.0), np.nan))
    difference = estimates[0] - estimates[1]
    return [float(value) for value in difference if np.isfinite(value)]

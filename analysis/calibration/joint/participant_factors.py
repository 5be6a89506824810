"""What the joint model says of single participants, of how they differ, and of the conditions' effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.joint.population_curve import PopulationCurve
from evenlight.analysis.calibration.rate_limit.conditions import (
    LEAST_PARTICIPANTS,
    Condition,
    ConditionEffect,
)
from evenlight.data_schema.arrays import Array

LEAST_INFORMATION = 1.0  # on ln(ratio): a standard error of 1; less says nothing of a participant's effect


@dataclass(frozen=True, slots=True)
class SpreadEstimate:
    """A standard deviation of ln(threshold): posterior median and 95 % credible interval."""

    value: float
    ci_low: float
    ci_high: float


@dataclass(frozen=True, slots=True)
class ParticipantFactor:
    """A participant's thresholds as a multiple of the population's curve.

    Attributes
    ----------
    participant_id : str
        Who.
    factor, ci_low, ci_high : float
        e^{u_p}: posterior median and 95 % credible interval.
    width : float
        Of the psychometric function.
    all_alike : bool
        Whether all answers were alike: they bound the factor from one side only.
    """

    participant_id: str
    factor: float
    ci_low: float
    ci_high: float
    width: float
    all_alike: bool


def participant_factors(population: PopulationCurve) -> tuple[ParticipantFactor, ...]:
    """Return the factor of each participant, over all sizes of the spreads."""
    tables = population.tables
    u = max((node.evaluation.u for node in population.nodes), key=len)
    masses = np.zeros((len(tables.participants), u.size))
    for node, weight in zip(population.nodes, population.weights, strict=True):
        seen = node.evaluation
        low = round((seen.u[0] - u[0]) / (u[1] - u[0]))
        masses[:, low : low + seen.u.size] += weight * seen.of_u
    seen = population.central.evaluation
    widths = np.exp((seen.of_nodes * tables.ln_width).sum(axis=1))
    found = []
    for k, who in enumerate(tables.participants):
        low_end, middle, high_end = np.exp(_quantiles(u, masses[k]))
        own = float(middle), float(low_end), float(high_end), float(widths[k])
        found.append(ParticipantFactor(who, *own, bool(tables.all_alike[k])))
    return tuple(found)


def spread_estimate(values: Sequence[float], weights: Array) -> SpreadEstimate:
    """Return the estimate of a standard deviation whose posterior is given at some values."""
    distinct, place = np.unique(np.asarray(values, dtype=np.float64), return_inverse=True)
    masses = np.asarray(np.bincount(place, weights), dtype=np.float64)
    low, middle, high = np.exp(_quantiles(np.log(distinct), masses)).tolist()
    return SpreadEstimate(middle, low, high)


def _quantiles(nodes: Array, masses: Array) -> Array:
    """Return 2.5, 50 and 97.5 % points; half of a node's mass lies below the node."""
    cumulative = (np.cumsum(masses) - masses / 2) / masses.sum()
    return np.interp([0.025, 0.5, 0.975], cumulative, nodes)


def condition_effects(
    population: PopulationCurve, draws: Array, conditions: tuple[Condition, Sequence[Condition]]
) -> tuple[ConditionEffect, ...]:
    """Return the effects of conditions on the threshold.

    The posterior assumes the same ratio for everyone. Where three participants or more saw both conditions,
    the scatter of their own ratios gives another error, and the larger one is stated.

    Parameters
    ----------
    population, draws : PopulationCurve, array (n, q)
        The posterior and coefficients drawn from it.
    conditions : (Condition, sequence of Condition)
        The reference and the others, in the order of the design's columns.
    """
    reference, others = conditions
    found = []
    for k, condition in enumerate(others):
        column = draws[:, population.prior.n_shape + k]
        own = _own_differences(population, condition, reference)
        error, df = float(column.std()), max(len(own) - 1, 1)
        if len(own) >= LEAST_PARTICIPANTS:
            error = max(error, float(np.std(own, ddof=1)) / len(own) ** 0.5)
        half = float(special.stdtrit(df, 0.975)) * error
        middle = float(column.mean())
        low, ratio, high = np.exp(np.clip([middle - half, middle, middle + half], -50, 50)).tolist()
        found.append(ConditionEffect(condition, reference, ratio, low, high))
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

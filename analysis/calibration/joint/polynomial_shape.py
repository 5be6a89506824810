"""Which polynomial describes the population's curve: chosen by how well it predicts luminances left out.

The score of a shape is the sum, over the luminances measured, of the log predictive density of the answers
there given those at all others, with the spreads held. Densities come from the quadratic expansion of the
likelihood at the smooth curve, so that one evaluation per luminance serves all shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import optimize

from evenlight.analysis.calibration.joint.marginal_likelihood import Evaluation, SmoothTables
from evenlight.analysis.calibration.joint.population_curve import (
    WEAK_SD,
    PopulationCurve,
    information,
    luminance_groups,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    CurveBasis,
    RateLimitOptions,
    basis_for,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitForm

Kind = tuple[RateLimitForm, int]
# Power law, its quadratic and cubic, and the authors' curve
CANDIDATES = (
    (RateLimitForm.LOG_LOG, 1),
    (RateLimitForm.LOG_LOG, 2),
    (RateLimitForm.LOG_LOG, 3),
    (RateLimitForm.LN_RATE, 4),
)
NEWTON_STEPS = 4
SLOPE_SAMPLES = 65  # at which a monotone curve may not fall


@dataclass(frozen=True, slots=True)
class ShapeScore:
    """How well a shape predicts the answers at a luminance from those at all others."""

    form: RateLimitForm
    degree: int
    score: float | None  # log predictive density, summed over the luminances; None with too few of them
    standard_error: float | None  # of the difference to the best score; 0 for the best
    chosen: bool  # whether the curve has this shape
    coefficients: tuple[float, ...]  # of the fitted curve of this shape


@dataclass(frozen=True, slots=True)
class Shape:
    """A polynomial with the effects of conditions."""

    basis: CurveBasis
    design: Array  # polynomials and indicators at each level, (C, d)
    centre: Array  # weak prior mean, (d,)


def _shape_of(form: RateLimitForm, degree: int, population: PopulationCurve) -> Shape:
    prior = population.prior
    luminance = population.tables.luminance
    distinct = int(luminance_groups(luminance).max()) + 1
    basis = basis_for(luminance, RateLimitOptions(form, degree), distinct)
    design = np.column_stack([basis.design(luminance), prior.design[:, prior.n_shape :]])
    if np.linalg.matrix_rank(design) < design.shape[1]:
        raise InputError(
            "the effect of a condition cannot be separated from the curve's shape: the conditions share too "
            "few luminances; measure them at the same levels, fit them apart, or give a lower degree"
        )
    centre = np.linalg.lstsq(design, prior.design @ prior.centre, rcond=None)[0]
    return Shape(basis, design, np.asarray(centre))


def compared_shapes(
    population: PopulationCurve, smooth: SmoothTables, options: RateLimitOptions
) -> tuple[tuple[ShapeScore, ...], Shape, Array]:
    """Return all shapes that the luminances allow, scored and fitted; the one chosen, and its coefficients.

    The tables are smoothed by the level scatter of the central node. Where the options leave form or degree
    open, the score chooses.
    """
    distinct = int(luminance_groups(population.tables.luminance).max()) + 1
    eligible = _eligible(distinct, options)
    others = [kind for kind in CANDIDATES if kind not in eligible and kind[1] <= distinct - 2]
    possible = _possible(population, eligible, others)
    kinds, shapes = list(possible), list(possible.values())
    known = [degree <= distinct - 2 for _, degree in kinds]
    scores, errors = np.zeros((2, 1))
    if distinct > 1:
        densities = _left_out_densities(population, smooth, shapes)
        scores = np.where(known, densities.sum(axis=1), -np.inf)
        errors = (densities - densities[np.argmax(scores)]).std(axis=1, ddof=1) * distinct**0.5
    chosen = int(np.argmax(scores[: sum(kind in eligible for kind in kinds)]))
    curves = [_fitted(shape, population, smooth, options.monotone) for shape in shapes]
    table = tuple(
        ShapeScore(
            *kind,
            score=float(scores[k]) if known[k] else None,
            standard_error=float(errors[k]) if known[k] else None,
            chosen=k == chosen,
            coefficients=tuple(curves[k][: kind[1] + 1].tolist()),
        )
        for k, kind in enumerate(kinds)
    )
    return table, shapes[chosen], curves[chosen]


def _possible(
    population: PopulationCurve, eligible: Sequence[Kind], others: Sequence[Kind]
) -> dict[Kind, Shape]:
    """Return the shapes that the levels allow, those to choose from first; or refuse."""
    possible, refused = {}, None
    for kind in (*eligible, *others):
        try:
            possible[kind] = _shape_of(*kind, population)
        except InputError as error:
            refused = refused or error
    if refused and not any(kind in possible for kind in eligible):
        raise refused
    return possible


def _eligible(distinct: int, options: RateLimitOptions) -> list[Kind]:
    """Return the shapes to choose from: those that a luminance can be left out of, or the simplest."""
    form, degree = options.form, options.degree
    if form is RateLimitForm.RATE:
        raise InputError(
            "the joint model describes ln(rate), got the form rate; choose ln_rate or log_log, or fit the "
            "individual or the pooled model"
        )
    if distinct == 1:
        return [(form or RateLimitForm.LOG_LOG, degree or 0)]
    if form is None and degree is None:
        allowed = [kind for kind in CANDIDATES if kind[1] <= distinct - 2]
        return allowed or [CANDIDATES[0]]
    forms = [form] if form else [RateLimitForm.LOG_LOG, RateLimitForm.LN_RATE]
    degrees = [degree] if degree is not None else list(range(1, max(2, min(5, distinct - 1))))
    return [(one, number) for one in forms for number in degrees]


def _left_out_densities(population: PopulationCurve, smooth: SmoothTables, shapes: Sequence[Shape]) -> Array:
    """Return the log predictive density of each luminance left out, shape (shapes, luminances)."""
    node, ln_luminance = population.central, np.log(population.tables.luminance)
    f, groups = population.prior.design @ node.mean, luminance_groups(population.tables.luminance)
    everywhere = np.arange(f.size, dtype=np.intp)
    found = []
    for left_out in range(-1, int(groups.max()) + 1):  # -1: none
        kept = everywhere[groups != left_out]
        seen = smooth.at_levels(kept).evaluate((f - ln_luminance)[kept], node.spread)
        found.append([_ln_evidence(shape, kept, f, seen) for shape in shapes])
    whole, *parts = (np.array(row) for row in found)
    return np.array([whole - part for part in parts]).T


def _ln_evidence(shape: Shape, kept: NDArray[np.intp], f: Array, seen: Evaluation) -> float:
    """Return the log-likelihood of the answers at some levels, the shape's coefficients integrated out."""
    X = shape.design[kept]
    own = information(X, seen)
    precision = own + np.eye(own.shape[0]) / WEAK_SD**2
    offset = f[kept] - X @ shape.centre
    gradient = X.T @ (seen.gradient - seen.curvature @ offset)
    move = np.linalg.solve(precision, gradient)
    at_centre = seen.value - seen.gradient @ offset + 0.5 * offset @ seen.curvature @ offset
    ln_volume = -own.shape[0] * np.log(WEAK_SD) - 0.5 * np.linalg.slogdet(precision)[1]
    return float(at_centre + 0.5 * move @ gradient + ln_volume)


def _fitted(shape: Shape, population: PopulationCurve, smooth: SmoothTables, monotone: bool) -> Array:
    """Return the coefficients of a shape: their mode at the central spreads, moved to the mixture's mean."""
    node, ln_luminance = population.central, np.log(population.tables.luminance)
    weak = np.eye(shape.centre.size) / WEAK_SD**2
    quadratic = _solved(shape, population, node.evaluation, node.at)
    at = quadratic
    for _ in range(NEWTON_STEPS):
        seen = smooth.evaluate(shape.design @ at - ln_luminance, node.spread)
        precision = information(shape.design, seen) + weak
        move = np.linalg.solve(precision, shape.design.T @ seen.gradient - (at - shape.centre) / WEAK_SD**2)
        at = at + move * min(1.0, 1.0 / max(float(np.abs(shape.design @ move).max()), 1e-12))
    means = np.zeros(at.size)
    for own, weight in zip(population.nodes, population.weights, strict=True):
        if weight > 1e-4:
            means += weight * (_solved(shape, population, own.evaluation, own.at) - quadratic)
    at = at + means
    return _not_falling(shape.basis, at, precision) if monotone else at


def _solved(shape: Shape, population: PopulationCurve, seen: Evaluation, at: Array) -> Array:
    """Return the mode of a shape under the quadratic expansion of the likelihood at a smooth curve."""
    offset = population.prior.design @ at - shape.design @ shape.centre
    gradient = shape.design.T @ (seen.gradient - seen.curvature @ offset)
    precision = information(shape.design, seen) + np.eye(shape.centre.size) / WEAK_SD**2
    return np.asarray(shape.centre + np.linalg.solve(precision, gradient))


def _not_falling(basis: CurveBasis, coefficients: Array, precision: Array) -> Array:
    """Return the most probable coefficients whose curve falls nowhere in the measured range.

    Least distance programming by non-negative least squares (Lawson & Hanson 1974, chapter 23).
    """
    if basis.degree == 0:
        return coefficients
    positions = np.cos(np.linspace(np.pi, 0.0, SLOPE_SAMPLES))
    rises = np.zeros((SLOPE_SAMPLES, coefficients.size))
    of_degrees = legendre.legder(np.eye(basis.degree + 1))
    rises[:, : basis.degree + 1] = legendre.legvander(positions, basis.degree - 1) @ of_degrees
    if (rises @ coefficients >= 0).all():
        return coefficients
    root = np.linalg.inv(np.linalg.cholesky(precision)).T
    system = np.vstack([(rises @ root).T, -(rises @ coefficients)])
    target = np.append(np.zeros(coefficients.size), 1.0)
    residual = system @ optimize.nnls(system, target)[0] - target
    return np.asarray(coefficients - root @ residual[:-1] / residual[-1])

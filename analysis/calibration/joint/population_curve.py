"""The population's curve given the answers: a power law and a smooth deviation, with all spreads unknown.

ln threshold of the median participant is a sum of Legendre polynomials of ln L. The first two make a power
law; the others, up to degree 8, are a smooth deviation whose size is estimated with the rest. So the curve's
uncertainty holds that of its shape. For each size of the spreads the posterior is normal about its mode; the
posterior is their mixture over a grid of spreads, with the spreads' weakly informative priors.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.calibration.joint.marginal_likelihood import (
    AnswerTables,
    Evaluation,
    SmoothTables,
    Spread,
    smoothed,
)
from evenlight.analysis.calibration.psychometric.psychometric_fit import WIDTH_PRIOR
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import CurveBasis
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.rate_limit import RateLimitForm

SMOOTH_DEGREE = 8
LUMINANCE_DIGITS = 4  # of ln(luminance): less is rounding
WEAK_SD = 3.0  # of everything else, about a constant relative rate amid those tested
WIDTH_SPREAD, WIDTH_PEOPLE = 0.4, 4.0  # of ln(width): as if so many people had shown that spread
WIDTH_MEAN_SD = 0.8  # of the population's mean ln(width), about the individual fits' median
LEVEL_SDS = np.geomspace(0.04, 0.7, 11)
DEVIATIONS = np.geomspace(0.02, 0.9, 6)
SPREAD_RATIO = 1.35  # of one participant_sd to the next
NEGLIGIBLE = 6.0  # ln units below the best: spreads that count less are left out
KEPT_NODES = 24  # of width and asymptotes, per participant
ROUNDS = 8  # of the search for the mode
LARGEST_MOVE = 0.5  # ln units, in one step of the search
NEAR_MODE = 0.05  # ln units from which the likelihood is quadratic up to the mode
LONGEST_CLIMB = 30  # steps
TYPICAL_DEVIATION = 0.2
WIDTH_STEP = 0.1  # of ln(width), over which its posterior's curvature is differenced


@dataclass(frozen=True, slots=True)
class PriorScales:
    """How wide the priors are: scales of half-normal ones in ln units, and factors of two others."""

    participant_sd: float = 0.5  # of σ_u: brightness studies find 0.2 to 0.35 between participants
    level_sd: float = 0.25  # of τ
    deviation: float = 0.4  # of the size of the smooth deviation from a power law
    width: float = 1.0  # times the standard deviations of ln(width): of its mean, and over people
    lapse: float = 1.0  # times the mean lapse rate, about


@dataclass(frozen=True, slots=True)
class CurveNode:
    """The curve at one size of the spreads."""

    spread: Spread
    deviation: float  # size of the smooth deviation
    at: Array  # where the answers' likelihood was evaluated, (q,)
    ln_evidence: float  # logarithm of the node's weight
    mean: Array  # of the coefficients' normal posterior, (q,)
    precision: Array  # (q, q)
    evaluation: Evaluation

    def draws(self, size: int, rng: np.random.Generator) -> Array:
        """Return coefficients drawn from the node's posterior, shape (size, q)."""
        root = np.linalg.cholesky(np.linalg.inv(self.precision))
        return np.asarray(self.mean + rng.standard_normal((size, self.mean.size)) @ root.T)


@dataclass(frozen=True, slots=True)
class CurvePrior:
    """The design of the levels, and what is known of its coefficients before the first answer."""

    # Legendre polynomials of each level, then indicators of conditions other than the reference, (C, q)
    design: Array
    centre: Array  # prior mean, (q,)
    n_shape: int  # how many of the columns are the curve's
    scales: PriorScales = field(default_factory=PriorScales)

    def precision(self, deviation: float) -> Array:
        """Return the diagonal of the prior's precision, for a size of the smooth deviation."""
        sd = np.full(self.centre.size, WEAK_SD)
        degree = np.arange(self.n_shape)
        sd[2 : self.n_shape] = deviation * 4.0 / degree[2:] ** 2
        return np.asarray(sd**-2)


@dataclass(frozen=True, slots=True)
class PopulationCurve:
    """The posterior of the population's curve: a mixture of nodes."""

    prior: CurvePrior
    tables: AnswerTables  # with the nodes of width and asymptotes that matter
    nodes: tuple[CurveNode, ...]
    weights: Array
    central: CurveNode  # the most probable

    def reweighed(self, scales: PriorScales) -> PopulationCurve:
        """Return the posterior with other scales of the spreads' priors."""
        of_spreads = "participant_sd", "level_sd", "deviation"
        sizes = np.array([(n.spread.participant_sd, n.spread.level_sd, n.deviation) for n in self.nodes])
        old, new = (
            np.array([getattr(own, name) for name in of_spreads]) for own in (self.prior.scales, scales)
        )
        weights = self.weights * np.exp(0.5 * sizes**2 @ (old**-2.0 - new**-2.0))
        return replace(self, weights=weights / weights.sum())

    def draws(self, size: int, rng: np.random.Generator) -> Array:
        """Return coefficients drawn from the posterior, shape (size, q)."""
        counts = rng.multinomial(size, self.weights).tolist()
        return np.concatenate([node.draws(n, rng) for node, n in zip(self.nodes, counts, strict=True) if n])


def width_sd(population: PopulationCurve) -> float:
    """Return the posterior's standard deviation of the people's mean ln(width).

    It is that of a normal posterior: from the curvature of the evidence, for which the curve is climbed
    again at a smaller and at a larger mean, at the likeliest spreads.
    """
    central, smooth = population.central, smoothed(population.tables, population.central.spread.level_sd)

    def evidence(step: float) -> float:
        spread = replace(central.spread, width_mean=central.spread.width_mean + step)
        return _best_of(_nodes_at(smooth, population.prior, spread, central.mean)).ln_evidence

    bend = 2 * evidence(0.0) - evidence(WIDTH_STEP) - evidence(-WIDTH_STEP)
    return float(
        (max(bend, 0.0) / WIDTH_STEP**2 + (population.prior.scales.width * WIDTH_MEAN_SD) ** -2) ** -0.5
    )


def luminance_groups(luminance: Array) -> NDArray[np.intp]:
    """Return the number of each level's luminance, from 0 for the lowest: two screens may share one.

    >>> luminance_groups(np.array([100.0, 20.0, 101.0, 20.0])).tolist()
    [1, 0, 2, 0]
    """
    return np.unique(np.log(luminance).round(LUMINANCE_DIGITS), return_inverse=True)[1]


def smooth_basis(luminance: Array) -> CurveBasis:
    """Return the polynomials of the smooth curve; a constant for one group of luminances [cd/m^2]."""
    low, high = float(np.min(luminance)), float(np.max(luminance))
    if luminance_groups(luminance).max() == 0:
        return CurveBasis(RateLimitForm.LOG_LOG, 0, (low, low * np.e))
    return CurveBasis(RateLimitForm.LOG_LOG, SMOOTH_DEGREE, (low, high))


def curve_prior(tables: AnswerTables, indicators: Array, scales: PriorScales) -> CurvePrior:
    """Return the prior of the curve's coefficients, about a relative rate amid those tested.

    `indicators`, (C, k), are 1 where a level belongs to a condition other than the reference.
    """
    luminance = tables.luminance
    basis = smooth_basis(luminance)
    columns = basis.design(luminance)
    middle = tables.start + tables.step * (tables.ln_likelihood.shape[2] - 1) / 2
    ends = np.log(basis.luminance_range)
    centre = np.zeros(columns.shape[1] + indicators.shape[1])
    centre[0] = middle + (ends.mean() if basis.degree else ends[0])
    if basis.degree:
        centre[1] = (ends[1] - ends[0]) / 2
    return CurvePrior(np.column_stack([columns, indicators]), centre, columns.shape[1], scales)


def population_curve(tables: AnswerTables, prior: CurvePrior) -> PopulationCurve:
    """Return the posterior of the population's curve."""
    tables, spread, at = _mode(tables, prior)
    profile = []
    for level_sd in LEVEL_SDS.tolist():
        smooth = smoothed(tables, level_sd)
        profile.append((smooth, _best_of(_nodes_at(smooth, prior, replace(spread, level_sd=level_sd), at))))
    best = max(node.ln_evidence for _, node in profile)
    nodes: list[CurveNode] = []
    for smooth, node in profile:
        if node.ln_evidence > best - NEGLIGIBLE:
            nodes += _over_participant_sds(smooth, prior, node)
    ln_weights = np.array([node.ln_evidence for node in nodes])
    weights = np.exp(ln_weights - special.logsumexp(ln_weights))
    return PopulationCurve(prior, tables, tuple(nodes), weights, _best_of(nodes))


def _best_of(nodes: list[CurveNode]) -> CurveNode:
    return max(nodes, key=lambda node: node.ln_evidence)


def _mode(tables: AnswerTables, prior: CurvePrior) -> tuple[AnswerTables, Spread, Array]:
    """Return the tables with the nodes that matter, the likeliest spreads but τ, and the curve's mode."""
    middle = float(np.log(WIDTH_PRIOR[0]))
    spread, at = Spread(0.35, 0.1, middle, prior.scales.width * WIDTH_SPREAD), prior.centre
    smooth = smoothed(tables, spread.level_sd)
    for done in range(ROUNDS):
        at, seen = _climbed(smooth, prior, spread, at)
        spread = _updated(spread, smooth.tables, seen, prior.scales)
        if done == ROUNDS // 2:
            kept = np.argsort(-seen.of_nodes, axis=1)[:, :KEPT_NODES].astype(np.intp)
            tables = tables.with_nodes(kept)
            smooth = smoothed(tables, spread.level_sd)
    return tables, spread, at


def _ordinates(prior: CurvePrior, tables: AnswerTables, at: Array) -> Array:
    """Return ln(threshold / L) of the median participant at each level."""
    return np.asarray(prior.design @ at - np.log(tables.luminance))


def _climbed(smooth: SmoothTables, prior: CurvePrior, spread: Spread, at: Array) -> tuple[Array, Evaluation]:
    """Return a place near the mode of the curve for some spreads, and the likelihood there.

    Newton's method: no step is longer than allowed at any level, or leads downwards.
    """
    precision, longest = prior.precision(TYPICAL_DEVIATION), LARGEST_MOVE
    seen = smooth.evaluate(_ordinates(prior, smooth.tables, at), spread)
    for _ in range(LONGEST_CLIMB):
        values, vectors = np.linalg.eigh(prior.design.T @ seen.curvature @ prior.design)
        upward = (vectors * np.abs(values)) @ vectors.T + np.diag(precision)
        move = np.linalg.solve(upward, prior.design.T @ seen.gradient - precision * (at - prior.centre))
        largest = float(np.abs(prior.design @ move).max())
        if largest < NEAR_MODE:
            break
        further = at + move * min(1.0, longest / largest)
        tried = smooth.evaluate(_ordinates(prior, smooth.tables, further), spread)
        loss = 0.5 * precision @ ((further - prior.centre) ** 2 - (at - prior.centre) ** 2)
        if tried.value - loss > seen.value:
            at, seen = further, tried
        else:
            longest = min(longest, largest) / 4
    return at, seen


def information(design: Array, seen: Evaluation) -> Array:
    """Return minus the curvature of the log-likelihood in the coefficients, with no direction below 0."""
    values, vectors = np.linalg.eigh(-(design.T @ seen.curvature @ design))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _updated(spread: Spread, tables: AnswerTables, seen: Evaluation, scales: PriorScales) -> Spread:
    """Return spreads that are likelier, given what is known of each participant (EM)."""
    people = seen.of_u.shape[0]
    squares = float((seen.of_u @ seen.u**2).sum())
    slack = people * scales.participant_sd**2
    variance = 0.5 * (np.sqrt(slack**2 + 4 * squares * scales.participant_sd**2) - slack)
    mean = (seen.of_nodes * tables.ln_width).sum(axis=1)
    weight = people / spread.width_sd**2
    prior_weight = (scales.width * WIDTH_MEAN_SD) ** -2
    middle = (weight * mean.mean() + prior_weight * np.log(WIDTH_PRIOR[0])) / (weight + prior_weight)
    scatter = float((seen.of_nodes * (tables.ln_width - middle) ** 2).sum())
    sd = np.sqrt((scatter + WIDTH_PEOPLE * (scales.width * WIDTH_SPREAD) ** 2) / (people + WIDTH_PEOPLE))
    return Spread(max(float(variance**0.5), 0.02), spread.level_sd, float(middle), float(sd))


def _over_participant_sds(smooth: SmoothTables, prior: CurvePrior, start: CurveNode) -> list[CurveNode]:
    """Return the nodes of one τ: from the likeliest σ_u both ways until the rest is negligible."""
    found = _nodes_at(smooth, prior, start.spread, start.mean)
    best = _best_of(found).ln_evidence
    for ratio in (SPREAD_RATIO, 1 / SPREAD_RATIO):
        sd, at = start.spread.participant_sd, start.mean
        while 0.01 < sd < 4.0:
            sd *= ratio
            nodes = _nodes_at(smooth, prior, replace(start.spread, participant_sd=sd), at)
            found += nodes
            node = _best_of(nodes)
            at, best = node.mean, max(best, node.ln_evidence)
            if node.ln_evidence < best - NEGLIGIBLE:
                break
    return found


def _nodes_at(smooth: SmoothTables, prior: CurvePrior, spread: Spread, at: Array) -> list[CurveNode]:
    """Return the nodes of some spreads, one for each size of the smooth deviation."""
    at, seen = _climbed(smooth, prior, spread, at)
    own = information(prior.design, seen)
    linear = own @ at + prior.design.T @ seen.gradient
    scales = prior.scales
    ln_prior = -0.5 * (spread.participant_sd / scales.participant_sd) ** 2 + np.log(spread.participant_sd)
    ln_prior += -0.5 * (spread.level_sd / scales.level_sd) ** 2 + np.log(spread.level_sd)
    nodes = []
    for deviation in DEVIATIONS.tolist() if prior.n_shape > 2 else [scales.deviation]:
        diagonal = prior.precision(deviation)
        precision = own + np.diag(diagonal)
        mean = np.asarray(np.linalg.solve(precision, linear + diagonal * prior.centre), dtype=np.float64)
        move, off = mean - at, mean - prior.centre
        value = seen.value + prior.design.T @ seen.gradient @ move - 0.5 * move @ own @ move
        ln_evidence = (
            value
            - 0.5 * off @ (diagonal * off)
            + 0.5 * (np.log(diagonal).sum() - np.linalg.slogdet(precision)[1])
            - 0.5 * (deviation / scales.deviation) ** 2
            + np.log(deviation)
            + ln_prior
        )
        nodes.append(CurveNode(spread, deviation, at, float(ln_evidence), mean, precision, seen))
    return nodes

"""The likelihood of all answers given the population's curve, everything of single participants summed over.

The answers of a participant at a level are a table of log-likelihood over ln(threshold / L), evenly spaced,
and over nodes of what is not the threshold: width, guess and lapse rate. It is made once; the joint model
then only shifts, smooths and adds up tables.

ln threshold_pl = f_l + u_p + v_pl. v_pl is summed over by smoothing the tables of likelihood along
ln(threshold), u_p over the nodes of the same grid, width and asymptotes over theirs. Gradient and curvature
in f come with the value: they are means and covariances over those nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, special

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    MAX_GUESS,
    MAX_LAPSE,
    guess_prior,
    lapse_prior,
    ln_likelihood,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampCounts,
    RampLevelKey,
    Repeats,
    counts_by_participant_and_level,
    joined_levels,
    level_order,
)
from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.rate_limit import Sigmoid
from evenlight.data_schema.recordings.ramp import RampTrial
from evenlight.method.compiled_loop import compiled_loop
from evenlight.method.psychometric import WIDTH_LOGITS, threshold_logit

LARGEST_STEP = 0.07  # of ln(threshold): the narrowest functions that count rise over 0.4
SMALLEST_STEP = 0.02
BEYOND = 3.0  # ln units by which the grid goes past the rates tested; beyond, the likelihood is flat
WIDTHS = np.geomspace(0.4, 10.0, 15)
LAPSE_NODES, GUESS_NODES = 4, 3
LARGEST_LOGIT = 60.0  # F differs from 0 or 1 by 1e-26 there
REACH = 4.5  # standard deviations of u_p that are summed over
FINER = 2  # nodes of u_p to a step of the tables: with many answers u_p is known to a step's width
ELEMENTS = 600_000  # of an array: as many participants at a time as a processor's cache holds
FARTHEST = 5.0  # ln units: more than any person differs from another


@dataclass(frozen=True, slots=True)
class AnswerTables:
    """The log-likelihood of all answers, over thresholds and nodes of width, guess and lapse rate.

    P participants, C levels of the population, T thresholds, K nodes of what is not the threshold.
    """

    participants: tuple[str, ...]
    levels: tuple[RampLevelKey, ...]
    start: float  # first node of ln(threshold / L)
    step: float  # from one to the next
    ln_likelihood: Array  # (C, P, T, K); 0 where a participant has no answers
    all_alike: Mask  # (P,): who gave one answer only, or of two intervals was right by chance at best
    ln_width: Array  # (P, K): the nodes
    guess_rate: Array
    lapse_rate: Array
    ln_weight: Array  # prior mass of their guess and lapse rate
    # The answers, with ln(rate / L), by number of level and participant; several of a display measured again
    cells: Mapping[tuple[int, int], Sequence[tuple[RampCounts, Array]]]
    sigmoid: Sigmoid

    @property
    def luminance(self) -> Array:
        """Each level's luminance [cd/m^2], shape (C,)."""
        return np.array([level.luminance for level in self.levels])

    def with_nodes(self, chosen: NDArray[np.intp]) -> AnswerTables:
        """Return the tables with some of each participant's nodes, by number, shape (P, fewer)."""
        take = np.take_along_axis
        return replace(
            self,
            ln_likelihood=take(self.ln_likelihood, chosen[None, :, None, :], axis=3),
            ln_width=take(self.ln_width, chosen, axis=1),
            guess_rate=take(self.guess_rate, chosen, axis=1),
            lapse_rate=take(self.lapse_rate, chosen, axis=1),
            ln_weight=take(self.ln_weight, chosen, axis=1),
        )


def answer_tables(
    trials: Sequence[RampTrial],
    repeats: Repeats | None = None,
    lapse_scale: float = 1.0,
    sigmoid: Sigmoid = Sigmoid.LOGISTIC,
) -> AnswerTables:
    """Return the tables of some trials, all of one task.

    Rates are taken relative to the luminance that they were shown at, and calibrations of one level are
    joined. Where thresholds grow as L^0.8 to L^1.2, one 2.5 % off the level's mean is so moved by 0.5 %.

    Parameters
    ----------
    trials : sequence of RampTrial
        Ramps and catch trials; of yes/no, the catch trials tell each participant's guess rate.
    repeats : Repeats, optional
        That the last answer is given again in some of the trials.
    lapse_scale : float
        By which the prior's mean lapse rate is multiplied, about.
    sigmoid : Sigmoid
        F, between the asymptotes.
    """
    counts = counts_by_participant_and_level(trials, repeats)
    participants = tuple(dict.fromkeys(who for who, _ in counts))
    joined = joined_levels(level for _, level in counts)
    levels = tuple(sorted(set(joined.values()), key=level_order))
    relative = [np.log(own.rates / level.luminance) for (_, level), own in counts.items()]
    most = max(int(own.n_trials.sum()) for own in counts.values())
    step = float(np.clip(most**-0.5, SMALLEST_STEP, LARGEST_STEP))
    start = min(float(x[0]) for x in relative) - BEYOND
    nodes = np.arange(start, max(float(x[-1]) for x in relative) + BEYOND, step)
    first = {who: own for (who, _), own in reversed(counts.items())}
    grids = [_nuisance_nodes(first[who], lapse_scale) for who in participants]
    table = np.zeros((len(levels), len(participants), nodes.size, grids[0].shape[1]))
    cells: dict[tuple[int, int], list[tuple[RampCounts, Array]]] = {}
    for ((who, level), own), x in zip(counts.items(), relative, strict=True):
        place = levels.index(joined[level]), participants.index(who)
        cells.setdefault(place, []).append((own, x))
        table[place] += _ln_likelihood(own, x, nodes, grids[place[1]], sigmoid)
    ln_width, guess, lapse, ln_weight = (np.array([grid[k] for grid in grids]) for k in range(4))
    alike = np.array(
        [_all_alike([own for (p, _), own in counts.items() if p == who]) for who in participants]
    )
    of_nodes = ln_width, guess, lapse, ln_weight
    return AnswerTables(participants, levels, start, step, table, alike, *of_nodes, cells, sigmoid)


def _all_alike(counts: Sequence[RampCounts]) -> bool:
    """Return whether a participant's answers leave their threshold open to one side."""
    yes = sum(int(own.n_yes.sum()) for own in counts)
    total = sum(int(own.n_trials.sum()) for own in counts)
    return yes == total or yes <= (counts[0].guess_rate or 0.0) * total


def _nuisance_nodes(counts: RampCounts, lapse_scale: float) -> Array:
    """Return ln(width), guess rate, lapse rate and the logarithm of the latter two's mass, shape (4, K)."""
    guess = np.array([[counts.guess_rate or 0.0], [1.0]])
    if counts.guess_rate is None:
        after = guess_prior(counts.catch_yes, counts.catch_trials)
        guess = _beta_nodes(*after, MAX_GUESS, GUESS_NODES)
    a, b = lapse_prior(counts.guess_rate)
    lapse = _beta_nodes(a, b / lapse_scale, MAX_LAPSE, LAPSE_NODES)
    ln_width, g, m = np.meshgrid(np.log(WIDTHS), guess[0], lapse[0], indexing="ij")
    mass = np.broadcast_to(np.outer(guess[1], lapse[1]), ln_width.shape)
    return np.array([ln_width.ravel(), g.ravel(), m.ravel(), np.log(mass.ravel())])


def _beta_nodes(a: float, b: float, largest: float, size: int) -> Array:
    """Return nodes of a Beta density below a limit and their masses: Gauss-Legendre in its own quantiles."""
    z, weights = special.roots_legendre(size)
    share = float(special.betainc(a, b, largest))
    return np.array([special.betaincinv(a, b, share * (z + 1) / 2), weights / 2])


def within_beta_nodes(
    values: Array, beta: tuple[float, float], largest: float, size: int, rng: np.random.Generator
) -> Array:
    """Return values at nodes of a Beta density, each moved at random within the mass that its node is for."""
    nodes, mass = _beta_nodes(*beta, largest, size)
    node = np.abs(values[:, None] - nodes).argmin(axis=1)
    share = special.betainc(*beta, largest) * (np.cumsum(mass) - mass * rng.random((values.size, size)))
    return np.asarray(special.betaincinv(*beta, np.take_along_axis(share, node[:, None], axis=1)[:, 0]))


def _ln_likelihood(counts: RampCounts, x: Array, nodes: Array, nuisance: Array, sigmoid: Sigmoid) -> Array:
    """Return the log-likelihood of one participant's answers at one level, shape (T, K)."""
    ln_width, guess, lapse, _ = nuisance
    logits = (ln_odds((place - nodes)[:, None], ln_width, guess, sigmoid) for place in x)
    odds = (np.exp(np.clip(logit, -LARGEST_LOGIT, LARGEST_LOGIT)) for logit in logits)
    return ln_likelihood(counts, odds, guess, lapse, np.zeros((nodes.size, ln_width.size)))


def ln_odds(distance: Array, ln_width: Array, guess: Array, sigmoid: Sigmoid) -> Array:
    """Return ln(F / (1 - F)) at ln(rate / threshold), where F rises from 5 % to 95 % over the width."""
    at_threshold = threshold_logit(guess)
    if sigmoid is Sigmoid.LOGISTIC:
        return np.asarray(WIDTH_LOGITS * np.exp(-ln_width) * distance + at_threshold)
    shares = special.expit(at_threshold), 0.05, 0.95
    if sigmoid is Sigmoid.NORMAL:
        middle, low, high = (special.ndtri(share) for share in shares)
        z = middle + (high - low) * np.exp(-ln_width) * distance
        return np.asarray(special.log_ndtr(z) - special.log_ndtr(-z))
    middle, low, high = (np.log(-np.log1p(-share)) for share in shares)
    z = middle + (high - low) * np.exp(-ln_width) * distance
    return np.asarray(np.log(np.expm1(np.exp(np.clip(z, -LARGEST_LOGIT, np.log(LARGEST_LOGIT))))))


@dataclass(frozen=True, slots=True)
class Spread:
    """How participants differ."""

    participant_sd: float  # σ_u of ln(threshold) between participants
    level_sd: float  # τ of a participant's levels about their own curve
    width_mean: float  # of ln(width) over participants
    width_sd: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The marginal log-likelihood at a curve, and what the answers say about the participants there."""

    value: float
    gradient: Array  # in the ordinates of the curve at the levels, (C,)
    curvature: Array  # (C, C)
    u: Array  # nodes of the participants' deviations, (U,)
    of_u: Array  # posterior mass of each participant's deviation, (P, U)
    of_nodes: Array  # and of width and asymptotes, (P, K)
    slope: Array  # of each cell's log-likelihood in its own ordinate, mean, (C, P)
    cell_information: Array  # minus its mean second derivative, (C, P)


@dataclass(frozen=True, slots=True)
class SmoothTables:
    """Tables smoothed by the scatter of levels, as cubic splines of their logarithm along ln(threshold)."""

    tables: AnswerTables
    splines: Array  # coefficients, shape of the tables

    def evaluate(self, f: Array, spread: Spread) -> Evaluation:
        """Return the marginal log-likelihood at a curve.

        Parameters
        ----------
        f : array (C,)
            ln(threshold / L) of the median participant at each level.
        spread : Spread
            How participants differ; its τ is the one that the tables are smoothed with.
        """
        reach, u, ln_u, ln_nodes = self._nodes(spread)
        each = max(1, ELEMENTS // (self.splines.shape[0] * u.size * ln_nodes.shape[1]))
        groups = [slice(k, k + each) for k in range(0, ln_nodes.shape[0], each)]
        parts = [self._summed(f, reach, own, ln_u[:, None] + ln_nodes[own, None]) for own in groups]
        value, curvature = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
        of_u, of_nodes = (np.concatenate([part[k] for part in parts]) for k in (2, 3))
        slope, bend = (np.concatenate([part[k] for part in parts], axis=1) for k in (4, 5))
        return Evaluation(float(value), slope.sum(axis=1), curvature, u, of_u, of_nodes, slope, -bend)

    def _nodes(self, spread: Spread) -> tuple[int, Array, Array, Array]:
        """Return how many steps u reaches, its nodes, and ln of the prior masses of u and of other nodes."""
        reach = int(np.ceil(min(REACH * spread.participant_sd, FARTHEST) / self.tables.step)) + 1
        u = self.tables.step / FINER * np.arange(-reach * FINER, (reach + 1) * FINER, dtype=np.float64)
        return reach, u, _ln_masses(u, spread.participant_sd), self._ln_nodes(spread)

    def drawn(
        self, f: Array, spread: Spread, rng: np.random.Generator
    ) -> tuple[Array, Integers, Array, float]:
        """Draw everyone's deviation and node, given the curve and the spreads as in `evaluate`.

        Returns
        -------
        tuple
            Deviations u (P,); numbers of the nodes of width and asymptotes (P,); log-likelihood of each cell
            there (C, P); and that of all answers with deviations and nodes summed over.
        """
        reach, u, ln_u, ln_nodes = self._nodes(spread)
        values = self._shifted(f, reach, slice(None), 1)[0]
        ln_joint = (ln_u[:, None] + ln_nodes[:, None] + values.sum(axis=0)).reshape(values.shape[1], -1)
        # Gumbel's: the largest of sums is at a place with the probability of its mass
        picked = (ln_joint + rng.gumbel(size=ln_joint.shape)).argmax(axis=1)
        of_u, node = np.divmod(picked, values.shape[3])
        cells = values[:, np.arange(picked.size), of_u, node]
        return u[of_u], node, cells, float(special.logsumexp(ln_joint, axis=1).sum())

    def _summed(self, f: Array, reach: int, people: slice, ln_prior: Array) -> tuple[Array, ...]:
        values, first, second = self._shifted(f, reach, people, 3)
        ln_joint = ln_prior + values.sum(axis=0)
        each = special.logsumexp(ln_joint, axis=(1, 2))
        mass = np.exp(ln_joint - each[:, None, None])
        slope = np.einsum("cpuk,puk->cp", first, mass)
        bend = np.einsum("cpuk,puk->cp", second, mass)
        flat = first.reshape(f.size, each.size, -1).transpose(1, 0, 2)
        products = (flat * mass.reshape(each.size, 1, -1)) @ flat.transpose(0, 2, 1)
        curvature = products.sum(axis=0) - slope @ slope.T + np.diag(bend.sum(axis=1))
        return each.sum(), curvature, mass.sum(axis=2), mass.sum(axis=1), slope, bend

    def at_levels(self, kept: NDArray[np.intp]) -> SmoothTables:
        """Return the tables of some levels, by number."""
        levels = tuple(self.tables.levels[k] for k in kept.tolist())
        own = replace(self.tables, levels=levels, ln_likelihood=self.tables.ln_likelihood[kept], cells={})
        return SmoothTables(own, self.splines[kept])

    def _ln_nodes(self, spread: Spread) -> Array:
        """Return the logarithm of the prior mass of each participant's nodes, shape (P, K)."""
        ln_width = self.tables.ln_width
        norm = special.logsumexp(_ln_normal(np.log(WIDTHS), spread))
        return np.asarray(self.tables.ln_weight + _ln_normal(ln_width, spread) - norm)

    def _shifted(self, f: Array, reach: int, people: slice, orders: int) -> Array:
        """Return the splines at f + u, first and second derivative: so many of these, each (C, P, U, K)."""
        tables = self.tables
        places = (f[:, None] - tables.start) / tables.step + np.arange(FINER) / FINER
        low = np.floor(places).astype(np.intp)
        weights = np.array([[_spline_weights(t) for t in shares] for shares in (places - low).tolist()])
        units = tables.step ** np.arange(float(orders))
        begin = low - reach - 1
        return spline_sums(self.splines[:, people], begin, 2 * reach + 1, weights[:, :, :orders], units)


def smoothed(tables: AnswerTables, level_sd: float) -> SmoothTables:
    """Return tables whose thresholds scatter from level to level with a standard deviation τ."""
    size = tables.ln_likelihood.shape[2]
    distance = tables.step * np.subtract.outer(np.arange(size), np.arange(size))
    kernel = np.exp(-0.5 * (distance / level_sd) ** 2)
    kernel /= kernel.sum(axis=1, keepdims=True)
    top = tables.ln_likelihood.max(axis=2, keepdims=True)
    likelihood = np.exp(np.maximum(tables.ln_likelihood - top, -600.0))
    ln_smooth = np.log(np.matmul(kernel, likelihood)) + top
    return SmoothTables(tables, ndimage.spline_filter1d(ln_smooth, 3, axis=2, mode="mirror"))


def _ln_masses(u: Array, sd: float) -> Array:
    ln_density = -0.5 * (u / sd) ** 2
    return np.asarray(ln_density - special.logsumexp(ln_density))


def _ln_normal(ln_width: Array, spread: Spread) -> Array:
    """Return the log-density of ln(width) over participants, without its constant."""
    return np.asarray(-0.5 * ((ln_width - spread.width_mean) / spread.width_sd) ** 2)


def _spline_weights(t: float) -> tuple[tuple[float, ...], ...]:
    """Return the weights of four coefficients of a cubic B-spline at a share t between the middle two.

    Those of the value, of its slope, and of its second derivative.
    """
    s = 1 - t
    return (
        (s**3 / 6, 2 / 3 - t**2 + t**3 / 2, 2 / 3 - s**2 + s**3 / 2, t**3 / 6),
        (-(s**2) / 2, -2 * t + 1.5 * t**2, 2 * s - 1.5 * s**2, t**2 / 2),
        (s, -2 + 3 * t, -2 + 3 * s, t),
    )


@compiled_loop()
def spline_sums(splines: Array, begin: NDArray[np.intp], length: int, weights: Array, units: Array) -> Array:
    """Return weighted sums of four neighbours each, at every row and at finer steps between rows.

    Parameters
    ----------
    splines : array (C, P, R, K)
        Beyond its first and last row those are repeated.
    begin : array (C, F) of int
        For each cell and finer step, the row of the first neighbour of the first sum.
    length : int
        Rows of sums L.
    weights, units : array (C, F, n, 4), array (n,)
        Each of the n sums is divided by its unit.

    Returns
    -------
    array (n, C, P, L·F, K)
    """
    n_cells, n_people, size, n_nodes = splines.shape
    finer = begin.shape[1]
    found = np.empty((units.size, n_cells, n_people, length * finer, n_nodes))
    for cell, person in np.ndindex(n_cells, n_people):
        rows = splines[cell, person]
        for i, part in np.ndindex(length, finer):
            at = begin[cell, part] + i
            a, b = rows[min(max(at, 0), size - 1)], rows[min(max(at + 1, 0), size - 1)]
            c, d = rows[min(max(at + 2, 0), size - 1)], rows[min(max(at + 3, 0), size - 1)]
            for order in range(units.size):
                w, x, y, z = weights[cell, part, order]
                out = found[order, cell, person, i * finer + part]
                for k in range(n_nodes):
                    out[k] = (w * a[k] + x * b[k] + y * c[k] + z * d[k]) / units[order]
    return found

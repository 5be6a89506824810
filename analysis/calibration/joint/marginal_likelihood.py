"""The likelihood of all answers given the population's curve, everything of single participants summed over.

ln threshold_pl = f_l + u_p + v_pl. v_pl is summed over by smoothing the tables of likelihood along
ln(threshold), u_p over the nodes of the same grid, width and asymptotes over theirs. Gradient and curvature
in f come with the value: they are means and covariances over those nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, special

from evenlight.analysis.calibration.joint.answer_tables import WIDTHS, AnswerTables
from evenlight.data_schema.arrays import Array
from evenlight.method.compiled_loop import compiled_loop

REACH = 4.5  # standard deviations of u_p that are summed over
FINER = 2  # nodes of u_p to a step of the tables: with many answers u_p is known to a step's width
ELEMENTS = 600_000  # of an array: as many participants at a time as a processor's cache holds
FARTHEST = 5.0  # ln units: more than any person differs from another


@dataclass(frozen=True, slots=True)
class Spread:
    """How participants differ.

    Attributes
    ----------
    participant_sd, level_sd : float
        σ_u of ln(threshold) between participants, and τ of a participant's levels about their own curve.
    width_mean, width_sd : float
        Of ln(width) over participants.
    """

    participant_sd: float
    level_sd: float
    width_mean: float
    width_sd: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The marginal log-likelihood at a curve, and what the answers say about the participants there.

    Attributes
    ----------
    value, gradient, curvature : float, array (C,), array (C, C)
        Log-likelihood; its derivatives in the ordinates of the curve at the levels.
    u : array (U,)
        Nodes of the participants' deviations.
    of_u, of_nodes : array (P, U), array (P, K)
        Posterior mass of each participant's deviation, and of width and asymptotes.
    slope, cell_information : array (C, P)
        Of each cell's log-likelihood in its own ordinate: mean derivative and minus mean second derivative.
    """

    value: float
    gradient: Array
    curvature: Array
    u: Array
    of_u: Array
    of_nodes: Array
    slope: Array
    cell_information: Array


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
        reach = int(np.ceil(min(REACH * spread.participant_sd, FARTHEST) / self.tables.step)) + 1
        u = self.tables.step / FINER * np.arange(-reach * FINER, (reach + 1) * FINER, dtype=np.float64)
        ln_u, ln_nodes = _ln_masses(u, spread.participant_sd), self._ln_nodes(spread)
        each = max(1, ELEMENTS // (self.splines.shape[0] * u.size * ln_nodes.shape[1]))
        groups = [slice(k, k + each) for k in range(0, ln_nodes.shape[0], each)]
        parts = [self._summed(f, reach, own, ln_u[:, None] + ln_nodes[own, None]) for own in groups]
        value, curvature = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
        of_u, of_nodes = (np.concatenate([part[k] for part in parts]) for k in (2, 3))
        slope, bend = (np.concatenate([part[k] for part in parts], axis=1) for k in (4, 5))
        return Evaluation(float(value), slope.sum(axis=1), curvature, u, of_u, of_nodes, slope, -bend)

    def _summed(self, f: Array, reach: int, people: slice, ln_prior: Array) -> tuple[Array, ...]:
        """Return what some participants add to likelihood and curvature, and what is their own."""
        values, first, second = self._shifted(f, reach, people)
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
        own = replace(self.tables, levels=levels, ln_likelihood=self.tables.ln_likelihood[kept])
        return SmoothTables(own, self.splines[kept])

    def _ln_nodes(self, spread: Spread) -> Array:
        """Return the logarithm of the prior mass of each participant's nodes, shape (P, K)."""
        ln_width = self.tables.ln_width
        norm = special.logsumexp(_ln_normal(np.log(WIDTHS), spread))
        return np.asarray(self.tables.ln_weight + _ln_normal(ln_width, spread) - norm)

    def _shifted(self, f: Array, reach: int, people: slice) -> tuple[Array, Array, Array]:
        """Return the splines at f + u and their first and second derivatives, each (C, P, U, K)."""
        tables = self.tables
        places = (f[:, None] - tables.start) / tables.step + np.arange(FINER) / FINER
        low = np.floor(places).astype(np.intp)
        weights = np.array([[_spline_weights(t) for t in shares] for shares in (places - low).tolist()])
        units = np.array([1.0, tables.step, tables.step**2])
        found = spline_sums(self.splines[:, people], low - reach - 1, 2 * reach + 1, weights, units)
        return found[0], found[1], found[2]


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
    """Return the logarithms of the masses of evenly spaced nodes under a normal distribution."""
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
    weights, units : array (C, F, 3, 4), array (3,)
        Each of the three sums is divided by its unit.

    Returns
    -------
    array (3, C, P, L·F, K)
    """
    n_cells, n_people, size, n_nodes = splines.shape
    finer = begin.shape[1]
    found = np.empty((3, n_cells, n_people, length * finer, n_nodes))
    for cell, person in np.ndindex(n_cells, n_people):
        rows = splines[cell, person]
        for i, part in np.ndindex(length, finer):
            at = begin[cell, part] + i
            a, b = rows[min(max(at, 0), size - 1)], rows[min(max(at + 1, 0), size - 1)]
            c, d = rows[min(max(at + 2, 0), size - 1)], rows[min(max(at + 3, 0), size - 1)]
            for order in range(3):
                w, x, y, z = weights[cell, part, order]
                out = found[order, cell, person, i * finer + part]
                for k in range(n_nodes):
                    out[k] = (w * a[k] + x * b[k] + y * c[k] + z * d[k]) / units[order]
    return found

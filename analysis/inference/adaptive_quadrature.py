"""Likelihoods with normally distributed participant effects, by adaptive Gauss-Hermite quadrature.

Every observation i of participant p has one or two linear predictors,

    a = A θ - w Λ z + offset,    b = B θ - κ w Λ z + offset,    z ~ N(0, I) of the participant,

and a log-density ℓ(a, b) that is concave in them. Λ is lower triangular, so that Λ z has the covariance Λ Λᵀ:
one effect (w = 1: the intercept) or two correlated ones (w = (1, x): intercept and slope of x). z is
integrated out for each participant with nodes placed by the mode and the curvature of that participant's own
posterior (Liu & Pierce 1994, Biometrika 81, 624; Pinheiro & Bates 1995, J. Comput. Graph. Stat. 4, 12): fixed
nodes step over the likelihood of a participant with many answers. One node is the Laplace approximation.

Gradient and Hessian are exact derivatives of the integral (Fisher's and Louis's identities; Louis 1982,
J. R. Stat. Soc. B 44, 226), as posterior means over the same nodes. Λ's signs are free, so that a standard
deviation of 0 is an inner point and no bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import special

from evenlight.data_schema.arrays import Array, Integers

NODES = (1, 15, 9)  # per axis, with 0, 1, 2 effects: log-likelihoods to 1e-6 up to an SD of 1 logit (tests)
FINE_NODES = (1, 61, 21)  # for larger ones: to 5e-4 up to SDs of 6, or of 4 and 2 logits
MODE_STEPS = 50
MODE_TOLERANCE = 1e-10  # of the mode, in units of the participant effect's standard deviation


@dataclass(frozen=True, slots=True)
class Derivatives:
    """ℓ(a, b) with its first and second derivatives, each (P, m, Q)."""

    value: Array
    a: Array
    b: Array
    aa: Array
    ab: Array
    bb: Array


# ℓ and its derivatives of every observation at a and b, each (P, m, Q); of what is only padding: 0.
Density = Callable[[Array, Array], Derivatives]


@dataclass(frozen=True, slots=True)
class PaddedModel:
    """Observations by participant, padded to the same number m; rows of padding are 0.

    Attributes
    ----------
    a_design, b_design : array (P, m, d)
        A and B of the fixed parameters.
    a_offset, b_offset : array (P, m)
        Offsets; ± infinity for a predictor that an observation has not.
    loadings : array (P, m, q)
        w of the q = 0, 1 or 2 participant effects.
    b_loads, density : bool, Density
        κ: whether the participant effects enter b too; and ℓ.
    """

    a_design: Array
    b_design: Array
    a_offset: Array
    b_offset: Array
    loadings: Array
    b_loads: bool
    density: Density

    @property
    def n_fixed(self) -> int:
        """Number d of fixed parameters; those of Λ follow, row by row."""
        return int(self.a_design.shape[2])

    @property
    def n_effects(self) -> int:
        """Number q of participant effects."""
        return int(self.loadings.shape[2])

    @property
    def n_parameters(self) -> int:
        """Number of all parameters, fixed and of Λ."""
        return self.n_fixed + self.n_effects * (self.n_effects + 1) // 2


@dataclass(frozen=True, slots=True)
class Likelihood:
    """Logarithm of a likelihood, with its gradient (d,) and Hessian (d, d).

    `aside` is the derivative by a parameter that is held, where one is; `scores` (P, d) are the gradients of
    the participants, where they are known.
    """

    value: float
    gradient: Array
    hessian: Array
    aside: float = 0.0
    scores: Array | None = None


def padded(values: Array, groups: Integers, filling: float = 0.0) -> Array:
    """Return values (n, ...) by participant, (P, m, ...), filled up to the same number m for each.

    >>> padded(np.array([1.0, 2.0, 3.0]), np.array([0, 1, 0])).tolist()
    [[1.0, 3.0], [2.0, 0.0]]
    """
    order = np.argsort(groups, kind="stable")
    counts = np.bincount(groups)
    place = np.arange(groups.size) - np.repeat(np.cumsum(counts) - counts, counts)
    filled = np.full((counts.size, counts.max(), *values.shape[1:]), filling)
    filled[groups[order], place] = values[order]
    return filled


def triangle(parameters: Array, size: int) -> Array:
    """Return the lower triangular matrix Λ whose rows the parameters fill.

    >>> triangle(np.array([1.0, 2.0, 3.0]), 2).tolist()
    [[1.0, 0.0], [2.0, 3.0]]
    """
    matrix = np.zeros((size, size))
    matrix[np.tril_indices(size)] = parameters
    return matrix


def marginal_likelihood(model: PaddedModel, parameters: Array, nodes: int | None = None) -> Likelihood:
    """Return the log-likelihood with the participant effects integrated out, its gradient and Hessian.

    Parameters
    ----------
    model : PaddedModel
        The observations.
    parameters : array (d,)
        Fixed parameters, then the rows of Λ.
    nodes : int, optional
        Per participant effect.
    """
    fixed = parameters[: model.n_fixed]
    spread = triangle(parameters[model.n_fixed :], model.n_effects)
    a = model.a_design @ fixed + model.a_offset
    b = model.b_design @ fixed + model.b_offset
    loads = model.loadings @ spread
    z, ln_weights = _adapted_rule(model, (a, b), loads, nodes or NODES[model.n_effects])
    at = _shifted(model, (a, b), np.einsum("pmk,pqk->pmq", loads, z))
    each = at.value.sum(axis=1) + ln_weights
    totals = special.logsumexp(each, axis=1)
    if not np.isfinite(totals).all():
        size = parameters.size
        return Likelihood(-np.inf, np.zeros(size), np.zeros((size, size)))
    posterior = np.exp(each - totals[:, None])
    return _with_derivatives(model, at, z, posterior, float(totals.sum()))


def _posterior_modes(model: PaddedModel, ab: tuple[Array, Array], loads: Array) -> tuple[Array, Array]:
    """Return each participant's most probable z (P, q) and the curvature there (P, q, q), by Newton's method.

    The posterior is log-concave; a step that would lower it is halved, for that participant alone.
    """
    n_groups, q = loads.shape[0], loads.shape[2]
    z = np.zeros((n_groups, q))
    value, slope, curvature = _posterior(model, ab, loads, z)
    for _ in range(MODE_STEPS):
        step = np.linalg.solve(curvature, slope[:, :, None])[:, :, 0]
        if np.abs(step).max(initial=0.0) < MODE_TOLERANCE:
            break
        share = np.ones(n_groups)
        for _ in range(MODE_STEPS):
            tried = _posterior(model, ab, loads, z + share[:, None] * step)
            worse = ~(tried[0] >= value - 1e-12 * (1 + np.abs(value)))
            if not worse.any():
                break
            share[worse] /= 2
        else:  # rounding alone is left
            break
        z = z + share[:, None] * step
        value, slope, curvature = tried
    return z, curvature


def _posterior(
    model: PaddedModel, ab: tuple[Array, Array], loads: Array, z: Array
) -> tuple[Array, Array, Array]:
    """Return each participant's log-posterior of z (P,), its gradient (P, q) and minus its Hessian."""
    at = _shifted(model, ab, np.einsum("pmk,pk->pm", loads, z)[:, :, None])
    value = at.value.sum(axis=(1, 2)) - 0.5 * (z**2).sum(axis=1)
    first, second = _by_effect(model, at)
    slope = np.einsum("pm,pmk->pk", first[:, :, 0], loads) - z
    curvature = np.eye(z.shape[1]) - np.einsum("pm,pmk,pml->pkl", second[:, :, 0], loads, loads)
    return value, slope, curvature


def _shifted(model: PaddedModel, ab: tuple[Array, Array], shift: Array) -> Derivatives:
    """Return ℓ and its derivatives with the participant effect (P, m, Q) taken from the predictors."""
    a, b = (predictor[:, :, None] for predictor in ab)
    return model.density(a - shift, b - shift if model.b_loads else b + 0.0 * shift)


def _by_effect(model: PaddedModel, at: Derivatives) -> tuple[Array, Array]:
    """First and second derivative of ℓ by the participant effect."""
    if model.b_loads:
        return -(at.a + at.b), at.aa + 2 * at.ab + at.bb
    return -at.a, at.aa


@cache
def _rule(nodes: int, effects: int) -> tuple[Array, Array]:
    """Return the product Gauss-Hermite rule of a standard normal: nodes (Q, q), ln of weights (Q,)."""
    t, weights = special.roots_hermitenorm(nodes)
    grid = np.stack(np.meshgrid(*[t] * effects, indexing="ij"), axis=-1).reshape(-1, effects)
    ln_weight = np.log(weights / weights.sum())
    sums = sum(np.meshgrid(*[ln_weight] * effects, indexing="ij"), start=np.zeros(1))
    return grid, np.asarray(sums).reshape(-1)


def _adapted_rule(
    model: PaddedModel, ab: tuple[Array, Array], loads: Array, nodes: int
) -> tuple[Array, Array]:
    """Return each participant's nodes z (P, Q, q), and the logarithms of their weights times the prior."""
    q = model.n_effects
    if q == 0:
        return np.zeros((loads.shape[0], 1, 0)), np.zeros((loads.shape[0], 1))
    mode, curvature = _posterior_modes(model, ab, loads)
    t, ln_weights = _rule(nodes, q)
    root = np.linalg.inv(np.linalg.cholesky(curvature))  # rootᵀ root = curvature⁻¹
    z = mode[:, None, :] + np.einsum("pkl,qk->pql", root, t)
    ln_determinant = np.log(np.einsum("pkk->pk", root)).sum(axis=1)
    density_ratio = 0.5 * (t**2).sum(axis=1) - 0.5 * (z**2).sum(axis=2)
    return z, ln_weights + density_ratio + ln_determinant[:, None]


def _with_derivatives(
    model: PaddedModel, at: Derivatives, z: Array, posterior: Array, value: float
) -> Likelihood:
    """Return the likelihood with gradient (mean score) and Hessian (mean Hessian + variance of the score).

    η = w Λ z is linear in the entries of Λ: entry (k, l) has the coefficient w_k z_l.
    """
    rows, columns = np.tril_indices(model.n_effects)
    first, second = _by_effect(model, at)
    swap = (0, 2, 1)
    score = np.concatenate(
        [
            at.a.transpose(swap) @ model.a_design + at.b.transpose(swap) @ model.b_design,
            (first.transpose(swap) @ model.loadings)[:, :, rows] * z[:, :, columns],
        ],
        axis=2,
    )
    mean = np.einsum("pq,pqd->pd", posterior, score)
    centred = score - mean[:, None, :]
    weighted = posterior[:, :, None] * centred
    hessian = np.einsum("pqd,pqe->de", weighted, centred, optimize=True)
    hessian += _mean_hessian(model, at, second, z, posterior)
    return Likelihood(value, mean.sum(axis=0), hessian, scores=mean)


def _mean_hessian(model: PaddedModel, at: Derivatives, second: Array, z: Array, posterior: Array) -> Array:
    """Return the posterior mean of the complete data's Hessian, summed over participants."""
    d = model.n_fixed
    rows, columns = np.tril_indices(model.n_effects)
    total = np.zeros((model.n_parameters, model.n_parameters))

    def average(values: Array) -> Array:
        return np.asarray(np.einsum("pmq,pq->pm", values, posterior))[:, :, None]

    a, b = (design.reshape(-1, d) for design in (model.a_design, model.b_design))
    aa, ab, bb = (average(h).reshape(-1, 1) for h in (at.aa, at.ab, at.bb))
    cross = a.T @ (ab * b)
    total[:d, :d] = a.T @ (aa * a) + b.T @ (bb * b) + cross + cross.T
    by_a = -(at.aa + at.ab) if model.b_loads else -at.aa
    by_b = -(at.ab + at.bb) if model.b_loads else -at.ab
    for r, (k, c) in enumerate(zip(rows, columns, strict=True)):
        moved = z[:, None, :, c]
        weight = model.loadings[:, :, k].reshape(-1, 1)
        column = a.T @ (weight * average(by_a * moved).reshape(-1, 1))
        column += b.T @ (weight * average(by_b * moved).reshape(-1, 1))
        total[:d, d + r] = total[d + r, :d] = column[:, 0]
        for s in range(r + 1):
            both = average(second * moved * z[:, None, :, columns[s]]).reshape(-1)
            loads = weight[:, 0] * model.loadings[:, :, rows[s]].reshape(-1)
            total[d + r, d + s] = total[d + s, d + r] = both @ loads
    return total

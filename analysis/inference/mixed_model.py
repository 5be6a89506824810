"""A linear mixed model for estimates with known standard errors: one random factor per participant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from evenlight.data_schema.arrays import Array, Integers


@dataclass(frozen=True, slots=True)
class GroupedEstimates:
    """Estimates y of several participants, each with a standard error, and the design of their mean.

    Attributes
    ----------
    values, standard_errors : array (n,)
        y, e.g. ln(threshold), and the known standard error of each value, same unit.
    design : array (n, k)
        X of the population mean X β.
    groups : array (n,) of int
        Which participant each value belongs to, 0 to P - 1.
    """

    values: Array
    standard_errors: Array
    design: Array
    groups: Integers

    @property
    def n_groups(self) -> int:
        """Number of participants P."""
        return int(self.groups.max()) + 1


@dataclass(frozen=True, slots=True)
class MixedModelFit:
    """What the mixed model found.

    Attributes
    ----------
    coefficients, covariance : array (k,), array (k, k)
        β of the population mean, and its covariance.
    group_sd, residual_sd : float
        σ_u, standard deviation between participants; τ, scatter of a participant's values beyond their
        standard errors.
    log_likelihood : float
        Restricted log-likelihood at the estimate.
    """

    coefficients: Array
    covariance: Array
    group_sd: float
    residual_sd: float
    log_likelihood: float


def fit_mixed_model(data: GroupedEstimates) -> MixedModelFit:
    """Fit y_pl = x_l β + u_p + e_pl, Var(u) = σ_u², Var(e_pl) = se_pl² + τ², by restricted likelihood (REML).

    Two-stage estimation: the standard errors of the first stage are taken as known (as in meta-analysis),
    so that a participant's poorly known threshold weighs little. σ_u is left out (0) with one participant,
    τ with no residual degree of freedom.
    """
    free_group = data.n_groups > 1
    free_residual = data.values.size - data.design.shape[1] - (data.n_groups - 1) > 0
    scale = max(float(np.std(data.values)), 1e-3)
    stacked = np.column_stack([data.design, data.values])
    membership = (data.groups[:, None] == np.arange(data.n_groups)).astype(np.float64)

    def solved(parameters: Array) -> MixedModelFit:
        group_sd = float(abs(parameters[0])) * scale * free_group
        residual_sd = float(abs(parameters[1])) * scale * free_residual
        return _solve(data.standard_errors, stacked, membership, group_sd, residual_sd)

    def cost(parameters: Array) -> float:
        return -solved(parameters).log_likelihood

    starts = (np.array([0.7, 0.3]), np.array([0.1, 0.7]))
    runs = [
        scipy.optimize.fmin(cost, start, xtol=1e-7, ftol=1e-10, maxiter=600, disp=False) for start in starts
    ]
    return solved(min(runs, key=cost))


def _solve(
    errors: Array, stacked: Array, membership: Array, group_sd: float, residual_sd: float
) -> MixedModelFit:
    """Return the generalized least-squares solution and the restricted likelihood for given variances.

    Of (X | y), (n, k + 1), and who each value is of, (n, P). V_p = diag(d) + σ_u² 11ᵀ is inverted by Sherman
    and Morrison: V⁻¹ = W - c_p w wᵀ with W = diag(1/d), w = 1/d and c_p = σ_u² / (1 + σ_u² Σ w).
    """
    weights = 1.0 / (errors**2 + residual_sd**2)
    weighted = weights[:, None] * stacked
    sums = membership.T @ weighted
    total = weights @ membership
    shrink = group_sd**2 / (1.0 + group_sd**2 * total)
    gram = stacked.T @ weighted - sums.T @ (shrink[:, None] * sums)
    information, moment, square = gram[:-1, :-1], gram[:-1, -1], gram[-1, -1]
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    coefficients = covariance @ moment
    log_det_v = float(np.sum(np.log1p(group_sd**2 * total)) - np.sum(np.log(weights)))
    log_det_x = float(np.linalg.slogdet(information)[1])
    df = errors.size - coefficients.size
    misfit = float(square - moment @ coefficients)
    likelihood = -0.5 * (log_det_v + log_det_x + misfit + df * np.log(2 * np.pi))
    return MixedModelFit(coefficients, covariance, group_sd, residual_sd, likelihood)

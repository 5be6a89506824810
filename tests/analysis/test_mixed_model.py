"""The mixed model: against analysis of variance, the likelihood as written, and weighted least squares."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import linalg

from evenlight.analysis.inference.mixed_model import GroupedEstimates, MixedModelFit, fit_mixed_model

EXACT = 1e-9  # a standard error that is none


def balanced(table: NDArray[np.float64], error: float = EXACT) -> GroupedEstimates:
    """Values of P participants (rows) at m levels, with a common mean."""
    groups = np.repeat(np.arange(table.shape[0]), table.shape[1])
    return GroupedEstimates(table.ravel(), np.full(table.size, error), np.ones((table.size, 1)), groups)


def restricted_likelihood_as_written(
    data: GroupedEstimates, group_sd: float, residual_sd: float
) -> tuple[float, NDArray[np.float64]]:
    """REML with the covariance matrix V written out."""
    same = data.groups[:, None] == data.groups[None, :]
    V = np.diag(data.standard_errors**2 + residual_sd**2) + group_sd**2 * same
    X, y = data.design, data.values
    information = X.T @ linalg.solve(V, X)
    beta = linalg.solve(information, X.T @ linalg.solve(V, y))
    r = y - X @ beta
    n, k = X.shape
    terms = np.linalg.slogdet(V)[1] + np.linalg.slogdet(information)[1] + r @ linalg.solve(V, r)
    return float(-0.5 * (terms + (n - k) * np.log(2 * np.pi))), beta


def test_a_balanced_table_gives_the_estimates_of_the_analysis_of_variance() -> None:
    # REML on a balanced one-way layout is ANOVA: τ² = MSW, σ_u² = (MSB - MSW)/m, where that is positive.
    # Rows 1±1, 5±1, 9±1: MSW = 2 (each row's variance), MSB = m · Var(1, 5, 9) = 2 · 16 = 32, σ_u² = 15;
    # the variance of the mean is MSB / (P m) = 32/6.
    fit = fit_mixed_model(balanced(np.array([[0.0, 2.0], [4.0, 6.0], [8.0, 10.0]])))
    assert fit.coefficients[0] == pytest.approx(5.0, abs=1e-6)
    assert fit.residual_sd**2 == pytest.approx(2.0, rel=1e-4)
    assert fit.group_sd**2 == pytest.approx(15.0, rel=1e-4)
    assert fit.covariance[0, 0] == pytest.approx(32 / 6, rel=1e-4)


def test_participants_who_differ_less_than_their_answers_scatter_have_no_variance_of_their_own() -> None:
    # MSB = 0 < MSW: σ_u = 0, and τ² is the variance of all six values, 6/5.
    fit = fit_mixed_model(balanced(np.array([[-1.0, 1.0]] * 3)))
    assert fit.group_sd == pytest.approx(0.0, abs=1e-3)
    assert fit.residual_sd**2 == pytest.approx(6 / 5, rel=1e-4)


def test_known_standard_errors_are_taken_off_the_residual_scatter() -> None:
    # Same table with a standard error of 1 each: τ² = 2 - 1; everything else is as it was.
    fit = fit_mixed_model(balanced(np.array([[0.0, 2.0], [4.0, 6.0], [8.0, 10.0]]), error=1.0))
    assert fit.residual_sd**2 == pytest.approx(1.0, rel=1e-4)
    assert fit.group_sd**2 == pytest.approx(15.0, rel=1e-4)


def unbalanced(seed: int) -> GroupedEstimates:
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(5), [6, 3, 7, 1, 5])
    x = rng.uniform(-1, 1, groups.size)
    values = 1 + 2 * x + 0.4 * rng.standard_normal(5)[groups] + 0.3 * rng.standard_normal(groups.size)
    errors = rng.uniform(0.1, 0.4, groups.size)
    return GroupedEstimates(values, errors, np.column_stack([np.ones_like(x), x]), groups)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_the_likelihood_is_the_one_written_out_and_no_nudge_improves_it(seed: int) -> None:
    data = unbalanced(seed)
    fit = fit_mixed_model(data)
    written, beta = restricted_likelihood_as_written(data, fit.group_sd, fit.residual_sd)
    assert fit.log_likelihood == pytest.approx(written, abs=1e-8)
    np.testing.assert_allclose(fit.coefficients, beta, rtol=1e-8)
    for step in (0.9, 1.1):
        for sds in ((fit.group_sd * step, fit.residual_sd), (fit.group_sd, fit.residual_sd * step)):
            assert restricted_likelihood_as_written(data, *sds)[0] <= written + 1e-7
    for sds in ((fit.group_sd + 0.01, fit.residual_sd), (fit.group_sd, fit.residual_sd + 0.01)):
        assert restricted_likelihood_as_written(data, *sds)[0] <= written + 1e-7


def test_one_participant_at_as_many_levels_as_coefficients_is_weighted_least_squares() -> None:
    # Nothing to estimate a scatter from: the covariance is that of the known standard errors alone, 0.1² and
    # 0.2² for two points and two coefficients at positions ±1 (mean and half-difference): (a² + b²)/4.
    X = np.array([[1.0, -1.0], [1.0, 1.0]])
    data = GroupedEstimates(np.array([1.0, 3.0]), np.array([0.1, 0.2]), X, np.zeros(2, np.int64))
    fit: MixedModelFit = fit_mixed_model(data)
    assert (fit.group_sd, fit.residual_sd) == (0.0, 0.0)
    np.testing.assert_allclose(fit.coefficients, [2.0, 1.0], rtol=1e-12)
    np.testing.assert_allclose(fit.covariance, [[0.0125, 0.0075], [0.0075, 0.0125]], rtol=1e-9)


def test_a_poorly_known_value_weighs_little() -> None:
    table = np.array([[1.0, 1.0, 1.0], [1.2, 1.2, 1.2], [0.8, 0.8, 5.0]])
    data = balanced(table, error=0.1)
    errors = data.standard_errors.copy()
    errors[-1] = 5.0
    fit = fit_mixed_model(GroupedEstimates(data.values, errors, data.design, data.groups))
    assert fit.coefficients[0] == pytest.approx(1.0, abs=0.02)


def test_identical_values_leave_no_variance() -> None:
    fit = fit_mixed_model(balanced(np.full((4, 3), 2.5), error=0.2))
    assert fit.coefficients[0] == pytest.approx(2.5, abs=1e-12)
    assert fit.group_sd == pytest.approx(0.0, abs=1e-3)
    assert fit.residual_sd == pytest.approx(0.0, abs=1e-3)

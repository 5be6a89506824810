"""Adaptive quadrature: the integral is right, so are its derivatives, and few nodes are enough."""

import numpy as np
import pytest
from scipy import stats

from evenlight.analysis.inference.adaptive_quadrature import (
    FINE_NODES,
    NODES,
    PaddedModel,
    marginal_likelihood,
    triangle,
)
from evenlight.analysis.inference.cumulative_link import OrdinalData, ordinal_model
from evenlight.analysis.inference.lognormal_times import CensoredTimes, times_model
from evenlight.data_schema.arrays import Array

CUT_POINTS = np.array([-2.0, -0.3, 1.1])


def answers(slope: bool, per_person: int = 6, people: int = 4) -> OrdinalData:
    rng = np.random.default_rng(2)
    groups = np.repeat(np.arange(people), per_person)[: people * per_person - 2]  # not the same number each
    x = rng.choice([-0.5, 0.5], groups.size)
    responses = rng.integers(0, 4, groups.size)
    return OrdinalData(responses, 4, x[:, None], ("x",), groups, 0 if slope else None)


def times(slope: bool) -> CensoredTimes:
    rng = np.random.default_rng(3)
    groups = np.repeat(np.arange(4), 6)[:22]
    x = rng.choice([-0.5, 0.5], groups.size)
    seconds = np.exp(2.0 + 0.8 * rng.standard_normal(groups.size))
    design = np.column_stack([np.ones(groups.size), x])
    return CensoredTimes(
        np.minimum(seconds, 12.0), seconds < 12.0, design, ("one", "x"), groups, 1 if slope else None
    )


def model(kind: str, slope: bool) -> tuple[PaddedModel, Array]:
    """A model of few observations, with parameters that are not its estimate."""
    if kind == "times":
        fixed = [1.3, 2.4, -0.3]
        padded = times_model(times(slope)).padded
    else:
        fixed = [*CUT_POINTS, 0.7]
        padded = ordinal_model(answers(slope)).padded
    return padded, np.array([*fixed, *([0.9, -0.4, 0.7] if slope else [0.9])])


def likelihood(data: OrdinalData | CensoredTimes, i: int, eta: Array, fixed: Array) -> Array:
    """Likelihood of observation i at linear predictors η, as the models are printed."""
    if isinstance(data, CensoredTimes):  # the density of ln t, or the probability that it is beyond the limit
        found = stats.norm.pdf if data.observed[i] else stats.norm.sf
        return found(np.log(data.times[i]), eta / fixed[0], 1 / fixed[0])
    edges = np.concatenate([[-np.inf], CUT_POINTS, [np.inf]])
    k = int(data.responses[i])
    return stats.logistic.cdf(edges[k + 1] - eta) - stats.logistic.cdf(edges[k] - eta)


def integrated(kind: str, slope: bool, parameters: Array) -> float:
    """The marginal likelihood by the trapezoid rule on an even grid, 0.1 SD apart, from -9 to 9.

    It is exponentially exact for a smooth density that has faded at both ends (Trefethen & Weideman 2014).
    """
    data = times(slope) if kind == "times" else answers(slope)
    even = np.linspace(-9, 9, 181)
    z = np.stack(np.meshgrid(even, even, indexing="ij")) if slope else even[None]
    own_effects = np.tensordot(triangle(parameters[-3:], 2), z, 1) if slope else parameters[-1] * z
    n_fixed = parameters.size - (3 if slope else 1)
    fixed, total = parameters[:n_fixed], 0.0
    for p in np.unique(data.groups):
        density = stats.norm.pdf(z).prod(axis=0)
        for i in np.flatnonzero(data.groups == p):
            mean = data.design[i] @ fixed[-data.design.shape[1] :]
            shift = own_effects[0] + (own_effects[1] * data.design[i, -1] if slope else 0.0)
            density = density * likelihood(data, i, mean + shift, fixed)
        total += float(np.log(density.sum() * (even[1] - even[0]) ** len(z)))
    return total


@pytest.mark.parametrize("slope", [False, True])
@pytest.mark.parametrize("kind", ["logit", "times"])
def test_the_integral_is_that_of_a_fine_even_grid_over_the_formula(kind: str, slope: bool) -> None:
    padded, parameters = model(kind, slope)
    value = marginal_likelihood(padded, parameters, 21).value
    assert value == pytest.approx(integrated(kind, slope, parameters), abs=1e-7)


@pytest.mark.parametrize("slope", [False, True])
@pytest.mark.parametrize("kind", ["logit", "times"])
def test_gradient_and_hessian_are_the_differences_of_value_and_gradient(kind: str, slope: bool) -> None:
    padded, parameters = model(kind, slope)
    at = marginal_likelihood(padded, parameters, nodes=21)
    h = 1e-5
    for j, unit in enumerate(np.eye(parameters.size)):
        above, below = (
            marginal_likelihood(padded, parameters + sign * h * unit, nodes=21) for sign in (1, -1)
        )
        assert at.gradient[j] == pytest.approx((above.value - below.value) / (2 * h), abs=1e-6)
        np.testing.assert_allclose(at.hessian[j], (above.gradient - below.gradient) / (2 * h), atol=1e-6)


def steep(sd: float, slope_sd: float | None) -> tuple[PaddedModel, Array]:
    """17 participants with 8 ratings each, who differ by `sd` logits."""
    rng = np.random.default_rng(4)
    groups, x = np.repeat(np.arange(17), 8), np.tile([-0.5, 0.5], 68)
    own = sd * rng.standard_normal(17)[groups] + (slope_sd or 0.0) * rng.standard_normal(17)[groups] * x
    latent = own + rng.logistic(size=groups.size)
    responses = (latent[:, None] > CUT_POINTS).sum(axis=1)
    data = OrdinalData(responses, 4, x[:, None], ("x",), groups, None if slope_sd is None else 0)
    parameters = [*CUT_POINTS, 0.3, sd, *([] if slope_sd is None else [0.3, slope_sd])]
    return ordinal_model(data).padded, np.array(parameters)


@pytest.mark.parametrize(
    ("sd", "slope_sd", "rule", "error"),
    [
        (1.0, None, NODES, 1e-8),
        (2.0, None, NODES, 1e-4),
        (1.0, 0.8, NODES, 2e-6),
        (6.0, None, FINE_NODES, 2e-4),
        (4.0, 2.0, FINE_NODES, 5e-4),
    ],
)
def test_the_nodes_used_agree_with_many(
    sd: float, slope_sd: float | None, rule: tuple[int, ...], error: float
) -> None:
    # At the end of an interval the statistic, about 4, rises by 4 per standard error: an error of 5e-4 in the
    # log-likelihood moves the end by less than 1e-3 standard errors.
    padded, parameters = steep(sd, slope_sd)
    few, many = rule[padded.n_effects], 201 if slope_sd is None else 45
    value = marginal_likelihood(padded, parameters, few).value
    assert value == pytest.approx(marginal_likelihood(padded, parameters, many).value, abs=error)


def test_without_a_participant_effect_the_likelihood_is_the_sum_over_answers() -> None:
    data = answers(slope=False)
    one = OrdinalData(data.responses, 4, data.design, data.names, np.zeros_like(data.groups))
    fixed = np.array([*CUT_POINTS, 0.7])
    expected = sum(np.log(likelihood(data, i, 0.7 * data.design[i, 0], fixed)) for i in range(22))
    value = marginal_likelihood(ordinal_model(one).padded, fixed).value
    assert value == pytest.approx(expected, abs=1e-10)

"""The posterior of a psychometric function: against priors in closed form and a brute-force grid."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    FINE_NODES,
    GUESS_PRIOR,
    LAPSE_PRIOR,
    THRESHOLD_FALLOFF,
    WIDTH_PRIOR,
    Axis,
    PosteriorGrid,
    posterior_grid,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.method.psychometric import PsychometricFunction, log_likelihood

RATES = 100 * np.array([0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12])


def counts(yes: list[int], n: int, catch: tuple[int, int] = (0, 0)) -> RampCounts:
    return RampCounts(RATES, np.array(yes), np.full(len(yes), n), *catch)


CASES = {
    "typical": counts([0, 1, 1, 3, 4, 5, 6, 6], 6, (8, 120)),
    "few trials": counts([0, 0, 1, 0, 1, 1, 1, 1], 1),
    "separated": counts([0, 0, 0, 0, 6, 6, 6, 6], 6, (2, 120)),
    "shallow": counts([2, 1, 3, 2, 4, 3, 4, 5], 6, (12, 40)),
    "all yes": counts([6] * 8, 6, (1, 120)),
    "all no": counts([0] * 8, 6, (0, 120)),
}


def test_without_answers_the_posterior_is_the_prior() -> None:
    # ln(threshold): symmetric about the middle of the tested rates; ln(width): normal; guess: conjugate,
    # Beta(1 + 3, 10 + 17), mean 4/31 and variance ab / ((a + b)^2 (a + b + 1)).
    grid = posterior_grid(counts([0] * 8, 0, (3, 20)))
    assert grid.mean_and_sd(0)[0] == pytest.approx(np.log(RATES[[0, -1]]).mean(), abs=1e-6)
    assert grid.mean_and_sd(1) == pytest.approx((math.log(1.6), 0.6), rel=1e-4)
    mean, sd = grid.mean_and_sd(2)
    assert mean == pytest.approx(4 / 31, rel=1e-4)
    assert sd == pytest.approx(math.sqrt(4 * 27 / (31**2 * 32)), rel=1e-3)


def test_without_answers_the_threshold_is_flat_over_the_tested_rates_with_gaussian_flanks() -> None:
    # Area: the tested range R, and half a Gaussian of SD s on either side, s sqrt(2π) together. The share q
    # below the slowest rate is therefore s sqrt(π/2) / (R + s sqrt(2π)).
    s, span = THRESHOLD_FALLOFF, float(np.log(RATES[-1] / RATES[0]))
    share = s * math.sqrt(math.pi / 2) / (span + s * math.sqrt(2 * math.pi))
    grid = posterior_grid(counts([0] * 8, 0))
    assert grid.quantiles(0, (share,))[0] == pytest.approx(math.log(RATES[0]), abs=3e-3)


def test_interval_ends_are_not_shifted_by_half_a_grid_step() -> None:
    # N(0, 1) on 40 nodes from -5 to 5: adding up whole masses gives [-2.07, 1.86] (step 0.26).
    nodes = np.linspace(-5, 5, 40)
    zeros = np.zeros(40)
    one = Axis((0.0, 1.0), np.array([0.5]), np.zeros(1), np.zeros(1))
    masses = np.exp(-(nodes**2) / 2)[:, None, None, None]
    grid = PosteriorGrid((Axis((-5.0, 5.0), nodes, zeros, zeros), one, one, one), masses / masses.sum())
    assert grid.quantiles(0, (0.025, 0.5, 0.975)) == pytest.approx((-1.959964, 0.0, 1.959964), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["typical", "few trials", "separated"])
def test_the_means_are_those_of_a_brute_force_grid(name: str) -> None:
    # Stated accuracy: 0.001 in ln(threshold), 0.009 in ln(width).
    grid = posterior_grid(CASES[name])
    expected = means_by_brute_force(CASES[name])
    assert grid.mean_and_sd(0)[0] == pytest.approx(expected[0], abs=0.001)
    assert grid.mean_and_sd(1)[0] == pytest.approx(expected[1], abs=0.009)
    assert grid.mean_and_sd(2)[0] == pytest.approx(expected[2], abs=0.001)
    assert grid.mean_and_sd(3)[0] == pytest.approx(expected[3], abs=0.001)


def means_by_brute_force(data: RampCounts) -> NDArray[np.float64]:
    """The posterior as written: one even grid over the whole prior, trapezoid rule, no adaptation."""
    x = np.log(data.rates)
    axes = [
        np.linspace(x[0] - 2.5, x[-1] + 2.5, 90),
        np.linspace(math.log(1.6) - 2.7, math.log(1.6) + 2.7, 44),
        np.linspace(1e-9, 0.45 if data.catch_trials < 30 else 0.22, 44),
        np.linspace(1e-9, 0.2, 40),
    ]
    t, w, g, m = np.ix_(*axes)
    flank = np.maximum(0, np.maximum(x[0] - t, t - x[-1])) / THRESHOLD_FALLOFF
    ln_posterior = -(flank**2) / 2 - ((w - math.log(WIDTH_PRIOR[0])) / WIDTH_PRIOR[1]) ** 2 / 2
    guess = (GUESS_PRIOR[0] + data.catch_yes, GUESS_PRIOR[1] + data.catch_trials - data.catch_yes)
    for p, (a, b) in ((g, guess), (m, LAPSE_PRIOR)):
        ln_posterior = ln_posterior + (a - 1) * np.log(p) + (b - 1) * np.log1p(-p)
    for xi, k, n in zip(x, data.n_yes, data.n_trials, strict=True):
        offset = special.logit((0.75 - g) / (1 - g))
        psi = g + (1 - g - m) * special.expit(2 * math.log(19) * (xi - t) / np.exp(w) + offset)
        ln_posterior = ln_posterior + special.xlogy(k, psi) + special.xlog1py(n - k, -psi)
    mass = np.exp(ln_posterior - ln_posterior.max())
    for axis in range(4):  # trapezoid: the ends count half
        index: list[slice | int] = [slice(None)] * 4
        for index[axis] in (0, -1):
            mass[tuple(index)] /= 2
    mass /= mass.sum()
    others = [tuple(j for j in range(4) if j != i) for i in range(4)]
    return np.array([axis @ mass.sum(axis=other) for axis, other in zip(axes, others, strict=True)])


@pytest.mark.parametrize("name", CASES)
def test_three_times_as_many_nodes_change_nothing(name: str) -> None:
    # Half of the stated accuracy is left for the comparison with the brute-force grid.
    usual = posterior_grid(CASES[name])
    finer = posterior_grid(CASES[name], (50, 20, 16, 10), (72, 48, 20, 14))
    for axis, accuracy in enumerate((0.0005, 0.0045, 0.0005, 0.0005)):
        assert usual.mean_and_sd(axis)[0] == pytest.approx(finer.mean_and_sd(axis)[0], abs=accuracy)
    assert usual.quantiles(0, (0.025, 0.975)) == pytest.approx(finer.quantiles(0, (0.025, 0.975)), abs=0.002)


def test_the_likelihood_on_the_grid_is_that_of_the_function() -> None:
    # Without the priors' terms, two nodes differ by the difference of their log-likelihoods.
    data = CASES["typical"]
    grid = posterior_grid(data)
    i, j = (10, 8, 3, 2), (25, 16, 7, 5)
    found, expected = [], []
    for node in (i, j):
        t, w, g, m = (axis.nodes[k] for axis, k in zip(grid.axes, node, strict=True))
        rest = sum(a.ln_prior[k] + a.ln_weights[k] for a, k in zip(grid.axes, node, strict=True))
        found.append(math.log(grid.masses[node]) - rest)
        function = PsychometricFunction(math.exp(t), math.exp(w), g, m)
        expected.append(log_likelihood(function, data.rates, data.n_yes, data.n_trials))
    assert found[0] - found[1] == pytest.approx(expected[0] - expected[1], rel=1e-9)


def test_saturated_cells_neither_overflow_nor_vanish() -> None:
    # Rates of 1e-12 and 1e12 times the others: their odds are beyond any float.
    rates = np.array([1e-12, 1.0, 2.0, 4.0, 1e12])
    data = RampCounts(rates, np.array([0, 1, 4, 7, 8]), np.full(5, 8))
    grid = posterior_grid(data)
    assert np.isfinite(grid.masses).all()
    low, median, high = grid.quantiles(0, (0.025, 0.5, 0.975))
    assert math.log(1.0) < low < median < high < math.log(8.0)


def test_yes_to_every_catch_trial_still_gives_a_posterior() -> None:
    grid = posterior_grid(counts([6] * 8, 6, (120, 120)))
    assert np.isfinite(grid.masses).all()
    assert grid.mean_and_sd(2)[0] > 0.6


def test_a_single_rate_gives_a_wide_posterior() -> None:
    grid = posterior_grid(RampCounts(np.array([2.0]), np.array([1]), np.array([1])))
    low, high = grid.quantiles(0, (0.025, 0.975))
    assert low < math.log(2.0) < high
    assert high - low > 1


def test_the_grid_has_the_size_it_states() -> None:
    assert posterior_grid(CASES["typical"]).masses.shape == FINE_NODES

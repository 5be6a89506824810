"""Psychometric fits: the logistic function through one participant's answers at one level (Section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.analysis.calibration.posterior_grid import (
    PosteriorGrid,
    PsychometricPrior,
    RampCounts,
    posterior_grid,
)
from evenlight.method.psychometric import PsychometricFunction, yes_probability

INTERVAL = (0.025, 0.5, 0.975)
SAMPLES = 400


@dataclass(frozen=True, slots=True)
class Estimate:
    """One parameter: mean and standard deviation of its posterior, its median and 95 % interval."""

    mean: float
    sd: float
    median: float
    ci_low: float
    ci_high: float


@dataclass(frozen=True, slots=True)
class PsychometricFit:
    """The posterior of one psychometric function.

    Attributes
    ----------
    counts : RampCounts
        The answers it was fitted to.
    function : PsychometricFunction
        The function of the posterior means; it runs through 75 % at the threshold.
    ln_threshold, ln_width, guess_rate, lapse_rate : Estimate
        The four parameters; the threshold is in ln(cd/m^2/s).
    samples : array (n, 4)
        Parameters drawn evenly from the posterior, columns in the order above; read-only.
    """

    counts: RampCounts
    function: PsychometricFunction
    ln_threshold: Estimate
    ln_width: Estimate
    guess_rate: Estimate
    lapse_rate: Estimate
    samples: NDArray[np.float64]


def fit_psychometric(counts: RampCounts, prior: PsychometricPrior | None = None) -> PsychometricFit:
    """Fit threshold, width, guess and lapse rate to the answers at one level, with 95 % intervals.

    The estimate is the mean of the posterior, for threshold and width of their logarithm: of mean, median and
    maximum it recovers simulated thresholds with the least bias (docs/decisions/threshold-definition.md).

    Parameters
    ----------
    counts : RampCounts
        The answers; all "yes", all "no" or perfectly separated ones give a wide posterior, not an error.
    prior : PsychometricPrior, optional
        What was known before.
    """
    grid = posterior_grid(counts, prior or PsychometricPrior())
    threshold, width, guess, lapse = (_estimate(grid, axis) for axis in range(4))
    samples = grid.sample(SAMPLES)
    samples.flags.writeable = False
    function = PsychometricFunction(
        float(np.exp(threshold.mean)), float(np.exp(width.mean)), guess.mean, lapse.mean
    )
    return PsychometricFit(counts, function, threshold, width, guess, lapse, samples)


def _estimate(grid: PosteriorGrid, axis: int) -> Estimate:
    """Return the summary of one parameter."""
    low, median, high = grid.quantiles(axis, INTERVAL)
    return Estimate(*grid.mean_and_sd(axis), median, low, high)


def posterior_band(
    fit: PsychometricFit, rate: ArrayLike, level: float = 0.95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pointwise band of P("yes") at rates [cd/m^2/s], lower and upper edge, for a figure.

    Parameters
    ----------
    fit : PsychometricFit
        Whose.
    rate : array_like (n,)
        Where [cd/m^2/s].
    level : float
        Probability of the band.
    """
    rates = np.asarray(rate, dtype=np.float64)
    curves = [
        yes_probability(rates, PsychometricFunction(float(np.exp(t)), float(np.exp(w)), float(g), float(m)))
        for t, w, g, m in fit.samples
    ]
    low, high = np.quantile(curves, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return low, high

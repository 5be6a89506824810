"""Psychometric fits: the logistic function through one participant's answers at one level (Section 3.4).

The posterior is integrated by quadrature on four axes, or three where the task fixes the guess rate:
ln(threshold) and ln(width) with equally spaced nodes (the trapezoid rule converges exponentially for a smooth
density that has faded at both ends), guess and lapse rate with Gauss-Legendre nodes (whose density need not
fade at 0). A coarse grid finds the posterior, a fine one integrates it; with thousands of answers, grids
narrow in on the posterior of a growing share of them. Everything is deterministic.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeVar

import numpy as np
from scipy import interpolate, special

from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.data_schema.arrays import Array, Integers
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction, threshold_logit

# What is known of a psychometric function before the first answer (docs/decisions/threshold-definition.md)
THRESHOLD_FALLOFF = 0.5  # flat over the rates tested; beyond, the standard deviation of a normal flank
WIDTH_PRIOR = (1.6, 0.6)  # log-normal: median, and standard deviation of ln(width)
GUESS_PRIOR = (1.0, 10.0)  # Beta
LAPSE_PRIOR = (1.0, 30.0)  # Beta; of yes/no
INTERVAL = (0.025, 0.5, 0.975)
MAX_GUESS = 0.7  # above 0.75 there is no 75 % point; fits this close to it are flagged as false alarms
MAX_LAPSE = 0.2  # above 0.25 there is no 75 % point
COARSE_NODES = (32, 12, 10, 6)
FINE_NODES = (36, 24, 12, 8)
FADED = np.log(1e-6)  # density, relative to its maximum, at which an axis is cut off
TAIL = 1e-12  # of the guess rate's density given the catch trials, left out when it is looked for
MAX_LOGIT = 500.0  # F differs from 0 or 1 by 1e-217 there: e^500 still fits a float with room to spare
QUANTILE_SAMPLES = 2001
PLENTY = 2000  # trials; the posterior of more may lie between the nodes of the coarse grid
NARROWING = 2.0  # by which the trials that count grow from one grid to the next

Count = TypeVar("Count", float, Array)


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One parameter: mean and standard deviation of its posterior, its median and 95 % credible interval."""

    mean: float
    sd: float
    median: float
    ci_low: float
    ci_high: float


@dataclass(frozen=True, slots=True)
class PsychometricFit:
    """The posterior of one psychometric function."""

    counts: RampCounts  # the answers it was fitted to
    function: PsychometricFunction  # of the posterior means; 75 % at the threshold, but for lapses
    ln_threshold: ParameterEstimate  # ln(cd/m^2/s)
    ln_width: ParameterEstimate
    guess_rate: ParameterEstimate
    lapse_rate: ParameterEstimate


def fit_psychometric(counts: RampCounts, fine: tuple[int, int, int, int] = FINE_NODES) -> PsychometricFit:
    """Fit threshold, width, guess and lapse rate to the answers at one level, with 95 % credible intervals.

    The estimate is the mean of the posterior, for threshold and width of their logarithm: of mean, median and
    maximum it recovers simulated thresholds with the least bias (docs/decisions/threshold-definition.md).

    Parameters
    ----------
    counts : RampCounts
        The answers; all "yes", all "no" or perfectly separated ones give a wide posterior, not an error.
    fine : tuple of int
        Nodes of the grid that integrates the posterior.
    """
    grid = posterior_grid(counts, fine=fine)
    threshold, width, guess, lapse = (_estimate(grid, axis) for axis in range(4))
    function = PsychometricFunction(
        float(np.exp(threshold.mean)), float(np.exp(width.mean)), guess.mean, lapse.mean
    )
    return PsychometricFit(counts, function, threshold, width, guess, lapse)


def _estimate(grid: PosteriorGrid, axis: int) -> ParameterEstimate:
    low, median, high = grid.quantiles(axis, INTERVAL)
    return ParameterEstimate(*grid.mean_and_sd(axis), median, low, high)


def lapse_prior(guess_rate: float | None) -> tuple[float, float]:
    """Return the Beta parameters of the lapse rate, for a guess rate that the task fixes or not (None).

    Who did not look answers at random, and of two intervals half of the random answers are right: lapses show
    half as often.

    >>> lapse_prior(None), lapse_prior(0.5)
    ((1.0, 30.0), (1.0, 60.0))
    """
    a, b = LAPSE_PRIOR
    return a, b / (1 - (guess_rate or 0.0))


def guess_prior(catch_yes: Count, catch_trials: int) -> tuple[Count, Count]:
    """Return the Beta parameters of the guess rate, given the answers "yes" in catch trials alone."""
    return GUESS_PRIOR[0] + catch_yes, GUESS_PRIOR[1] + catch_trials - catch_yes


@dataclass(frozen=True, slots=True)
class Axis:
    """The interval of one parameter, its nodes, and the logarithms of their prior and of their weights."""

    interval: tuple[float, float]
    nodes: Array
    ln_prior: Array
    ln_weights: Array


@dataclass(frozen=True, slots=True)
class PosteriorGrid:
    """A posterior on a grid."""

    axes: tuple[Axis, Axis, Axis, Axis]  # ln(threshold), ln(width), guess rate, lapse rate
    masses: Array  # posterior probability of each node, an axis each; they add up to 1

    def marginal(self, axis: int) -> Array:
        """Return the posterior probability of each node of one axis."""
        return np.asarray(self.masses.sum(axis=tuple(i for i in range(4) if i != axis)))

    def mean_and_sd(self, axis: int) -> tuple[float, float]:
        """Return mean and standard deviation of one parameter."""
        nodes, mass = self.axes[axis].nodes, self.marginal(axis)
        if nodes.size == 1:  # known
            return float(nodes[0]), 0.0
        mean = float(nodes @ mass)
        return mean, float(np.sqrt((nodes - mean) ** 2 @ mass))

    def quantiles(self, axis: int, probabilities: tuple[float, ...]) -> tuple[float, ...]:
        """Return quantiles of one parameter.

        The density between the nodes is the spline of its logarithm, and the distribution function counts
        half of a node's mass below the node: adding up whole masses would shift every interval down by
        half a step. A parameter that is known is all of its quantiles.
        """
        parameter = self.axes[axis]
        if parameter.nodes.size == 1:
            return (float(parameter.nodes[0]),) * len(probabilities)
        with np.errstate(divide="ignore"):
            ln_density = np.log(self.marginal(axis)) - parameter.ln_weights
        seen = np.isfinite(ln_density)
        spline = interpolate.CubicSpline(parameter.nodes[seen], ln_density[seen] - ln_density[seen].max())
        fine = np.linspace(*parameter.interval, QUANTILE_SAMPLES)
        density = np.exp(spline(fine))
        cumulative = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
        return tuple(np.interp(probabilities, cumulative / cumulative[-1], fine).tolist())


def posterior_grid(
    counts: RampCounts,
    coarse: tuple[int, int, int, int] = COARSE_NODES,
    fine: tuple[int, int, int, int] = FINE_NODES,
) -> PosteriorGrid:
    """Return the posterior of ln(threshold), ln(width), guess and lapse rate for the answers at one level.

    A coarse grid finds it, a fine one integrates it; a known guess rate takes one node.
    """
    if counts.guess_rate is not None:
        coarse, fine = ((*sizes[:2], 1, sizes[3]) for sizes in (coarse, fine))
    share = min(1.0, PLENTY / max(1, int(np.sum(counts.n_trials)) + counts.catch_trials))
    weaker = _share_of(counts, share)
    located = _integrate(weaker, _whole_range(weaker), coarse)
    while share < 1.0:
        share = min(1.0, share * NARROWING)
        located = _integrate(_share_of(counts, share), _faded_ranges(located), fine)
    return _integrate(counts, _faded_ranges(located), fine)


def _share_of(counts: RampCounts, share: float) -> RampCounts:
    """Return counts of which each is a share of what it was: answers that say the same, but less surely."""
    if share == 1.0:
        return counts

    def fewer(n: Integers) -> Integers:
        return np.round(n * share).astype(np.int64)

    again = counts.repeats
    if again is not None:
        again = replace(again, n_yes=fewer(again.n_yes), n_trials=fewer(again.n_trials))
    return replace(
        counts,
        repeats=again,
        n_yes=fewer(counts.n_yes),
        n_trials=fewer(counts.n_trials),
        catch_yes=int(counts.catch_yes * share),
        catch_trials=int(counts.catch_trials * share),
    )


def _whole_range(counts: RampCounts) -> tuple[tuple[float, float], ...]:
    beyond = np.sqrt(-2 * FADED)
    x = np.log(counts.rates)
    middle, spread = float(np.log(WIDTH_PRIOR[0])), WIDTH_PRIOR[1]
    a, b = guess_prior(counts.catch_yes, counts.catch_trials)
    guess = float(special.betaincinv(a, b, TAIL)), float(special.betainccinv(a, b, TAIL))
    if counts.guess_rate is not None:
        guess = counts.guess_rate, counts.guess_rate
    return (
        (float(x[0] - beyond * THRESHOLD_FALLOFF), float(x[-1] + beyond * THRESHOLD_FALLOFF)),
        (middle - beyond * spread, middle + beyond * spread),
        (min(guess[0], 0.9 * MAX_GUESS), min(guess[1], MAX_GUESS)),
        (0.0, MAX_LAPSE),
    )


def _faded_ranges(grid: PosteriorGrid) -> tuple[tuple[float, float], ...]:
    """Return the interval of each parameter in which its posterior has not faded, one step wider."""
    ranges = []
    for axis, parameter in enumerate(grid.axes):
        with np.errstate(divide="ignore"):
            ln_density = np.log(grid.marginal(axis)) - parameter.ln_weights
        seen = np.flatnonzero(ln_density > ln_density.max() + FADED)
        below, above = seen[0] - 1, seen[-1] + 1
        low = parameter.nodes[below] if below >= 0 else parameter.interval[0]
        high = parameter.nodes[above] if above < parameter.nodes.size else parameter.interval[1]
        ranges.append((float(low), float(high)))
    return tuple(ranges)


def _integrate(
    counts: RampCounts,
    ranges: tuple[tuple[float, float], ...],
    sizes: tuple[int, int, int, int],
) -> PosteriorGrid:
    x = np.log(counts.rates)
    t, w = ((np.linspace(*ranges[i], sizes[i]), np.zeros(sizes[i])) for i in (0, 1))  # equal weights: ln 1
    g, m = (_gauss_nodes(*ranges[i], sizes[i]) for i in (2, 3))
    outside = np.maximum(0.0, np.maximum(x[0] - t[0], t[0] - x[-1])) / THRESHOLD_FALLOFF
    off_middle = (w[0] - np.log(WIDTH_PRIOR[0])) / WIDTH_PRIOR[1]
    guess = guess_prior(counts.catch_yes, counts.catch_trials)
    axes = (
        Axis(ranges[0], t[0], -0.5 * outside**2, t[1]),
        Axis(ranges[1], w[0], -0.5 * off_middle**2, w[1]),
        Axis(ranges[2], g[0], _ln_beta(g[0], *guess), g[1]),
        Axis(ranges[3], m[0], _ln_beta(m[0], *lapse_prior(counts.guess_rate)), m[1]),
    )
    # The odds are a product of one factor of threshold and width and one of the asymptotes, so that no
    # exponential is taken on the whole grid.
    guess_rate, lapse_rate = g[0][:, None], m[0][None, :]
    at_threshold = np.exp(threshold_logit(guess_rate))
    logits = ((ln_rate - t[0])[:, None] * (WIDTH_LOGITS / np.exp(w[0])) for ln_rate in x)
    odds = (np.exp(np.clip(z, -MAX_LOGIT, MAX_LOGIT))[:, :, None, None] * at_threshold for z in logits)
    ln_masses = ln_likelihood(counts, odds, guess_rate, lapse_rate, np.zeros(sizes))
    for i, axis in enumerate(axes):
        own = axis.ln_prior + axis.ln_weights
        ln_masses += own.reshape([-1 if i == j else 1 for j in range(4)])
    masses = np.exp(ln_masses - ln_masses.max())
    return PosteriorGrid(axes, masses / masses.sum())


def ln_likelihood(
    counts: RampCounts, odds: Iterable[Array], guess: Array, lapse: Array, total: Array
) -> Array:
    """Return the log-likelihood of answers, over nodes of guess and lapse rate and of what the odds are for.

    With odds s = F / (1 - F): ψ = (γ + (1 - λ)s) / (1 + s) and 1 - ψ = ((1 - γ) + λs) / (1 + s). Both
    numerators stay above 0 where neither rate is 0, as at the nodes of Gauss.

    Parameters
    ----------
    counts, odds : RampCounts, iterable of array
        The answers, and the odds of the rise F at each of their rates.
    guess, lapse : array
        Nodes; odds, guess and lapse broadcast.
    total : array
        What it is added to, in place.
    """
    parts = counts.parts(guess, lapse)
    for k, s in enumerate(odds):
        share = 1.0 / (1.0 + s)
        for n_yes, n_trials, low, missed in parts:
            if n_yes[k]:
                total += n_yes[k] * np.log((low + (1 - missed) * s) * share)
            if n_trials[k] - n_yes[k]:
                total += (n_trials[k] - n_yes[k]) * np.log(((1 - low) + missed * s) * share)
    return total


def _ln_beta(p: Array, a: float, b: float) -> Array:
    """Return the logarithm of a Beta density, without its constant."""
    return np.asarray(special.xlogy(a - 1, p) + special.xlog1py(b - 1, -p))


def _gauss_nodes(low: float, high: float, size: int) -> tuple[Array, Array]:
    nodes, weights = _legendre_rule(size)
    return low + (high - low) * (nodes + 1) / 2, np.log(weights)


@cache
def _legendre_rule(size: int) -> tuple[Array, Array]:
    nodes, weights = special.roots_legendre(size)
    return np.asarray(nodes), np.asarray(weights)

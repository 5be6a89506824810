"""Whether answers look like those of a logistic function: the deviance, judged by Monte Carlo.

The deviance of some fifty answers does not follow chi-squared (Wichmann and Hill 2001, Perception &
Psychophysics 63, 1293), and sparse rates make it worse. So data sets are simulated from the fitted function,
each is fitted again, and the share of them with at least the deviance of the real answers is the p-value.
All refits are done at once: the most probable parameters by damped Fisher scoring
(`analysis.calibration.most_probable`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.calibration.most_probable import Answers, most_probable, probabilities_of
from evenlight.analysis.calibration.posterior_grid import PsychometricPrior, RampCounts
from evenlight.data_schema.arrays import Array

REPLICATES = 299  # a p-value of 0.05 is known to 0.013, one of 0.01 to 0.006
LEAST_IN_BIN = 5  # trials; neighbouring rates are put together until there are as many
LEAST_BINS = 3  # fewer, and any function meets them
POOR_FIT_P = 0.01
FEW_TRIALS = 30  # of a level; with fewer only gross misfits show (docs/decisions/goodness-of-fit.md)
TIE = 1e-9  # deviances of the same counts differ by rounding


@dataclass(frozen=True, slots=True)
class GoodnessOfFit:
    """The deviance of answers from the most probable function, beside those of simulated answers.

    Attributes
    ----------
    deviance : float
        2 Σ k ln(k / nψ) + (n - k) ln((n - k) / n(1 - ψ)) over the bins.
    p_value : float
        Share of simulated data sets with at least this deviance, the real one counted among them.
    n_bins : int
        Rates, or groups of neighbouring rates.
    simulated : array (n,)
        Deviances of the simulated data sets; read-only.
    """

    deviance: float
    p_value: float
    n_bins: int
    simulated: Array


def goodness_of_fit(
    counts: RampCounts, prior: PsychometricPrior | None = None, replicates: int = REPLICATES
) -> GoodnessOfFit | None:
    """Return how well a logistic function describes the answers at one level.

    The random numbers are seeded by the answers: the same answers have the same p-value.

    Parameters
    ----------
    counts : RampCounts
        The answers.
    prior : PsychometricPrior, optional
        What was known before; of the fit to the answers and of those to the simulated ones.
    replicates : int
        Simulated data sets.

    Returns
    -------
    GoodnessOfFit or None
        None with too few rates or trials to judge by.
    """
    prior = prior or PsychometricPrior()
    starts = bin_starts(counts.n_trials)
    if starts.size < LEAST_BINS:
        return None
    given = Answers(
        np.log(counts.rates),
        counts.n_trials.astype(np.float64),
        counts.n_yes[None, :].astype(np.float64),
        np.array([float(counts.catch_yes)]),
        counts.catch_trials,
        counts.guess_rate,
    )
    fitted = most_probable(given, prior)
    made = _simulated(given, fitted[0], np.random.default_rng(_seed(counts)), replicates)
    refitted = most_probable(made, prior, start=fitted[0])
    observed = float(_deviance(given, probabilities_of(fitted, given), starts)[0])
    simulated = _deviance(made, probabilities_of(refitted, made), starts)
    simulated.flags.writeable = False
    return GoodnessOfFit(observed, _share(observed, simulated), starts.size, simulated)


def joint_p_value(fits: Sequence[GoodnessOfFit]) -> float | None:
    """Return the p-value of the summed deviance of a participant's levels, or None without any.

    Misfits that no level shows by itself add up; the k-th simulated data set of every level make one of the
    participant.
    """
    if not fits:
        return None
    simulated = np.sum([fit.simulated for fit in fits], axis=0)
    return _share(sum(fit.deviance for fit in fits), np.asarray(simulated, dtype=np.float64))


def bin_starts(n_trials: NDArray[np.int64], least: int = LEAST_IN_BIN) -> NDArray[np.int64]:
    """Return where each bin of neighbouring rates begins, so that each holds enough trials.

    Adaptive placement asks many rates once or twice, and single answers have a deviance that says nothing:
    it depends on the fitted function alone. What is left at the end joins the last bin.

    >>> bin_starts(np.array([6, 6, 2, 1, 3, 4, 9, 1])).tolist()
    [0, 1, 2, 5]
    """
    starts, held = [0], 0
    for place, n in enumerate(n_trials.tolist()):
        if held >= least:
            starts.append(place)
            held = 0
        held += n
    if held < least and len(starts) > 1:
        starts.pop()
    return np.array(starts, dtype=np.int64)


def _simulated(given: Answers, parameters: Array, rng: np.random.Generator, replicates: int) -> Answers:
    """Return data sets drawn from a function, catch trials included."""
    probability = probabilities_of(parameters[None, :], given)[0]
    n = given.n_trials.astype(np.int64)
    success = rng.binomial(n, probability, (replicates, n.size)).astype(np.float64)
    catch = np.zeros(replicates)
    if given.guess_rate is None:
        catch = rng.binomial(given.catch_trials, parameters[2], replicates).astype(np.float64)
    return Answers(given.x, given.n_trials, success, catch, given.catch_trials, given.guess_rate)


def _deviance(answers: Answers, probability: Array, starts: NDArray[np.int64]) -> Array:
    """Return the deviance of each data set, over bins of rates."""
    total = np.add.reduceat(answers.n_trials, starts)
    success = np.add.reduceat(answers.success, starts, axis=1)
    expected = np.add.reduceat(answers.n_trials * probability, starts, axis=1)
    failure, unexpected = total - success, total - expected
    terms = special.xlogy(success, success / expected) + special.xlogy(failure, failure / unexpected)
    return np.asarray(np.maximum(2 * np.sum(terms, axis=1), 0.0), dtype=np.float64)


def _share(observed: float, simulated: Array) -> float:
    """Return the Monte Carlo p-value of a deviance."""
    return float((1 + np.sum(simulated >= observed - TIE)) / (1 + simulated.size))


def _seed(counts: RampCounts) -> int:
    """Return a seed made from the answers."""
    digest = hashlib.sha256()
    for values in (counts.rates, counts.n_yes, counts.n_trials):
        digest.update(np.ascontiguousarray(values, dtype=np.float64).tobytes())
    digest.update(f"{counts.catch_yes} {counts.catch_trials} {counts.guess_rate}".encode())
    return int.from_bytes(digest.digest()[:8], "big")

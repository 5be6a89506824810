"""Whether answers look like those of a logistic function: the deviance, judged by Monte Carlo.

The deviance of some fifty answers does not follow chi-squared (Wichmann and Hill 2001, Perception &
Psychophysics 63, 1293), and sparse rates make it worse. So data sets are simulated from the fitted function,
each is fitted again, and the share of them with at least the deviance of the real answers is the p-value.

All refits are done at once. The posterior mean, which the thresholds are, takes an integral per data set; to
compare hundreds of simulated data sets, the maximum of the same posterior serves. Damped Fisher scoring finds
it in ln(threshold), ln(width) and scaled logits of guess and lapse rate, in whose measure the priors have
their maximum inside, so that no parameter runs off to an edge.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    GUESS_PRIOR,
    LAPSE_PRIOR,
    MAX_GUESS,
    MAX_LAPSE,
    THRESHOLD_FALLOFF,
    WIDTH_PRIOR,
    guess_prior,
    lapse_prior,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.data_schema.arrays import Array, Integers
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, WIDTH_LOGITS, threshold_logit

REPLICATES = 299  # a p-value of 0.05 is known to 0.013, one of 0.01 to 0.006
LEAST_IN_BIN = 5  # trials; neighbouring rates are put together until there are as many
LEAST_BINS = 3  # fewer, and any function meets them
POOR_FIT_P = 0.01
FEW_TRIALS = 30  # of a level; with fewer only gross misfits show (docs/decisions/threshold-definition.md)
TIE = 1e-9  # deviances of the same counts differ by rounding
STEPS = 14
LARGEST_STEP = 0.7  # of any parameter: farther, the quadratic model is not to be trusted
FIRST_DAMPING = 0.01  # share of the curvature


@dataclass(frozen=True, slots=True)
class GoodnessOfFit:
    """The deviance of answers from the most probable function, beside those of simulated answers.

    The deviance is 2 Σ k ln(k / nψ) + (n - k) ln((n - k) / n(1 - ψ)) over the bins.
    """

    deviance: float
    p_value: float  # share of the data sets with at least this deviance, the real one counted among them
    simulated: Array  # deviances of the simulated data sets, read-only


@dataclass(frozen=True, slots=True)
class AnswerSets:
    """Several data sets with the rates, the numbers of trials and the guess rate of one."""

    counts: RampCounts  # the one
    success: Array  # at each rate, of each data set, (r, m)
    catch_yes: Array  # "yes" in catch trials, (r,)

    @property
    def x(self) -> Array:
        """ln(rate), shape (m,)."""
        return np.asarray(np.log(self.counts.rates))


def goodness_of_fit(counts: RampCounts, replicates: int = REPLICATES) -> GoodnessOfFit | None:
    """Return how well a logistic function describes the answers; None with too few rates or trials for it.

    The random numbers are seeded by the answers: the same answers have the same p-value.
    """
    starts = bin_starts(counts.n_trials)
    if starts.size < LEAST_BINS:
        return None
    given = answered(counts)
    fitted = most_probable(given)
    made = _simulated(given, fitted[0], np.random.default_rng(_seed(counts)), replicates)
    refitted = most_probable(made, start=fitted[0])
    observed = float(_deviance(given, _probabilities_of(fitted, given), starts)[0])
    simulated = _deviance(made, _probabilities_of(refitted, made), starts)
    simulated.flags.writeable = False
    return GoodnessOfFit(observed, _share(observed, simulated), simulated)


def answered(counts: RampCounts) -> AnswerSets:
    """Return the answers themselves as the only data set."""
    success = counts.n_yes[None, :].astype(np.float64)
    return AnswerSets(counts, success, np.array([float(counts.catch_yes)]))


def joint_p_value(fits: Sequence[GoodnessOfFit]) -> float | None:
    """Return the p-value of the summed deviance of a participant's levels, or None without any.

    Misfits that no level shows by itself add up; the k-th simulated data set of every level make one of the
    participant.
    """
    if not fits:
        return None
    simulated = np.sum([fit.simulated for fit in fits], axis=0)
    return _share(sum(fit.deviance for fit in fits), np.asarray(simulated, dtype=np.float64))


def bin_starts(n_trials: Integers, least: int = LEAST_IN_BIN) -> Integers:
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


def _simulated(given: AnswerSets, parameters: Array, rng: np.random.Generator, replicates: int) -> AnswerSets:
    counts, probability = given.counts, _probabilities_of(parameters[None, :], given)[0]
    n = counts.n_trials.astype(np.int64)
    success = rng.binomial(n, probability, (replicates, n.size)).astype(np.float64)
    catch = np.zeros(replicates)
    if counts.guess_rate is None:
        catch = rng.binomial(counts.catch_trials, parameters[2], replicates).astype(np.float64)
    return AnswerSets(counts, success, catch)


def _deviance(answers: AnswerSets, probability: Array, starts: Integers) -> Array:
    total = np.add.reduceat(answers.counts.n_trials, starts)
    success = np.add.reduceat(answers.success, starts, axis=1)
    expected = np.add.reduceat(answers.counts.n_trials * probability, starts, axis=1)
    failure, unexpected = total - success, total - expected
    terms = special.xlogy(success, success / expected) + special.xlogy(failure, failure / unexpected)
    return np.asarray(np.maximum(2 * np.sum(terms, axis=1), 0.0), dtype=np.float64)


def _share(observed: float, simulated: Array) -> float:
    return float((1 + np.sum(simulated >= observed - TIE)) / (1 + simulated.size))


def _seed(counts: RampCounts) -> int:
    digest = hashlib.sha256()
    for values in (counts.rates, counts.n_yes, counts.n_trials):
        digest.update(np.ascontiguousarray(values, dtype=np.float64).tobytes())
    digest.update(f"{counts.catch_yes} {counts.catch_trials} {counts.guess_rate}".encode())
    return int.from_bytes(digest.digest()[:8], "big")


def most_probable(answers: AnswerSets, start: Array | None = None) -> Array:
    """Return the most probable ln(threshold), ln(width), guess and lapse rate of each data set, (r, 4).

    The search sets out from `start`, (4,), or from the middle of the rates and the priors' means.
    """
    free = np.tile(_free(_first(answers) if start is None else start), (answers.success.shape[0], 1))
    damping = np.full(len(free), FIRST_DAMPING)
    height, slope, curvature = _posterior(free, answers)
    for _ in range(STEPS):
        diagonal = np.einsum("rii->ri", curvature)
        damped = curvature + (damping[:, None] * diagonal)[:, :, None] * np.eye(4)
        step = np.linalg.solve(damped, slope[:, :, None])[:, :, 0]
        tried = free + np.clip(step, -LARGEST_STEP, LARGEST_STEP)
        new = _posterior(tried, answers)
        better = new[0] >= height
        free = np.where(better[:, None], tried, free)
        height = np.where(better, new[0], height)
        slope = np.where(better[:, None], new[1], slope)
        curvature = np.where(better[:, None, None], new[2], curvature)
        damping *= np.where(better, 0.3, 10.0)
    return _parameters(free, answers.counts.guess_rate)


def _probabilities_of(parameters: Array, answers: AnswerSets) -> Array:
    """Return the probability of success at each rate, shape (r, m), for parameters of shape (r, 4)."""
    t, w, g, m = (parameters[:, i, None] for i in range(4))
    return np.asarray(g + (1 - g - m) * special.expit(_logit(answers.x, t, w, g)))


def _logit(x: Array, t: Array, w: Array, g: Array) -> Array:
    return np.asarray(WIDTH_LOGITS * (x - t) * np.exp(-w) + threshold_logit(g))


def _first(answers: AnswerSets) -> Array:
    counts = answers.counts
    middle = float(np.average(answers.x, weights=counts.n_trials))
    a, b = GUESS_PRIOR[0] + answers.catch_yes.mean(), GUESS_PRIOR[1] + counts.catch_trials
    guess = min(a / (a + b), 0.9 * MAX_GUESS) if counts.guess_rate is None else counts.guess_rate
    return np.array([middle, np.log(WIDTH_PRIOR[0]), guess, 1 / (1 + LAPSE_PRIOR[1])])


def _free(parameters: Array) -> Array:
    """Return parameters without bounds; a known guess rate is not used then."""
    guess, lapse = parameters[2] / MAX_GUESS, parameters[3] / MAX_LAPSE
    return np.array([parameters[0], parameters[1], special.logit(guess), special.logit(lapse)])


def _parameters(free: Array, guess_rate: float | None) -> Array:
    found = free.copy()
    found[:, 2] = MAX_GUESS * special.expit(free[:, 2]) if guess_rate is None else guess_rate
    found[:, 3] = MAX_LAPSE * special.expit(free[:, 3])
    return found


def _posterior(free: Array, answers: AnswerSets) -> tuple[Array, Array, Array]:
    """Return the log-posterior (r,), its gradient (r, 4) and its expected curvature (r, 4, 4)."""
    known = answers.counts.guess_rate
    found = _parameters(free, known)
    t, w, g, m = (found[:, i, None] for i in range(4))
    rise = special.expit(_logit(answers.x, t, w, g))
    psi = g + (1 - g - m) * rise
    steep = (1 - g - m) * rise * (1 - rise)
    slope = WIDTH_LOGITS * np.exp(-w)
    by_guess = (1 - rise) - steep / (THRESHOLD_PROBABILITY - g)
    d_guess = g * (1 - g / MAX_GUESS) if known is None else np.zeros_like(g)
    d_lapse = m * (1 - m / MAX_LAPSE)
    jacobian = np.stack(
        [-slope * steep, -slope * (answers.x - t) * steep, by_guess * d_guess, -rise * d_lapse], axis=2
    )
    n, k = answers.counts.n_trials, answers.success
    variance = psi * (1 - psi)
    gradient = np.einsum("rm,rmi->ri", (k - n * psi) / variance, jacobian)
    weighted = jacobian * (n / variance)[:, :, None]
    curvature = np.matmul(weighted.transpose(0, 2, 1), jacobian)
    height = np.sum(k * np.log(psi) + (n - k) * np.log1p(-psi), axis=1)
    terms = [
        _ln_prior_of_threshold(found[:, 0], answers.x),
        _ln_prior_of_width(found[:, 1]),
        # A known guess rate has no prior; a curvature of 1 keeps the matrix invertible.
        (np.zeros(len(found)), np.zeros(len(found)), np.ones(len(found)))
        if known is not None
        else _ln_prior_of_rate(
            found[:, 2], guess_prior(answers.catch_yes, answers.counts.catch_trials), MAX_GUESS
        ),
        _ln_prior_of_rate(found[:, 3], lapse_prior(known), MAX_LAPSE),
    ]
    for i, (value, first, second) in enumerate(terms):
        height = height + value
        gradient[:, i] += first
        curvature[:, i, i] += second
    return height, gradient, curvature


# Each: the logarithm of a prior, its slope and its (negative) curvature.


def _ln_prior_of_threshold(t: Array, x: Array) -> tuple[Array, Array, Array]:
    out = (np.minimum(0.0, t - x[0]) + np.maximum(0.0, t - x[-1])) / THRESHOLD_FALLOFF
    return -0.5 * out**2, -out / THRESHOLD_FALLOFF, (out != 0) / THRESHOLD_FALLOFF**2


def _ln_prior_of_width(w: Array) -> tuple[Array, Array, Array]:
    off = (w - np.log(WIDTH_PRIOR[0])) / WIDTH_PRIOR[1]
    return -0.5 * off**2, -off / WIDTH_PRIOR[1], np.full_like(w, WIDTH_PRIOR[1] ** -2)


def _ln_prior_of_rate(
    p: Array, beta: tuple[float | Array, float | Array], largest: float
) -> tuple[Array, Array, Array]:
    """Of a rate p = P · expit(u) with a Beta prior, as a density of u.

    dp/du = p (1 - p/P), so that ln density = a ln p + (b - 1) ln(1 - p) + ln(1 - p/P) up to a constant.
    """
    a, b = beta
    inside = 1 - p / largest
    value = a * np.log(p) + (b - 1) * np.log1p(-p) + np.log(inside)
    first = a * inside - (b - 1) * p * inside / (1 - p) - p / largest
    second = p * inside * (a / largest + (b - 1) + 1 / largest)
    return np.asarray(value), np.asarray(first), np.asarray(second)

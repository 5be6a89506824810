"""The most probable psychometric function of many data sets at once, by damped Fisher scoring.

The posterior mean, which the thresholds are, takes an integral per data set; where hundreds of simulated data
sets are fitted to be compared with each other, the maximum of the same posterior serves. It is sought in
ln(threshold), ln(width) and scaled logits of guess and lapse rate, in whose measure the priors have their
maximum inside, so that no parameter runs off to an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.posterior_grid import MAX_GUESS, MAX_LAPSE, PsychometricPrior
from evenlight.data_schema.arrays import Array
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, WIDTH_LOGITS

STEPS = 14
LARGEST_STEP = 0.7  # of any parameter: farther, the quadratic model is not to be trusted
FIRST_DAMPING = 0.01  # share of the curvature


@dataclass(frozen=True, slots=True)
class Answers:
    """Several data sets with the same rates and numbers of trials.

    Attributes
    ----------
    x : array (m,)
        ln(rate), rates in cd/m^2/s.
    n_trials : array (m,)
        Trials at each.
    success : array (r, m)
        Successes at each, of each data set.
    catch_yes : array (r,)
        "Yes" in catch trials.
    catch_trials : int
        Catch trials.
    guess_rate : float or None
        The guess rate, if the task fixes it.
    """

    x: Array
    n_trials: Array
    success: Array
    catch_yes: Array
    catch_trials: int
    guess_rate: float | None


def most_probable(answers: Answers, prior: PsychometricPrior, start: Array | None = None) -> Array:
    """Return the most probable parameters of each data set.

    Parameters
    ----------
    answers : Answers
        The data sets.
    prior : PsychometricPrior
        What was known before.
    start : array (4,), optional
        Parameters to set out from.

    Returns
    -------
    array (r, 4)
        ln(threshold), ln(width), guess rate, lapse rate.
    """
    free = np.tile(_free(_first(answers, prior) if start is None else start), (answers.success.shape[0], 1))
    damping = np.full(len(free), FIRST_DAMPING)
    height, slope, curvature = _posterior(free, answers, prior)
    for _ in range(STEPS):
        diagonal = np.einsum("rii->ri", curvature)
        damped = curvature + (damping[:, None] * diagonal)[:, :, None] * np.eye(4)
        step = np.linalg.solve(damped, slope[:, :, None])[:, :, 0]
        tried = free + np.clip(step, -LARGEST_STEP, LARGEST_STEP)
        new = _posterior(tried, answers, prior)
        better = new[0] >= height
        free = np.where(better[:, None], tried, free)
        height = np.where(better, new[0], height)
        slope = np.where(better[:, None], new[1], slope)
        curvature = np.where(better[:, None, None], new[2], curvature)
        damping *= np.where(better, 0.3, 10.0)
    return _parameters(free, answers.guess_rate)


def probabilities_of(parameters: Array, answers: Answers) -> Array:
    """Return the probability of success at each rate, shape (r, m), for parameters of shape (r, 4)."""
    t, w, g, m = (parameters[:, i, None] for i in range(4))
    return np.asarray(g + (1 - g - m) * special.expit(_logit(answers.x, t, w, g, m)))


def _logit(x: Array, t: Array, w: Array, g: Array, m: Array) -> Array:
    """Return the logit of the rise F; ψ is 75 % at the threshold."""
    at_threshold = np.log((THRESHOLD_PROBABILITY - g) / (1 - THRESHOLD_PROBABILITY - m))
    return np.asarray(WIDTH_LOGITS * (x - t) * np.exp(-w) + at_threshold)


def _first(answers: Answers, prior: PsychometricPrior) -> Array:
    """Return where to begin without a better idea: the middle of the rates, the priors' means."""
    middle = float(np.average(answers.x, weights=answers.n_trials))
    a, b = prior.guess[0] + answers.catch_yes.mean(), prior.guess[1] + answers.catch_trials
    guess = min(a / (a + b), 0.9 * MAX_GUESS) if answers.guess_rate is None else answers.guess_rate
    return np.array([middle, np.log(prior.width_median), guess, 1 / (1 + prior.lapse[1])])


def _free(parameters: Array) -> Array:
    """Return parameters without bounds; a known guess rate is not used then."""
    guess, lapse = parameters[2] / MAX_GUESS, parameters[3] / MAX_LAPSE
    return np.array([parameters[0], parameters[1], special.logit(guess), special.logit(lapse)])


def _parameters(free: Array, guess_rate: float | None) -> Array:
    """Return the parameters of unbounded ones."""
    found = free.copy()
    found[:, 2] = MAX_GUESS * special.expit(free[:, 2]) if guess_rate is None else guess_rate
    found[:, 3] = MAX_LAPSE * special.expit(free[:, 3])
    return found


def _posterior(free: Array, answers: Answers, prior: PsychometricPrior) -> tuple[Array, Array, Array]:
    """Return the log-posterior (r,), its gradient (r, 4) and its expected curvature (r, 4, 4)."""
    known = answers.guess_rate
    found = _parameters(free, known)
    t, w, g, m = (found[:, i, None] for i in range(4))
    rise = special.expit(_logit(answers.x, t, w, g, m))
    psi = g + (1 - g - m) * rise
    steep = (1 - g - m) * rise * (1 - rise)
    slope = WIDTH_LOGITS * np.exp(-w)
    by_guess = (1 - rise) - steep / (THRESHOLD_PROBABILITY - g)
    by_lapse = -rise + steep / (1 - THRESHOLD_PROBABILITY - m)
    d_guess = g * (1 - g / MAX_GUESS) if known is None else np.zeros_like(g)
    d_lapse = m * (1 - m / MAX_LAPSE)
    jacobian = np.stack(
        [-slope * steep, -slope * (answers.x - t) * steep, by_guess * d_guess, by_lapse * d_lapse], axis=2
    )
    n, k = answers.n_trials, answers.success
    variance = psi * (1 - psi)
    gradient = np.einsum("rm,rmi->ri", (k - n * psi) / variance, jacobian)
    weighted = jacobian * (n / variance)[:, :, None]
    curvature = np.matmul(weighted.transpose(0, 2, 1), jacobian)
    height = np.sum(k * np.log(psi) + (n - k) * np.log1p(-psi), axis=1)
    terms = [
        _ln_prior_of_threshold(found[:, 0], answers.x, prior),
        _ln_prior_of_width(found[:, 1], prior),
        _ln_prior_of_guess(found[:, 2], answers, prior),
        _ln_prior_of_rate(found[:, 3], prior.lapse_after(known), MAX_LAPSE),
    ]
    for i, (value, first, second) in enumerate(terms):
        height = height + value
        gradient[:, i] += first
        curvature[:, i, i] += second
    return height, gradient, curvature


def _ln_prior_of_threshold(t: Array, x: Array, prior: PsychometricPrior) -> tuple[Array, Array, Array]:
    """Return the logarithm of the prior, its slope and its (negative) curvature: flat, Gaussian flanks."""
    out = (np.minimum(0.0, t - x[0]) + np.maximum(0.0, t - x[-1])) / prior.threshold_falloff
    return -0.5 * out**2, -out / prior.threshold_falloff, (out != 0) / prior.threshold_falloff**2


def _ln_prior_of_width(w: Array, prior: PsychometricPrior) -> tuple[Array, Array, Array]:
    """Return the same for ln(width): Gaussian."""
    off = (w - np.log(prior.width_median)) / prior.width_spread
    return -0.5 * off**2, -off / prior.width_spread, np.full_like(w, prior.width_spread**-2)


def _ln_prior_of_guess(g: Array, answers: Answers, prior: PsychometricPrior) -> tuple[Array, Array, Array]:
    """Return the same for the guess rate, after the catch trials; a known one gets a curvature of 1."""
    if answers.guess_rate is not None:
        return np.zeros_like(g), np.zeros_like(g), np.ones_like(g)
    a = prior.guess[0] + answers.catch_yes
    b = prior.guess[1] + answers.catch_trials - answers.catch_yes
    return _ln_prior_of_rate(g, (a, b), MAX_GUESS)


def _ln_prior_of_rate(
    p: Array, beta: tuple[float, float] | tuple[Array, Array], largest: float
) -> tuple[Array, Array, Array]:
    """Return the same for a rate p = P · expit(u) with a Beta prior, as a density of u.

    dp/du = p (1 - p/P), so that ln density = a ln p + (b - 1) ln(1 - p) + ln(1 - p/P) up to a constant.
    """
    a, b = beta
    inside = 1 - p / largest
    value = a * np.log(p) + (b - 1) * np.log1p(-p) + np.log(inside)
    first = a * inside - (b - 1) * p * inside / (1 - p) - p / largest
    second = p * inside * (a / largest + (b - 1) + 1 / largest)
    return np.asarray(value), np.asarray(first), np.asarray(second)

"""The population's threshold at one level: all answers at once, a threshold for each participant.

P(success of participant p at rate r) = ψ(r; threshold e^{μ + σ z_p}, width, guess_p, lapse) with z_p standard
normal. z_p is integrated out numerically, so that no participant's threshold has to be estimated first: a
participant with few answers, or with none but "yes", counts as far as the answers go. Pooled answers ignore
z_p, which flattens the function and moves its 75 % point upwards (docs/decisions/pooling.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from evenlight.analysis.calibration.psychometric.psychometric_fit import MAX_LAPSE, PsychometricPrior
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.data_schema.arrays import Array
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, WIDTH_LOGITS

LAST_NODE = 6.0  # of z: beyond, a standard normal holds 2e-9
NODES = 121  # 0.1 apart: 481 change no estimate by more than 1e-4 (tests/analysis/test_random_threshold.py)
LARGEST_LOGIT = 60.0  # F differs from 0 or 1 by 1e-26 there
START_SD = 0.25  # of ln(threshold) between participants: what brightness studies find (choice)
STEP = 1e-4  # of the differences that the curvature is made of


@dataclass(frozen=True, slots=True)
class RandomThresholdFit:
    """The population's threshold at one level.

    Attributes
    ----------
    threshold : float
        e^μ: of the median participant [cd/m^2/s].
    ci_low, ci_high : float
        95 % confidence interval, Student's t with one degree of freedom less than there are participants
        [cd/m^2/s].
    standard_error_ln, participant_sd : float
        Of μ; and σ, of ln(threshold) between participants.
    width, lapse_rate, n_participants : float, float, int
        Of all participants, and how many.
    """

    threshold: float
    ci_low: float
    ci_high: float
    standard_error_ln: float
    participant_sd: float
    width: float
    lapse_rate: float
    n_participants: int


def even_rule(n: int = NODES) -> tuple[Array, Array]:
    """Return n equally spaced nodes of z and the logarithms of their weights under a standard normal.

    The trapezoid rule converges exponentially for smooth densities that have faded at both ends, and its
    nodes lie 0.1 apart wherever a participant is. Those of Gauss and Hermite lie farther apart for the same
    number (21: 0.6, 101: 0.3), and step over the likelihood of a participant with many answers: with 320 of
    each, 21 state a third of the standard error and 101 miss the threshold by up to 7 %.
    """
    nodes = np.linspace(-LAST_NODE, LAST_NODE, n)
    ln_weights = -0.5 * nodes**2
    return nodes, ln_weights - special.logsumexp(ln_weights)


def fit_random_threshold(
    participants: Sequence[RampCounts],
    prior: PsychometricPrior | None = None,
    rule: tuple[Array, Array] | None = None,
) -> RandomThresholdFit | None:
    """Fit the population's threshold at one level by maximum penalized likelihood.

    Width and lapse rate have the priors of the individual fits. σ has the factor σ of Chung et al. (2013,
    Psychometrika 78, 685): in a normal model it turns the maximum-likelihood divisor P into P - 1, and it
    keeps σ off 0.

    Parameters
    ----------
    participants : sequence of RampCounts
        The answers of each; guess rates are taken from the catch trials, or from the task.
    prior : PsychometricPrior, optional
        Of width, guess and lapse rate.
    rule : (array, array), optional
        Nodes of z and logarithms of their weights; `even_rule()` by default.

    Returns
    -------
    RandomThresholdFit or None
        None for fewer than two participants, or answers that are all alike.
    """
    success = sum(int(counts.n_yes.sum()) for counts in participants)
    trials = sum(int(counts.n_trials.sum()) for counts in participants)
    if len(participants) < 2 or success in (0, trials):
        return None
    prior = prior or PsychometricPrior()
    lapse = prior.lapse_after(participants[0].guess_rate)
    model = _Model(_stacked(participants, prior), prior, lapse, rule or even_rule())
    start = np.array([model.middle, np.log(START_SD), np.log(model.prior.width_median), -2.5])
    best = optimize.minimize(model.cost, start, method="BFGS", options={"gtol": 1e-4}).x
    variance = float(np.linalg.inv(_curvature(model, best))[0, 0])
    error = float(np.sqrt(variance)) if variance > 0 else float("inf")
    half = float(special.stdtrit(len(participants) - 1, 0.975)) * error
    if not np.isfinite(half) or half > 50:  # answers that leave the threshold unknown within any bounds
        return None
    return RandomThresholdFit(
        threshold=float(np.exp(best[0])),
        ci_low=float(np.exp(best[0] - half)),
        ci_high=float(np.exp(best[0] + half)),
        standard_error_ln=error,
        participant_sd=float(np.exp(best[1])),
        width=float(np.exp(best[2])),
        lapse_rate=float(MAX_LAPSE * special.expit(best[3])),
        n_participants=len(participants),
    )


@dataclass(frozen=True, slots=True)
class _Stacked:
    """The answers of all participants, one row per participant and rate."""

    x: Array
    success: Array
    failure: Array
    guess: Array
    starts: NDArray[np.int64]


def _stacked(participants: Sequence[RampCounts], prior: PsychometricPrior) -> _Stacked:
    """Return the answers of all participants, one below the other."""
    sizes = [counts.rates.size for counts in participants]
    guess = np.repeat([_guess_rate(counts, prior) for counts in participants], sizes)
    n = np.concatenate([counts.n_trials for counts in participants])
    success = np.concatenate([counts.n_yes for counts in participants])
    return _Stacked(
        x=np.log(np.concatenate([counts.rates for counts in participants])),
        success=success.astype(np.float64),
        failure=(n - success).astype(np.float64),
        guess=guess,
        starts=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
    )


def _guess_rate(counts: RampCounts, prior: PsychometricPrior) -> float:
    """Return a participant's guess rate: the task's, or its mean after the catch trials."""
    if counts.guess_rate is not None:
        return counts.guess_rate
    a, b = prior.guess
    mean = (a + counts.catch_yes) / (a + b + counts.catch_trials)
    return float(min(mean, 0.7))  # 75 % is never reached above 0.75


class _Model:
    """The penalized likelihood of μ, ln σ, ln width and the scaled logit of the lapse rate."""

    def __init__(
        self,
        answers: _Stacked,
        prior: PsychometricPrior,
        lapse: tuple[float, float],
        rule: tuple[Array, Array],
    ) -> None:
        self.answers, self.prior, self.lapse = answers, prior, lapse
        self.nodes, self.ln_weights = rule

    @property
    def middle(self) -> float:
        """Mean ln(rate) of the answers: where the search begins."""
        return float(np.average(self.answers.x, weights=self.answers.success + self.answers.failure))

    def cost(self, parameters: Array) -> float:
        """Return minus the logarithm of the penalized likelihood."""
        mu, ln_sd, ln_width, u = (float(p) for p in parameters)
        ln_sd, ln_width = float(np.clip(ln_sd, -8, 3)), float(np.clip(ln_width, -5, 5))
        lapse = MAX_LAPSE * float(special.expit(np.clip(u, -30, 30)))
        ln_prior = (
            ln_sd
            - 0.5 * ((ln_width - np.log(self.prior.width_median)) / self.prior.width_spread) ** 2
            + self.lapse[0] * np.log(lapse)
            + (self.lapse[1] - 1) * np.log1p(-lapse)
            + np.log1p(-lapse / MAX_LAPSE)
        )
        # Beyond their clips the parameters only cost: the search cannot wander off.
        beyond = (parameters[1] - ln_sd) ** 2 + (parameters[2] - ln_width) ** 2
        return -float(self._ln_likelihood(mu, np.exp(ln_sd), np.exp(ln_width), lapse) + ln_prior - beyond)

    def _ln_likelihood(self, mu: float, sd: float, width: float, lapse: float) -> float:
        """Return the logarithm of the likelihood, the participants' z integrated out.

        With odds s = F / (1 - F): ψ = (γ + (1 - λ)s) / (1 + s) and 1 - ψ = ((1 - γ) + λs) / (1 + s).
        """
        a = self.answers
        at_threshold = np.log((THRESHOLD_PROBABILITY - a.guess) / (1 - THRESHOLD_PROBABILITY - lapse))
        slope = WIDTH_LOGITS / width
        logit = (slope * (a.x - mu) + at_threshold)[:, None] - slope * sd * self.nodes
        odds = np.exp(np.clip(logit, -LARGEST_LOGIT, LARGEST_LOGIT))
        g = a.guess[:, None]
        rows = a.success[:, None] * np.log(g + (1 - lapse) * odds)
        rows += a.failure[:, None] * np.log((1 - g) + lapse * odds)
        rows -= (a.success + a.failure)[:, None] * np.log1p(odds)
        each = np.add.reduceat(rows, a.starts, axis=0) + self.ln_weights
        return float(np.sum(special.logsumexp(each, axis=1)))


def _curvature(model: _Model, best: Array) -> Array:
    """Return the matrix of second differences of the cost."""
    size = best.size
    steps = np.eye(size) * STEP * np.array([10.0, 100.0, 10.0, 100.0])
    matrix = np.empty((size, size))
    for i in range(size):
        for j in range(i, size):
            corners = [
                sign_i * sign_j * model.cost(best + sign_i * steps[i] + sign_j * steps[j])
                for sign_i in (1, -1)
                for sign_j in (1, -1)
            ]
            matrix[i, j] = matrix[j, i] = sum(corners) / (4 * steps[i, i] * steps[j, j])
    return matrix

"""The population's threshold at each level, estimated in three ways that should not be confused.

All answers with a random threshold (the estimate to be trusted), all answers pooled as if one person had
given them (the paper's way, if "the answers" means that: no guessing, no lapses, and a curve through the 75 %
points), and the geometric mean of the thresholds fitted to each participant. Pooling flattens the
psychometric function by the differences between participants, which moves its 75 % point upwards
(docs/decisions/which-model.md).

With a random threshold, P(success of participant p at rate r) = ψ(r; threshold e^{μ + σ z_p}, width, guess_p,
lapse), z_p standard normal. z_p is integrated out numerically, so that no participant's threshold has to be
estimated first: one with few answers, or with none but "yes", counts as far as the answers go.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import optimize, special

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    MAX_GUESS,
    MAX_LAPSE,
    WIDTH_PRIOR,
    guess_prior,
    lapse_prior,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampCounts,
    RampLevelKey,
    by_joined_level,
    level_of_trial,
    level_order,
    pooled_counts,
    ramp_counts,
)
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE, ThresholdFit, level_of_fit
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import RateLimitFit, fit_points
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.quantities import quantity
from evenlight.data_schema.recordings.ramp import RampTrial
from evenlight.data_schema.threshold import ThresholdFlag
from evenlight.method.psychometric import (
    WIDTH_LOGITS,
    PsychometricFunction,
    log_likelihood,
    threshold_logit,
)

LN_WIDTH_RANGE = (-3.0, 3.0)  # ln of the width in ln(rate): from a step to no slope within any range tested
LAST_NODE = 6.0  # of z: beyond, a standard normal holds 2e-9
NODES = 121  # 0.1 apart: 481 change no estimate by more than 1e-4 (tests/analysis/test_random_threshold.py)
LARGEST_LOGIT = 60.0  # F differs from 0 or 1 by 1e-26 there
START_SD = 0.25  # of ln(threshold) between participants: what brightness studies find (choice)
STEP = 1e-4  # of the differences that the curvature is made of


@dataclass(frozen=True, slots=True)
class LevelEstimates:
    """Three estimates of the population's threshold at one level."""

    level: RampLevelKey
    # With a threshold for each participant, integrated out; None for fewer than two participants. Left out
    # are those with too many false alarms, but not those who answered all alike.
    random: RandomThresholdFit | None
    pooled: float | None  # 75 % point of all answers pooled [cd/m^2/s]; None if they are all alike
    mean_of_fits: float | None  # geometric mean of the participants' usable thresholds [cd/m^2/s]
    n_participants: int
    n_usable: int  # thresholds

    @property
    def pooled_ratio(self) -> float | None:
        """Pooled over random threshold."""
        return self.pooled / self.random.threshold if self.pooled and self.random else None

    @property
    def mean_ratio(self) -> float | None:
        """Mean of individual fits over random threshold."""
        return self.mean_of_fits / self.random.threshold if self.mean_of_fits and self.random else None

    @property
    def in_words(self) -> str:
        """What pooling does here."""
        if self.random is None:
            return "no random threshold: two participants or more with answers of both kinds are needed"
        ratios = {"pooled fit": self.pooled_ratio, "mean of individual fits": self.mean_ratio}
        return "; ".join(
            f"the {name} lies {_percent(ratio)} the population's threshold"
            for name, ratio in ratios.items()
            if ratio is not None
        )


def estimate_levels(fits: Iterable[ThresholdFit]) -> tuple[LevelEstimates, ...]:
    """Return the estimates of every level, from the fits of each participant and level."""
    levels = by_joined_level(fits, level_of_fit)
    return tuple(_estimates(level, levels[level]) for level in sorted(levels, key=level_order))


def _estimates(level: RampLevelKey, fits: Sequence[ThresholdFit]) -> LevelEstimates:
    usable = [fit.threshold.threshold for fit in fits if fit.threshold.flag not in UNUSABLE]
    honest: dict[str, list[RampCounts]] = {}
    for fit in fits:
        if fit.threshold.flag is not ThresholdFlag.FALSE_ALARMS:
            honest.setdefault(fit.threshold.participant_id, []).append(fit.fit.counts)
    return LevelEstimates(
        level=level,
        random=fit_random_threshold([_own_counts(counts) for counts in honest.values()]),
        pooled=logistic_threshold(pooled_counts([fit.fit.counts for fit in fits])),
        mean_of_fits=_geometric_mean(usable),
        n_participants=len({fit.threshold.participant_id for fit in fits}),
        n_usable=len(usable),
    )


def _own_counts(counts: Sequence[RampCounts]) -> RampCounts:
    """Return one participant's answers at a level, under however many calibrations of the display."""
    if len(counts) == 1:
        return counts[0]
    yes, trials = counts[0].catch_yes, counts[0].catch_trials  # the participant's, at all levels
    return dataclasses.replace(pooled_counts(counts), catch_yes=yes, catch_trials=trials)


def mean_ratios(levels: Sequence[LevelEstimates]) -> tuple[float | None, float | None]:
    """Return pooled and mean-of-fits over random threshold, geometric means over the levels."""
    pooled = [level.pooled_ratio for level in levels if level.pooled_ratio]
    means = [level.mean_ratio for level in levels if level.mean_ratio]
    return _geometric_mean(pooled), _geometric_mean(means)


def difference_in_words(levels: Sequence[LevelEstimates]) -> str | None:
    """Return what pooling and averaging do over all levels, in words; None if nothing can be compared."""
    pooled, means = mean_ratios(levels)
    if pooled is None or means is None:
        return None
    return (
        f"on average over {len(levels)} levels, the pooled fit lies {_percent(pooled)} and the geometric "
        f"mean of individual fits {_percent(means)} the population's threshold with one of their own for "
        "each participant"
    )


def level_mapping(estimates: LevelEstimates) -> dict[str, Any]:
    """Return the estimates of a level as an entry of `fit_summary.json`."""
    level, random = estimates.level, estimates.random
    return {
        "screen": level.screen,
        "factor": level.factor,
        "luminance_cd_m2": level.luminance,
        "direction": level.direction.value,
        "ramp_duration_s": level.ramp_duration,
        "procedure": level.procedure.value,
        "n_participants": estimates.n_participants,
        "n_usable": estimates.n_usable,
        "random_threshold": None if random is None else mapping_from_record(random),
        "pooled_threshold_cd_m2_s": estimates.pooled,
        "mean_of_fits_cd_m2_s": estimates.mean_of_fits,
        "pooled_ratio": estimates.pooled_ratio,
        "mean_of_fits_ratio": estimates.mean_ratio,
        "in_words": estimates.in_words,
    }


def _geometric_mean(values: Sequence[float]) -> float | None:
    return float(np.exp(np.mean(np.log(values)))) if values else None


def _percent(ratio: float) -> str:
    return f"{abs(100 * (ratio - 1)):.1f} % {'above' if ratio >= 1 else 'below'}"


def fit_pooled(
    trials: Iterable[RampTrial], display: Display, options: RateLimitOptions | None = None
) -> RateLimitFit:
    """Fit the rate limit as the paper did: pooled logistic fits, then a polynomial through their 75 % points.

    Parameters
    ----------
    trials : iterable of RampTrial
        Of all participants; catch trials are left out, as the paper has none.
    display : Display
        What they were shown on.
    options : RateLimitOptions, optional
        Form and degree of the curve, and of which direction and duration the ramps are that it is drawn
        through; all of them, unless it says so.

    Raises
    ------
    InputError
        If too few levels have both answers.
    """
    options = options or RateLimitOptions()
    levels = by_joined_level((trial for trial in trials if not trial.is_catch), level_of_trial)
    points = [
        (level.luminance, rate)
        for level, group in levels.items()
        if options.direction in (None, level.direction)
        and options.ramp_duration in (None, level.ramp_duration)
        and (rate := logistic_threshold(ramp_counts(group))) is not None
    ]
    luminance, threshold = np.array(points).reshape(-1, 2).T
    return fit_points(luminance, threshold, display, options, name="pooled")


def logistic_threshold(counts: RampCounts) -> float | None:
    """Return the 75 % point [cd/m^2/s] of the most likely logistic function without guessing or lapses.

    Of two intervals, the function rises from the half that is right by chance. None if all answers are alike:
    no function is the most likely one then. With perfectly separated answers the function becomes a step, and
    the point lies between the last "no" and the first "yes".

    >>> even = RampCounts(np.array([1.0, 2.0, 4.0]), np.array([1, 2, 3]), np.array([4, 4, 4]))
    >>> round(logistic_threshold(even), 3)  # symmetric: 25, 50 and 75 % at 1, 2 and 4
    4.0
    """
    if counts.n_yes.sum() in (0, counts.n_trials.sum()):
        return None
    x = np.log(counts.rates)

    def cost(parameters: Array) -> float:
        width = float(np.exp(np.clip(parameters[1], *LN_WIDTH_RANGE)))
        threshold = float(np.exp(np.clip(parameters[0], -50, 50)))
        function = PsychometricFunction(threshold, width, counts.guess_rate or 0.0)
        return -log_likelihood(function, counts.rates, counts.n_yes, counts.n_trials)

    start = np.array([np.average(x, weights=counts.n_trials), 0.5])
    best = optimize.fmin(cost, start, xtol=1e-6, ftol=1e-9, disp=False)
    return float(np.exp(best[0]))


@dataclass(frozen=True, slots=True)
class RandomThresholdFit:
    """The population's threshold at one level."""

    threshold: float = quantity("cd/m^2/s", "e^μ: that of the median participant")
    ci_low: float = quantity("cd/m^2/s", "95 % confidence interval: Student's t, participants less one")
    ci_high: float = quantity("cd/m^2/s", "its other end")
    standard_error_ln: float = quantity("1", "of μ")
    participant_sd: float = quantity("1", "σ, of ln(threshold) between participants", key="participant_sd_ln")
    width: float = quantity("1", "that of all participants")
    lapse_rate: float = quantity("1", "that of all participants")
    n_participants: int = quantity("1", "how many")


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
    participants: Sequence[RampCounts], rule: tuple[Array, Array] | None = None
) -> RandomThresholdFit | None:
    """Fit the population's threshold at one level by maximum penalized likelihood.

    Width and lapse rate have the priors of the individual fits. σ has the factor σ of Chung et al. (2013,
    Psychometrika 78, 685): in a normal model it turns the maximum-likelihood divisor P into P - 1, and it
    keeps σ off 0.

    Parameters
    ----------
    participants : sequence of RampCounts
        The answers of each; guess rates are taken from the catch trials, or from the task.
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
    model = RandomThresholdModel(participants, rule or even_rule())
    start = np.array([model.middle, np.log(START_SD), np.log(WIDTH_PRIOR[0]), -2.5])
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


class RandomThresholdModel:
    """The penalized likelihood of μ, ln σ, ln width and the scaled logit of the lapse rate.

    The answers of all participants stand one below the other, a row for each participant and rate.
    """

    def __init__(self, participants: Sequence[RampCounts], rule: tuple[Array, Array]) -> None:
        self.lapse = lapse_prior(participants[0].guess_rate)
        self.nodes, self.ln_weights = rule
        parts = [(own, *part) for own in participants for part in own.parts(_guess_rate(own), 0.0)]
        sizes = [own.rates.size for own, *_ in parts]
        self.x = np.log(np.concatenate([own.rates for own, *_ in parts]))
        self.success, self.n = (np.concatenate([p[k] for p in parts]).astype(np.float64) for k in (1, 2))
        self.low, self.missed = (np.repeat([p[k] for p in parts], sizes) for k in (3, 4))
        self.guess = np.repeat([_guess_rate(own) for own, *_ in parts], sizes)
        self.kept = np.repeat([1 - (own.repeats.share if own.repeats else 0.0) for own, *_ in parts], sizes)
        everybody = [own.rates.size * (2 if own.repeats else 1) for own in participants]
        self.starts = np.concatenate([[0], np.cumsum(everybody)[:-1]]).astype(np.int64)

    @property
    def middle(self) -> float:
        """Mean ln(rate) of the answers: where the search begins."""
        return float(np.average(self.x, weights=self.n))

    def cost(self, parameters: Array) -> float:
        """Return minus the logarithm of the penalized likelihood."""
        mu, ln_sd, ln_width, u = (float(p) for p in parameters)
        ln_sd, ln_width = float(np.clip(ln_sd, -8, 3)), float(np.clip(ln_width, -5, 5))
        lapse = MAX_LAPSE * float(special.expit(np.clip(u, -30, 30)))
        ln_prior = (
            ln_sd
            - 0.5 * ((ln_width - np.log(WIDTH_PRIOR[0])) / WIDTH_PRIOR[1]) ** 2
            + self.lapse[0] * np.log(lapse)
            + (self.lapse[1] - 1) * np.log1p(-lapse)
            + np.log1p(-lapse / MAX_LAPSE)
        )
        # Beyond their clips the parameters only cost: the search cannot wander off.
        beyond = (parameters[1] - ln_sd) ** 2 + (parameters[2] - ln_width) ** 2
        return -float(self.ln_likelihood(mu, np.exp(ln_sd), np.exp(ln_width), lapse) + ln_prior - beyond)

    def ln_likelihood(self, mu: float, sd: float, width: float, lapse: float) -> float:
        """Return the logarithm of the likelihood, the participants' z integrated out.

        With odds s = F / (1 - F): ψ = (γ + (1 - λ)s) / (1 + s) and 1 - ψ = ((1 - γ) + λs) / (1 + s).
        """
        at_threshold = threshold_logit(self.guess)
        slope = WIDTH_LOGITS / width
        logit = (slope * (self.x - mu) + at_threshold)[:, None] - slope * sd * self.nodes
        odds = np.exp(np.clip(logit, -LARGEST_LOGIT, LARGEST_LOGIT))
        g, missed = self.low[:, None], (self.missed + self.kept * lapse)[:, None]
        success, n = self.success[:, None], self.n[:, None]
        rows = success * np.log(g + (1 - missed) * odds)
        rows += (n - success) * np.log((1 - g) + missed * odds)
        rows -= n * np.log1p(odds)
        each = np.add.reduceat(rows, self.starts, axis=0) + self.ln_weights
        return float(np.sum(special.logsumexp(each, axis=1)))


def _guess_rate(counts: RampCounts) -> float:
    if counts.guess_rate is not None:
        return counts.guess_rate
    a, b = guess_prior(counts.catch_yes, counts.catch_trials)
    return float(min(a / (a + b), MAX_GUESS))


def _curvature(model: RandomThresholdModel, best: Array) -> Array:
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

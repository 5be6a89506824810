"""The population's threshold at each level, estimated in three ways that should not be confused.

All answers with a random threshold (the estimate to be trusted), all answers pooled as if one person had
given them (the paper's way, if "the answers" means that: no guessing, no lapses, and a curve through the 75 %
points), and the geometric mean of the thresholds fitted to each participant. Pooling flattens the
psychometric function by the differences between participants, which moves its 75 % point upwards
(docs/decisions/pooling.md).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampCounts,
    RampLevelKey,
    group_by_level,
    joined_levels,
    level_of_threshold,
    level_order,
    ramp_counts,
)
from evenlight.analysis.calibration.psychometric.random_threshold import (
    RandomThresholdFit,
    fit_random_threshold,
)
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE, ThresholdFit
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import RateLimitFit, fit_points
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import RampTrial
from evenlight.data_schema.threshold import ThresholdFlag
from evenlight.method.psychometric import PsychometricFunction, log_likelihood

LN_WIDTH_RANGE = (-3.0, 3.0)  # ln of the width in ln(rate): from a step to no slope within any range tested


@dataclass(frozen=True, slots=True)
class LevelEstimates:
    """Three estimates of the population's threshold at one level.

    Attributes
    ----------
    level : RampLevelKey
        Which.
    random : RandomThresholdFit or None
        With a threshold for each participant, integrated out; None for fewer than two participants. Left out
        are those with too many false alarms, but not those who answered all alike.
    pooled : float or None
        75 % point of all participants' answers pooled [cd/m^2/s]; None if they are all alike.
    mean_of_fits : float or None
        Geometric mean of the participants' usable thresholds [cd/m^2/s].
    n_participants, n_usable : int
        Participants at this level, and usable thresholds.
    """

    level: RampLevelKey
    random: RandomThresholdFit | None
    pooled: float | None
    mean_of_fits: float | None
    n_participants: int
    n_usable: int

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
        parts = [
            f"the {name} lies {_percent(ratio)} the population's threshold"
            for name, ratio in (
                ("pooled fit", self.pooled_ratio),
                ("mean of individual fits", self.mean_ratio),
            )
            if ratio is not None
        ]
        return "; ".join(parts)


def estimate_levels(fits: Iterable[ThresholdFit]) -> tuple[LevelEstimates, ...]:
    """Return the estimates of every level.

    Parameters
    ----------
    fits : iterable of ThresholdFit
        One per participant and level.
    """
    fits = tuple(fits)
    joined = joined_levels(level_of_threshold(fit.threshold) for fit in fits)
    levels: dict[RampLevelKey, list[ThresholdFit]] = {}
    for fit in fits:
        levels.setdefault(joined[level_of_threshold(fit.threshold)], []).append(fit)
    return tuple(_estimates(level, levels[level]) for level in sorted(levels, key=level_order))


def _estimates(level: RampLevelKey, fits: Sequence[ThresholdFit]) -> LevelEstimates:
    """Return the estimates of one level."""
    usable = [fit.threshold.threshold for fit in fits if fit.threshold.flag not in UNUSABLE]
    honest: dict[str, list[RampCounts]] = {}
    for fit in fits:
        if fit.threshold.flag is not ThresholdFlag.FALSE_ALARMS:
            honest.setdefault(fit.threshold.participant_id, []).append(fit.fit.counts)
    return LevelEstimates(
        level=level,
        random=fit_random_threshold([_own_counts(counts) for counts in honest.values()]),
        pooled=logistic_threshold(pooled_counts([fit.fit.counts for fit in fits])),
        mean_of_fits=float(np.exp(np.mean(np.log(usable)))) if usable else None,
        n_participants=len({fit.threshold.participant_id for fit in fits}),
        n_usable=len(usable),
    )


def _own_counts(counts: Sequence[RampCounts]) -> RampCounts:
    """Return one participant's answers at a level, under however many calibrations of the display."""
    if len(counts) == 1:
        return counts[0]
    yes, trials = counts[0].catch_yes, counts[0].catch_trials  # the participant's, at all levels
    return dataclasses.replace(pooled_counts(counts), catch_yes=yes, catch_trials=trials)


def pooled_counts(participants: Sequence[RampCounts]) -> RampCounts:
    """Return all participants' answers pooled, catch trials left out."""
    rates, index = np.unique(np.concatenate([c.rates for c in participants]), return_inverse=True)

    def summed(parts: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        return np.bincount(index, np.concatenate(parts), minlength=rates.size).astype(np.int64)

    return RampCounts(
        rates,
        summed([c.n_yes for c in participants]),
        summed([c.n_trials for c in participants]),
        guess_rate=participants[0].guess_rate,
    )


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
        "random_threshold": None if random is None else _random_mapping(random),
        "pooled_threshold_cd_m2_s": estimates.pooled,
        "mean_of_fits_cd_m2_s": estimates.mean_of_fits,
        "pooled_ratio": estimates.pooled_ratio,
        "mean_of_fits_ratio": estimates.mean_ratio,
        "in_words": estimates.in_words,
    }


def _random_mapping(fit: RandomThresholdFit) -> dict[str, float]:
    """Return the random threshold's figures, units in their keys."""
    return {
        "threshold_cd_m2_s": fit.threshold,
        "ci_low_cd_m2_s": fit.ci_low,
        "ci_high_cd_m2_s": fit.ci_high,
        "standard_error_ln": fit.standard_error_ln,
        "participant_sd_ln": fit.participant_sd,
        "width": fit.width,
        "lapse_rate": fit.lapse_rate,
        "n_participants": fit.n_participants,
    }


def _geometric_mean(values: Sequence[float]) -> float | None:
    """Return the geometric mean; None of nothing."""
    return float(np.exp(np.mean(np.log(values)))) if values else None


def _percent(ratio: float) -> str:
    """Return a ratio as "12.3 % above"."""
    return f"{abs(100 * (ratio - 1)):.1f} % {'above' if ratio >= 1 else 'below'}"


@dataclass(frozen=True, slots=True)
class PooledFit:
    """The pooled analysis of the paper.

    Attributes
    ----------
    luminance, threshold : array (n,)
        75 % points of the pooled answers [cd/m^2], [cd/m^2/s].
    curve : RateLimitFit
        The unweighted polynomial through them.
    left_out : int
        Levels whose pooled answers were all "yes" or all "no".
    levels : dict of RampLevelKey to float
        75 % point of the pooled answers of every level [cd/m^2/s], those of other conditions included.
    """

    luminance: NDArray[np.float64]
    threshold: NDArray[np.float64]
    curve: RateLimitFit
    left_out: int
    levels: dict[RampLevelKey, float]


def fit_pooled(
    trials: Iterable[RampTrial], display: Display, options: RateLimitOptions | None = None
) -> PooledFit:
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
    levels = group_by_level(trial for trial in trials if not trial.is_catch)
    points = {level: logistic_threshold(ramp_counts(group)) for level, group in levels.items()}
    found = {level: rate for level, rate in points.items() if rate is not None}
    own = {
        level: rate for level, rate in found.items() if _is_asked_for(level, options or RateLimitOptions())
    }
    luminance = np.array([level.luminance for level in own])
    threshold = np.array(list(own.values()))
    curve = fit_points(luminance, threshold, display, options, name="pooled")
    return PooledFit(luminance, threshold, curve, len(points) - len(found), found)


def _is_asked_for(level: RampLevelKey, options: RateLimitOptions) -> bool:
    """Return whether a level is of the direction and duration that the options name."""
    return options.direction in (None, level.direction) and options.ramp_duration in (
        None,
        level.ramp_duration,
    )


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

    def cost(parameters: NDArray[np.float64]) -> float:
        width = float(np.exp(np.clip(parameters[1], *LN_WIDTH_RANGE)))
        threshold = float(np.exp(np.clip(parameters[0], -50, 50)))
        function = PsychometricFunction(threshold, width, counts.guess_rate or 0.0)
        return -log_likelihood(function, counts.rates, counts.n_yes, counts.n_trials)

    start = np.array([np.average(x, weights=counts.n_trials), 0.5])
    best = optimize.fmin(cost, start, xtol=1e-6, ftol=1e-9, disp=False)
    return float(np.exp(best[0]))

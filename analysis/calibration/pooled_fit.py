"""The paper's way, shown beside ours: all participants' answers in one pot, no guessing, no lapses.

Pooling flattens the psychometric function by the differences between participants, which moves its 75 % point
upwards (docs/decisions/pooling.md).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from evenlight.analysis.calibration.posterior_grid import RampCounts
from evenlight.analysis.calibration.ramp_counts import RampLevelKey, group_by_level, ramp_counts
from evenlight.analysis.calibration.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit_fit import RateLimitFit, fit_points
from evenlight.data_schema.display import Display
from evenlight.data_schema.ramp import RampTrial
from evenlight.method.psychometric import PsychometricFunction, log_likelihood

LN_WIDTH_RANGE = (-3.0, 3.0)  # ln of the width in ln(rate): from a step to no slope within any range tested


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

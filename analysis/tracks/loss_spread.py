"""How unevenly contrast is lost over time, and how surely one way to dim is more even than another."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.data_schema.arrays import Array

COSINES = 4  # few: they must be slower than the content, of which minutes hold little
ENOUGH = 30.0  # measured correlation times that a walk must be long for the interval to hold what it says
SAME = 1e-12  # a spread below this is rounding


@dataclass(frozen=True, slots=True)
class SpreadRatio:
    """The standard deviations over time of two losses of one walk, and their ratio."""

    sd: float  # of the first
    sd_constant: float  # of the second
    ratio: float | None = None  # sd / sd_constant; None where the second never changes
    ci_low: float | None = None  # 95 % confidence interval; None where the ratio is 0 or missing
    ci_high: float | None = None
    correlation_time: float = 0.0  # after which the second's autocorrelation is below 1/e [s]
    flag: str = ""  # why there is no ratio or no interval


def spread_ratio(loss: Array, constant_loss: Array, durations: Array) -> SpreadRatio:
    """Return the ratio of two standard deviations over time, with an interval that knows of autocorrelation.

    Frames next to each other are all but alike: 900 of them are not 900 observations. The logarithm of the
    ratio moves with each frame by ψ = (x²/σ_x² - y²/σ_y²)/2 (delta method); the long-run variance of its mean
    is estimated from its products with the four slowest cosines, with Student's t of four degrees of freedom
    (Müller 2007; Lazarus, Lewis, Stock & Watson 2018). The interval is about walks as long as this one
    through content of this kind.

    Parameters
    ----------
    loss, constant_loss : array, (N,)
        Contrast loss of each frame under either way to dim.
    durations : array, (N,)
        How long each frame is shown [s].
    """
    share = durations / durations.sum()
    own, other = loss - share @ loss, constant_loss - share @ constant_loss
    sd, sd_constant = (math.sqrt(float(share @ x**2)) for x in (own, other))
    if sd_constant <= SAME:
        flag = "the loss under constant dimming never changes: there is no ratio"
        return SpreadRatio(sd, sd_constant, flag=flag)
    correlation = _correlation_time(other, durations)
    ratio, duration = sd / sd_constant, float(durations.sum())
    if sd <= SAME:
        return SpreadRatio(0.0, sd_constant, 0.0, None, None, correlation, "no interval for a ratio of 0")
    if duration < ENOUGH * correlation:
        flag = (
            f"no interval: {duration:.0f} s are only {duration / correlation:.0f} correlation times of the "
            "content, too few to tell this walk from others"
        )
        return SpreadRatio(sd, sd_constant, ratio, None, None, correlation, flag)
    influence = (own**2 / sd**2 - other**2 / sd_constant**2) / 2
    half = float(special.stdtrit(COSINES, 0.975)) * _long_run_error(influence, share)
    return SpreadRatio(sd, sd_constant, ratio, ratio * math.exp(-half), ratio * math.exp(half), correlation)


def _long_run_error(influence: Array, share: Array) -> float:
    middle = np.cumsum(share) - share / 2
    orders = np.arange(1, COSINES + 1)[:, None]
    products = (math.sqrt(2) * np.cos(math.pi * orders * middle)) @ (share * influence)
    return math.sqrt(float(np.mean(products**2)))


def _correlation_time(deviation: Array, durations: Array) -> float:
    """Return the time after which the autocorrelation is below 1/e; lags count frames of mean duration."""
    n = len(deviation)
    power = np.abs(np.fft.rfft(deviation, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[:n]
    below = np.flatnonzero(correlation < correlation[0] / math.e)
    return float(below[0] if len(below) else n) * float(np.mean(durations))

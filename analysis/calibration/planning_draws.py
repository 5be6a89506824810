"""Experiments drawn from a pool of simulated participants: the band that each reports, and its error."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit_fit import fit_thresholds
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.plan import MOST_PARTICIPANTS
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at


@dataclass(frozen=True, slots=True)
class Drawing:
    """How experiments are drawn and analysed.

    Attributes
    ----------
    display : Display
        What the ramps were shown on.
    options : RateLimitOptions
        How the rate limit is fitted.
    draws : int
        Experiments.
    seed : tuple of int
        Of who is drawn.
    """

    display: Display
    options: RateLimitOptions
    draws: int
    seed: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TrueLevels:
    """The pool's levels: initial luminances [cd/m^2], and the mean of ln(true threshold) at each."""

    luminance: Array
    ln_rate: Array


@dataclass(frozen=True, slots=True)
class Experiments:
    """Experiments as their analysis sees them and as they are.

    Attributes
    ----------
    half_widths : array (draws, levels)
        Of the bands, in ln(rate).
    errors : array (draws, levels)
        ln(fitted / true rate).
    participants : int
        In each.
    """

    half_widths: Array
    errors: Array
    participants: int

    @property
    def standard_errors(self) -> Array:
        """Of each draw's band, as for one participant: half-width · sqrt(N) / t, RMS [ln], (draws,)."""
        quantile = float(special.stdtrit(self.participants - 1, 0.975))
        return np.asarray(np.sqrt(np.mean(self.half_widths**2, axis=1) * self.participants) / quantile)

    @property
    def standard_error(self) -> float:
        """The RMS of the standard errors [ln]."""
        return float(np.sqrt(np.mean(self.standard_errors**2)))


def true_levels(truths: Sequence[Mapping[float, float]]) -> TrueLevels:
    """Return the truth of a pool from that of its participants, thresholds [cd/m^2/s] by luminance.

    >>> levels = true_levels([{10.0: 1.0, 20.0: 2.0}, {10.0: 4.0, 20.0: 2.0}])
    >>> np.exp(levels.ln_rate).round(9).tolist()
    [2.0, 2.0]
    """
    luminance = sorted(truths[0])
    ln_rate = np.mean([[np.log(truth[L]) for L in luminance] for truth in truths], axis=0)
    return TrueLevels(np.array(luminance), np.asarray(ln_rate, dtype=np.float64))


def participant_sd(truths: Sequence[Mapping[float, float]]) -> float:
    """Return the standard deviation of ln(true threshold) between participants, over the levels.

    >>> round(participant_sd([{10.0: 1.0, 20.0: 2.0}, {10.0: np.e, 20.0: 2 * np.e}]), 9)  # sqrt(1/2)
    0.707106781
    """
    logs = np.log([[truth[L] for L in sorted(truths[0])] for truth in truths])
    return float(np.sqrt(np.mean(np.var(logs, axis=0, ddof=1))))


def whole_pool_error(drawing: Drawing, pool: Sequence[Sequence[Threshold]], truth: TrueLevels) -> Array:
    """Return ln(fitted / true rate) at each level if all of a pool take part once, (levels,).

    It is common to all draws. Its mean over the levels is the bias of the analysis; the rest is chance in the
    pool's own answers, which an experiment with other participants would not share.
    """
    limit = _fitted(drawing, pool)
    return np.asarray(np.log(rate_limit_at(limit, truth.luminance)) - truth.ln_rate, dtype=np.float64)


def draw_experiments(
    drawing: Drawing, pool: Sequence[Sequence[Threshold]], truth: TrueLevels, participants: int
) -> Experiments:
    """Return experiments with so many participants, drawn from a pool with replacement.

    Parameters
    ----------
    drawing : Drawing
        How.
    pool : sequence of sequences of Threshold
        The thresholds of each who can be drawn.
    truth : TrueLevels
        Of the pool.
    participants : int
        How many are drawn.
    """
    rng = np.random.default_rng([*drawing.seed, participants])
    half_widths, errors = [], []
    for _ in range(drawing.draws):
        limit = _fitted(drawing, [pool[k] for k in rng.integers(len(pool), size=participants)])
        half_widths.append(_half_width(limit, truth.luminance))
        errors.append(np.log(rate_limit_at(limit, truth.luminance)) - truth.ln_rate)
    return Experiments(np.array(half_widths), np.array(errors), participants)


def _fitted(drawing: Drawing, chosen: Sequence[Sequence[Threshold]]) -> RateLimit:
    """Return the rate limit of some participants, each another one even if drawn twice."""
    thresholds = [
        dataclasses.replace(threshold, participant_id=f"{number:04d}")
        for number, own in enumerate(chosen)
        for threshold in own
    ]
    return fit_thresholds(thresholds, drawing.display, drawing.options).limit


def _half_width(limit: RateLimit, luminance: Array) -> Array:
    """Return the half-width of a limit's band at luminances [cd/m^2], in ln(rate)."""
    lower, upper = (
        np.interp(luminance, limit.band_luminance, np.log(edge))
        for edge in (limit.band_lower, limit.band_upper)
    )
    return np.asarray((upper - lower) / 2, dtype=np.float64)


def resampling_spread(resampled: Experiments) -> float:
    """Return how well a pool tells the standard error of its bands: the SD of its logarithm.

    Who happened to be in the pool decides how much its people differ. Draws of as many participants as there
    are in the pool, with replacement, show what other pools would have given (the bootstrap).

    Parameters
    ----------
    resampled : Experiments
        With as many participants as the pool has.
    """
    return float(np.std(np.log(resampled.standard_errors), ddof=1))


def participants_needed(standard_error: float, precision: float) -> int | None:
    """Return how many participants give a band of a half-width, or None if more than 1000 do not.

    Half-width = t(N - 1) · standard error / sqrt(N) in ln(rate), t the 97.5 % point of Student's t.

    Parameters
    ----------
    standard_error : float
        As for one participant [ln].
    precision : float
        Half-width wanted, as a share.

    >>> participants_needed(0.3, 0.1)  # ln 1.1 = 0.0953; 2.02 · 0.3 / sqrt(41) = 0.0947, of 40: 0.0959
    41
    """
    n = np.arange(2, MOST_PARTICIPANTS + 1)
    half = special.stdtrit(n - 1, 0.975) * standard_error / np.sqrt(n)
    enough = np.flatnonzero(half <= np.log1p(precision))
    return int(n[enough[0]]) if enough.size else None

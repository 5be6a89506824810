"""Effect sizes of paired differences with intervals that hold for few, discrete and tied ratings.

Seventeen pairs of ratings 1 to 5 have five or six different differences, often half of them 0. Student's t
then misses too often where nearly all pairs are alike (its spread comes out too small, or 0), and
approximations by Fisher's z fail where nearly all differ in one direction. The intervals here were chosen by
their exact coverage, from all histograms of 17 differences (docs/decisions/rating-inference.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evenlight.analysis.inference.exact_intervals import joined, shared_interval, sign_flip_interval
from evenlight.data_schema.arrays import Array, Integers

LEVEL = 0.95
LARGE_D_Z = 1.5  # beyond it 17 ratings 1 to 5 do not tell their own spread: coverage below 92 % is met

# Two pairs that were not rated: one without a difference, half a pair with 1 step in either direction. For
# differences of 0 and ± 1 this is the adjustment of Agresti & Min (2005).
PSEUDO_STEPS = (-1, 0, 1)
PSEUDO_PAIRS = (0.5, 1.0, 0.5)


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect size.

    Attributes
    ----------
    value : float or None
        None where the differences do not give it.
    ci_low, ci_high : float or None
        95 % confidence interval; None where there is none.
    flag : str
        Why it is missing, or should be looked at.
    p_value : float or None
        Of the test that goes with it; None where there is none.
    """

    value: float | None
    ci_low: float | None = None
    ci_high: float | None = None
    flag: str = ""
    p_value: float | None = None


def mean_difference(differences: ArrayLike, step: float = 1.0) -> Effect:
    """Return the mean difference, with Student's t on a spread to which two pseudo pairs are added.

    Parameters
    ----------
    differences : array_like, (n,)
        In rating points.
    step : float
        Smallest difference that the scale of the answers can show [rating points].

    >>> effect = mean_difference([1, 1, 0, 2])
    >>> effect.value, round(effect.ci_low, 2), round(effect.ci_high, 2)
    (1.0, -0.48, 2.48)
    """
    values = np.asarray(differences, dtype=np.float64)
    n, mean = values.size, float(values.mean())
    if n < 2:
        return Effect(mean, flag="one pair: no interval")
    half = _t_quantile(n - 1) * _adjusted_sd(values, step) / math.sqrt(n)
    return Effect(mean, mean - half, mean + half, _alike(values))


def exact_mean_difference(scores: Integers, step: float) -> Effect:
    """Return the mean difference with an interval that excludes 0 exactly where `sign_flip_test` has p < 5 %.

    It holds all differences that the sign-flip test does not reject, and those of `mean_difference`: where
    nearly all pairs are alike, the former would hold them alone.

    Parameters
    ----------
    scores : array of int, (n,)
        Differences in steps.
    step : float
        As in `mean_difference`.

    >>> effect = exact_mean_difference(np.array([1, 2, 3, 4, 5, 6]), 1.0)
    >>> effect.ci_low, round(effect.ci_high, 2)
    (1.0, 6.0)
    """
    effect = mean_difference(step * scores, step)
    if effect.ci_low is None or effect.ci_high is None:
        return effect
    low, high = sign_flip_interval(scores)
    return Effect(
        effect.value, *joined((step * low, step * high), (effect.ci_low, effect.ci_high)), effect.flag
    )


def within(effect: Effect, lowest: float, highest: float) -> Effect:
    """Return an effect whose interval keeps to what the scale can show.

    >>> within(Effect(3.5, 2.0, 5.0), -4, 4).ci_high
    4
    """
    low = None if effect.ci_low is None else max(effect.ci_low, lowest)
    high = None if effect.ci_high is None else min(effect.ci_high, highest)
    return replace(effect, ci_low=low, ci_high=high)


def group_difference(first: ArrayLike, second: ArrayLike, step: float = 1.0) -> Effect:
    """Return the mean of one group less that of another, by Welch's t with two pseudo answers in each.

    Parameters
    ----------
    first, second : array_like, (n1,) and (n2,)
        Of two groups of people [rating points].
    step : float
        As in `mean_difference`.
    """
    groups = [np.asarray(group, dtype=np.float64) for group in (first, second)]
    value = float(groups[0].mean() - groups[1].mean())
    if min(group.size for group in groups) < 2:
        return Effect(value, flag="one participant in a group: no interval")
    # The pseudo answers lie about each group's own median, as those of pairs do about no difference.
    spreads = [_adjusted_sd(g - np.sort(g)[(g.size - 1) // 2], step) ** 2 / g.size for g in groups]
    freedom = sum(spreads) ** 2 / sum(s**2 / (g.size - 1) for s, g in zip(spreads, groups, strict=True))
    half = _t_quantile(freedom) * math.sqrt(sum(spreads))
    return Effect(value, value - half, value + half)


def standardized_difference(differences: ArrayLike, step: float = 1.0) -> Effect:
    """Return Cohen's d_z, mean over SD (n - 1) of the differences, with an interval by the noncentral t.

    The interval has both ends that the spread as found and the spread with two pseudo pairs give by Steiger
    and Fouladi (1997), whichever lie further out.

    Parameters
    ----------
    differences : array_like, (n,)
        In rating points.
    step : float
        As in `mean_difference`.
    """
    values = np.asarray(differences, dtype=np.float64)
    if values.size < 2 or not np.ptp(values) > 0:
        few = "one pair" if values.size < 2 else f"all {values.size} differences are alike"
        return Effect(None, flag=f"{few}: no spread")
    mean, sd = float(values.mean()), float(values.std(ddof=1))
    ends = [_noncentral_interval(mean / spread, values.size) for spread in (sd, _adjusted_sd(values, step))]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    large = abs(mean / sd) > LARGE_D_Z
    return Effect(mean / sd, low, high, f"beyond {LARGE_D_Z:g} few ratings do not tell their spread" * large)


def _with_pseudo_pairs(values: Array, step: float) -> tuple[Array, Array]:
    """Return the differences with those of the pseudo pairs, and their weights."""
    everything = np.concatenate([values, step * np.array(PSEUDO_STEPS)])
    return everything, np.concatenate([np.ones(values.size), PSEUDO_PAIRS])


def _adjusted_sd(values: Array, step: float) -> float:
    """Return the SD (n - 1) of the differences with the pseudo pairs among them: never 0."""
    everything, weights = _with_pseudo_pairs(values, step)
    mean = np.average(everything, weights=weights)
    return float(np.sqrt(np.sum(weights * (everything - mean) ** 2) / (weights.sum() - 1)))


def _noncentral_interval(d_z: float, n: int) -> tuple[float, float]:
    """Return the d_z for which what was found, t = d_z √n, is at the 97.5 % and at the 2.5 % point."""
    t, tail = abs(d_z) * math.sqrt(n), (1 - LEVEL) / 2
    ends = [float(scipy.special.nctdtrinc(n - 1, share, t)) / math.sqrt(n) for share in (1 - tail, tail)]
    return (ends[0], ends[1]) if d_z >= 0 else (-ends[1], -ends[0])


def _t_quantile(df: float) -> float:
    return float(scipy.special.stdtrit(df, (1 + LEVEL) / 2))


def _alike(values: Array) -> str:
    if np.ptp(values) > 0:
        return ""
    return f"all {values.size} differences are alike: the interval rests on two pseudo pairs"


def superiority(differences: ArrayLike) -> Effect:
    """Return P(better) + ½ P(alike), the probability that a participant's first of a pair is the better one.

    0.5 is no effect. Interval: the score interval of a paired difference of shares, P(better) - P(worse),
    by Tango (1998), joined with that of the sign test, moved from [-1, 1] to [0, 1].

    Parameters
    ----------
    differences : array_like, (n,)
        Of either sign; only the signs count.

    >>> superiority([1, 2, 0, -1]).value  # 2 better, 1 alike, 1 worse
    0.625
    """
    values = np.asarray(differences, dtype=np.float64)
    better, worse = int(np.sum(values > 0)), int(np.sum(values < 0))
    by_signs = shared_interval(better, worse, values.size)
    low, high = joined(by_signs, _tango_interval(better, worse, values.size))
    flag = "all pairs alike" if better == worse == 0 else ""
    return Effect(0.5 + (better - worse) / (2 * values.size), (1 + low) / 2, (1 + high) / 2, flag)


def _tango_interval(better: int, worse: int, n: int) -> tuple[float, float]:
    """Return the score interval of P(better) - P(worse) (Tango 1998)."""
    z = float(scipy.special.ndtri((1 + LEVEL) / 2))
    found = (better - worse) / n

    def score(difference: float, beyond: float) -> float:
        gap = n * (found - difference)
        variance = _tango_variance(difference, better, worse, n)
        if gap == 0 or variance > 0:
            return (gap / math.sqrt(variance) if gap else 0.0) - beyond
        return math.copysign(math.inf, gap)  # at the ends of the scale nothing varies

    low = -1.0 if found == -1 else scipy.optimize.bisect(score, -1.0, found, args=(z,), xtol=1e-12)
    high = 1.0 if found == 1 else scipy.optimize.bisect(score, found, 1.0, args=(-z,), xtol=1e-12)
    return float(low), float(high)


def _tango_variance(difference: float, better: int, worse: int, n: int) -> float:
    """Return n times the variance of the difference of shares, its nuisance by maximum likelihood."""
    linear = (2 * n - better + worse) * difference - better - worse
    constant = -worse * difference * (1 - difference)
    share = (math.sqrt(max(linear**2 - 8 * n * constant, 0.0)) - linear) / (4 * n)
    return max(n * (2 * share + difference * (1 - difference)), 0.0)


def rank_biserial(differences: ArrayLike, step: float = 1.0) -> Effect:
    """Return the matched-pairs rank-biserial correlation: signed ranks over all ranks (Kerby 2014).

    Pairs without a difference keep their ranks (Pratt 1959). The sum of signed ranks then counts pairs of
    participants i <= j by the sign of d_i + d_j (Tukey's Walsh averages), so that the correlation estimates
    P(d_i + d_j > 0) - P(d_i + d_j < 0). Interval: that difference with two pseudo pairs, Student's t on its
    standard error as a U-statistic (Hoeffding 1948), within [-1, 1].

    Parameters
    ----------
    differences : array_like, (n,)
        Of either sign.
    step : float
        As in `mean_difference`.

    >>> rank_biserial([0, 2, 2, 5]).value  # (2.5 + 2.5 + 4) of 10: the pair without a difference has rank 1
    0.9
    """
    values = np.asarray(differences, dtype=np.float64)
    n = values.size
    signs = np.sign(values[:, None] + values)
    value = float(np.triu(signs).sum() / (n * (n + 1) / 2))
    if n < 2:
        return Effect(value, flag="one pair: no interval")
    everything, weights = _with_pseudo_pairs(values, step)
    projections = np.sign(everything[:, None] + everything) @ weights / weights.sum()
    centre = float(np.average(projections, weights=weights))
    variance = np.sum(weights * (projections - centre) ** 2) / (weights.sum() - 1)
    half = _t_quantile(n - 1) * 2 * math.sqrt(variance / n)
    return Effect(
        value, max(min(centre - half, value), -1.0), min(max(centre + half, value), 1.0), _alike(values)
    )

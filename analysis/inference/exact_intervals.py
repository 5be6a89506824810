"""Confidence intervals that agree with exact tests: they exclude "no difference" exactly where p < 5 %.

The sign-flip test of d - δ is turned round: the interval holds every δ that it does not reject. A choice of
signs reaches the sum that was found exactly where the differences that it turns have a mean of at most δ, so
that p counts the means of all 2^n - 1 subsets: the ends are two of those means (Hartigan 1969, "typical
values"), and nothing is searched for. Exact where d - δ is symmetric about 0. Answers on few steps are not
quite, and where all are alike their only "mean" would be the interval; hence `joined`, with an interval that
allows for that.

p of an exact test is a multiple of 2^(1 - n), which is never 0.05: "p < 5 %" has no borderline.
"""

from __future__ import annotations

import math

import numpy as np

from evenlight.analysis.inference.binomial_tests import ALPHA, Interval, clopper_pearson
from evenlight.analysis.inference.exact_tests import ExactTest, sign_flip_test, subset_counts
from evenlight.data_schema.arrays import Array, Integers

LISTED = 14  # people whose subsets are listed one by one: 2^14
MOST_WORK = 2e8  # additions in the table of subsets; beyond, the sums of subsets count as normal
MOST_PEOPLE = 1000  # 2^1024 is beyond the numbers
NORMAL = 1.959963984540054  # 97.5 % point


def sign_flip_interval(scores: Integers, sizes: Integers | None = None, null: float = 0.0) -> Interval:
    """Return all δ = Σ score / Σ size that the sign-flip test of score - δ · size does not reject at 5 %.

    Parameters
    ----------
    scores : array of int, (n,)
        Differences of n people; or how often each of them chose something.
    sizes : array of int, (n,), optional
        Of how many answers, at least 1; without it 1, so that the ratio is the mean difference.
    null : float
        δ of "no difference", a multiple of one half.

    Returns
    -------
    (float, float)
        Both ends belong to it; infinite with fewer than 6 people, of whom the test rejects nothing. Exact up
        to 53 people, then to 13 digits of p. Beyond `MOST_WORK` (some 500 ratings) the sums of subsets count
        as normal, which changes p by less than 0.01; which side the null is on is exact there too.

    >>> sign_flip_interval(np.array([1, 2, 3, 4, 5, 6]))  # of 64 choices the least reaches p = 2 / 64
    (1.0, 6.0)
    >>> sign_flip_interval(np.array([1, 2, 3, 4, 5]))
    (-inf, inf)
    """
    each = np.ones_like(scores) if sizes is None else sizes
    if 2.0 ** (1 - scores.size) > ALPHA:
        return -math.inf, math.inf
    work = float(scores.size) * (each.sum() + 1.0) * (np.abs(scores).sum() + 1.0)
    if scores.size > LISTED and (work > MOST_WORK or scores.size > MOST_PEOPLE):
        test = sign_flip_test(2 * scores - round(2 * null) * each)
        return _agreeing(_normal_interval(scores, each), test, null)
    ratios, chances = _subset_ratios(scores, each)
    order = np.argsort(ratios)
    least = _typical_value(ratios[order], chances[order], scores.size)
    most = -_typical_value(-ratios[order[::-1]], chances[order[::-1]], scores.size)
    return least, most


def _subset_ratios(scores: Integers, sizes: Integers) -> tuple[Array, Array]:
    """Return the ratios Σ score / Σ size of all subsets but the empty one, and how likely each is."""
    if scores.size <= LISTED:
        sums, totals = np.zeros(1, np.int64), np.zeros(1, np.int64)
        for score, size in zip(scores, sizes, strict=True):
            sums, totals = np.append(sums, sums + score), np.append(totals, totals + size)
        return sums[1:] / totals[1:], np.full(sums.size - 1, 0.5**scores.size)
    counts, lowest = subset_counts(scores, sizes)
    total, above = np.nonzero(counts)
    some = total > 0
    ratios = (lowest + above[some]) / total[some]
    return ratios, np.ldexp(counts[total[some], above[some]], -scores.size)


def _typical_value(ratios: Array, chances: Array, n: int) -> float:
    """Return the least of ascending ratios of subsets that is not rejected; the empty subset counts."""
    p_values = 2 * (math.ldexp(1.0, -n) + np.cumsum(chances))
    return float(ratios[np.searchsorted(p_values, ALPHA, side="right")])


def _normal_interval(scores: Integers, sizes: Integers) -> Interval:
    """Return the δ with |Σ (score - δ size)| = 1.96 √Σ (score - δ size)²: roots of a quadratic equation."""
    d, w = scores.astype(np.float64), sizes.astype(np.float64)
    a = w.sum() ** 2 - NORMAL**2 * float(w @ w)
    if a <= 0:  # nearly all answers are of three people or fewer
        return -math.inf, math.inf
    b = d.sum() * w.sum() - NORMAL**2 * float(d @ w)
    c = d.sum() ** 2 - NORMAL**2 * float(d @ d)
    root = math.sqrt(max(b * b - a * c, 0.0))
    return (b - root) / a, (b + root) / a


def _agreeing(ends: Interval, test: ExactTest, null: float) -> Interval:
    """Return an interval that lies beside a value that a test rejects, and else holds it."""
    low, high = ends
    if test.p_value >= ALPHA:
        return min(low, null), max(high, null)
    if test.statistic > 0:
        return max(low, math.nextafter(null, math.inf)), high
    return low, min(high, math.nextafter(null, -math.inf))


def shared_interval(one: int, other: int, n: int) -> Interval:
    """Return the interval of (one - other) / n that agrees with the sign test, given how many pairs differ.

    That of Clopper and Pearson for the share of either sign among those.

    >>> low, high = shared_interval(5, 0, 17)  # p = 2 / 32
    >>> low < 0 < high, shared_interval(6, 0, 17)[0] > 0  # p = 2 / 64
    (True, True)
    """
    low, high = clopper_pearson(one, one + other)
    return (one + other) / n * (2 * low - 1), (one + other) / n * (2 * high - 1)


def joined(exact: Interval, other: Interval, null: float = 0.0) -> Interval:
    """Return an interval that holds two others, but crosses "no difference" only where the exact one does.

    Where the other one alone would reach across, the exact end stays: which side the truth lies on is what
    the exact test has decided.

    >>> joined((0.1, 0.5), (0.0, 0.6)), joined((-0.1, 0.5), (0.1, 0.6))
    ((0.1, 0.6), (-0.1, 0.6))
    """
    low = exact[0] if other[0] <= null < exact[0] else min(exact[0], other[0])
    high = exact[1] if exact[1] < null <= other[1] else max(exact[1], other[1])
    return low, high

"""What n answers to a question with two choices can show: power of the exact tests, and how often they err.

Sums over all outcomes k = 0 to n, weighted by their probability: exact, without simulation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, stats

from evenlight.analysis.inference.binomial_tests import (
    ALPHA,
    HALF,
    clopper_pearson,
    mid_p_interval,
    smallest_margin,
)
from evenlight.data_schema.arrays import Array

MOST_ANSWERS = 10000  # a plan that needs more is no plan


def difference_power(answers: ArrayLike, share: ArrayLike, alpha: float = ALPHA) -> Array:
    """Return how often the two-sided exact test finds a share other than 1/2.

    With share = 1/2 this is the type I error, at most alpha.

    Parameters
    ----------
    answers : array_like of int
        n.
    share : array_like
        True share p; broadcasts with `answers`.
    alpha : float
        Level of the test.

    >>> difference_power([5, 6], 0.5).tolist()  # 2 / 2^5 > 5 %: no outcome counts; 2 / 2^6
    [0.0, 0.03125]
    """
    n, p = np.asarray(answers), np.asarray(share, dtype=np.float64)
    few = lower_critical(n, alpha)
    # Whichever the share, as many as n - few or more count as well.
    return np.asarray(stats.binom.cdf(few, n, p) + stats.binom.sf(n - few - 1, n, p))


def lower_critical(answers: ArrayLike, alpha: float = ALPHA) -> NDArray[np.int64]:
    """Return the most answers that the two-sided exact test still calls too few; -1 if none.

    >>> lower_critical([5, 6, 17]).tolist()
    [-1, 0, 4]
    """
    n = np.asarray(answers)
    k = stats.binom.ppf(alpha / 2, n, HALF)
    return np.asarray(np.where(stats.binom.cdf(k, n, HALF) <= alpha / 2, k, k - 1), dtype=np.int64)


def equivalence_power(answers: ArrayLike, share: ArrayLike, margin: float, alpha: float = ALPHA) -> Array:
    """Return how often the exact equivalence test finds a share within a margin about 1/2.

    With share = 1/2 + margin this is its type I error, at most alpha.

    >>> round(float(equivalence_power(17, 0.5, 0.15)), 9)  # no outcome of 17 shows equivalence within 0.15
    0.0
    """
    n, p = np.asarray(answers), np.asarray(share, dtype=np.float64)
    fewest = stats.binom.isf(alpha, n, HALF - margin) + 1  # P(X >= fewest | 1/2 - margin) <= alpha
    within = stats.binom.cdf(n - fewest, n, p) - stats.binom.cdf(fewest - 1, n, p)
    return np.asarray(np.where(fewest <= n - fewest, within, 0.0))


def smallest_share_found(answers: int, power: float, alpha: float = ALPHA) -> float | None:
    """Return the smallest share above 1/2 that the exact test finds with a power; None if it finds none.

    >>> smallest_share_found(5, 0.8) is None
    True
    """
    if lower_critical(answers, alpha) < 0:
        return None
    found = optimize.brentq(
        lambda p: float(difference_power(answers, p, alpha)) - power, HALF, 1.0, xtol=1e-12
    )
    return float(found)


def smallest_margin_ever(answers: int, alpha: float = ALPHA) -> float:
    """Return the smallest margin about 1/2 that so many answers could show: of those divided most evenly.

    >>> round(smallest_margin_ever(17), 4)  # of 9 of 17 the 90 % interval ends at 0.7399
    0.2399
    """
    return smallest_margin(answers // 2, answers, alpha)


def margin_shown(answers: int, power: float, alpha: float = ALPHA) -> float:
    """Return the smallest margin within which so many answers show a true share of 1/2 with a power.

    Outcomes from some k to n - k are found equivalent: the largest k that leaves them the power. 1/2 if none
    does.

    >>> n = 100
    >>> margin = margin_shown(n, 0.8)
    >>> [float(equivalence_power(n, 0.5, margin + e)) >= 0.8 for e in (-1e-6, 1e-6)]
    [False, True]
    """
    fewest = np.arange(1, answers // 2 + 1)
    within = stats.binom.cdf(answers - fewest, answers, HALF) - stats.binom.cdf(fewest - 1, answers, HALF)
    enough = fewest[within >= power]
    return smallest_margin(int(enough[-1]), answers, alpha) if enough.size else HALF


def answers_to_find(share: float, power: float, alpha: float = ALPHA) -> int | None:
    """Return how many answers find a share with a power, and with every greater number too.

    The power of an exact test rises in jumps and falls between them. None if more than 10 000 are needed.

    >>> n = answers_to_find(0.7, 0.8)
    >>> float(difference_power(n, 0.7)) >= 0.8 > float(difference_power(n - 1, 0.7))
    True
    """
    return _from_here_on(difference_power(_NUMBERS, share, alpha) >= power)


def answers_for_equivalence(
    margin: float, power: float, share: float = HALF, alpha: float = ALPHA
) -> int | None:
    """Return how many answers show a share within a margin with a power, and every greater number too."""
    return _from_here_on(equivalence_power(_NUMBERS, share, margin, alpha) >= power)


_NUMBERS = np.arange(1, MOST_ANSWERS + 1)


def _from_here_on(enough: NDArray[np.bool_]) -> int | None:
    """Return the first number from which on all suffice."""
    if not enough[-1]:
        return None
    lacking = np.flatnonzero(~enough)
    return int(_NUMBERS[lacking[-1] + 1]) if lacking.size else 1


def interval_coverage(answers: int, shares: ArrayLike, mid_p: bool) -> Array:
    """Return how often the 95 % confidence interval holds each true share, (shares,).

    Parameters
    ----------
    answers, shares : int, array_like, (shares,)
        n, and true shares.
    mid_p : bool
        Of the mid-p interval; else of Clopper and Pearson's.
    """
    p = np.asarray(shares, dtype=np.float64)
    interval = mid_p_interval if mid_p else clopper_pearson
    ends = np.array([interval(k, answers) for k in range(answers + 1)])
    holds = (ends[:, :1] <= p) & (p <= ends[:, 1:])
    outcomes = stats.binom.pmf(np.arange(answers + 1)[:, None], answers, p)
    return np.asarray((outcomes * holds).sum(axis=0))

"""Answers to a question with two choices: exact tests against one half, intervals, equivalence; their power.

Everything is a sum over outcomes k = 0 to n, weighted by their binomial probability: exact, not simulated.
Trials of the same people go together: the interval of their share is by people.
"""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array, Integers, Mask

HALF = 0.5  # the share of people who guess
DEFAULT_MARGIN = 0.15  # a share from 0.35 to 0.65 counts as a coin's: a choice, said with every result
LEVEL = 0.95  # of confidence intervals
ALPHA = 0.05  # of tests
MOST_ANSWERS = 10000  # a plan that needs more is no plan
PSEUDO_PERSON = 0.02  # by coverage: docs/decisions/inference-levels.md
Interval = tuple[float, float]


def exact_p(chosen: int, answers: int) -> float:
    """Return the two-sided p of the exact test of p = 1/2.

    The distribution is symmetric there, so that doubling the smaller tail and adding up all that is as
    unlikely come to the same.

    >>> exact_p(0, 5)  # 2 / 2^5
    0.0625
    """
    return float(scipy.stats.binomtest(chosen, answers, HALF).pvalue)


def clopper_pearson(chosen: float, answers: float, level: float = LEVEL) -> Interval:
    """Return the interval of Clopper and Pearson (1934): all p that neither one-sided exact test rejects.

    With an effective number of answers neither number need be whole.

    >>> low, high = clopper_pearson(0, 1)
    >>> low, round(high, 9)  # 1 - high = 2.5 %
    (0.0, 0.975)
    """
    tail = (1 - level) / 2
    low = scipy.special.betaincinv(chosen, answers - chosen + 1, tail) if chosen else 0.0
    high = scipy.special.betaincinv(chosen + 1, answers - chosen, 1 - tail) if chosen < answers else 1.0
    return float(low), float(high)


def mid_p_interval(chosen: int, answers: int) -> Interval:
    """Return the mid-p interval (Lancaster 1961): only half of P(X = k) counts to the tails.

    Its coverage lies about the nominal one instead of above it.

    >>> low, high = mid_p_interval(0, 1)
    >>> low, round(high, 9)  # (1 - high) / 2 = 2.5 %
    (0.0, 0.95)
    """
    tail, k, n = (1 - LEVEL) / 2, chosen, answers

    def below(p: float) -> float:
        """P(X < k) + P(X = k) / 2, which falls from 1 to 0 as p rises: the mean of P(X < k) and P(X <= k)."""
        fewer = scipy.special.betaincc(k, n - k + 1, p) if k else 0.0
        at_most = scipy.special.betaincc(k + 1, n - k, p) if k < n else 1.0
        return float(fewer + at_most) / 2

    low = scipy.optimize.brentq(lambda p: below(p) - (1 - tail), 0.0, 1.0, xtol=1e-13) if k else 0.0
    high = scipy.optimize.brentq(lambda p: below(p) - tail, 0.0, 1.0, xtol=1e-13) if k < n else 1.0
    return float(low), float(high)


def equivalence_p(chosen: int, answers: int, margin: float) -> float:
    """Return the p of the exact test that the share lies within a margin about 1/2 (Schuirmann 1987).

    The larger of those of two one-sided exact tests: of p <= 1/2 - margin and of p >= 1/2 + margin.

    >>> round(equivalence_p(1, 2, 0.25), 9)  # P(X >= 1 | 1/4) = P(X <= 1 | 3/4) = 7/16
    0.4375
    """
    above_low = scipy.stats.binom.sf(chosen - 1, answers, HALF - margin)
    below_high = scipy.stats.binom.cdf(chosen, answers, HALF + margin)
    return float(max(above_low, below_high))


def smallest_margin(chosen: int, answers: int) -> float:
    """Return the margin above which the equivalence test finds k of n equivalent to 1/2.

    That of the interval of Clopper and Pearson with level 90 %: its farther end. A half means that no
    margin does.

    >>> round(smallest_margin(1, 1), 9), round(smallest_margin(0, 1), 9)
    (0.5, 0.5)
    """
    low, high = clopper_pearson(chosen, answers, 1 - 2 * ALPHA)
    return max(HALF - low, high - HALF)


def bayes_factor(chosen: int, answers: int) -> float:
    """Return the Bayes factor for p = 1/2 against p uniform on [0, 1]: (n + 1) C(n, k) / 2^n.

    >>> bayes_factor(1, 2)  # 3 · 2 / 4
    1.5
    """
    return float((answers + 1) * math.comb(answers, chosen) / 2**answers)  # whole numbers: exact for any n


def posterior_within(chosen: int, answers: int, margin: float) -> float:
    """Return the probability that the share lies within a margin about 1/2, from a uniform prior.

    The posterior is Beta(k + 1, n - k + 1).

    >>> round(posterior_within(0, 0, 0.15), 9)
    0.3
    """
    a, b = chosen + 1, answers - chosen + 1
    return float(scipy.special.betainc(a, b, HALF + margin) - scipy.special.betainc(a, b, HALF - margin))


def bayes_factor_within(chosen: int, answers: int, margin: float) -> float:
    """Return the Bayes factor for a share within a margin about 1/2 against one outside, uniform in each.

    Odds after the answers over odds before, 2 margin to 1 - 2 margin (Morey & Rouder 2011).

    >>> round(bayes_factor_within(0, 0, 0.15), 9)
    1.0
    """
    a, b = chosen + 1, answers - chosen + 1
    outside = scipy.special.betainc(a, b, HALF - margin) + scipy.special.betaincc(a, b, HALF + margin)
    odds = posterior_within(chosen, answers, margin) / max(float(outside), np.finfo(float).tiny)
    return float(odds * (1 - 2 * margin) / (2 * margin))


def clustered_interval(successes: Integers, trials: Integers) -> Interval:
    """Return the 95 % interval of a share of the trials of some people: those of one person go together.

    That of Clopper and Pearson at the effective number of trials. Where all trials have the same outcome
    nothing tells how alike those of a person are: each person counts as one trial. That is the worst case, as
    "nobody ever" is never likelier than (1 - p)^people.
    Coverage: docs/decisions/inference-levels.md.

    Parameters
    ----------
    successes, trials : array of int, (people,)
        How often each of at least two people had success, of how many trials (at least 1).

    >>> round(clustered_interval(np.array([0, 0]), np.array([21, 21]))[1], 3)  # (1 - p)^2 = 2.5 %
    0.842
    """
    count, n = int(successes.sum()), int(trials.sum())
    effective = trials.size if count in (0, n) else _effective_number(successes, trials)
    return clopper_pearson(count / n * effective, effective)


def _effective_number(successes: Integers, trials: Integers) -> float:
    """Return how many independent trials would tell a share as well as those of at least two people.

    Their number is divided by how much more the people's counts scatter than counts of a coin would, and
    reduced for the few people that tell it (Korn & Graubard 1998). Few people, or few with the rarer outcome,
    can be alike by chance. Hence two pseudo people among them, each a fiftieth of a person: one with
    successes alone, one without any.
    """
    people, n = trials.size, int(trials.sum())
    pseudo = PSEUDO_PERSON * n / people  # trials of either pseudo person
    share = (float(successes.sum()) + pseudo) / (n + 2 * pseudo)
    excess = successes - share * trials
    squares = float(excess @ excess) + pseudo * n / people * ((1 - share) ** 2 + share**2)
    weight = people + 2 * PSEUDO_PERSON
    variance = weight / (weight - 1) * squares / (n + 2 * pseudo) ** 2
    fewer = scipy.special.stdtrit(n - 1, 0.975) / scipy.special.stdtrit(people - 1, 0.975)
    return float(min(share * (1 - share) / variance * fewer**2, n))


# --- what n answers can show, and how often tests and intervals err ---


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
    return np.asarray(scipy.stats.binom.cdf(few, n, p) + scipy.stats.binom.sf(n - few - 1, n, p))


def lower_critical(answers: ArrayLike, alpha: float = ALPHA) -> Integers:
    """Return the most answers that the two-sided exact test still calls too few; -1 if none.

    >>> lower_critical([5, 6, 17]).tolist()
    [-1, 0, 4]
    """
    n = np.asarray(answers)
    k = scipy.stats.binom.ppf(alpha / 2, n, HALF)
    return np.asarray(np.where(scipy.stats.binom.cdf(k, n, HALF) <= alpha / 2, k, k - 1), dtype=np.int64)


def equivalence_power(answers: ArrayLike, share: ArrayLike, margin: float) -> Array:
    """Return how often the exact equivalence test finds a share within a margin about 1/2.

    With share = 1/2 + margin this is its type I error, at most 5 %.

    >>> round(float(equivalence_power(17, 0.5, 0.15)), 9)  # no outcome of 17 shows equivalence within 0.15
    0.0
    """
    n, p = np.asarray(answers), np.asarray(share, dtype=np.float64)
    fewest = scipy.stats.binom.isf(ALPHA, n, HALF - margin) + 1  # P(X >= fewest | 1/2 - margin) <= 5 %
    within = scipy.stats.binom.cdf(n - fewest, n, p) - scipy.stats.binom.cdf(fewest - 1, n, p)
    return np.asarray(np.where(fewest <= n - fewest, within, 0.0))


def smallest_share_found(answers: int, power: float) -> float | None:
    """Return the smallest share above 1/2 that the exact test finds with a power; None if it finds none.

    >>> smallest_share_found(5, 0.8) is None
    True
    """
    if lower_critical(answers) < 0:
        return None
    found = scipy.optimize.brentq(
        lambda p: float(difference_power(answers, p)) - power, HALF, 1.0, xtol=1e-12
    )
    return float(found)


def smallest_margin_ever(answers: int) -> float:
    """Return the smallest margin about 1/2 that so many answers could show: of those divided most evenly.

    >>> round(smallest_margin_ever(17), 4)  # of 9 of 17 the 90 % interval ends at 0.7399
    0.2399
    """
    return smallest_margin(answers // 2, answers)


def margin_shown(answers: int, power: float) -> float:
    """Return the smallest margin within which so many answers show a true share of 1/2 with a power.

    Outcomes from some k to n - k are found equivalent: the largest k that leaves them the power. 1/2 if none
    does.

    >>> n = 100
    >>> margin = margin_shown(n, 0.8)
    >>> [float(equivalence_power(n, 0.5, margin + e)) >= 0.8 for e in (-1e-6, 1e-6)]
    [False, True]
    """
    fewest = np.arange(1, answers // 2 + 1)
    within = scipy.stats.binom.cdf(answers - fewest, answers, HALF) - scipy.stats.binom.cdf(
        fewest - 1, answers, HALF
    )
    enough = fewest[within >= power]
    return smallest_margin(int(enough[-1]), answers) if enough.size else HALF


def answers_to_find(share: float, power: float) -> int | None:
    """Return how many answers find a share with a power, and with every greater number too.

    The power of an exact test rises in jumps and falls between them. None if more than 10 000 are needed.

    >>> n = answers_to_find(0.7, 0.8)
    >>> float(difference_power(n, 0.7)) >= 0.8 > float(difference_power(n - 1, 0.7))
    True
    """
    return _from_here_on(difference_power(_NUMBERS, share) >= power)


def answers_for_equivalence(margin: float, power: float) -> int | None:
    """Return how many answers show 1/2 within a margin with a power, and every greater number too."""
    return _from_here_on(equivalence_power(_NUMBERS, HALF, margin) >= power)


_NUMBERS = np.arange(1, MOST_ANSWERS + 1)


def _from_here_on(enough: Mask) -> int | None:
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
    outcomes = scipy.stats.binom.pmf(np.arange(answers + 1)[:, None], answers, p)
    return np.asarray((outcomes * holds).sum(axis=0))

"""Counts of answers to a question with two choices: exact tests against one half, intervals, equivalence.

Everything is a finite sum of binomial probabilities; nothing is approximated. How often a test or an interval
errs, and what it can find, is in `binomial_power.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special, stats

HALF = 0.5  # the share of people who guess
DEFAULT_MARGIN = 0.15  # a share from 0.35 to 0.65 counts as a coin's: a choice, said with every result
LEVEL = 0.95  # of confidence intervals
ALPHA = 0.05  # of tests
Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BinomialInference:
    """What k of n independent answers say about the share p of such answers.

    Attributes
    ----------
    chosen, answers : int
        k and n.
    clopper_pearson : (float, float)
        95 % confidence interval that holds p at least so often, whatever p is.
    mid_p : (float, float)
        95 % confidence interval that does so on average.
    p_value : float
        Of the two-sided exact test of p = 1/2.
    margin : float
        Distance from 1/2 within which p counts as equivalent to it.
    equivalence_p : float
        Of the exact test that p lies within the margin (two one-sided tests).
    smallest_margin : float
        Below which the same test does not find equivalence at 5 %.
    bayes_factor : float
        Odds for p = 1/2 against p anywhere (uniform), as the answers change them; above 1 for 1/2.
    bayes_factor_within : float
        The same for p within the margin against p outside of it, both uniform.
    posterior_within : float
        Probability that p lies within the margin, from a uniform prior.
    """

    chosen: int
    answers: int
    clopper_pearson: Interval
    mid_p: Interval
    p_value: float
    margin: float
    equivalence_p: float
    smallest_margin: float
    bayes_factor: float
    bayes_factor_within: float
    posterior_within: float

    @property
    def share(self) -> float:
        """Of k among n."""
        return self.chosen / self.answers


def infer_share(chosen: int, answers: int, margin: float) -> BinomialInference:
    """Return what k of n independent answers say about the share of such answers.

    Parameters
    ----------
    chosen, answers : int
        k and n, n at least 1.
    margin : float
        Within which the share counts as equivalent to 1/2, in (0, 1/2).

    >>> found = infer_share(9, 17, 0.15)
    >>> found.p_value
    1.0
    >>> round(found.bayes_factor, 3)  # 18 · 24310 / 2^17
    3.338
    """
    return BinomialInference(
        chosen=chosen,
        answers=answers,
        clopper_pearson=clopper_pearson(chosen, answers),
        mid_p=mid_p_interval(chosen, answers),
        p_value=exact_p(chosen, answers),
        margin=margin,
        equivalence_p=equivalence_p(chosen, answers, margin),
        smallest_margin=smallest_margin(chosen, answers),
        bayes_factor=bayes_factor(chosen, answers),
        bayes_factor_within=bayes_factor_within(chosen, answers, margin),
        posterior_within=posterior_within(chosen, answers, margin),
    )


def exact_p(chosen: int, answers: int) -> float:
    """Return the two-sided p of the exact test of p = 1/2.

    The distribution is symmetric there, so that doubling the smaller tail and adding up all that is as
    unlikely come to the same.

    >>> exact_p(0, 5)  # 2 / 2^5
    0.0625
    """
    return float(stats.binomtest(chosen, answers, HALF).pvalue)


def clopper_pearson(chosen: float, answers: float, level: float = LEVEL) -> Interval:
    """Return the interval of Clopper and Pearson (1934): all p that neither one-sided exact test rejects.

    With an effective number of answers neither number need be whole.

    >>> low, high = clopper_pearson(0, 1)
    >>> low, round(high, 9)  # 1 - high = 2.5 %
    (0.0, 0.975)
    """
    tail = (1 - level) / 2
    low = special.betaincinv(chosen, answers - chosen + 1, tail) if chosen else 0.0
    high = special.betaincinv(chosen + 1, answers - chosen, 1 - tail) if chosen < answers else 1.0
    return float(low), float(high)


def mid_p_interval(chosen: int, answers: int, level: float = LEVEL) -> Interval:
    """Return the mid-p interval (Lancaster 1961): only half of P(X = k) counts to the tails.

    Its coverage lies about the nominal one instead of above it.

    >>> low, high = mid_p_interval(0, 1)
    >>> low, round(high, 9)  # (1 - high) / 2 = 2.5 %
    (0.0, 0.95)
    """
    tail = (1 - level) / 2
    k, n = chosen, answers

    def below(p: float) -> float:
        """P(X < k) + P(X = k) / 2, which falls from 1 to 0 as p rises: the mean of P(X < k) and P(X <= k)."""
        fewer = special.betaincc(k, n - k + 1, p) if k else 0.0
        at_most = special.betaincc(k + 1, n - k, p) if k < n else 1.0
        return float(fewer + at_most) / 2

    low = optimize.brentq(lambda p: below(p) - (1 - tail), 0.0, 1.0, xtol=1e-13) if k else 0.0
    high = optimize.brentq(lambda p: below(p) - tail, 0.0, 1.0, xtol=1e-13) if k < n else 1.0
    return float(low), float(high)


def equivalence_p(chosen: int, answers: int, margin: float) -> float:
    """Return the p of the exact test that the share lies within a margin about 1/2 (Schuirmann 1987).

    The larger of those of two one-sided exact tests: of p <= 1/2 - margin and of p >= 1/2 + margin.

    >>> round(equivalence_p(1, 2, 0.25), 9)  # P(X >= 1 | 1/4) = P(X <= 1 | 3/4) = 7/16
    0.4375
    """
    above_low = stats.binom.sf(chosen - 1, answers, HALF - margin)
    below_high = stats.binom.cdf(chosen, answers, HALF + margin)
    return float(max(above_low, below_high))


def smallest_margin(chosen: int, answers: int, alpha: float = ALPHA) -> float:
    """Return the margin above which the equivalence test finds k of n equivalent to 1/2.

    That of the interval of Clopper and Pearson with level 1 - 2 alpha: its farther end. A half means that no
    margin does.

    >>> round(smallest_margin(1, 1), 9), round(smallest_margin(0, 1), 9)
    (0.5, 0.5)
    """
    low, high = clopper_pearson(chosen, answers, 1 - 2 * alpha)
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
    return float(special.betainc(a, b, HALF + margin) - special.betainc(a, b, HALF - margin))


def bayes_factor_within(chosen: int, answers: int, margin: float) -> float:
    """Return the Bayes factor for a share within a margin about 1/2 against one outside, uniform in each.

    Odds after the answers over odds before, 2 margin to 1 - 2 margin (Morey & Rouder 2011).

    >>> round(bayes_factor_within(0, 0, 0.15), 9)
    1.0
    """
    a, b = chosen + 1, answers - chosen + 1
    outside = special.betainc(a, b, HALF - margin) + special.betaincc(a, b, HALF + margin)
    odds = posterior_within(chosen, answers, margin) / max(float(outside), np.finfo(float).tiny)
    return float(odds * (1 - 2 * margin) / (2 * margin))

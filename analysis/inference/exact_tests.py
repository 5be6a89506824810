"""Exact tests by permutation: of paired differences, and of two groups.

Of paired differences each is under "no difference" as likely to have the other sign. That holds whatever
their distribution, if it is symmetric about 0, as it is where two versions that look alike were shown in
random order. Tied, discrete ratings are therefore no problem, and nothing is simulated: given how large the
differences are, all 2^n choices of signs are enumerated (Fisher 1935). All tests are two-sided: p is the
share of choices of signs with at least the |statistic| that was found.

Of n whole numbers there are 2^n subsets, but their sums take few values. Taking the numbers one after the
other, each sum is reached with the number or without it (Pagano & Tritchler 1983): the work grows with the
square of n, and 200 pairs are no more trouble than 17.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array, Integers

MOST_CELLS = 4_000_000  # of a table of probabilities held at once: 32 MB


class ZeroHandling(enum.Enum):
    """What becomes of pairs without a difference in the signed-rank test; they have no sign either way."""

    PRATT = "pratt"  # ranked with the others, then without a sign (Pratt 1959)
    DROPPED = "dropped"  # left out before ranking (Wilcoxon 1945)


@dataclass(frozen=True, slots=True)
class ExactTest:
    """What an exact test of paired differences found.

    Attributes
    ----------
    statistic : float
        Sum of the differences, of their signed ranks, or of their signs.
    p_value : float
        Two-sided; 1 where no pair differs.
    n, n_different : int
        Pairs, and those with a difference: the others cannot speak for either side.
    """

    statistic: float
    p_value: float
    n: int
    n_different: int

    @property
    def smallest_p(self) -> float:
        """The smallest p that so many pairs with a difference can give, all of one sign.

        >>> ExactTest(statistic=3, p_value=0.5, n=17, n_different=5).smallest_p
        0.0625
        """
        return min(1.0, 2.0 ** (1 - self.n_different))


def sign_flip_test(differences: ArrayLike, mid_p: bool = False) -> ExactTest:
    """Test whether the mean difference is 0, by all choices of signs (Fisher 1935).

    Parameters
    ----------
    differences : array_like of int, (n,)
        Whole numbers: means of several ratings are to be multiplied by their common denominator.
    mid_p : bool
        Whether choices that are as extreme as what was found count one half (Lancaster 1961). That is not
        exact, but closer to the nominal level where ties leave few values of p.

    >>> sign_flip_test([3, 1, 1]).p_value  # of 8 choices, only those with three equal signs reach 5
    0.25
    """
    scores = _whole(differences)
    return _found(scores, np.abs(scores), float(scores.sum()), mid_p)


def signed_rank_test(differences: ArrayLike, zeros: ZeroHandling = ZeroHandling.PRATT) -> ExactTest:
    """Test whether the differences lie about 0, by Wilcoxon's signed ranks; ties have their mean rank.

    Parameters
    ----------
    differences : array_like of int, (n,)
        Whole numbers.
    zeros : ZeroHandling
        What becomes of pairs without a difference.

    >>> dropped = signed_rank_test([0, 2, 2, 5], ZeroHandling.DROPPED)
    >>> signed_rank_test([0, 2, 2, 5]).statistic, dropped.statistic
    (9.0, 6.0)
    """
    scores = _whole(differences)
    ranked = scores if zeros is ZeroHandling.PRATT else scores[scores != 0]
    twice_ranks = np.rint(2 * scipy.stats.rankdata(np.abs(ranked))).astype(np.int64)  # midranks are halves
    twice_ranks = np.where(ranked != 0, twice_ranks, 0)
    statistic = float(np.sum(np.sign(ranked) * twice_ranks)) / 2
    found = _found(ranked, twice_ranks, statistic)
    return ExactTest(found.statistic, found.p_value, scores.size, found.n_different)


def sign_test(differences: ArrayLike) -> ExactTest:
    """Test whether more pairs differ in one direction than in the other; pairs without a difference drop out.

    >>> sign_test([4, 1, 1, 0]).p_value  # three of three heads: 2 / 8
    0.25
    """
    scores = _whole(differences)
    signs = np.sign(scores)
    return _found(scores, np.abs(signs), float(signs.sum()))


def sign_flip_p_values(differences: ArrayLike, mid_p: bool = False) -> Array:
    """Return the p values of `sign_flip_test` for many sets of differences at once.

    Parameters
    ----------
    differences : array_like of int, (rows, n)
        Whole numbers, one set per row.
    mid_p : bool
        As in `sign_flip_test`.

    Returns
    -------
    array, (rows,)
        Two-sided.
    """
    scores = _whole(differences)
    # What is enumerated depends on the sizes alone: each set of sizes once, whatever order they come in.
    sizes, place = np.unique(np.sort(np.abs(scores), axis=1), axis=0, return_inverse=True)
    place = place.reshape(-1)
    p_values = np.empty(len(scores))
    totals = np.abs(scores.sum(axis=1))
    step = max(1, MOST_CELLS // (int(sizes.sum(axis=1).max(initial=0)) + 1))
    for start in range(0, len(sizes), step):
        part = sizes[start : start + step]
        own = np.flatnonzero((place >= start) & (place < start + step))
        tails = _tails(part, mid_p)
        p_values[own] = tails[place[own] - start, totals[own]]
    return p_values


def _whole(differences: ArrayLike) -> Integers:
    """Refuse what is no lattice: the enumeration needs one."""
    values = np.asarray(differences, dtype=np.float64)
    if not values.size:
        raise ValueError("an exact paired test needs at least one difference, got none")
    if not np.all(values == np.rint(values)):
        raise ValueError(
            "the differences of an exact test must be whole numbers; multiply means by their denominator"
        )
    return values.astype(np.int64)


def _found(scores: Integers, weights: Integers, statistic: float, mid_p: bool = False) -> ExactTest:
    total = abs(int(np.sum(np.sign(scores) * weights)))
    p_value = float(_tails(weights[None, :], mid_p)[0, total])
    return ExactTest(statistic, p_value, scores.size, int(np.count_nonzero(scores)))


def _tails(weights: Integers, mid_p: bool) -> Array:
    """Return P(|T| >= t) for t = 0, 1, ... of T = Σ ± weight, for each row; with `mid_p` ½ P(|T| = t) less.

    The mid-p of t = 0 is 1, twice the one-sided one. T is twice the sum S of the weights with a plus, less
    their total: |T| = |2 S - total|.
    """
    probabilities = _subset_sums(weights)
    rows, width = probabilities.shape
    totals = weights.sum(axis=1)
    size = np.abs(2 * np.arange(width) - totals[:, None])
    row = np.broadcast_to(np.arange(rows)[:, None], size.shape)
    # Sums above a row's own total have probability 0, but may have a |T| beyond the table.
    inside = np.arange(width) <= totals[:, None]
    exactly: Array = np.zeros((rows, width))
    np.add.at(exactly, (row[inside], size[inside]), probabilities[inside])
    at_least = np.cumsum(exactly[:, ::-1], axis=1)[:, ::-1]
    if mid_p:
        at_least[:, 1:] -= 0.5 * exactly[:, 1:]
    return np.minimum(at_least, 1.0)


def _subset_sums(weights: Integers) -> Array:
    """Return the distribution of the sum of a random subset, each member in it with probability one half.

    Of each row of weights (rows, n), at least 0: (rows, largest total + 1). All terms are positive and halved
    exactly, so that the relative error stays below n rounding errors.
    """
    rows = weights.shape[0]
    sums = np.arange(int(weights.sum(axis=1).max(initial=0)) + 1)
    probabilities = np.zeros((rows, sums.size))
    probabilities[:, 0] = 1.0
    for weight in weights.T:
        without = sums - weight[:, None]  # the sum before this weight came in
        reached = np.take_along_axis(probabilities, np.maximum(without, 0), axis=1)
        probabilities = 0.5 * (probabilities + np.where(without >= 0, reached, 0.0))
    return probabilities


def subset_counts(scores: Integers, sizes: Integers | None = None) -> tuple[Array, int]:
    """Return how many subsets of some whole numbers have each size and sum.

    Parameters
    ----------
    scores : array of int, (n,)
        Of either sign.
    sizes : array of int, (n,), optional
        What each adds to the size of a subset, at least 1; without it 1.

    Returns
    -------
    array, (total size + 1, sums)
        Number of subsets by size and by sum; exact up to 2^53, then to 16 digits.
    int
        The sum of the first column: that of all scores below 0.

    >>> counts, lowest = subset_counts(np.array([-1, 2]))
    >>> lowest, counts.tolist()  # rows: sizes 0, 1, 2; columns: sums -1, 0, 1, 2
    (-1, [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    """
    lowest, highest = int(scores[scores < 0].sum()), int(scores[scores > 0].sum())
    each = np.ones_like(scores) if sizes is None else sizes
    counts = np.zeros((int(each.sum()) + 1, highest - lowest + 1))
    counts[0, -lowest] = 1.0
    for score, size in zip(scores, each, strict=True):
        # Nothing is rolled over the edge: the columns reach from the sum of all scores below 0 to that of all
        # above, and hold every sum on the way.
        counts[size:] += np.roll(counts[:-size], int(score), axis=1)
    return counts, lowest


def group_p_value(first: ArrayLike, second: ArrayLike) -> float:
    """Return p of the same mean in two groups, by all ways to divide everybody into two such groups.

    Two-sided: p is the share of divisions with at least the |difference of means| that was found (Fisher
    1935; Pagano & Tritchler 1983). The sum of one group says all, as that of both is given.

    Parameters
    ----------
    first, second : array_like of int, (n1,) and (n2,)
        Whole numbers; at least one in each.

    >>> group_p_value([2, 3], [0, 1])  # of six divisions, this one and its mirror image
    0.3333333333333333
    """
    groups = [np.asarray(group, dtype=np.float64) for group in (first, second)]
    if not all(group.size and np.all(group == np.rint(group)) for group in groups):
        raise ValueError("both groups of an exact test need whole numbers, at least one each")
    one, other = (group.astype(np.int64) for group in groups)
    everybody = np.concatenate([one, other])
    counts, lowest = subset_counts(everybody)
    ways = counts[one.size]
    sums = lowest + np.arange(ways.size)
    # The difference of means goes with n · S less what S is on average, n1 times the sum of all.
    distance = np.abs(everybody.size * sums - one.size * int(everybody.sum()))
    found = abs(everybody.size * int(one.sum()) - one.size * int(everybody.sum()))
    return min(float(ways[distance >= found].sum() / ways.sum()), 1.0)


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p values adjusted for their number (Holm 1979).

    The k-th smallest of m is multiplied by m - k + 1, and is never below the one before. Rejecting where the
    adjusted p is at most 5 % keeps the chance of any false rejection at 5 %, however the tests depend on each
    other. Written out, as `statsmodels` collects garbage for 50 ms at each such call.

    Parameters
    ----------
    p_values : sequence of float or None
        None for a test that could not be made: it stays None, and is not counted.

    >>> holm([0.01, None, 0.04, 0.03])
    [0.03, None, 0.06, 0.06]
    """
    given = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    raised = accumulate((min(p * (len(given) - k), 1.0) for k, (p, _) in enumerate(given)), max)
    adjusted = dict(zip((place for _, place in given), raised, strict=True))
    return [adjusted.get(place) for place in range(len(p_values))]

"""How the sums of random subsets are distributed, exactly: what permutation tests are made of.

Of n whole numbers there are 2^n subsets, but their sums take few values. Taking the numbers one after the
other, each sum is reached with the number or without it (Pagano & Tritchler 1983): the work grows with the
square of n, and 200 pairs are no more trouble than 17.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array

Integers = NDArray[np.int64]


def subset_sum_probabilities(weights: Integers) -> Array:
    """Return the distribution of the sum of a random subset, each member in it with probability one half.

    All terms are positive and halved exactly, so that the relative error stays below n rounding errors.

    Parameters
    ----------
    weights : array of int, (rows, n)
        At least 0; each row is a set of its own.

    Returns
    -------
    array, (rows, largest total + 1)
        Probability of each sum 0, 1, 2, ...

    >>> subset_sum_probabilities(np.array([[1, 2]])).tolist()  # {}, {1}, {2}, {1, 2}
    [[0.25, 0.25, 0.25, 0.25]]
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


def subset_counts(scores: Integers) -> tuple[Array, int]:
    """Return how many subsets of some whole numbers have each size and sum.

    Parameters
    ----------
    scores : array of int, (n,)
        Of either sign.

    Returns
    -------
    array, (n + 1, sums)
        Number of subsets by size and by sum; exact up to 2^53, then to 16 digits.
    int
        The sum of the first column: that of all scores below 0.

    >>> counts, lowest = subset_counts(np.array([-1, 2]))
    >>> lowest, counts.tolist()  # rows: sizes 0, 1, 2; columns: sums -1, 0, 1, 2
    (-1, [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    """
    lowest, highest = int(scores[scores < 0].sum()), int(scores[scores > 0].sum())
    counts = np.zeros((scores.size + 1, highest - lowest + 1))
    counts[0, -lowest] = 1.0
    for score in scores:
        # Nothing is rolled over the edge: the columns reach from the sum of all scores below 0 to that of all
        # above, and hold every sum on the way.
        counts[1:] += np.roll(counts[:-1], int(score), axis=1)
    return counts, lowest

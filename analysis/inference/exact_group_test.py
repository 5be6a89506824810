"""An exact test of the difference between two groups: under "no difference" everybody could be in either."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from evenlight.analysis.inference.subset_sums import subset_counts


@dataclass(frozen=True, slots=True)
class GroupTest:
    """What an exact test between two groups found.

    Attributes
    ----------
    difference : float
        Mean of the first group less mean of the second, in the unit of the scores.
    p_value : float
        Two-sided.
    n_first, n_second : int
        How many are in each.
    """

    difference: float
    p_value: float
    n_first: int
    n_second: int


def group_test(first: ArrayLike, second: ArrayLike) -> GroupTest:
    """Test whether two groups have the same mean, by all ways to divide everybody into two such groups.

    Two-sided: p is the share of divisions with at least the |difference of means| that was found (Fisher
    1935; Pagano & Tritchler 1983). The sum of one group says all, as that of both is given.

    Parameters
    ----------
    first, second : array_like of int, (n1,) and (n2,)
        Whole numbers; at least one in each.

    >>> group_test([2, 3], [0, 1]).p_value  # of six divisions, this one and its mirror image
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
    p_value = float(ways[distance >= found].sum() / ways.sum())
    return GroupTest(float(one.mean() - other.mean()), min(p_value, 1.0), one.size, other.size)

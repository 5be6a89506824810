"""Every way in which the ratings of two versions can belong to the same people, and the tests of all of them.

A printed table has the margins of the joint table of the two ratings, not the table itself. Paired tests need
the differences: all possible multisets of them are found here, and the range of p over all of them.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from evenlight.analysis.audit.conventions import SCORES, Counts, all_histograms
from evenlight.analysis.inference.exact_tests import holm as adjusted
from evenlight.analysis.inference.exact_tests import sign_flip_p_values
from evenlight.data_schema.arrays import Array

CATEGORIES = len(SCORES)
DIFFERENCES = np.arange(1 - CATEGORIES, CATEGORIES)  # ours less baseline, -4 to 4
BITS = 5  # of a packed count
MOST_PEOPLE = 2**BITS - 1
_CHANGES = DIFFERENCES[DIFFERENCES != 0]
_FIRST_CHANGE = BITS * (CATEGORIES - 1)  # below it lie the counts of all columns but the last
ALPHA = 0.05


def reachable_differences(baseline: Counts, ours: Counts) -> Counts:
    """Return every histogram of the differences that some pairing of the ratings gives.

    The joint tables are built row by row. All that a half-built table decides about the rest is how much of
    each column is used and how often each difference has occurred; tables that agree in both are kept once.
    Both are packed into one whole number, so that adding a row is adding a number.

    Parameters
    ----------
    baseline, ours : int array (a, 5), (b, 5)
        Histograms that each version may have, all of the same number of people, at most 31; every pair of
        them is tried.

    Returns
    -------
    int array (histograms, 9)
        How often each of the differences -4 to 4 occurs.

    >>> one, other = np.array([[1, 1, 0, 0, 0]]), np.array([[0, 1, 1, 0, 0]])  # 1, 2 and 2, 3
    >>> reachable_differences(one, other)[:, 4:7].tolist()  # of 0, 1, 2: 1 twice; or 0 and 2
    [[0, 2, 0], [1, 0, 1]]
    """
    n = int(baseline[0].sum())
    if not np.all(np.concatenate([baseline, ours]).sum(axis=1) == n) or n > MOST_PEOPLE:
        raise ValueError(f"need histograms of the same number of people, at most {MOST_PEOPLE}")
    packed = np.unique(np.concatenate([_reachable(rows, ours) for rows in baseline]))
    changes = (packed[:, None] >> (BITS * np.arange(_CHANGES.size))) & MOST_PEOPLE
    return np.insert(changes, CATEGORIES - 1, n - changes.sum(axis=1), axis=1)


def _reachable(rows: Counts, columns: Counts) -> NDArray[np.int64]:
    """Return the packed counts of differences of all tables with these row sums and one of the columns'."""
    states, used = np.zeros(1, dtype=np.int64), 0
    most = columns.max(axis=0)
    # The fullest row comes last: the columns leave no choice there.
    *others, last = np.argsort(rows, kind="stable")
    for row in others:
        cells = all_histograms(int(rows[row]))
        cells = cells[(cells <= most).all(axis=1)]
        used += int(rows[row])
        states = np.unique((states[:, None] + _packed(cells, row)).ravel())
        left = columns[:, None] - _columns_used(states, used)
        states = states[(left >= 0).all(axis=2).any(axis=0)]
    left = columns[:, None] - _columns_used(states, used)
    final = [(states + _packed(cells, last))[(cells >= 0).all(axis=1)] for cells in left]
    return np.unique(np.concatenate(final) >> _FIRST_CHANGE)


def _packed(cells: Counts, row: int) -> NDArray[np.int64]:
    """Return a row's cells as packed counts of columns and differences."""
    column_shift = BITS * np.arange(CATEGORIES - 1)
    packed = (cells[:, :-1] << column_shift).sum(axis=1)
    for column in range(CATEGORIES):
        if column != row:
            change = int(np.searchsorted(_CHANGES, column - row))
            packed = packed + (cells[:, column] << (_FIRST_CHANGE + BITS * change))
    return np.asarray(packed)


def _columns_used(states: NDArray[np.int64], used: int) -> Counts:
    """Return how much of each column half-built tables have used, (states, 5)."""
    columns = (states[:, None] >> (BITS * np.arange(CATEGORIES - 1))) & MOST_PEOPLE
    return np.column_stack([columns, used - columns.sum(axis=1)])


class PairedTest(enum.Enum):
    """A two-sided test of paired differences; all but the first are exact."""

    T = "t test"
    SIGN_FLIP = "sign-flip test of the mean"
    SIGNED_RANK = "signed ranks, zeros ranked"
    SIGNED_RANK_DROPPED = "signed ranks, zeros dropped"
    SIGN = "sign test"


MAIN_TEST = PairedTest.SIGN_FLIP  # of the very number that is printed, exact with any ties


class Verdict(enum.Enum):
    """What a table without its pairing says about a difference at 5 %."""

    DIFFERS = "differs, whatever the pairing"
    NOT_SHOWN = "not shown to differ by any pairing"
    OPEN = "depends on the pairing"


@dataclass(frozen=True, slots=True)
class PValueRange:
    """The smallest and the largest p of a test over all pairings.

    Attributes
    ----------
    low, high : float
        Both attained by a pairing.
    """

    low: float
    high: float

    @property
    def verdict(self) -> Verdict:
        """What holds for every pairing, with p of exactly 5 % counted as enough.

        >>> PValueRange(0.01, 0.04).verdict, PValueRange(0.01, 0.2).verdict
        (<Verdict.DIFFERS: 'differs, whatever the pairing'>, <Verdict.OPEN: 'depends on the pairing'>)
        """
        if self.high <= ALPHA:
            return Verdict.DIFFERS
        return Verdict.OPEN if self.low <= ALPHA else Verdict.NOT_SHOWN


def p_ranges(counts: Counts) -> dict[PairedTest, PValueRange]:
    """Return the smallest and largest p of every test over histograms of differences, (histograms, 9).

    The t test has no value where all differences are alike; such a histogram does not count for it.

    Raises
    ------
    ValueError
        If there is no other.
    """
    differences = differences_of(counts)
    values = {test: paired_p_values(differences, test) for test in PairedTest}
    if np.isnan(values[PairedTest.T]).all():
        raise ValueError("all differences are alike in every pairing: a t test has no value")
    return {test: PValueRange(float(np.nanmin(p)), float(np.nanmax(p))) for test, p in values.items()}


def differences_of(counts: Counts) -> Counts:
    """Return the differences that histograms of them count, in rising order, (histograms, n).

    >>> differences_of(np.array([[0, 0, 0, 1, 0, 2, 0, 0, 0]])).tolist()
    [[-1, 1, 1]]
    """
    ends = np.cumsum(counts, axis=1)
    n = int(ends[0, -1])
    return np.asarray(DIFFERENCES[(ends[:, :, None] <= np.arange(n)).sum(axis=1)])


def paired_p_values(differences: Counts, test: PairedTest) -> Array:
    """Return the two-sided p of a test for sets of differences, (sets, n) -> (sets,); NaN for none.

    Signed ranks are scores whose signs may flip, and so are signs alone: one enumeration serves all.

    >>> exact = (PairedTest.SIGN_FLIP, PairedTest.SIGN)
    >>> [float(paired_p_values(np.array([[1, 1, 1]]), test)[0]) for test in exact]
    [0.25, 0.25]
    """
    if test is PairedTest.T:
        return _t_p_values(differences)
    if test is PairedTest.SIGN:
        return sign_flip_p_values(np.sign(differences))
    if test is PairedTest.SIGN_FLIP:
        return sign_flip_p_values(differences)
    ranks = stats.rankdata(np.abs(differences), axis=1)
    if test is PairedTest.SIGNED_RANK_DROPPED:  # zeros have the lowest ranks: without them all others sink
        ranks = ranks - (differences == 0).sum(axis=1, keepdims=True)
    return sign_flip_p_values(np.rint(2 * ranks) * np.sign(differences))  # midranks are halves


def _t_p_values(differences: Counts) -> Array:
    """Return the two-sided p of Student's t; NaN where all differences are alike."""
    n = differences.shape[1]
    total, squares = differences.sum(axis=1), (differences**2).sum(axis=1)
    spread = n * squares - total**2  # n (n - 1) times the variance: a whole number, 0 only if all are alike
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.abs(total) * np.sqrt((n - 1) / spread)
    return np.where(spread > 0, 2 * special.stdtr(n - 1, -t), np.nan)


def holm(ranges: list[PValueRange]) -> list[PValueRange]:
    """Return ranges of p with Holm's (1979) correction for their number.

    A p that is corrected so never falls when any of the p rises, and each pairing is free: the smallest
    come together from all the smallest, the largest from all the largest.

    >>> holm([PValueRange(0.01, 0.02), PValueRange(0.04, 0.5)])
    [PValueRange(low=0.02, high=0.04), PValueRange(low=0.04, high=0.5)]
    """
    lows, highs = adjusted([r.low for r in ranges]), adjusted([r.high for r in ranges])
    return [PValueRange(float(low or 0), float(high or 0)) for low, high in zip(lows, highs, strict=True)]

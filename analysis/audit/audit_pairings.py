"""Every way in which the ratings of two versions can belong to the same people, given both histograms.

A printed table has the margins of the joint table of the two ratings, not the table itself. Paired tests need
the differences; which multisets of differences are possible is found here, all of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.audit.audit_conventions import SCORES, Counts, all_histograms

CATEGORIES = len(SCORES)
DIFFERENCES = np.arange(1 - CATEGORIES, CATEGORIES)  # ours less baseline, -4 to 4
BITS = 5  # of a packed count
MOST_PEOPLE = 2**BITS - 1
_CHANGES = DIFFERENCES[DIFFERENCES != 0]
_FIRST_CHANGE = BITS * (CATEGORIES - 1)  # below it lie the counts of all columns but the last


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

"""The pair sum as linear inequalities, for solvers that know nothing of sorting.

Frames that count alike go through a sorting network (Batcher 1968, AFIPS 32:307), its comparators relaxed
to lo + hi = a + b, hi >= a, hi >= b: minimizing the pair sum of what comes out makes them exact. That is the
dual of Goemans' extended formulation of the permutahedron (2015, Math. Program. 153:5), and takes about
N (log2 N)² / 2 variables where all pairs would take N² / 2. Frames of different weights need all the pairs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from evenlight.data_schema.arrays import Array
from evenlight.method.objective import order_weights


@dataclass(frozen=True, slots=True)
class PairSum:
    """The least `cost` · z over z = (u, further variables) with `equal` · z = 0 and `below` · z <= 0.

    Attributes
    ----------
    cost : array, (V,)
        Of each variable.
    equal, below : sparse array, (·, V)
        Rows.
    """

    cost: Array
    equal: csr_array
    below: csr_array


def pair_sum_rows(weights: Array) -> PairSum:
    """Return rows whose least cost, for given losses u, is Σ_{i<j} ω_i ω_j |u_i - u_j|.

    Parameters
    ----------
    weights : array, (N,)
        ω of each frame.
    """
    return _network(weights) if np.ptp(weights) == 0 else _all_pairs(weights)


def comparators(n: int) -> list[tuple[int, int]]:
    """Return the comparators of Batcher's odd-even merge sort for n wires, in order.

    >>> comparators(3)
    [(0, 2), (0, 1), (1, 2)]
    """
    found = []
    top = 1 << max((n - 1).bit_length() - 1, 0)
    p = top
    while p > 0:
        q, r, distance = top, 0, p
        while distance > 0:
            found += [(i, i + distance) for i in range(n - distance) if i & p == r]
            distance, q, r = (q - p, q >> 1, p) if q != p else (0, q, r)
        p >>= 1
    return found


def _network(weights: Array) -> PairSum:
    """Return the rows of a sorting network."""
    n = len(weights)
    wires, variables = list(range(n)), n
    equal: list[tuple[int, int, float]] = []
    below: list[tuple[int, int, float]] = []
    for row, (i, j) in enumerate(comparators(n)):
        low, high = variables, variables + 1
        variables += 2
        equal += [(row, low, 1.0), (row, high, 1.0), (row, wires[i], -1.0), (row, wires[j], -1.0)]
        below += [(2 * row, wires[i], 1.0), (2 * row, high, -1.0)]
        below += [(2 * row + 1, wires[j], 1.0), (2 * row + 1, high, -1.0)]
        wires[i], wires[j] = low, high
    cost = np.zeros(variables)
    cost[wires] = order_weights(weights)
    return PairSum(cost, _sparse(equal, variables), _sparse(below, variables))


def _all_pairs(weights: Array) -> PairSum:
    """Return the rows t >= u_i - u_j and t >= u_j - u_i of all pairs."""
    n = len(weights)
    first, second = np.triu_indices(n, 1)
    pairs = np.arange(len(first))
    below = []
    for k, sign in enumerate((1.0, -1.0)):
        row = (2 * pairs + k).tolist()
        below += list(zip(row, first.tolist(), [sign] * len(row), strict=True))
        below += list(zip(row, second.tolist(), [-sign] * len(row), strict=True))
        below += list(zip(row, (n + pairs).tolist(), [-1.0] * len(row), strict=True))
    cost = np.concatenate([np.zeros(n), weights[first] * weights[second]])
    return PairSum(cost, _sparse([], len(cost)), _sparse(below, len(cost)))


def _sparse(entries: list[tuple[int, int, float]], columns: int) -> csr_array:
    """Return a sparse array of entries (row, column, value)."""
    rows = 1 + max((row for row, _, _ in entries), default=-1)
    at_row, at_column, value = (np.array([e[k] for e in entries]) for k in range(3))
    return csr_array((value, (at_row.astype(int), at_column.astype(int))), shape=(rows, columns))

"""Other solvers of the problem, to judge ours by: a sequence of linear programs, by a general sparse solver.

About feasible factors the loss curves and the rate limit are linearized, within a trust region; what is left
is a linear program. Its answer is projected on the true limits. If that improves the objective, the region
moves there and grows, else it shrinks. HiGHS comes with SciPy; Clarabel is a package of its own. Up to 250
frames take less than minutes, and 100 whose weights differ.

In these programs the pair sum stands as linear inequalities, for they know nothing of sorting. Frames that
count alike go through a sorting network (Batcher 1968, AFIPS 32:307), its comparators relaxed to lo + hi = a
+ b, hi >= a, hi >= b: minimizing the pair sum of what comes out makes them exact. That is the dual of
Goemans' extended formulation of the permutahedron (2015, Math. Program. 153:5), and takes about N (log2 N)² /
2 variables where all pairs would take N² / 2. Frames of different weights need all the pairs. The mean loss
is linear as it is, and the largest loss one variable that is no less than any loss.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, vstack

from evenlight.data_schema.arrays import Array
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.optimizer.chain import linearized_limits, nearest_feasible
from evenlight.method.optimizer.objective import LargestLoss, order_weights
from evenlight.method.optimizer.optimize import Problem, Solution

FIRST_TRUST = 0.1
LEAST_TRUST = 1e-5
MOST_MODELS = 60


@dataclass(frozen=True, slots=True)
class LinearProgram:
    """Least cost · z within equal · z = equal_to, below · z <= at_most and low <= z <= high."""

    cost: Array
    equal: csr_array
    equal_to: Array
    below: csr_array
    at_most: Array
    low: Array
    high: Array


def by_highs(program: LinearProgram) -> Array | None:
    """HiGHS, its interior-point method with crossover: the z of least cost, or None if none was found."""
    found = linprog(
        program.cost,
        A_ub=program.below,
        b_ub=program.at_most,
        A_eq=program.equal,
        b_eq=program.equal_to,
        bounds=np.column_stack([program.low, program.high]),
        method="highs-ipm",
    )
    return None if found.x is None else np.asarray(found.x)


def by_clarabel(program: LinearProgram) -> Array | None:
    """Clarabel, interior-point method for conic programs: the z of least cost, or None if none is found."""
    bounded, size = np.isfinite(program.low), len(program.cost)
    one = csr_array(eye_array(size))[bounded]
    rows = csc_array(block_array([[program.equal], [program.below], [one], [-one]]))
    limits = np.concatenate([program.equal_to, program.at_most, program.high[bounded], -program.low[bounded]])
    cones = [
        clarabel.ZeroConeT(len(program.equal_to)),
        clarabel.NonnegativeConeT(len(limits) - len(program.equal_to)),
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    nothing = csc_array((size, size))
    found = clarabel.DefaultSolver(nothing, program.cost, rows, limits, cones, settings).solve()
    z = np.array(found.x)
    return z if np.isfinite(z).all() else None


@dataclass(frozen=True, slots=True)
class SequentialConvexSolver:
    """Improve constant dimming by linear programs in a trust region."""

    solver: Callable[[LinearProgram], Array | None]  # which solves them

    def solve(self, problem: Problem) -> Solution:
        """Return the last of the improving factors."""
        factors = problem.baseline()
        if not problem.leaves_a_choice:
            return Solution(factors, 0)
        rows, objective, trust, models = rows_of(problem), problem.objective(factors), FIRST_TRUST, 0
        while trust > LEAST_TRUST and models < MOST_MODELS and objective > 0:
            models += 1
            z = self.solver(_model(problem, factors, rows, trust))
            if z is None:
                break
            wanted = np.clip(z[: len(factors)], problem.lowest_factor, 1.0)
            candidate = nearest_feasible(problem, factors, wanted, trust)
            value = problem.objective(candidate)
            if value < objective * (1 - 1e-6):
                factors, objective, trust = candidate, value, min(2 * trust, 1.0)
            else:
                trust /= 4
        return Solution(factors, models)


def _model(problem: Problem, factors: Array, rows: ObjectiveRows, trust: float) -> LinearProgram:
    """Return the linear program about feasible factors; z holds factors, losses, further variables."""
    n, extra = len(factors), len(rows.cost) - len(factors)
    loss, slope = loss_and_slope(problem.curves, factors)
    limits = linearized_limits(problem, factors, trust)
    on_chain = csr_array((0, n)) if n < 2 else _chain_rows(limits.up_slope, limits.down_slope)
    on_curve = csr_array(diags_array(slope))
    blank = csr_array((1, n + extra))
    equal: list[list[Any]] = [
        [csr_array(problem.budget_weights[None]), blank],
        [on_curve, -eye_array(n, n + extra, format="csr")],
        [csr_array((rows.equal.shape[0], n)), rows.equal],
    ]
    below: list[list[Any]] = [
        [on_chain, csr_array((on_chain.shape[0], n + extra))],
        [csr_array((rows.below.shape[0], n)), rows.below],
    ]
    nothing = np.full(n + extra, np.inf)
    return LinearProgram(
        cost=np.concatenate([np.zeros(n), rows.cost / problem.size()]),
        equal=csr_array(block_array(equal)),
        equal_to=np.concatenate(
            [[problem.baseline_factor], slope * factors - loss, np.zeros(rows.equal.shape[0])]
        ),
        below=csr_array(block_array(below)),
        at_most=np.concatenate([limits.up_offset, -limits.down_offset, np.zeros(rows.below.shape[0])]),
        low=np.concatenate([limits.low, -nothing]),
        high=np.concatenate([limits.high, nothing]),
    )


def _chain_rows(up_slope: Array, down_slope: Array) -> csr_array:
    """Return the rows x' - up · x <= ... and down · x - x' <= ... of each step."""
    n = len(up_slope) + 1
    here, after = eye_array(n - 1, n, format="csr"), eye_array(n - 1, n, k=1, format="csr")
    up = after - diags_array(up_slope) @ here
    down = diags_array(down_slope) @ here - after
    return csr_array(vstack([up, down]))


@dataclass(frozen=True, slots=True)
class ObjectiveRows:
    """Size times the objective of losses u: the least `cost` · z with `equal` · z = 0 and `below` · z <= 0.

    z = (u, further variables).
    """

    cost: Array  # (V,): of each variable
    equal: csr_array  # rows, (·, V)
    below: csr_array  # rows, (·, V)


def rows_of(problem: Problem) -> ObjectiveRows:
    """Return rows whose least cost, for given losses, is the problem's size times its objective."""
    weights = problem.frame_importance()
    if isinstance(problem.minimized, LargestLoss):
        return _largest(weights, problem.size())
    rows = pair_sum_rows(weights)
    if problem.minimized.level_weight is not None:
        level = problem.minimized.level_weight * problem.size() / weights.sum()
        rows.cost[: len(weights)] += level * weights
    return rows


def _largest(weights: Array, size: float) -> ObjectiveRows:
    """Return the rows u <= t of all frames that count; t costs the size."""
    n, counting = len(weights), np.flatnonzero(weights > 0).tolist()
    below = [(row, frame, 1.0) for row, frame in enumerate(counting)]
    below += [(row, n, -1.0) for row in range(len(counting))]
    return ObjectiveRows(np.append(np.zeros(n), size), _sparse([], n + 1), _sparse(below, n + 1))


def pair_sum_rows(weights: Array) -> ObjectiveRows:
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


def _network(weights: Array) -> ObjectiveRows:
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
    return ObjectiveRows(cost, _sparse(equal, variables), _sparse(below, variables))


def _all_pairs(weights: Array) -> ObjectiveRows:
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
    return ObjectiveRows(cost, _sparse([], len(cost)), _sparse(below, len(cost)))


def _sparse(entries: list[tuple[int, int, float]], columns: int) -> csr_array:
    """Return a sparse array of entries (row, column, value)."""
    rows = 1 + max((row for row, _, _ in entries), default=-1)
    at_row, at_column, value = (np.array([e[k] for e in entries]) for k in range(3))
    return csr_array((value, (at_row.astype(int), at_column.astype(int))), shape=(rows, columns))

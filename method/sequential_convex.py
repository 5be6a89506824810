"""General sparse solvers behind the seam: each solves a sequence of convex models of the problem.

About feasible factors the loss curves and the rate limit are linearized, within a trust region; what is left
is a linear program (`method.pair_sum_rows`). Its answer is projected on the true limits. If that improves the
objective, the region moves there and grows, else it shrinks. HiGHS comes with SciPy; Clarabel is a package of
its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, vstack

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.method.budgeted_chain import linearized_limits, nearest_feasible
from evenlight.method.curve_lookup import loss_and_slope
from evenlight.method.objective import weight_of_pairs
from evenlight.method.optimize import Problem, Solution
from evenlight.method.pair_sum_rows import PairSum, pair_sum_rows

FIRST_TRUST = 0.1
LEAST_TRUST = 1e-5
MOST_MODELS = 60
UNEVEN_FRAMES = 100  # of different weights, which need all the pairs


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


class LinearSolver(Protocol):
    """Something that solves linear programs."""

    @property
    def name(self) -> str:
        """What the command calls it."""

    @property
    def max_frames(self) -> int:
        """How many frames it can do in reasonable time."""

    def solve(self, program: LinearProgram) -> Array | None:
        """Return the z of least cost, or None if none was found."""


@dataclass(frozen=True, slots=True)
class Highs:
    """HiGHS, its interior-point method with crossover, as SciPy brings it."""

    name: str = "highs"
    max_frames: int = 250

    def solve(self, program: LinearProgram) -> Array | None:
        """Return the z of least cost, or None if none was found."""
        found = linprog(  # type: ignore[call-overload] # the stubs know no sparse arrays
            program.cost,
            A_ub=program.below,
            b_ub=program.at_most,
            A_eq=program.equal,
            b_eq=program.equal_to,
            bounds=np.column_stack([program.low, program.high]),
            method="highs-ipm",
        )
        return None if found.x is None else np.asarray(found.x)


@dataclass(frozen=True, slots=True)
class Clarabel:
    """Clarabel, an interior-point method for conic programs."""

    name: str = "clarabel"
    max_frames: int = 250

    def solve(self, program: LinearProgram) -> Array | None:
        """Return the z of least cost, or None if none was found."""
        clarabel = _clarabel()
        bounded, size = np.isfinite(program.low), len(program.cost)
        one = csr_array(eye_array(size))[bounded]
        rows = csc_array(block_array([[program.equal], [program.below], [one], [-one]]))
        limits = np.concatenate(
            [program.equal_to, program.at_most, program.high[bounded], -program.low[bounded]]
        )
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


def _clarabel() -> Any:
    """Return the module, or say how to get it."""
    try:
        import clarabel  # type: ignore[import-untyped] # it has no stubs
    except ImportError:
        raise InputError(
            "--solver clarabel needs the package clarabel, which is not installed: pip install clarabel"
        ) from None
    return clarabel


@dataclass(frozen=True, slots=True)
class SequentialConvexSolver:
    """Improve constant dimming by linear programs in a trust region.

    Attributes
    ----------
    solver : LinearSolver
        Which solves them.
    """

    solver: LinearSolver

    def solve(self, problem: Problem) -> Solution:
        """Return the last of the improving factors."""
        if self.solver.name == "clarabel":
            _clarabel()  # before any work
        importance, factors = problem.frame_importance(), problem.baseline()
        self._require_affordable(importance)
        if not weight_of_pairs(importance) > 0:
            return Solution(factors, 0)
        rows, objective, trust, models = pair_sum_rows(importance), problem.objective(factors), FIRST_TRUST, 0
        while trust > LEAST_TRUST and models < MOST_MODELS and objective > 0:
            models += 1
            z = self.solver.solve(_model(problem, factors, rows, trust))
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

    def _require_affordable(self, importance: Array) -> None:
        """Raise `InputError` if there are more frames than the solver can do in reasonable time."""
        n, even = len(importance), bool(np.ptp(importance) == 0)
        most = self.solver.max_frames if even else min(self.solver.max_frames, UNEVEN_FRAMES)
        if n > most:
            weighted = "" if even else " of different weights"
            raise InputError(
                f"--solver {self.solver.name} takes at most {most} frames{weighted}, this video has {n}; "
                f"use --solver splitting"
            )


def _model(problem: Problem, factors: Array, rows: PairSum, trust: float) -> LinearProgram:
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
        cost=np.concatenate([np.zeros(n), rows.cost / weight_of_pairs(problem.frame_importance())]),
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

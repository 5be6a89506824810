"""The solvers, by the name that the command knows them by."""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.method.choices import SolverName
from evenlight.method.optimize import Solver
from evenlight.method.sequential_convex import Clarabel, Highs, SequentialConvexSolver
from evenlight.method.slsqp import SlsqpSolver
from evenlight.method.splitting import SplittingSolver


def make_solver(name: SolverName, rng: np.random.Generator, start: Array | None = None) -> Solver:
    """Return a solver.

    Parameters
    ----------
    name : SolverName
        Which.
    rng : np.random.Generator
        Perturbs the start where the solver wants that.
    start : array, (N,), optional
        Factors to start from, where the solver can.

    Raises
    ------
    InputError
        If a start is given to a solver that takes none.
    """
    if name is SolverName.SPLITTING:
        return SplittingSolver(start)
    if start is not None:
        raise InputError(f"--start is for --solver splitting, not for {name.value}")
    if name is SolverName.SLSQP:
        return SlsqpSolver(rng)
    return SequentialConvexSolver(Highs() if name is SolverName.HIGHS else Clarabel())

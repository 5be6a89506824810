"""The solvers, by the name that the command knows them by."""

from __future__ import annotations

import numpy as np

from method.choices import SolverName
from method.optimize import Solver
from method.slsqp import SlsqpSolver
from method.splitting import SplittingSolver


def make_solver(name: SolverName, rng: np.random.Generator) -> Solver:
    """Return a solver; `rng` perturbs the start where the solver wants that."""
    if name is SolverName.SLSQP:
        return SlsqpSolver(rng)
    return SplittingSolver()

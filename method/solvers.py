"""The solvers, by the name that the command knows them by."""

from __future__ import annotations

import enum

import numpy as np

from method.optimize import Solver
from method.slsqp import SlsqpSolver
from method.splitting import SplittingSolver


class SolverName(enum.Enum):
    """Which solver."""

    SPLITTING = "splitting"  # the default: any length, with a certificate
    SLSQP = "slsqp"  # the paper's, for short clips


def make_solver(name: SolverName, rng: np.random.Generator) -> Solver:
    """Return a solver; `rng` perturbs the start where the solver wants that."""
    if name is SolverName.SLSQP:
        return SlsqpSolver(rng)
    return SplittingSolver()

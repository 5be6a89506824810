"""The three tracks of a sequence whose adaptation is compared (Section 4.4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.reproduction.adaptation_differences import AdaptationInput
from evenlight.analysis.reproduction.luminance_maps import LuminanceMaps
from evenlight.method.optimize import Problem, Solver, optimize

NO_LIMIT = 1e9  # [cd/m^2/s] the sun's luminance within a second: no step of a display comes near


def adaptation_input(
    problem: Problem, factors: NDArray[np.float64], maps: LuminanceMaps, solver: Solver
) -> AdaptationInput:
    """Return a sequence with its track, with the one that no rate limit binds, and with constant dimming.

    Parameters
    ----------
    problem : Problem
        What was solved.
    factors : array, (N,)
        b of the track within the rate limit.
    maps : LuminanceMaps
        Of the same frames.
    solver : Solver
        Solves the same problem without a rate limit.
    """
    free = replace(problem, rate_limit=lambda luminance: np.full_like(luminance, NO_LIMIT))
    return AdaptationInput(
        name=problem.curves.video,
        budget=problem.baseline_factor,
        maps=maps,
        constrained=factors,
        unconstrained=optimize(free, solver).factors,
        constant=problem.baseline(),
    )

"""A calmer track for a small share of the gain.

The optimum follows every flicker of the measured contrast loss as far as the rate limit lets it. Of the
tracks that keep most of the gain, the calmest is wanted: one that runs straight wherever it may. A string
pulled tight through a tube about the optimum is the shortest path within it; the tube is as wide as the gain
allows.
"""

from __future__ import annotations

import numba
import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.budgeted_chain import linearized_limits, nearest_within_budget
from evenlight.method.optimize import Problem, feasible_blend, is_feasible

RADII = 0.128 * 0.5 ** np.arange(10.0)  # of the tube, as differences of factors, widest first


def calmed(problem: Problem, factors: Array, share: float) -> Array:
    """Return the calmest track found that gives up at most a share of the gain over constant dimming.

    Parameters
    ----------
    problem : Problem
        N frames.
    factors : array, (N,)
        A feasible track.
    share : float
        Of the gain in the objective, in [0, 1]; 0 returns the track itself.

    Returns
    -------
    array, (N,)
        Feasible; budget and rate limit are met.
    """
    objective = problem.objective(factors)
    allowed = objective + share * (problem.objective(problem.baseline()) - objective)
    if share <= 0 or len(factors) < 3:
        return factors
    limits = linearized_limits(problem, factors, trust=float(2 * RADII[0]))
    for radius in RADII:
        straight = taut_string(problem.curves.times, factors, float(radius))
        nearest = nearest_within_budget(problem, straight, limits)
        track = feasible_blend(problem, np.clip(nearest, problem.lowest_factor, 1.0))
        if problem.objective(track) <= allowed and is_feasible(problem, track):
            return track
    return factors


@numba.njit(cache=True)
def taut_string(times: Array, values: Array, radius: float) -> Array:
    """Return the shortest path within a radius of some values, both ends held.

    From each bend the path goes straight for as long as one slope stays within the tube; then it bends where
    the tube was narrowest.

    >>> taut_string(np.arange(5.0), np.array([0.0, 0.1, -0.1, 0.1, 0.0]), 0.1).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0]
    """
    last = len(values) - 1
    path = values.copy()
    bend = 0
    while bend < last:
        steepest, flattest = np.inf, -np.inf
        upper, lower, following, slope = bend, bend, last, 0.0
        for j in range(bend + 1, last + 1):
            room = radius if j < last else 0.0
            ahead = times[j] - times[bend]
            top = (values[j] + room - path[bend]) / ahead
            bottom = (values[j] - room - path[bend]) / ahead
            if bottom > steepest:
                following, slope = upper, steepest
                break
            if top < flattest:
                following, slope = lower, flattest
                break
            if top <= steepest:
                steepest, upper = top, j
            if bottom >= flattest:
                flattest, lower = bottom, j
            slope = steepest
        for k in range(bend + 1, following + 1):
            path[k] = path[bend] + slope * (times[k] - times[bend])
        bend = following
    return path

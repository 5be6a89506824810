"""A calmer track: one that keeps most of the gain, runs straight wherever it may, and slower than the limit.

The optimum follows every flicker of the measured contrast loss as fast as the rate limit lets it. A part of
the gain is given up for a track that turns back less: a string pulled tight through a tube about the optimum
is the shortest path within it, and has the least of any convex cost of its slopes. Another part is given up
for one that never reaches the limit: the nearest track within the smallest share of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.compiled_loop import compiled_loop
from evenlight.method.optimizer.chain import linearized_limits, nearest_within_budget
from evenlight.method.optimizer.optimize import Problem, feasible_blend, is_feasible

STRAIGHTENING = 0.75  # of what may be given up; the rest slows (docs/decisions/calm-tracks.md)
NARROWEST, WIDEST = 1e-4, 0.5  # radius of the tube, as a difference of factors
HALVINGS = 8  # of the radius, and of the share of the limit


def calmed(
    problem: Problem, factors: Array, share: float, objective: Callable[[Array], float] | None = None
) -> Array:
    """Return the calmest track found that gives up at most a share of the gain over constant dimming.

    Parameters
    ----------
    problem : Problem
        N frames.
    factors : array, (N,)
        A feasible track.
    share : float
        Of the gain in the objective, in [0, 1]; 0 returns the track itself.
    objective : callable, optional
        What is to be kept, of factors (N,); else the problem's own objective.

    Returns
    -------
    array, (N,)
        Feasible; budget and rate limit are met.
    """
    value = objective or problem.objective
    if share <= 0 or len(factors) < 3:
        return factors
    best = value(factors)
    gain = value(problem.baseline()) - best

    def kept(given_up: float) -> Callable[[Array], bool]:
        return lambda track: value(track) <= best + given_up * gain and is_feasible(problem, track)

    straight = _straightened(problem, factors, kept(STRAIGHTENING * share))
    return _slowed(problem, straight, kept(share))


def _straightened(problem: Problem, factors: Array, is_kept: Callable[[Array], bool]) -> Array:
    """Return the track within the widest tube about the factors that keeps enough of the gain."""
    limits = linearized_limits(problem, factors, trust=WIDEST)
    best, narrow, wide = factors, NARROWEST, WIDEST
    for _ in range(HALVINGS):
        radius = math.sqrt(narrow * wide)
        string = taut_string(problem.curves.times, factors, radius)
        track = _feasible(problem, nearest_within_budget(problem, string, limits))
        if is_kept(track):
            best, narrow = track, radius
        else:
            wide = radius
    return best


def _slowed(problem: Problem, factors: Array, is_kept: Callable[[Array], bool]) -> Array:
    """Return the track nearest to the factors within the smallest share of the limit that keeps enough."""
    best, slow, fast = factors, 0.0, 1.0
    for _ in range(HALVINGS):
        share = (slow + fast) / 2
        slower = replace(problem, rate_limit=_part_of(problem, share))
        limits = linearized_limits(slower, feasible_blend(slower, factors), trust=WIDEST)
        track = _feasible(slower, nearest_within_budget(slower, factors, limits))
        if is_kept(track):
            best, fast = track, share
        else:
            slow = share
    return best


def _part_of(problem: Problem, share: float) -> Callable[[Array], Array]:
    return lambda luminance: share * problem.rate_limit(luminance)


def _feasible(problem: Problem, factors: Array) -> Array:
    """Return factors within their bounds, drawn towards constant dimming as far as the limit demands."""
    return feasible_blend(problem, np.clip(factors, problem.lowest_factor, 1.0))


@compiled_loop()
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

"""A problem with blocks of frames for frames, whose answer is where the full one starts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.loss_curves import ARRAY_SHAPES, LossCurves
from evenlight.method.budgeted_chain import nearest_feasible
from evenlight.method.optimize import Problem, Solution

BLOCK = 8  # frames


def coarse_problem(problem: Problem) -> Problem:
    """Return the problem with the means of blocks of frames; a free step frees the one between blocks."""
    starts = np.arange(0, problem.curves.n_frames, BLOCK)
    importance = np.add.reduceat(problem.frame_importance(), starts)
    return Problem(
        curves=_coarse_curves(problem.curves, starts),
        budget_weights=np.add.reduceat(problem.budget_weights, starts),
        baseline_factor=problem.baseline_factor,
        luminance=_means(problem.luminance, starts),
        rate_limit=problem.rate_limit,
        importance=importance / importance.mean(),
        allowances=_coarse_allowances(problem.allowances, starts),
    )


def _means(values: Array, starts: NDArray[np.int64]) -> Array:
    """Return the means of blocks along the first axis."""
    sizes = np.diff(np.append(starts, len(values)))
    return np.asarray(np.add.reduceat(values, starts, axis=0) / sizes.reshape(-1, *[1] * (values.ndim - 1)))


def _coarse_curves(curves: LossCurves, starts: NDArray[np.int64]) -> LossCurves:
    """Return the mean loss curves of blocks of frames."""
    of_frames = (name for name, shape in ARRAY_SHAPES.items() if shape[0] == "N")
    means: dict[str, Any] = {name: _means(getattr(curves, name), starts) for name in of_frames}
    for name in ("loss", "visible_contrast", "channel_means", "counted"):
        means[name] = np.clip(means[name], 0.0, 1.0)  # but for rounding they lie there
    means["times"], means["durations"] = curves.times[starts], np.add.reduceat(curves.durations, starts)
    return replace(curves, **means)


def _coarse_allowances(allowances: Array | None, starts: NDArray[np.int64]) -> Array | None:
    """Return the mean allowance of the steps from the start of each block to that of the next."""
    if allowances is None:
        return None
    steps = allowances[: starts[-1]]
    return np.add.reduceat(steps, starts[:-1]) / BLOCK


def refined_solution(problem: Problem, coarse: Solution) -> Solution:
    """Return feasible factors of all frames near those of a coarse solution, with its dual variables."""
    n = problem.curves.n_frames
    starts = np.arange(0, n, BLOCK)
    sizes = np.diff(np.append(starts, n))
    wanted = np.interp(np.arange(n), starts + (sizes - 1) / 2, coarse.factors)
    factors = nearest_feasible(problem, problem.baseline(), wanted, 1.0)
    factors = nearest_feasible(problem, factors, wanted, 1.0)
    weights = coarse.frame_weights
    if weights is not None:
        weights = np.repeat(weights, sizes)
    return Solution(factors, 0, weights, coarse.budget_price)

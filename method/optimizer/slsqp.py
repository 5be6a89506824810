"""The paper's solver: sequential least-squares programming, for short clips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.optimizer.optimize import BUDGET_TOLERANCE, Problem, Solution, feasible_blend

CONVERGED = 1e-8  # the paper's tolerance
PERTURBATION = 0.01  # standard deviation of the start about the constant
MOST_FRAMES = 500  # longer problems are refused: time grows with the cube of N
MOST_ITERATIONS = 1000
NO_LIMIT = 2.0  # change of a factor: twice what any step can be


@dataclass(frozen=True, slots=True)
class SlsqpSolver:
    """Minimize by SciPy's SLSQP from a perturbed constant, as the paper does (Section 3.5)."""

    rng: np.random.Generator  # for the perturbation

    def solve(self, problem: Problem) -> Solution:
        """Return SLSQP's answer, made feasible; the baseline where that is better."""
        n = problem.curves.n_frames
        if n > MOST_FRAMES:
            raise InputError(
                f"the solver slsqp takes at most {MOST_FRAMES} frames, this video has {n}; "
                f"use the solver splitting"
            )
        baseline = problem.baseline()
        if not problem.leaves_a_choice:
            return Solution(baseline, 0)
        noise = PERTURBATION * self.rng.standard_normal(n)
        factors, iterations = slsqp_from(problem, baseline + noise, CONVERGED)
        if problem.objective(factors) > problem.objective(baseline):
            factors = baseline
        return Solution(factors, iterations)


def slsqp_from(
    problem: Problem, start: Array, tolerance: float, iterations: int = MOST_ITERATIONS
) -> tuple[Array, int]:
    """Return what SLSQP makes of a start, drawn into the limits, and its iterations.

    Where it ends off the budget, the answer is the constant baseline.

    Parameters
    ----------
    problem : Problem
        N frames; time grows with the cube of N.
    start : array, (N,)
        Factors; they need not keep the limits.
    tolerance, iterations : float, int
        Of convergence, and how many it may take.
    """
    n, budget, reach = len(start), problem.baseline_factor, problem.step_reach()
    limits: list[scipy.optimize.LinearConstraint | scipy.optimize.NonlinearConstraint] = [
        scipy.optimize.LinearConstraint(problem.budget_weights[None], budget, budget),
        scipy.optimize.NonlinearConstraint(
            lambda b: _slack(problem, reach, b), 0.0, np.inf, jac=lambda b: _slack_slope(problem, reach, b)
        ),
    ]
    result = scipy.optimize.minimize(  # type: ignore[call-overload] # the stubs ask for statically 1-D arrays
        problem.objective,
        np.clip(start, problem.lowest_factor, 1.0),
        jac=lambda b: _objective_slope(problem, b),
        method="SLSQP",
        bounds=[(problem.lowest_factor, 1.0)] * n,
        constraints=limits,
        options={"maxiter": iterations, "ftol": tolerance},
    )
    factors = np.clip(result.x, problem.lowest_factor, 1.0)
    met = abs(problem.budget_error(factors)) <= BUDGET_TOLERANCE
    return feasible_blend(problem, factors) if met else problem.baseline(), int(result.nit)


def _objective_slope(problem: Problem, factors: Array) -> Array:
    loss, slope = loss_and_slope(problem.curves, factors)
    weights = problem.minimized.frame_weights(loss, problem.frame_importance()) / problem.size()
    return np.asarray(weights * slope)


def _slack(problem: Problem, reach: Array, factors: Array) -> Array:
    """Return how much further each step could go, upwards and downwards, in units of the factor, (2(N-1),).

    In cd/m^2/s, bright frames beside dark ones would have slopes of 1e7 beside 1e-320, with which SLSQP does
    not end, or, compiled as it is, leaves its memory.
    """
    limit = problem.rate_limit(factors * problem.luminance)
    lower, step = np.minimum(limit[:-1], limit[1:]), np.diff(factors)
    bound, length = _bounded(reach, lower)
    furthest = np.where(bound, lower * length, NO_LIMIT)
    return np.concatenate([furthest - step, furthest + step])


def _slack_slope(problem: Problem, reach: Array, factors: Array) -> Array:
    """Return the derivative of the slack, (2(N-1), N): of each step in the end that limits it."""
    n = len(factors)
    seen = factors * problem.luminance
    nudge = 1e-5 * np.maximum(seen, 1e-6)
    limit = problem.rate_limit(seen)
    gain = (problem.rate_limit(seen + nudge) - limit) / nudge * problem.luminance
    step = np.arange(n - 1)
    end = np.where(limit[:-1] <= limit[1:], step, step + 1)
    _, length = _bounded(reach, limit[end])
    furthest, change = np.zeros((n - 1, n)), np.zeros((n - 1, n))
    furthest[step, end] = gain[end] * length
    change[step, step], change[step, step + 1] = -1.0, 1.0
    return np.concatenate([furthest - change, furthest + change])


def _bounded(reach: Array, lower: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return which steps the lower limit of their ends [cd/m^2/s] holds back, and their reach or 0, (N-1,).

    No factor can change by more than 1, so that beyond `NO_LIMIT` a step counts as free.
    """
    bound = np.isfinite(reach) & (lower < NO_LIMIT / np.maximum(reach, 1e-300))
    return bound, np.where(bound, reach, 0.0)

"""The paper's solver: sequential least-squares programming, for short clips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, NonlinearConstraint, minimize

from data_schema.errors import InputError
from method.curve_lookup import loss_and_slope
from method.modulation import allowed_rate, modulation_rate, step_luminance
from method.objective import order_weights
from method.optimize import Problem, Solution, feasible_blend

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SlsqpSolver:
    """Minimize by SciPy's SLSQP from a perturbed constant, as the paper does (Section 3.5).

    Attributes
    ----------
    rng : np.random.Generator
        For the perturbation.
    tolerance : float
        Convergence tolerance; the paper's.
    perturbation : float
        Standard deviation of the start about the constant.
    max_frames : int
        Longer problems are refused: time grows with the cube of N.
    """

    rng: np.random.Generator
    tolerance: float = 1e-8
    perturbation: float = 0.01
    max_frames: int = 500

    def solve(self, problem: Problem) -> Solution:
        """Return SLSQP's answer, made feasible; the baseline where that is better."""
        n = problem.curves.n_frames
        if n > self.max_frames:
            raise InputError(
                f"--solver slsqp takes at most {self.max_frames} frames, this video has {n}; "
                f"use --solver splitting"
            )
        baseline = problem.baseline()
        if n == 1:
            return Solution(baseline, 0)
        noise = self.perturbation * self.rng.standard_normal(n)
        budget = problem.baseline_factor
        limits: list[LinearConstraint | NonlinearConstraint] = [
            LinearConstraint(problem.budget_weights[None], budget, budget),
            NonlinearConstraint(
                lambda b: _slack(problem, b), 0.0, np.inf, jac=lambda b: _slack_slope(problem, b)
            ),
        ]
        result = minimize(  # type: ignore[call-overload] # the stubs ask for statically 1-D arrays
            problem.objective,
            np.clip(baseline + noise, problem.lowest_factor, 1.0),
            jac=lambda b: _objective_slope(problem, b),
            method="SLSQP",
            bounds=[(problem.lowest_factor, 1.0)] * n,
            constraints=limits,
            options={"maxiter": 1000, "ftol": self.tolerance},
        )
        factors = np.clip(result.x, problem.lowest_factor, 1.0)
        met = abs(problem.budget_error(factors)) < 1e-9
        factors = feasible_blend(problem, factors) if met else baseline
        if problem.objective(factors) > problem.objective(baseline):
            factors = baseline
        return Solution(factors, int(result.nit))


def _objective_slope(problem: Problem, factors: Array) -> Array:
    """Return a (sub)gradient of the mean absolute pairwise difference of loss, (N,)."""
    loss, slope = loss_and_slope(problem.curves, factors)
    n = len(loss)
    weights = np.empty(n)
    weights[np.argsort(loss, kind="stable")] = order_weights(n) / (n * (n - 1) / 2)
    return weights * slope


def _slack(problem: Problem, factors: Array) -> Array:
    """Return what each step has left below its limit, upwards and downwards [cd/m^2/s], (2(N-1),)."""
    rate = modulation_rate(factors, problem.luminance, problem.curves.durations)[:-1]
    allowed = allowed_rate(factors, problem.luminance, problem.rate_limit)[:-1]
    return np.concatenate([allowed - rate, allowed + rate])


def _slack_slope(problem: Problem, factors: Array) -> Array:
    """Return the derivative of the slack, (2(N-1), N)."""
    n = len(factors)
    seen = factors * problem.luminance
    nudge = 1e-5 * np.maximum(seen, 1e-6)
    limit = problem.rate_limit(seen)
    gain = (problem.rate_limit(seen + nudge) - limit) / nudge * problem.luminance
    step = np.arange(n - 1)
    end = np.where(limit[:-1] <= limit[1:], step, step + 1)
    allowed = np.zeros((n - 1, n))
    allowed[step, end] = gain[end]
    speed = step_luminance(problem.luminance) / problem.curves.durations[:-1]
    rate = np.zeros((n - 1, n))
    rate[step, step], rate[step, step + 1] = -speed, speed
    return np.concatenate([allowed - rate, allowed + rate])

"""The optimization of a brightness track (Eq. 6): the problem, its answer, and the seam for solvers.

`pose` makes a `Problem` of loss curves and a `Request`; `optimize` gives it to a solver and checks the
answer. Several clips can share one budget: their curves are joined, and no step is seen between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.loss_bends import LossBends
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves
from evenlight.method.choices import LimitCurve, ModulatedLuminance
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.optimizer.objective import SPREAD, Objective, pairwise_spread
from evenlight.method.optimizer.request import Request, budget_as_factor, frame_weights, step_allowances
from evenlight.method.rate_limit import (
    RateLimitFunction,
    allowed_rate,
    largest_rate_ratio,
    modulation_rate,
    rate_limit_at,
    step_luminance,
)

BUDGET_TOLERANCE = 1e-9  # mean factor; the lower bound covers every track within it
RATE_TOLERANCE = 1e-6  # share of the limit; the lower bound covers far more


@dataclass(frozen=True, slots=True)
class Problem:
    """The problem that a solver gets: find factors b that minimize the objective."""

    # contrast loss of each of N frames over the factor; the first knot is the lowest factor allowed
    curves: LossCurves
    budget_weights: Array  # (N,): share that each frame's factor has in the budget; they add up to 1
    # the budget: Σ budget_weights · b must equal it. Constant dimming by it uses the same power.
    baseline_factor: float
    luminance: Array  # (N,): Ī, the luminance at factor 1 that the rate limit is about [cd/m^2]
    rate_limit: RateLimitFunction  # ΔL [cd/m^2/s] as a function of the luminance b·Ī [cd/m^2]
    # (N,): ω, how much each frame counts in the objective, 1 on average; None where all count alike
    importance: Array | None = None
    # (N-1,): how many times the rate limit each step may reach, infinite where it is free; None where all may
    # reach just that
    allowances: Array | None = None
    minimized: Objective = SPREAD  # of the losses: the spread, or another objective

    @property
    def lowest_factor(self) -> float:
        """Lower bound of every factor; the upper one is 1."""
        return float(self.curves.factors[0])

    def baseline(self) -> Array:
        """Return constant dimming at equal power."""
        return np.full(self.curves.n_frames, self.baseline_factor)

    def loss(self, factors: Array) -> Array:
        """Return the contrast loss of each frame, (N,)."""
        return loss_and_slope(self.curves, factors)[0]

    def objective(self, factors: Array) -> float:
        """Return what is minimized; unless another objective is asked for, the spread."""
        return self.value(self.loss(factors))

    def value(self, loss: Array) -> float:
        """Return what is minimized, of given losses."""
        return self.minimized.value(loss, self.importance)

    def size(self) -> float:
        """Return how many times the objective is what the dual variables are about, times N."""
        return self.minimized.size(self.frame_importance())

    def spread(self, loss: Array) -> float:
        """Return the mean absolute pairwise difference of given losses."""
        return pairwise_spread(loss, self.importance)

    @property
    def leaves_a_choice(self) -> bool:
        """Whether tracks can differ: there are several frames, and not all are as good."""
        return self.curves.n_frames > 1 and self.size() > 0

    def frame_importance(self) -> Array:
        """Return ω, how much each frame counts, (N,)."""
        return np.ones(self.curves.n_frames) if self.importance is None else self.importance

    def allowed_rate(self, factors: Array) -> Array:
        """Return the largest rate allowed from each frame to the next [cd/m^2/s], (N,)."""
        return allowed_rate(factors, self.luminance, self.rate_limit, self.allowances)

    def step_reach(self) -> Array:
        """Return the change of the factor per rate limit of each step; infinite where it is free, (N-1,).

        A step between two frames without light changes nothing, and is free.
        """
        middle = step_luminance(self.luminance)
        reach = np.full(len(middle), np.inf)
        with np.errstate(over="ignore"):  # next to no light
            np.divide(self.curves.durations[:-1], middle, out=reach, where=middle > 0)
        return reach if self.allowances is None else _product(reach, self.allowances)

    def budget_error(self, factors: Array) -> float:
        """Return by how much the factors use more than the budget, as a mean factor."""
        return float(self.budget_weights @ factors) - self.baseline_factor

    def rate_ratio(self, factors: Array) -> float:
        """Return the largest ratio of a step's rate to its limit."""
        rate = modulation_rate(factors, self.luminance, self.curves.durations)
        return largest_rate_ratio(rate, self.allowed_rate(factors))


def _product(reach: Array, allowances: Array) -> Array:
    """Return how far a step goes per rate limit with its allowance: what is free stays free."""
    free = np.isinf(reach) | np.isinf(allowances)
    return np.where(free, np.inf, np.where(free, 1.0, reach) * np.where(free, 1.0, allowances))


@dataclass(frozen=True, slots=True)
class Solution:
    """What a solver answers."""

    factors: Array  # (N,): b; budget, rate limit and bounds are met
    iterations: int  # that the solver took
    # (N,): dual variable: how much the objective (times its size, divided by N; of the spread, the sum over
    # pairs / N) rises with each frame's loss. It lies in the objective's set of weights / N (or near it): of
    # the spread, the permutahedron of the order weights. So it gives a lower bound.
    frame_weights: Array | None = None
    # dual variable of the budget: how much that objective falls per unit of the mean factor
    budget_price: float = 0.0


class Solver(Protocol):
    """A way to solve the problem."""

    def solve(self, problem: Problem) -> Solution:
        """Return a feasible answer no worse than the constant baseline; `InputError` if it cannot."""


def pose(curves: LossCurves, request: Request, joints: Sequence[int] = ()) -> Problem:
    """Return the problem that a request poses on the loss curves of a video.

    Parameters
    ----------
    curves : LossCurves
        Of N frames.
    request : Request
        What is asked.
    joints : sequence of int
        Frames that begin another clip, where several share the budget.

    Raises
    ------
    InputError
        If no factors within the curves' range can meet the budget, which says which budgets can be met; if
        sections do not fit the video.
    """
    factor, weights = budget_as_factor(curves, request)
    if request.modulated is ModulatedLuminance.FRAME_MEAN:
        luminance = curves.mean_luminance
    else:
        luminance = np.full(curves.n_frames, curves.display.peak_luminance)
    limit = partial(_limit_of_emitted, request.limit, request.limit_curve, curves.display.reflected_luminance)
    importance = frame_weights(curves, request.weights)
    allowances = step_allowances(curves, request.allowances, joints)
    return Problem(curves, weights, factor, luminance, limit, importance, allowances, request.minimized)


def _limit_of_emitted(limit: RateLimit, curve: LimitCurve, reflected: float, emitted: Array) -> Array:
    return rate_limit_at(limit, emitted + reflected, curve)


def optimize(problem: Problem, solver: Solver) -> Solution:
    """Return the solver's answer, once it is checked to be one: budget, rate limit, bounds, baseline.

    Raises
    ------
    InputError
        If the solver refuses the problem.
    RuntimeError
        If the answer breaks a constraint or is worse than constant dimming: a defect of the solver.
    """
    solution = solver.solve(problem)
    broken = broken_constraints(problem, solution.factors)
    if broken:
        raise RuntimeError(f"the solver {type(solver).__name__} broke: {', '.join(broken)}")
    return solution


def broken_constraints(problem: Problem, factors: Array) -> list[str]:
    """Return the names of the constraints that an answer breaks: budget, rate limit, bounds, baseline."""
    kept = {
        "budget": abs(problem.budget_error(factors)) <= BUDGET_TOLERANCE,
        "rate limit": problem.rate_ratio(factors) <= 1 + RATE_TOLERANCE,
        "bounds": factors.min() >= problem.lowest_factor - 1e-12 and factors.max() <= 1 + 1e-12,
        "baseline": problem.objective(factors) <= problem.objective(problem.baseline()) + 1e-12,
    }
    return [name for name, is_kept in kept.items() if not is_kept]


def is_feasible(problem: Problem, factors: Array) -> bool:
    """Return whether factors meet budget, rate limit (to a thousandth of its tolerance) and bounds."""
    return (
        abs(problem.budget_error(factors)) <= BUDGET_TOLERANCE
        and problem.rate_ratio(factors) <= 1 + RATE_TOLERANCE / 1000
        and bool(factors.min() >= problem.lowest_factor - 1e-12)
        and bool(factors.max() <= 1 + 1e-12)
    )


def feasible_blend(problem: Problem, factors: Array) -> Array:
    """Return the factors, drawn towards the constant baseline just as far as the rate limit demands.

    The baseline moves at no rate and the budget is linear, so every blend of the two meets the budget, and
    some blend meets the rate limit.
    """
    baseline = problem.baseline()
    share = 1.0
    blend = factors
    for _ in range(100):
        ratio = problem.rate_ratio(blend)
        if ratio <= 1 + 1e-12:
            return blend
        share *= min(1 / ratio, 1 - 1e-12) if np.isfinite(ratio) else 0.0
        blend = baseline + share * (factors - baseline)
    return baseline


def joined_curves(clips: Sequence[LossCurves]) -> LossCurves:
    """Return the loss curves of clips shown one after the other.

    Raises
    ------
    InputError
        If they were made for different displays or factors.
    """
    first = clips[0]
    for other in clips[1:]:
        if other.display != first.display or not np.array_equal(other.factors, first.factors):
            raise InputError(
                f"{other.video} and {first.video} cannot share a budget: their loss curves are for different "
                f"displays, pixels per degree or factors"
            )
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(clip, name) for clip in clips])
        for name, shape in ARRAY_SHAPES.items()
        if shape[0] == "N"
    }
    start, times = 0.0, []
    for clip in clips:
        times.append(clip.times - clip.times[0] + start)
        start = float(times[-1][-1] + clip.durations[-1])
    arrays["times"] = np.concatenate(times)
    bends = [clip.bends for clip in clips if clip.bends is not None]
    arrays["bends"] = LossBends.joined(bends) if len(bends) == len(clips) else None
    return replace(first, video=" + ".join(clip.video for clip in clips), **arrays)


def joints(clips: Sequence[LossCurves]) -> list[int]:
    """Return the first frame of every clip but the first."""
    return [int(end) for end in np.cumsum([clip.n_frames for clip in clips])[:-1]]


def clip_of(problem: Problem, clip: LossCurves, first: int) -> Problem:
    """Return the part of a problem that is about one clip, for its track: its budget is not its own.

    Parameters
    ----------
    problem : Problem
        Of all clips.
    clip : LossCurves
        The clip's own.
    first : int
        Its first frame among all.
    """
    frames = slice(first, first + clip.n_frames)
    allowances, weights = problem.allowances, problem.budget_weights[frames]
    if not weights.sum() > 0:  # black throughout, on a panel that then uses nothing
        weights = clip.durations
    return replace(
        problem,
        curves=clip,
        budget_weights=weights / weights.sum(),
        luminance=problem.luminance[frames],
        importance=None if problem.importance is None else problem.importance[frames],
        allowances=None if allowances is None else allowances[first : first + clip.n_frames - 1],
    )

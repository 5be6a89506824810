"""The optimization of a brightness track (Eq. 6): the problem, its answer, and the seam for solvers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.brightness_track import BudgetUnit
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.loss_curves import LossCurves
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.section import AllowanceSection, WeightSection
from evenlight.method.choices import LimitCurve, ModulatedLuminance
from evenlight.method.curve_lookup import loss_and_slope
from evenlight.method.modulation import (
    RateLimitFunction,
    allowed_rate,
    largest_rate_ratio,
    modulation_rate,
    step_luminance,
)
from evenlight.method.objective import pairwise_spread
from evenlight.method.power import power_per_factor
from evenlight.method.rate_limit import rate_limit_at
from evenlight.method.sections import frame_weights, step_allowances

BUDGET_TOLERANCE = 1e-9  # mean factor; the lower bound covers every track within it
RATE_TOLERANCE = 1e-6  # share of the limit; the lower bound covers far more


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of the optimizer, beside the video.

    Attributes
    ----------
    budget : float
        In `budget_unit`.
    budget_unit : BudgetUnit
        Mean factor, share of the power at full brightness, or watt.
    power_model : PowerModel
        Of the panel.
    rate_limit : RateLimit
        ΔL(L), fitted on the curves' display.
    limit_curve : LimitCurve
        The fitted curve, or the lower edge of its band.
    modulated : ModulatedLuminance
        Whose luminance the rate limit is about.
    weights : tuple of WeightSection
        Sections that count more or less than others.
    allowances : tuple of AllowanceSection
        Sections in which brightness may change faster than the rate limit, or not at all.
    """

    budget: float
    budget_unit: BudgetUnit
    power_model: PowerModel
    rate_limit: RateLimit
    limit_curve: LimitCurve = LimitCurve.FITTED
    modulated: ModulatedLuminance = ModulatedLuminance.FRAME_MEAN
    weights: tuple[WeightSection, ...] = ()
    allowances: tuple[AllowanceSection, ...] = ()


@dataclass(frozen=True, slots=True)
class Problem:
    """The problem that a solver gets: find factors b that minimize the spread of contrast loss.

    Attributes
    ----------
    curves : LossCurves
        Contrast loss of each of N frames over the factor; the first knot is the lowest factor allowed.
    budget_weights : array, (N,)
        Share that each frame's factor has in the budget; they add up to 1.
    baseline_factor : float
        The budget: Σ budget_weights · b must equal it. Constant dimming by it uses the same power.
    luminance : array, (N,)
        Ī, the luminance at factor 1 that the rate limit is about [cd/m^2].
    rate_limit : function
        ΔL [cd/m^2/s] as a function of the luminance b·Ī [cd/m^2].
    importance : array, (N,), or None
        ω, how much each frame counts in the objective, 1 on average; None where all count alike.
    allowances : array, (N-1,), or None
        How many times the rate limit each step may reach, infinite where it is free; None where all may
        reach just that.
    """

    curves: LossCurves
    budget_weights: Array
    baseline_factor: float
    luminance: Array
    rate_limit: RateLimitFunction
    importance: Array | None = None
    allowances: Array | None = None

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
        """Return the mean absolute pairwise difference of contrast loss."""
        return self.spread(self.loss(factors))

    def spread(self, loss: Array) -> float:
        """Return the mean absolute pairwise difference of given losses."""
        return pairwise_spread(loss, self.importance)

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
    """What a solver answers.

    Attributes
    ----------
    factors : array, (N,)
        b; budget, rate limit and bounds are met.
    iterations : int
        That the solver took.
    frame_weights : array, (N,) or None
        Dual variable: how much the objective (as a sum over pairs, divided by N) rises with each frame's
        loss. It lies in the permutahedron of the order weights / N (or near it), and so gives a lower bound.
    budget_price : float
        Dual variable of the budget: how much that objective falls per unit of the mean factor.
    """

    factors: Array
    iterations: int
    frame_weights: Array | None = None
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
    limit = partial(
        _limit_of_emitted, request.rate_limit, request.limit_curve, curves.display.reflected_luminance
    )
    importance = frame_weights(curves, request.weights)
    allowances = step_allowances(curves, request.allowances, joints)
    return Problem(curves, weights, factor, luminance, limit, importance, allowances)


def _limit_of_emitted(limit: RateLimit, curve: LimitCurve, reflected: float, emitted: Array) -> Array:
    """Return ΔL at the luminance seen: what the display emits plus what it reflects."""
    return rate_limit_at(limit, emitted + reflected, curve)


def budget_as_factor(curves: LossCurves, request: Request) -> tuple[float, Array]:
    """Return the constant factor that meets the budget, and each frame's share in the budget.

    Every budget is linear in the factors, so all units become one: Σ weights · b = factor. Averages are over
    time, which is the paper's average over frames where all last equally long.

    Raises
    ------
    InputError
        If that factor lies outside the curves' range.
    """
    require_possible(request, float(curves.factors[0]))
    time_share = curves.durations / curves.durations.sum()
    slope = power_per_factor(request.power_model, curves.channel_means)
    mean_slope, base = float(time_share @ slope), request.power_model.base_power
    if request.budget_unit is BudgetUnit.FACTOR:
        scale, offset, weights = 1.0, 0.0, time_share
    else:
        if not mean_slope > 0:
            raise InputError("the video is black throughout: dimming an OLED panel saves no power on it")
        scale, offset = mean_slope, base
        if request.budget_unit is BudgetUnit.POWER:
            scale, offset = mean_slope / (mean_slope + base), base / (mean_slope + base)
        weights = time_share * slope / mean_slope
    low, high = offset + scale * float(curves.factors[0]), offset + scale
    _require_between(request, (low, high), float(curves.factors[0]))
    factor = (request.budget - offset) / scale
    return min(max(factor, float(curves.factors[0])), 1.0), weights


def require_possible(request: Request, lowest_factor: float) -> None:
    """Raise `InputError` if no video at all could meet the budget, so that none is analysed in vain.

    Parameters
    ----------
    request : Request
        With the budget.
    lowest_factor : float
        Lowest brightness factor allowed.
    """
    model, unit = request.power_model, request.budget_unit
    if model.kind is PanelKind.OLED:
        if unit is BudgetUnit.FACTOR:
            raise InputError(
                "--budget-unit factor says nothing of the power of an OLED panel, which depends on content: "
                "give power or watt"
            )
        _require_possible_on_oled(request, lowest_factor)
        return
    full = model.base_power + model.power_per_luminance * model.peak_luminance
    least = model.base_power + lowest_factor * (full - model.base_power)
    low, high = {
        BudgetUnit.FACTOR: (lowest_factor, 1.0),
        BudgetUnit.POWER: (least / full, 1.0),
        BudgetUnit.WATT: (least, full),
    }[unit]
    _require_between(request, (low, high), lowest_factor)


def _require_possible_on_oled(request: Request, lowest_factor: float) -> None:
    """Raise `InputError` if no content meets the budget: black uses the base alone, white the most.

    Dimming saves the largest share on white: (base + b s) / (base + s) falls as s grows.
    """
    base = request.power_model.base_power
    white = float(power_per_factor(request.power_model, np.ones((1, 3)))[0])
    if request.budget_unit is BudgetUnit.POWER:
        _require_between(request, ((base + lowest_factor * white) / (base + white), 1.0), lowest_factor)
    elif not base < request.budget <= (base + white) * (1 + 1e-12):
        raise InputError(
            f"--budget {request.budget:g} (watt) cannot be met on any content: the panel takes {base:.4g} W "
            f"for black and up to {base + white:.4g} W for white"
        )


def _require_between(request: Request, limits: tuple[float, float], lowest_factor: float) -> None:
    """Raise `InputError` if the budget lies outside what the factors can use."""
    low, high = limits
    rounding = 1e-12 * high  # watts of any size
    if not low - rounding <= request.budget <= high + rounding:
        raise InputError(
            f"--budget {request.budget:g} ({request.budget_unit.value}) cannot be met: factors from "
            f"{lowest_factor:g} to 1 use {low:.4g} to {high:.4g}"
        )


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
    broken = broken_promises(problem, solution.factors)
    if broken:
        raise RuntimeError(f"the solver {type(solver).__name__} broke: {', '.join(broken)}")
    return solution


def broken_promises(problem: Problem, factors: Array) -> list[str]:
    """Return what an answer promises and does not hold: budget, rate limit, bounds, baseline."""
    promises = {
        "budget": abs(problem.budget_error(factors)) <= BUDGET_TOLERANCE,
        "rate limit": problem.rate_ratio(factors) <= 1 + RATE_TOLERANCE,
        "bounds": factors.min() >= problem.lowest_factor - 1e-12 and factors.max() <= 1 + 1e-12,
        "baseline": problem.objective(factors) <= problem.objective(problem.baseline()) + 1e-12,
    }
    return [name for name, kept in promises.items() if not kept]


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

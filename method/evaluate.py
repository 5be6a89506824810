"""What a brightness track does: its columns, and the figures of its summary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
    OptimizationSummary,
    TrackHeader,
)
from evenlight.data_schema.provenance import Provenance
from evenlight.method.modulation import allowed_rate, largest_rate_ratio, modulation_rate
from evenlight.method.optimize import Problem, Request
from evenlight.method.power import power

ROUNDING = 1e-10  # of a mean difference of losses, which are at most 1, summed over up to a million frames


@dataclass(frozen=True, slots=True)
class Effort:
    """How the work was done.

    Attributes
    ----------
    solve_s, curves_s : float
        Time that the optimizer took, and the loss curves [s].
    bound_s : float
        Time that the lower bound took [s].
    calm : float
        Share of the gain that could be given up for a calmer track.
    """

    solve_s: float
    curves_s: float
    bound_s: float
    calm: float = 0.0


@dataclass(frozen=True, slots=True)
class Answer:
    """What is known of the answer beside its track.

    Attributes
    ----------
    lower_bound : float
        No track within the limits has a smaller objective.
    iterations : int
        Of the solver.
    contrast_model : str
        Name of the choices that the loss curves were made with.
    clips : int
        How many clips share the budget.
    """

    lower_bound: float
    iterations: int
    contrast_model: str
    clips: int = 1


def track_of(problem: Problem, request: Request, factors: Array, header: TrackHeader) -> BrightnessTrack:
    """Return the track of the given factors, every column computed from them.

    Parameters
    ----------
    problem, request : Problem, Request
        What was to be solved.
    factors : array, (N,)
        b of each frame.
    header : TrackHeader
        What the track is for.
    """
    curves = problem.curves
    reflected = curves.display.reflected_luminance
    rate = modulation_rate(factors, problem.luminance, curves.durations)
    limit = problem.allowed_rate(factors)
    unseen = np.isinf(limit)  # the step to another clip
    own = problem.rate_limit(factors * problem.luminance)
    return BrightnessTrack(
        times=curves.times,
        factors=factors,
        contrast_loss=np.clip(problem.loss(factors), 0.0, 1.0),
        mean_luminance=factors * curves.mean_luminance + reflected,
        rate=np.where(unseen, 0.0, rate),
        rate_limit=np.where(unseen, own, limit),
        power=power(request.power_model, factors, curves.channel_means),
        header=header,
    )


def summarize(
    problem: Problem, request: Request, answer: Answer, track: BrightnessTrack, effort: Effort
) -> OptimizationSummary:
    """Return the figures of an optimization, from the finished track.

    Parameters
    ----------
    problem, request : Problem, Request
        What was to be solved.
    answer : Answer
        What the solver found.
    track : BrightnessTrack
        The answer's track.
    effort : Effort
        How the work was done.

    Raises
    ------
    RuntimeError
        If the lower bound is above the objective, by more than rounding: a defect of one of the two.
    """
    curves, header = problem.curves, track.header
    share = curves.durations / curves.durations.sum()
    baseline, objective = problem.baseline(), problem.spread(track.contrast_loss)
    baseline_power = power(request.power_model, baseline, curves.channel_means)
    full_power = float(share @ power(request.power_model, np.ones_like(baseline), curves.channel_means))
    mean_power, mean_factor = float(share @ track.power), float(share @ track.factors)
    achieved = {
        BudgetUnit.FACTOR: mean_factor,
        BudgetUnit.POWER: mean_power / full_power if full_power > 0 else 1.0,  # as with any base power
        BudgetUnit.WATT: mean_power,
    }
    origin: Provenance = header.provenance
    return OptimizationSummary(
        video=header.video,
        display=header.display_name,
        rate_limit=header.rate_limit,
        power_model=header.power_model,
        frames=curves.n_frames,
        duration=float(curves.durations.sum()),
        budget=request.budget,
        budget_unit=request.budget_unit,
        achieved=achieved[request.budget_unit],
        objective=objective,
        objective_baseline=problem.objective(baseline),
        lower_bound=_below(objective, answer.lower_bound),
        max_rate_ratio=largest_rate_ratio(track.rate, track.rate_limit),
        mean_contrast_loss=float(share @ track.contrast_loss),
        mean_contrast_loss_baseline=float(share @ problem.loss(baseline)),
        mean_factor=mean_factor,
        baseline_factor=problem.baseline_factor,
        mean_power=mean_power,
        baseline_power=float(share @ baseline_power),
        full_power=full_power,
        limit_curve=request.limit_curve.value,
        modulated=request.modulated.value,
        lowest_factor=problem.lowest_factor,
        pixels_per_degree=curves.display.pixels_per_degree,
        contrast_model=answer.contrast_model,
        simulated=request.rate_limit.simulated,
        rate_limit_procedure=request.rate_limit.procedure,
        frames_without_contrast=int(np.count_nonzero(curves.visible_contrast == 0)),
        solver=header.solver,
        iterations=answer.iterations,
        calm=effort.calm,
        solve_s=effort.solve_s,
        curves_s=effort.curves_s,
        bound_s=effort.bound_s,
        seed=origin.seed,
        versions={"evenlight": origin.software_version, **origin.versions},
        provenance=origin,
        curves_tolerance=curves.tolerance,
        counted=float(np.mean(curves.counted)),
        curves_computed_on=curves.computed_on,
        clips=answer.clips,
        weighted=problem.importance is not None and bool(np.ptp(problem.importance) > 0),
        largest_allowance=_largest_allowance(problem),
        max_rate_ratio_fitted=largest_rate_ratio(
            track.rate, limit_without_allowances(problem, track.factors)
        ),
    )


def limit_without_allowances(problem: Problem, factors: Array) -> Array:
    """Return the largest rate from each frame to the next by the rate limit alone [cd/m^2/s], (N,)."""
    return allowed_rate(factors, problem.luminance, problem.rate_limit)


def _largest_allowance(problem: Problem) -> float:
    """Return how many times the rate limit the most generous step may reach that is seen."""
    if problem.allowances is None:
        return 1.0
    return float(problem.allowances[np.isfinite(problem.allowances)].max(initial=0.0))


def _below(objective: float, bound: float) -> float:
    """Return the lower bound, once it is checked to be one; it may be above the objective by rounding."""
    if bound > objective + ROUNDING:
        raise RuntimeError(
            f"the lower bound {bound:.12g} is above the objective {objective:.12g} of an answer that exists"
        )
    return min(bound, objective)

"""What becomes of an answer: a calmer track, its columns, and the figures of its summary.

The optimum follows every flicker of the measured contrast loss as far as the rate limit lets it. Of the
tracks that keep most of the gain, the calmest is wanted: one that runs straight wherever it may. A string
pulled tight through a tube about the optimum is the shortest path within it; the tube is as wide as the gain
allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
    OptimizationSummary,
    TrackHeader,
)
from evenlight.method.optimizer.chain import linearized_limits, nearest_within_budget
from evenlight.method.optimizer.optimize import Problem, feasible_blend, is_feasible
from evenlight.method.optimizer.request import Request
from evenlight.method.power import power
from evenlight.method.rate_limit import allowed_rate, largest_rate_ratio, modulation_rate

ROUNDING = 1e-10  # of a mean difference of losses, which are at most 1, summed over up to a million frames
RADII = 0.128 * 0.5 ** np.arange(10.0)  # of the tube, as differences of factors, widest first


@dataclass(frozen=True, slots=True)
class RunRecord:
    """How the work was done."""

    solve_s: float  # time that the optimizer took [s]
    curves_s: float  # time that the loss curves took [s]
    bound_s: float  # time that the lower bound took [s]
    calm: float = 0.0  # share of the gain that could be given up for a calmer track
    pixel_aspect: float = 1.0  # width of the pixels of the video's file over their height


@dataclass(frozen=True, slots=True)
class SolverAnswer:
    """What is known of the answer beside its track."""

    lower_bound: float  # no track within the limits has a smaller objective
    iterations: int  # of the solver
    contrast_model: str  # name of the choices that the loss curves were made with
    clips: int = 1  # how many clips share the budget


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
    problem: Problem, request: Request, answer: SolverAnswer, track: BrightnessTrack, effort: RunRecord
) -> OptimizationSummary:
    """Return the figures of an optimization, from the finished track.

    Parameters
    ----------
    problem, request : Problem, Request
        What was to be solved.
    answer : SolverAnswer
        What the solver found.
    track : BrightnessTrack
        The answer's track.
    effort : RunRecord
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
        field_of_view=header.field_of_view,
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
        wide_band_accepted=header.wide_band_accepted,
        pixel_aspect=effort.pixel_aspect,
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

"""What becomes of an answer: the columns of its track, and the figures of its summary."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
    TrackHeader,
    WatchedTrack,
)
from evenlight.data_schema.tracks.optimization_summary import MinimizedOutcome, OptimizationSummary
from evenlight.method.choices import ObjectiveName
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.detectability import watched
from evenlight.method.optimizer.lower_bound import checked_bound
from evenlight.method.optimizer.optimize import Problem
from evenlight.method.optimizer.request import Request
from evenlight.method.power import power
from evenlight.method.rate_limit import allowed_rate, largest_rate_ratio, modulation_rate, rate_limit_at

AT_LIMIT, NEAR_LIMIT = 0.99, 0.9  # shares of the limit from which on a rate counts as at it, or near it
STANDSTILL = 1e-9  # steps of the factor below this are rounding
LEAST_LIMIT = 1e-12  # [cd/m^2/s] where next to nothing is allowed


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

    lower_bound: float  # no track within the limits has less of what is minimized
    iterations: int  # of the solver
    contrast_model: str  # name of the choices that the loss curves were made with
    clips: int = 1  # how many clips share the budget
    minimized: MinimizedOutcome | None = None  # the worst of several measures, where that was minimized
    by_measure: tuple[MinimizedOutcome, ...] = ()  # each of them


def no_worse_than_constant(problem: Problem, *tracks: Array) -> Array:
    """Return the first track that is no worse than constant dimming by its published losses, or the latter.

    A solver knows curves between knots by straight lines: where little can be gained, that may mislead it.
    """
    constant = problem.value(loss_at(problem.curves, problem.baseline()))
    good = (track for track in tracks if problem.value(loss_at(problem.curves, track)) <= constant)
    return next(good, problem.baseline())


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
        contrast_loss=np.clip(loss_at(curves, factors), 0.0, 1.0),
        mean_luminance=factors * curves.mean_luminance + reflected,
        rate=np.where(unseen, 0.0, rate),
        rate_limit=np.where(unseen, own, limit),
        power=None
        if request.power_model is None
        else power(request.power_model, factors, curves.channel_means),
        header=replace(header, watched=watched_track(problem, request, factors)),
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
    curves, header, battery = problem.curves, track.header, request.battery
    share = curves.durations / curves.durations.sum()
    baseline, objective = problem.baseline(), problem.spread(track.contrast_loss)
    baseline_loss = loss_at(curves, baseline)
    minimized, value = problem.minimized, problem.value(track.contrast_loss)
    # The bound is of curves that are linear between knots, as the solver has them.
    bound = min(checked_bound(answer.lower_bound, problem.objective(track.factors)), value)
    outcome = answer.minimized
    if minimized.name is not ObjectiveName.SPREAD:
        outcome = MinimizedOutcome(minimized.name.value, value, problem.value(baseline_loss), bound)
    mean_factor, mean_power = float(share @ track.factors), None
    baseline_power = full_power = None
    achieved = {BudgetUnit.FACTOR: mean_factor}
    if request.power_model is not None:
        mean_power, baseline_power, full_power = (
            float(share @ power(request.power_model, factors, curves.channel_means))
            for factors in (track.factors, baseline, np.ones_like(baseline))
        )
        achieved[BudgetUnit.POWER] = mean_power / full_power if full_power > 0 else 1.0  # with any base power
        achieved[BudgetUnit.WATT] = mean_power
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
        objective_baseline=problem.spread(baseline_loss),
        lower_bound=min(bound, objective) if minimized.name is ObjectiveName.SPREAD else 0.0,
        max_rate_ratio=largest_rate_ratio(track.rate, track.rate_limit),
        mean_contrast_loss=float(share @ track.contrast_loss),
        mean_contrast_loss_baseline=float(share @ baseline_loss),
        mean_factor=mean_factor,
        baseline_factor=problem.baseline_factor,
        mean_power=mean_power,
        baseline_power=baseline_power,
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
        curves_computed_on=curves.computed_on,
        clips=answer.clips,
        weighted=problem.importance is not None and bool(np.ptp(problem.importance) > 0),
        largest_allowance=_largest_allowance(problem),
        max_rate_ratio_fitted=largest_rate_ratio(
            track.rate, limit_without_allowances(problem, track.factors)
        ),
        wide_band_accepted=header.wide_band_accepted,
        pixel_aspect=effort.pixel_aspect,
        film=header.film,
        minimized=outcome,
        level_weight=minimized.level_weight,
        by_measure=answer.by_measure,
        share_at_limit=time_share_from(AT_LIMIT, track, curves.durations),
        share_near_limit=time_share_from(NEAR_LIMIT, track, curves.durations),
        reversals_per_s=reversals(track.factors) / float(curves.durations.sum()),
        worst_contrast_loss=float(track.contrast_loss.max()),
        worst_contrast_loss_baseline=max(float(baseline_loss.max()), 0.0),
        battery_capacity=battery,
        battery_life=battery / mean_power if battery and mean_power else None,
        battery_life_full=battery / full_power if battery and full_power else None,
        noticed=header.noticed,
        watched=header.watched,
    )


def time_share_from(part: float, track: BrightnessTrack, durations: Array) -> float:
    """Return the share of the time in which a track changes at a part of its rate limit, or faster.

    Parameters
    ----------
    part : float
        Of the limit, above 0.
    track : BrightnessTrack
        N frames.
    durations : array, (N,)
        How long each frame is shown [s].
    """
    speed = np.abs(track.rate)
    at = (speed > 0) & (speed >= part * track.rate_limit)
    return float(durations[at].sum() / durations.sum())


def reversals(factors: Array) -> int:
    """Return how often factors turn from rising to falling or back, however long they stood still between.

    >>> reversals(np.array([0.5, 0.6, 0.6, 0.5, 0.4, 0.5]))
    2
    """
    steps = np.diff(factors)
    signs = np.sign(steps[np.abs(steps) > STANDSTILL])
    return int(np.count_nonzero(signs[1:] != signs[:-1]))


def watched_track(problem: Problem, request: Request, factors: Array) -> WatchedTrack | None:
    """Return how well a track's changes are noticed, by the fitted limit whatever was asked or obeyed.

    As `track_of`; None if the limit's calibration does not tell.
    """
    durations, reflected = problem.curves.durations, problem.curves.display.reflected_luminance
    fitted = allowed_rate(
        factors, problem.luminance, lambda emitted: rate_limit_at(request.rate_limit, emitted + reflected)
    )
    rate = modulation_rate(factors, problem.luminance, durations)
    moving = (rate != 0) & ~np.isinf(problem.allowed_rate(factors))  # the step to another clip is unseen
    ratios = np.divide(rate, np.maximum(fitted, LEAST_LIMIT), out=np.zeros_like(fitted), where=moving)
    return watched(request.rate_limit, ratios, durations)


def limit_without_allowances(problem: Problem, factors: Array) -> Array:
    """Return the largest rate from each frame to the next by the rate limit alone [cd/m^2/s], (N,)."""
    return allowed_rate(factors, problem.luminance, problem.rate_limit)


def _largest_allowance(problem: Problem) -> float:
    if problem.allowances is None:
        return 1.0
    return float(problem.allowances[np.isfinite(problem.allowances)].max(initial=0.0))

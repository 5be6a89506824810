"""From a video and a target loss to what the online controller does with it (Section 6)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.loss_spread import SpreadRatio, spread_ratio
from evenlight.analysis.tracks.optimization_job import OptimizationJob, track_header
from evenlight.analysis.tracks.other_measures import with_other_measures
from evenlight.analysis.tracks.track_figure import DrawnTrack
from evenlight.analysis.tracks.track_words import lost
from evenlight.analysis.wording import percent
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit
from evenlight.data_schema.tracks.control import LOOKAHEAD, ONLINE
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import ControlSummary, OptimizationSummary
from evenlight.method.choices import ModulatedLuminance
from evenlight.method.contrast.curve_lookup import loss_and_slope, loss_at
from evenlight.method.online import governor
from evenlight.method.online.control_curves import ControlledTrack, control_ahead, control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.gain import gain_warning
from evenlight.method.online.lookahead import LookaheadSettings
from evenlight.method.optimizer.evaluate import RunRecord, SolverAnswer, summarize, track_of
from evenlight.method.optimizer.optimize import Problem
from evenlight.method.power import power, power_per_factor
from evenlight.method.rate_limit import rate_limit_at, scalar_rate_limit
from evenlight.stimuli.video.square_pixels import pixel_aspect

MUCH_OUT_OF_REACH = 0.5  # of the time: beyond, a target says more of the bounds than of the video


@dataclass(frozen=True, slots=True)
class ControlJob:
    """What is asked of the controller."""

    work: OptimizationJob  # the video, the display, the rate limit and the power model
    settings: ControllerSettings  # target, gains and bounds
    start_factor: float | None = None  # b of the first frame; None: where it has the target loss
    budget: governor.GovernorSettings | None = None  # for the target to follow
    # if not, the first one is what the first frame loses where it meets the budget
    target_is_given: bool = True
    # how much of what is to come is known; None: the PID controller
    lookahead: LookaheadSettings | None = None


def control_video(
    curves: LossCurves, asked: ControlJob, samples: FrameSamples, curves_s: float
) -> tuple[DrawnTrack, float | None, tuple[str, ...]]:
    """Return what the controller does with a video whose loss curves took some time [s].

    Its track beside constant dimming by the mean factor; how many times as much its loss varies; what is
    wrong with the horizon of the budget or the target, or if nothing is gained.
    """
    video = _ControlledVideo(curves, asked)
    began = time.perf_counter()
    run = video.run(asked.lookahead)
    track, summary = video.evaluated(run, RunRecord(time.perf_counter() - began, curves_s, 0.0))
    loss, spread = video.beside_constant(run)
    summary = replace(summary, control=video.control_summary(run, spread))
    summary = with_other_measures(summary, track, samples.held, curves, asked.work)
    drawn = DrawnTrack(track, summary, loss, samples.few)
    return drawn, spread.ratio, tuple(video.warnings(run, spread.ratio))


class _ControlledVideo:
    """The loss curves of a video, and what the controller is to do over them."""

    def __init__(self, curves: LossCurves, asked: ControlJob) -> None:
        self.curves, self.asked, self.settings, self.start = curves, asked, asked.settings, asked.start_factor
        request, reflected = asked.work.request, curves.display.reflected_luminance
        self._limit = scalar_rate_limit(request.limit, reflected, request.limit_curve)
        white = request.modulated is ModulatedLuminance.WHITE_FIELD
        self.luminance = (
            np.full(curves.n_frames, curves.display.peak_luminance) if white else curves.mean_luminance
        )
        if asked.budget is not None:
            self._require_power(asked.budget.budget_unit)
            if not asked.target_is_given:
                self._begin_with(asked.budget)

    def _require_power(self, unit: BudgetUnit) -> None:
        if unit is not BudgetUnit.FACTOR and not self._watts(np.array(1.0)).any():
            model = self.asked.work.request.panel
            raise InputError(
                f"the video is black throughout, for which the panel {model.name!r} takes no power: there is "
                "nothing to hold a budget with"
            )

    def _begin_with(self, budget: governor.GovernorSettings) -> None:
        """Take what the first frame loses where it meets the budget as the first target."""
        settings, curves, model = self.settings, self.curves, self.asked.work.request.power_model
        slope = float(power_per_factor(model, curves.channel_means[:1])[0])
        fair = governor.first_factor(budget, model, slope, (settings.lowest_factor, settings.highest_factor))
        self.start = fair if self.start is None else self.start
        target = float(loss_and_slope(curves, np.full(curves.n_frames, fair))[0][0])
        self.settings = replace(settings, target_loss=target)

    def _watts(self, factors: Array) -> Array:
        return power(self.asked.work.request.panel, factors, self.curves.channel_means)

    def run(self, ahead: LookaheadSettings | None) -> ControlledTrack:
        """Return what a controller makes of the video."""
        controller, budget = Controller(self.settings, self._limit), self.asked.budget
        model, given = self.asked.work.request.power_model, self.asked.target_is_given
        costs = None if budget is None else governor.frame_costs(self.curves, budget, model)
        if ahead is not None:
            return control_ahead(self.curves, controller, ahead, self.start, self.luminance, costs, given)
        governed = None
        if budget is not None and costs is not None:
            governed = (governor.governor_of(controller, budget), costs)
        return control_curves(self.curves, controller, self.start, self.luminance, governed)

    def beside_constant(self, run: ControlledTrack) -> tuple[Array, SpreadRatio]:
        """Return the loss at a run's mean factor throughout, and how steady the run's is beside that."""
        constant = np.full(self.curves.n_frames, min(run.mean_factor, 1.0))
        loss = loss_at(self.curves, constant)
        return loss, spread_ratio(run.contrast_loss, loss, run.durations)

    def warnings(self, run: ControlledTrack, ratio: float | None) -> Iterator[str]:
        """Say what is wrong with horizon or target; if nothing is gained, or the lookahead is of no use."""
        budget, ahead, durations = self.asked.budget, self.asked.lookahead, self.curves.durations
        warning = None
        if budget is None:
            warning = _out_of_reach(run, self.settings)
        elif ahead is None:
            warning = governor.horizon_warning(budget, float(np.median(durations)))
        yield from (words for words in (warning, gain_warning(ratio)) if words is not None)
        if ahead is None:
            return
        if 0 < ahead.seconds < (shortest := float(durations.min())):
            yield f"a lookahead of {ahead.seconds:g} s is less than one frame, {shortest:.3g} s: as 0"
        without = self.beside_constant(self.run(None))[1].ratio
        if without is not None and ratio is not None and without < ratio:
            yield (
                f"without a look ahead the loss varies {without:.2f} times as much as with constant dimming "
                f"by the mean factor, with it {ratio:.2f} times"
            )

    def control_summary(self, run: ControlledTrack, spread: SpreadRatio) -> ControlSummary:
        """Return the run in the terms of the controller."""
        budget, ahead, gains = self.asked.budget, self.asked.lookahead, self.settings
        found = ControlSummary(
            target_loss=gains.target_loss,
            final_target_loss=float(run.targets[-1]),
            proportional=None if ahead else gains.proportional,
            integral=None if ahead else gains.integral,
            derivative=None if ahead else gains.derivative,
            gain_rate=None if ahead else gains.gain_rate,
            start_factor=float(run.factors[0]),
            sd_loss=spread.sd,
            sd_loss_constant=spread.sd_constant,
            share_limited=_time_share(run, run.limited),
            lookahead=None if ahead is None else ahead.seconds,
        )
        if budget is None:
            return found
        errors = self._horizon_errors(run, budget)
        # The lookahead keeps the horizon that is asked for, however few frames it has.
        steered = (
            budget.horizon if ahead else governor.steered_horizon(budget, float(np.median(run.durations)))
        )
        return replace(
            found,
            budget=budget.budget,
            budget_unit=budget.budget_unit,
            horizon=budget.horizon,
            horizon_error=None if errors is None else errors.either_way,
            share_budget_held=_time_share(run, run.budget_held),
            horizon_excess=None if errors is None else errors.above,
            steered_horizon=steered,
        )

    def _horizon_errors(
        self, run: ControlledTrack, budget: governor.GovernorSettings
    ) -> governor.HorizonErrors | None:
        """Return how far the mean over a whole horizon is from the budget, in its unit, at most."""
        one = np.ones_like(run.factors)
        used = run.factors if budget.budget_unit is BudgetUnit.FACTOR else self._watts(run.factors)
        of = self._watts(one) if budget.budget_unit is BudgetUnit.POWER else one
        held = budget.budget, budget.horizon
        return governor.horizon_errors(np.asarray(used), of, np.asarray(run.durations), held)

    def evaluated(
        self, run: ControlledTrack, effort: RunRecord
    ) -> tuple[BrightnessTrack, OptimizationSummary]:
        """Return the track, and its summary beside constant dimming of equal mean factor."""
        curves, work, mean = self.curves, self.asked.work, min(run.mean_factor, 1.0)
        asked, reflected = work.request, curves.display.reflected_luminance
        limit = asked.limit
        if self.asked.budget is None:
            asked = replace(asked, budget=mean, budget_unit=BudgetUnit.FACTOR)
        problem = Problem(
            curves=curves,
            budget_weights=run.time_share,
            baseline_factor=mean,
            luminance=np.asarray(self.luminance),
            rate_limit=lambda light: rate_limit_at(limit, light + reflected, asked.limit_curve),
        )
        solver = ONLINE if self.asked.lookahead is None else LOOKAHEAD
        header = replace(track_header(replace(work, request=asked), curves, [curves]), solver=solver)
        track = track_of(problem, asked, np.asarray(run.factors), header)
        answer = SolverAnswer(0.0, curves.n_frames, work.model_name)  # it looks at each frame once
        effort = replace(effort, pixel_aspect=float(pixel_aspect(work.source)))
        return track, summarize(problem, asked, answer, track, effort)


def _out_of_reach(run: ControlledTrack, settings: ControllerSettings) -> str | None:
    at_bound = np.asarray(run.factors) <= settings.lowest_factor
    share = _time_share(run, at_bound & (np.asarray(run.contrast_loss) < settings.target_loss))
    if share <= MUCH_OUT_OF_REACH:
        return None
    return (
        f"the target of {lost(settings.target_loss)} is out of reach for {percent(share)} of the time: the "
        f"video loses less even at the lowest factor, {settings.lowest_factor:g}"
    )


def _time_share(run: ControlledTrack, where: NDArray[np.bool_]) -> float:
    return min(float(run.time_share @ where), 1.0)

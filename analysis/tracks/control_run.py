"""From a video and a target loss to what the online controller does with it (Section 6)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from evenlight.analysis.tracks.control_reports import (
    Outcome,
    PowerUse,
    control_summary,
    out_of_reach,
    time_share,
    tuning_report,
)
from evenlight.analysis.tracks.loss_spread import SpreadRatio, spread_ratio
from evenlight.analysis.tracks.optimization_job import OptimizationJob, track_header
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit
from evenlight.data_schema.tracks.control import LOOKAHEAD, ONLINE, ControlSummary, TargetRow, TuningReport
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.choices import ModulatedLuminance
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import (
    ControlledTrack,
    VideoGovernor,
    VideoLookahead,
    control_ahead,
    control_curves,
)
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.gain import gain_warning
from evenlight.method.online.governor import (
    GovernorSettings,
    first_factor,
    frame_costs,
    governor_of,
    horizon_warning,
)
from evenlight.method.online.lookahead import LookaheadSettings
from evenlight.method.online.tuning import tune
from evenlight.method.optimizer.evaluate import RunRecord, SolverAnswer, summarize, track_of
from evenlight.method.optimizer.optimize import Problem
from evenlight.method.power import power_per_factor
from evenlight.method.rate_limit import rate_limit_at, scalar_rate_limit
from evenlight.stimuli.video.square_pixels import pixel_aspect


@dataclass(frozen=True, slots=True)
class ControlJob:
    """What is asked of the controller.

    Attributes
    ----------
    work, settings : OptimizationJob, ControllerSettings
        The video, the display, the rate limit and the power model; target, gains and bounds.
    start_factor : float or None
        b of the first frame; None: where it has the target loss.
    budget : GovernorSettings or None
        A budget for the target to follow.
    target_is_given : bool
        Whether the target was asked for; if not, the first one is what the first frame loses where it meets
        the budget.
    tuned : bool
        Whether to choose the gains for this video; the search leaves a budget aside.
    sweep : tuple of float
        Targets to try, without a budget.
    lookahead : LookaheadSettings or None
        How much of what is to come is known; None: the PID controller.
    """

    work: OptimizationJob
    settings: ControllerSettings
    start_factor: float | None = None
    budget: GovernorSettings | None = None
    target_is_given: bool = True
    tuned: bool = False
    sweep: tuple[float, ...] = ()
    lookahead: LookaheadSettings | None = None


@dataclass(frozen=True, slots=True)
class ControlResult:
    """What came of it.

    Attributes
    ----------
    settings : ControllerSettings
        With the gains and the first target that were used.
    display : Display
        At the pixels per degree of the analysis.
    run, track : ControlledTrack, BrightnessTrack
        The controller's factors, and where it was held back; the same, as a track to be played.
    summary, control : OptimizationSummary, ControlSummary
        In the terms of the optimizer, and in those of the controller.
    spread : SpreadRatio
        How steady the loss is beside that of constant dimming.
    baseline_loss : array, (N,)
        Of constant dimming by the mean factor.
    tuning, tuning_runs : TuningReport or None, (ControlledTrack, ControlledTrack) or None
        If the gains were tuned; with the gains before and after that, at the first target: the search leaves
        a budget aside.
    warnings : tuple of str
        What is wrong with the horizon of the budget, or with the target; that nothing is gained.
    """

    settings: ControllerSettings
    display: Display
    run: ControlledTrack
    track: BrightnessTrack
    summary: OptimizationSummary
    control: ControlSummary
    spread: SpreadRatio
    baseline_loss: Array
    tuning: TuningReport | None = None
    tuning_runs: tuple[ControlledTrack, ControlledTrack] | None = None
    warnings: tuple[str, ...] = ()


class ControlledVideo:
    """A video's loss curves, and the controller that runs over them.

    Parameters
    ----------
    curves, curves_s : LossCurves, float
        Of the video, and the time that they took [s].
    asked : ControlJob
        What is asked.
    """

    def __init__(self, curves: LossCurves, asked: ControlJob, curves_s: float = 0.0) -> None:
        self.curves, self.asked, self._curves_s = curves, asked, curves_s
        request, reflected = asked.work.request, curves.display.reflected_luminance
        self._limit = scalar_rate_limit(request.rate_limit, reflected, request.limit_curve)
        white = request.modulated is ModulatedLuminance.WHITE_FIELD
        self.luminance = (
            np.full(curves.n_frames, curves.display.peak_luminance) if white else curves.mean_luminance
        )

    def controlled(self) -> ControlResult:
        """Return what the controller does, with tuned gains if that is asked."""
        self._require_power()
        began = time.perf_counter()
        settings, start = self._start()
        given, tuned = settings, None
        if self.asked.tuned:
            tuned = tune(self.curves, self._controller(settings), start, self.luminance)
            settings = tuned.settings
        run = self._run(settings, start, ahead=self.asked.lookahead)
        track, summary = self._evaluated(run, time.perf_counter() - began)
        loss, spread = self._beside_constant(run)
        outcome, tuning, runs = Outcome(run, summary, spread), None, None
        if tuned is not None:
            both = given, settings
            runs = self._run(given, start, governs=False), self._run(settings, start, governs=False)
            tuning = tuning_report(self.curves, both, tuned, runs, outcome)
        return ControlResult(
            settings=settings,
            display=self.curves.display,
            run=run,
            track=track,
            summary=summary,
            control=control_summary(outcome, settings, self.asked.budget, self.asked.lookahead, self._use),
            spread=spread,
            baseline_loss=loss,
            tuning=tuning,
            tuning_runs=runs,
            warnings=(*self._warnings(run, settings, spread), *self._lookahead_warnings(spread)),
        )

    def sweep(self, settings: ControllerSettings) -> list[TargetRow]:
        """Return what comes of each target, with the gains of some settings."""
        rows = []
        for target in self.asked.sweep:
            at_target = replace(settings, target_loss=target)
            run = self._run(at_target, self.asked.start_factor, governs=False)
            spread = self._beside_constant(run)[1]
            rows.append(
                TargetRow(
                    target_loss=target,
                    mean_factor=min(run.mean_factor, 1.0),
                    mean_loss=float(run.time_share @ run.contrast_loss),
                    sd_loss=spread.sd,
                    sd_loss_constant=spread.sd_constant,
                    share_limited=time_share(run, run.limited),
                    mean_power=float(run.time_share @ self._use.watts(run.factors)),
                )
            )
        return rows

    @property
    def _use(self) -> PowerUse:
        """What the panel takes."""
        return PowerUse(self.asked.work.request.power_model, self.curves.channel_means)

    def _controller(self, settings: ControllerSettings) -> Controller:
        return Controller(settings, self._limit)

    def _start(self) -> tuple[ControllerSettings, float]:
        """Return the settings with the first target, and the first factor."""
        settings, start, curves = self.asked.settings, self.asked.start_factor, self.curves
        first = np.full(curves.n_frames, settings.target_loss)
        if not self.asked.target_is_given:
            fair = self._first_factor(settings)
            start = fair if start is None else start
            first = loss_and_slope(curves, np.full(curves.n_frames, fair))[0]
            settings = replace(settings, target_loss=float(first[0]))
        if start is None:
            start = float(factor_at_loss(curves, first)[0])
            start = min(max(start, settings.lowest_factor), settings.highest_factor)
        return settings, start

    def _first_factor(self, settings: ControllerSettings) -> float:
        """Return where the first frame meets the budget, with nothing known of those to come."""
        assert self.asked.budget is not None
        use = self._use
        slope = float(power_per_factor(use.model, use.channel_means[:1])[0])
        return first_factor(
            self.asked.budget, use.model, slope, (settings.lowest_factor, settings.highest_factor)
        )

    def _warnings(
        self, run: ControlledTrack, settings: ControllerSettings, spread: SpreadRatio
    ) -> tuple[str, ...]:
        """Return what is wrong with the horizon of the budget or a target that is to stay; no gain."""
        budget, warning = self.asked.budget, None
        if budget is None:
            warning = out_of_reach(run, settings)
        elif self.asked.lookahead is None:
            warning = horizon_warning(budget, float(np.median(self.curves.durations)))
        return tuple(words for words in (warning, gain_warning(spread.ratio)) if words is not None)

    def _lookahead_warnings(self, spread: SpreadRatio) -> Iterator[str]:
        """Say whether the lookahead holds no frame, and whether the PID controller is steadier."""
        ahead, shortest = self.asked.lookahead, float(self.curves.durations.min())
        if ahead is None:
            return
        if 0 < ahead.seconds < shortest:
            yield f"a lookahead of {ahead.seconds:g} s is less than one frame, {shortest:.3g} s: as 0"
        without = self._beside_constant(self._run(*self._start()))[1].ratio
        if without is not None and spread.ratio is not None and without < spread.ratio:
            yield (
                f"without --lookahead the loss varies {without:.2f} times as much as with constant dimming "
                f"by the mean factor, with it {spread.ratio:.2f} times"
            )

    def _beside_constant(self, run: ControlledTrack) -> tuple[Array, SpreadRatio]:
        """Return the loss at a run's mean factor throughout, and how steady the run's is beside that."""
        constant = np.full(self.curves.n_frames, min(run.mean_factor, 1.0))
        loss = loss_and_slope(self.curves, constant)[0]
        return loss, spread_ratio(run.contrast_loss, loss, run.durations)

    def _require_power(self) -> None:
        """Raise `InputError` if a power budget is asked for and the video takes no power at any factor."""
        unit = None if self.asked.budget is None else self.asked.budget.budget_unit
        if unit in (BudgetUnit.POWER, BudgetUnit.WATT) and not self._use.watts(np.array(1.0)).any():
            raise InputError(
                f"the video is black throughout, for which the panel {self._use.model.name!r} takes no "
                "power: there is nothing to hold a budget with"
            )

    def _run(
        self,
        settings: ControllerSettings,
        start: float | None,
        *,
        governs: bool = True,
        ahead: LookaheadSettings | None = None,
    ) -> ControlledTrack:
        """Return what a controller makes of the video; unless `governs`, without a budget."""
        controller, budget = self._controller(settings), self.asked.budget if governs else None
        costs = None if budget is None else frame_costs(self.curves, budget, self._use.model)
        if ahead is not None:
            looking = VideoLookahead(ahead, costs, self.asked.target_is_given)
            return control_ahead(self.curves, controller, looking, start, self.luminance)
        governed = (
            None if budget is None or costs is None else VideoGovernor(governor_of(controller, budget), costs)
        )
        return control_curves(self.curves, controller, start, self.luminance, governed)

    def _evaluated(self, run: ControlledTrack, seconds: float) -> tuple[BrightnessTrack, OptimizationSummary]:
        """Return the track, and its summary beside constant dimming of equal mean factor."""
        curves, work, mean = self.curves, self.asked.work, min(run.mean_factor, 1.0)
        asked, reflected = work.request, curves.display.reflected_luminance
        if self.asked.budget is None:
            asked = replace(asked, budget=mean, budget_unit=BudgetUnit.FACTOR)
        problem = Problem(
            curves=curves,
            budget_weights=run.time_share,
            baseline_factor=mean,
            luminance=np.asarray(self.luminance),
            rate_limit=lambda light: rate_limit_at(asked.rate_limit, light + reflected, asked.limit_curve),
        )
        solver = ONLINE if self.asked.lookahead is None else LOOKAHEAD
        header = replace(track_header(replace(work, request=asked), curves, [curves]), solver=solver)
        track = track_of(problem, asked, np.asarray(run.factors), header)
        answer = SolverAnswer(0.0, curves.n_frames, work.model_name)  # it looks at each frame once
        shape = float(pixel_aspect(work.source))
        effort = RunRecord(seconds, self._curves_s, 0.0, pixel_aspect=shape)
        return track, summarize(problem, asked, answer, track, effort)

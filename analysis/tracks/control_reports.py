"""The records of what the online controller did: how steady it was, and what the search for gains found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.tracks.loss_spread import SpreadRatio
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import ControlSummary, LoopReport, TuningReport
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.online.control_curves import ControlledTrack
from evenlight.method.online.controller import ControllerSettings
from evenlight.method.online.governor import GovernorSettings, HorizonErrors, horizon_errors, steered_horizon
from evenlight.method.online.lookahead import LookaheadSettings
from evenlight.method.online.tuning import (
    MarginRequirements,
    Margins,
    TuningResult,
    content_slopes,
    rms_error,
)
from evenlight.method.power import power

MUCH_OUT_OF_REACH = 0.5  # of the time: beyond, a target says more of the bounds than of the video


@dataclass(frozen=True, slots=True)
class Outcome:
    """A run of the controller, its summary in the optimizer's terms, and how steady it was."""

    run: ControlledTrack
    summary: OptimizationSummary
    spread: SpreadRatio


def control_summary(
    outcome: Outcome,
    settings: ControllerSettings,
    budget: GovernorSettings | None,
    ahead: LookaheadSettings | None,
    used: PowerUse,
) -> ControlSummary:
    """Return what the controller was set to, and how steady it was.

    Parameters
    ----------
    outcome, used : Outcome, PowerUse
        The run, and what the panel takes.
    settings, budget, ahead : ControllerSettings, GovernorSettings or None, LookaheadSettings or None
        Target and gains of the controller; its budget; how far it looks ahead.
    """
    run, summary, spread = outcome.run, outcome.summary, outcome.spread
    errors = None if budget is None else used.horizon_errors(run, budget)
    return ControlSummary(
        video=summary.video,
        target_loss=settings.target_loss,
        final_target_loss=float(run.targets[-1]),
        proportional=None if ahead else settings.proportional,
        integral=None if ahead else settings.integral,
        derivative=None if ahead else settings.derivative,
        gain_rate=None if ahead else settings.gain_rate,
        start_factor=float(run.factors[0]),
        mean_loss=summary.mean_contrast_loss,
        sd_loss=spread.sd,
        sd_loss_constant=spread.sd_constant,
        mean_factor=min(summary.mean_factor, 1.0),
        mean_power=summary.mean_power,
        share_limited=time_share(run, run.limited),
        provenance=summary.provenance,
        budget=None if budget is None else budget.budget,
        budget_unit=None if budget is None else budget.budget_unit,
        horizon=None if budget is None else budget.horizon,
        horizon_error=None if errors is None else errors.either_way,
        share_budget_held=None if budget is None else time_share(run, run.budget_held),
        horizon_excess=None if errors is None else errors.above,
        steered_horizon=_steered(budget, ahead, float(np.median(run.durations))),
        lookahead=None if ahead is None else ahead.seconds,
    )


def _steered(
    budget: GovernorSettings | None, ahead: LookaheadSettings | None, duration: float
) -> float | None:
    """Return the horizon that is steered by; the lookahead keeps the one asked for, however few frames."""
    if budget is None:
        return None
    return budget.horizon if ahead else steered_horizon(budget, duration)


@dataclass(frozen=True, slots=True)
class PowerUse:
    """What a panel takes while some content is shown."""

    model: PowerModel
    channel_means: Array

    def watts(self, factors: Array) -> Array:
        """Return the power of each frame at its factor [W]."""
        return power(self.model, factors, self.channel_means)

    def horizon_errors(self, run: ControlledTrack, budget: GovernorSettings) -> HorizonErrors | None:
        """Return how far the mean over a whole horizon is from the budget, in its unit, at most."""
        one = np.ones_like(run.factors)
        used, of = {
            BudgetUnit.FACTOR: (np.asarray(run.factors), one),
            BudgetUnit.POWER: (self.watts(run.factors), self.watts(one)),
            BudgetUnit.WATT: (self.watts(run.factors), one),
        }[budget.budget_unit]
        return horizon_errors(used, of, np.asarray(run.durations), (budget.budget, budget.horizon))


def tuning_report(
    curves: LossCurves,
    settings: tuple[ControllerSettings, ControllerSettings],
    tuned: TuningResult,
    runs: tuple[ControlledTrack, ControlledTrack],
    outcome: Outcome,
) -> TuningReport:
    """Return what the search for gains found.

    Settings and runs are those before and after it; the runs at a target that stays, as the search was.
    """
    demands, duration = MarginRequirements(), float(np.median(curves.durations))
    target = settings[1].target_loss
    return TuningReport(
        video=curves.video,
        target_loss=target,
        gain_rate=settings[1].gain_rate or 1 / duration,
        frame_rate=1 / duration,
        quantile=demands.quantile,
        slope=tuned.slope,
        steepest_slope=float(content_slopes(curves, target, settings[1].lowest_factor).max()),
        least_gain_margin_db=20 * math.log10(demands.gain_margin),
        least_phase_margin=demands.phase_margin,
        before=loop_report(settings[0], tuned.margins_before, runs[0]),
        after=loop_report(settings[1], tuned.margins, runs[1]),
        tries=tuned.tries,
        provenance=outcome.summary.provenance,
    )


def loop_report(settings: ControllerSettings, margin: Margins, run: ControlledTrack) -> LoopReport:
    """Return what is to be said of gains, from their margins and from a run with them."""
    mean = float(run.time_share @ run.contrast_loss)
    sd = math.sqrt(float(run.time_share @ (run.contrast_loss - mean) ** 2))
    return LoopReport(
        proportional=settings.proportional,
        integral=settings.integral,
        derivative=settings.derivative,
        stable_slope=_finite(margin.stable_slope),
        gain_margin_db=_finite(margin.gain_margin_db),
        phase_margin=margin.phase_margin,
        sensitivity_peak=_finite(margin.sensitivity_peak),
        sd_loss=sd,
        rms_error=rms_error(run),
        share_limited=time_share(run, run.limited),
    )


def out_of_reach(run: ControlledTrack, settings: ControllerSettings) -> str | None:
    """Return what is to be said of a target that most of the video never loses; None if it does."""
    at_bound = np.asarray(run.factors) <= settings.lowest_factor
    share = time_share(run, at_bound & (np.asarray(run.contrast_loss) < settings.target_loss))
    if share <= MUCH_OUT_OF_REACH:
        return None
    return (
        f"the target of {settings.target_loss:g} is out of reach for {share:.1%} of the time: the video "
        f"loses less even at the lowest factor, {settings.lowest_factor:g}"
    )


def time_share(run: ControlledTrack, where: NDArray[np.bool_]) -> float:
    """Return the share of the time of some frames."""
    return min(float(run.time_share @ where), 1.0)


def _finite(value: float) -> float | None:
    """Return a number, or None for one that is infinite."""
    return value if math.isfinite(value) else None

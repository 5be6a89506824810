"""What is kept of a walk that a controller dimmed, and its summary in one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh, TuningReport
from evenlight.experiments.playback.live_dimming import LiveBudget
from evenlight.experiments.playback.walk import WalkResult
from evenlight.method.choices import LimitCurve
from evenlight.method.modulation import largest_rate_ratio
from evenlight.method.online.controller import ControllerSettings
from evenlight.method.online.governor import HorizonErrors, horizon_errors, horizon_warning, steered_horizon

LOG, RECORD = "live_control.csv", "live_control.json"


def settings_of(target_loss: float, tuning: Path | None) -> ControllerSettings:
    """Return the controller's settings: the paper's gains, or those of a `tuning.json`."""
    if tuning is None:
        return ControllerSettings(target_loss)
    tuned = read_json_record(TuningReport, tuning)
    return ControllerSettings(
        target_loss,
        proportional=tuned.after.proportional,
        integral=tuned.after.integral,
        derivative=tuned.after.derivative,
        gain_rate=tuned.gain_rate,
    )


def live_control(
    settings: ControllerSettings,
    limit: tuple[RateLimit, LimitCurve],
    seen: tuple[str, Display, str],
    rows: list[LiveRefresh],
    simulated: bool,
) -> LiveControl:
    """Return the record of a walk.

    Parameters
    ----------
    settings : ControllerSettings
        Of the controller.
    limit : (RateLimit, LimitCurve)
        The rate limit, and which of its curves.
    seen : (str, Display, str)
        The scene, the display that showed it, and what measured its loss.
    rows : list of LiveRefresh
        What the controller did.
    simulated : bool
        Whether the user was simulated.
    """
    (rate_limit, curve), (scene, display, measured_by) = limit, seen
    inputs = {"display": sha256_of_record(display), "rate_limit": sha256_of_record(rate_limit)}
    return LiveControl(
        scene=scene,
        display=display,
        simulated=simulated,
        target_loss=settings.target_loss,
        proportional=settings.proportional,
        integral=settings.integral,
        derivative=settings.derivative,
        gain_rate=settings.gain_rate,
        lowest_factor=settings.lowest_factor,
        highest_factor=settings.highest_factor,
        rate_limit=rate_limit.name,
        limit_curve=curve.value,
        measured_by=measured_by,
        mean_loss=over_time(rows, [row.contrast_loss for row in rows]),
        mean_factor=over_time(rows, [row.factor for row in rows]),
        max_rate_ratio=_rate_ratio(rows),
        provenance=provenance_now(inputs=inputs),
    )


def over_time(rows: list[LiveRefresh], values: Sequence[float | None]) -> float | None:
    """Return the mean over time of what each refresh has, where it is known; None if it never is.

    A picture counts until the next one appears. Where only the last one has a value, that is the mean.
    """
    seconds = [*np.diff([row.flip_time for row in rows]).tolist(), 0.0]
    known = [
        (value, passed)
        for value, passed in zip(values, seconds[: len(rows)], strict=True)
        if value is not None
    ]
    if not known:
        return None
    value, passed = np.array(known).T
    whole = passed.sum()
    mean = value @ passed / whole if whole > 0 else value.mean()
    return float(np.clip(mean, value.min(), value.max()))  # beyond them it is by rounding


def _rate_ratio(rows: list[LiveRefresh]) -> float | None:
    """Return the largest ratio of a rate to its limit, if there is a finite one."""
    steps = [(row.rate, row.rate_limit) for row in rows if row.rate is not None]
    if not steps:
        return None
    ratio = largest_rate_ratio(*np.array(steps, dtype=float).T)
    return ratio if np.isfinite(ratio) else None


@dataclass(frozen=True, slots=True)
class BudgetOutcome:
    """How a walk met its budget.

    Attributes
    ----------
    achieved : float or None
        The mean over time, in the budget's unit; None for a share of a panel that took no power at all.
    mean_power : float or None
        [W]; None for a budget in factors.
    errors : HorizonErrors or None
        Over whole horizons; None for a walk that is shorter.
    """

    achieved: float | None
    mean_power: float | None
    errors: HorizonErrors | None


def budget_outcome(budget: LiveBudget, rows: list[LiveRefresh]) -> BudgetOutcome | None:
    """Return how a walk met its budget; None for one that ended at once.

    A picture counts until the next one appears; how long the last one stayed is unknown.
    """
    asked, shown = budget.settings, rows[:-1]
    durations = np.diff([row.flip_time for row in rows])
    if not shown or not durations.sum() > 0:
        return None
    in_factors = asked.budget_unit is BudgetUnit.FACTOR
    used = np.array([row.factor if in_factors else row.power for row in shown], dtype=float)
    whole = np.ones_like(used)
    if asked.budget_unit is BudgetUnit.POWER:
        whole = np.array([row.full_power for row in shown], dtype=float)
    return BudgetOutcome(
        achieved=float(used @ durations / (whole @ durations)) if whole @ durations > 0 else None,
        mean_power=None if in_factors else float(used @ durations / durations.sum()),
        errors=horizon_errors(used, whole, durations, (asked.budget, asked.horizon)),
    )


def between_answers(rows: list[LiveRefresh]) -> float | None:
    """Return the median time from one answer of the controller to the next [s], if there are two."""
    measured = [(row.measured_refresh, row.flip_time) for row in rows if row.measured_refresh is not None]
    times = [time for k, (refresh, time) in enumerate(measured) if k == 0 or refresh != measured[k - 1][0]]
    median = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return median if median > 0 else None


def horizon_remark(budget: LiveBudget, rows: list[LiveRefresh]) -> str | None:
    """Return what is to be said of a horizon that held too few answers to steer by; None if it is fine."""
    passed = between_answers(rows)
    return None if passed is None else horizon_warning(budget.settings, passed, "answers")


def with_budget(record: LiveControl, budget: LiveBudget, rows: list[LiveRefresh]) -> LiveControl:
    """Return the record of a walk with what a governor was to do, and how near it came."""
    asked, met = budget.settings, budget_outcome(budget, rows)
    targets = [row.target_loss for row in rows if row.target_loss is not None]
    errors, passed = None if met is None else met.errors, between_answers(rows)
    return replace(
        record,
        target_loss=targets[0] if targets else None,
        final_target_loss=targets[-1] if targets else None,
        budget=asked.budget,
        budget_unit=asked.budget_unit,
        horizon=asked.horizon,
        power_model=None if asked.budget_unit is BudgetUnit.FACTOR else budget.model.name,
        mean_power=None if met is None else met.mean_power,
        horizon_error=None if errors is None else errors.either_way,
        horizon_excess=None if errors is None else errors.above,
        steered_horizon=None if passed is None else steered_horizon(asked, passed),
        achieved=None if met is None else met.achieved,
        share_budget_held=over_time(
            rows, [None if row.budget_held is None else float(row.budget_held) for row in rows]
        ),
    )


def write_live(folder: Path, record: LiveControl, rows: list[LiveRefresh]) -> None:
    """Write what is kept of a walk: the record, and a row for each refresh."""
    write_json_record(folder / RECORD, record)
    write_rows(folder / LOG, LiveRefresh, rows)


def walk_summary(scene: str, done: WalkResult, rows: list[LiveRefresh], budget: LiveBudget | None) -> str:
    """Return how a walk in a scene went, what the controller did, and how a budget was met."""
    return _said(scene, done) + _control_summary(rows) + _budget_summary(budget, rows)


def _said(scene: str, done: WalkResult) -> str:
    """Return how a walk went."""
    seconds = done.flip_times[-1] if done.flip_times else 0.0
    return f"{scene}: {len(done.flip_times)} refreshes in {seconds:.1f} s, {done.frames_dropped} dropped"


def _control_summary(rows: list[LiveRefresh]) -> str:
    """Return what the controller did, in words; nothing without one."""
    known = [row for row in rows if row.contrast_loss is not None]
    if not known:
        return "" if not rows else "; no loss was measured"
    measured = len({row.measured_refresh for row in known})
    loss = over_time(rows, [row.contrast_loss for row in rows])
    factor = over_time(rows, [row.factor for row in rows])
    return f"; contrast loss {loss:.3g} and factor {factor:.3g} on average, {measured} refreshes measured"


def _budget_summary(budget: LiveBudget | None, rows: list[LiveRefresh]) -> str:
    """Return how a budget was met, in words; nothing without one."""
    met = None if budget is None else budget_outcome(budget, rows)
    if budget is None or met is None:
        return ""
    asked = budget.settings
    words = f"; budget {asked.budget:g} ({asked.budget_unit.value}): "
    if met.achieved is None:
        return f"{words}nothing was used, all was black"
    words += f"{met.achieved:.3g} on average"
    if met.errors is None:
        words += f", shorter than the horizon of {asked.horizon:g} s"
    else:
        off, above = met.errors
        words += f", over any {asked.horizon:g} s off by {off:.2g} at most, above it by {above:.2g}"
    warning = horizon_remark(budget, rows)
    return words if warning is None else f"{words}; {warning}"

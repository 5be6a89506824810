"""What is kept of a walk that a controller dimmed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data_schema.brightness_track import BudgetUnit
from data_schema.control import TuningReport
from data_schema.display import Display
from data_schema.live_control import LiveControl, LiveRefresh
from data_schema.provenance import provenance_now, sha256_of_record
from data_schema.rate_limit import RateLimit
from data_schema.text_files import read_json_record, write_json_record, write_rows
from experiments.live_governor import LiveBudget
from method.choices import LimitCurve
from method.controller import ControllerSettings
from method.horizon_errors import HorizonErrors, horizon_errors

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
        Whether nobody sat at the keys.
    """
    (rate_limit, curve), (scene, display, measured_by) = limit, seen
    losses = [row.contrast_loss for row in rows if row.contrast_loss is not None]
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
        mean_loss=sum(losses) / len(losses) if losses else None,
        mean_factor=sum(row.factor for row in rows) / len(rows) if rows else None,
        provenance=provenance_now(inputs=inputs),
    )


@dataclass(frozen=True, slots=True)
class BudgetMet:
    """How a walk met its budget.

    Attributes
    ----------
    achieved : float
        The mean over time, in the budget's unit.
    mean_power : float or None
        [W]; None for a budget in factors.
    errors : HorizonErrors or None
        Over whole horizons; None for a walk that is shorter.
    """

    achieved: float
    mean_power: float | None
    errors: HorizonErrors | None


def how_met(budget: LiveBudget, rows: list[LiveRefresh]) -> BudgetMet | None:
    """Return how a walk met its budget; None for one that ended at once.

    A picture counts until the next one appears; how long the last one stayed nobody knows.
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
    return BudgetMet(
        achieved=float(used @ durations / (whole @ durations)),
        mean_power=None if in_factors else float(used @ durations / durations.sum()),
        errors=horizon_errors(used, whole, durations, (asked.budget, asked.horizon)),
    )


def with_budget(record: LiveControl, budget: LiveBudget, rows: list[LiveRefresh]) -> LiveControl:
    """Return the record of a walk with what a governor was to do, and how near it came."""
    asked, met = budget.settings, how_met(budget, rows)
    targets = [row.target_loss for row in rows if row.target_loss is not None]
    errors = None if met is None else met.errors
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
    )


def write_live(folder: Path, record: LiveControl, rows: list[LiveRefresh]) -> None:
    """Write what is kept of a walk: the record, and a row for each refresh."""
    write_json_record(folder / RECORD, record)
    write_rows(folder / LOG, LiveRefresh, rows)

"""What is kept of a walk that was dimmed online: its record, and a row for each refresh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh
from evenlight.experiments.playback.live_dimming import LiveBudget
from evenlight.experiments.playback.walk import between_answers, budget_outcome, over_time, rate_ratio
from evenlight.method.choices import LimitCurve
from evenlight.method.online.controller import ControllerSettings
from evenlight.method.online.governor import steered_horizon

LOG, RECORD = "live_control.csv", "live_control.json"


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
        The scene, the display that showed it, at the pixels per degree that were drawn, and what measured its
        loss.
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
        max_rate_ratio=rate_ratio(rows),
        provenance=provenance_now(inputs=inputs),
        wide_band_accepted=bool(rate_limit.wide_band),
    )


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

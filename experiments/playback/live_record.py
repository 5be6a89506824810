"""What dims a walk online as it is asked for, and what is kept of that: a record, rows, a summary."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh
from evenlight.experiments.playback.live_dimming import LiveBudget, LiveGovernor
from evenlight.experiments.playback.play_options import LiveOptions
from evenlight.method.choices import LimitCurve
from evenlight.method.detectability import limit_at_share
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.gain import GainMonitor, gain_warning
from evenlight.method.online.governor import (
    HORIZON,
    HORIZONS,
    GovernorSettings,
    horizon_errors,
    horizon_warning,
    steered_horizon,
)
from evenlight.method.optimizer.request import Request, require_possible
from evenlight.method.preset_files import load_rate_limit, power_model_for, usable_limit
from evenlight.method.rate_limit import largest_rate_ratio, scalar_rate_limit

LOG, RECORD = "live_control.csv", "live_control.json"


def asked_budget(live: LiveOptions, display: Display) -> LiveBudget | None:
    """Return the budget that a walk on a display is to meet, if there is one.

    Raises
    ------
    InputError
        If the budget or its horizon cannot be.
    """
    budget, horizon = live.budget, HORIZON if live.horizon is None else live.horizon
    if budget is None:
        return None
    unit = BudgetUnit(live.budget_unit or BudgetUnit.FACTOR)
    if not 0 < budget < float("inf"):
        raise InputError(f"--budget must be above 0, got {budget:g}")
    if not HORIZONS[0] <= horizon <= HORIZONS[1]:
        raise InputError(f"--horizon must lie in {HORIZONS[0]:g} to {HORIZONS[1]:g}, got {horizon:g}")
    if unit is BudgetUnit.FACTOR and live.power_model is not None:
        raise InputError("--power-model is for a budget in power or watt: give --budget-unit with it")
    needed_for = "" if unit is BudgetUnit.FACTOR else f"a budget in {unit.value}"
    model = power_model_for(display, live.power_model, needed_for)
    return LiveBudget(GovernorSettings(budget, unit, horizon), model)


@dataclass(frozen=True, slots=True)
class LiveDimming:
    """What dims a walk on a display: a controller within a rate limit, and what is to meet a budget."""

    controller: Controller
    limit: RateLimit  # that is kept to: as in its file, or for another share of detections
    limit_sha256: str  # of the limit as in its file
    curve: LimitCurve
    budget: LiveBudget | None = None
    target_loss: float | None = None  # contrast loss to hold, or to begin with

    @classmethod
    def asked_for(
        cls, live: LiveOptions, display: Display, budget: LiveBudget | None, *, other_display_ok: bool = False
    ) -> LiveDimming:
        """Return what some options ask for.

        Raises
        ------
        InputError
            If the rate limit is of another display or not known well enough, or no factor meets the budget.
        """
        curve = LimitCurve(live.limit_curve)
        limit = load_rate_limit(live.rate_limit)
        limit = usable_limit(limit, display, other_display_ok, live.accept_wide_band, live.noticed)
        of_file = sha256_of_record(limit)
        if live.noticed is not None:
            limit = limit_at_share(limit, live.noticed)
        fastest = scalar_rate_limit(limit, display.reflected_luminance, curve)
        settings = ControllerSettings(live.target_loss or 0.0, **live.gains)
        if budget is not None:
            asked = budget.settings
            request = Request(asked.budget, asked.budget_unit, budget.model, limit, curve)
            require_possible(request, settings.lowest_factor)
        return cls(Controller(settings, fastest), limit, of_file, curve, budget, live.target_loss)

    def governor(self) -> LiveGovernor | None:
        """Return what moves the target so that the budget is met, if there is one."""
        return None if self.budget is None else LiveGovernor(self.budget, self.controller, self.target_loss)


def live_control(
    dimming: LiveDimming,
    seen: tuple[str, Display, str],
    rows: list[LiveRefresh],
    *,
    simulated: bool,
    files: dict[str, str] | None = None,
) -> LiveControl:
    """Return the record of a walk: what the controller did, and how near a budget came to be met.

    Parameters
    ----------
    dimming : LiveDimming
        What dimmed it.
    seen : (str, Display, str)
        The scene, the display that showed it, at the pixels per degree that were drawn, and what measured its
        loss.
    rows : list of LiveRefresh
        What the controller did.
    simulated : bool
        Whether the user was simulated.
    files : dict of str to str, optional
        SHA-256 of the files of the scene.
    """
    settings, limit, (scene, display, measured_by) = dimming.controller.settings, dimming.limit, seen
    inputs = {"display": sha256_of_record(display), "rate_limit": dimming.limit_sha256, **(files or {})}
    return LiveControl(
        scene=scene,
        display=display,
        simulated=simulated,
        proportional=settings.proportional,
        integral=settings.integral,
        derivative=settings.derivative,
        gain_rate=settings.gain_rate,
        lowest_factor=settings.lowest_factor,
        highest_factor=settings.highest_factor,
        rate_limit=limit.name,
        limit_curve=dimming.curve.value,
        measured_by=measured_by,
        mean_loss=over_time(rows, [row.contrast_loss for row in rows]),
        mean_factor=over_time(rows, [row.factor for row in rows]),
        max_rate_ratio=_rate_ratio(rows),
        provenance=provenance_now(inputs=inputs),
        wide_band_accepted=bool(limit.wide_band),
        noticed=limit.noticed,
        **({"target_loss": settings.target_loss} if dimming.budget is None else _met(dimming.budget, rows)),
    )


def _met(budget: LiveBudget, rows: list[LiveRefresh]) -> dict[str, Any]:
    """Return what a record says of a budget, and of how it was met.

    A picture counts until the next one appears; how long the last one stayed is unknown.
    """
    asked, passed = budget.settings, between_answers(rows)
    targets = [row.target_loss for row in rows if row.target_loss is not None]
    held = [None if row.budget_held is None else float(row.budget_held) for row in rows]
    said: dict[str, Any] = {
        "target_loss": targets[0] if targets else None,
        "final_target_loss": targets[-1] if targets else None,
        "budget": asked.budget,
        "budget_unit": asked.budget_unit,
        "horizon": asked.horizon,
        "steered_horizon": None if passed is None else steered_horizon(asked, passed),
        "share_budget_held": over_time(rows, held),
    }
    in_factors = asked.budget_unit is BudgetUnit.FACTOR
    said["power_model"] = None if in_factors or budget.model is None else budget.model.name
    durations = np.diff([row.flip_time for row in rows])
    if not durations.sum() > 0:
        return said
    used = np.array([row.factor if in_factors else row.power for row in rows[:-1]], dtype=float)
    whole = np.ones_like(used)
    if asked.budget_unit is BudgetUnit.POWER:
        whole = np.array([row.full_power for row in rows[:-1]], dtype=float)
    errors = horizon_errors(used, whole, durations, (asked.budget, asked.horizon))
    said["horizon_error"], said["horizon_excess"] = errors or (None, None)
    said["mean_power"] = None if in_factors else float(used @ durations / durations.sum())
    if whole @ durations > 0:
        said["achieved"] = float(used @ durations / (whole @ durations))
    return said


def write_live(folder: Path, record: LiveControl, rows: list[LiveRefresh]) -> None:
    """Write what is kept of a walk: the record, and a row for each refresh."""
    write_json_record(folder / RECORD, record)
    write_rows(folder / LOG, LiveRefresh, rows)


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


def between_answers(rows: list[LiveRefresh]) -> float | None:
    """Return the median time from one answer of the controller to the next [s], if there are two."""
    measured = [(row.measured_refresh, row.flip_time) for row in rows if row.measured_refresh is not None]
    times = [time for k, (refresh, time) in enumerate(measured) if k == 0 or refresh != measured[k - 1][0]]
    median = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return median if median > 0 else None


def dimming_in_words(record: LiveControl, budget: LiveBudget | None, rows: list[LiveRefresh]) -> str:
    """Return what the controller did, how a budget was met, and what is wrong with either."""
    words = ["no loss was measured"] if rows else []
    if record.mean_loss is not None:
        measured = len({row.measured_refresh for row in rows if row.contrast_loss is not None})
        on_average = f"contrast loss {record.mean_loss:.3g} and factor {record.mean_factor:.3g} on average"
        words = [f"{on_average}, {measured} refreshes measured"]
    if budget is not None and rows and rows[-1].flip_time > rows[0].flip_time:
        words += _budget_in_words(record, budget, between_answers(rows))
    monitor = GainMonitor(record.horizon or HORIZON)
    for row, after in itertools.pairwise(rows):
        if row.contrast_loss is not None and row.measured_factor is not None:
            monitor.take(row.measured_factor, row.contrast_loss, after.flip_time - row.flip_time)
    nothing_gained = gain_warning(monitor.ratio)
    return "; ".join(words if nothing_gained is None else [*words, nothing_gained])


def _budget_in_words(record: LiveControl, budget: LiveBudget, passed: float | None) -> list[str]:
    """Return how a budget was met, answers coming some time apart [s]."""
    asked = budget.settings
    words = f"budget {asked.budget:g} ({asked.budget_unit.value}): "
    if record.achieved is None:
        return [f"{words}nothing was used, all was black"]
    words += f"{record.achieved:.3g} on average, "
    if record.horizon_error is None:
        words += f"shorter than the horizon of {asked.horizon:g} s"
    else:
        off = f"off by {record.horizon_error:.2g} at most, above it by {record.horizon_excess:.2g}"
        words += f"over any {asked.horizon:g} s {off}"
    warning = None if passed is None else horizon_warning(asked, passed, "answers")
    return [words] if warning is None else [words, warning]

"""What is said of a walk once it has ended, in one line."""

from __future__ import annotations

from evenlight.data_schema.live_control import LiveRefresh
from evenlight.experiments.live_governor import LiveBudget
from evenlight.experiments.live_record import how_met, over_time, said_of_horizon
from evenlight.experiments.walk import Walked


def words_of_walk(scene: str, done: Walked, rows: list[LiveRefresh], budget: LiveBudget | None) -> str:
    """Return how a walk in a scene went, what the controller did, and how a budget was met."""
    return _said(scene, done) + _said_of_control(rows) + _said_of_budget(budget, rows)


def _said(scene: str, done: Walked) -> str:
    """Return how a walk went."""
    seconds = done.flip_times[-1] if done.flip_times else 0.0
    return f"{scene}: {len(done.flip_times)} refreshes in {seconds:.1f} s, {done.frames_dropped} dropped"


def _said_of_control(rows: list[LiveRefresh]) -> str:
    """Return what the controller did, in words; nothing without one."""
    known = [row for row in rows if row.contrast_loss is not None]
    if not known:
        return "" if not rows else "; no loss was measured"
    measured = len({row.measured_refresh for row in known})
    loss = over_time(rows, [row.contrast_loss for row in rows])
    factor = over_time(rows, [row.factor for row in rows])
    return f"; contrast loss {loss:.3g} and factor {factor:.3g} on average, {measured} refreshes measured"


def _said_of_budget(budget: LiveBudget | None, rows: list[LiveRefresh]) -> str:
    """Return how a budget was met, in words; nothing without one."""
    met = None if budget is None else how_met(budget, rows)
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
    warning = said_of_horizon(budget, rows)
    return words if warning is None else f"{words}; {warning}"

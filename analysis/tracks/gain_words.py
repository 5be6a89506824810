"""What a track saves, what that costs, and how evenly: the lines that a result begins with."""

from __future__ import annotations

from evenlight.analysis.tracks.objective_words import less_or_more, little_of
from evenlight.analysis.wording import sentence
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.online.gain import NO_GAIN

OFF_BUDGET = 0.005  # relative: from here on a budget that is not met is told of
PUBLISHED = "surace2025"  # the preset of a power model, measured on a panel of its own
SAME_POWER = 1e-4  # relative: powers that print alike


def gain_in_words(summary: OptimizationSummary) -> tuple[str, ...]:
    """Return what a track saves, costs and gains, in three or four lines."""
    lines = (_saving(summary), _cost(summary), _evenness(summary), _off_budget(summary))
    return tuple(line for line in lines if line)


def gain_sentences(summary: OptimizationSummary) -> tuple[str, str]:
    """Return what a track saves and what it costs, as sentences; how evenly, other words tell there."""
    return f"{_saving(summary)}.", f"{sentence(_cost(summary))}."


def _saving(summary: OptimizationSummary) -> str:
    """Return the power that a track saves, and how long a battery lasts if its capacity is known."""
    saved, full = summary.full_power - summary.mean_power, summary.full_power
    panel = summary.power_model
    where = "" if panel == summary.display else f" on the display of the power model {panel}"
    if panel == PUBLISHED != summary.display:
        where = f" on the published panel ({panel}; for {summary.display} give --power-model)"
    if not saved > 1e-6 * full:
        return f"{summary.video} saves no power{where}: {full:.3g} W, as at full brightness"
    words = f"{summary.video} saves {saved:.3g} of {full:.3g} W ({100 * saved / full:.0f} %){where}"
    life, life_full = summary.battery_life, summary.battery_life_full
    if life is None or life_full is None:
        return words
    return (
        f"{words}; {summary.battery_capacity:g} Wh last that panel alone {life:.3g} h instead of "
        f"{life_full:.3g} h"
    )


def _cost(summary: OptimizationSummary) -> str:
    """Return the visible contrast that is lost, on average and in the worst frame."""
    ours, constant = summary.mean_contrast_loss, summary.mean_contrast_loss_baseline
    if not (ours > 0 or constant > 0):
        return "no visible contrast is lost in any frame, nor is it with constant dimming"
    worst, worst_constant = summary.worst_contrast_loss, summary.worst_contrast_loss_baseline
    equal = "equal power" if uses_same_power(summary) else "the same mean factor"
    words = f"{_percent(ours)} of the visible contrast is lost on average"
    if worst is None or worst_constant is None:  # an older file
        return f"{words}, {_percent(constant)} with constant dimming at {equal}"
    return (
        f"{words}, {_percent(worst)} in the worst frame; with constant dimming at {equal} "
        f"{_percent(constant)} and {_percent(worst_constant)}"
    )


def uses_same_power(summary: OptimizationSummary) -> bool:
    """Return whether a track and its constant baseline use the same power."""
    return abs(summary.mean_power - summary.baseline_power) <= SAME_POWER * summary.baseline_power


def _evenness(summary: OptimizationSummary) -> str:
    """Return how much frames differ in what they lose; nothing where none loses anything."""
    ours, constant = summary.objective, summary.objective_baseline
    if not (summary.mean_contrast_loss > 0 or summary.mean_contrast_loss_baseline > 0):
        return ""
    words = (
        f"two frames differ by {_points(ours)} percentage points in what they lose"
        f"{', by their weights' if summary.weighted else ''}, with constant dimming by {_points(constant)}"
    )
    if little := little_of(summary):
        return f"{little}: {words}"
    if not constant > 0:
        return words
    if NO_GAIN < ours / constant <= 1:
        certain = summary.lower_bound > 0.9 * constant
        why = "; budget, rate limit and lowest factor leave no room" if certain else ""
        return f"{words}: next to nothing gained{why}"
    return f"{words}: {less_or_more(1 - ours / constant)}"


def _off_budget(summary: OptimizationSummary) -> str:
    """Return by how much a budget is not met; nothing where it is, or where clips share it."""
    used, budget = summary.achieved, summary.budget
    if summary.clips > 1 or abs(used - budget) <= OFF_BUDGET * budget:
        return ""
    how = "exceeded" if used > budget else "not used up"
    return f"the budget of {budget:g} ({summary.budget_unit.value}) is {how}: {used:.3g} on average"


def _percent(share: float) -> str:
    """Return a share in percent, to a tenth, or to two digits where it is small.

    >>> _percent(0.03049), _percent(0.00054)
    ('3.0 %', '0.054 %')
    """
    return f"{_points(share)} %"


def _points(share: float) -> str:
    """Return a share in percentage points, likewise."""
    return f"{100 * share:.1f}" if share >= 0.01 else f"{100 * share:.2g}"

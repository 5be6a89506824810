"""The figure of a viewing plan: power over participants, and how often the tests find what is not there."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenlight.analysis.figure_style import (
    BASELINE,
    INK,
    LIMIT,
    LOST,
    MUTED,
    OURS,
    PAGE,
    PARTICIPANT,
    Medium,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.plans.viewing_plan import ViewingPlan, needed_in_words
from evenlight.data_schema.analysis_results import ViewingPlanRow

COLOURS = (OURS, INK, BASELINE, LIMIT, PARTICIPANT, LOST)
MARKERS = ("o", "s", "D", "^", "v", "P")
LINES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.6)),
    (0, (2.5, 1.4)),
    (0, (1, 1.2)),
    (0, (6, 1.4, 1, 1.4)),
    (0, (3, 3)),
)
TITLES = {
    "rating": "Detail rating: how many participants",
    "comparison": "Artifact comparison: how many participants",
    "search": "Ring search: how many participants",
}


def viewing_plan_figure(plan: ViewingPlan, medium: Medium = PAGE) -> Figure:
    """Draw the power of each test over the number of participants, and below its type I error.

    Parameters
    ----------
    plan : ViewingPlan
        What was planned.
    medium : Medium
        Where it is shown.
    """
    with look(medium):
        em = medium.em
        left = 4.8 * em
        width = medium.width - left - 2 * em
        lines, above = heading_lines(TITLES[plan.request.task], _subtitle(plan), medium.width - 3 * em, em)
        key = 1.7 * em * len(plan.tests)
        tall = min(26 * em, medium.height - above - key - 20 * em)
        figure = new_figure(medium, above + key + tall + 16.4 * em)
        lines_at(figure, 1.5 * em, lines)
        _draw_key(figure, plan, (1.5 * em, above + 0.6 * em))
        top = above + key + 2.0 * em
        upper = axes_at(figure, left, top, width, tall)
        lower = axes_at(figure, left, top + tall + 2.0 * em, width, 8 * em)
        _draw_power(upper, plan)
        _draw_errors(lower, plan)
    return figure


def _subtitle(plan: ViewingPlan) -> str:
    """Return what was assumed."""
    request = plan.request
    drawn = any(row.runs for row in plan.rows)
    how = (
        f"Simulated: {request.runs} experiments for each mark, bars 95 %"
        if drawn
        else "Computed: no experiment drawn"
    )
    exact = "; marks without bars are exact" if drawn and any(not row.runs for row in plan.rows) else ""
    return f"{how}{exact}. Assumed: {request.truth.in_words}."


def _draw_key(figure: Figure, plan: ViewingPlan, place: tuple[float, float]) -> None:
    """Write which mark is which test, and how many participants it needs."""
    handles = []
    for k, name in enumerate(plan.tests):
        needed = needed_in_words(plan.rows_of(name)[0])
        label = drawable(f"{name}: {needed} for {100 * plan.request.power:g} %")
        handles.append(
            Line2D([], [], color=COLOURS[k % 6], marker=MARKERS[k % 6], linestyle=LINES[k % 6],
                   ms=0.55 * text_size(), linewidth=text_size() / 8, label=label)
        )  # fmt: skip
    width, height = figure.get_size_inches()
    anchor = (place[0] / width, 1 - place[1] / height)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=anchor, handlelength=3.0)


def _draw_power(axes: Axes, plan: ViewingPlan) -> None:
    """Draw power over participants."""
    for k, name in enumerate(plan.tests):
        rows = plan.rows_of(name)
        _draw_line(axes, k, rows, [(row.power, row.power_low, row.power_high) for row in rows])
    axes.axhline(
        100 * plan.request.power, color=MUTED, linestyle=(0, (4, 3)), linewidth=text_size() / 10, zorder=1
    )
    _frame(axes, plan)
    axes.set_ylim(0, 102)
    axes.set_ylabel("power [% of experiments]")
    axes.tick_params(labelbottom=False)


def _draw_errors(axes: Axes, plan: ViewingPlan) -> None:
    """Draw the type I error over participants."""
    highest = 10.0
    for k, name in enumerate(plan.tests):
        rows = plan.rows_of(name)
        shares = [(row.type_i_error, row.type_i_error_low, row.type_i_error_high) for row in rows]
        highest = max(highest, *(105 * share[2] for share in shares))
        _draw_line(axes, k, rows, shares)
    axes.axhline(5, color=MUTED, linestyle=(0, (4, 3)), linewidth=text_size() / 10, zorder=1)
    _frame(axes, plan)
    axes.set_ylim(0, highest)
    axes.set(xlabel="participants", ylabel="type I error [%]")


def _draw_line(
    axes: Axes, place: int, rows: tuple[ViewingPlanRow, ...], shares: list[tuple[float, float, float]]
) -> None:
    """Draw shares with their intervals, a little apart from the other tests'."""
    size = text_size()
    at = [row.participants * 1.012**place for row in rows]
    middle = [100 * share[0] for share in shares]
    bars = [[100 * (s[0] - s[1]) for s in shares], [100 * (s[2] - s[0]) for s in shares]]
    axes.errorbar(at, middle, yerr=bars, color=COLOURS[place % 6], marker=MARKERS[place % 6], ms=0.5 * size,
                  linestyle=LINES[place % 6], linewidth=size / 8, elinewidth=size / 10)  # fmt: skip


def _frame(axes: Axes, plan: ViewingPlan) -> None:
    """Give the horizontal axis its range, and a mark for each number that was tried."""
    numbers = sorted({row.participants for row in plan.rows})
    axes.set_xscale("log")
    axes.set_xlim(numbers[0] / 1.12, numbers[-1] * 1.12)
    axes.set_xticks(numbers, [str(n) for n in numbers])
    axes.set_xticks([], minor=True)

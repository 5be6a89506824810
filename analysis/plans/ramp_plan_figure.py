"""The figure of a plan: how precisely ΔL(L) is known, for so many participants and minutes of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
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
from evenlight.analysis.plans.ramp_plan import RampPlan
from evenlight.data_schema.analysis_results import RampPlanRow

COLOURS = (INK, BASELINE, OURS, LIMIT, PARTICIPANT, LOST)
MARKERS = ("o", "s", "D", "^", "v", "P")
MOST_PANELS = 4  # numbers of participants side by side
SHARES = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200)  # [%]
COUNTS = (2, 3, 5, 7, 10, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500, 1000)


def planning_figure(plan: RampPlan, medium: Medium = PAGE) -> Figure:
    """Draw the band's half-width over a participant's time, and what the wanted precision takes.

    Above a panel for each number of participants (the first four), below the participants and the hours of
    all of them that give the wanted precision.

    Parameters
    ----------
    plan : RampPlan
        What was planned.
    medium : Medium
        Where it is shown.
    """
    numbers = sorted({row.participants for row in plan.rows})[:MOST_PANELS]
    with look(medium):
        em = medium.em
        left = 4.6 * em
        width = medium.width - left - 1.5 * em
        lines, above = heading_lines(*_heading(plan), width, em)
        key_columns = 2 if width > 40 * em else 1
        key = 1.7 * em * -(-(len(plan.request.designs) + 1) // key_columns)
        height = float(np.clip((medium.height - above - key - 14 * em) / 2, 9 * em, 16 * em))
        figure = new_figure(medium, above + key + 2 * height + 13.6 * em)
        lines_at(figure, left, lines)
        _draw_key(figure, plan, (left, above + 0.6 * em), key_columns)
        top, gap = above + key + 3.4 * em, 1.2 * em
        each = (width - gap * (len(numbers) - 1)) / len(numbers)
        for k, number in enumerate(numbers):
            axes = axes_at(figure, left + k * (each + gap), top, each, height)
            _draw_precision(axes, plan, number, first=k == 0)
        top += height + 6.2 * em
        half = (width - 6 * em) / 2
        _draw_needs(axes_at(figure, left, top, half, height), plan, lambda row: row.participants_needed,
                    "participants needed")  # fmt: skip
        _draw_needs(axes_at(figure, left + half + 6 * em, top, half, height), plan,
                    lambda row: row.hours_needed, "hours needed, of all")  # fmt: skip
    return figure


def _heading(plan: RampPlan) -> tuple[str, str]:
    """Return title and subtitle."""
    request = plan.request
    trials = ", ".join(map(str, sorted(request.trials)))
    return (
        "How many participants, and how long of each",
        f"Simulated: {request.pool} participants per design, {request.draws} experiments drawn from them. "
        f"Marks: {trials} ramps per level. Above: half-width of the 95 % pointwise band of ΔL(L). Below: "
        f"what {100 * request.precision:g} % takes.",
    )


def _draw_key(figure: Figure, plan: RampPlan, place: tuple[float, float], columns: int) -> None:
    """Write which mark is which design."""
    size = text_size()
    handles = [
        Line2D([], [], color=COLOURS[k % 6], marker=MARKERS[k % 6], ms=0.55 * size, label=drawable(name))
        for k, name in enumerate(plan.request.designs)
    ]
    wanted = f"wanted: {100 * plan.request.precision:g} %"
    handles.append(Line2D([], [], color=MUTED, linestyle=(0, (4, 3)), linewidth=size / 10, label=wanted))
    width, height = figure.get_size_inches()
    anchor = (place[0] / width, 1 - place[1] / height)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=anchor, ncols=columns)


def _rows_of(plan: RampPlan, design: str, participants: int) -> list[RampPlanRow]:
    """Return the rows of a design for so many participants, shortest sessions first."""
    own = [row for row in plan.rows if (row.design, row.participants) == (design, participants)]
    return sorted(own, key=lambda row: row.minutes)


def _draw_precision(axes: Axes, plan: RampPlan, participants: int, first: bool) -> None:
    """Draw the half-width over minutes, for so many participants."""
    size = text_size()
    for k, name in enumerate(plan.request.designs):
        rows = _rows_of(plan, name, participants)
        axes.plot([row.minutes for row in rows], [100 * row.half_width for row in rows], color=COLOURS[k % 6],
                  marker=MARKERS[k % 6], ms=0.5 * size, linewidth=size / 8)  # fmt: skip
    wanted = 100 * plan.request.precision
    axes.axhline(wanted, color=MUTED, linestyle=(0, (4, 3)), linewidth=size / 10, zorder=1)
    shares = [wanted, *(100 * row.half_width for row in plan.rows)]
    axes.set_yscale("log")
    _set_ticks(axes, (min(shares) / 1.15, max(shares) * 1.15), SHARES)
    axes.tick_params(labelleft=first)
    axes.set_xlim(0, 1.06 * max(row.minutes for row in plan.rows))
    axes.set_title(f"{participants} participants", loc="left", color=INK)
    if first:
        axes.set_ylabel("half-width of the band [%]")
    axes.set_xlabel("minutes per participant")


def _draw_needs(axes: Axes, plan: RampPlan, need: Callable[[RampPlanRow], float | None], words: str) -> None:
    """Draw what the wanted precision takes, over the minutes of a participant."""
    size = text_size()
    number = plan.rows[0].participants
    found = []
    for k, name in enumerate(plan.request.designs):
        rows = [(row.minutes, need(row)) for row in _rows_of(plan, name, number)]
        points = [(x, y) for x, y in rows if y is not None]
        found += [y for _, y in points]
        axes.plot(*zip(*points, strict=True) if points else ([], []), color=COLOURS[k % 6],
                  marker=MARKERS[k % 6], ms=0.5 * size, linewidth=size / 8)  # fmt: skip
    axes.set_yscale("log")
    _set_ticks(axes, (min(found, default=1) / 1.2, max(found, default=10) * 1.2), COUNTS)
    axes.set(xlabel="minutes per participant", ylabel=words)
    axes.set_xlim(0, 1.06 * max(row.minutes for row in plan.rows))


def _set_ticks(axes: Axes, limits: tuple[float, float], ticks: Sequence[float]) -> None:
    """Give a logarithmic vertical axis its range, and plain numbers."""
    axes.set_ylim(*limits)
    shown = [tick for tick in ticks if limits[0] <= tick <= limits[1]]
    axes.set_yticks(shown, [f"{tick:g}" for tick in shown])
    axes.set_yticks([], minor=True)

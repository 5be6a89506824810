"""The files of a plan: its table, its summary and its figure."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

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
    FigureFormat,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
    write_png,
)
from evenlight.analysis.plans import ramp_plan, viewing_plan
from evenlight.analysis.plans.ramp_plan import RampPlan
from evenlight.analysis.plans.viewing_plan import ViewingPlan, needed_in_words
from evenlight.data_schema.analysis_results import RampPlanRow, ViewingPlanRow
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json

TABLE, SUMMARY, FIGURE = "plan.csv", "plan.json", "plan.png"
COLOURS = (INK, BASELINE, OURS, LIMIT, PARTICIPANT, LOST)
MARKERS = ("o", "s", "D", "^", "v", "P")
MOST_PANELS = 4  # numbers of participants side by side
SHARES = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200)  # [%]
COUNTS = (2, 3, 5, 7, 10, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500, 1000)
TEST_COLOURS = (OURS, INK, BASELINE, LIMIT, PARTICIPANT, LOST)
LINES: tuple[Any, ...] = (
    "-", (0, (5, 1.6)), (0, (2.5, 1.4)), (0, (1, 1.2)), (0, (6, 1.4, 1, 1.4)), (0, (3, 3)),
)  # fmt: skip
TITLES = {
    "rating": "Detail rating: how many participants",
    "comparison": "Artifact comparison: how many participants",
    "search": "Ring search: how many participants",
}


def write_plan(folder: Path, plan: ramp_plan.RampPlan) -> None:
    """Write `plan.csv`, `plan.json` and `plan.png` of a calibration."""
    request = plan.request
    inputs = {f"design {name}": sha256_of_record(design) for name, design in request.designs.items()}
    inputs["display"] = sha256_of_record(request.display)
    write_rows(folder / TABLE, RampPlanRow, plan.rows)
    content: dict[str, Any] = {
        "in_words": list(ramp_plan.in_words(plan)),
        "simulated": True,
        "effort": request.effort,
        "monte_carlo_error": ramp_plan.chance_in_words(plan),
        "model": ramp_plan.PLANNED_MODEL,
        "precision": request.precision,
        "pool": request.pool,
        "draws": request.draws,
        "best": {task.value: row and mapping_from_record(row) for task, row in plan.best.items()},
        "rows": [mapping_from_record(row) for row in plan.rows],
        "designs": {name: mapping_from_record(design) for name, design in request.designs.items()},
        "provenance": mapping_from_record(provenance_now(request.seed, inputs)),
    }
    write_json(folder / SUMMARY, content)
    write_png(folder / FIGURE, planning_figure(plan))


def write_viewing_plan(folder: Path, plan: viewing_plan.ViewingPlan) -> None:
    """Write `plan.csv`, `plan.json` and `plan.png` of a viewing experiment."""
    request = plan.request
    write_rows(folder / TABLE, ViewingPlanRow, plan.rows)
    content: dict[str, Any] = {
        "task": request.task,
        "simulated": True,
        "power": request.power,
        "runs": request.runs,
        "truth": dataclasses.asdict(request.truth),  # type: ignore[call-overload] # every truth is a record
        "truth_in_words": request.truth.in_words,
        "in_words": list(viewing_plan.in_words(plan)),
        "rows": [mapping_from_record(row) for row in plan.rows],
        "provenance": mapping_from_record(provenance_now(request.seed)),
    }
    write_json(folder / SUMMARY, content)
    write_png(folder / FIGURE, viewing_plan_figure(plan))


def planning_figure(plan: RampPlan, medium: FigureFormat = PAGE) -> Figure:
    """Draw the band's half-width over a participant's time, and what the wanted precision takes.

    Above a panel for each number of participants (the first four), below the participants and the hours of
    all of them that give the wanted precision.

    Parameters
    ----------
    plan : RampPlan
        What was planned.
    medium : FigureFormat
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


def viewing_plan_figure(plan: ViewingPlan, medium: FigureFormat = PAGE) -> Figure:
    """Draw the power of each test over the number of participants, and below its type I error.

    Parameters
    ----------
    plan : ViewingPlan
        What was planned.
    medium : FigureFormat
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
        _draw_test_key(figure, plan, (1.5 * em, above + 0.6 * em))
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


def _draw_test_key(figure: Figure, plan: ViewingPlan, place: tuple[float, float]) -> None:
    """Write which mark is which test, and how many participants it needs."""
    handles = []
    for k, name in enumerate(plan.tests):
        needed = needed_in_words(plan.rows_of(name)[0])
        label = drawable(f"{name}: {needed} for {100 * plan.request.power:g} %")
        handles.append(
            Line2D([], [], color=TEST_COLOURS[k % 6], marker=MARKERS[k % 6], linestyle=LINES[k % 6],
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
    _frame_numbers(axes, plan)
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
    _frame_numbers(axes, plan)
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
    axes.errorbar(at, middle, yerr=bars, color=TEST_COLOURS[place % 6], marker=MARKERS[place % 6],
                  ms=0.5 * size, linestyle=LINES[place % 6], linewidth=size / 8,
                  elinewidth=size / 10)  # fmt: skip


def _frame_numbers(axes: Axes, plan: ViewingPlan) -> None:
    """Give the horizontal axis its range, and a mark for each number that was tried."""
    numbers = sorted({row.participants for row in plan.rows})
    axes.set_xscale("log")
    axes.set_xlim(numbers[0] / 1.12, numbers[-1] * 1.12)
    axes.set_xticks(numbers, [str(n) for n in numbers])
    axes.set_xticks([], minor=True)

"""The figure of the detection times (Section 4.2): every location, both versions, with what was not found."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LOST,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.search.search_locations import LocationCell, LocationResult
from evenlight.data_schema.analysis_results import Origin, PlottedPoint

ROW = 1.62  # height of a location [em]
HEADING = 1.75  # of a sequence [em]
LONGEST_NAME = 18
NAME_WIDTH, COUNT_WIDTH, FACTOR_WIDTH = 11.5, 10.4, 9.2  # of the columns beside the axes [em]
SECOND = 4.0  # from the column of ours to that of the baseline [em]
OFFSET = 0.2  # of either version from the middle of its row [rows]


def times_figure(
    locations: Sequence[LocationResult], limit: float, simulated: bool, medium: FigureFormat = PAGE
) -> Figure:
    """Draw for each location how soon the ring was found in either version, and how often it was not.

    Parameters
    ----------
    locations : sequence of LocationResult
        In order, by sequence.
    limit : float
        The longest time limit [s].
    simulated : bool
        Whether simulated participants searched.
    medium : FigureFormat
        Where it is shown.
    """
    places = _row_places(locations)
    with look(medium):
        em = medium.em
        left = (NAME_WIDTH + 1.0) * em
        width = medium.width - left - (COUNT_WIDTH + FACTOR_WIDTH + 1.5) * em
        lines, above = heading_lines(*_heading(locations, simulated), medium.width - 2 * em, em)
        top = above + 3.0 * em
        lowest, highest = places[-1] + 0.65, -HEADING / ROW - 0.1
        height = (lowest - highest) * ROW * em
        figure = new_figure(medium, top + height + 5.6 * em)
        lines_at(figure, em, lines)
        axes = axes_at(figure, left, top, width, height)
        axes.set(xlim=(0, 1.04 * limit), ylim=(lowest, highest))
        _frame(axes, limit)
        _draw_columns(axes, locations, places)
        _draw_cells(axes, locations, places, limit)
        _add_key(axes, -NAME_WIDTH * em / width, -3.6 * em / height)
    return figure


def times_points(locations: Sequence[LocationResult], origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return every number that the figure draws."""
    points = []
    for result in locations:
        for version, cell in (("ours", result.ours), ("baseline", result.baseline)):
            if cell is not None:
                points += _points_of(result.location.name, version, cell, origin)
    return tuple(points)


def _points_of(label: str, version: str, cell: LocationCell, origin: Origin) -> list[PlottedPoint]:
    """Return the numbers of one version at one location."""
    a = cell.averages
    axes = ("location", "1", "search time", "s", origin)
    return [
        PlottedPoint("times", f"median, {version}", label, None, a.curve.median, *axes,
                     low=a.curve.median_low, high=a.curve.median_high, n=a.n),
        PlottedPoint("times", f"mean of found, {version}", label, None, a.mean_found, *axes,
                     n=a.n - a.undetected),
        PlottedPoint("undetected", version, label, None, float(a.undetected), "location", "1",
                     "searches without success", "1", origin, n=a.n),
    ]  # fmt: skip


def _heading(locations: Sequence[LocationResult], simulated: bool) -> tuple[str, str]:
    """Return title and subtitle."""
    cells = [cell for result in locations for cell in (result.ours, result.baseline) if cell]
    most = max(cell.averages.n for cell in cells)
    fewest = min(cell.averages.n for cell in cells)
    each = f"{most}" if most == fewest else f"{fewest} to {most}"
    who = f"{'Simulated: ' if simulated else ''}{each} participants search each location in each version. "
    return (
        "How long it takes to find the ring",
        who
        + "Within a sequence from the locations that ours brightens most to those that it dims most. Bars: "
        "95 % confidence intervals of the median (Kaplan–Meier); an arrow: no upper end within "
        "the time limit.",
    )


def _row_places(locations: Sequence[LocationResult]) -> list[float]:
    """Return where each row lies, with room for the name of a sequence above its first [rows]."""
    places: list[float] = []
    down = -1.0
    for number, (_, own) in enumerate(groupby(locations, key=lambda r: r.location.sequence)):
        down += HEADING / ROW if number else 0.0
        for _ in own:
            down += 1.0
            places.append(down)
    return places


def _frame(axes: Axes, limit: float) -> None:
    """Set the axis of time, and draw the limit."""
    size = text_size()
    axes.set_xlabel("search time [s]")
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color=FAINT, linewidth=size / 18)
    axes.axvline(limit, color=MUTED, linewidth=size / 9, linestyle=(0, (3, 2)), zorder=1)
    axes.annotate("time limit", (limit, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3), ha="center",
                  textcoords="offset points", color=MUTED, fontsize=0.9 * size)  # fmt: skip


def _draw_columns(axes: Axes, locations: Sequence[LocationResult], places: list[float]) -> None:
    """Write names at the left; undetected rings and brightness factors at the right."""
    size = text_size()
    count, factor = 2.0 * size, (COUNT_WIDTH + 1.2) * size
    top = -HEADING / ROW
    for title, start in (("undetected / n", count), ("brightness factor", factor)):
        _above(axes, top, (start, 1.9 * size), title, INK)
        _above(axes, top, (start, 0.6 * size), "ours", OURS)
        _above(axes, top, (start + SECOND * size, 0.6 * size), "baseline", BASELINE)
    last = ""
    for result, place in zip(locations, places, strict=True):
        if result.location.sequence != last:
            last = result.location.sequence
            _write_sequence(axes, last, place)
        name = result.location.keypoint.replace("_", " ")[:LONGEST_NAME]
        _beside(axes, place, 0.0, -(NAME_WIDTH - 1.0) * size, name, INK)
        for cell, value, across in (
            (result.ours, result.location.ours, 0.0),
            (result.baseline, result.location.baseline, SECOND * size),
        ):  # fmt: skip
            if cell is None:
                _beside(axes, place, 1.0, count + across, "–", MUTED)
                continue
            lost = cell.averages.undetected
            _beside(axes, place, 1.0, count + across, f"{lost} / {cell.averages.n}", LOST if lost else MUTED)
            _beside(axes, place, 1.0, factor + across, "–" if value is None else f"{value:.2f}", INK)


def _above(axes: Axes, row: float, offset: tuple[float, float], words: str, colour: str) -> None:
    """Write words at the right of a row, so many points from the end of the axes."""
    axes.annotate(words, (1.0, row), xycoords=("axes fraction", "data"), xytext=offset,
                  textcoords="offset points", color=colour, annotation_clip=False)  # fmt: skip


def _write_sequence(axes: Axes, sequence: str, place: float) -> None:
    """Write the name of a sequence above its first row, and a line."""
    size = text_size()
    name = drawable(sequence.replace("_", " "))
    axes.annotate(name, (0.0, place - 0.5), xycoords=("axes fraction", "data"), va="bottom",
                  xytext=(-NAME_WIDTH * size, 0.15 * size), textcoords="offset points", fontweight="bold",
                  annotation_clip=False)  # fmt: skip
    axes.axhline(place - 0.5, color=FAINT, linewidth=size / 11, zorder=0.5)


def _beside(axes: Axes, place: float, fraction: float, across: float, words: str, colour: str) -> None:
    """Write words beside a row, so many points from the left or right end of the axes."""
    axes.annotate(drawable(words), (fraction, place), xycoords=("axes fraction", "data"), xytext=(across, 0),
                  textcoords="offset points", va="center", color=colour, annotation_clip=False)  # fmt: skip


def _draw_cells(axes: Axes, locations: Sequence[LocationResult], places: list[float], limit: float) -> None:
    """Draw medians, intervals and means."""
    for result, place in zip(locations, places, strict=True):
        for cell, colour, offset in ((result.ours, OURS, -OFFSET), (result.baseline, BASELINE, OFFSET)):
            if cell is not None:
                _draw_cell(axes, cell, place + offset, colour, limit)


def _draw_cell(axes: Axes, cell: LocationCell, place: float, colour: str, limit: float) -> None:
    """Draw the median of a version with its interval, and the mean of the rings found."""
    size = text_size()
    curve = cell.averages.curve
    low = curve.median_low
    if low is not None:
        high = limit if curve.median_high is None else curve.median_high
        axes.plot(
            [low, high], [place, place], color=colour, linewidth=size / 5, solid_capstyle="butt", zorder=3
        )
        if curve.median_high is None:
            axes.plot(limit, place, ">", color=colour, ms=0.55 * size, zorder=3, clip_on=False)
    if curve.median is not None:
        axes.plot(
            curve.median, place, "o", color=colour, ms=0.62 * size, mec="white", mew=size / 14, zorder=5
        )
    if cell.averages.mean_found is not None:
        axes.plot(cell.averages.mean_found, place, "|", color=INK, ms=0.62 * size, mew=size / 8, zorder=6)


def _add_key(axes: Axes, across: float, down: float) -> None:
    """Write below the axes what the marks are, so far from their lower left corner [widths, heights]."""
    size = text_size()
    for colour, words in ((OURS, "ours: median, 95 %"), (BASELINE, "baseline: median, 95 %")):
        axes.plot(
            [], [], color=colour, linewidth=size / 5, marker="o", ms=0.62 * size, mec="white", label=words
        )
    axes.plot(
        [],
        [],
        "|",
        color=INK,
        ms=0.62 * size,
        mew=size / 8,
        label="mean of the rings found (as in the paper)",
    )
    axes.legend(loc="upper left", bbox_to_anchor=(across, down), ncols=3)

"""The figure of the detection times (Section 4.2): every location, both versions, with what was not found."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

from matplotlib.axes import Axes

from evenlight.analysis import figure_style as style
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.results import Drawing
from evenlight.analysis.rows import Plot
from evenlight.analysis.search import search_numbers as of
from evenlight.analysis.search.search_numbers import Study
from evenlight.analysis.search.search_trials import Location
from evenlight.analysis.wording import of_track, percent, spaced
from evenlight.data_schema.analysis_results import Statistic

ROW = 1.62  # height of a location [em]
HEADING = 1.75  # of a sequence [em]
LONGEST_NAME = 18
NAME_WIDTH, COUNT_WIDTH, FACTOR_WIDTH = 11.5, 10.4, 9.2  # of the columns beside the axes [em]
# Of either version: colour, distance of its column from that of ours [em], and of its mark from the middle
# of the row [rows].
STYLE = {"ours": (style.OURS, 0.0, -0.2), "baseline": (style.BASELINE, 4.0, 0.2)}
# Where the columns of undetected rings and of brightness factors begin, from the right end of the axes [em].
COUNTS, FACTORS = 2.0, COUNT_WIDTH + 1.2
UNDETECTED = ("location", "1", "searches without success", "1")


def times_figure(study: Study) -> Drawing:
    """Draw for each location how soon the ring was found in either version, and how often it was not."""
    places = _row_places(study.table.locations)
    with style.look():
        em = PAGE.em
        left = (NAME_WIDTH + 1.0) * em
        columns = COUNT_WIDTH + (FACTOR_WIDTH if _factors_known(study) else 0.0)
        width = PAGE.width - left - (columns + 1.5) * em
        lines, above = style.heading_lines(*_heading(study), PAGE.width - 2 * em, em)
        top = above + 3.0 * em
        lowest, highest = places[-1] + 0.65, -HEADING / ROW - 0.1
        height = (lowest - highest) * ROW * em
        figure = style.new_figure(top + height + 5.6 * em)
        style.lines_at(figure, em, lines)
        axes = style.axes_at(figure, left, top, width, height)
        limit = float(study.table.limits.max())
        axes.set(xlim=(0, 1.04 * study.span(limit)), ylim=(lowest, highest))
        _frame(axes, limit)
        _head_columns(axes, study)
        plot = Plot(axes, "times", study.rows.origin, ("location", "1", "search time", "s"))
        lost = Plot(axes, "undetected", study.rows.origin, UNDETECTED)
        lost.points = plot.points  # one table, location by location
        _draw_locations(plot, lost, study, places)
        _add_key(axes, -NAME_WIDTH * em / width, -3.6 * em / height)
    last = "undetected rings, and brightness factors" if _factors_known(study) else "and undetected rings"
    caption = (
        "Search times at each location in both versions: medians with 95 % confidence intervals, means "
        f"of the rings found, {last}."
    )
    return Drawing("search_times", figure, caption, tuple(plot.points))


def _factors_known(study: Study) -> bool:
    return any(place.ours or place.baseline for place in study.table.locations)


def _heading(study: Study) -> tuple[str, str]:
    searched = [row.n or 0 for row in study.rows.of("locations", of.LOST)]
    people, times = _span(searched), ""
    if study.table.repeated:
        people, times = f"{len(study.table.participants)}", f" {_span(study.searches_each)} times"
    order = "Within a sequence from the locations that the track brightens most to those that it dims most. "
    return (
        "How long it takes to find the ring",
        f"{'Simulated: ' if study.simulated else ''}{people} participants search each location{times} "
        f"in each version. {order if _factors_known(study) else ''}Bars: 95 % confidence intervals of the "
        "median (Kaplan–Meier); an arrow: no upper end within the time limit.",
    )


def _span(numbers: Sequence[int]) -> str:
    fewest, most = min(numbers), max(numbers)
    return f"{most}" if most == fewest else f"{fewest} to {most}"


def _row_places(locations: tuple[Location, ...]) -> list[float]:
    """Return where each row lies, with room for the name of a sequence above its first [rows]."""
    places: list[float] = []
    down = -1.0
    for number, (_, own) in enumerate(groupby(locations, key=lambda place: place.sequence)):
        down += HEADING / ROW if number else 0.0
        for _ in own:
            down += 1.0
            places.append(down)
    return places


def _frame(axes: Axes, limit: float) -> None:
    size = style.text_size()
    axes.set_xlabel("search time [s]")
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color=style.FAINT, linewidth=size / 18)
    if limit < axes.get_xlim()[1]:
        axes.axvline(limit, color=style.MUTED, linewidth=size / 9, linestyle=(0, (3, 2)), zorder=1)
        axes.annotate(
            "time limit",
            (limit, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3),
            ha="center",
            textcoords="offset points",
            color=style.MUTED,
            fontsize=0.9 * size,
        )


def _head_columns(axes: Axes, study: Study) -> None:
    columns = {"undetected" if study.table.repeated else "undetected / n": COUNTS}
    if _factors_known(study):
        columns["brightness factor"] = FACTORS
    for title, start in columns.items():
        _write(axes, title, (1.0, -HEADING / ROW), (start, 1.9), color=style.INK)
        for version, (colour, aside, _) in STYLE.items():
            _write(axes, version, (1.0, -HEADING / ROW), (start + aside, 0.6), color=colour)


def _write(
    axes: Axes, words: str, place: tuple[float, float], aside: tuple[float, float], **text: Any
) -> None:
    """Write words beside a row, so far from the left or right end of the axes [em]."""
    size = style.text_size()
    axes.annotate(
        style.drawable(words),
        place,
        xycoords=("axes fraction", "data"),
        xytext=(aside[0] * size, aside[1] * size),
        textcoords="offset points",
        annotation_clip=False,
        **text,
    )


def _draw_locations(plot: Plot, lost: Plot, study: Study, places: list[float]) -> None:
    axes, size, last = plot.axes, style.text_size(), ""
    for location, place in zip(study.table.locations, places, strict=True):
        if location.sequence != last:
            last = location.sequence
            name, corner = spaced(last), (-NAME_WIDTH, 0.15)
            _write(axes, name, (0.0, place - 0.5), corner, va="bottom", fontweight="bold")
            axes.axhline(place - 0.5, color=style.FAINT, linewidth=size / 11, zorder=0.5)
        name = spaced(location.keypoint)[:LONGEST_NAME]
        _write(axes, name, (0.0, place), (1.0 - NAME_WIDTH, 0), va="center", color=style.INK)
        found = {row.what: row for row in study.rows if row.group == location.name}
        for version, (colour, aside, offset) in STYLE.items():
            undetected = found.get(f"{of.LOST}, {version}")
            lacking = style.LOST if undetected and undetected.value else style.MUTED
            words = _count(undetected, study.table.repeated)
            _write(axes, words, (1.0, place), (COUNTS + aside, 0), va="center", color=lacking)
            if undetected is None:
                continue
            if _factors_known(study):
                factor = found[f"{of.FACTOR}, {version}"].value
                words = "–" if factor is None else f"{factor:.2f}"
                _write(axes, words, (1.0, place), (FACTORS + aside, 0), va="center", color=style.INK)
            median = found[f"{of.MEDIAN}, {version}"]
            ends = (median.ci_low, median.ci_high)
            plot.note(f"median, {version}", None, median.value, location.name, median.n, ends)
            _draw_median(axes, median, place + offset, colour, axes.get_xlim()[1] / 1.04)
            mean = found[f"{of.MEAN}, {version}"]
            plot.note(f"mean of found, {version}", None, mean.value, location.name, mean.n)
            lost.note(version, None, undetected.value, location.name, undetected.n)
            if mean.value is not None:
                axes.plot(
                    mean.value, place + offset, "|", color=style.INK, ms=0.62 * size, mew=size / 8, zorder=6
                )


def _count(undetected: Statistic | None, repeated: bool) -> str:
    """Return how many of the searches had no success: of many, as a share."""
    if undetected is None or undetected.value is None or not undetected.n:
        return "–"
    if repeated:
        return percent(undetected.value / undetected.n, 0)
    return f"{undetected.value:.0f} / {undetected.n}"


def _draw_median(axes: Axes, median: Statistic, place: float, colour: str, limit: float) -> None:
    """Draw a median with its interval; an arrow where that ends beyond the limit."""
    size = style.text_size()
    if median.ci_low is not None:
        high = limit if median.ci_high is None else median.ci_high
        bar: dict[str, Any] = {"linewidth": size / 5, "solid_capstyle": "butt", "zorder": 3}
        axes.plot([median.ci_low, high], [place, place], color=colour, **bar)
        if median.ci_high is None:
            axes.plot(limit, place, ">", color=colour, ms=0.55 * size, zorder=3, clip_on=False)
    if median.value is not None:
        mark: dict[str, Any] = {"ms": 0.62 * size, "mec": "white", "mew": size / 14, "zorder": 5}
        axes.plot(median.value, place, "o", color=colour, **mark)


def _add_key(axes: Axes, across: float, down: float) -> None:
    """Write below the axes what the marks are, so far from their lower left corner [widths, heights]."""
    size = style.text_size()
    for version, (colour, _, _) in STYLE.items():
        mark: dict[str, Any] = {"linewidth": size / 5, "marker": "o", "ms": 0.62 * size, "mec": "white"}
        axes.plot([], [], color=colour, label=f"{of_track(version)}: median, 95 %", **mark)
    mean: dict[str, Any] = {
        "label": "mean of the rings found (as in the paper)",
        "ms": 0.62 * size,
        "mew": size / 8,
    }
    axes.plot([], [], "|", color=style.INK, **mean)
    axes.legend(loc="upper left", bbox_to_anchor=(across, down), ncols=3)

"""The figures of the interaction: time over brightness ratio, and rings found over time on either side."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import Bbox

from evenlight.analysis import figure_style as style
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.results import Drawing
from evenlight.analysis.rows import Plot
from evenlight.analysis.search.search_models import LocationLine
from evenlight.analysis.search.search_numbers import RATIO, VERSIONS, Study
from evenlight.analysis.search.search_pairs import found_over_time
from evenlight.analysis.search.search_trials import BrightnessEffect
from evenlight.analysis.wording import of_track, participants
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.arrays import Array

TICKS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0)
LINE_STEPS = 61
MOST_NAMED = 4
STEPS_ASIDE = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.5, -4.5, 6.0, -6.0)  # of a name [lines of text]
FURTHEST = math.log(12.0)  # an interval beyond is drawn with an arrow
RATIOS = ("brightness of ours / baseline", "1", "search time of ours / baseline", "1")
OVER_TIME = ("search time", "s", "rings found", "%")
PANELS = {"ours dims": BrightnessEffect.DIMMED, "ours brightens": BrightnessEffect.BRIGHTENED}
COLOURS = {"ours": style.OURS, "baseline": style.BASELINE}

_Shown = tuple[float, Statistic, str]  # ln(brightness ratio), time ratio and name of a location


def brightness_figure(study: Study) -> Drawing | None:
    """Draw the ratio of times at each location over the ratio of brightness; None where none has both."""
    shown = _shown(study)
    if not shown:
        return None
    with style.look():
        em = PAGE.em
        left = 5.2 * em
        width = PAGE.width - left - 1.5 * em
        lines, above = style.heading_lines(*_heading(study, len(shown)), PAGE.width - 2 * em, em)
        height = 0.5 * width
        figure = style.new_figure(above + 1.4 * em + height + 6.4 * em)
        style.lines_at(figure, em, lines)
        axes = style.axes_at(figure, left, above + 1.4 * em, width, height)
        line, locations = (Plot(axes, "times", study.rows.origin, RATIOS) for _ in range(2))
        _frame(axes, shown)
        if not isinstance(study.line, str):
            _draw_line(line, study.line, [x for x, _, _ in shown])
        _draw_locations(locations, shown, len(study.table.participants))
        _name_the_odd(axes, shown)
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -4.0 * em / height), ncols=4)
    caption = (
        "Ratio of search times over ratio of brightness factors, the track to baseline, with 95 % confidence "
        "intervals; the line over locations with its pointwise 95 % confidence band, and the line of no "
        "difference."
    )
    return Drawing("search_brightness", figure, caption, (*locations.points, *line.points))


def _shown(study: Study) -> list[_Shown]:
    """Return the locations that have both a ratio of brightness and one of times."""
    rows = ((place, study.rows.find("locations", place.name, RATIO)) for place in study.table.locations)
    return [
        (place.ln_ratio, row, place.in_words)
        for place, row in rows
        if place.ln_ratio is not None and row is not None and row.value is not None
    ]


def _heading(study: Study, drawn: int) -> tuple[str, str]:
    words = (
        f"{_who(study)}. Search time over brightness, the track against the baseline, at each location; "
        "named are those whose own interval excludes 1."
    )
    if not isinstance(study.line, str):
        words += " The line is for locations like these."
    if missing := len(study.table.locations) - drawn:
        words += f" {missing} locations have no ratio of their own."
    return "Does more light save time?", words


def _who(study: Study) -> str:
    simulated = "Simulated: " if study.simulated else ""
    return f"{simulated}{participants(len(study.table.participants))}"


def _frame(axes: Axes, shown: list[_Shown]) -> None:
    """Set the axes: both logarithmic, with the lines of no difference."""
    size = style.text_size()
    ends = (math.log(end) for _, row, _ in shown for end in (row.ci_low, row.ci_high) if end)
    widest = 1.12 * max([abs(place) for place, _, _ in shown] + [0.1])
    reach = 1.08 * max([min(abs(end), FURTHEST) for end in ends] + [0.3])
    axes.set(xlim=(-widest, widest), ylim=(-reach, reach))
    axes.axhline(0.0, color=style.INK, linewidth=size / 10, zorder=1)
    axes.axvline(0.0, color=style.MUTED, linewidth=size / 12, linestyle=(0, (1, 2)), zorder=1)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(FixedLocator([math.log(tick) for tick in TICKS]))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{math.exp(value):.3g}"))
        axis.set_minor_locator(NullLocator())
    axes.set_xlabel("brightness factor of the track / baseline")
    axes.set_ylabel("search time of the track / baseline")
    for words, across, down, ha, va in (
        ("← the track dims", 0.0, 1.0, "left", "bottom"),
        ("the track brightens →", 1.0, 1.0, "right", "bottom"),
        (" the track slower", 0.0, 0.99, "left", "top"),
        (" the track faster", 0.0, 0.01, "left", "bottom"),
    ):
        axes.text(across, down, words, transform=axes.transAxes, ha=ha, va=va, color=style.MUTED)


def _draw_line(plot: Plot, line: LocationLine, places: list[float]) -> None:
    x = np.linspace(min(places), max(places), LINE_STEPS)
    middle, low, high = line.band(x)
    for at, y, *ends in np.exp([x, middle, low, high]).T.tolist():
        plot.note("line over locations", at, y, n=len(line.locations), ends=(ends[0], ends[1]))
    plot.axes.plot(x, middle, color=style.OURS, zorder=3, label="line over locations")
    band: dict[str, Any] = {"color": style.OURS, "alpha": 0.14, "linewidth": 0, "zorder": 0.5}
    plot.axes.fill_between(x, low, high, label="its 95 % confidence band", **band)


def _draw_locations(plot: Plot, shown: list[_Shown], people: int) -> None:
    axes, size = plot.axes, style.text_size()
    for x, row, name in shown:
        plot.note("location", math.exp(x), row.value, name, people, (row.ci_low, row.ci_high))
        axes.plot([x, x], _bar(axes, row), color=style.BASELINE, linewidth=size / 8, alpha=0.75, zorder=2)
    marks: dict[str, Any] = {"ms": 0.62 * size, "mec": "white", "mew": size / 14, "zorder": 4}
    y = [math.log(row.value or 1.0) for _, row, _ in shown]
    axes.plot([x for x, _, _ in shown], y, "o", color=style.BASELINE, label="a location, 95 %", **marks)


def _bar(axes: Axes, row: Statistic) -> tuple[float, float]:
    """Return the ends of an interval as they are drawn, within the axes."""
    bottom, top = axes.get_ylim()
    low = bottom if row.ci_low is None else max(math.log(row.ci_low), bottom)
    return low, top if row.ci_high is None else min(math.log(row.ci_high), top)


def _name_the_odd(axes: Axes, shown: list[_Shown]) -> None:
    """Name the locations whose interval excludes a ratio of 1, each where it covers no other."""
    size = style.text_size()
    per_point = axes.figure.dpi / 72
    odd = [item for item in shown if item[1].p_value is not None and item[1].p_value < 0.05]
    taken = [Bbox(_corners(axes, x, row)) for x, row, _ in shown]
    inside = axes.get_window_extent()
    for x, row, name in sorted(odd, key=lambda item: item[1].p_value or 0.0)[:MOST_NAMED]:
        words = style.drawable(name)
        wide, high = (per_point * length for length in (0.52 * 0.9 * size * len(words), 1.2 * size))
        across, height = axes.transData.transform((x, math.log(row.value or 1.0)))
        gap = 0.7 * size * per_point
        boxes = [
            Bbox.from_bounds(left, height + step * high - high / 2, wide, high)
            for step in STEPS_ASIDE
            for left in (across + gap, across - gap - wide)
        ]
        within = [box for box in boxes if inside.contains(*box.min) and inside.contains(*box.max)] or boxes
        best = min(within, key=lambda box: sum(box.overlaps(other) for other in taken))
        taken.append(best)
        leftwards = best.x1 < across
        end = (best.x1 if leftwards else best.x0), (best.y0 + best.y1) / 2
        left, up = axes.transData.inverted().transform(end)
        side = "right" if leftwards else "left"
        axes.text(left, up, words, zorder=5, fontsize=0.9 * size, va="center", ha=side)


def _corners(axes: Axes, x: float, row: Statistic) -> Array:
    """Return the corners of what is drawn of a location, in pixels."""
    half = np.array([0.3 * style.text_size() * axes.figure.dpi / 72, 0.0])
    ends = axes.transData.transform([(x, end) for end in _bar(axes, row)])
    return np.array([ends[0] - half, ends[1] + half])


def curves_figure(study: Study) -> Drawing | None:
    """Draw the share of the rings found over time; None where ours neither brightens nor dims anywhere."""
    sides = study.table.sides[study.table.location]
    panels = {panel: side for panel, side in PANELS.items() if (sides == side).any()}
    if not panels:
        return None
    heading = "How many rings are found, and when", f"{_who(study)}. Bands: 95 %, over participants."
    with style.look():
        figure, axes = style.panels(*heading, [list(panels)], [15.0], sharey=True)
        plots = [Plot(axes[panel], panel, study.rows.origin, OVER_TIME) for panel in panels]
        for plot, (panel, side) in zip(plots, panels.items(), strict=True):
            _draw_panel(plot, study, panel, sides == side)
        plots[0].axes.set_ylabel("rings found [%]")
        plots[0].axes.legend(loc="lower right", bbox_to_anchor=(0.98, 0.04))
    caption = (
        "Share of the rings found over time in both versions, where the track dims and where it brightens."
    )
    return Drawing("search_curves", figure, caption, tuple(point for plot in plots for point in plot.points))


def _draw_panel(plot: Plot, study: Study, panel: str, there: Array) -> None:
    axes, size, searches = plot.axes, style.text_size(), []
    limit = study.span(float(study.table.limits.min()))
    for version, ours in VERSIONS.items():
        own, colour = study.table.some(there & (study.table.ours == ours)), COLOURS[version]
        if not own.times.size:
            continue
        times, shares = found_over_time(own, limit)
        for time, share, *ends in zip(times.tolist(), *(100 * shares).tolist(), strict=True):
            low, high = (None if math.isnan(end) else end for end in ends)
            plot.note(version, time, share, n=own.times.size, ends=(low, high))
        axes.plot(times, 100 * shares[0], color=colour, zorder=3, label=f"{of_track(version)}, 95 % band")
        axes.fill_between(times, *(100 * shares[1:]), color=colour, alpha=0.16, linewidth=0)
        searches.append(f"{own.times.size}")
    axes.set(xlim=(0, limit), ylim=(0, 100), xlabel="search time [s]")
    axes.set_yticks(range(0, 101, 20))
    axes.grid(color=style.FAINT, linewidth=size / 18)
    axes.annotate(
        f"{of_track(panel)} (searches: {' and '.join(searches)})",
        (0.0, 1.0),
        (0, 0.6 * size),
        xycoords="axes fraction",
        textcoords="offset points",
        color=style.MUTED,
    )

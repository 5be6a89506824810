"""Figures of a benchmark: time over error, and time over size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from benchmarks.measured import Chart
from benchmarks.records import BenchmarkPoint, Role
from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    png_bytes,
    text_at,
)

UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6}  # of times [s]
# As wide as a page, for a screen: pictures that go with a document are small files.
SCREEN = replace(PAGE, dots_per_inch=110.0)
COLOUR = {
    Role.REFERENCE: INK,
    Role.DEFAULT: OURS,
    Role.VARIANT: OURS,
    Role.PEER: BASELINE,
    Role.CITED: LIMIT,
}
MARK = {Role.REFERENCE: "s", Role.DEFAULT: "o", Role.VARIANT: "o", Role.PEER: "D", Role.CITED: "x"}
MEANING = {
    Role.REFERENCE: "reference",
    Role.DEFAULT: "ours, as it runs by default",
    Role.VARIANT: "ours, one thing changed",
    Role.PEER: "peer, same run",
    Role.CITED: "published, another machine",
}
LINE = 0.19  # [inch] of the list of approaches
LEAST_GAP = 1.7  # lines of text between two labels
NEAR = 0.25  # [inch] points nearer than this in both directions share a label


def chart_png(chart: Chart, points: Sequence[BenchmarkPoint]) -> bytes:
    """Return a figure of the points of a chart's tasks as a PNG."""
    with look(SCREEN):
        return png_bytes(chart_figure(chart, points))


def chart_figure(chart: Chart, points: Sequence[BenchmarkPoint]) -> Figure:
    """Return the figure; within `look`."""
    shown = [p for p in points if p.task in chart.tasks]
    return _over_size(chart, shown) if chart.over_size else _over_error(chart, shown)


def _over_error(chart: Chart, points: list[BenchmarkPoint]) -> Figure:
    """Return time over error, a numbered point for each approach, and a list of what the numbers are."""
    known = sorted((p for p in points if p.error is not None), key=lambda p: (p.error, p.time))
    em = SCREEN.em
    meanings = "; ".join(dict.fromkeys(p.error_of for p in points if p.error is not None))
    title, below = heading_lines(
        chart.title, f"lower left is better; error: {meanings}", SCREEN.width - 1.2, em
    )
    top = below + 1.9 * em + 2.75 + 4.2 * em  # of the list
    figure = new_figure(top + LINE * (len(known) + 1), SCREEN)
    lines_at(figure, 0.5, title)
    axes = axes_at(figure, 0.9, below + 1.9 * em, SCREEN.width - 1.3, 2.75)
    positive = [p.error for p in known if p.error]
    none_at = min(positive, default=1e-6) / 10  # where an error of exactly 0 is drawn
    positive_only = len(positive) == len(known)
    for p in known:
        _mark(axes, p, p.error or none_at)
    axes.set(xscale="log", yscale="log", xlabel="error", ylabel="time")
    _label_ticks(axes, lambda error: f"{error:g}" if error > none_at * 3 or positive_only else "")
    if not positive_only:
        axes.axvline(none_at * 3, color=FAINT, linewidth=0.8)
        axes.annotate(
            "no error", (none_at, 0.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
            textcoords="offset points", ha="center", color=MUTED,
        )  # fmt: skip
    axes.margins(0.08, 0.15)
    _tick_often_enough(axes)
    _number(axes, [(p.error or none_at, p.time) for p in known])
    _role_legend(axes, known)
    for number, p in enumerate(known, start=1):
        words = f"{number}  {p.approach}: {duration(p.time)}, {_error(p.error)}"
        text_at(figure, 0.75, top, words, color=COLOUR[p.role])
        top += LINE
    return figure


def _over_size(chart: Chart, points: list[BenchmarkPoint]) -> Figure:
    """Return time over size, a line for each approach, labelled at its end."""
    figure = new_figure(4.2, SCREEN)
    em = SCREEN.em
    title, below = heading_lines(chart.title, "dotted: time in proportion to size", SCREEN.width - 1.2, em)
    lines_at(figure, 0.5, title)
    axes = axes_at(figure, 0.9, below + 0.8 * em, SCREEN.width - 3.4, 4.2 - below - 4.4 * em)
    axes.set(xscale="log", yscale="log", xlabel=points[0].size_of, ylabel="time")
    _label_ticks(axes, lambda size: f"{size:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}"))
    ends = []
    lines = cycle(("--", "-.", ":"))
    for approach in dict.fromkeys(p.approach for p in points):
        row = sorted((p for p in points if p.approach == approach), key=lambda p: p.size)
        x, y = [p.size for p in row], [p.time for p in row]
        style: str = "-" if row[0].role is Role.DEFAULT else next(lines)
        axes.plot(x, y, marker=MARK[row[0].role], color=COLOUR[row[0].role], linestyle=style)
        axes.fill_between(
            x, [p.time_low for p in row], [p.time_high for p in row], color=COLOUR[row[0].role], alpha=0.15,
            linewidth=0,
        )  # fmt: skip
        ends.append((y[-1], float(x[-1]), approach, COLOUR[row[0].role]))
    default = [p for p in points if p.role is Role.DEFAULT] or points
    first = min(default, key=lambda p: p.size)
    reach = np.array([first.size, max(p.size for p in points)])
    axes.plot(reach, first.time * reach / first.size, color=MUTED, linestyle=":", zorder=0)
    _tick_often_enough(axes)
    _label_ends(axes, ends)
    return figure


def _mark(axes: Axes, p: BenchmarkPoint, error: float) -> None:
    """Draw one point with the quartiles of its time."""
    colour = COLOUR[p.role]
    axes.plot([error, error], [p.time_low, p.time_high], color=colour, linewidth=1)
    hollow = p.role is Role.VARIANT
    axes.plot(error, p.time, MARK[p.role], color=colour, markerfacecolor="white" if hollow else colour)


def _number(axes: Axes, places: Sequence[tuple[float, float]]) -> None:
    """Write the number of each point beside it, from 1 on; neighbours' numbers stand side by side."""
    axes.figure.canvas.draw()
    spots = [axes.transData.transform(place) for place in places]
    groups: list[list[int]] = []
    for k, spot in enumerate(spots):
        for group in groups:
            if any(np.abs(spots[other] - spot).max() < NEAR * SCREEN.dots_per_inch for other in group):
                group.append(k)
                break
        else:
            groups.append([k])
    for group in groups:
        beside = places[max(group, key=lambda k: spots[k][0])]
        words = ", ".join(str(k + 1) for k in group)
        axes.annotate(words, beside, xytext=(5, 4), textcoords="offset points", color=INK)


def _label_ticks(axes: Axes, x_words: Callable[[float], str]) -> None:
    """Write times as such beside the ticks, and along the other axis what a function makes of its values."""
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: x_words(value)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: duration(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())


def _tick_often_enough(axes: Axes) -> None:
    """Put more ticks than powers of ten on an axis that holds fewer than three of them."""
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        span = limits[1] / limits[0]
        if span < 5:
            axis.set_major_locator(MaxNLocator(4))
        elif span < 1000:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if span < 100 else (1.0, 3.0)))


def _role_legend(axes: Axes, points: Sequence[BenchmarkPoint]) -> None:
    """Say above the axes what the marks mean."""
    for role in Role:
        if any(p.role is role for p in points):
            face = "white" if role is Role.VARIANT else COLOUR[role]
            axes.plot([], [], MARK[role], color=COLOUR[role], markerfacecolor=face, label=MEANING[role])
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, borderaxespad=0.4)


def _label_ends(axes: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """Write the name of each line beside its last point, apart from one another."""
    axes.figure.canvas.draw()
    height = axes.get_window_extent().height
    gap = LEAST_GAP * SCREEN.font_size / 72 * SCREEN.dots_per_inch / height
    last = -np.inf
    for y, x, words, colour in sorted(ends):
        at = axes.transAxes.inverted().transform(axes.transData.transform((x, y)))[1]
        last = max(at, last + gap)
        axes.annotate(
            words, (x, y), xycoords="data", xytext=(1.03, last), textcoords="axes fraction", va="center",
            color=colour, arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5, "alpha": 0.6},
            annotation_clip=False,
        )  # fmt: skip


def duration(seconds: float) -> str:
    """Return a time in the unit that suits it.

    >>> duration(0.0123), duration(4e-5), duration(95.0)
    ('12.3 ms', '40 µs', '95 s')
    """
    for unit, least in UNITS.items():
        if seconds >= least:
            return f"{seconds / least:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"


def _error(error: float | None) -> str:
    """Return an error in words."""
    return "no error" if not error else f"error {error:.2g}"

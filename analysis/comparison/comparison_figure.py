"""The figures of the artifact comparison: shares with their intervals, and what so many answers can show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from evenlight.analysis import figure_style as style
from evenlight.analysis.comparison.comparison_results import ALL, POWER, Comparison
from evenlight.analysis.comparison.comparison_shares import ShareEstimate
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.inference.binomial_tests import (
    HALF,
    difference_power,
    margin_shown,
    smallest_margin_ever,
)
from evenlight.analysis.results import Drawing
from evenlight.analysis.rows import Plot
from evenlight.analysis.wording import counted, participants, spaced
from evenlight.data_schema.analysis_results import Origin

Look = dict[str, Any]
LARGER = (50, 100, 200)  # numbers of answers drawn beside the experiment's own
SHARES = np.linspace(0.5, 1.0, 101)
MARGIN_NUMBERS = np.unique(2 * np.geomspace(4, 500, 60).round().astype(int))  # even: no jumps
LINES = ("-", (0, (5, 1.6)), (0, (2.5, 1.4)), (0, (1, 1.2)))
LONGEST_NAME = 28  # characters


def shares_figure(found: Comparison) -> Drawing:
    """Draw the share of each sequence with its interval, one half, and the margin about it."""
    names = {name: "all answers" if name == ALL else name for name in found.listed}
    shares = found.shares.values()
    exact = found.pooled.choices.one_each or all(s is None or s.choices.one_each for s in shares)
    words = (
        f"{participants(found.people, found.data.simulated)}. Bars: 95 % confidence intervals "
        f"({'Clopper and Pearson' if exact else 'over participants'}; all answers: over participants). Band: "
        f"{found.within}, the margin within which a share counts as a coin's."
    )
    with style.look():
        em, width = PAGE.em, PAGE.width
        left = (1.5 + 0.6 * min(LONGEST_NAME, max(map(len, names.values())))) * em
        title = "Which of the two changed in brightness?"
        lines, above = style.heading_lines(title, words, width - 3 * em, em)
        height = (1.6 + 2.1 * len(names)) * em
        figure = style.new_figure(above + 1.6 * em + height + 4.2 * em)
        style.lines_at(figure, 1.5 * em, lines)
        axes = style.axes_at(figure, left, above + 1.6 * em, width - left - 12 * em, height)
        plot = Plot(axes, "shares", found.rows.origin, ("sequence", "1", "share of answers", "1"))
        _draw_margin(axes, found.margin)
        for place, (name, share) in enumerate(found.listed.items()):
            _draw_share(plot, place, names[name], share, is_all=name == ALL)
        axes.set(xlim=(0, 1), ylim=(len(names) - 0.45, -0.55))
        labels = [style.drawable(spaced(name[:LONGEST_NAME])) for name in names.values()]
        axes.set_yticks(range(len(names)), labels)
        axes.set_xticks(np.arange(0, 1.01, 0.1), [f"{k}" for k in range(0, 101, 10)])
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("the track taken for the one whose brightness changed [% of answers]")
    caption = (
        "Share of answers that took the track's version for the one whose brightness changed, with 95 % "
        f"confidence intervals; {participants(found.people)}. The band is {found.within}."
    )
    return Drawing("comparison_shares", figure, caption, tuple(plot.points))


def _draw_margin(axes: Axes, margin: float) -> None:
    """Draw one half and the margin about it, and say what the ends of the axis are."""
    size = style.text_size()
    band: Look = {"color": style.FAINT, "alpha": 0.55, "linewidth": 0, "zorder": 0}
    axes.axvspan(HALF - margin, HALF + margin, **band)
    axes.axvline(HALF, color=style.MUTED, linewidth=size / 9, zorder=1)
    look: Look = {"textcoords": "offset points", "color": style.MUTED, "fontsize": 0.9 * size}
    for share, said, side in ((0.0, "baseline chosen", "left"), (1.0, "the track chosen", "right")):
        axes.annotate(said, (share, 1.0), (0, 3), xycoords=("data", "axes fraction"), ha=side, **look)


def _draw_share(plot: Plot, place: int, name: str, share: ShareEstimate | None, *, is_all: bool) -> None:
    size, axes, colour = style.text_size(), plot.axes, style.INK if is_all else style.OURS
    words = "no answer"
    if share is None:
        plot.note("ours chosen", None, None, name, 0)
    else:
        n, value = share.choices.people, share.choices.share
        low, high = share.difference.ci_low, share.difference.ci_high
        plot.note("ours chosen", None, value, name, n, (low, high))
        words = share.choices.count + ("" if share.choices.one_each else f" ({n} people)")
        if low is not None and high is not None:
            bar: Look = {"linewidth": size / 4.5, "zorder": 3, "solid_capstyle": "butt"}
            axes.plot([low, high], [place, place], color=colour, **bar)
        mark: Look = {"ms": 0.8 * size, "mec": "white", "mew": size / 12, "zorder": 4, "clip_on": False}
        axes.plot(value, place, "D" if is_all else "o", color=colour, **mark)
    beside: Look = {"textcoords": "offset points", "va": "center", "annotation_clip": False}
    axes.annotate(words, (1.0, place), (0.8 * size, 0), **beside)
    if is_all:
        axes.axhline(place - 0.5, color=style.FAINT, linewidth=size / 11, zorder=0)


def power_figure(own: int, margin: float) -> Drawing:
    """Draw what so many answers can show: power over the true share, and the smallest margin over n."""
    words = (
        "Exact binomial tests at 5 %, computed, for answers of so many different people. Left: how often a "
        "true share is found to differ from one half. Right: the smallest margin within which a share can be "
        "shown to agree with one half."
    )
    with style.look():
        title = f"What {counted(own, 'answer')} can show, and what they cannot"
        figure, axes = style.panels(title, words, [["power", "margins"]], [22.0])
        power = _draw_power(axes["power"], (own, *(n for n in LARGER if n > 1.5 * own)))
        margins = _draw_margins(axes["margins"], own, margin)
    caption = (
        f"What {counted(own, 'answer')} and more can show: how often a true share is found to differ from "
        "one half, and the smallest margin about one half that can be shown at all."
    )
    return Drawing("comparison_power", figure, caption, (*power.points, *margins.points))


def _draw_power(axes: Axes, numbers: Sequence[int]) -> Plot:
    size = style.text_size()
    units = ("true share", "1", "share of experiments that find it", "1")
    plot = Plot(axes, "power", Origin.COMPUTED, units)
    for k, n in enumerate(numbers):
        power = difference_power(n, SHARES)
        for x, y in zip(SHARES, power, strict=True):
            plot.note(f"n = {n}", float(x), float(y), n=n)
        colour, width = (style.OURS, size / 4) if k == 0 else (style.INK, size / 7)
        look: Look = {"color": colour, "linestyle": LINES[k], "linewidth": width}
        axes.plot(100 * SHARES, 100 * power, label=f"n = {n}", **look)
    axes.axhline(100 * POWER, color=style.MUTED, linewidth=size / 12, zorder=0)
    axes.axhline(5, color=style.LIMIT, linewidth=size / 12, zorder=0)
    axes.annotate("80 %", (50, 100 * POWER), (2, 2), textcoords="offset points", color=style.MUTED)
    chance: Look = {"textcoords": "offset points", "color": style.LIMIT, "ha": "right"}
    axes.annotate("5 %, by chance", (100, 5), (-2, 2), **chance)
    axes.set(xlim=(50, 100), ylim=(0, 101))
    axes.set(xlabel="true share choosing the track [%]", ylabel="found to differ [% of experiments]")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.13), handlelength=2.4)
    return plot


def _draw_margins(axes: Axes, own: int, margin: float) -> Plot:
    """Draw the margin that so many answers can show, at best and with 80 % power, over their number."""
    size = style.text_size()
    plot = Plot(axes, "margin", Origin.COMPUTED, ("answers", "1", "margin about 0.5", "1"))
    numbers = np.unique([*MARGIN_NUMBERS, own]).tolist()
    found = {
        "at best": {n: smallest_margin_ever(n) for n in numbers},
        "80 % power": {n: margin_shown(n, POWER) for n in numbers},
    }
    for series, margins in found.items():
        for n, value in margins.items():
            plot.note(series, float(n), value, n=n)
    best, likely = (np.array([100 * by[int(n)] for n in MARGIN_NUMBERS]) for by in found.values())
    axes.fill_between(MARGIN_NUMBERS, 0, best, color=style.BASELINE, alpha=0.2, linewidth=0, zorder=0)
    line: Look = {"linewidth": size / 7}
    axes.plot(MARGIN_NUMBERS, likely, color=style.INK, label="in 80 % of experiments, if true", **line)
    words = "at best: even numbers, divided evenly"
    axes.plot(MARGIN_NUMBERS, best, color=style.BASELINE, label=words, **line)
    mine = 100 * found["at best"][own]
    words = f"{counted(own, 'answer')}: ± {mine:.0f} points at best"
    axes.plot(own, mine, "o", color=style.OURS, ms=0.75 * size, zorder=4, label=words)
    dashed: Look = {"linewidth": size / 10, "linestyle": (0, (4, 3)), "zorder": 1}
    axes.axhline(100 * margin, color=style.MUTED, **dashed)
    wanted: Look = {"textcoords": "offset points", "color": style.MUTED, "ha": "right", "va": "bottom"}
    axes.annotate(f"wanted: ± {100 * margin:g}", (1000, 100 * margin), (0, 2), **wanted)
    axes.annotate("cannot be shown", (9, 3), color=style.MUTED, va="bottom")
    axes.set_xscale("log")
    ticks = (10, 20, 50, 100, 200, 500, 1000)
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set(xlim=(min(8, own), 1000), ylim=(0, 50))
    axes.set(xlabel="answers of different people", ylabel="margin about 50 % [± percentage points]")
    axes.legend(loc="upper right")
    return plot

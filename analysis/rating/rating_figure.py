"""The figure of detail ratings: ratings of each version back to back, and differences within participants."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from evenlight.analysis import figure_style as style
from evenlight.analysis.rating.rating_pairs import ALL, MEAN, POINTS, Ratings, Sample
from evenlight.analysis.results import Drawing
from evenlight.analysis.rows import Plot
from evenlight.analysis.wording import in_words, of_track, p_in_words, p_text
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING, Version

Look = dict[str, Any]
COLUMNS = 4  # panels side by side
PANEL_HEIGHT, ROW_HEIGHT = 11.0, 4.2  # of the ratings of a sequence, of a row of differences [em]
SIDES = {Version.BASELINE: (-1, style.BASELINE), Version.OURS: (1, style.OURS)}
RATINGS = range(LOWEST_RATING, HIGHEST_RATING + 1)
MEAN_SERIES = "mean and 95 % confidence interval"
_WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}  # behind a number that a line would cross
_BESIDE: Look = {"textcoords": "offset points", "annotation_clip": False}


def rating_figure(ratings: Ratings) -> Drawing:
    """Draw the ratings of each sequence, and below them the differences."""
    bars = (
        "Bars: how many ratings of each value, constant dimming (baseline) to the left, the track to the "
        "right. Diamonds: means with 95 % confidence intervals."
    )
    who = "simulated participant" if ratings.data.simulated else "participant"
    differences = f"Track less baseline, of each {who}, and its mean with 95 % confidence interval"
    page = style.PAGE
    with style.look():
        em, plots = page.em, []
        left, width = 5.0 * em, page.width - 6.2 * em
        lines, above = style.heading_lines(f"Detail ratings of {ratings.people}", bars, width, em)
        columns, rows = min(len(ratings.sequences), COLUMNS), -(-len(ratings.sequences) // COLUMNS)
        top, step = above + 3.0 * em, (PANEL_HEIGHT + 6.4) * em
        below, height = top + rows * step, len(ratings.shown) * ROW_HEIGHT * em
        figure = style.new_figure(below + height + 4.2 * em)
        style.lines_at(figure, left, lines)
        for k, name in enumerate(ratings.sequences):
            row, column = divmod(k, COLUMNS)
            wide = min(width / columns - 1.4 * em, 18 * em)
            across = left + column * width / columns
            axes = style.axes_at(figure, across, top + row * step, wide, PANEL_HEIGHT * em)
            plots.append(_draw_ratings(axes, ratings, name))
            axes.tick_params(labelleft=column == 0)
            axes.set_ylabel("rating (5 is best)" if column == 0 else "")
        style.text_at(figure, left, below - 1.9 * em, differences, fontweight="bold")
        names, numbers = 7.0 * em, 16.3 * em
        axes = style.axes_at(figure, left + names, below, width - names - numbers, height)
        plots.append(_draw_differences(axes, ratings))
    caption = (
        f"Detail ratings of {ratings.people}: how often each rating was given to each version, and how the "
        "two differ for the same people (left of 0 the baseline is rated higher). Means with 95 % confidence "
        "intervals."
    )
    return Drawing("rating", figure, caption, tuple(point for plot in plots for point in plot.points))


def _draw_ratings(axes: Axes, ratings: Ratings, name: str) -> Plot:
    plot = Plot(axes, name, ratings.rows.origin, ("number of ratings", "1", "rating", POINTS))
    given = Counter((t.version, t.rating) for t in ratings.data.trials if t.sequence == name)
    most, size = max(given.values(), default=1), style.text_size()
    for version in SIDES:
        _draw_version(plot, version, {k: given[version, k] for k in RATINGS})
    for version, (side, colour) in SIDES.items():
        if mean := ratings.rows.find("means", name, f"mean rating, {version.value}"):
            units = ("version", "1", "mean rating", POINTS)
            series, look = f"{version.value}, {MEAN_SERIES}", {"color": colour, "clip_on": False}
            at = side * 1.62 * most
            plot.interval(series, version.value, mean, at, size, units, upright=True, **look)
            _name_version(axes, version, mean.n)
    axes.axvline(0, color="white", linewidth=size / 9)
    axes.set_xlim(-1.8 * most, 1.8 * most)
    axes.set_ylim(LOWEST_RATING - 0.6, HIGHEST_RATING + 0.6)
    axes.set(xticks=[], yticks=list(RATINGS))
    axes.spines["bottom"].set_visible(False)
    axes.set_title(style.drawable(in_words(name)), loc="left", fontweight="bold")
    return plot


def _draw_version(plot: Plot, version: Version, counts: dict[int, int]) -> None:
    (side, colour), size, total = SIDES[version], style.text_size(), sum(counts.values())
    series, bar = f"{version.value}, ratings", {"height": 0.78, "color": colour, "linewidth": 0}
    text: Look = {
        "va": "center",
        "ha": "left" if side > 0 else "right",
        "fontsize": 0.8 * size,
        "color": style.MUTED,
    }
    for rating, n in counts.items():
        plot.bar(series, float(n), float(rating), total, across=True, side=side, **bar)
        if n:
            at, beside = (side * n, rating), (side * 0.25 * size, 0)
            plot.axes.annotate(f"{n}", at, xytext=beside, **text, **_BESIDE)


def _name_version(axes: Axes, version: Version, n: int | None) -> None:
    (side, colour), size = SIDES[version], style.text_size()
    below: Look = {"xytext": (0, -0.5 * size), "xycoords": "axes fraction", "va": "top", **_BESIDE}
    look: Look = {"ha": "right" if side > 0 else "left", "fontsize": 0.85 * size, "color": colour}
    axes.annotate(f"{of_track(version.value)}\nn = {n}", (max(side, 0), 0), **below, **look)


def _difference_counts(pair: Sample) -> tuple[dict[float, int], float]:
    """Return how many participants have each difference, in bins, and their width [rating points]."""
    width = max(pair.step, 0.25) if pair.of else 1.0
    return dict(sorted(Counter((np.round(pair.values / width) * width).tolist()).items())), width


def _draw_differences(axes: Axes, ratings: Ratings) -> Plot:
    """Draw, a row for each sequence, how many participants have each difference, and the mean."""
    units = ("ours less baseline", POINTS, "number of participants", "1")
    plot = Plot(axes, "differences", ratings.rows.origin, units)
    drawn = {name: _difference_counts(pair) for name, pair in ratings.shown.items()}
    size, scale = (
        style.text_size(),
        0.6 / max(max(counts.values(), default=1) for counts, _ in drawn.values()),
    )
    of_mean = ("sequence", "1", "mean of ours less baseline", POINTS)
    for k, (name, (counts, width)) in enumerate(drawn.items()):
        floor = float(-k)
        axes.axhline(floor, color=style.FAINT, linewidth=size / 14, zorder=0)
        for x, count in counts.items():
            plot.note(f"{name}, bins of {width:g}", x, float(count), n=sum(counts.values()))
        _draw_counts(axes, floor, scale, counts, width)
        if mean := ratings.rows.find("differences", name, MEAN):
            at = floor - 0.13
            plot.interval(
                MEAN_SERIES, name, mean, at, size, of_mean, upright=False, color=style.INK, zorder=3
            )
            _write_beside(axes, floor + 0.12, name, mean, several=len(ratings.pairs) > 1)
    reach = max([1.6, *(abs(x) + 0.5 for counts, _ in drawn.values() for x in counts)])
    axes.axvline(0, color=style.INK, linewidth=size / 14, zorder=0.5)
    axes.set(xlim=(-reach, reach), ylim=(-len(drawn) + 0.68, 0.85), yticks=[])
    axes.set_xlabel("difference [rating points]:   baseline better  ←   →  the track better")
    axes.spines["left"].set_visible(False)
    return plot


def _draw_counts(axes: Axes, floor: float, scale: float, counts: dict[float, int], width: float) -> None:
    size = style.text_size()
    text: Look = {
        "ha": "center",
        "va": "bottom",
        "fontsize": 0.8 * size,
        "color": style.MUTED,
        "bbox": _WHITE,
    }
    for x, count in counts.items():
        colour = style.OURS if x > 0 else style.BASELINE if x < 0 else style.PARTICIPANT
        axes.bar(x, scale * count, bottom=floor, width=0.8 * width, color=colour, linewidth=0)
        if 0.8 * width > 0.3:
            above, beside = (x, floor + scale * count), (0, 0.1 * size)
            axes.annotate(f"{count}", above, xytext=beside, textcoords="offset points", **text)


def _write_beside(axes: Axes, at: float, name: str, mean: Statistic, *, several: bool) -> None:
    size = style.text_size()
    text: Look = {"va": "center", "xycoords": ("axes fraction", "data"), **_BESIDE}
    title = style.drawable("All, each\none's mean" if name == ALL else in_words(name))
    axes.annotate(title, (0.0, at), xytext=(-0.8 * size, 0), ha="right", fontweight="bold", **text)
    numbers: Look = {"ha": "left", "fontsize": 0.9 * size, "linespacing": 1.35}
    axes.annotate(_numbers(mean, several), (1.0, at), xytext=(0.8 * size, 0), **numbers, **text)


def _numbers(mean: Statistic, several: bool) -> str:
    """Return mean, interval, p and n of a row; Holm's p where there are several sequences."""
    if mean.value is None or mean.p_value is None:
        return mean.flag
    ends = "" if mean.ci_low is None else f"  [{mean.ci_low:+.2f}, {mean.ci_high:+.2f}]"
    holm = "" if mean.p_adjusted is None or not several else f" (Holm {p_text(mean.p_adjusted)})"
    return f"{mean.value:+.2f}{ends}\n{p_in_words(mean.p_value)}{holm}, n = {mean.n}".replace("-", "−")

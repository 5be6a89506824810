"""The figure of detail ratings: ratings of each version back to back, and differences within participants."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from evenlight.analysis import figure_style as style
from evenlight.analysis.rating.rating_pairs import ALL, MEAN, POINTS, Ratings, Sample
from evenlight.analysis.results import Drawing
from evenlight.analysis.rows import Plot
from evenlight.analysis.wording import in_words, of_track, p_in_words, p_text
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.rating_scale import RatingScale, exact
from evenlight.data_schema.recordings.viewing import Version

Look = dict[str, Any]
COLUMNS = 4  # panels side by side
PANEL_HEIGHT, ROW_HEIGHT = 11.0, 4.2  # of the ratings of a sequence, of a row of differences [em]
SIDES = {Version.BASELINE: (-1, style.BASELINE), Version.OURS: (1, style.OURS)}
MOST_BARS = 11  # bars of single ratings, as of 0 to 10; more stand together in up to 10
MEAN_SERIES = "mean and 95 % confidence interval"
_WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}  # behind a number that a line would cross
_BESIDE: Look = {"textcoords": "offset points", "annotation_clip": False}


class Bins(NamedTuple):
    """What ratings are counted in, each number or some that lie together: names, ends, whether each is one.

    What lies at an end belongs to the next bin, but for the last.
    """

    names: tuple[str, ...]
    ends: Array
    single: bool

    @property
    def middles(self) -> Array:
        """Their middles [rating points]."""
        return np.asarray((self.ends[1:] + self.ends[:-1]) / 2)


def bins_of(scale: RatingScale) -> Bins:
    """Return what ratings on a scale are counted in.

    >>> bins_of(RatingScale()).names, bins_of(RatingScale(1, 9, 0.5)).names[0]
    (('1', '2', '3', '4', '5'), '1 to 2')
    """
    low, steps = exact(scale.lowest), scale.range / scale.unit
    single = bool(scale.step) and steps < MOST_BARS
    number = int(steps) + 1 if single else next((k for k in range(10, 4, -1) if steps % k == 0), 10)
    width = scale.unit if single else scale.range / number
    ends = np.array([float(low + (k - Fraction(single, 2)) * width) for k in range(number + 1)])
    told = [f"{float(low + k * width):g}" for k in range(number + 1)]
    pairs = [f"{one} to {other}" for one, other in itertools.pairwise(told)]
    return Bins(tuple(told[:-1] if single else pairs), ends, single)


def rating_figure(ratings: Ratings) -> Drawing:
    """Draw the ratings of each sequence, and below them the differences."""
    counted = "of each value" if bins_of(ratings.data.scale).single else "in each range"
    bars = (
        f"Bars: how many ratings {counted}, constant dimming (baseline) to the left, the track to the "
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
            best = f"rating ({ratings.data.scale.highest:g} is best)"
            axes.set_ylabel(best if column == 0 else "")
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
    bins, size = bins_of(ratings.data.scale), style.text_size()
    given = {v: np.histogram(ratings.given(name, v), bins.ends)[0].tolist() for v in SIDES}
    most = max(*map(max, given.values()), 1)
    for version in SIDES:
        _draw_version(plot, version, bins, given[version])
    for version, (side, colour) in SIDES.items():
        if mean := ratings.rows.find("means", name, f"mean rating, {version.value}"):
            units = ("version", "1", "mean rating", POINTS)
            series, look = f"{version.value}, {MEAN_SERIES}", {"color": colour, "clip_on": False}
            at = side * 1.62 * most
            plot.interval(series, version.value, mean, at, size, units, upright=True, **look)
            _name_version(axes, version, mean.n)
    axes.axvline(0, color="white", linewidth=size / 9)
    axes.set_xlim(-1.8 * most, 1.8 * most)
    beyond = 0.1 * float(bins.ends[1] - bins.ends[0])
    axes.set_ylim(bins.ends[0] - beyond, bins.ends[-1] + beyond)
    axes.set(xticks=[], yticks=bins.middles if bins.single else bins.ends)
    axes.spines["bottom"].set_visible(False)
    axes.set_title(style.drawable(in_words(name)), loc="left", fontweight="bold")
    return plot


def _draw_version(plot: Plot, version: Version, bins: Bins, counts: list[int]) -> None:
    (side, colour), size, total = SIDES[version], style.text_size(), sum(counts)
    height = 0.78 * float(bins.ends[1] - bins.ends[0])
    series, bar = f"{version.value}, ratings", {"height": height, "color": colour, "linewidth": 0}
    text: Look = {
        "va": "center",
        "ha": "left" if side > 0 else "right",
        "fontsize": 0.8 * size,
        "color": style.MUTED,
    }
    for rating, n in zip(bins.middles.tolist(), counts, strict=True):
        plot.bar(series, float(n), rating, total, across=True, side=side, **bar)
        if n:
            at, beside = (side * n, rating), (side * 0.25 * size, 0)
            plot.axes.annotate(f"{n}", at, xytext=beside, **text, **_BESIDE)


def _name_version(axes: Axes, version: Version, n: int | None) -> None:
    (side, colour), size = SIDES[version], style.text_size()
    below: Look = {"xytext": (0, -0.5 * size), "xycoords": "axes fraction", "va": "top", **_BESIDE}
    look: Look = {"ha": "right" if side > 0 else "left", "fontsize": 0.85 * size, "color": colour}
    axes.annotate(f"{of_track(version.value)}\nn = {n}", (max(side, 0), 0), **below, **look)


def _finest(ratings: Ratings) -> float:
    """Return the narrowest bins of differences [rating points]: of 1 to 5, a quarter; of others, as fine."""
    seen = max((abs(x) for pair in ratings.pairs.values() for x in pair.values), default=0.0)
    wanted = min(ratings.largest, max(4.0, 2 * seen)) / 16
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(nice * power for nice in (1, 2.5, 5, 10) if nice * power >= wanted)


def _difference_counts(pair: Sample, finest: float) -> tuple[dict[float, int], float]:
    """Return how many participants have each difference, in bins, and their width [rating points]."""
    width = max(pair.step, finest) if pair.of else 1.0
    return dict(sorted(Counter((np.round(pair.values / width) * width).tolist()).items())), width


def _draw_differences(axes: Axes, ratings: Ratings) -> Plot:
    """Draw, a row for each sequence, how many participants have each difference, and the mean."""
    units = ("ours less baseline", POINTS, "number of participants", "1")
    plot = Plot(axes, "differences", ratings.rows.origin, units)
    finest = _finest(ratings)
    drawn = {name: _difference_counts(pair, finest) for name, pair in ratings.shown.items()}
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
        _draw_counts(axes, floor, scale, counts, width, labelled=0.8 * width > 1.2 * finest)
        if mean := ratings.rows.find("differences", name, MEAN):
            at = floor - 0.13
            plot.interval(
                MEAN_SERIES, name, mean, at, size, of_mean, upright=False, color=style.INK, zorder=3
            )
            _write_beside(axes, floor + 0.12, name, mean, several=len(ratings.pairs) > 1)
    reach = max([6.4 * finest, *(abs(x) + 2 * finest for counts, _ in drawn.values() for x in counts)])
    axes.axvline(0, color=style.INK, linewidth=size / 14, zorder=0.5)
    axes.set(xlim=(-reach, reach), ylim=(-len(drawn) + 0.68, 0.85), yticks=[])
    axes.set_xlabel("difference [rating points]:   baseline better  ←   →  the track better")
    axes.spines["left"].set_visible(False)
    return plot


def _draw_counts(
    axes: Axes, floor: float, scale: float, counts: dict[float, int], width: float, *, labelled: bool
) -> None:
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
        if labelled:
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

"""The figure of detail ratings and its numbers: ratings of each version, differences within participants."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
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
    text_at,
    text_size,
)
from evenlight.analysis.rating.rating_pairs import ALL, PairedRatings, VersionRatings
from evenlight.analysis.rating.rating_results import PairResult, RatingResults
from evenlight.analysis.rating.rating_statistics import POINTS, mean_of
from evenlight.analysis.wording import in_words, p_in_words, p_text
from evenlight.data_schema.analysis_results import Origin, PlottedPoint
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING, Version

COLUMNS = 4  # panels of ratings side by side
PANEL_HEIGHT = 11.0  # [em]
ROW_HEIGHT = 4.2  # of a sequence in the panel of differences [em]
FINEST_BIN = 0.25  # of differences between means of several ratings [rating points]
COLOURS = {Version.BASELINE: BASELINE, Version.OURS: OURS}
_WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}  # behind a number that a line would cross
RATINGS = range(LOWEST_RATING, HIGHEST_RATING + 1)


def rating_figure(results: RatingResults, medium: FigureFormat = PAGE) -> Figure:
    """Draw the ratings of both versions of each sequence, and below them the differences within participants.

    Parameters
    ----------
    results : RatingResults
        What is drawn.
    medium : FigureFormat
        Where it is shown.
    """
    with look(medium):
        em = medium.em
        left, width = 5.0 * em, medium.width - 6.2 * em
        lines, above = heading_lines(*_heading(results), width, em)
        columns = min(len(results.sequences), COLUMNS)
        rows = -(-len(results.sequences) // COLUMNS)
        top = above + 3.0 * em
        below = top + rows * (PANEL_HEIGHT + 6.4) * em
        height = len(results.shown) * ROW_HEIGHT * em
        figure = new_figure(medium, below + height + 4.2 * em)
        lines_at(figure, left, lines)
        for number, name in enumerate(results.sequences):
            row, column = divmod(number, COLUMNS)
            across, down = left + column * width / columns, top + row * (PANEL_HEIGHT + 6.4) * em
            wide = min(width / columns - 1.4 * em, 18 * em)
            axes = axes_at(figure, across, down, wide, PANEL_HEIGHT * em)
            _draw_ratings(axes, results, name)
            axes.tick_params(labelleft=column == 0)
            axes.set_ylabel("rating (5 is best)" if column == 0 else "")
        text_at(figure, left, below - 1.9 * em, _differences_in_words(results), fontweight="bold")
        names, numbers = 7.0 * em, 16.3 * em
        axes = axes_at(figure, left + names, below, width - names - numbers, height)
        _draw_differences(axes, results)
    return figure


def _heading(results: RatingResults) -> tuple[str, str]:
    """Return title and subtitle."""
    title = f"Detail ratings of {results.people}"
    return title, (
        "Bars: how many ratings of each value, constant dimming (baseline) to the left, ours to the right. "
        "Diamonds: means with 95 % confidence intervals."
    )


def _differences_in_words(results: RatingResults) -> str:
    """Return the heading of the lower panel."""
    who = "simulated participant" if results.simulated else "participant"
    return f"Difference ours − baseline of each {who}, and its mean with 95 % confidence interval"


def _draw_ratings(axes: Axes, results: RatingResults, name: str) -> None:
    """Draw how often each rating was given, back to back, and the means."""
    versions = {version: results.versions[name, version] for version in COLOURS}
    most = max(max(Counter(ratings.ratings).values(), default=1) for ratings in versions.values())
    for version, side in ((Version.BASELINE, -1), (Version.OURS, 1)):
        _draw_bars(axes, versions[version], side)
        _draw_mean(axes, versions[version], side * 1.62 * most)
    axes.axvline(0, color="white", linewidth=text_size() / 9)
    axes.set(xlim=(-1.8 * most, 1.8 * most), ylim=(LOWEST_RATING - 0.6, HIGHEST_RATING + 0.6), xticks=[],
             yticks=list(RATINGS))  # fmt: skip
    axes.spines["bottom"].set_visible(False)
    axes.set_title(drawable(in_words(name)), loc="left", fontweight="bold")


def _draw_bars(axes: Axes, ratings: VersionRatings, side: int) -> None:
    """Draw the ratings of a version to one side, with their numbers, and name it below."""
    size, colour = text_size(), COLOURS[ratings.version]
    numbers = [ratings.ratings.count(rating) for rating in RATINGS]
    axes.barh(list(RATINGS), [side * n for n in numbers], height=0.78, color=colour, linewidth=0)
    style: dict[str, Any] = {"textcoords": "offset points", "annotation_clip": False}
    for rating, number in zip(RATINGS, numbers, strict=True):
        if number:
            axes.annotate(f"{number}", (side * number, rating), xytext=(side * 0.25 * size, 0), va="center",
                          ha="left" if side > 0 else "right", fontsize=0.8 * size, color=MUTED,
                          **style)  # fmt: skip
    words = f"{ratings.version.value}\nn = {len(ratings.means)}"
    axes.annotate(words, (max(side, 0), 0), xytext=(0, -0.5 * size), xycoords="axes fraction", va="top",
                  ha="right" if side > 0 else "left", fontsize=0.85 * size, color=colour,
                  **style)  # fmt: skip


def _draw_mean(axes: Axes, ratings: VersionRatings, place: float) -> None:
    """Draw the mean of a version with its interval, beside the bars."""
    mean = mean_of(ratings)
    if mean.value is None:
        return
    style: dict[str, Any] = {"color": COLOURS[ratings.version], "clip_on": False}
    if mean.ci_low is not None and mean.ci_high is not None:
        axes.plot([place, place], [mean.ci_low, mean.ci_high], linewidth=text_size() / 6, **style)
    axes.plot(place, mean.value, "D", markersize=0.62 * text_size(), **style)


def _draw_differences(axes: Axes, results: RatingResults) -> None:
    """Draw, a row for each sequence, how many participants have each difference, and the mean."""
    drawn = [difference_counts(result.pairs) for result in results.shown]
    scale = 0.6 / max(max(counts.values(), default=1) for counts in drawn)
    adjusted = (*results.adjusted, None) if len(results.pairs) > 1 else (None,)
    for place, (result, counts) in enumerate(zip(results.shown, drawn, strict=True)):
        axes.axhline(-place, color=FAINT, linewidth=text_size() / 14, zorder=0)
        width = 0.8 * bin_width(result.pairs)
        for x, count in counts.items():
            _draw_count(axes, (x, float(-place)), scale * count, width, f"{count}")
        _draw_row(axes, result, float(-place), adjusted[place])
    reach = max([1.6, *(abs(x) + 0.5 for counts in drawn for x in counts)])
    axes.axvline(0, color=INK, linewidth=text_size() / 14, zorder=0.5)
    axes.set(xlim=(-reach, reach), ylim=(-len(drawn) + 0.68, 0.85), yticks=[],
             xlabel="difference [rating points]:   baseline better  ←   →  ours better")  # fmt: skip
    axes.spines["left"].set_visible(False)


def _draw_count(axes: Axes, place: tuple[float, float], height: float, width: float, count: str) -> None:
    """Draw the bar of a difference, and how many participants have it where there is room."""
    x, floor = place
    colour = OURS if x > 0 else BASELINE if x < 0 else PARTICIPANT
    axes.bar(x, height, bottom=floor, width=width, color=colour, linewidth=0)
    if width > 0.3:
        size = text_size()
        axes.annotate(count, (x, floor + height), xytext=(0, 0.1 * size), textcoords="offset points",
                      ha="center", va="bottom", fontsize=0.8 * size, color=MUTED, bbox=_WHITE)  # fmt: skip


def _draw_row(axes: Axes, result: PairResult, floor: float, adjusted: float | None) -> None:
    """Draw the mean of a row with its interval below the bars, its name before and its numbers after it."""
    size, mean = text_size(), result.mean
    beside: dict[str, Any] = {"textcoords": "offset points", "va": "center", "annotation_clip": False}
    if mean.value is not None:
        if mean.ci_low is not None and mean.ci_high is not None:
            axes.plot(
                [mean.ci_low, mean.ci_high], [floor - 0.13] * 2, color=INK, linewidth=size / 6, zorder=3
            )
        axes.plot(mean.value, floor - 0.13, "D", color=INK, markersize=0.62 * size, zorder=4)
    name = "All, each\none's mean" if result.pairs.name == ALL else in_words(result.pairs.name)
    axes.annotate(drawable(name), (0.0, floor + 0.12), xytext=(-0.8 * size, 0), ha="right",
                  xycoords=("axes fraction", "data"), fontweight="bold", **beside)  # fmt: skip
    axes.annotate(_numbers(result, adjusted), (1.0, floor + 0.12), xytext=(0.8 * size, 0), ha="left",
                  xycoords=("axes fraction", "data"), fontsize=0.9 * size, linespacing=1.35,
                  **beside)  # fmt: skip


def _numbers(result: PairResult, adjusted: float | None) -> str:
    """Return mean, interval, p and n of a row."""
    mean, n = result.mean, len(result.pairs.participant_ids)
    if mean.value is None or result.flip is None:
        return mean.flag
    interval = "" if mean.ci_low is None else f"  [{mean.ci_low:+.2f}, {mean.ci_high:+.2f}]"
    holm = "" if adjusted is None else f" (Holm {p_text(adjusted)})"
    words = f"{mean.value:+.2f}{interval}\n{p_in_words(result.flip.p_value)}{holm}, n = {n}"
    return words.replace("-", "−")


def bin_width(pairs: PairedRatings) -> float:
    """Return how wide the bins are in which differences are counted [rating points]."""
    return max(pairs.step, FINEST_BIN) if pairs.participant_ids else 1.0


def difference_counts(pairs: PairedRatings) -> dict[float, int]:
    """Return how many participants have each difference, in bins."""
    width = bin_width(pairs)
    return dict(sorted(Counter((np.round(pairs.values / width) * width).tolist()).items()))


def rating_points(results: RatingResults) -> tuple[PlottedPoint, ...]:
    """Return every number that `rating_figure` draws: bars and means of ratings, and of differences."""
    origin = Origin.SIMULATED if results.simulated else Origin.RECORDED
    differences = [point for result in results.shown for point in _difference_points(result, origin)]
    return (*_rating_points(results, origin), *differences)


def _rating_points(results: RatingResults, origin: Origin) -> Iterator[PlottedPoint]:
    """Return how often each rating was given, and the means."""
    for (sequence, version), ratings in results.versions.items():
        for rating in range(LOWEST_RATING, HIGHEST_RATING + 1):
            yield PlottedPoint(
                sequence, f"{version.value}, ratings", "", float(ratings.ratings.count(rating)),
                float(rating), "number of ratings", "1", "rating", POINTS, origin, n=len(ratings.ratings),
            )  # fmt: skip
        mean = mean_of(ratings)
        yield PlottedPoint(
            sequence, f"{version.value}, mean and 95 % confidence interval", version.value, None, mean.value,
            "version", "1", "mean rating", POINTS, origin, mean.ci_low, mean.ci_high, len(ratings.means),
        )  # fmt: skip


def _difference_points(result: PairResult, origin: Origin) -> Iterator[PlottedPoint]:
    """Return how many participants have each difference, and the mean."""
    name, n, mean = result.pairs.name, len(result.pairs.participant_ids), result.mean
    series = f"{name}, bins of {bin_width(result.pairs):g}"
    for difference, count in difference_counts(result.pairs).items():
        yield PlottedPoint(
            "differences", series, "", difference, float(count), "ours less baseline", POINTS,
            "number of participants", "1", origin, n=n,
        )  # fmt: skip
    yield PlottedPoint(
        "differences", "mean and 95 % confidence interval", name, None, mean.value, "sequence", "1",
        "mean of ours less baseline", POINTS, origin, mean.ci_low, mean.ci_high, n,
    )  # fmt: skip

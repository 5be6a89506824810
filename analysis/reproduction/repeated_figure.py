"""The figure of simulated effects: how estimates scatter, what is assumed, what is published."""

from __future__ import annotations

from collections.abc import Sequence

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
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.reproduction.repeated_sets import RepeatedEffect
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, RATED, TIME_RATIO

BINS = 30  # of the distribution of estimates, about
MOST_VALUES = 100  # that estimates may take to be drawn as values, rather than as any number
ROW_HEIGHT = 3.0  # [em]
AXES = {
    RATED: "mean rating, ours less constant [rating points]",
    CHOSEN: "share choosing ours as the one that changes",
    TIME_RATIO: "search time, ours over constant",
}


def effects_figure(effects: Sequence[RepeatedEffect], sets: int) -> Figure:
    """Draw, for each effect, the distribution of its estimates, and what is assumed and published.

    Parameters
    ----------
    effects : sequence of RepeatedEffect
        What is drawn, a panel for each kind of effect.
    sets : int
        Simulated data sets of each.
    """
    panels = {what: [effect for effect in effects if effect.assumed.what == what] for what in AXES}
    panels = {what: own for what, own in panels.items() if own}
    with look(PAGE):
        em = PAGE.em
        left, width = 8.0 * em, PAGE.width - 9.5 * em
        lines, above = heading_lines(
            "Effects assumed of simulated viewers, estimated, and published",
            f"Simulated: {sets} data sets each. Gray: estimates. Line: assumed. Ring: the data set of this "
            "report. Diamond: published, with the 95 % interval that its numbers allow.",
            width, em,
        )  # fmt: skip
        top, gap = above + 1.4 * em, 4.6 * em
        heights = [len(own) * ROW_HEIGHT * em for own in panels.values()]
        figure = new_figure(PAGE, top + sum(heights) + gap * len(heights))
        lines_at(figure, left, lines)
        for (what, own), height in zip(panels.items(), heights, strict=True):
            axes = axes_at(figure, left, top, width, height)
            _draw_panel(axes, own)
            axes.set_xlabel(AXES[what])
            top += height + gap
    return figure


def _draw_panel(axes: Axes, effects: Sequence[RepeatedEffect]) -> None:
    """Draw the effects of one kind, the first on top."""
    axes.axvline(effects[0].no_effect, color=FAINT, linewidth=1.0, zorder=0)
    every = np.concatenate([effect.estimates for effect in effects])
    ends = [end for effect in effects for end in effect.published.interval or ()]
    low, high = min([np.nanmin(every), *ends]), max([np.nanmax(every), *ends])
    edges = _edges(every[np.isfinite(every)], low, high)
    for place, effect in enumerate(effects):
        _draw_hill(axes, effect, edges, len(effects) - 1.0 - place)
    axes.set(
        ylim=(-0.15, len(effects)),
        yticks=[len(effects) - 0.7 - k for k in range(len(effects))],
        yticklabels=[drawable(in_words(effect.assumed.group)) for effect in effects],
    )
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _edges(values: Array, low: float, high: float) -> Array:
    """Return edges of bins; where few values are possible, as of means of ratings, each bin holds as many."""
    possible = np.unique(values.round(9))
    step = float(np.diff(possible).min(initial=np.inf))
    width = max((high - low) / BINS, 1e-6)
    if (high - low) / step > MOST_VALUES:
        return np.arange(low, high + width, width)
    width = step * max(round(width / step), 1)
    return np.arange(possible[0] - step / 2, high + width, width)


def _draw_hill(axes: Axes, effect: RepeatedEffect, edges: Array, base: float) -> None:
    """Draw one distribution on its base line, with its marks."""
    told, size = effect.published, text_size()
    estimates = effect.estimates[np.isfinite(effect.estimates)]
    counts = np.histogram(estimates, edges)[0]
    heights = 0.8 * counts / max(int(counts.max(initial=1)), 1)
    axes.stairs(base + heights, edges, baseline=base, fill=True, color=PARTICIPANT, alpha=0.45, linewidth=0)
    axes.plot([effect.assumed.value] * 2, [base, base + 0.85], color=OURS, linewidth=size / 5)
    axes.plot(
        effect.estimates[:1], [base + 0.2], "o", color=INK, markerfacecolor="white", markersize=0.6 * size
    )
    if told.value is not None and told.interval is not None:
        axes.plot(told.interval, [base + 0.5] * 2, color=BASELINE, linewidth=size / 7)
        axes.plot([told.value], [base + 0.5], "D", color=BASELINE, markersize=0.6 * size)
    axes.axhline(base, color=MUTED, linewidth=0.3, zorder=0)


def effect_points(effects: Sequence[RepeatedEffect]) -> tuple[PlottedPoint, ...]:
    """Return every estimate, and what is assumed and published."""
    points = []
    for effect in effects:
        own, told = effect.assumed, effect.published
        drawn: list[tuple[str, float | None, Origin]] = [("assumed", own.value, Origin.SIMULATED)]
        drawn += [("published", told.value, Origin.PUBLISHED)] if told.value is not None else []
        shown = ["data set shown", *["data set"] * (len(effect.estimates) - 1)]
        drawn += [
            (name, x, Origin.SIMULATED) for name, x in zip(shown, effect.estimates.tolist(), strict=True)
        ]
        for name, x, origin in drawn:
            low, high = told.interval or (None, None) if name == "published" else (None, None)
            known = None if x is None or not np.isfinite(x) else x
            points.append(
                PlottedPoint(
                    own.what, name, own.group, known, None, own.what, own.unit, "", "", origin, low, high
                )
            )
    return tuple(points)

"""The panel of a track's figure that shows how fast brightness changes, and how fast it may."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from numpy.typing import NDArray

from evenlight.analysis.figure_style import BASELINE, FAINT, LIMIT, OURS, legend_above
from evenlight.analysis.tracks.track_figure_data import TrackFigureData, frame_edges
from evenlight.data_schema.arrays import Array

WIDE_RANGE = 10.0  # a rate limit that varies by more than this leaves no room for its lowest
FEW_FRAMES = 40  # up to so many, each frame gets a dot


def step_line(axes: Axes, edges: Array, values: Array, **style: Any) -> None:
    """Draw values that hold from each edge to the next; where they are few, with a dot at their beginning."""
    dots: dict[str, Any] = {"marker": "o", "markevery": slice(0, len(values))}
    axes.plot(
        edges,
        np.append(values, values[-1]),
        drawstyle="steps-post",
        **{**(dots if len(values) <= FEW_FRAMES else {}), **style},
    )


def draw_rate(axes: Axes, data: TrackFigureData) -> None:
    """Draw how fast the modulation changes luminance, up or down, and the areas that it must not enter.

    Where allowances make the limit another one than the fitted, that is marked, and both are drawn.
    """
    edges, marked = frame_edges(data.track.times), data.with_allowance()
    drawn = drawn_rates(data)
    top = _top_rate(drawn, is_marked=bool(marked.any()))
    thin = {"linewidth": 0.6 * rcParams["lines.linewidth"]}
    beyond: dict[str, Any] = {"facecolor": LIMIT, "alpha": 0.16, "linewidth": 0, "step": "post"}
    allowed, fitted = (np.append(limit, limit[-1]) for limit in (drawn.allowed, drawn.fitted))
    label = "too fast" if marked.any() else "faster than ΔL"
    for sign in (1, -1):
        axes.fill_between(
            edges, sign * np.minimum(allowed, top), sign * top, label=label if sign > 0 else None, **beyond
        )
        axes.plot(edges, sign * allowed, drawstyle="steps-post", color=LIMIT, zorder=2, **thin)
        if marked.any():
            axes.plot(
                edges, sign * fitted, drawstyle="steps-post", color=LIMIT, linestyle=":", zorder=2, **thin
            )
    axes.axhline(0.0, color=FAINT, zorder=0, **thin)
    _mark_allowances(axes, edges, marked)
    change = "change made" if marked.any() else "change by the modulation"  # room for the sections
    step_line(axes, edges[: len(drawn.rate) + 1], drawn.rate, color=OURS, label=change, zorder=3, **thin)
    axes.set(ylim=(-top, top), ylabel=drawn.unit)
    legend_above(axes, reverse=True)


def _top_rate(drawn: DrawnRates, *, is_marked: bool) -> float:
    """Return the top of the axis of rates: above every limit that is no allowance, and every rate."""
    limit = drawn.fitted if is_marked else drawn.allowed
    fastest = float(np.abs(drawn.rate[np.isfinite(drawn.rate)]).max(initial=0.0))
    return 1.25 * max(float(limit.max()), fastest) or 1.0


def _mark_allowances(axes: Axes, edges: Array, marked: NDArray[np.bool_]) -> None:
    """Shade the sections in which another limit than the fitted one holds."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    for first, last in ends.reshape(-1, 2):
        label = "other limit than ΔL" if first == ends[0] else None
        axes.axvspan(
            edges[first], edges[last], color=BASELINE, alpha=0.22, linewidth=0, zorder=0.5, label=label
        )


@dataclass(frozen=True, slots=True)
class DrawnRates:
    """Rates as they are drawn: up to the last step; the limit as allowed and as fitted, of each frame."""

    rate: Array
    allowed: Array
    fitted: Array
    unit: str


def drawn_rates(data: TrackFigureData) -> DrawnRates:
    """Return the rates up to the last step, each frame's limits, and the name of their axis.

    Limits that vary by more than a factor of `WIDE_RANGE` leave no room for the lowest: then rates are
    shares of the fitted limit [%], whatever is allowed. A limit of 0 has no share but that of no change, 0.
    """
    track, fitted = data.track, data.limit_alone()
    rate = track.rate[:-1] if len(track.rate) > 1 else track.rate  # after the last frame nothing changes
    positive = fitted[fitted > 0]
    if not positive.size or positive.max() / positive.min() <= WIDE_RANGE:
        return DrawnRates(rate, track.rate_limit, fitted, "rate [cd/m²/s]")
    limit, whole = fitted[: len(rate)], np.full(len(fitted), 100.0)
    beyond = np.where(rate == 0, 0.0, np.copysign(np.inf, rate))
    share = 100 * np.divide(rate, limit, out=beyond, where=limit > 0)
    allowed = 100 * np.divide(track.rate_limit, fitted, out=np.ones(len(fitted)), where=fitted > 0)
    allowed = np.where(data.with_allowance(), allowed, whole)
    return DrawnRates(share, allowed, whole, "rate / ΔL [%]")

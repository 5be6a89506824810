"""The figure of a brightness track: what it does to brightness, contrast and rate of change, over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    Line,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
    short,
    text_at,
    text_lines,
)
from evenlight.analysis.tracks.frame_samples import Image, dimmed_picture
from evenlight.analysis.tracks.gain_words import SAME_POWER
from evenlight.analysis.tracks.track_figure_data import (
    TrackFigureData,
    budget_in_words,
    frame_edges,
    outcome_in_words,
)
from evenlight.data_schema.arrays import Array
from evenlight.method.rate_limit import largest_rate_ratio
from evenlight.stimuli.video.viewing_geometry import geometry_words

MIN_FACTOR_SPAN = 0.11  # factors that hardly move do not fill the panel, which is then 0.15 high
WIDE_RANGE = 10.0  # a rate limit that varies by more than this leaves no room for its lowest
FEW_FRAMES = 40  # up to so many, each frame gets a dot


def track_figure(data: TrackFigureData, medium: FigureFormat = PAGE) -> Figure:
    """Draw a brightness track: factor, contrast loss and rate over time, and frames as they are shown.

    Parameters
    ----------
    data : TrackFigureData
        Its content.
    medium : FigureFormat
        Where it is shown.
    """
    with look(medium):
        figure = new_figure(medium)
        layout = _layout(data, medium)
        lines_at(figure, layout.left, layout.lines)
        panels = [
            axes_at(figure, layout.left, top, layout.width, layout.panel_height) for top in layout.panel_tops
        ]
        _draw_factors(panels[0], data)
        _draw_loss(panels[1], data)
        draw_rate(panels[2], data)
        for panel in panels:
            _finish_panel(panel, data, layout, is_last=panel is panels[-1])
        _draw_letters(panels[0], data, layout)
        _draw_thumbnails(figure, data, layout)
    return figure


@dataclass(frozen=True, slots=True)
class _Layout:
    """Where things are, in inches from the upper left corner, and which thumbnails have room."""

    em: float
    left: float
    width: float
    lines: tuple[Line, ...]
    panel_tops: tuple[float, float, float]
    panel_height: float
    picture_top: float
    picture_size: tuple[float, float]
    thumbnails: tuple[tuple[int, Image], ...]


def _layout(data: TrackFigureData, medium: FigureFormat) -> _Layout:
    """Lay out a figure that fills the medium: what the rest leaves is the panels'."""
    em = medium.em
    left = 6.6 * em
    width = medium.width - left - 1.4 * em
    thumbnails = _with_room(data.thumbnails, int(width / (7 * em)))
    heading, above = _heading(data, width, em)
    footer, below = _footer(data, width, em)
    below += 0.5 * em
    picture = _picture_size(thumbnails, width, 0.1 * medium.height, em)
    pictures = 2 * picture[1] + 2.6 * em if thumbnails else 0.0
    picture_top = medium.height - below - pictures + 1.4 * em
    first, between, axis = above + 1.9 * em, 2.6 * em, 3.8 * em
    panel = (medium.height - below - pictures - axis - first - 2 * between) / 3
    top, middle, bottom = (first + k * (panel + between) for k in range(3))
    lines = (*heading, *((words, medium.height - below + at, style) for words, at, style in footer))
    return _Layout(em, left, width, lines, (top, middle, bottom), panel, picture_top, picture, thumbnails)


def _with_room(thumbnails: tuple[tuple[int, Image], ...], most: int) -> tuple[tuple[int, Image], ...]:
    """Return at most so many thumbnails, evenly chosen."""
    n = min(len(thumbnails), most)
    return tuple(thumbnails[(2 * k + 1) * len(thumbnails) // (2 * n)] for k in range(n))


def _picture_size(
    thumbnails: tuple[tuple[int, Image], ...], width: float, highest: float, em: float
) -> tuple[float, float]:
    """Return width and height of the thumbnails [inch]: as large as a row of them allows."""
    if not thumbnails:
        return 0.0, 0.0
    rows, columns = thumbnails[0][1].shape[:2]
    n = max(4, len(thumbnails))
    high = min((width - (n - 1) * 0.8 * em) / n * rows / columns, highest)
    return high * columns / rows, high


def _heading(data: TrackFigureData, width: float, em: float) -> tuple[list[Line], float]:
    """Return what video, display and budget it is about and what came out, and the height that it takes."""
    header = data.track.header
    title = f"{_clipped(header.video, 32)} on {_clipped(header.display_name, 24)}, {budget_in_words(data)}"
    return heading_lines(title, outcome_in_words(data), width, em)


def _footer(data: TrackFigureData, width: float, em: float) -> tuple[list[Line], float]:
    """Return how the track was made, and the height that it takes."""
    track, header = data.track, data.track.header
    power = float(np.average(track.power, weights=np.diff(frame_edges(track.times))))
    frames = "1 frame" if len(track.times) == 1 else f"{len(track.times)} frames"
    words = (
        f"{frames}  ·  solver {header.solver}  ·  mean power {power:.3g} W (model {header.power_model})  ·  "
        f"rate limit {header.rate_limit}{_allowances(data)}"
    )
    if header.pixels_per_degree is not None:
        seen = geometry_words(header.field_of_view, header.pixels_per_degree)
        words += f"  ·  seen {seen.partition(',')[0]}"
    return text_lines(words, 0.8 * em, width, {"color": MUTED, "fontsize": 0.85 * 72 * em})


def _allowances(data: TrackFigureData) -> str:
    """Return how fast brightness changes where sections allow another limit than the fitted one."""
    marked = data.with_allowance()
    if not marked.any():
        return ""
    ratio = largest_rate_ratio(data.track.rate[marked], data.limit_alone()[marked])
    return (
        f", in marked sections up to {short(ratio)} times it"
        if ratio > 1 + SAME_POWER
        else " but for marked sections"
    )


def _clipped(words: str, room: int) -> str:
    """Return words of at most so many characters; of longer ones the middle is left out.

    >>> _clipped("a_very_long_name.mp4", 11)
    'a_ver…e.mp4'
    """
    half = (room - 1) // 2
    return words if len(words) <= room else f"{words[:half]}…{words[-half:]}"


def _draw_factors(axes: Axes, data: TrackFigureData) -> None:
    """Draw the brightness factors, the constant baseline and the range that factors may take."""
    edges = frame_edges(data.track.times)
    bottom, top = factor_axis(np.append(data.track.factors, data.baseline_factor))
    forbidden: dict[str, Any] = {"facecolor": "none", "edgecolor": FAINT, "hatch": "////", "linewidth": 0}
    is_bounded = data.lowest_factor > bottom
    if is_bounded:
        axes.axhspan(bottom, data.lowest_factor, **forbidden)
    if top > 1:
        axes.axhline(1.0, color=FAINT, linewidth=0.4 * rcParams["lines.linewidth"], zorder=0)
    axes.axhline(data.baseline_factor, color=BASELINE, linestyle="--", zorder=3)
    step_line(axes, edges, data.track.factors, color=OURS, zorder=2)
    ticks = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(bottom, top)
    axes.set(ylim=(bottom, top), ylabel="factor b")
    axes.set_yticks([tick for tick in ticks if bottom <= tick <= min(top, 1)])
    same = "same power" if data.same_power else "same mean"
    constant = f"constant, {same}: {short(data.baseline_factor)}"
    handles = [
        Line2D([], [], color=OURS, label="ours"),
        Line2D([], [], color=BASELINE, linestyle="--", label=constant),
        Patch(label="not allowed", **{**forbidden, "edgecolor": MUTED}),
    ]
    legend_above(axes, handles=handles[: 3 if is_bounded else 2])


def factor_axis(factors: Array) -> tuple[float, float]:
    """Return bottom and top of an axis of factors: all of them with a margin, above it room for letters.

    >>> [round(end, 3) for end in factor_axis(np.array([0.2, 0.7]))]
    [0.15, 0.85]
    """
    low, high = float(factors.min()), float(factors.max())
    missing = max(MIN_FACTOR_SPAN - (high - low), 0.0)
    low, high = low - missing / 2, high + missing / 2
    return max(low - 0.1 * (high - low), 0.0), high + 0.3 * (high - low)


def _draw_loss(axes: Axes, data: TrackFigureData) -> None:
    """Draw the contrast loss of the track and of constant dimming."""
    edges = frame_edges(data.track.times)
    loss, constant = data.track.contrast_loss, data.baseline_loss
    step_line(axes, edges, loss, color=OURS, label="ours", zorder=2)
    step_line(axes, edges, constant, color=BASELINE, linestyle="--", label="constant", zorder=3)
    top = max(float(constant.max()), float(loss.max()), 0.01)
    axes.set(ylim=(0, 1.1 * top), ylabel="contrast loss")
    legend_above(axes)


def _finish_panel(axes: Axes, data: TrackFigureData, layout: _Layout, is_last: bool) -> None:
    """Give a panel the common axis of time and the lines of the thumbnails."""
    times = data.track.times
    axes.set_xlim(times[0], frame_edges(times)[-1])
    if len(times) == 1:
        axes.set(xlim=(times[0] - 0.25, times[0] + 1), xticks=[times[0]])
    for index, _ in layout.thumbnails:
        axes.axvline(times[index], color=MUTED, linewidth=0.3 * rcParams["lines.linewidth"], zorder=1.5)
    axes.yaxis.set_label_coords(-4.2 * layout.em / layout.width, 0.5)
    axes.tick_params(labelbottom=is_last)
    if is_last:
        axes.set_xlabel("time [s]")


def _letter(place: int) -> str:
    """Return the letter of the thumbnail at a place."""
    return chr(ord("A") + place)


def _draw_letters(axes: Axes, data: TrackFigureData, layout: _Layout) -> None:
    """Write each thumbnail's letter at the top of its line."""
    for place, (index, _) in enumerate(layout.thumbnails):
        axes.text(
            float(data.track.times[index]), 1 - 0.55 * layout.em / layout.panel_height, _letter(place),
            transform=axes.get_xaxis_transform(), ha="center", va="center", fontsize=0.75 * 72 * layout.em,
            color="white", bbox={"boxstyle": "circle,pad=0.2", "facecolor": MUTED, "edgecolor": "none"},
            zorder=4,
        )  # fmt: skip


def _draw_thumbnails(figure: Figure, data: TrackFigureData, layout: _Layout) -> None:
    """Show frames at full brightness over the same frames as they are shown, dimmed."""
    n, em = len(layout.thumbnails), layout.em
    wide, high = layout.picture_size
    rows = [layout.picture_top, layout.picture_top + high + 0.15 * em]
    for place, (index, picture) in enumerate(layout.thumbnails):
        middle = layout.left + (place + 0.5) * layout.width / n
        factor = float(data.track.factors[index])
        heading = f"{_letter(place)}:  b = {factor:.2f}"
        text_at(figure, middle, rows[0] - 0.3 * em, heading, ha="center", va="bottom", fontsize=0.9 * 72 * em)
        for top, shown in zip(rows, (picture, dimmed_picture(picture, factor)), strict=True):
            axes = axes_at(figure, middle - wide / 2, top, wide, high)
            axes.imshow(shown, aspect="auto")
            axes.set_axis_off()
    for top, words in zip(rows, ("full\nbrightness", "as shown,\ndimmed by b") if n else (), strict=False):
        style: dict[str, Any] = {"ha": "right", "va": "center", "color": MUTED, "fontsize": 0.8 * 72 * em}
        text_at(figure, layout.left - 0.4 * em, top + high / 2, words, **style)


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

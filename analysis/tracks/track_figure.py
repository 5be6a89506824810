"""The figure of a brightness track: what it does to brightness, contrast and rate of change, over time."""

from __future__ import annotations

from collections.abc import Sequence
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

from evenlight.analysis import figure_style as style
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.tracks.frame_samples import Image, dimmed_picture, thumbnails_of
from evenlight.analysis.tracks.track_words import (
    SAME_POWER,
    budget_in_words,
    outcome_in_words,
    uses_same_power,
    watts,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.rate_limit import largest_rate_ratio
from evenlight.stimuli.video.viewing_geometry import geometry_words

MIN_FACTOR_SPAN = 0.11  # factors that hardly move do not fill the panel, which is then 0.15 high
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
MOST_THUMBNAILS = 6
Thumbnails = tuple[tuple[int, Image], ...]  # frames, small, with their index
FEW_FRAMES = 40  # up to so many, each frame gets a dot


@dataclass(frozen=True, slots=True)
class DrawnTrack:
    """A track beside constant dimming, as the figure and the player show them."""

    track: BrightnessTrack
    summary: OptimizationSummary
    baseline_loss: Array  # 𝓛_c of each frame under constant dimming, (N,)
    # some frames (height, width, 3) at full brightness, with their rising index (`FrameSamples.held`)
    samples: Sequence[tuple[int, NDArray[Any]]] = ()
    fitted_limit: Array | None = None  # without allowances [cd/m^2/s], (N,); None: the track's
    counts: bool = True  # in what was minimized: of clips that share a budget, some may not

    @property
    def limit_alone(self) -> Array:
        """The rate limit of each step without allowances [cd/m^2/s], (N,)."""
        return self.track.rate_limit if self.fitted_limit is None else self.fitted_limit

    @property
    def with_allowance(self) -> NDArray[np.bool_]:
        """Which steps have another rate limit than the fitted one, (N,)."""
        return np.asarray(np.abs(self.track.rate_limit - self.limit_alone) > 1e-9 * np.abs(self.limit_alone))

    @property
    def outcome(self) -> str:
        """What came out, in a sentence or two."""
        return f"{self.does_not_count}{outcome_in_words(self.summary)}"

    @property
    def does_not_count(self) -> str:
        """A sentence, if it is so."""
        return "" if self.counts else "Does not count (weight 0). "

    def compared_at(self, frame: int) -> tuple[tuple[float, float], ...]:
        """Return factor and contrast loss of a frame: ours, and under constant dimming."""
        return (
            (float(self.track.factors[frame]), float(self.track.contrast_loss[frame])),
            (self.summary.baseline_factor, float(self.baseline_loss[frame])),
        )


def frame_edges(times: Array) -> Array:
    """Return when frames begin, and when the last one ends: it lasts as long as the median of the others."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    return np.append(times, times[-1] + (step if step > 0 else 1.0))


def track_figure(data: DrawnTrack) -> Figure:
    """Draw a brightness track: factor, contrast loss and rate over time, and frames as they are shown."""
    with style.look():
        em = PAGE.em
        left, between, axis = 6.6 * em, 2.6 * em, 3.8 * em
        width = PAGE.width - left - 1.4 * em
        thumbnails = thumbnails_of(data.samples, min(MOST_THUMBNAILS, int(width / (7 * em))))
        header = data.track.header
        title = f"{clipped(header.video, 32)} on {clipped(header.display_name, 24)}"
        heading, above = style.heading_lines(
            f"{title}, {budget_in_words(data.summary)}", data.outcome, width, em
        )
        footer, below = _footer(data, width, em)
        bottom = PAGE.height - below - 0.5 * em
        wide, high = _picture_size(thumbnails, width, 0.1 * PAGE.height, em)
        pictures = 2 * high + 2.6 * em if thumbnails else 0.0
        top = above + 1.9 * em
        panel = (bottom - pictures - axis - top - 2 * between) / 3  # what the rest leaves
        figure = style.new_figure()
        style.lines_at(figure, left, [*heading, *((words, bottom + at, own) for words, at, own in footer)])
        for k, draw in enumerate((_draw_factors, _draw_loss, _draw_rate)):
            axes = style.axes_at(figure, left, top + k * (panel + between), width, panel)
            draw(axes, data)
            _finish_panel(axes, data, thumbnails, is_last=draw is _draw_rate)
            axes.yaxis.set_label_coords(-4.2 * em / width, 0.5)
        _draw_letters(figure.axes[0], data, thumbnails, 0.55 * em / panel)
        if thumbnails:
            place = left, bottom - pictures + 1.4 * em, width
            _draw_thumbnails(figure, data, thumbnails, place, (wide, high))
    return figure


def _picture_size(thumbnails: Thumbnails, width: float, highest: float, em: float) -> tuple[float, float]:
    """Return width and height of the thumbnails [inch]: as large as a row of them allows."""
    if not thumbnails:
        return 0.0, 0.0
    rows, columns = thumbnails[0][1].shape[:2]
    n = max(4, len(thumbnails))
    high = min((width - (n - 1) * 0.8 * em) / n * rows / columns, highest)
    return high * columns / rows, high


def _footer(data: DrawnTrack, width: float, em: float) -> tuple[list[style.Line], float]:
    track, header = data.track, data.track.header
    frames = "1 frame" if len(track.times) == 1 else f"{len(track.times)} frames"
    mean = data.summary.mean_power
    power = "no power model" if mean is None else f"mean power {watts(mean)} (model {header.power_model})"
    words = (
        f"{frames}  ·  solver {header.solver}  ·  {power}  ·  "
        f"rate limit {header.rate_limit}{_allowances(data)}"
    )
    if header.pixels_per_degree is not None:
        seen = geometry_words(header.field_of_view, header.pixels_per_degree)
        words += f"  ·  seen {seen.partition(',')[0]}"
    return style.text_lines(words, 0.8 * em, width, {"color": style.MUTED, "fontsize": 0.85 * 72 * em})


def _allowances(data: DrawnTrack) -> str:
    """Return how fast brightness changes where sections allow another limit than the fitted one."""
    marked = data.with_allowance
    if not marked.any():
        return ""
    ratio = largest_rate_ratio(data.track.rate[marked], data.limit_alone[marked])
    beyond = ratio > 1 + SAME_POWER
    return (
        f", in marked sections up to {style.short(ratio)} times it" if beyond else " but for marked sections"
    )


def clipped(words: str, room: int) -> str:
    """Return words of at most so many characters; of longer ones the middle is left out.

    >>> clipped("a_very_long_name.mp4", 11)
    'a_ver…e.mp4'
    """
    half = (room - 1) // 2
    return words if len(words) <= room else f"{words[:half]}…{words[-half:]}"


def _draw_factors(axes: Axes, data: DrawnTrack) -> None:
    edges = frame_edges(data.track.times)
    constant, lowest = data.summary.baseline_factor, data.summary.lowest_factor
    bottom, top = factor_axis(np.append(data.track.factors, constant))
    forbidden: dict[str, Any] = {
        "facecolor": "none",
        "edgecolor": style.FAINT,
        "hatch": "////",
        "linewidth": 0,
    }
    is_bounded = lowest > bottom
    if is_bounded:
        axes.axhspan(bottom, lowest, **forbidden)
    if top > 1:
        axes.axhline(1.0, color=style.FAINT, linewidth=0.4 * rcParams["lines.linewidth"], zorder=0)
    axes.axhline(constant, color=style.BASELINE, linestyle="--", zorder=3)
    _step_line(axes, edges, data.track.factors, color=style.OURS, zorder=2)
    ticks = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(bottom, top)
    axes.set(ylim=(bottom, top), ylabel="factor b")
    axes.set_yticks([tick for tick in ticks if bottom <= tick <= min(top, 1)])
    same = "same power" if uses_same_power(data.summary) else "same mean"
    handles = [
        Line2D([], [], color=style.OURS, label="the track"),
        Line2D(
            [], [], color=style.BASELINE, linestyle="--", label=f"constant, {same}: {style.short(constant)}"
        ),
        Patch(label="not allowed", **{**forbidden, "edgecolor": style.MUTED}),
    ]
    style.legend_above(axes, handles=handles[: 3 if is_bounded else 2])


def factor_axis(factors: Array) -> tuple[float, float]:
    """Return bottom and top of an axis of factors: all of them with a margin, above it room for letters.

    >>> [round(end, 3) for end in factor_axis(np.array([0.2, 0.7]))]
    [0.15, 0.85]
    """
    low, high = float(factors.min()), float(factors.max())
    missing = max(MIN_FACTOR_SPAN - (high - low), 0.0)
    low, high = low - missing / 2, high + missing / 2
    return max(low - 0.1 * (high - low), 0.0), high + 0.3 * (high - low)


def _draw_loss(axes: Axes, data: DrawnTrack) -> None:
    edges = frame_edges(data.track.times)
    loss, constant = 100 * data.track.contrast_loss, 100 * data.baseline_loss
    _step_line(axes, edges, loss, color=style.OURS, label="visible contrast lost: the track", zorder=2)
    _step_line(axes, edges, constant, color=style.BASELINE, linestyle="--", label="constant", zorder=3)
    top = max(float(constant.max()), float(loss.max()), 1.0)
    axes.set(ylim=(0, 1.1 * top), ylabel="loss [%]")
    style.legend_above(axes)


def _finish_panel(axes: Axes, data: DrawnTrack, thumbnails: Thumbnails, *, is_last: bool) -> None:
    times = data.track.times
    axes.set_xlim(times[0], frame_edges(times)[-1])
    if len(times) == 1:
        axes.set(xlim=(times[0] - 0.25, times[0] + 1), xticks=[times[0]])
    for index, _ in thumbnails:
        axes.axvline(times[index], color=style.MUTED, linewidth=0.3 * rcParams["lines.linewidth"], zorder=1.5)
    axes.tick_params(labelbottom=is_last)
    if is_last:
        axes.set_xlabel("time [s]")


def _draw_letters(axes: Axes, data: DrawnTrack, thumbnails: Thumbnails, below: float) -> None:
    """Write each thumbnail's letter on its line, so far below the top of the panel, as a share of it."""
    look_of_box = {"boxstyle": "circle,pad=0.2", "facecolor": style.MUTED, "edgecolor": "none"}
    for letter, (index, _) in zip(LETTERS, thumbnails, strict=False):
        axes.text(
            float(data.track.times[index]),
            1 - below,
            letter,
            transform=axes.get_xaxis_transform(),
            ha="center",
            va="center",
            fontsize=0.75 * rcParams["font.size"],
            color="white",
            bbox=look_of_box,
            zorder=4,
        )


def _draw_thumbnails(
    figure: Figure,
    data: DrawnTrack,
    thumbnails: Thumbnails,
    place: tuple[float, float, float],
    size: tuple[float, float],
) -> None:
    """Show frames over the same frames as they are dimmed; place: left, top and width of both rows [inch]."""
    (left, first, width), (wide, high), font = place, size, rcParams["font.size"]
    em = font / 72
    rows = (first, first + high + 0.15 * em)
    axes = style.axes_at(
        figure, left, first, width, rows[1] + high - first
    )  # one of their own each takes 20 ms
    axes.set_axis_off()
    for k, (letter, (index, picture)) in enumerate(zip(LETTERS, thumbnails, strict=False)):
        middle = left + (k + 0.5) * width / len(thumbnails)
        factor = float(data.track.factors[index])
        heading = f"{letter}:  b = {factor:.2f}"
        style.text_at(
            figure, middle, first - 0.3 * em, heading, ha="center", va="bottom", fontsize=0.9 * font
        )
        for top, shown in zip(rows, (picture, dimmed_picture(picture, factor)), strict=True):
            sides = middle - wide / 2, middle + wide / 2
            axes.imshow(shown, aspect="auto", extent=(*sides, top + high, top))
    axes.set(xlim=(left, left + width), ylim=(rows[1] + high, first))
    for top, words in zip(rows, ("full\nbrightness", "as shown,\ndimmed by b"), strict=True):
        own: dict[str, Any] = {"ha": "right", "va": "center", "color": style.MUTED, "fontsize": 0.8 * font}
        style.text_at(figure, left - 0.4 * em, top + high / 2, words, **own)


def _step_line(axes: Axes, edges: Array, values: Array, **own: Any) -> None:
    """Draw values that hold from each edge to the next; where they are few, with a dot at their beginning."""
    dots: dict[str, Any] = {"marker": "o", "markevery": slice(0, len(values))}
    axes.plot(
        edges,
        np.append(values, values[-1]),
        drawstyle="steps-post",
        **{**(dots if len(values) <= FEW_FRAMES else {}), **own},
    )


def _draw_rate(axes: Axes, data: DrawnTrack) -> None:
    """Draw how fast brightness changes, up or down, as a share of ΔL, and the areas that it must not enter.

    Where allowances make the limit another one than ΔL, that is marked, and both are drawn.
    """
    edges, marked = frame_edges(data.track.times), data.with_allowance
    rate, allowed = rate_shares(data)
    thin = {"linewidth": 0.6 * rcParams["lines.linewidth"]}
    fastest = float(np.abs(rate[np.isfinite(rate)]).max(initial=0.0))
    top = 1.25 * max(100.0, fastest)
    beyond: dict[str, Any] = {"facecolor": style.LIMIT, "alpha": 0.16, "linewidth": 0, "step": "post"}
    limit = np.append(allowed, allowed[-1])
    low, high = f"{data.limit_alone.min():.2g}", f"{data.limit_alone.max():.2g}"  # by the frame's luminance
    limits = low if low == high else f"{low} to {high}"
    label = "too fast" if marked.any() else f"faster than ΔL ({limits} cd/m²/s)"
    for sign, name in ((1, label), (-1, None)):
        axes.fill_between(edges, sign * np.minimum(limit, top), sign * top, label=name, **beyond)
        axes.plot(edges, sign * limit, drawstyle="steps-post", color=style.LIMIT, zorder=2, **thin)
        if marked.any():
            axes.axhline(sign * 100.0, color=style.LIMIT, linestyle=":", zorder=2, **thin)
    axes.axhline(0.0, color=style.FAINT, zorder=0, **thin)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    for number, (first, last) in enumerate(edges[ends].reshape(-1, 2)):
        words = None if number else "other limit than ΔL"
        axes.axvspan(first, last, color=style.BASELINE, alpha=0.22, linewidth=0, zorder=0.5, label=words)
    _step_line(axes, edges[: len(rate) + 1], rate, color=style.OURS, label="change made", zorder=3, **thin)
    axes.set(ylim=(-top, top), ylabel="rate [% of ΔL]")
    style.legend_above(axes, reverse=True)


def rate_shares(data: DrawnTrack) -> tuple[Array, Array]:
    """Return rates up to the last step, and the limit of each frame, in % of ΔL: the limit as it was fitted.

    Where ΔL is 0, no change is no share of it, and any change is infinitely fast.
    """
    track, fitted = data.track, data.limit_alone
    rate = track.rate[:-1] if len(track.rate) > 1 else track.rate  # after the last frame nothing changes
    limit = fitted[: len(rate)]
    beyond = np.where(rate == 0, 0.0, np.copysign(np.inf, rate))
    shares = 100 * np.divide(rate, limit, out=beyond, where=limit > 0)
    allowed = 100 * np.divide(track.rate_limit, fitted, out=np.ones(len(fitted)), where=fitted > 0)
    return shares, np.where(data.with_allowance, allowed, 100.0)

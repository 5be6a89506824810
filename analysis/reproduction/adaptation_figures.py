"""The figures of visual adaptation (Section 4.4), and the numbers that are drawn in them.

The histogram of the differences between static and dynamic cone response; and what the two responses are: one
change of brightness, at once and at the pace of the rate limit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, PercentFormatter

from evenlight.analysis.figure_style import (
    BASELINE,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.reproduction.adaptation_lag import (
    BINS_PER_DECADE,
    DECADES,
    AdaptationInput,
    ConeInput,
    DimmingCondition,
    ResponseDifferences,
    bin_edges,
)
from evenlight.data_schema.analysis_results import Origin, PlottedPoint
from evenlight.data_schema.arrays import Array
from evenlight.method.adaptation import (
    adapted,
    cone_response,
    response_differences,
    state_after,
    static_response,
)

Results = Mapping[tuple[str, DimmingCondition, ConeInput], ResponseDifferences]
STYLES: dict[DimmingCondition, dict[str, Any]] = {
    DimmingCondition.CONSTANT: {"color": BASELINE, "linewidth": 3.0, "alpha": 0.75},
    DimmingCondition.CONSTRAINED: {"color": OURS, "linewidth": 1.3},
    DimmingCondition.UNCONSTRAINED: {
        "color": LIMIT,
        "linewidth": 1.5,
        "linestyle": (0, (3, 1.2)),
        "fill": True,
    },
}
SHOWN = (-5, -1)  # powers of ten between which the bars are; the first holds what is smaller, too
MERGED = 2  # bins of `bin_edges()` in a bar
BEFORE, AFTER = 40.0, 20.0  # [cd/m^2] a frame of middling brightness, and its half
PACE = 0.03  # [1/s] about the published limit there, relative to the luminance
STEP = 0.002  # [s] between the moments that are drawn


def bar_edges() -> Array:
    """Return the edges of the bars that are drawn, (bars + 1,).

    >>> edges = bar_edges()
    >>> edges.size, round(float(edges[0]), 9), round(float(edges[-1]), 9)
    (21, 1e-05, 0.1)
    """
    first = (SHOWN[0] - DECADES[0]) * BINS_PER_DECADE
    last = (SHOWN[1] - DECADES[0]) * BINS_PER_DECADE
    return bin_edges()[first : last + 1 : MERGED]


def bars(found: ResponseDifferences) -> Array:
    """Return the share of time and places in each bar, (bars,): it is 1 in all.

    The first bar holds all that is smaller, the last all that is larger.
    """
    first = (SHOWN[0] - DECADES[0]) * BINS_PER_DECADE
    last = (SHOWN[1] - DECADES[0]) * BINS_PER_DECADE
    shares = found.shares[first:last].reshape(-1, MERGED).sum(axis=1)
    shares[0] += found.shares[:first].sum()
    shares[-1] += found.shares[last:].sum()
    return np.asarray(shares)


def differences_figure(sequences: Sequence[AdaptationInput], results: Results) -> Figure:
    """Draw the histogram of the differences, for each way to dim.

    Left for eyes that rest on the display, right for eyes that wander; a histogram that lies further to the
    right is one of larger differences.
    """
    em = PAGE.em
    with look(PAGE):
        left, gap, row = 6.8 * em, 4.8 * em, 9.2 * em
        width = (PAGE.width - left - gap - 1.5 * em) / 2
        frames = sum(len(sequence.maps.emitted) for sequence in sequences)
        first = sequences[0].maps.emitted[0].shape
        lines, above = heading_lines(
            "How far the response of the cones lags behind the picture",
            f"{len(sequences)} rendered sequences, {frames} frames, {first[1]} × {first[0]} blocks each. "
            "Further right is more lag. ▼ and numbers: means.",
            PAGE.width - left - em, em,
        )  # fmt: skip
        top = above + 4.2 * em
        figure = new_figure(PAGE, top + len(sequences) * row + 2.4 * em)
        lines_at(figure, left, lines)
        for k, sequence in enumerate(sequences):
            highest = max(
                bars(results[sequence.name, d, p]).max() for d in DimmingCondition for p in ConeInput
            )
            for column, place in enumerate(ConeInput):
                axes = axes_at(figure, left + column * (width + gap), top + k * row, width, 7.6 * em)
                _draw(axes, sequence, place, results)
                axes.set_ylim(0, 1.32 * highest)
                if k == 0:
                    axes.set_title(_PLACES[place], loc="left", pad=0.6 * text_size())
                if k == len(sequences) - 1:
                    axes.set_xlabel("difference of the responses, |static − dynamic| [1]")
                else:
                    axes.tick_params(labelbottom=False)
                if column == 0:
                    axes.set_ylabel("share of time")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, ncols=3, loc="upper left",
            bbox_to_anchor=(left / PAGE.width, 1 - (above + 0.6 * em) / figure.get_size_inches()[1]),
        )  # fmt: skip
    return figure


_PLACES = {
    ConeInput.PIXEL: "each block of pixels by itself: the eye rests",
    ConeInput.FRAME_MEAN: "mean of the frame: the eye wanders",
}


def _draw(axes: Axes, sequence: AdaptationInput, place: ConeInput, results: Results) -> None:
    """Draw the three histograms of a sequence."""
    edges = bar_edges()
    label: dict[str, Any] = {"transform": axes.transAxes, "va": "top"}
    name = sequence.name.replace("_", " ")
    axes.text(0.01, 0.98, drawable(f"{name} ({sequence.budget:g})"), fontweight="bold", **label)
    for k, (dimming, style) in enumerate(STYLES.items()):
        found, line = results[sequence.name, dimming, place], dict(style)
        if line.pop("fill", False):
            axes.stairs(bars(found), edges, fill=True, color=line["color"], alpha=0.13, linewidth=0)
        axes.stairs(bars(found), edges, label=dimming.value, **line)
        at = min(max(found.mean, edges[0]), edges[-1])
        marker = {"color": line["color"], "markersize": 0.6 * text_size(), "clip_on": False, "zorder": 5}
        axes.plot([at], [0.03], "v", transform=axes.get_xaxis_transform(), **marker)
        axes.text(0.99, 0.98 - 0.17 * k, f"{found.mean:.5f}", color=line["color"], ha="right", **label)
    axes.set(xscale="log", xlim=(edges[0], edges[-1]))
    axes.xaxis.set_major_locator(LogLocator(numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.5f}".rstrip("0")))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))


def histogram_points(sequences: Sequence[AdaptationInput], results: Results) -> tuple[PlottedPoint, ...]:
    """Return the bars of the histograms, each at its middle on the logarithmic axis."""
    points, edges = [], bar_edges()
    middles = np.sqrt(edges[:-1] * edges[1:])
    for sequence in sequences:
        for place in ConeInput:
            for dimming in DimmingCondition:
                found = results[sequence.name, dimming, place]
                for middle, share in zip(middles, bars(found), strict=True):
                    points.append(
                        PlottedPoint(
                            f"{sequence.name}, {place.value}", dimming.value, "", float(middle),
                            min(float(share), 1.0), "difference of the responses", "1",
                            "share of time", "1", Origin.COMPUTED, n=found.n_frames,
                        )
                    )  # fmt: skip
                points.append(
                    PlottedPoint(
                        f"{sequence.name}, {place.value}", f"{dimming.value}, mean", "", found.mean, None,
                        "difference of the responses", "1", "share of time", "1", Origin.COMPUTED,
                        n=found.n_frames,
                    )
                )  # fmt: skip
    return tuple(points)


def step_points(changes: Sequence[LuminanceChange]) -> tuple[PlottedPoint, ...]:
    """Return the responses of the figure of one change."""
    return tuple(
        PlottedPoint(
            change.name, series, "", float(time), float(value), "time", "s", "cone response", "1",
            Origin.COMPUTED,
        )
        for change in changes
        for series, values in (("static", change.static), ("dynamic", change.dynamic))
        for time, value in zip(np.round(change.times, 6), values, strict=True)
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class LuminanceChange:
    """A change of luminance, and what the cones make of it, at M moments.

    Attributes
    ----------
    name, times : str, array, (M,)
        What it is called, and the moments [s]; it begins at 0.
    static, dynamic, integral : array, (M,), and float
        Responses, in [0, 1], and the integral of their difference over all time shown [s].
    """

    name: str
    times: Array
    static: Array
    dynamic: Array
    integral: float

    @property
    def largest(self) -> float:
        """Largest difference at any of the moments."""
        return float(np.abs(self.static - self.dynamic).max())


def changes() -> tuple[LuminanceChange, LuminanceChange]:
    """Return the change at once, and at the pace of the rate limit."""
    ramp = float(np.log(BEFORE / AFTER)) / PACE
    return (
        _change("at once", np.arange(-0.1, 0.5, STEP), lambda t: AFTER if t >= -STEP / 2 else BEFORE),
        _change(
            f"at {100 * PACE:g} % per second", np.arange(-5.0, ramp + 5.0, 20 * STEP),
            lambda t: BEFORE * float(np.exp(-PACE * min(max(t, 0.0), ramp))),
        ),
    )  # fmt: skip


def _change(name: str, times: Array, luminance_at: Callable[[float], float]) -> LuminanceChange:
    """Return the responses to a luminance over time, constant between moments."""
    luminance = np.array([luminance_at(t) for t in times.tolist()])
    durations = np.full(len(times), times[1] - times[0])
    state, dynamic = adapted(luminance[0]), []
    for light, seconds in zip(luminance, durations, strict=True):
        dynamic.append(cone_response(light, state).item())
        state = state_after(state, light, seconds)
    integral = float(response_differences(luminance, durations).sum())
    return LuminanceChange(name, times, static_response(luminance), np.array(dynamic), integral)


def step_figure(shown: tuple[LuminanceChange, LuminanceChange]) -> Figure:
    """Draw both responses over time, for the change at once and for the slow one."""
    em = PAGE.em
    with look(PAGE):
        left, gap = 5.6 * em, 3.0 * em
        width = (PAGE.width - left - gap - 1.5 * em) / 2
        lines, above = heading_lines(
            "The time integral of the difference does not tell fast from slow",
            f"Cones that have adapted (static) and that adapt (dynamic): a screen dimmed from {BEFORE:g} to "
            f"{AFTER:g} cd/m²",
            PAGE.width - left - em, em,
        )  # fmt: skip
        top, height = above + 2.6 * em, 14 * em
        figure = new_figure(PAGE, top + height + 4.4 * em)
        lines_at(figure, left, lines)
        everything = np.concatenate([part for change in shown for part in (change.static, change.dynamic)])
        low, high = float(everything.min()), float(everything.max())
        for k, change in enumerate(shown):
            axes = axes_at(figure, left + k * (width + gap), top, width, height)
            axes.fill_between(
                change.times, change.static, change.dynamic, color=LIMIT, alpha=0.25, linewidth=0
            )
            axes.plot(change.times, change.static, color=INK, linestyle=(0, (3, 1.4)), label="static")
            axes.plot(change.times, change.dynamic, color=OURS, label="dynamic")
            area = f"area {1000 * change.integral:.1f} ms, gap up to {change.largest:.1g}"
            axes.set_title(f"{change.name}: {area}", loc="left")
            axes.set(
                xlim=(change.times[0], change.times[-1]), xlabel="time [s]",
                ylim=(low - 0.08 * (high - low), high + 0.08 * (high - low)),
            )  # fmt: skip
            if k == 0:
                axes.set_ylabel("cone response R [1]")
                axes.legend(loc="lower right")
            else:
                axes.tick_params(labelleft=False)
                seconds = np.log(BEFORE / AFTER) / PACE
                words = f"the lines all but lie on each other,\nbut for {seconds:.0f} s: about the same area"
                axes.text(
                    0.97, 0.06, words, color=MUTED, ha="right", transform=axes.transAxes, linespacing=1.4
                )
    return figure

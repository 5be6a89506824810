"""The histogram of the differences between static and dynamic cone response (Section 4.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, PercentFormatter

from evenlight.analysis.figure_style import (
    BASELINE,
    LIMIT,
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
from evenlight.analysis.reproduction.adaptation_differences import (
    BINS_PER_DECADE,
    DECADES,
    AdaptationInput,
    Differences,
    Dimming,
    Place,
    bin_edges,
)
from evenlight.data_schema.arrays import Array

Results = Mapping[tuple[str, Dimming, Place], Differences]

STYLES: dict[Dimming, dict[str, Any]] = {
    Dimming.CONSTANT: {"color": BASELINE, "linewidth": 3.0, "alpha": 0.75},
    Dimming.CONSTRAINED: {"color": OURS, "linewidth": 1.3},
    Dimming.UNCONSTRAINED: {"color": LIMIT, "linewidth": 1.5, "linestyle": (0, (3, 1.2)), "fill": True},
}
SHOWN = (-5, -1)  # powers of ten between which the bars are; the first holds what is smaller, too
MERGED = 2  # bins of `bin_edges()` in a bar


def bar_edges() -> Array:
    """Return the edges of the bars that are drawn, (bars + 1,).

    >>> edges = bar_edges()
    >>> edges.size, round(float(edges[0]), 9), round(float(edges[-1]), 9)
    (21, 1e-05, 0.1)
    """
    first = (SHOWN[0] - DECADES[0]) * BINS_PER_DECADE
    last = (SHOWN[1] - DECADES[0]) * BINS_PER_DECADE
    return bin_edges()[first : last + 1 : MERGED]


def bars(found: Differences) -> Array:
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
            highest = max(bars(results[sequence.name, d, p]).max() for d in Dimming for p in Place)
            for column, place in enumerate(Place):
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
    Place.PIXEL: "each block of pixels by itself: the eye rests",
    Place.FRAME_MEAN: "mean of the frame: the eye wanders",
}


def _draw(axes: Axes, sequence: AdaptationInput, place: Place, results: Results) -> None:
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

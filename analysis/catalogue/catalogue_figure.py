"""The figure of a catalogue: what its videos saved and gained, and how near the optimum their tracks are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evenlight.analysis.figure_style import (
    BASELINE,
    INK,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.catalogue import CatalogueRow

FEWEST_BINS, MOST_BINS = 6, 24


def catalogue_figure(rows: Sequence[CatalogueRow]) -> Figure:
    """Draw how saving, gain, spread and gap are distributed over the videos of a catalogue.

    Parameters
    ----------
    rows : sequence of CatalogueRow
        Those with a result, at least one.
    """
    with look(PAGE):
        em = PAGE.em
        lines, above = heading_lines(
            f"{len(rows)} videos" if len(rows) > 1 else "1 video",
            "How many videos have which value. Above: the power that dimming saves; the gain: how much less "
            "the track's loss differs between frames than constant dimming's. Below: these differences "
            "themselves; what a better track could gain at most.",
            PAGE.width - 4 * em,
            em,
        )
        top, height, width = above + 3.0 * em, 12 * em, (PAGE.width - 14 * em) / 2
        left, right, below = 5 * em, 10 * em + width, top + height + 7.5 * em
        figure = new_figure(PAGE, below + height + 5 * em)
        lines_at(figure, 2 * em, lines)
        saved = [1 - row.mean_power / row.full_power for row in rows if row.mean_power and row.full_power]
        _histogram(axes_at(figure, left, top, width, height), "power saved [%]", _percent(saved))
        gains = [row.gain for row in rows if row.gain is not None]
        axes = axes_at(figure, right, top, width, height)
        _histogram(axes, "gain over constant dimming [%]", _percent(gains))
        axes = axes_at(figure, left, below, width, height)
        ours = _percent([row.objective for row in rows if row.objective is not None])
        constant = _percent([row.objective_baseline for row in rows if row.objective_baseline is not None])
        _histogram(axes, "difference of loss between two frames [% points]", ours, constant)
        gaps = [row.gap for row in rows if row.gap is not None]
        axes = axes_at(figure, right, below, width, height)
        _histogram(axes, "gap to the bound, of what was minimized [%]", _percent(gaps))
    return figure


def _percent(shares: Sequence[float]) -> Array:
    """Return shares in percent."""
    return 100 * np.asarray(shares, dtype=np.float64)


def _histogram(axes: Axes, label: str, ours: Array, constant: Array | None = None) -> None:
    """Draw how values are distributed, those of constant dimming as an outline, and their medians."""
    every = ours if constant is None else np.concatenate([ours, constant])
    low, high = (float(every.min()), float(every.max())) if every.size else (0.0, 1.0)
    if high - low < 1e-6:  # all alike: one bar, in the middle
        low, high = low - 1, high + 1
    bins = int(np.clip(2 * np.sqrt(ours.size), FEWEST_BINS, MOST_BINS)) // 2 * 2 + 1
    edges = np.linspace(low, high, bins + 1).tolist()
    axes.hist(ours, edges, color=OURS, edgecolor="white", lw=0.8, label="tracks")
    if ours.size:
        axes.axvline(float(np.median(ours)), color=INK, ls="--", label="their median")
    if constant is not None:
        axes.hist(constant, edges, histtype="step", color=BASELINE, lw=1.5, label="constant dimming")
    axes.set(xlabel=label, ylabel="videos")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    legend_above(axes)

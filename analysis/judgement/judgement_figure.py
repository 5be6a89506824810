"""The figure of a judgement: how evenly each measure finds the loss spread, and which measures agree."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
)
from evenlight.data_schema.tracks.judgement import Judgement

ROW = 2.4  # em of height, of a measure


def judgement_figure(judgement: Judgement) -> Figure:
    """Draw the spread of loss by each measure, and the rank correlation of each pair of measures.

    Parameters
    ----------
    judgement : Judgement
        What the measures say.
    """
    with look(PAGE):
        em, n = PAGE.em, len(judgement.measured)
        lines, above = heading_lines(
            f"{judgement.video} by {n} measure{'s' * (n > 1)} of loss",
            "Left: how differently the frames lose contrast, beside constant dimming at equal power. Right: "
            "rank correlation of the measures over the frames, at constant dimming.",
            PAGE.width - 4 * em,
            em,
        )
        top, height = above + 3.0 * em, max(n, 2) * ROW * em
        figure = new_figure(PAGE, top + height + 6 * em)
        lines_at(figure, 2 * em, lines)
        half = (PAGE.width - 24 * em) / 2
        _spreads(axes_at(figure, 9.5 * em, top, half + 2.5 * em, height), judgement)
        _agreements(axes_at(figure, 22 * em + half, top, half - 2 * em, height), judgement)
    return figure


def _spreads(axes: Axes, judgement: Judgement) -> None:
    """Draw the spread of the track as a share of that of constant dimming: the measures' units differ."""
    rows = np.arange(len(judgement.measured))
    shares = [np.nan if one.gain is None else 1 - one.gain for one in judgement.measured]
    axes.axvline(1, color=BASELINE, label="constant dimming")
    axes.hlines(rows, np.minimum(shares, 1), np.maximum(shares, 1), color=FAINT, lw=3)
    axes.plot(shares, rows, "D", color=OURS, label="track")
    axes.set(xlabel="spread of loss, as a share of constant dimming's", ylim=(len(rows) - 0.5, -0.5))
    axes.set_xlim(0, 1.08 * np.nanmax([*shares, 1.0]))
    axes.set_yticks(rows, [one.measure for one in judgement.measured])
    legend_above(axes)


def _agreements(axes: Axes, judgement: Judgement) -> None:
    """Draw the matrix of rank correlations, with its numbers."""
    names = [one.measure for one in judgement.measured]
    matrix = np.eye(len(names))
    for pair in judgement.agreements:
        i, j = names.index(pair.first), names.index(pair.second)
        matrix[i, j] = matrix[j, i] = np.nan if pair.correlation is None else pair.correlation
    axes.imshow(matrix, cmap="PuOr", vmin=-1, vmax=1, aspect="auto")
    for i, j in np.ndindex(matrix.shape):
        words = "–" if np.isnan(matrix[i, j]) else f"{matrix[i, j]:.2f}"
        dark = abs(matrix[i, j]) > 0.6
        axes.text(j, i, words, ha="center", va="center", color="white" if dark else "black")
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right")
    axes.set_yticks(range(len(names)), names)

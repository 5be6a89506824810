"""The figure of brightness and contrast loss over time in several sequences (the paper's last figure)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    Medium,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_at,
    text_size,
)
from evenlight.analysis.findings import Drawing
from evenlight.analysis.reproduction.sequence_tracks import SequenceTracks
from evenlight.analysis.tracks.track_figure import factor_axis
from evenlight.analysis.tracks.track_figure_data import frame_edges
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint
from evenlight.data_schema.arrays import Array

PICTURES = 6
UNCONSTRAINED = MUTED
LINES = (
    "Each sequence at its budget: the track within the rate limit, constant dimming at the same power, and a "
    "track without rate limit."
)


def sequence_figure(sequences: Sequence[SequenceTracks], note: str = "", medium: Medium = PAGE) -> Figure:
    """Draw, for each sequence, frames along it, and brightness factor and contrast loss over time.

    Parameters
    ----------
    sequences : sequence of SequenceTracks
        From top to bottom.
    note : str
        What the tracks rest on; stands below the title.
    medium : Medium
        Where it is shown.
    """
    with look(medium):
        em = medium.em
        left, gap = 4.6 * em, 5.2 * em
        width = (medium.width - left - gap - 1.2 * em) / 2
        lines, top = heading_lines(
            "Brightness and contrast loss over time", f"{LINES} {note}".strip(), medium.width - left - em, em
        )
        first = sequences[0].thumbnails[0][1]
        full = medium.width - left - 1.2 * em
        picture = (full - (PICTURES - 1) * 0.6 * em) / PICTURES
        tall = picture * first.shape[0] / first.shape[1]
        panel = 8.6 * em
        row = 2.1 * em + tall + 2.4 * em + panel + 3.4 * em
        figure = new_figure(medium, top + len(sequences) * row + 1.2 * em)
        lines_at(figure, left, lines)
        for place, sequence in enumerate(sequences):
            above = top + 0.6 * em + place * row
            text_at(figure, left, above, _row_title(sequence), fontweight="bold")
            _draw_pictures(figure, sequence, (left, above + 1.9 * em), (picture, tall))
            at = above + 1.9 * em + tall + 2.0 * em
            factors = axes_at(figure, left, at, width, panel)
            loss = axes_at(figure, left + width + gap, at, width, panel)
            _draw_factors(factors, sequence)
            _draw_loss(loss, sequence)
            for axes in (factors, loss):
                axes.set_xlim(0.0, float(frame_edges(sequence.track.times)[-1]))
                axes.grid(axis="y", color=FAINT, linewidth=0.6)
                if place == len(sequences) - 1:
                    axes.set_xlabel("time [s]")
            if place == 0:
                for axes in (factors, loss):
                    axes.legend(
                        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=0.85 * text_size()
                    )
    return figure


def _row_title(sequence: SequenceTracks) -> str:
    """Return what a sequence is and what came out."""
    ours, constant = sequence.summary.objective, sequence.summary.objective_baseline
    less = f"{100 * (1 - ours / constant):.0f} % less" if constant > 0 else "no difference"
    return (
        f"{in_words(sequence.name)}, mean factor {sequence.budget:g}: loss differs between frames by "
        f"{ours:.2g}, {less} than constant dimming"
    )


def _draw_pictures(
    figure: Figure, sequence: SequenceTracks, corner: tuple[float, float], size: tuple[float, float]
) -> None:
    """Draw frames of a sequence in a row, each with its time."""
    left, top = corner
    wide, tall = size
    pictures = sequence.thumbnails[:PICTURES]
    step = wide + 0.6 * text_size() / 72
    for k, (index, picture) in enumerate(pictures):
        axes = axes_at(figure, left + k * step, top, wide, tall)
        axes.imshow(picture, aspect="auto")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.text(
            0.03, 0.05, f"{sequence.track.times[index]:.0f} s", transform=axes.transAxes, color="white",
            fontsize=0.8 * text_size(), bbox={"facecolor": "black", "alpha": 0.6, "pad": 1.5, "linewidth": 0},
        )  # fmt: skip


def _draw_factors(axes: Axes, sequence: SequenceTracks) -> None:
    """Draw the factors of the three ways of dimming."""
    times = sequence.track.times
    axes.plot(times, sequence.unconstrained, color=UNCONSTRAINED, lw=0.7, ls=":", label="no rate limit")
    axes.axhline(sequence.baseline_factor, color=BASELINE, label="constant")
    axes.plot(times, sequence.track.factors, color=OURS, label="ours")
    both = np.concatenate([sequence.track.factors, sequence.unconstrained, [sequence.baseline_factor]])
    axes.set_ylim(*factor_axis(both))
    axes.set_ylabel("brightness factor")


def _draw_loss(axes: Axes, sequence: SequenceTracks) -> None:
    """Draw what contrast the track and constant dimming lose."""
    times, ours = sequence.track.times, sequence.track.contrast_loss
    axes.plot(times, sequence.baseline_loss, color=BASELINE, label="constant")
    axes.plot(times, ours, color=OURS, label="ours")
    axes.axhline(float(ours.mean()), color=LIMIT, lw=0.7, ls="--", label="mean of ours")
    axes.set_ylim(0.0, 1.08 * float(max(ours.max(), sequence.baseline_loss.max(), 1e-3)))
    axes.set_ylabel("contrast loss")


def sequence_drawing(sequences: Sequence[SequenceTracks], png: bytes) -> Drawing:
    """Return the figure with the numbers that are drawn in it."""
    points = [point for sequence in sequences for point in track_points(sequence)]
    return Drawing(
        "brightness_and_contrast_loss",
        png,
        "Brightness factor (left) and contrast loss (right) over time in the four sequences: ours (blue), "
        "constant dimming at the same power (orange), and a track without rate limit (dotted). The dashed "
        "line is the mean loss of ours.",
        tuple(points),
    )


def track_points(sequence: SequenceTracks) -> list[PlottedPoint]:
    """Return the lines of a sequence: factors and losses of each frame."""
    times = sequence.track.times
    constant = np.full(len(times), sequence.baseline_factor)
    lines: tuple[tuple[str, str, Array], ...] = (
        ("brightness factor", "ours", sequence.track.factors),
        ("brightness factor", "constant", constant),
        ("brightness factor", "no rate limit", sequence.unconstrained),
        ("contrast loss", "ours", sequence.track.contrast_loss),
        ("contrast loss", "constant", sequence.baseline_loss),
    )
    return [
        PlottedPoint(f"{sequence.name}: {what}", series, "", t, y, "time", "s", what, "1", Origin.COMPUTED)
        for what, series, values in lines
        for t, y in zip(times.tolist(), values.tolist(), strict=True)
    ]

"""What of the reproduction needs no participants: lost contrast, examples, the four sequences."""

from __future__ import annotations

import dataclasses
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
    FigureFormat,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    png_bytes,
    text_at,
    text_size,
)
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.report import Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.reproduction.reproduction import SequenceTracks
from evenlight.analysis.tracks.contrast_map_figure import ContrastMap, contrast_map, contrast_map_figure
from evenlight.analysis.tracks.track_figure import factor_axis, track_figure
from evenlight.analysis.tracks.track_figure_data import TrackFigureData, frame_edges
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.arrays import Array
from evenlight.method.contrast.luminance import emitted_luminance

SHOWN_FACTORS = (0.4, 0.8)  # average brightness of the paper's figure of thresholded contrast
RESTS_ON_SIMULATED = "The rate limit rests on simulated participants."
PICTURES = 6
UNCONSTRAINED = MUTED
LINES = (
    "Each sequence at its budget: the track within the rate limit, constant dimming at the same power, and a "
    "track without rate limit."
)


def contrast_findings(sequence: SequenceTracks) -> Findings:
    """Return visible and lost contrast in one frame of a sequence, at two brightness factors.

    The frame is the one, of some evenly spread ones, that is brightest of those with contrast to lose.
    """
    display = sequence.curves.display
    index, pixels = max(sequence.samples, key=lambda held: float(sequence.curves.visible_contrast[held[0]]))
    low, high = (
        dataclasses.replace(contrast_map(pixels, factor, display), label="dimmed") for factor in SHOWN_FACTORS
    )
    time = float(sequence.track.times[index])
    name = f"{in_words(sequence.name).lower()} at {time:.1f} s"
    bright = float(emitted_luminance(pixels, display).mean())
    rows = [row for at in (low, high) for row in _map_rows(at, name)]
    png = png_bytes(contrast_map_figure(pixels, low, high, name))
    caption = (
        f"A frame of mean luminance {bright:.3g} cd/m², and its visible contrast (white) and what dimming "
        f"loses of it (red), at mean brightness factors of {low.factor:g} and {high.factor:g}."
    )
    points = tuple(
        PlottedPoint(
            f"b = {at.factor:g}", what, "", None, share, "", "", "share of the pixels", "1", Origin.COMPUTED
        )
        for at in (low, high)
        for what, share in _shares(at)
    )
    drawing = Drawing("thresholded_contrast", png, caption, points)
    lead = (
        f"Dimmed to {low.factor:g}, the frame loses {100 * low.loss:.0f} % of its visible contrast; to "
        f"{high.factor:g}, {100 * high.loss:.1f} %."
    )
    about = Section("Visible contrast, and what dimming loses of it", (lead,), (), (drawing.picture,))
    return Findings("thresholded_contrast", lead, tuple(rows), (drawing,), (about,))


def _shares(at: ContrastMap) -> tuple[tuple[str, float], ...]:
    """Return which share of a map's pixels is what."""
    visible, lost = float(at.reference.mean()), float(at.lost.mean())
    return ("visible and stays", visible - lost), ("lost", lost), ("not visible", 1 - visible)


def _map_rows(at: ContrastMap, group: str) -> list[Statistic]:
    """Return the numbers that stand in the figure."""
    band = f"of the visible contrast at {at.frequency:.3g} cpd"
    return [
        Statistic(
            "lost_contrast", f"{group}, factor {at.factor:g}", what, value, "1", Origin.COMPUTED, method=how
        )
        for what, value, how in (
            ("contrast loss", at.loss, "share of the visible contrast of all bands that is lost"),
            ("loss in the band shown", at.lost_share, band),
        )
    ]


def example_findings(examples: Sequence[SequenceTracks], simulated: bool) -> Findings:
    """Return the tracks of checkerboard and sunrise (the paper's two examples)."""
    drawings, sections = [], []
    for example in examples:
        caption = (
            f"{in_words(example.name)} at a mean factor of {example.budget:g}: brightness factor, contrast "
            "loss and rate of change over time, for the track (blue) and constant dimming at the same power "
            "(orange); below, frames at the marked times at full brightness and as they are shown."
        )
        png = png_bytes(track_figure(_figure_data(example)))
        drawing = Drawing(example.name, png, caption, tuple(track_points(example)))
        drawings.append(drawing)
        sections.append(
            Section(in_words(example.name), (_example_words(example),), (), (drawing.picture,),
                    simulated=simulated)
        )  # fmt: skip
    lead = " ".join(_example_words(example) for example in examples)
    rows = [row for example in examples for row in track_rows(example)]
    return Findings("examples", lead, tuple(rows), tuple(drawings), tuple(sections))


def _figure_data(sequence: SequenceTracks) -> TrackFigureData:
    """Return the content of the figure of a track."""
    return TrackFigureData(
        track=sequence.track,
        baseline_factor=sequence.baseline_factor,
        baseline_loss=sequence.baseline_loss,
        objective=sequence.summary.objective,
        objective_baseline=sequence.summary.objective_baseline,
        thumbnails=sequence.thumbnails,
        lowest_factor=float(sequence.curves.factors[0]),
    )


def _example_words(example: SequenceTracks) -> str:
    """Return how brightness follows content, in a sentence."""
    content = example.curves.mean_luminance
    together = float(np.corrcoef(example.track.factors, content)[0, 1])
    low, high = float(example.track.factors.min()), float(example.track.factors.max())
    way = "darker frames get more light" if together < 0 else "brighter frames get more light"
    return (
        f"{in_words(example.name)}: the factor goes from {low:.2f} to {high:.2f}; {way} (correlation of "
        f"factor and mean luminance {together:.2f})."
    )


def sequence_findings(sequences: Sequence[SequenceTracks], simulated: bool) -> Findings:
    """Return brightness and contrast loss of the four sequences."""
    png = png_bytes(_sequence_figure(sequences, RESTS_ON_SIMULATED if simulated else ""))
    drawing = sequence_drawing(sequences, png)
    gains = [100 * (1 - s.summary.objective / s.summary.objective_baseline) for s in sequences]
    table = Table(
        "Mean absolute difference of contrast loss between two frames: of ours, of constant dimming, without "
        "rate limit; and below which no track within the limits gets.",
        ("sequence", "mean factor", "frames", "ours", "constant", "less [%]", "no rate limit", "lower bound",
         "fastest change, share of limit"),
        tuple(
            (
                in_words(s.name), s.budget, s.summary.frames, s.summary.objective,
                s.summary.objective_baseline, gain, s.unconstrained_objective, s.summary.lower_bound,
                s.summary.max_rate_ratio,
            )
            for s, gain in zip(sequences, gains, strict=True)
        ),
    )  # fmt: skip
    about = section("reproduction/sequences", (table,), (drawing.picture,), simulated=simulated, gains=gains)
    rows = [row for sequence in sequences for row in track_rows(sequence)]
    return Findings("sequences", about.paragraphs[0], tuple(rows), (drawing,), (about,))


def track_rows(sequence: SequenceTracks) -> list[Statistic]:
    """Return what the tracks of a sequence achieve."""
    summary, n = sequence.summary, sequence.summary.frames
    spread = "mean absolute difference of contrast loss between two frames"
    numbers = (
        ("mean brightness factor", summary.mean_factor, "of the track"),
        ("spread of contrast loss, ours", summary.objective, spread),
        ("spread of contrast loss, constant", summary.objective_baseline, spread),
        ("spread of contrast loss, no rate limit", sequence.unconstrained_objective, spread),
        ("spread of contrast loss, lower bound", summary.lower_bound, "no track within the limits has less"),
        ("mean contrast loss, ours", summary.mean_contrast_loss, "mean over time"),
        ("mean contrast loss, constant", summary.mean_contrast_loss_baseline, "mean over time"),
        ("fastest change", summary.max_rate_ratio, "share of the rate limit"),
    )
    return [
        Statistic("tracks", sequence.name, what, value, "1", Origin.COMPUTED, n=n, method=how)
        for what, value, how in numbers
    ]


def _sequence_figure(
    sequences: Sequence[SequenceTracks], note: str = "", medium: FigureFormat = PAGE
) -> Figure:
    """Draw, for each sequence, frames along it, and brightness factor and contrast loss over time."""
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

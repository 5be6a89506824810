"""What of the reproduction needs no participants: lost contrast, examples, the four sequences."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.report import Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.reproduction.sequence_figure import sequence_drawing, sequence_figure, track_points
from evenlight.analysis.reproduction.sequence_tracks import SequenceTracks
from evenlight.analysis.tracks.contrast_map_figure import ContrastMap, contrast_map, contrast_map_figure
from evenlight.analysis.tracks.track_figure import track_figure
from evenlight.analysis.tracks.track_figure_data import TrackFigureData
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.method.contrast.luminance import emitted_luminance

SHOWN_FACTORS = (0.4, 0.8)  # average brightness of the paper's figure of thresholded contrast
RESTS_ON_SIMULATED = "The rate limit rests on simulated participants."


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
    png = png_bytes(sequence_figure(sequences, RESTS_ON_SIMULATED if simulated else ""))
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

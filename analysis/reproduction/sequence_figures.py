"""What of the paper needs no participants: lost contrast, the two examples, the four sequences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes

from evenlight.analysis.figure_style import BASELINE, FAINT, LIMIT, MUTED, OURS, PERCENT, look, panels
from evenlight.analysis.report import Cell, Section
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.reproduction import SequenceTracks
from evenlight.analysis.results import Analysis, Drawing
from evenlight.analysis.rows import Plot, Rows, number, significant
from evenlight.analysis.tracks.contrast_map_figure import contrast_map_figure, contrast_maps
from evenlight.analysis.tracks.track_figure import DrawnTrack, factor_axis, frame_edges, track_figure
from evenlight.analysis.wording import in_words, of_track
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.method.contrast.luminance import emitted_luminance

SHOWN_FACTORS = (0.4, 0.8)  # average brightness of the paper's figure of thresholded contrast
PICTURES = 6
SPREAD = "spread of contrast loss, "
LINES = (
    "Each sequence at its budget: the track within the rate limit, constant dimming at the same power, and a "
    "track without rate limit."
)


def percent(row: Statistic | None) -> tuple[Cell]:
    """Return a share in percent, or a difference of losses in points, with three significant digits."""
    return (None if row is None or row.value is None else f"{100 * row.value:.3g}",)


def contrast_findings(sequence: SequenceTracks) -> Analysis:
    """Return visible and lost contrast in one frame of a sequence, at two brightness factors.

    The frame is the one, of some evenly spread ones, with the most contrast to lose.
    """
    display, rows = sequence.curves.display, Rows(Origin.COMPUTED)
    index, pixels = max(sequence.samples, key=lambda held: float(sequence.curves.visible_contrast[held[0]]))
    low, high = contrast_maps(pixels, [(factor, None) for factor in SHOWN_FACTORS], display, DEFAULT_MODEL)
    name = f"{in_words(sequence.name).lower()} at {float(sequence.track.times[index]):.1f} s"
    points = []
    for at in (low, high):
        group, band = f"{name}, factor {at.factor:g}", f"of the visible contrast at {at.frequency:.3g} cpd"
        how = "share of the visible contrast of all bands that is lost"
        rows.add("lost_contrast", group, "contrast loss", "1", how, at.loss)
        rows.add("lost_contrast", group, "loss in the band shown", "1", band, at.lost_share)
        visible, lost = float(at.reference.mean()), float(at.lost.mean())
        shares = {"visible and stays": visible - lost, "lost": lost, "not visible": 1 - visible}
        for what, share in shares.items():
            panel, units = f"b = {at.factor:g}", ("", "", "share of the pixels", "1")
            points.append(PlottedPoint(panel, what, "", None, share, *units, Origin.COMPUTED))
    bright = float(emitted_luminance(pixels, display).mean())
    (caption,) = prose("reproduction/contrast_caption", bright=bright, low=low.factor, high=high.factor)
    figure = contrast_map_figure(pixels, low, high, name, labels=("dimmed", "dimmed"))
    drawing = Drawing("thresholded_contrast", figure, caption, tuple(points))
    lead = (
        f"Dimmed to {low.factor:g}, the frame loses {100 * low.loss:.0f} % of its visible contrast; to "
        f"{high.factor:g}, {100 * high.loss:.1f} %."
    )
    about = Section("Visible contrast, and what dimming loses of it", (lead,), (), (drawing.picture,))
    return Analysis("thresholded_contrast", lead, tuple(rows), (drawing,), (about,))


def example_findings(examples: Sequence[SequenceTracks]) -> Analysis:
    """Return the tracks of checkerboard and sunrise (the paper's two examples)."""
    drawings, sections, rows = [], [], Rows(Origin.COMPUTED)
    for example in examples:
        _add_track(rows, example)
        (caption,) = prose("reproduction/example_caption", name=example.name, budget=example.budget)
        drawn = DrawnTrack(example.track, example.summary, example.baseline_loss, example.thumbnails)
        drawing = Drawing(example.name, track_figure(drawn), caption, tuple(_points(example)))
        drawings.append(drawing)
        sections.append(Section(in_words(example.name), (_followed(example),), (), (drawing.picture,)))
    lead = " ".join(_followed(example) for example in examples)
    return Analysis("examples", lead, tuple(rows), tuple(drawings), tuple(sections))


def _followed(example: SequenceTracks) -> str:
    """Return how brightness follows content, in a sentence."""
    factors = example.track.factors
    together = float(np.corrcoef(factors, example.curves.mean_luminance)[0, 1])
    way = "darker frames get more light" if together < 0 else "brighter frames get more light"
    return (
        f"{in_words(example.name)}: the factor goes from {factors.min():.2f} to {factors.max():.2f}; {way} "
        f"(correlation of factor and mean luminance {together:.2f})."
    )


def sequence_findings(sequences: Sequence[SequenceTracks]) -> Analysis:
    """Return brightness and contrast loss of the four sequences."""
    rows = Rows(Origin.COMPUTED)
    for sequence in sequences:
        _add_track(rows, sequence)
    drawing = _sequence_drawing(sequences)
    spreads = [
        ("tracks", f"{SPREAD}{of}", percent) for of in ("ours", "constant", "no rate limit", "lower bound")
    ]
    table = rows.view(
        "Mean absolute difference of contrast loss between two frames, in percentage points: of the track, "
        "of constant dimming, without rate limit; and below which no track within the limits gets.",
        {s.name: in_words(s.name) for s in sequences},
        [("tracks", "mean brightness factor", significant), *spreads, ("tracks", "fastest change", number)],
        ("sequence", "mean factor", "the track", "constant", "no rate limit", "lower bound",
         "fastest change, share of limit"),
    )  # fmt: skip
    about = section("reproduction/sequences", (table,), (drawing.picture,), gains=[s.gain for s in sequences])
    return Analysis("sequences", about.paragraphs[0], tuple(rows), (drawing,), (about,))


def _add_track(rows: Rows, sequence: SequenceTracks) -> None:
    summary = sequence.summary
    spread = "mean absolute difference of contrast loss between two frames"
    for what, value, how in (
        ("mean brightness factor", summary.mean_factor, "of the track"),
        (f"{SPREAD}ours", summary.objective, spread),
        (f"{SPREAD}constant", summary.objective_baseline, spread),
        (f"{SPREAD}no rate limit", sequence.unconstrained_objective, spread),
        (f"{SPREAD}lower bound", summary.lower_bound, "no track within the limits has less"),
        ("mean contrast loss, ours", summary.mean_contrast_loss, "mean over time"),
        ("mean contrast loss, constant", summary.mean_contrast_loss_baseline, "mean over time"),
        ("fastest change", summary.max_rate_ratio, "share of the rate limit"),
    ):
        rows.add("tracks", sequence.name, what, "1", how, value, summary.frames)


def _lines(sequence: SequenceTracks) -> Iterator[tuple[str, str, Array]]:
    """Yield what is drawn of a sequence over time: panel, series, values."""
    yield "brightness factor", "ours", sequence.track.factors
    yield "brightness factor", "constant", np.full(len(sequence.track.times), sequence.baseline_factor)
    yield "brightness factor", "no rate limit", sequence.unconstrained
    yield "contrast loss", "ours", sequence.track.contrast_loss
    yield "contrast loss", "constant", sequence.baseline_loss


STYLES = {
    "ours": {"color": OURS, "zorder": 2.2},
    "constant": {"color": BASELINE, "zorder": 2.1},
    "no rate limit": {"color": MUTED, "lw": 1.1, "ls": ":"},
}


def _points(sequence: SequenceTracks) -> Iterator[PlottedPoint]:
    for what, series, values in _lines(sequence):
        for time, value in zip(sequence.track.times.tolist(), values.tolist(), strict=True):
            panel = f"{sequence.name}: {what}"
            yield PlottedPoint(panel, series, "", time, value, "time", "s", what, "1", Origin.COMPUTED)


def _sequence_drawing(sequences: Sequence[SequenceTracks]) -> Drawing:
    """Draw, for each sequence, frames along it, and brightness factor and contrast loss over time."""
    quantities = ("brightness factor", "contrast loss")
    mosaic, points = [], []
    for s in sequences:
        mosaic += [[".", "."], [s.name, s.name], [f"{s.name}: {what}" for what in quantities]]
    with look():
        title = "Brightness and contrast loss over time"
        figure, axes = panels(title, LINES, mosaic, [0.4, 5.4, 8.6] * len(sequences), apart=2.6)
        for s in sequences:
            _draw_pictures(axes[s.name], s)
            for what in quantities:
                plot = Plot(
                    axes[f"{s.name}: {what}"], f"{s.name}: {what}", Origin.COMPUTED, ("time", "s", what, "1")
                )
                for _, series, values in (own for own in _lines(s) if own[0] == what):
                    drawn = STYLES[series] | {"label": of_track(series)}
                    plot.line(series, s.track.times.tolist(), values.tolist(), **drawn)
                plot.axes.set(ylabel=what, xlim=(0.0, float(frame_edges(s.track.times)[-1])))
                plot.axes.grid(axis="y", color=FAINT, linewidth=0.6)
                points += plot.points
            both = np.concatenate([values for what, _, values in _lines(s) if what == quantities[0]])
            axes[f"{s.name}: {quantities[0]}"].set_ylim(*factor_axis(both))
            loss = axes[f"{s.name}: {quantities[1]}"]
            loss.axhline(
                float(s.track.contrast_loss.mean()), color=LIMIT, lw=0.7, ls="--", label="mean of the track"
            )
            loss.set_ylim(bottom=0.0)
            loss.yaxis.set_major_formatter(PERCENT)
        for what in quantities:
            axes[f"{sequences[0].name}: {what}"].legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
            axes[f"{sequences[-1].name}: {what}"].set_xlabel("time [s]")
    (caption,) = prose("reproduction/sequences_caption")
    return Drawing("brightness_and_contrast_loss", figure, caption, tuple(points))


def _draw_pictures(axes: Axes, sequence: SequenceTracks) -> None:
    pictures = [picture for _, picture in sequence.thumbnails[:PICTURES]]
    gap = np.full_like(pictures[0][:, : max(pictures[0].shape[1] // 20, 1)], 255)
    axes.imshow(np.hstack([part for picture in pictures for part in (picture, gap)][:-1]), aspect="auto")
    step = pictures[0].shape[1] + gap.shape[1]
    times = [f"{sequence.track.times[index]:.0f} s" for index, _ in sequence.thumbnails[:PICTURES]]
    axes.set_xticks([k * step + pictures[0].shape[1] / 2 for k in range(len(times))], times)
    axes.tick_params(length=0)
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    axes.set_title(_row_title(sequence), loc="left", fontweight="bold")


def _row_title(sequence: SequenceTracks) -> str:
    ours, constant = sequence.summary.objective, sequence.summary.objective_baseline
    less = f"{sequence.gain:.0f} % less" if constant > 0 else "no difference"
    return (
        f"{in_words(sequence.name)} ({sequence.budget:g}): loss differs between frames by "
        f"{100 * ours:.2g} points, {less} than constant dimming"
    )

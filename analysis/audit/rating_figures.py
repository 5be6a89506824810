"""The figures of the audit on Table 1: the ratings behind it, and the p of every pairing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from evenlight.analysis.audit.conventions import SCORES, Counts
from evenlight.analysis.audit.pairings import ALPHA, PairedTest, PValueRange, Verdict
from evenlight.analysis.audit.table_ratings import SequenceRatings, printed_cell
from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LIMIT,
    OURS,
    PAGE,
    PARTICIPANT,
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
from evenlight.analysis.findings import Drawing
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint

COLOURS = {"baseline": BASELINE, "ours": OURS}
VERDICT_COLOURS = {Verdict.DIFFERS: OURS, Verdict.OPEN: PARTICIPANT, Verdict.NOT_SHOWN: LIMIT}
VERDICT_WORDS = {
    Verdict.DIFFERS: "at most 0.05 in any pairing",
    Verdict.OPEN: "depends on the pairing",
    Verdict.NOT_SHOWN: "above 0.05 in any",
}
SMALLEST_DRAWN = 1e-4  # p


def distribution_drawing(ratings: Sequence[SequenceRatings], medium: FigureFormat = PAGE) -> Drawing:
    """Draw every histogram of ratings that agrees with each cell of Table 1."""
    title = "The ratings behind Table 1: every distribution that agrees with a printed mean and SEM"
    n = ratings[0].n
    subtitle = f"{n} ratings each. A line is one possible distribution; its height is the number of people."
    with look(medium):
        em = medium.em
        left, gap = 4.4 * em, 1.6 * em
        width = (medium.width - left - 1.2 * em - (len(ratings) - 1) * gap) / len(ratings)
        lines, above = heading_lines(title, subtitle, medium.width - left - em, em)
        height, between = 11.0 * em, 3.6 * em
        figure = new_figure(medium, above + 2 * (height + between) + 3.6 * em)
        lines_at(figure, left, lines)
        for column, r in enumerate(ratings):
            for row, (version, histograms) in enumerate((("baseline", r.baseline), ("ours", r.ours))):
                top = above + between + row * (height + between)
                axes = axes_at(figure, left + column * (width + gap), top, width, height)
                _draw_histograms(axes, histograms, COLOURS[version])
                _name_panel(axes, r.sequence, version, len(histograms))
                axes.tick_params(labelleft=column == 0, labelbottom=row == 1)
                if column == 0:
                    axes.set_ylabel("people")
                if row == 1:
                    axes.set_xlabel("rating")
        png = png_bytes(figure)
    caption = (
        f"Every distribution of {n} ratings from 1 to 5 that agrees with a printed mean and standard "
        "error, under any convention of rounding and of the standard deviation."
    )
    return Drawing("audit_distributions", png, caption, tuple(_histogram_points(ratings)))


def _draw_histograms(axes: Axes, histograms: Counts, colour: str) -> None:
    """Draw possible histograms as lines over the ratings, and the fewest and most people of each as a bar."""
    low, high = histograms.min(axis=0), histograms.max(axis=0)
    axes.bar(SCORES, high - low, bottom=low, width=0.8, color=colour, alpha=0.15, linewidth=0)
    opacity = float(np.clip(3 / len(histograms), 0.35, 1.0))
    size = text_size()
    for histogram in histograms:
        axes.plot(SCORES, histogram, "-o", color=colour, alpha=opacity, ms=0.3 * size, lw=0.09 * size,
                  clip_on=False)  # fmt: skip
    axes.set_xlim(0.5, SCORES[-1] + 0.5)
    axes.set_ylim(0, histograms[0].sum())
    axes.set_xticks(SCORES)
    axes.set_yticks([0, 5, 10, 15])
    axes.grid(axis="y", color=FAINT, lw=0.07 * text_size())


def _name_panel(axes: Axes, sequence: str, version: str, possible: int) -> None:
    """Write what a panel shows above it."""
    printed = printed_cell(sequence, version)
    name = f"{in_words(sequence)}, {version}"
    axes.set_title(
        f"{name}\n{printed.mean} ± {printed.sem}: {possible} possible", loc="left", linespacing=1.4
    )


def _histogram_points(ratings: Sequence[SequenceRatings]) -> list[PlottedPoint]:
    """Return the people that gave each rating, in every possible distribution."""
    return [
        PlottedPoint(f"{r.sequence}, {version}", f"possibility {number}", "", float(score), float(count),
                     "rating", "1", "people", "1", Origin.COMPUTED, n=r.n)
        for r in ratings
        for version, histograms in (("baseline", r.baseline), ("ours", r.ours))
        for number, histogram in enumerate(histograms, start=1)
        for score, count in zip(SCORES, histogram, strict=True)
    ]  # fmt: skip


def pairing_drawing(
    ratings: Sequence[SequenceRatings],
    adjusted: dict[PairedTest, list[PValueRange]],
    medium: FigureFormat = PAGE,
) -> Drawing:
    """Draw the range of p over all pairings, for each sequence and test."""
    title = "What paired tests of Table 1 can give, over all pairings that agree with it"
    subtitle = (
        f"{ratings[0].n} pairs. Thick: from the smallest to the largest two-sided p. Thin, below: with "
        f"Holm's correction for {len(ratings)} sequences."
    )
    with look(medium):
        em = medium.em
        left = 17.5 * em
        width = medium.width - left - 1.6 * em
        lines, above = heading_lines(title, subtitle, medium.width - 2 * em, em)
        row, key = 1.85 * em, 2.6 * em
        height = row * (len(ratings) * (len(PairedTest) + 0.8))
        figure = new_figure(medium, above + key + height + 3.9 * em)
        lines_at(figure, em, lines)
        axes = axes_at(figure, left, above + key, width, height)
        labels, places = [], []
        for k, r in enumerate(ratings):
            first = k * (len(PairedTest) + 0.8)
            text_at(figure, em, above + key + row * (first + 0.62), in_words(r.sequence), fontweight="bold")
            _draw_unpaired(axes, r, first)
            for j, test in enumerate(PairedTest):
                _draw_range(axes, first + j, r.ranges[test], adjusted[test][k])
                labels.append(test.value)
                places.append(first + j)
        _frame_ranges(axes, places, labels, em / height)
        png = png_bytes(figure)
    caption = (
        f"Smallest and largest p of {len(PairedTest)} paired tests over every pairing that agrees with "
        "Table 1, alone and with Holm's correction. Diamonds: the p of a test that takes the two versions "
        f"for rated by different people. p below {SMALLEST_DRAWN:g} are drawn as arrows at the edge."
    )
    return Drawing("audit_pairings", png, caption, tuple(_range_points(ratings, adjusted)))


def _draw_range(axes: Axes, place: float, raw: PValueRange, adjusted: PValueRange) -> None:
    """Draw a range of p, and below it the corrected one."""
    size, colour = text_size(), VERDICT_COLOURS[raw.verdict]
    for p, at, width, opacity in ((raw, place - 0.08, 0.75, 1.0), (adjusted, place + 0.3, 0.17, 0.9)):
        low = max(p.low, SMALLEST_DRAWN)
        axes.plot(
            [low, p.high], [at, at], color=colour, lw=width * size, alpha=opacity, solid_capstyle="butt"
        )
        if p.low < SMALLEST_DRAWN and p is raw:
            axes.annotate(
                "",
                (SMALLEST_DRAWN, at),
                (1.6 * SMALLEST_DRAWN, at),
                zorder=4,
                arrowprops={"arrowstyle": "-|>", "color": "white", "lw": 0.1 * size},
            )


def _draw_unpaired(axes: Axes, r: SequenceRatings, first: float) -> None:
    """Draw the p of the unpaired tests on the rows of their paired relatives."""
    for place, p in zip((0, 1), r.unpaired, strict=True):
        middle = float(np.sqrt(p.low * p.high))
        axes.plot(
            [middle], [first + place - 0.08], "D", color="white", mec=INK, ms=0.55 * text_size(), zorder=5
        )


def _frame_ranges(axes: Axes, places: list[float], labels: list[str], em: float) -> None:
    """Set the axes and the key of the ranges."""
    size = text_size()
    axes.set_xscale("log")
    axes.set_xlim(SMALLEST_DRAWN, 1.15)
    axes.set_ylim(max(places) + 0.8, -0.8)
    axes.set_yticks(places, labels)
    axes.set_yticklabels(labels, color=INK)
    ticks = [1e-4, 1e-3, 0.01, 0.05, 0.2, 1.0]
    axes.set_xticks(ticks, ["0.0001", "0.001", "0.01", "0.05", "0.2", "1"])
    axes.minorticks_off()
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color=FAINT, lw=0.07 * size)
    axes.axvline(ALPHA, color=INK, lw=0.13 * size, ls="--", zorder=0.5)
    axes.set_xlabel("two-sided p")
    axes.spines["left"].set_visible(False)
    keys = [Line2D([], [], color=VERDICT_COLOURS[v], lw=0.75 * size, label=VERDICT_WORDS[v]) for v in Verdict]
    keys.append(
        Line2D([], [], ls="", marker="D", color="white", mec=INK, ms=0.55 * size, label="as if unpaired")
    )
    axes.legend(
        handles=keys, loc="lower right", bbox_to_anchor=(1.0, 1.0 + 0.5 * em), ncols=4, columnspacing=1.2
    )


def _range_points(
    ratings: Sequence[SequenceRatings], adjusted: dict[PairedTest, list[PValueRange]]
) -> list[PlottedPoint]:
    """Return the ends of every range that is drawn."""
    drawn = [
        (r, test.value, series, p)
        for k, r in enumerate(ratings)
        for test in PairedTest
        for series, p in (("p", r.ranges[test]), ("p, Holm", adjusted[test][k]))
    ]
    names = (PairedTest.T.value, PairedTest.SIGN_FLIP.value)
    for r in ratings:
        drawn += [(r, name, "p, as if unpaired", p) for name, p in zip(names, r.unpaired, strict=True)]
    return [
        PlottedPoint(r.sequence, series, label, None, float(np.sqrt(p.low * p.high)), "test", "1",
                     "two-sided p", "1", Origin.COMPUTED, low=p.low, high=p.high, n=r.n)
        for r, label, series, p in drawn
    ]  # fmt: skip

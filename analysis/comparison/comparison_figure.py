"""The figures of the artifact comparison: shares with their intervals, and what so many answers can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.comparison.comparison_limits import POWER
from evenlight.analysis.comparison.comparison_results import ComparisonResults
from evenlight.analysis.comparison.comparison_shares import ShareEstimate
from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.inference.binomial_power import difference_power, margin_shown, smallest_margin_ever
from evenlight.analysis.inference.binomial_tests import HALF
from evenlight.analysis.wording import spaced

LARGER = (50, 100, 200)  # numbers of answers drawn beside the experiment's own
SHARES = np.linspace(0.5, 1.0, 101)
MARGIN_NUMBERS = np.unique(2 * np.geomspace(4, 500, 60).round().astype(int))  # even: no jumps
LINES = ("-", (0, (5, 1.6)), (0, (2.5, 1.4)), (0, (1, 1.2)))
ALL = "all answers"


@dataclass(frozen=True, slots=True)
class ShareRow:
    """A row of the figure of shares: its name, and what is drawn."""

    name: str
    estimate: ShareEstimate | None


def share_rows(found: ComparisonResults) -> tuple[ShareRow, ...]:
    """Return what the figure of shares draws, from above: the sequences, then all of them."""
    rows = tuple(ShareRow(own.name, own.estimate) for own in found.sequences)
    return (*rows, ShareRow(ALL, found.pooled)) if len(rows) > 1 else rows


def shares_figure(found: ComparisonResults, medium: FigureFormat = PAGE) -> Figure:
    """Draw the share of each sequence with its interval, one half, and the margin about it.

    Parameters
    ----------
    found : ComparisonResults
        What the comparison shows.
    medium : FigureFormat
        Where it is shown.
    """
    rows = share_rows(found)
    with look(medium):
        em = medium.em
        left = (1.5 + 0.6 * min(28, max(len(row.name) for row in rows))) * em
        right = 12 * em
        width = medium.width - left - right
        lines, above = heading_lines(*_heading(found), medium.width - 3 * em, em)
        height = (1.6 + 2.1 * len(rows)) * em
        figure = new_figure(medium, above + 1.6 * em + height + 4.2 * em)
        lines_at(figure, 1.5 * em, lines)
        axes = axes_at(figure, left, above + 1.6 * em, width, height)
        _draw_half(axes, found.margin)
        for place, row in enumerate(rows):
            _draw_share(axes, place, row)
        axes.set(xlim=(0, 1), ylim=(len(rows) - 0.45, -0.55))
        axes.set_yticks(range(len(rows)), [drawable(spaced(row.name[:28])) for row in rows])
        axes.set_xticks(np.arange(0, 1.01, 0.1), [f"{k}" for k in range(0, 101, 10)])
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("ours taken for the one whose brightness changed [% of answers]")
    return figure


def _heading(found: ComparisonResults) -> tuple[str, str]:
    """Return title and subtitle."""
    who = "simulated participants" if found.data.simulated else "participants"
    exact = found.pooled.exact is not None or all(
        s.estimate is None or s.estimate.exact for s in found.sequences
    )
    bars = "Clopper and Pearson" if exact else "over participants"
    return (
        "Which of the two changed in brightness?",
        f"{found.people} {who}. Bars: 95 % confidence intervals ({bars}; all answers: over "
        f"participants). Band: 0.5 ± {found.margin:g}, the margin within which a share counts as a coin's.",
    )


def _draw_half(axes: Axes, margin: float) -> None:
    """Draw one half and the margin."""
    axes.axvspan(HALF - margin, HALF + margin, color=FAINT, alpha=0.55, linewidth=0, zorder=0)
    axes.axvline(HALF, color=MUTED, linewidth=text_size() / 9, zorder=1)
    for share, words, side in ((0.0, "baseline chosen", "left"), (1.0, "ours chosen", "right")):
        axes.annotate(words, (share, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
                      textcoords="offset points", ha=side, color=MUTED,
                      fontsize=0.9 * text_size())  # fmt: skip


def _draw_share(axes: Axes, place: int, row: ShareRow) -> None:
    """Draw a share with its interval, and its counts at the right."""
    size = text_size()
    is_all = row.name == ALL
    colour = INK if is_all else OURS
    if row.estimate is None:
        words = "no answer"
    else:
        choices = row.estimate.choices
        words = f"{int(choices.chosen.sum())} of {choices.total}"
        if not choices.one_each:
            words += f" ({len(choices.participants)} people)"
        if row.estimate.interval is not None:
            axes.plot(row.estimate.interval, [place, place], color=colour, linewidth=size / 4.5, zorder=3,
                      solid_capstyle="butt")  # fmt: skip
        axes.plot(choices.share, place, "D" if is_all else "o", color=colour, ms=0.8 * size, mec="white",
                  mew=size / 12, zorder=4, clip_on=False)  # fmt: skip
    axes.annotate(words, (1.0, place), xytext=(0.8 * size, 0), textcoords="offset points", va="center",
                  annotation_clip=False)  # fmt: skip
    if is_all:
        axes.axhline(place - 0.5, color=FAINT, linewidth=size / 11, zorder=0)


def numbers_shown(answers: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of answers whose power is drawn: the experiment's own, and larger ones.

    >>> numbers_shown([17, 17, 16])
    (17, 50, 100, 200)
    """
    own = max(set(answers), key=list(answers).count)
    return (own, *[n for n in LARGER if n > 1.5 * own])


def power_figure(answers: Sequence[int], margin: float, medium: FigureFormat = PAGE) -> Figure:
    """Draw what so many answers can show: power over the true share, and the smallest margin over n.

    Parameters
    ----------
    answers : sequence of int
        How many there are of each sequence.
    margin : float
        Within which a share counts as equivalent to one half.
    medium : FigureFormat
        Where it is shown.
    """
    numbers = numbers_shown(answers)
    with look(medium):
        em = medium.em
        lines, above = heading_lines(*_power_heading(numbers[0]), medium.width - 3 * em, em)
        left, gap = 4.6 * em, 6.4 * em
        width = (medium.width - left - gap - 2 * em) / 2
        height = 0.8 * width
        figure = new_figure(medium, above + 2.4 * em + height + 4.2 * em)
        lines_at(figure, 1.5 * em, lines)
        top = above + 2.4 * em
        _draw_power(axes_at(figure, left, top, width, height), numbers)
        _draw_margins(axes_at(figure, left + width + gap, top, width, height), numbers[0], margin)
    return figure


def _power_heading(own: int) -> tuple[str, str]:
    """Return title and subtitle."""
    return (
        f"What {own} answers can show, and what they cannot",
        "Exact binomial tests at 5 %, computed, for answers of so many different people. Left: how often a "
        "true share is found to differ from one half. Right: the smallest margin within which a share can be "
        "shown to agree with one half.",
    )


def _draw_power(axes: Axes, numbers: Sequence[int]) -> None:
    """Draw the power of the test of one half over the true share."""
    size = text_size()
    for k, n in enumerate(numbers):
        axes.plot(100 * SHARES, 100 * difference_power(n, SHARES), color=OURS if k == 0 else INK,
                  linestyle=LINES[k], linewidth=size / (4 if k == 0 else 7), label=f"n = {n}")  # fmt: skip
    axes.axhline(100 * POWER, color=MUTED, linewidth=size / 12, zorder=0)
    axes.axhline(5, color=LIMIT, linewidth=size / 12, zorder=0)
    axes.annotate("80 %", (50, 100 * POWER), xytext=(2, 2), textcoords="offset points", color=MUTED)
    axes.annotate(
        "5 %, by chance", (100, 5), xytext=(-2, 2), textcoords="offset points", color=LIMIT, ha="right"
    )
    axes.set(xlim=(50, 100), ylim=(0, 101), xlabel="true share choosing ours [%]",
             ylabel="found to differ [% of experiments]")  # fmt: skip
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.13), handlelength=2.4)


def _draw_margins(axes: Axes, own: int, margin: float) -> None:
    """Draw the margin that so many answers can show, at best and with 80 % power, over their number."""
    size = text_size()
    best, likely = (
        np.array([100 * f(int(n)) for n in MARGIN_NUMBERS]) for f in (smallest_margin_ever, likely_margin)
    )
    axes.fill_between(MARGIN_NUMBERS, 0, best, color=BASELINE, alpha=0.2, linewidth=0, zorder=0)
    axes.plot(MARGIN_NUMBERS, likely, color=INK, linewidth=size / 7, label="in 80 % of experiments, if true")
    axes.plot(
        MARGIN_NUMBERS,
        best,
        color=BASELINE,
        linewidth=size / 7,
        label="at best: even numbers, divided evenly",
    )
    mine = 100 * smallest_margin_ever(own)
    axes.plot(
        own,
        mine,
        "o",
        color=OURS,
        ms=0.75 * size,
        zorder=4,
        label=f"{own} answers: ± {mine:.0f} points at best",
    )
    axes.axhline(100 * margin, color=MUTED, linewidth=size / 10, linestyle=(0, (4, 3)), zorder=1)
    axes.annotate(f"wanted: ± {100 * margin:g}", (1000, 100 * margin), xytext=(0, 2),
                  textcoords="offset points", color=MUTED, ha="right", va="bottom")  # fmt: skip
    axes.annotate("cannot be shown", (9, 3), color=MUTED, va="bottom")
    axes.set_xscale("log")
    ticks = (10, 20, 50, 100, 200, 500, 1000)
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set(xlim=(min(8, own), 1000), ylim=(0, 50), xlabel="answers of different people",
             ylabel="margin about 50 % [± percentage points]")  # fmt: skip
    axes.legend(loc="upper right")


def likely_margin(answers: int) -> float:
    """Return the margin within which so many answers show a true share of one half in 80 % of experiments."""
    return margin_shown(answers, POWER)

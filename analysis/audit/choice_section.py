"""The section of the audit on 53 % and 47 %: the counts behind them, and what they can show."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from evenlight.analysis.audit.choices import MARGINS, TOLD_MARGIN, chosen_counts, numbers_that_fit
from evenlight.analysis.audit.rows import ALL, AuditRows, audit_section
from evenlight.analysis.figure_style import (
    FAINT,
    INK,
    MUTED,
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
    text_size,
)
from evenlight.analysis.findings import Drawing
from evenlight.analysis.inference.binomial_power import difference_power, smallest_share_found
from evenlight.analysis.inference.binomial_tests import HALF, clopper_pearson, smallest_margin
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint

SHARE = "share of choices of ours"
MARGIN = "smallest margin within which the share is shown to be one half"
EQUIVALENCE = f"p of equivalence within {TOLD_MARGIN:g}"
BAYES_FACTOR = "Bayes factor for one half against any share"
CURVE = np.linspace(0.5, 1.0, 101)
THRESHOLD = 0.75  # share of right choices at which a change is usually called visible
POWER = 0.8
SUBTITLE = (
    "Asked which version showed a change in brightness. Margin: within which the answers show one half. "
    "Dashed: a share of 0.75. All: as if independent."
)
Share = tuple[str, int, int]  # name, chosen, answers


def choice_section(rows: AuditRows, drawing: Drawing) -> Section:
    """Return the section."""
    counts = chosen_counts()
    n = counts[0].answers
    shares = [rows.of("choices", group, SHARE) for group in (*(c.sequence for c in counts), ALL)]
    return audit_section(
        "choices",
        rows,
        (_count_table(rows), _needed_table(rows)),
        (drawing,),
        n=n,
        total=sum(c.answers for c in counts),
        count=len(counts),
        high=max(counts, key=lambda c: c.chosen),
        low=min(counts, key=lambda c: c.chosen),
        other_people=[people for people in numbers_that_fit(tuple(c.text for c in counts)) if people != n],
        smallest_p=min(share.p_value for share in shares if share.p_value is not None),
        margin_row=MARGIN,
    )


def _count_table(rows: AuditRows) -> Table:
    """Return the table of counts and what follows from them."""
    lines: list[tuple[Cell, ...]] = []
    names = [(c.sequence, in_words(c.sequence), f"{c.text} %") for c in chosen_counts()]
    for group, name, text in [*names, (ALL, "All, if independent", "")]:
        share, chosen = rows.of("choices", group, SHARE), rows.of("choices", group, "choices of ours")
        margin, equivalence, factor = (
            f"{rows.number('choices', group, what):.2f}" for what in (MARGIN, EQUIVALENCE, BAYES_FACTOR)
        )
        lines.append(
            (
                name,
                text,
                f"{chosen.value:.0f} of {chosen.n}",
                f"{share.ci_low:.2f} to {share.ci_high:.2f}",
                f"{share.p_value:.2f}",
                f"±{margin}",
                equivalence,
                factor,
            )
        )
    return Table(
        "Choices of ours, asked which version showed a change in brightness",
        ("sequence", "printed", "count", "95 % confidence interval", "p, one half", "margin shown",
         f"p, within ±{TOLD_MARGIN:g}", "Bayes factor"),
        tuple(lines),
    )  # fmt: skip


def _needed_table(rows: AuditRows) -> Table:
    """Return the table of how many answers would do."""
    lines: list[tuple[Cell, ...]] = []
    for margin in MARGINS:
        equal = f"answers that show equivalence within {margin:g} with 80 % power"
        different = f"answers that find a share of {HALF + margin:g} with 80 % power"
        needed = (f"{rows.number('choices_needed', ALL, what):.0f}" for what in (equal, different))
        lines.append((f"±{margin:g}", *needed))
    return Table(
        "Independent answers needed for 80 % power",
        ("margin", "to show equivalence", "to find a share at the margin"),
        tuple(lines),
    )


def choice_drawing(medium: FigureFormat = PAGE) -> Drawing:
    """Draw the shares of choices with their intervals, and the power of so many answers."""
    counts = chosen_counts()
    shares: list[Share] = [(in_words(c.sequence), c.chosen, c.answers) for c in counts]
    total = sum(c.answers for c in counts)
    shares.append(("All", sum(c.chosen for c in counts), total))
    numbers = (counts[0].answers, total)
    few, many = (choose(c.chosen for c in counts) for choose in (min, max))
    title = f"Choices of ours: what {few} or {many} of {counts[0].answers} can show"
    with look(medium):
        em = medium.em
        left, gap = 11.0 * em, 5.5 * em
        width = (medium.width - left - gap - 1.5 * em) / 2
        lines, above = heading_lines(title, SUBTITLE,
                                     medium.width - 2 * em, em)  # fmt: skip
        top, height = above + 3.4 * em, 16 * em
        figure = new_figure(medium, top + height + 4 * em)
        lines_at(figure, em, lines)
        intervals = axes_at(figure, left, top, width, height)
        power = axes_at(figure, left + width + gap, top, width, height)
        _draw_shares(intervals, shares)
        _draw_power(power, numbers)
        for axes, words in (
            (intervals, "Shares that are not excluded"),
            (power, "Chance of finding a share"),
        ):
            axes.set_title(words, loc="left", pad=1.4 * text_size(), color=INK)
        png = png_bytes(figure)
    caption = (
        "Left: share of choices of ours with its exact 95 % confidence interval (thin) and 90 % interval "
        "(thick), whose farther end is the smallest margin that an equivalence test shows; n as counted. "
        "Right: how often the exact two-sided test at 5 % finds a true share; the dashed line is a share of "
        "0.75."
    )
    return Drawing("audit_choices", png, caption, tuple(_points(shares, numbers)))


def _draw_shares(axes: Axes, shares: list[Share]) -> None:
    """Draw shares with both of their intervals."""
    size = text_size()
    for place, (_, chosen, answers) in enumerate(shares):
        for level, width in ((0.95, 0.14), (0.90, 0.4)):
            axes.plot(clopper_pearson(chosen, answers, level), [place, place], color=OURS, lw=width * size,
                      solid_capstyle="butt")  # fmt: skip
        axes.plot([chosen / answers], [place], "o", color="white", mec=OURS, ms=0.75 * size, mew=0.18 * size)
        axes.text(0.97, place, f"±{smallest_margin(chosen, answers):.2f}", ha="right", va="center", color=INK)
    axes.text(0.97, -0.62, "margin", ha="right", va="center", color=MUTED)
    axes.axvline(HALF, color=INK, lw=0.1 * size, zorder=0.5)
    axes.axvline(THRESHOLD, color=INK, lw=0.13 * size, ls="--", zorder=0.5)
    axes.set_xlim(0.2, 0.98)
    axes.set_xticks(np.arange(0.2, 0.81, 0.1))
    axes.set_ylim(len(shares) - 0.5, -0.9)
    axes.set_yticks(range(len(shares)), [f"{name}: {k} of {n}" for name, k, n in shares])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color=FAINT, lw=0.07 * size)
    axes.set_xlabel("share of choices of ours")


def _draw_power(axes: Axes, numbers: tuple[int, int]) -> None:
    """Draw how often so many answers find a share."""
    size = text_size()
    for answers, colour in zip(numbers, (OURS, PARTICIPANT), strict=True):
        axes.plot(CURVE, difference_power(answers, CURVE), color=colour)
        found = smallest_share_found(answers, POWER)
        if found is not None:
            axes.plot([found], [POWER], "o", color=colour, ms=0.6 * size)
            words, side = (
                (f"n = {answers} ", "right") if answers == max(numbers) else (f" n = {answers}", "left")
            )
            axes.text(
                found, POWER - 0.02, words, color=colour, ha=side, va="top" if side == "left" else "bottom"
            )
    axes.axvline(THRESHOLD, color=INK, lw=0.13 * size, ls="--", zorder=0.5)
    axes.set_xlim(0.5, 1.0)
    axes.set_ylim(0, 1.02)
    axes.set_yticks(np.arange(0, 1.01, 0.2), [f"{100 * p:.0f} %" for p in np.arange(0, 1.01, 0.2)])
    axes.grid(color=FAINT, lw=0.07 * size)
    axes.set_xlabel("true share of choices of ours")
    axes.set_ylabel("power")


def _points(shares: list[Share], numbers: tuple[int, int]) -> list[PlottedPoint]:
    """Return everything that is drawn."""
    points = []
    for name, chosen, answers in shares:
        for level in (0.95, 0.90):
            low, high = clopper_pearson(chosen, answers, level)
            points.append(
                PlottedPoint("shares", f"{100 * level:.0f} % interval", name, None, chosen / answers,
                             x_quantity="sequence", x_unit="1", y_quantity="share of choices of ours",
                             y_unit="1", origin=Origin.COMPUTED, low=low, high=high, n=answers)
            )  # fmt: skip
    for answers in numbers:
        curve = difference_power(answers, CURVE)
        points += [
            PlottedPoint("power", f"{answers} answers", "", float(x), float(y), x_quantity="true share",
                         x_unit="1", y_quantity="power", y_unit="1", origin=Origin.COMPUTED, n=answers)
            for x, y in zip(CURVE, curve, strict=True)
        ]  # fmt: skip
        found = smallest_share_found(answers, POWER)
        points.append(
            PlottedPoint("power", f"80 % power, {answers} answers", "", found, POWER,
                         x_quantity="true share", x_unit="1", y_quantity="power", y_unit="1",
                         origin=Origin.COMPUTED, n=answers)
        )  # fmt: skip
    return points

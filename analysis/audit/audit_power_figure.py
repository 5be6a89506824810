"""The figure of the audit on the table of powers: which brightness factors its watts stand for."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from evenlight.analysis.audit.audit_power_table import TablePower, nominal_line, table_powers
from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    MUTED,
    OURS,
    PAGE,
    Medium,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    png_bytes,
    text_size,
)
from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import SEQUENCES
from evenlight.analysis.wording import in_words
from evenlight.data_schema.statistic import Origin, PlottedPoint

COLOURS = {"baseline": BASELINE, "ours": OURS, "full": INK}
READINGS: tuple[tuple[str, str, Callable[[TablePower], float | None]], ...] = (
    ("P(L), of Table 3's full brightness", "o", lambda p: p.factor_of_full),
    ("P(L), of 750 cd/m²", "s", lambda p: p.factor_of_peak),
    ("between the samples, of 750 cd/m²", "^", lambda p: p.factor_of_samples),
)


def power_drawing(medium: Medium = PAGE) -> Drawing:
    """Draw the implied brightness factors beside the nominal ones, and the powers over those."""
    powers = table_powers()
    with look(medium):
        em = medium.em
        left, gap = 8.5 * em, 5.5 * em
        width = (medium.width - left - gap - 1.5 * em) / 2
        lines, above = heading_lines(
            "The table of powers: which brightness factors its watts stand for",
            "Table 3 as printed, to 1 mW: on these axes the printed digits are narrower than the marks.",
            medium.width - 2 * em, em,
        )  # fmt: skip
        top, height = above + 2.2 * em, 17 * em
        figure = new_figure(medium, top + height + 10.2 * em)
        lines_at(figure, em, lines)
        factors = axes_at(figure, left, top, width, height)
        line = axes_at(figure, left + width + gap, top, width, height)
        _draw_factors(factors, powers, em / height)
        _draw_line(line, powers, em / height)
        png = png_bytes(figure)
    caption = (
        "Left: brightness factor that each power of Table 3 implies, read in three ways, against the "
        "nominal factor (bar). Right: the same powers over the nominal factors, and the straight line "
        "through the baseline's four."
    )
    return Drawing("audit_power", png, caption, tuple(_points(powers)))


def _draw_factors(axes: Axes, powers: tuple[TablePower, ...], em: float) -> None:
    """Draw the implied factors, one row for each sequence."""
    size, names = text_size(), list(SEQUENCES)
    for power in powers:
        if power.version == "full":
            continue
        place = names.index(power.sequence) + (-0.17 if power.version == "baseline" else 0.17)
        for _, marker, reading in READINGS:
            value = reading(power)
            if value is not None:
                axes.plot([value], [place], marker, color=COLOURS[power.version], ms=0.62 * size, mew=0)
        axes.plot(
            [power.nominal_factor] * 2, [place - 0.17, place + 0.17], color=INK, lw=0.2 * size, zorder=1
        )
    axes.set_xlim(0.2, 0.75)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_yticks(range(len(names)), [in_words(name) for name in names])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color=FAINT, lw=0.07 * size)
    axes.set_xlabel("brightness factor")
    keys = [Line2D([], [], color=INK, lw=0, marker="|", ms=size, mew=0.3 * size, label="nominal")]
    keys += [
        Line2D([], [], ls="", color=MUTED, marker=m, ms=0.62 * size, label=name) for name, m, _ in READINGS
    ]
    axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.0, -3.6 * em), ncols=1)


def _draw_line(axes: Axes, powers: tuple[TablePower, ...], em: float) -> None:
    """Draw the powers over the nominal factors."""
    size, line = text_size(), nominal_line()
    axes.plot([0, 1], [line.base, line.at_full], color=BASELINE, ls="--")
    for version, marker in (("baseline", "o"), ("ours", "x"), ("full", "o")):
        own = [p for p in powers if p.version == version]
        axes.plot([p.nominal_factor for p in own], [p.power for p in own], marker, color=COLOURS[version],
                  ms=0.62 * size, mew=0.2 * size if marker == "x" else 0)  # fmt: skip
    axes.set_xlim(0, 1.04)
    axes.set_ylim(0, 1.95)
    axes.grid(color=FAINT, lw=0.07 * size)
    axes.set_xlabel("nominal brightness factor")
    axes.set_ylabel("power, W")
    keys = [
        Line2D([], [], ls="", marker="o", color=BASELINE, ms=0.62 * size, label="baseline"),
        Line2D([], [], ls="", marker="x", color=OURS, ms=0.62 * size, mew=0.2 * size, label="ours"),
        Line2D([], [], ls="", marker="o", color=INK, ms=0.62 * size, label="full brightness"),
        Line2D([], [], ls="--", color=BASELINE, label="line through the baseline's"),
    ]
    axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.0, -3.6 * em), ncols=2)


def _points(powers: tuple[TablePower, ...]) -> list[PlottedPoint]:
    """Return everything that is drawn."""
    line = nominal_line()
    drawn: list[tuple[str, str, str, float | None, float | None]] = [
        ("factors", f"{power.version}, {name}", power.sequence, None, value)
        for power in powers
        if power.version != "full"
        for name, value in (("nominal", power.nominal_factor), *((n, read(power)) for n, _, read in READINGS))
    ]
    drawn += [("powers", p.version, p.sequence, p.nominal_factor, p.power) for p in powers]
    drawn += [
        ("powers", "line through the baseline's", "", x, y)
        for x, y in ((0.0, line.base), (1.0, line.at_full))
    ]
    axes = {
        "factors": ("sequence", "1", "brightness factor", "1"),
        "powers": ("nominal brightness factor", "1", "power", "W"),
    }
    return [
        PlottedPoint(panel, series, label, x, y, *axes[panel], origin=Origin.PUBLISHED)
        for panel, series, label, x, y in drawn
    ]

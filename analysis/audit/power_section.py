"""The sections of the audit on the table of powers, and on what else the paper prints in numbers."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from evenlight.analysis.audit.powers import (
    CURRENT_STEP,
    OF_FULL,
    OF_PEAK,
    OF_SAMPLES,
    TablePower,
    nominal_line,
    refitted_line,
    sample_luminance,
    table_powers,
)
from evenlight.analysis.audit.rows import AuditRows, audit_section
from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
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
    text_size,
)
from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, PlottedPoint

COLOURS = {"baseline": BASELINE, "ours": OURS, "full": INK}
READINGS: tuple[tuple[str, str, Callable[[TablePower], float | None]], ...] = (
    ("P(L), of Table 3's full brightness", "o", lambda p: p.factor_of_full),
    ("P(L), of 750 cd/m²", "s", lambda p: p.factor_of_peak),
    ("between the samples, of 750 cd/m²", "^", lambda p: p.factor_of_samples),
)
READ_WITH = (Origin.COMPUTED, Origin.AUTHORS, Origin.AUTHORS)  # the paper prints neither samples nor a peak


def power_section(rows: AuditRows, drawing: Drawing) -> Section:
    """Return the section on the table of powers."""
    powers, fit = table_powers(), refitted_line()
    full = [p for p in powers if p.version == "full"]
    dimmed = [(p, f"{p.sequence}, {p.version}") for p in powers if p.version != "full"]
    peak = max(sample_luminance())
    top = int(fit.level_luminance.argmax())
    half_step = published("authors_power.voltage").number * CURRENT_STEP / 2
    return audit_section(
        "power",
        rows,
        (_factor_table(rows),),
        (drawing,),
        samples=len(sample_luminance()),
        fit=fit,
        peak=peak,
        below=float(fit.deviations[top] * fit.power(fit.level_luminance[top])),
        full_watts=[p.power for p in full],
        full_light=[p.luminance for p in full],
        off_full=[p.nominal_factor - p.factor_of_full for p, _ in dimmed],
        off_samples=[abs(p.nominal_factor - rows.number("power", g, OF_SAMPLES)) for p, g in dimmed],
        digits=half_step / published("power_model.slope").number / peak,
        line=nominal_line(),
        other_differences=[
            abs(rows.number("power", sequence, "power of ours less baseline"))
            for sequence in SEQUENCES
            if sequence != "library"
        ],
    )


def _factor_table(rows: AuditRows) -> Table:
    """Return the table of implied factors."""
    whats = (
        ("luminance on P(L)", ".0f"),
        ("nominal brightness factor", ".1f"),
        (OF_FULL, ".3f"),
        (OF_PEAK, ".3f"),
        (OF_SAMPLES, ".3f"),
        ("power saved against full brightness", ".1f"),
    )
    lines: list[tuple[Cell, ...]] = []
    for sequence in SEQUENCES:
        for version in ("baseline", "ours", "full"):
            group = f"{sequence}, {version}"
            shown = whats if version != "full" else whats[:1]
            cells: list[Cell] = [format(rows.number("power", group, what), form) for what, form in shown]
            cells += [None] * (len(whats) - len(shown))
            printed = published(f"power.{sequence}.{version}").text
            lines.append((in_words(sequence), version, printed, *cells))
    return Table(
        "What each printed power stands for: the brightness factor read in three ways, beside the nominal "
        "one. The peak of 750 cd/m² and the samples are from the authors' program; the paper has neither",
        ("sequence", "version", "printed, W", "L, cd/m²", "nominal", "of Table 3's full", "of 750 cd/m²",
         "between samples", "saved, %"),
        tuple(lines),
    )  # fmt: skip


def other_section(rows: AuditRows) -> Section:
    """Return the section on the tables of adaptation and of online control."""
    lines: list[tuple[Cell, ...]] = []
    for sequence in SEQUENCES:
        printed = [published(f"adaptation.{sequence}.{c}").text for c in ("constrained", "unconstrained")]
        left = rows.number("adaptation", sequence, "share left by the constraint")
        lines.append((in_words(sequence), *printed, f"{left:.2f}"))
    table = Table(
        "Table 2: differences of static and dynamic cone response as printed, and their ratio",
        ("sequence", "constrained", "unconstrained", "ratio"),
        tuple(lines),
    )
    return audit_section("adaptation_and_online", rows, (table,))


def power_drawing(medium: FigureFormat = PAGE) -> Drawing:
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
        ends = [place - 0.17, place + 0.17]
        axes.plot([power.nominal_factor] * 2, ends, color=INK, lw=0.2 * size, zorder=1)
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
    drawn: list[tuple[str, str, str, float | None, float | None, Origin]] = []
    for power in (p for p in powers if p.version != "full"):
        series = ("factors", f"{power.version}, nominal", power.sequence)
        drawn.append((*series, None, power.nominal_factor, Origin.PUBLISHED))
        for (name, _, read), origin in zip(READINGS, READ_WITH, strict=True):
            drawn.append(("factors", f"{power.version}, {name}", power.sequence, None, read(power), origin))
    drawn += [("powers", p.version, p.sequence, p.nominal_factor, p.power, Origin.PUBLISHED) for p in powers]
    drawn += [
        ("powers", "line through the baseline's", "", x, y, Origin.COMPUTED)
        for x, y in ((0.0, line.base), (1.0, line.at_full))
    ]
    axes = {
        "factors": ("sequence", "1", "brightness factor", "1"),
        "powers": ("nominal brightness factor", "1", "power", "W"),
    }
    return [
        PlottedPoint(panel, series, label, x, y, *axes[panel], origin=origin)
        for panel, series, label, x, y, origin in drawn
    ]

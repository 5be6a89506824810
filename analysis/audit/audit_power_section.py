"""The sections of the audit on the table of powers, and on what else the paper prints in numbers."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.audit.audit_power_statistics import OF_FULL, OF_PEAK, OF_SAMPLES
from evenlight.analysis.audit.audit_power_table import (
    CURRENT_STEP,
    nominal_line,
    refitted_line,
    sample_luminance,
    table_powers,
)
from evenlight.analysis.audit.audit_statistics import Rows
from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words, listed, p_in_words, spaced
from evenlight.data_schema.statistic import Statistic


def power_section(statistics: Sequence[Statistic], drawing: Drawing) -> Section:
    """Return the section on the table of powers."""
    rows = Rows(statistics)
    return Section(
        "The table of powers",
        paragraphs=(_line_in_words(), _full_in_words(), _factors_in_words(rows), _equal_in_words(rows)),
        tables=(_factor_table(rows),),
        pictures=(drawing.picture,),
    )


def _line_in_words() -> str:
    """Return whether the samples give the printed line."""
    fit = refitted_line()
    top = int(fit.level_luminance.argmax())
    below = fit.deviations[top] * fit.power(fit.level_luminance[top])
    slope, base = (published(f"power_model.{part}").text for part in ("slope", "base"))
    return (
        f"The authors' {len(sample_luminance())} samples give the line {fit.slope:.6f} L + "
        f"{fit.base_power:.4f} W; printed is {slope} L + {base} W. They bend "
        f"{'upwards' if fit.bend < 0 else 'downwards'} ({p_in_words(fit.bend_p or 0.0)} for a straight "
        f"panel), and at {fit.level_luminance[top]:.0f} cd/m², the highest, the line lies {abs(below):.2f} W "
        f"too {'low' if below > 0 else 'high'}."
    )


def _full_in_words() -> str:
    """Return what the rows of full brightness imply."""
    full = [p for p in table_powers() if p.version == "full"]
    light, watts = [p.luminance for p in full], [p.power for p in full]
    beyond = [100 * (L / sample_luminance()[0] - 1) for L in light]
    return (
        f"At full brightness Table 3 has {min(watts):.3f} to {max(watts):.3f} W, which on P(L) is "
        f"{min(light):.0f} to {max(light):.0f} cd/m²: {min(beyond):.0f} to {max(beyond):.0f} % beyond the "
        "highest sample. Either the panel was brighter in that measurement, or P(L) reads it too high "
        "there."
    )


def _factors_in_words(rows: Rows) -> str:
    """Return which brightness factors the dimmed rows imply."""
    dimmed = [p for p in table_powers() if p.version != "full"]
    off_full = [p.nominal_factor - p.factor_of_full for p in dimmed]
    off_samples = max(
        abs(p.nominal_factor - rows.number("power", f"{p.sequence}, {p.version}", OF_SAMPLES)) for p in dimmed
    )
    line, peak = nominal_line(), max(sample_luminance())
    half_step = published("authors_power.voltage").number * CURRENT_STEP / 2
    digits = half_step / published("power_model.slope").number / peak
    return (
        f"Measured against those rows, the dimmed versions have brightness factors {min(off_full):.2f} to "
        f"{max(off_full):.2f} below the nominal ones. Against {peak:.0f} cd/m² they come nearer, and read "
        f"between the samples in place of the line they agree within {off_samples:.2f}; the current's two "
        f"digits alone allow {digits:.2f}. The baseline's powers lie on one straight line over their nominal "
        f"factors to {1000 * line.largest_miss:.0f} mW; at factor 1 it has {line.at_full:.2f} W. So the "
        "dimmed rows agree with each other and with their targets; the full-brightness row stands apart, "
        "and savings measured against it come out larger."
    )


def _equal_in_words(rows: Rows) -> str:
    """Return how equal the powers of ours and baseline are."""
    differences = {s: 1000 * rows.number("power", s, "power of ours less baseline") for s in SEQUENCES}
    most = max(differences, key=lambda s: abs(differences[s]))
    others = max(abs(d) for s, d in differences.items() if s != most)
    share = rows.number("power", most, "power of ours over baseline, less 1")
    return (
        f"Ours and baseline take equal power to {others:.0f} mW, except in the {spaced(most)}, where ours "
        f"took {abs(differences[most]):.0f} mW ({abs(share):.1f} %) {'more' if share > 0 else 'less'}. How "
        "far repeated measurements scatter is not printed."
    )


def _factor_table(rows: Rows) -> Table:
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
        "one",
        ("sequence", "version", "printed, W", "L, cd/m²", "nominal", "of Table 3's full", "of 750 cd/m²",
         "between samples", "saved, %"),
        tuple(lines),
    )  # fmt: skip


def _beyond() -> str:
    """Return the printed differences that two responses between 0 and 1 cannot have."""
    printed = [published(f"adaptation.{s}.{c}") for s in SEQUENCES for c in ("constrained", "unconstrained")]
    return listed([value.text for value in printed if value.number > 1])


def other_section(statistics: Sequence[Statistic]) -> Section:
    """Return the section on the tables of adaptation and of online control."""
    shares = {s.group: s.value or 0.0 for s in statistics if s.table == "adaptation"}
    online = next(s for s in statistics if s.table == "online")
    rows: list[tuple[Cell, ...]] = [
        (
            in_words(s),
            published(f"adaptation.{s}.constrained").text,
            published(f"adaptation.{s}.unconstrained").text,
            f"{shares[s]:.2f}",
        )
        for s in SEQUENCES
    ]
    return Section(
        "Adaptation and online control",
        paragraphs=(
            "Of the unconstrained difference of cone responses the constraint leaves "
            f"{listed([f'{shares[s]:.2f} in the {spaced(s)}' for s in SEQUENCES])}. What constant dimming "
            "would give is not printed; without it, how much of a difference the content itself makes is "
            "open. The unit is open too: cone responses lie between 0 and 1, and the average difference of "
            f"two cannot be {_beyond()}.",
            f"Online, the standard deviation of contrast loss is {online.value:.2f} times the baseline's "
            f"({online.ci_low:.2f} to {online.ci_high:.2f} by the printed digits), in one session of "
            f"{published('online.duration').text} minutes.",
        ),
        tables=(
            Table(
                "Table 2: differences of static and dynamic cone response as printed, and their ratio",
                ("sequence", "constrained", "unconstrained", "ratio"),
                tuple(rows),
            ),
        ),
    )

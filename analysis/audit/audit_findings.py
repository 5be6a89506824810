"""The audit: what the numbers that the paper prints can and cannot support."""

from __future__ import annotations

import csv
from collections import Counter

import numpy as np

from evenlight.analysis.audit.choice_section import MARGIN, choice_drawing, choice_section
from evenlight.analysis.audit.choices import choice_statistics, chosen_counts
from evenlight.analysis.audit.distribution_section import (
    distribution_section,
    distribution_statistics,
    numbers_that_fit,
)
from evenlight.analysis.audit.pairing_section import pairing_section, pairing_statistics
from evenlight.analysis.audit.pairings import MAIN_TEST
from evenlight.analysis.audit.power_section import other_section, power_drawing, power_section
from evenlight.analysis.audit.powers import other_statistics, power_statistics
from evenlight.analysis.audit.rating_figures import distribution_drawing, pairing_drawing
from evenlight.analysis.audit.rows import AuditRows, audit_section
from evenlight.analysis.audit.table_ratings import (
    VERSIONS,
    holm_ranges,
    participant_totals,
    table_ratings,
)
from evenlight.analysis.figure_style import PAGE, FigureFormat
from evenlight.analysis.findings import Findings
from evenlight.analysis.published import SURACE_2025
from evenlight.analysis.report import Table
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.analysis_results import Origin

TITLE = "What the published numbers support"
OPEN_POINTS = SURACE_2025.with_name("surace2025.open_points.csv")
MEANINGS = {
    Origin.PUBLISHED: "printed in the paper",
    Origin.AUTHORS: "from the program that its authors published, or computed with numbers of it",
    Origin.COMPUTED: "computed from numbers that are printed in the paper",
}
SEED = 1  # of the search for the most even totals, which meets its bound from any start


def audit_findings(medium: FigureFormat = PAGE) -> Findings:
    """Return what the paper's published numbers support: no data are read.

    Parameters
    ----------
    medium : FigureFormat
        Where the figures are shown.
    """
    ratings = table_ratings()
    adjusted = holm_ranges(ratings)
    fewer = {k for version in VERSIONS for k in numbers_that_fit(("gym", version)) if k < ratings[0].n}
    totals = participant_totals(ratings, np.random.default_rng(SEED))
    rows = AuditRows(
        (
            *distribution_statistics(ratings),
            *pairing_statistics(ratings, adjusted, totals),
            *choice_statistics(),
            *power_statistics(),
            *other_statistics(),
        )
    )
    drawings = (
        distribution_drawing(ratings, medium),
        pairing_drawing(ratings, adjusted, medium),
        choice_drawing(medium),
        power_drawing(medium),
    )
    n = ratings[0].n
    sections = (
        distribution_section(rows, n, drawings[0]),
        pairing_section(rows, n, drawings[1]),
        choice_section(rows, drawings[2]),
        power_section(rows, drawings[3]),
        other_section(rows),
        audit_section("open_points", rows, (contradictions(), left_open())),
        audit_section("origins", rows, (_origin_table(rows),)),
    )
    (lead,) = prose(
        "audit/lead",
        fewer=[str(k) for k in sorted(fewer)],
        n=n,
        main_test=MAIN_TEST.value,
        counts=chosen_counts(),
        margin=rows.number("choices", ratings[0].sequence, MARGIN),
    )
    return Findings("audit", lead, rows.statistics, drawings, sections)


def _origin_table(rows: AuditRows) -> Table:
    """Return what the origins mean, and how many numbers have each."""
    counts = Counter(s.origin for s in rows.statistics)
    lines = tuple((origin.value, words, counts[origin]) for origin, words in MEANINGS.items())
    return Table("Where the numbers of audit_statistics.csv come from", ("origin", "means", "numbers"), lines)


def contradictions() -> Table:
    """Return where the paper contradicts itself, what it prints, and what this software does."""
    caption = "Two places that do not agree, or a formula that does not say what is meant"
    return _points_table("contradiction", caption)


def left_open() -> Table:
    """Return what the paper leaves open although a reproduction needs it, and what this software does."""
    return _points_table("left open", "What a reproduction needs to know, and the paper does not say")


def _points_table(kind: str, caption: str) -> Table:
    """Return the table of the open points of a kind."""
    with OPEN_POINTS.open(encoding="utf-8", newline="") as file:
        points = [point for point in csv.DictReader(file) if point["kind"] == kind]
    rows = tuple((p["places"], p["printed"], p["here"], p["page"]) for p in points)
    return Table(caption, ("where", "printed", "in Evenlight", "page"), rows)

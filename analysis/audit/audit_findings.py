"""The audit: what the numbers that the paper prints can and cannot support."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evenlight.analysis.audit.audit_choice_figure import choice_drawing
from evenlight.analysis.audit.audit_choice_section import MARGIN, choice_section
from evenlight.analysis.audit.audit_choice_statistics import choice_statistics
from evenlight.analysis.audit.audit_choices import chosen_counts
from evenlight.analysis.audit.audit_convention_words import odd_numbers
from evenlight.analysis.audit.audit_distribution_section import (
    complete_numbers,
    distribution_section,
    distribution_statistics,
)
from evenlight.analysis.audit.audit_open_points import CONTRADICTIONS, LEFT_OPEN, OpenPoint
from evenlight.analysis.audit.audit_paired_tests import MAIN_TEST, PairedTest, PRange
from evenlight.analysis.audit.audit_pairing_section import pairing_section
from evenlight.analysis.audit.audit_pairing_statistics import pairing_statistics
from evenlight.analysis.audit.audit_participants import participant_totals
from evenlight.analysis.audit.audit_power_figure import power_drawing
from evenlight.analysis.audit.audit_power_section import other_section, power_section
from evenlight.analysis.audit.audit_power_statistics import other_statistics, power_statistics
from evenlight.analysis.audit.audit_rating_figures import distribution_drawing, pairing_drawing
from evenlight.analysis.audit.audit_ratings import SequenceRatings, holm_ranges, table_ratings
from evenlight.analysis.audit.audit_statistics import Rows
from evenlight.analysis.audit.audit_verdict_words import verdicts_in_words
from evenlight.analysis.figure_style import PAGE, Medium
from evenlight.analysis.findings import Findings
from evenlight.analysis.inference.binomial_tests import HALF
from evenlight.analysis.report import Section, Table
from evenlight.analysis.wording import listed
from evenlight.data_schema.statistic import Statistic

TITLE = "What the published numbers support"
SEED = 1  # of the search for the most even totals, which meets its bound from any start


def audit_findings(medium: Medium = PAGE) -> Findings:
    """Return what the paper's published numbers support: no data are read.

    Parameters
    ----------
    medium : Medium
        Where the figures are shown.
    """
    ratings = table_ratings()
    adjusted = holm_ranges(ratings)
    totals = participant_totals(ratings, np.random.default_rng(SEED))
    distributions, pairings = distribution_statistics(ratings), pairing_statistics(ratings, adjusted, totals)
    choices, powers, others = choice_statistics(), power_statistics(), other_statistics()
    drawings = (
        distribution_drawing(ratings, medium),
        pairing_drawing(ratings, adjusted, medium),
        choice_drawing(medium),
        power_drawing(medium),
    )
    sections = (
        distribution_section(ratings, distributions, drawings[0]),
        pairing_section(ratings, adjusted, pairings, drawings[1]),
        choice_section(choices, drawings[2]),
        power_section(powers, drawings[3]),
        other_section(others),
        _points_section(),
    )
    statistics = (*distributions, *pairings, *choices, *powers, *others)
    return Findings("audit", _lead(ratings, adjusted, statistics), statistics, drawings, sections)


def _lead(
    ratings: Sequence[SequenceRatings],
    adjusted: Mapping[PairedTest, Sequence[PRange]],
    statistics: Sequence[Statistic],
) -> str:
    """Return the three findings that matter most."""
    people = [s.n for s in statistics if s.table == "numbers_of_people"]
    complete = listed([str(n) for n in complete_numbers(statistics)] or ["no number"])
    odd = odd_numbers(ratings)
    away = max((number.last_digits_away for number in odd), default=0)
    names, alone = [r.sequence for r in ratings], [r.ranges[MAIN_TEST] for r in ratings]
    counts, margin = chosen_counts(), Rows(statistics).number("choices", ratings[0].sequence, MARGIN)
    chosen = " or ".join(str(k) for k in sorted({c.chosen for c in counts}))
    return (
        f"Three findings. The ratings are consistent: of {people[0]} to {people[-1]} people only {complete} "
        f"fit every mean and standard error, and {len(odd)} numbers differ by {away} in the last digit "
        "from how the others were printed. Whether they differ, the table cannot tell without its pairing: "
        f"by the {MAIN_TEST.value} at 5 %, each by itself, {verdicts_in_words(names, alone)}; after Holm's "
        f"correction, {verdicts_in_words(names, adjusted[MAIN_TEST])}. And {chosen} choices of "
        f"{counts[0].answers} agree with nobody being able to tell, but show no more than a share between "
        f"{HALF - margin:.2f} and {HALF + margin:.2f}."
    )


def _points_section() -> Section:
    """Return the section on contradictions and what is left open."""
    return Section(
        "Where the paper contradicts itself, and what it leaves open",
        paragraphs=(
            "Who does the work again has to decide each of these; here is how it was decided. The pages "
            "are in docs/decisions/.",
        ),
        tables=(
            _points_table(
                "Two places that do not agree, or a formula that does not say what is meant", CONTRADICTIONS
            ),
            _points_table("What one would need to know, and is not told", LEFT_OPEN),
        ),
    )


def _points_table(caption: str, points: Sequence[OpenPoint]) -> Table:
    """Return a table of open points."""
    rows = tuple((p.places, p.printed, p.here, p.page) for p in points)
    return Table(caption, ("where", "printed", "in Evenlight", "page"), rows)

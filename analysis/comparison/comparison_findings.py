"""What the artifact comparison found: rows, figures and words (Section 4.3 of the paper)."""

from __future__ import annotations

from evenlight.analysis.comparison.comparison_figure import power_figure, shares_figure
from evenlight.analysis.comparison.comparison_limits import answer_limits, limit_rows
from evenlight.analysis.comparison.comparison_results import Comparison, compare
from evenlight.analysis.comparison.comparison_sections import limits_section, pooled_section, shares_section
from evenlight.analysis.comparison.comparison_statistics import power_points, share_points, statistics_of
from evenlight.analysis.comparison.comparison_words import lead_of
from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.inference.binomial_tests import DEFAULT_MARGIN
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.viewing import ComparisonTrial


def comparison_findings(
    data: TaskData[ComparisonTrial], seed: int = 1, margin: float = DEFAULT_MARGIN
) -> Findings:
    """Return what an artifact comparison found.

    Parameters
    ----------
    data : TaskData of ComparisonTrial
        The answers: one of each participant for each sequence, as in the paper, or more.
    seed : int
        Of the permutations.
    margin : float
        Within which a share counts as equivalent to one half, in (0, 1/2).

    Raises
    ------
    InputError
        If there is no answer, or no such margin.
    """
    found = compare(data, seed, margin)
    numbers = answers_per_sequence(found)
    limits = [answer_limits(n, margin) for n in dict.fromkeys(numbers)]
    shares = Drawing(
        "comparison_shares",
        png_bytes(shares_figure(found)),
        "Share of answers that took the modulated version for the one whose brightness changed, with 95 % "
        f"intervals; {found.people} participants. The band is 0.5 ± {margin:g}.",
        share_points(found),
    )
    power = Drawing(
        "comparison_power",
        png_bytes(power_figure(numbers, margin)),
        f"What {numbers[0]} answers and more can show: how often a true share is found to differ from one "
        "half, and the smallest margin about one half that can be shown at all.",
        power_points(numbers),
    )
    return Findings(
        name="comparison",
        lead=lead_of(found, limits),
        statistics=(*statistics_of(found), *(row for own in limits for row in limit_rows(own))),
        drawings=(shares, power),
        sections=(
            shares_section(found, shares.picture),
            pooled_section(found),
            limits_section(limits, power.picture),
        ),
        warnings=found.warnings,
    )


def answers_per_sequence(found: Comparison) -> list[int]:
    """Return how many people answered about each sequence, the commonest number first.

    One answer of each is what counts as independent, however often they were asked.
    """
    numbers = [len(own.estimate.choices.participants) for own in found.sequences if own.estimate is not None]
    return sorted(numbers, key=lambda n: (-numbers.count(n), -n))

"""What simulated participants are assumed to show, beside what the analysis of their answers estimates.

The truth stands in the data set (`simulated_truth.json`). Where it is that there is nothing to see, answers
are coin flips: then the analysis does not conclude, from them, that two versions look alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.report import Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import Rows, with_interval
from evenlight.analysis.wording import in_words, of_track
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, RATED, TIME_RATIO, AssumedEffect

TABLE = "assumed"
# The rows of the analyses that estimate each effect.
ESTIMATED = {
    RATED: "mean difference, ours less baseline",
    CHOSEN: "ours chosen",
    TIME_RATIO: "time ratio, ours / baseline",
}


def with_assumed(findings: Analysis, assumed: Sequence[AssumedEffect]) -> Analysis:
    """Return findings of simulated answers with what is true of those who gave them.

    Where the assumed observers see nothing to choose by, the lead says so, and a note of the first section.

    Parameters
    ----------
    findings : Analysis
        Of one task.
    assumed : sequence of AssumedEffect
        What is true of the population; nothing is added if there is nothing.
    """
    if not assumed:
        return findings
    coins = [effect for effect in assumed if effect.is_a_coin]
    estimates = [_estimate(findings.rows, effect) for effect in assumed]
    both = list(zip(assumed, estimates, strict=True))
    seen = [own for own in both if own[0].what == CHOSEN and not own[0].is_a_coin]
    words = prose("assumed_coins", coins=coins, seen=seen)
    first = tuple(replace(own, notes=(*words, *own.notes)) for own in findings.sections[:1])
    table = Table(
        "What is true of the simulated population, and what its answers here give, with 95 % confidence "
        "intervals (CI). A dash: not estimated by itself.",
        ("of", "effect", "assumed", "estimated", "95 % CI"),
        tuple(
            (in_words(own.group), of_track(own.what), f"{own.value:.2f}", *with_interval(row))
            for own, row in both
        ),
    )
    rows = Rows(Origin.SIMULATED)
    for effect in assumed:
        what, method = effect.what, "true of the simulated population"
        rows.add(TABLE, effect.group, what, effect.unit, method, effect.value)
    return replace(
        findings,
        lead=cautious(findings.concerns, " ".join(words)) if words else findings.lead,
        rows=(*findings.rows, *rows),
        sections=(
            *first,
            *findings.sections[1:],
            replace(section("assumed", (table,), simulated=True), below=True),
        ),
    )


def _estimate(rows: Sequence[Statistic], effect: AssumedEffect) -> Statistic | None:
    """Return the row that estimates an effect; a side of a search is named with its number of locations."""
    what = ESTIMATED.get(effect.what)
    own = (row for row in rows if row.what == what and row.group.partition(" (")[0] == effect.group)
    return next(own, None)

"""What simulated participants are assumed to show, beside what the analysis of their answers estimates.

The truth stands in the data set (`simulated_truth.json`). Where it is that there is nothing to see, answers
are coin flips: then the analysis does not conclude, from them, that two versions look alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evenlight.analysis.findings import Findings
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, RATED, TIME_RATIO, AssumedEffect

TABLE = "assumed"
# The rows of the analyses that estimate each effect.
ESTIMATED = {
    RATED: "mean difference, ours less baseline",
    CHOSEN: "ours chosen",
    TIME_RATIO: "time ratio, ours / baseline",
}


def with_assumed(findings: Findings, assumed: Sequence[AssumedEffect]) -> Findings:
    """Return findings of simulated answers with what is true of those who gave them.

    Where the assumed observers see nothing to choose by, the lead says so, and a note of the first section.

    Parameters
    ----------
    findings : Findings
        Of one task.
    assumed : sequence of AssumedEffect
        What is true of the population; nothing is added if there is nothing.
    """
    if not assumed:
        return findings
    coins = [effect for effect in assumed if effect.is_a_coin]
    seen = [
        (effect, _estimate(findings.statistics, effect))
        for effect in assumed
        if effect.what == CHOSEN and not effect.is_a_coin
    ]
    words = prose("assumed_coins", coins=coins, seen=seen)
    first = tuple(replace(own, notes=(*words, *own.notes)) for own in findings.sections[:1])
    about = section("assumed", (_table(findings, assumed),), simulated=True)
    rows = tuple(
        Statistic(TABLE, effect.group, effect.what, effect.value, effect.unit, Origin.SIMULATED,
                  method="true of the simulated population")
        for effect in assumed
    )  # fmt: skip
    return replace(
        findings,
        lead=" ".join(words) if words else findings.lead,
        statistics=(*findings.statistics, *rows),
        sections=(*first, *findings.sections[1:], replace(about, below=True)),
    )


def _table(findings: Findings, assumed: Sequence[AssumedEffect]) -> Table:
    """Return each assumed effect beside its estimate."""
    rows: list[tuple[Cell, ...]] = []
    for effect in assumed:
        row = _estimate(findings.statistics, effect)
        interval = None
        if row is not None and row.ci_low is not None and row.ci_high is not None:
            interval = f"{row.ci_low:.2f} to {row.ci_high:.2f}"
        rows.append(
            (
                in_words(effect.group), effect.what, f"{effect.value:.2f}",
                None if row is None or row.value is None else f"{row.value:.2f}", interval,
            )
        )  # fmt: skip
    return Table(
        "What is true of the simulated population, and what its answers here give, with 95 % confidence "
        "intervals (CI). A dash: not estimated by itself.",
        ("of", "effect", "assumed", "estimated", "95 % CI"),
        tuple(rows),
    )


def _estimate(rows: Sequence[Statistic], effect: AssumedEffect) -> Statistic | None:
    """Return the row that estimates an effect; a side of a search is named with its number of locations."""
    what = ESTIMATED.get(effect.what)
    return next(
        (row for row in rows if row.what == what and row.group.partition(" (")[0] == effect.group), None
    )

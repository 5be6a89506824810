"""The section of the audit on what the pairing decides, which Table 1 does not print.

What paired tests of Table 1 can come to: by sequence, over all sequences, and what 17 people find.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from evenlight.analysis.audit.conventions import SCORES
from evenlight.analysis.audit.pairings import ALPHA, MAIN_TEST, PairedTest, PValueRange
from evenlight.analysis.audit.rows import ALL, AuditRows, audit_section, between, p_between, row
from evenlight.analysis.audit.table_ratings import ParticipantTotals, SequenceRatings, correlations
from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import SEQUENCES
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words
from evenlight.data_schema.analysis_results import Statistic

BELOW = "correlation below which the t test cannot give p < 0.05"
ABOVE = "correlation above which the t test must give p < 0.05"
SMALLEST = "smallest possible correlation within people"
LARGEST = "largest possible correlation within people"
DETECTABLE = "mean difference found with 80 % power, correlation {:g}"
POWER = 0.8
ASSUMED_CORRELATIONS = (0.0, 0.5)  # within people: unrelated, and as ratings of the same person often are
OVER_PAIRINGS = "over every pairing of every distribution that agrees with Table 1"
UNPAIRED = ("Welch's t test", "exact permutation test of the means")


def pairing_statistics(
    ratings: Sequence[SequenceRatings],
    adjusted: dict[PairedTest, list[PValueRange]],
    totals: ParticipantTotals,
) -> tuple[Statistic, ...]:
    """Return every number of the section on pairings."""
    what = "mean difference of ratings"
    rows = [
        row("paired", r.sequence, what, r.mean_differences[0], n=r.n, method="any pairing") for r in ratings
    ]
    for test in PairedTest:
        ranges = [r.ranges[test] for r in ratings]
        for r, raw, corrected in zip(ratings, ranges, adjusted[test], strict=True):
            rows += _ends(r, test.value, raw, corrected)
    for r in ratings:
        rows += [s for name, p in zip(UNPAIRED, r.unpaired, strict=True) for s in _ends(r, name, p, None)]
        rows += _correlation_rows(r)
        rows += _detectable(r)
    return (*rows, *_total_rows(totals), *_unrelated(ratings))


def _ends(r: SequenceRatings, test: str, raw: PValueRange, adjusted: PValueRange | None) -> list[Statistic]:
    """Return the smallest and the largest p of a test."""
    table = "paired" if adjusted else "unpaired"
    method = f"{test}, two-sided, {OVER_PAIRINGS}" + ("; Holm over the sequences" if adjusted else "")
    flag = raw.verdict.value if adjusted else "as if different people had rated the two versions"
    ends = (
        ("smallest", raw.low, adjusted and adjusted.low),
        ("largest", raw.high, adjusted and adjusted.high),
    )
    return [
        row(table, r.sequence, f"{name} p of the {test}", p, p_value=p, p_adjusted=holm_p, n=r.n,
            method=method, flag=flag)
        for name, p, holm_p in ends
    ]  # fmt: skip


def _correlation_rows(r: SequenceRatings) -> list[Statistic]:
    """Return which correlations within people are possible and which the t test needs."""
    found = correlations(r)
    method = "t test at 5 %, from the means and SD that Table 1 leaves possible"
    facts = (
        (SMALLEST, found.low, OVER_PAIRINGS),
        (LARGEST, found.high, OVER_PAIRINGS),
        (BELOW, found.needed_low, method),
        (ABOVE, found.needed_high, method),
    )
    return [row("correlation", r.sequence, what, value, n=r.n, method=how) for what, value, how in facts]


def _detectable(r: SequenceRatings) -> list[Statistic]:
    """Return the mean differences that a t test of so many pairs finds with 80 % power, at their spread."""
    from statsmodels.stats.power import TTestPower

    effect = float(TTestPower().solve_power(nobs=r.n, alpha=ALPHA, power=POWER))
    first, second = (
        max(float(np.std(np.repeat(SCORES, h), ddof=1)) for h in side) for side in (r.baseline, r.ours)
    )
    rows = []
    for correlation in ASSUMED_CORRELATIONS:
        spread = float(np.sqrt(first**2 + second**2 - 2 * correlation * first * second))
        what = DETECTABLE.format(correlation)
        method = "two-sided t test at 5 %, noncentral t; largest SD that agree with Table 1"
        rows.append(row("power_of_ratings", r.sequence, what, effect * spread, n=r.n, method=method))
    return rows


def _total_rows(totals: ParticipantTotals) -> list[Statistic]:
    """Return the bounds for the participants' mean difference over all sequences."""
    n = len(totals.most_even)
    rows = [row("paired", ALL, "mean difference of ratings", totals.mean, n=n, method="any pairing")]
    for test in PairedTest:
        p = totals.p_range(test)
        exact = test is PairedTest.T
        flag = (
            p.verdict.value if exact else "the largest is that of the least even totals, not of all pairings"
        )
        if not totals.bound_met:
            flag += "; a smaller one may exist"
        for name, end in (("smallest", p.low), ("largest", p.high)):
            method = f"{test.value} of the participants' means over the sequences, two-sided, {OVER_PAIRINGS}"
            what = f"{name} p of the {test.value}"
            rows.append(row("paired", ALL, what, end, p_value=end, n=n, method=method, flag=flag))
    return rows


def _unrelated(ratings: Sequence[SequenceRatings]) -> list[Statistic]:
    """Return the mean difference over all sequences if a person's eight ratings had nothing in common."""
    n = ratings[0].n
    mean = float(np.mean([r.mean_differences[0] for r in ratings]))
    variances = [
        max(float(np.var(np.repeat(SCORES, h), ddof=1)) for h in side)
        for r in ratings
        for side in (r.baseline, r.ours)
    ]
    error = float(np.sqrt(sum(variances) / n)) / len(ratings)
    half = float(special.stdtrit(n - 1, 1 - ALPHA / 2)) * error
    p = float(2 * special.stdtr(n - 1, -mean / error))
    what = "mean difference of ratings, if a person's ratings were unrelated"
    flag = "an assumption: how a person's ratings go together is not published"
    return [
        row("paired", ALL, what, mean, ci_low=mean - half, ci_high=mean + half, interval=0.95, p_value=p,
            n=n, method="t, n - 1; largest SD that agree with Table 1", flag=flag)
    ]  # fmt: skip


def pairing_section(rows: AuditRows, n: int, drawing: Drawing) -> Section:
    """Return the section, about n pairs."""
    return audit_section(
        "pairing",
        rows,
        (_range_table(rows, n), _context_table(rows, n)),
        (drawing,),
        main_test=MAIN_TEST.value,
        tests=len(SEQUENCES),
        pairs=n,
        above=ABOVE,
        below=BELOW,
        largest=LARGEST,
        all_p=p_between(*rows.ends("paired", ALL, PairedTest.T.value)),
    )


def _range_table(rows: AuditRows, n: int) -> Table:
    """Return the table of the ranges of p."""
    lines: list[tuple[Cell, ...]] = []
    for sequence in SEQUENCES:
        for test in PairedTest:
            low, high = (
                rows.of("paired", sequence, f"{end} p of the {test.value}") for end in ("smallest", "largest")
            )
            raw = p_between(low.value, high.value)
            holm = p_between(low.p_adjusted, high.p_adjusted)
            name = in_words(sequence) if test is PairedTest.T else ""
            lines.append((name, test.value, raw, holm, low.flag))
    return Table(
        f"Smallest and largest two-sided p over all pairings that agree with Table 1 ({n} pairs)",
        ("sequence", "test", "p", "p, Holm", "at 5 %, before Holm"),
        tuple(lines),
    )


def _context_table(rows: AuditRows, n: int) -> Table:
    """Return the table of mean differences, unpaired tests, correlations, and what so many pairs find."""
    lines: list[tuple[Cell, ...]] = []
    for sequence in SEQUENCES:
        possible = [f"{rows.number('correlation', sequence, what):.2f}" for what in (SMALLEST, LARGEST)]
        detectable = [
            f"{rows.number('power_of_ratings', sequence, DETECTABLE.format(c)):.2f}"
            for c in ASSUMED_CORRELATIONS
        ]
        lines.append(
            (
                in_words(sequence),
                f"{rows.number('paired', sequence, 'mean difference of ratings'):.2f}",
                between(*possible),
                _needed(rows, sequence),
                *(p_between(*rows.ends("unpaired", sequence, test)) for test in UNPAIRED),
                *detectable,
            )
        )
    return Table(
        "What the ratings are besides: correlation r within people, tests as if unpaired, and the mean "
        f"difference that {n} pairs find with 80 % power",
        ("sequence", "difference", "r possible", "r for p < 0.05", "p, Welch", "p, permutation",
         "found if r = 0", "found if r = 0.5"),
        tuple(lines),
    )  # fmt: skip


def _needed(rows: AuditRows, sequence: str) -> str:
    """Return which correlations give p < 0.05, in words where all that are possible do, or none."""
    below, above = rows.number("correlation", sequence, BELOW), rows.number("correlation", sequence, ABOVE)
    if above < rows.number("correlation", sequence, SMALLEST):
        return "any"
    if below > rows.number("correlation", sequence, LARGEST):
        return "none"
    return "above " + between(f"{below:.2f}", f"{above:.2f}")

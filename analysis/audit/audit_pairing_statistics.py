"""What paired tests of Table 1 can come to: by sequence, over all sequences, and what 17 people find."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from evenlight.analysis.audit.audit_conventions import SCORES
from evenlight.analysis.audit.audit_paired_tests import ALPHA, PairedTest, PRange
from evenlight.analysis.audit.audit_participants import Totals
from evenlight.analysis.audit.audit_ratings import SequenceRatings, correlations
from evenlight.analysis.audit.audit_statistics import ALL, row
from evenlight.data_schema.statistic import Statistic

POWER = 0.8
ASSUMED_CORRELATIONS = (0.0, 0.5)  # within people: unrelated, and as ratings of the same person often are
OVER_PAIRINGS = "over every pairing of every distribution that agrees with Table 1"
UNPAIRED = ("Welch's t test", "exact permutation test of the means")


def pairing_statistics(
    ratings: Sequence[SequenceRatings], adjusted: dict[PairedTest, list[PRange]], totals: Totals
) -> tuple[Statistic, ...]:
    """Return every number of the section on pairings."""
    rows: list[Statistic] = []
    for r in ratings:
        means = r.mean_differences
        rows.append(
            row("paired", r.sequence, "mean difference of ratings", means[0], n=r.n, method="any pairing")
        )
    for test in PairedTest:
        ranges = [r.ranges[test] for r in ratings]
        for r, raw, corrected in zip(ratings, ranges, adjusted[test], strict=True):
            rows += _ends(r, test.value, raw, corrected)
    for r in ratings:
        rows += [s for name, p in zip(UNPAIRED, r.unpaired, strict=True) for s in _ends(r, name, p, None)]
        rows += _correlation_rows(r)
        rows += _detectable(r)
    return (*rows, *_total_rows(totals), *_unrelated(ratings))


def _ends(r: SequenceRatings, test: str, raw: PRange, adjusted: PRange | None) -> list[Statistic]:
    """Return the smallest and the largest p of a test."""
    table = "paired" if adjusted else "unpaired"
    method = f"{test}, two-sided, {OVER_PAIRINGS}" + ("; Holm over the sequences" if adjusted else "")
    flag = raw.verdict.value if adjusted else "as if different people had rated the two versions"
    ends = (
        ("smallest", raw.low, adjusted and adjusted.low),
        ("largest", raw.high, adjusted and adjusted.high),
    )
    return [
        row(
            table,
            r.sequence,
            f"{name} p of the {test}",
            p,
            p_value=p,
            p_adjusted=holm_p,
            n=r.n,
            method=method,
            flag=flag,
        )
        for name, p, holm_p in ends
    ]


def _correlation_rows(r: SequenceRatings) -> list[Statistic]:
    """Return which correlations within people are possible and which the t test needs."""
    found = correlations(r)
    method = "t test at 5 %, from the means and SD that Table 1 leaves possible"
    facts = (
        ("smallest possible correlation within people", found.low, OVER_PAIRINGS),
        ("largest possible correlation within people", found.high, OVER_PAIRINGS),
        ("correlation below which the t test cannot give p < 0.05", found.needed_low, method),
        ("correlation above which the t test must give p < 0.05", found.needed_high, method),
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
        what = f"mean difference found with 80 % power, correlation {correlation:g}"
        method = "two-sided t test at 5 %, noncentral t; largest SD that agree with Table 1"
        rows.append(row("power_of_ratings", r.sequence, what, effect * spread, n=r.n, method=method))
    return rows


def _total_rows(totals: Totals) -> list[Statistic]:
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

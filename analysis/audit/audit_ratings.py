"""The paper's table of detail ratings: which ratings and which pairings can be behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from evenlight.analysis.audit.audit_conventions import SCORES, Counts, Printed, possible_histograms
from evenlight.analysis.audit.audit_paired_tests import ALPHA, PairedTest, PRange, holm, p_ranges
from evenlight.analysis.audit.audit_pairings import DIFFERENCES, reachable_differences
from evenlight.analysis.inference.exact_group_test import group_test
from evenlight.analysis.published import SEQUENCES, published

VERSIONS = ("baseline", "ours")
OTHER_NUMBERS = range(8, 25)  # of people, tried beside the 17 that the paper names


@dataclass(frozen=True, slots=True)
class SequenceRatings:
    """All ratings of a sequence that agree with what is printed of it.

    Attributes
    ----------
    sequence : str
        Which.
    baseline, ours : Counts
        Histograms that each version may have, (histograms, 5).
    differences : Counts
        Histograms that the differences may have, (histograms, 9).
    ranges : dict of PairedTest to PRange
        Smallest and largest p of each test over all pairings.
    unpaired : (PRange, PRange)
        The same of Welch's t test and of the exact permutation test of the means, which do as if different
        people had rated the two versions: all that a table without the pairing allows to test directly.
    """

    sequence: str
    baseline: Counts
    ours: Counts
    differences: Counts
    ranges: dict[PairedTest, PRange]
    unpaired: tuple[PRange, PRange]

    @property
    def n(self) -> int:
        """How many people."""
        return int(self.baseline[0].sum())

    @property
    def mean_differences(self) -> tuple[float, ...]:
        """The mean differences that are possible [rating points]: a single one where the sums are fixed."""
        totals = np.unique(self.differences @ DIFFERENCES)
        return tuple(float(total) / self.n for total in totals)


def printed_cell(sequence: str, version: str) -> Printed:
    """Return a mean of the table with its standard error."""
    name = f"detail_quality.{sequence}.{version}"
    n = int(published("participants.viewing").number)
    return Printed(published(f"{name}_mean").text, published(f"{name}_sem").text, n)


def table_ratings() -> tuple[SequenceRatings, ...]:
    """Return what can be behind the paper's table, sequence by sequence."""
    return tuple(
        ratings_behind(sequence, *(printed_cell(sequence, version) for version in VERSIONS))
        for sequence in SEQUENCES
    )


def ratings_behind(sequence: str, baseline: Printed, ours: Printed) -> SequenceRatings:
    """Return the ratings that can be behind two printed means, under any convention, in any pairing."""
    first, second = possible_histograms(baseline), possible_histograms(ours)
    for version, printed, possible in (("baseline", baseline, first), ("ours", ours, second)):
        if not len(possible):
            raise ValueError(
                f"{sequence}, {version}: no {printed.n} ratings from 1 to 5 have the mean {printed.mean} "
                f"and the standard error {printed.sem}"
            )
    differences = reachable_differences(first, second)
    return SequenceRatings(
        sequence, first, second, differences, p_ranges(differences), _unpaired_ranges(first, second)
    )


def _unpaired_ranges(baseline: Counts, ours: Counts) -> tuple[PRange, PRange]:
    """Return the range of p of Welch's t test and of the exact permutation test of unpaired means."""
    welch, exact = [], []
    for one in baseline:
        for other in ours:
            groups = np.repeat(SCORES, other), np.repeat(SCORES, one)
            welch.append(float(stats.ttest_ind(*groups, equal_var=False).pvalue))
            exact.append(group_test(*groups).p_value)
    return PRange(min(welch), max(welch)), PRange(min(exact), max(exact))


def holm_ranges(ratings: Sequence[SequenceRatings]) -> dict[PairedTest, list[PRange]]:
    """Return the ranges of each test with Holm's correction over the sequences, in their order."""
    return {test: holm([r.ranges[test] for r in ratings]) for test in PairedTest}


@dataclass(frozen=True, slots=True)
class Correlations:
    """How alike the two ratings of a person can be, and how alike they must be for a t test to find 5 %.

    Attributes
    ----------
    low, high : float
        Smallest and largest correlation over all pairings.
    needed_low, needed_high : float
        Below the first no pairing gives p < 5 %, above the second every pairing does; they differ only
        where the standard deviations are not known exactly.
    """

    low: float
    high: float
    needed_low: float
    needed_high: float


def correlations(ratings: SequenceRatings) -> Correlations:
    """Return which correlations within people are possible, and which ones a t test needs.

    The variance of the differences is s₁² + s₂² - 2 r s₁ s₂, and t is the mean difference over its standard
    error: the correlation r is all that the table lacks.
    """
    n, reach, needed = ratings.n, [], []
    critical = float(special.stdtrit(n - 1, 1 - ALPHA / 2))
    for one in ratings.baseline:
        for other in ratings.ours:
            first, second = np.repeat(SCORES, one), np.repeat(SCORES, other)
            spreads = float(np.std(first, ddof=1)), float(np.std(second, ddof=1))
            mean = float(second.mean() - first.mean())
            largest_variance = n * (mean / critical) ** 2
            squares = spreads[0] ** 2 + spreads[1] ** 2
            needed.append((squares - largest_variance) / (2 * spreads[0] * spreads[1]))
            # Sorted alike, and against each other: extremes of a sum of products (Hardy et al. 1934).
            reach += [float(np.corrcoef(first, order)[0, 1]) for order in (second, second[::-1])]
    return Correlations(min(reach), max(reach), min(needed), max(needed))

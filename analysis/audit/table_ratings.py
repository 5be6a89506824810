"""The paper's table of detail ratings: which ratings and which pairings can be behind it.

Over all sequences, a person's total is the sum of four differences, so that two things are unknown: which
ratings of a sequence belong to one person, and which person of one sequence is which of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from evenlight.analysis.audit.conventions import SCORES, Counts, PrintedMean, possible_histograms
from evenlight.analysis.audit.pairings import (
    ALPHA,
    DIFFERENCES,
    PairedTest,
    PValueRange,
    holm,
    p_ranges,
    paired_p_values,
    reachable_differences,
)
from evenlight.analysis.inference.exact_tests import group_test
from evenlight.analysis.published import SEQUENCES, published

VERSIONS = ("baseline", "ours")
OTHER_NUMBERS = range(8, 25)  # of people, tried beside the 17 that the paper names
TRIES = 50  # arrangements begun at random, until the bound is met


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
    ranges : dict of PairedTest to PValueRange
        Smallest and largest p of each test over all pairings.
    unpaired : (PValueRange, PValueRange)
        The same of Welch's t test and of the exact permutation test of the means, which do as if different
        people had rated the two versions: all that a table without the pairing allows to test directly.
    """

    sequence: str
    baseline: Counts
    ours: Counts
    differences: Counts
    ranges: dict[PairedTest, PValueRange]
    unpaired: tuple[PValueRange, PValueRange]

    @property
    def n(self) -> int:
        """How many people."""
        return int(self.baseline[0].sum())

    @property
    def mean_differences(self) -> tuple[float, ...]:
        """The mean differences that are possible [rating points]: a single one where the sums are fixed."""
        totals = np.unique(self.differences @ DIFFERENCES)
        return tuple(float(total) / self.n for total in totals)


def printed_cell(sequence: str, version: str) -> PrintedMean:
    """Return a mean of the table with its standard error."""
    name = f"detail_quality.{sequence}.{version}"
    n = int(published("participants.viewing").number)
    return PrintedMean(published(f"{name}_mean").text, published(f"{name}_sem").text, n)


def table_ratings() -> tuple[SequenceRatings, ...]:
    """Return what can be behind the paper's table, sequence by sequence."""
    return tuple(
        ratings_behind(sequence, *(printed_cell(sequence, version) for version in VERSIONS))
        for sequence in SEQUENCES
    )


def ratings_behind(sequence: str, baseline: PrintedMean, ours: PrintedMean) -> SequenceRatings:
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


def _unpaired_ranges(baseline: Counts, ours: Counts) -> tuple[PValueRange, PValueRange]:
    """Return the range of p of Welch's t test and of the exact permutation test of unpaired means."""
    welch, exact = [], []
    for one in baseline:
        for other in ours:
            groups = np.repeat(SCORES, other), np.repeat(SCORES, one)
            welch.append(float(stats.ttest_ind(*groups, equal_var=False).pvalue))
            exact.append(group_test(*groups).p_value)
    return PValueRange(min(welch), max(welch)), PValueRange(min(exact), max(exact))


def holm_ranges(ratings: Sequence[SequenceRatings]) -> dict[PairedTest, list[PValueRange]]:
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


@dataclass(frozen=True, slots=True)
class ParticipantTotals:
    """The most and the least uneven totals of the participants.

    Attributes
    ----------
    most_even, least_even : int array (n,)
        Sum over the sequences of a person's differences [rating points]; both belong to ratings that
        agree with the table.
    sequences : int
        Over how many.
    bound_met : bool
        Whether no totals of whole numbers with that sum could be more even than `most_even`.
    """

    most_even: NDArray[np.int64]
    least_even: NDArray[np.int64]
    sequences: int
    bound_met: bool

    @property
    def mean(self) -> float:
        """The mean difference over people and sequences [rating points]; no pairing changes it."""
        return float(self.most_even.mean()) / self.sequences

    def p_range(self, test: PairedTest) -> PValueRange:
        """Return the p of a test for both totals.

        Of the t test these are the extremes. Of the other tests, the second is one of the large ones.
        """
        low, high = paired_p_values(np.stack([self.most_even, self.least_even]), test)
        return PValueRange(float(low), float(high))


def participant_totals(ratings: Sequence[SequenceRatings], rng: np.random.Generator) -> ParticipantTotals:
    """Return the most and the least uneven totals of the participants that agree with a table.

    Totals are least even, for given histograms, where all ratings of ours rise and all of the baseline fall
    from person to person: that makes every covariance as large as it can be. The most even are sought by
    rearranging one column after the other against the sum of the others (Puccetti & Rüschendorf 2012), until
    they differ by no more than 1, which is the bound for whole numbers.

    Parameters
    ----------
    ratings : sequence of SequenceRatings
        Of the same people.
    rng : numpy.random.Generator
        Where the search begins.
    """
    candidates = [side for r in ratings for side in (_signed(r.ours, 1), _signed(r.baseline, -1))]
    least_even = _least_even(candidates)
    most_even = least_even
    for _ in range(TRIES):
        found = _evened(np.stack([rng.permutation(rng.choice(side)) for side in candidates]))
        most_even = min(most_even, found, key=lambda totals: int((totals**2).sum()))
        if np.ptp(most_even) <= 1:
            break
    return ParticipantTotals(most_even, least_even, len(ratings), bool(np.ptp(most_even) <= 1))


def _signed(histograms: Counts, sign: int) -> Counts:
    """Return the ratings of each histogram, the baseline's below 0, in rising order, (histograms, n)."""
    return np.sort([sign * np.repeat(SCORES, histogram) for histogram in histograms], axis=1)


def _least_even(candidates: list[Counts]) -> NDArray[np.int64]:
    """Return the totals with the largest sum of squares, over every choice of histograms.

    The columns are taken in one after the other; of sums that are equal, one goes on.
    """
    sums = candidates[0]
    for side in candidates[1:]:
        sums = np.unique((sums[:, None, :] + side[None, :, :]).reshape(-1, side.shape[1]), axis=0)
    return np.asarray(sums[np.argmax((sums**2).sum(axis=1))])


def _evened(columns: Counts) -> NDArray[np.int64]:
    """Return the totals of columns, each rearranged against the sum of the others until none gains."""
    squares = None
    while squares != (squares := int((columns.sum(axis=0) ** 2).sum())):
        for column in columns:
            others = columns.sum(axis=0) - column
            column[np.argsort(others, kind="stable")] = np.sort(column)[::-1]
    return np.asarray(columns.sum(axis=0))

"""Bounds for the participants' mean difference over all sequences, from a table without any pairing.

A person's total is the sum of four differences, so that two things are unknown: which ratings of a sequence
belong to one person, and which person of one sequence is which of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.audit.audit_conventions import SCORES, Counts
from evenlight.analysis.audit.audit_paired_tests import PairedTest, PRange, paired_p_values
from evenlight.analysis.audit.audit_ratings import SequenceRatings

TRIES = 50  # arrangements begun at random, until the bound is met


@dataclass(frozen=True, slots=True)
class Totals:
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

    def p_range(self, test: PairedTest) -> PRange:
        """Return the p of a test for both totals.

        Of the t test these are the extremes. Of the other tests, the second is one of the large ones.
        """
        low, high = paired_p_values(np.stack([self.most_even, self.least_even]), test)
        return PRange(float(low), float(high))


def participant_totals(ratings: Sequence[SequenceRatings], rng: np.random.Generator) -> Totals:
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
    return Totals(most_even, least_even, len(ratings), bool(np.ptp(most_even) <= 1))


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

"""The paired tests of many possible sets of differences at once, and what holds for all of them."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from evenlight.analysis.audit.audit_conventions import Counts
from evenlight.analysis.audit.audit_pairings import DIFFERENCES
from evenlight.analysis.inference.exact_paired_tests import sign_flip_p_values
from evenlight.analysis.inference.holm import holm as adjusted
from evenlight.data_schema.arrays import Array

ALPHA = 0.05


class PairedTest(enum.Enum):
    """A two-sided test of paired differences; all but the first are exact."""

    T = "t test"
    SIGN_FLIP = "sign-flip test of the mean"
    SIGNED_RANK = "signed ranks, zeros ranked"
    SIGNED_RANK_DROPPED = "signed ranks, zeros dropped"
    SIGN = "sign test"


MAIN_TEST = PairedTest.SIGN_FLIP  # of the very number that is printed, exact with any ties


class Verdict(enum.Enum):
    """What a table without its pairing says about a difference at 5 %."""

    DIFFERS = "differs, whatever the pairing"
    NOT_SHOWN = "not shown to differ by any pairing"
    OPEN = "depends on the pairing"


@dataclass(frozen=True, slots=True)
class PRange:
    """The smallest and the largest p of a test over all pairings.

    Attributes
    ----------
    low, high : float
        Both attained by a pairing.
    """

    low: float
    high: float

    @property
    def verdict(self) -> Verdict:
        """What holds for every pairing, with p of exactly 5 % counted as enough.

        >>> PRange(0.01, 0.04).verdict, PRange(0.01, 0.2).verdict
        (<Verdict.DIFFERS: 'differs, whatever the pairing'>, <Verdict.OPEN: 'depends on the pairing'>)
        """
        if self.high <= ALPHA:
            return Verdict.DIFFERS
        return Verdict.OPEN if self.low <= ALPHA else Verdict.NOT_SHOWN


def p_ranges(counts: Counts) -> dict[PairedTest, PRange]:
    """Return the smallest and largest p of every test over histograms of differences, (histograms, 9).

    The t test has no value where all differences are alike; such a histogram does not count for it.

    Raises
    ------
    ValueError
        If there is no other.
    """
    differences = differences_of(counts)
    values = {test: paired_p_values(differences, test) for test in PairedTest}
    if np.isnan(values[PairedTest.T]).all():
        raise ValueError("all differences are alike in every pairing: a t test has no value")
    return {test: PRange(float(np.nanmin(p)), float(np.nanmax(p))) for test, p in values.items()}


def differences_of(counts: Counts) -> Counts:
    """Return the differences that histograms of them count, in rising order, (histograms, n).

    >>> differences_of(np.array([[0, 0, 0, 1, 0, 2, 0, 0, 0]])).tolist()
    [[-1, 1, 1]]
    """
    ends = np.cumsum(counts, axis=1)
    n = int(ends[0, -1])
    return np.asarray(DIFFERENCES[(ends[:, :, None] <= np.arange(n)).sum(axis=1)])


def paired_p_values(differences: Counts, test: PairedTest) -> Array:
    """Return the two-sided p of a test for sets of differences, (sets, n) -> (sets,); NaN for none.

    Signed ranks are scores whose signs may flip, and so are signs alone: one enumeration serves all.

    >>> exact = (PairedTest.SIGN_FLIP, PairedTest.SIGN)
    >>> [float(paired_p_values(np.array([[1, 1, 1]]), test)[0]) for test in exact]
    [0.25, 0.25]
    """
    if test is PairedTest.T:
        return _t_p_values(differences)
    if test is PairedTest.SIGN:
        return sign_flip_p_values(np.sign(differences))
    if test is PairedTest.SIGN_FLIP:
        return sign_flip_p_values(differences)
    ranks = stats.rankdata(np.abs(differences), axis=1)
    if test is PairedTest.SIGNED_RANK_DROPPED:  # zeros have the lowest ranks: without them all others sink
        ranks = ranks - (differences == 0).sum(axis=1, keepdims=True)
    return sign_flip_p_values(np.rint(2 * ranks) * np.sign(differences))  # midranks are halves


def _t_p_values(differences: Counts) -> Array:
    """Return the two-sided p of Student's t; NaN where all differences are alike."""
    n = differences.shape[1]
    total, squares = differences.sum(axis=1), (differences**2).sum(axis=1)
    spread = n * squares - total**2  # n (n - 1) times the variance: a whole number, 0 only if all are alike
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.abs(total) * np.sqrt((n - 1) / spread)
    return np.where(spread > 0, 2 * special.stdtr(n - 1, -t), np.nan)


def holm(ranges: list[PRange]) -> list[PRange]:
    """Return ranges of p with Holm's (1979) correction for their number.

    A p that is corrected so never falls when any of the p rises, and each pairing is free: the smallest
    come together from all the smallest, the largest from all the largest.

    >>> holm([PRange(0.01, 0.02), PRange(0.04, 0.5)])
    [PRange(low=0.02, high=0.04), PRange(low=0.04, high=0.5)]
    """
    lows, highs = adjusted([r.low for r in ranges]), adjusted([r.high for r in ranges])
    return [PRange(float(low or 0), float(high or 0)) for low, high in zip(lows, highs, strict=True)]

"""Which ratings can be behind a printed mean and standard error: all of them are tried, in whole numbers.

The paper does not say whether its standard errors rest on the sample or the population standard deviation,
nor whether digits were rounded or cut off. Every combination is a `Convention`, and is tried.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.quantities import read_only

Counts = NDArray[np.int64]
LOWEST, HIGHEST = 1, 5  # of the ratings
SCORES = np.arange(LOWEST, HIGHEST + 1)


class Digits(enum.Enum):
    """What became of the digits that are not printed."""

    ROUNDED = "rounded"
    CUT_OFF = "cut off"


class Deviation(enum.Enum):
    """Which standard deviation a standard error rests on: the sum of squares over n - 1, or over n."""

    SAMPLE = "sample SD"
    POPULATION = "population SD"


@dataclass(frozen=True, slots=True)
class Convention:
    """How a table may have been printed.

    Attributes
    ----------
    mean : Digits
        Of the means.
    deviation : Deviation
        Of the standard errors.
    sem : Digits
        Of the standard errors.
    """

    mean: Digits
    deviation: Deviation
    sem: Digits

    def __str__(self) -> str:
        return f"means {self.mean.value}, SEM of the {self.deviation.value} {self.sem.value}"


CONVENTIONS = tuple(Convention(*parts) for parts in product(Digits, Deviation, Digits))


@dataclass(frozen=True, slots=True)
class PrintedMean:
    """A mean of n ratings with its standard error, as printed.

    Attributes
    ----------
    mean, sem : str
        Their digits, e.g. "3.59" and "0.22".
    n : int
        How many ratings, at least 2.
    """

    mean: str
    sem: str
    n: int

    def __post_init__(self) -> None:
        if self.n < 2:
            raise ValueError(f"a standard error needs at least 2 ratings, got n = {self.n}")


@cache
def all_histograms(n: int) -> Counts:
    """Return every histogram of n ratings from 1 to 5, (histograms, 5).

    >>> len(all_histograms(17))  # C(17 + 4, 4)
    5985
    """
    first = [np.zeros((1, 0), dtype=np.int64)]
    for _ in SCORES[:-1]:
        first = [_extended(block, n) for block in first]
    counts = first[0]
    return read_only(np.column_stack([counts, n - counts.sum(axis=1)]), np.int64)


def _extended(counts: Counts, n: int) -> Counts:
    """Return the rows of partial histograms with every count that the next rating may have."""
    left = n - counts.sum(axis=1)
    rows = np.repeat(np.arange(len(counts)), left + 1)
    return np.column_stack([counts[rows], np.concatenate([np.arange(most + 1) for most in left])])


def matches(printed: PrintedMean, histograms: Counts, convention: Convention) -> NDArray[np.bool_]:
    """Return which histograms would be printed so under a convention, (histograms,).

    A half may have been rounded either way. In whole numbers, nothing is lost: with S and Q the sums of the
    ratings and of their squares, the mean is S / n and the squared standard error (nQ - S²) / (n²(n - 1)), or
    over n³ for the population.

    >>> ratings = np.array([[0, 0, 1, 1, 0]])  # 3 and 4: mean 3.5, SEM 0.5 or 0.354
    >>> rounded = Convention(Digits.ROUNDED, Deviation.SAMPLE, Digits.ROUNDED)
    >>> matches(PrintedMean("3.5", "0.50", 2), ratings, rounded).tolist()
    [True]
    """
    return _mean_matches(printed, histograms, convention) & _sem_matches(printed, histograms, convention)


def _mean_matches(printed: PrintedMean, histograms: Counts, convention: Convention) -> NDArray[np.bool_]:
    """Return which histograms have a mean that would be printed so."""
    digits, scale = _whole(printed.mean)
    total, n = scale * (histograms @ SCORES), printed.n
    if convention.mean is Digits.CUT_OFF:
        return np.asarray((digits * n <= total) & (total < (digits + 1) * n))
    return np.asarray(np.abs(2 * total - 2 * digits * n) <= n)


def _sem_matches(printed: PrintedMean, histograms: Counts, convention: Convention) -> NDArray[np.bool_]:
    """Return which histograms have a standard error that would be printed so."""
    digits, scale = _whole(printed.sem)
    n = printed.n
    square = scale**2 * (n * (histograms @ SCORES**2) - (histograms @ SCORES) ** 2)
    divisor = n**2 * (n - 1) if convention.deviation is Deviation.SAMPLE else n**3
    if convention.sem is Digits.CUT_OFF:
        return np.asarray((digits**2 * divisor <= square) & (square < (digits + 1) ** 2 * divisor))
    low, high = max(2 * digits - 1, 0), 2 * digits + 1
    return np.asarray((low**2 * divisor <= 4 * square) & (4 * square <= high**2 * divisor))


def _whole(text: str) -> tuple[int, int]:
    """Return printed digits as a whole number, and what it is to be divided by.

    >>> _whole("3.59"), _whole("4")
    ((359, 100), (4, 1))
    """
    decimals = max(-int(Decimal(text).as_tuple().exponent), 0)
    return int(Decimal(text).scaleb(decimals)), 10**decimals


def possible_histograms(printed: PrintedMean) -> Counts:
    """Return the histograms that would be printed so under one convention or another, (histograms, 5)."""
    histograms = all_histograms(printed.n)
    return histograms[np.any([matches(printed, histograms, c) for c in CONVENTIONS], axis=0)]


@cache
def conventions_that_allow(printed: PrintedMean) -> tuple[Convention, ...]:
    """Return the conventions under which some histogram would be printed so."""
    histograms = all_histograms(printed.n)
    return tuple(c for c in CONVENTIONS if matches(printed, histograms, c).any())

"""The paper's choices between two versions: which counts are behind its percentages, what they can show."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal

import numpy as np
from scipy import special, stats

from evenlight.analysis.audit.audit_ratings import OTHER_NUMBERS
from evenlight.analysis.inference.binomial_tests import HALF
from evenlight.analysis.published import SEQUENCES, published


@dataclass(frozen=True, slots=True)
class ChosenCount:
    """A printed percentage as a count.

    Attributes
    ----------
    sequence : str
        Of which sequence.
    text : str
        The percentage as printed.
    chosen, answers : int
        How many of how many.
    """

    sequence: str
    text: str
    chosen: int
    answers: int


def chosen_counts() -> tuple[ChosenCount, ...]:
    """Return the counts behind the four percentages of choices of ours.

    Raises
    ------
    ValueError
        If a percentage is that of no count, or of several.
    """
    n = int(published("participants.viewing").number)
    return tuple(
        _only_count(sequence, published(f"detail_quality.{sequence}.chosen_percent").text, n)
        for sequence in SEQUENCES
    )


def _only_count(sequence: str, text: str, n: int) -> ChosenCount:
    """Return the one count that is printed as a percentage."""
    counts = counts_printed_as(text, n)
    if len(counts) != 1:
        raise ValueError(f"{sequence}: {text} % should be one count of {n}, is {counts}")
    return ChosenCount(sequence, text, counts[0], n)


def counts_printed_as(text: str, n: int) -> tuple[int, ...]:
    """Return the counts of n whose percentage, rounded or cut off, is printed so.

    >>> counts_printed_as("53", 17), counts_printed_as("53", 16)
    ((9,), ())
    """
    return tuple(k for k in range(n + 1) if text in _percentages(k, n))


def _percentages(k: int, n: int) -> set[str]:
    """Return k of n in whole percent, rounded and cut off."""
    share = Decimal(100 * k) / n
    return {str(share.quantize(Decimal(1), rounding)) for rounding in (ROUND_HALF_UP, ROUND_DOWN)}


def numbers_that_fit(texts: tuple[str, ...]) -> tuple[int, ...]:
    """Return which numbers of people, 8 to 24, have a count for each of some percentages.

    >>> numbers_that_fit(("53", "47"))
    (15, 17, 19)
    """
    return tuple(n for n in OTHER_NUMBERS if all(counts_printed_as(text, n) for text in texts))


def chance_of_being_so_even(counts: tuple[ChosenCount, ...]) -> float:
    """Return how often coins would divide every one of some counts as evenly as these, or more evenly.

    >>> count = ChosenCount("library", "53", 9, 17)
    >>> round(chance_of_being_so_even((count,)), 4)  # 8 or 9 of 17: 2 · 24310 / 2^17
    0.3709
    """
    within = []
    for count in counts:
        nearer = max(count.chosen, count.answers - count.chosen)
        within.append(1 - 2 * float(stats.binom.sf(nearer, count.answers, HALF)))
    return float(np.prod(within))


def detectability(share: float) -> float:
    """Return d' of somebody who chooses rightly so often between two: √2 Φ⁻¹(share) (Green & Swets 1966).

    >>> round(detectability(0.76025), 3)  # Φ(1 / √2)
    1.0
    """
    return float(np.sqrt(2) * special.ndtri(share))

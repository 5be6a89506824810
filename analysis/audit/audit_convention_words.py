"""What the printed numbers say of how they were printed, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal

import numpy as np

from evenlight.analysis.audit.audit_conventions import (
    CONVENTIONS,
    SCORES,
    Convention,
    Counts,
    Deviation,
    Digits,
    Printed,
    conventions_that_allow,
)
from evenlight.analysis.audit.audit_ratings import VERSIONS, SequenceRatings, printed_cell
from evenlight.analysis.wording import listed, spaced


@dataclass(frozen=True, slots=True)
class OddNumber:
    """A printed number that the conventions which give most of the table do not give.

    Attributes
    ----------
    sequence, version : str
        Of which cell.
    text : str
        As printed.
    expected : tuple of str
        What would be printed under those conventions.
    value : str
        What it is, where that is known exactly; empty otherwise.
    """

    sequence: str
    version: str
    text: str
    expected: tuple[str, ...]
    value: str = ""

    @property
    def last_digits_away(self) -> int:
        """How many units of the last digit it is away from the farthest of those.

        >>> OddNumber("gym", "ours", "0.19", ("0.18", "0.20")).last_digits_away
        1
        """
        exponent = -int(Decimal(self.text).as_tuple().exponent)
        return max(int(abs(Decimal(e) - Decimal(self.text)).scaleb(exponent)) for e in self.expected)

    def __str__(self) -> str:
        known = f" is {self.value} and" if self.value else ""
        would = " or ".join(self.expected)
        return f"{self.text} of the {spaced(self.sequence)}, {self.version},{known} would be {would}"


def best_conventions(ratings: Sequence[SequenceRatings]) -> tuple[Convention, ...]:
    """Return the conventions that give the most cells of the table."""
    allowed = [
        conventions_that_allow(printed_cell(r.sequence, version)) for r in ratings for version in VERSIONS
    ]
    most = max(sum(c in each for each in allowed) for c in CONVENTIONS)
    return tuple(c for c in CONVENTIONS if sum(c in each for each in allowed) == most)


def odd_numbers(ratings: Sequence[SequenceRatings]) -> tuple[OddNumber, ...]:
    """Return the printed numbers that none of the best conventions gives."""
    found: list[OddNumber] = []
    best = best_conventions(ratings)
    for r in ratings:
        for version, histograms in zip(VERSIONS, (r.baseline, r.ours), strict=True):
            cell = printed_cell(r.sequence, version)
            if set(best) & set(conventions_that_allow(cell)):
                continue
            means, errors = _expected(histograms, cell, best)
            totals = np.unique(histograms @ SCORES)
            value = f"{totals[0]}/{r.n} = {totals[0] / r.n:.4f}" if len(totals) == 1 else ""
            if cell.mean not in means:
                found.append(OddNumber(r.sequence, version, cell.mean, means, value))
            if cell.sem not in errors:
                found.append(OddNumber(r.sequence, version, cell.sem, errors))
    return tuple(found)


def _expected(
    histograms: Counts, cell: Printed, conventions: Sequence[Convention]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the means and the standard errors that would be printed of some histograms."""
    means, errors = set(), set()
    total, squares, n = histograms @ SCORES, histograms @ SCORES**2, cell.n
    for convention in conventions:
        means |= {_printed(value, cell.mean, convention.mean) for value in total / n}
        freedom = n - 1 if convention.deviation is Deviation.SAMPLE else n
        values = np.sqrt((squares - total**2 / n) / freedom / n)
        errors |= {_printed(value, cell.sem, convention.sem) for value in values}
    return tuple(sorted(means)), tuple(sorted(errors))


def _printed(value: float, like: str, digits: Digits) -> str:
    """Return a number with as many digits as another.

    >>> _printed(55 / 17, "3.23", Digits.ROUNDED), _printed(55 / 17, "3.23", Digits.CUT_OFF)
    ('3.24', '3.23')
    """
    rounding = ROUND_DOWN if digits is Digits.CUT_OFF else ROUND_HALF_UP
    unit = Decimal(1).scaleb(int(Decimal(like).as_tuple().exponent))
    return str(Decimal(float(value)).quantize(unit, rounding))


def conventions_in_words(ratings: Sequence[SequenceRatings]) -> str:
    """Return which conventions give the table, and which printed numbers they do not give."""
    best, odd = best_conventions(ratings), odd_numbers(ratings)
    named = " and ".join(f"“{convention}”" for convention in best)
    if not odd:
        return f"The whole table agrees with {named}."
    away = max(number.last_digits_away for number in odd)
    rows = listed(list(dict.fromkeys(spaced(number.sequence) for number in odd)))
    return (
        f"No single convention gives all {2 * len(ratings)} cells. Those that give most are "
        f"{named} (NumPy's std is that of the population "
        f"unless told otherwise); they fail in the row of the {rows} alone. There, under them, "
        f"{'; '.join(str(number) for number in odd)}: {away} unit{'s' if away > 1 else ''} of the last "
        "digit away, which changes nothing that follows. Below, whatever agrees under any convention "
        "counts as possible."
    )


def known_in_words(ratings: Sequence[SequenceRatings]) -> str:
    """Return where the sums of the ratings and of their squares are known exactly."""
    exact, left, agreeing = [], [], []
    for r in ratings:
        sums = [len({(int(h @ SCORES), int(h @ SCORES**2)) for h in side}) for side in (r.baseline, r.ours)]
        if max(sums) == 1:
            exact.append(spaced(r.sequence))
            agreeing += [len(r.baseline), len(r.ours)]
        else:
            left.append(f"{sums[0]} (baseline) and {sums[1]} (ours) in the {spaced(r.sequence)}")
    known = (
        f"In {listed(exact)} sum and sum of squares are known exactly, and with them mean and standard "
        f"deviation; {min(agreeing)} to {max(agreeing)} histograms agree. "
        if exact
        else ""
    )
    others = f"Several pairs of sums are possible elsewhere: {listed(left)}." if left else ""
    return known + others

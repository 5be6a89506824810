"""Which ratings can be behind a printed mean and standard error."""

from collections import Counter
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal, localcontext
from itertools import product
from math import comb

import numpy as np
import pytest

from evenlight.analysis.audit.conventions import (
    CONVENTIONS,
    SCORES,
    Convention,
    Deviation,
    Digits,
    PrintedMean,
    all_histograms,
    conventions_that_allow,
    matches,
    possible_histograms,
)

ROUNDED = Convention(Digits.ROUNDED, Deviation.SAMPLE, Digits.ROUNDED)


def as_printed(histogram, convention: Convention, half: str = ROUND_HALF_UP) -> tuple[str, str]:
    """Print a mean and its standard error as a careful person would, in 60 digits."""
    ratings = [Decimal(int(s)) for s, count in zip(SCORES, histogram, strict=True) for _ in range(count)]
    with localcontext() as context:
        context.prec = 60
        n = len(ratings)
        mean = sum(ratings) / n
        squares = sum((r - mean) ** 2 for r in ratings)
        divisor = n - 1 if convention.deviation is Deviation.SAMPLE else n
        sem = (squares / divisor).sqrt() / Decimal(n).sqrt()
        ways = {Digits.ROUNDED: half, Digits.CUT_OFF: ROUND_DOWN}
        cent = Decimal("0.01")
        return str(mean.quantize(cent, ways[convention.mean])), str(sem.quantize(cent, ways[convention.sem]))


@pytest.mark.parametrize("n", [1, 3, 5])
def test_all_histograms_are_those_of_all_ratings(n: int) -> None:
    counted = {tuple(Counter(ratings)[s] for s in SCORES) for ratings in product(SCORES, repeat=n)}
    found = [tuple(row) for row in all_histograms(n).tolist()]
    assert len(found) == comb(n + 4, 4)
    assert set(found) == counted


@pytest.mark.parametrize("convention", CONVENTIONS, ids=str)
def test_a_histogram_matches_what_would_be_printed_of_it_and_nothing_else(convention: Convention) -> None:
    histograms = all_histograms(7)  # no mean or standard error of 7 ratings ends in a half of the last digit
    printed = [as_printed(histogram, convention) for histogram in histograms]
    for mean, sem in sorted(set(printed))[::7]:
        found = matches(PrintedMean(mean, sem, 7), histograms, convention)
        assert found.tolist() == [(mean, sem) == other for other in printed]


def test_a_half_may_have_been_rounded_either_way() -> None:
    histogram = np.array([[0, 0, 7, 1, 0]])  # 25 / 8 = 3.125
    sem = as_printed(histogram[0], ROUNDED)[1]
    both = {as_printed(histogram[0], ROUNDED, half)[0] for half in (ROUND_HALF_UP, ROUND_HALF_EVEN)}
    assert both == {"3.13", "3.12"}
    for mean in both:
        assert matches(PrintedMean(mean, sem, 8), histogram, ROUNDED).all()


def test_a_number_without_further_digits_is_not_cut_off_to_the_one_below() -> None:
    cut_off = Convention(Digits.CUT_OFF, Deviation.SAMPLE, Digits.CUT_OFF)
    histogram = np.array([[0, 0, 1, 1, 0]])  # 3 and 4: mean 3.5 and SEM 0.5, both exactly
    assert matches(PrintedMean("3.50", "0.50", 2), histogram, cut_off).all()
    assert not matches(PrintedMean("3.49", "0.50", 2), histogram, cut_off).any()
    assert not matches(PrintedMean("3.50", "0.49", 2), histogram, cut_off).any()


def test_equal_ratings_have_no_standard_error_under_any_convention() -> None:
    everybody_four = [0, 0, 0, 17, 0]
    printed = PrintedMean("4.00", "0.00", 17)
    assert possible_histograms(printed).tolist() == [everybody_four]
    assert conventions_that_allow(printed) == CONVENTIONS


def test_a_mean_of_55_of_17_is_3_24_rounded_and_3_23_cut_off() -> None:
    # 55 / 17 = 3.2353, and no other sum of 17 comes between 3.225 and 3.240: 54 / 17 = 3.18.
    assert {c.mean for c in conventions_that_allow(PrintedMean("3.23", "0.26", 17))} == {Digits.CUT_OFF}


def test_parity_leaves_out_a_standard_error_of_0_19() -> None:
    # 63 = sum of 17 ratings, so the sum of squares is odd. Population SEM² · 17³ = 17 Q - 63²: 162 for 243,
    # 196 for 245; SEM 0.1816 and 0.1997. Only 244 would round to 0.19, and it is even.
    rounded = Convention(Digits.ROUNDED, Deviation.POPULATION, Digits.ROUNDED)
    assert rounded not in conventions_that_allow(PrintedMean("3.71", "0.19", 17))
    assert rounded in conventions_that_allow(PrintedMean("3.71", "0.18", 17))


def test_impossible_numbers_have_no_ratings_behind_them() -> None:
    assert len(possible_histograms(PrintedMean("3.50", "0.20", 17))) == 0  # 59.5 is no sum
    assert len(possible_histograms(PrintedMean("3.59", "0.02", 17))) == 0  # 61 of 17 cannot be that alike


def test_one_rating_has_no_standard_error() -> None:
    with pytest.raises(ValueError, match="at least 2 ratings, got n = 1"):
        PrintedMean("3.00", "0.10", 1)

"""How many ratings are behind each cell of Table 1: tried one by one, in other code than the audit's."""

from itertools import combinations_with_replacement
from math import sqrt
from statistics import fmean, pstdev, stdev

import pytest

from evenlight.analysis.audit.conventions import Digits
from evenlight.analysis.audit.distribution_section import numbers_that_fit

# Table 1: mean and standard error.
PRINTED = {
    ("library", "baseline"): (3.59, 0.22), ("library", "ours"): (3.76, 0.16),
    ("gym", "baseline"): (3.23, 0.26), ("gym", "ours"): (3.71, 0.19),
    ("living_room", "baseline"): (3.82, 0.19), ("living_room", "ours"): (4.18, 0.17),
    ("basement", "baseline"): (3.47, 0.15), ("basement", "ours"): (4.29, 0.18),
}  # fmt: skip
TINY = 1e-9


def is_printed(value: float, digits: float, cut_too: bool) -> bool:
    """Whether a value, rounded (a half either way) or also cut off, has two digits like these."""
    rounded = abs(value - digits) <= 0.005 + TINY
    return rounded or (cut_too and digits - TINY <= value < digits + 0.01 - TINY)


@pytest.fixture(scope="module")
def moments() -> dict[int, list[tuple[float, float, float]]]:
    """Mean and both standard errors of every choice of 2 to 17 ratings from 1 to 5."""
    return {
        n: [(fmean(r), stdev(r) / sqrt(n), pstdev(r) / sqrt(n))
            for r in combinations_with_replacement(range(1, 6), n)]
        for n in range(2, 18)
    }  # fmt: skip


def tried(moments, cell: tuple[str, str], cut_too: bool) -> set[int]:
    mean, sem = PRINTED[cell]
    return {
        n
        for n, choices in moments.items()
        if any(
            is_printed(m, mean, cut_too) and (is_printed(s, sem, cut_too) or is_printed(p, sem, cut_too))
            for m, s, p in choices
        )
    }


@pytest.mark.slow
def test_the_numbers_that_fit_are_those_that_trying_finds(moments) -> None:
    for cell in PRINTED:
        for cut_too, ways in ((True, tuple(Digits)), (False, (Digits.ROUNDED,))):
            found = {n for n in numbers_that_fit(cell, ways) if n <= 17}
            assert found == tried(moments, cell, cut_too), (cell, cut_too)


def test_the_gym_also_fits_fewer_ratings_than_seventeen() -> None:
    # 52/14 = 3.714 and 42/13 = 3.231: ratings may be missing there.
    assert {n for n in numbers_that_fit(("gym", "ours")) if n <= 17} == {14, 17}
    assert {n for n in numbers_that_fit(("gym", "baseline")) if n <= 17} == {13, 17}
    assert 17 not in numbers_that_fit(("gym", "baseline"), (Digits.ROUNDED,))


def test_seventeen_is_the_one_number_that_all_cells_share() -> None:
    assert set.intersection(*(numbers_that_fit(cell) for cell in PRINTED)) == {17}

"""The section of the audit on Table 1 itself: which ratings can be behind its means and standard errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from evenlight.analysis.audit.audit_convention_words import conventions_in_words, known_in_words
from evenlight.analysis.audit.audit_conventions import (
    CONVENTIONS,
    SCORES,
    Counts,
    Printed,
    conventions_that_allow,
    possible_histograms,
)
from evenlight.analysis.audit.audit_ratings import OTHER_NUMBERS, VERSIONS, SequenceRatings, printed_cell
from evenlight.analysis.audit.audit_statistics import ALL, between, row
from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import SEQUENCES
from evenlight.analysis.report import Section, Table
from evenlight.analysis.wording import in_words, listed, spaced
from evenlight.data_schema.statistic import Statistic

ENUMERATED = "every histogram of ratings from 1 to 5, compared in whole numbers"
CELLS = tuple((sequence, version) for sequence in SEQUENCES for version in VERSIONS)


def distribution_statistics(ratings: Sequence[SequenceRatings]) -> tuple[Statistic, ...]:
    """Return what the printed numbers fix, cell by cell, and which conventions allow them."""
    rows = [s for r in ratings for version in VERSIONS for s in _of_cell(r, version)]
    for convention in CONVENTIONS:
        allowed = sum(convention in conventions_that_allow(printed_cell(*cell)) for cell in CELLS)
        rows.append(
            row("conventions", ALL, f"cells allowed: {convention}", allowed, n=len(CELLS), method=ENUMERATED)
        )
    for n in OTHER_NUMBERS:
        cells = [printed_cell(*cell) for cell in CELLS]
        fitting = sum(len(possible_histograms(Printed(c.mean, c.sem, n))) > 0 for c in cells)
        what = f"cells possible for {n} people"
        rows.append(
            row(
                "numbers_of_people",
                ALL,
                what,
                fitting,
                n=n,
                method=f"any of the {len(CONVENTIONS)} conventions",
            )
        )
    return tuple(rows)


def _of_cell(ratings: SequenceRatings, version: str) -> list[Statistic]:
    """Return what is known of the ratings of one version of a sequence."""
    histograms = ratings.baseline if version == "baseline" else ratings.ours
    group = f"{ratings.sequence}, {version}"
    totals, squares = histograms @ SCORES, histograms @ SCORES**2
    spreads = np.sqrt((squares - totals**2 / ratings.n) / (ratings.n - 1))
    facts: tuple[tuple[str, ArrayLike, str], ...] = (
        ("distributions that agree", len(histograms), ENUMERATED),
        ("mean rating", totals / ratings.n, "sum of the ratings over their number"),
        ("sum of the ratings", totals, ENUMERATED),
        ("sum of the squared ratings", squares, ENUMERATED),
        ("sample SD", spreads, "from the sums, n - 1"),
        ("SEM of the sample SD", spreads / np.sqrt(ratings.n), "from the sums, n - 1"),
        ("SEM of the population SD", spreads * np.sqrt(1 - 1 / ratings.n) / np.sqrt(ratings.n), "over n"),
    )
    return [_known(group, what, values, ratings.n, method) for what, values, method in facts]


def _known(group: str, what: str, values: ArrayLike, n: int, method: str) -> Statistic:
    """Return a number that agrees with the table; with bounds and a flag where several do."""
    low, high = float(np.min(values)), float(np.max(values))
    if low == high:
        return row("distributions", group, what, low, n=n, method=method)
    return row("distributions", group, what, (low + high) / 2, ci_low=low, ci_high=high, interval=1.0, n=n,
               method=method, flag="the digits allow several")  # fmt: skip


def distribution_section(
    ratings: Sequence[SequenceRatings], statistics: Sequence[Statistic], drawing: Drawing
) -> Section:
    """Return the section."""
    people = [s for s in statistics if s.table == "numbers_of_people"]
    complete, n = complete_numbers(statistics), ratings[0].n
    most = max(int(s.value or 0) for s in people if s.n not in complete)
    return Section(
        "Which ratings can be behind Table 1",
        paragraphs=(
            f"A mean of {n} whole numbers from 1 to 5, printed with two digits, names their sum; a standard "
            f"error nearly names the sum of their squares. Every histogram of {n} ratings was tried against "
            "every convention: digits rounded or cut off, standard deviation of the sample (n - 1) or of "
            "the population (n).",
            f"All {len(CELLS)} cells are possible for {_numbers(complete)} people and for no other number "
            f"from {people[0].n} to {people[-1].n} (the next best explains {most} cells): nobody's ratings "
            f"are missing. {known_in_words(ratings)}",
            conventions_in_words(ratings),
        ),
        tables=(_cell_table(ratings, statistics), _convention_table(statistics)),
        pictures=(drawing.picture,),
    )


def complete_numbers(statistics: Sequence[Statistic]) -> list[int]:
    """Return the numbers of people that fit every cell."""
    people = (s for s in statistics if s.table == "numbers_of_people" and s.value == len(CELLS))
    return [s.n for s in people if s.n is not None]


def _numbers(numbers: Sequence[int]) -> str:
    """Return numbers in words."""
    return listed([str(n) for n in numbers]) if numbers else "no number of"


def _cell_table(ratings: Sequence[SequenceRatings], statistics: Sequence[Statistic]) -> Table:
    """Return the table of what each cell fixes."""
    rows = []
    for r in ratings:
        for version in VERSIONS:
            group, printed = f"{r.sequence}, {version}", printed_cell(r.sequence, version)
            own = {s.what: s for s in statistics if s.table == "distributions" and s.group == group}
            facts = ("sum of the ratings", "sum of the squared ratings", "SEM of the sample SD",
                     "SEM of the population SD", "distributions that agree")  # fmt: skip
            cells = [_bounds(own[what], "d" if what.startswith(("sum", "dist")) else ".4f") for what in facts]
            rows.append((in_words(r.sequence), version, f"{printed.mean} ± {printed.sem}", *cells))
    return Table(
        f"What each printed mean with its standard error fixes (n = {ratings[0].n} ratings)",
        ("sequence", "version", "printed", "sum", "sum of squares", "SEM, n - 1", "SEM, n", "histograms"),
        tuple(rows),
    )


def _bounds(statistic: Statistic, form: str) -> str:
    """Return a number, or its bounds."""
    low = statistic.value if statistic.ci_low is None else statistic.ci_low
    high = statistic.value if statistic.ci_high is None else statistic.ci_high
    if form == "d":
        return str(int(low or 0)) if low == high else f"{low:.0f} or {high:.0f}"  # squares keep their parity
    return between(format(low or 0.0, form), format(high or 0.0, form))


def _convention_table(statistics: Sequence[Statistic]) -> Table:
    """Return the table of how many cells each convention allows."""
    rows = []
    for convention in CONVENTIONS:
        own = next(s for s in statistics if s.what == f"cells allowed: {convention}")
        failing = [
            f"{spaced(sequence)} {version}"
            for sequence, version in CELLS
            if convention not in conventions_that_allow(printed_cell(sequence, version))
        ]
        rows.append((str(convention), f"{own.value:.0f} of {own.n}", ", ".join(failing)))
    rows.sort(key=lambda cells: cells[1], reverse=True)
    return Table("Cells of Table 1 that each convention allows", ("convention", "cells", "not"), tuple(rows))


def possible_counts(histograms: Counts) -> tuple[Counts, Counts]:
    """Return the fewest and the most people that can have given each rating, (5,) each.

    >>> low, high = possible_counts(np.array([[0, 0, 3, 6, 8], [0, 1, 0, 9, 7]]))
    >>> low.tolist(), high.tolist()
    ([0, 0, 0, 6, 7], [0, 1, 3, 9, 8])
    """
    return histograms.min(axis=0), histograms.max(axis=0)

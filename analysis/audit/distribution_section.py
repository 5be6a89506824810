"""The section of the audit on Table 1 itself: which ratings can be behind its means and standard errors."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import ArrayLike

from evenlight.analysis.audit.conventions import (
    CONVENTIONS,
    SCORES,
    Convention,
    Digits,
    PrintedMean,
    conventions_that_allow,
)
from evenlight.analysis.audit.rows import ALL, AuditRows, audit_section, between, row
from evenlight.analysis.audit.table_ratings import VERSIONS, SequenceRatings, printed_cell
from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import SEQUENCES
from evenlight.analysis.report import Section, Table
from evenlight.analysis.wording import in_words, spaced
from evenlight.data_schema.analysis_results import Statistic

ENUMERATED = "every histogram of ratings from 1 to 5, compared in whole numbers"
TRIED = range(2, 31)  # numbers of ratings; the paper names 17 people
ROUNDED = (Digits.ROUNDED,)
CELLS = tuple((sequence, version) for sequence in SEQUENCES for version in VERSIONS)


def distribution_statistics(ratings: Sequence[SequenceRatings]) -> tuple[Statistic, ...]:
    """Return what the printed numbers fix, cell by cell, and which conventions allow them."""
    rows = [s for r in ratings for version in VERSIONS for s in _cell_rows(r, version)]
    for convention in CONVENTIONS:
        allowed = sum(convention in conventions_that_allow(printed_cell(*cell)) for cell in CELLS)
        what = f"cells allowed: {convention}"
        rows.append(row("conventions", ALL, what, allowed, n=len(CELLS), method=ENUMERATED))
    return (*rows, *(s for n in TRIED for s in _rows_of_number(n)))


def _rows_of_number(n: int) -> list[Statistic]:
    """Return which cells so many ratings can be behind, and under how many conventions."""
    allowed = {cell: len(conventions_of(cell, n)) for cell in CELLS}
    what, method = f"conventions under which {n} ratings fit", f"of {len(CONVENTIONS)}; {ENUMERATED}"
    cells = [row("numbers_of_ratings", ", ".join(c), what, k, n=n, method=method) for c, k in allowed.items()]
    fitting = sum(k > 0 for k in allowed.values())
    what, method = f"cells possible for {n} people", f"any of the {len(CONVENTIONS)} conventions"
    return [*cells, row("numbers_of_people", ALL, what, fitting, n=n, method=method)]


def conventions_of(cell: tuple[str, str], n: int) -> tuple[Convention, ...]:
    """Return the conventions under which some n ratings would be printed as a cell of the table."""
    printed = printed_cell(*cell)
    return conventions_that_allow(PrintedMean(printed.mean, printed.sem, n))


def numbers_that_fit(cell: tuple[str, str], digits: Collection[Digits] = tuple(Digits)) -> set[int]:
    """Return which numbers of ratings fit a cell, where every digit was treated in one of some ways."""
    return {n for n in TRIED if any({c.mean, c.sem} <= set(digits) for c in conventions_of(cell, n))}


def _cell_rows(ratings: SequenceRatings, version: str) -> list[Statistic]:
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


def distribution_section(rows: AuditRows, n: int, drawing: Drawing) -> Section:
    """Return the section, about n people."""
    fitting = {s.n: int(s.value or 0) for s in rows.statistics if s.table == "numbers_of_people"}
    allowed = {s.what.partition(": ")[2]: s.value or 0.0 for s in rows.statistics if s.table == "conventions"}
    known = [f"{s}, {v}" for s, v in CELLS if s != "gym"]
    alone = [cell for cell in CELLS if numbers_that_fit(cell) & set(range(n + 1)) == {n}]
    return audit_section(
        "ratings",
        rows,
        (_number_table(), _cell_table(rows, n), _convention_table(rows)),
        (drawing,),
        n=n,
        tried=TRIED,
        fits_all=[str(people) for people, cells in fitting.items() if cells == len(CELLS)],
        next_best=max(cells for people, cells in fitting.items() if people != n),
        alone=[f"{spaced(s)}, {v}" for s, v in alone],
        fewer={c: [str(k) for k in sorted(numbers_that_fit(c)) if k < n] for c in CELLS},
        rounded={c: [str(k) for k in sorted(numbers_that_fit(c, ROUNDED))] for c in CELLS},
        histograms=[int(rows.number("distributions", g, "distributions that agree")) for g in known],
        cell_count=len(CELLS),
        best=[name for name, cells in allowed.items() if cells == max(allowed.values())],
        printed=printed_cell,
    )


def _number_table() -> Table:
    """Return the table of the numbers of ratings that fit, cell by cell and all together."""
    ways = (tuple(Digits), ROUNDED)
    fitting = [[numbers_that_fit(cell, way) for way in ways] for cell in CELLS]
    lines = [
        (in_words(cell[0]), cell[1], *(", ".join(map(str, sorted(numbers))) or "none" for numbers in two))
        for cell, two in zip(CELLS, fitting, strict=True)
    ]
    joint = (", ".join(map(str, sorted(set.intersection(*k)))) or "none" for k in zip(*fitting, strict=True))
    return Table(
        f"Numbers of ratings, {TRIED[0]} to {TRIED[-1]}, of which some would be printed like the cell",
        ("sequence", "version", "n that fit, digits rounded or cut off", "n that fit, digits rounded"),
        (*lines, ("All cells, one n", "", *joint)),
    )


def _cell_table(rows: AuditRows, n: int) -> Table:
    """Return the table of what each cell fixes."""
    facts = {"sum of the ratings": "d", "sum of the squared ratings": "d", "SEM of the sample SD": ".4f",
             "SEM of the population SD": ".4f", "distributions that agree": "d"}  # fmt: skip
    lines = []
    for sequence, version in CELLS:
        printed = printed_cell(sequence, version)
        group = f"{sequence}, {version}"
        cells = [_bounds(rows.of("distributions", group, what), form) for what, form in facts.items()]
        lines.append((in_words(sequence), version, f"{printed.mean} ± {printed.sem}", *cells))
    return Table(
        f"What each printed mean with its standard error fixes (n = {n} ratings)",
        ("sequence", "version", "printed", "sum", "sum of squares", "SEM, n - 1", "SEM, n", "histograms"),
        tuple(lines),
    )


def _bounds(statistic: Statistic, form: str) -> str:
    """Return a number, or its bounds."""
    low = statistic.value if statistic.ci_low is None else statistic.ci_low
    high = statistic.value if statistic.ci_high is None else statistic.ci_high
    if form == "d":
        return str(int(low or 0)) if low == high else f"{low:.0f} or {high:.0f}"  # squares keep their parity
    return between(format(low or 0.0, form), format(high or 0.0, form))


def _convention_table(rows: AuditRows) -> Table:
    """Return the table of how many cells each convention allows."""
    lines = []
    for convention in CONVENTIONS:
        own = rows.of("conventions", ALL, f"cells allowed: {convention}")
        failing = [
            f"{spaced(sequence)} {version}"
            for sequence, version in CELLS
            if convention not in conventions_that_allow(printed_cell(sequence, version))
        ]
        lines.append((str(convention), f"{own.value:.0f} of {own.n}", ", ".join(failing)))
    lines.sort(key=lambda cells: cells[1], reverse=True)
    return Table("Cells of Table 1 that each convention allows", ("convention", "cells", "not"), tuple(lines))

"""What the numbers printed in the paper support by themselves: the tables of docs/audit.md.

    python examples/paper_audit.py                    # the tables, as Markdown
    python examples/paper_audit.py docs/pictures      # and audit-pairings.png in that folder

No data are read but the printed numbers (`evenlight.analysis.published`). What counts as possible, and why,
is on the page.
"""

from __future__ import annotations

import enum
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal
from functools import cache
from itertools import combinations, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from evenlight.analysis.inference.binomial_tests import (
    answers_for_equivalence,
    answers_to_find,
    bayes_factor,
    clopper_pearson,
    difference_power,
    exact_p,
    lower_critical,
    smallest_margin,
    smallest_share_found,
)
from evenlight.analysis.inference.exact_tests import holm, sign_flip_p_values
from evenlight.analysis.published import SEQUENCES, published, published_values
from evenlight.analysis.wording import p_text, spaced

Counts = NDArray[np.int64]  # histograms, one in each row
Range = tuple[float, float]
Cells = list[str]
VERSIONS = ("baseline", "ours")
CELLS = tuple(product(SEQUENCES, VERSIONS))  # of Table 1
SCORES = np.arange(1, 6)  # ratings
DIFFERENCES = np.arange(-4, 5)  # of two ratings, ours less baseline
PEOPLE = int(published("participants.viewing").number)
TRIED = range(2, 31)  # numbers of ratings behind a cell; the paper names 17 people
ALPHA = 0.05
POWER = 0.8


# --- Which ratings can be behind a printed mean and standard error


class Convention(NamedTuple):
    """How a table may have been printed: digits rounded or cut off, SD over n - 1 or over n."""

    mean_cut_off: bool
    population: bool
    sem_cut_off: bool

    def __str__(self) -> str:
        mean, sem = ("cut off" if cut else "rounded" for cut in (self.mean_cut_off, self.sem_cut_off))
        return f"means {mean}, SEM of the {'population' if self.population else 'sample'} SD {sem}"


CONVENTIONS = tuple(Convention(*parts) for parts in product((False, True), repeat=3))
ROUNDED = tuple(c for c in CONVENTIONS if not c.mean_cut_off and not c.sem_cut_off)


@cache
def all_histograms(n: int) -> Counts:
    """Return every histogram of n ratings from 1 to 5: four bars among n stars, (histograms, 5)."""
    bars = np.array(list(combinations(range(n + 4), 4)))
    edges = np.column_stack([np.full(len(bars), -1), bars, np.full(len(bars), n + 4)])
    return np.diff(edges, axis=1) - 1


def whole(text: str) -> tuple[int, int]:
    """Return printed digits as a whole number, and what it is to be divided by: "3.59" is 359, 100."""
    decimals = max(-int(Decimal(text).as_tuple().exponent), 0)
    return int(Decimal(text).scaleb(decimals)), 10**decimals


def matches(mean: str, sem: str, histograms: Counts, convention: Convention) -> NDArray[np.bool_]:
    """Return which histograms would be printed so, (histograms,); a half may have been rounded either way.

    In whole numbers nothing is lost: with S and Q the sums of n ratings and of their squares, the mean is
    S / n, and the squared standard error (nQ - S²) / (n²(n - 1)), or over n³ for the population.
    """
    n = int(histograms[0].sum())
    total, squares = histograms @ SCORES, histograms @ SCORES**2
    digits, scale = whole(mean)
    if convention.mean_cut_off:
        fits = (digits * n <= scale * total) & (scale * total < (digits + 1) * n)
    else:
        fits = np.abs(2 * scale * total - 2 * digits * n) <= n
    digits, scale = whole(sem)
    divisor = n**3 if convention.population else n**2 * (n - 1)
    square = scale**2 * (n * squares - total**2)
    if convention.sem_cut_off:
        return np.asarray(fits & (digits**2 * divisor <= square) & (square < (digits + 1) ** 2 * divisor))
    low, high = max(2 * digits - 1, 0), 2 * digits + 1
    return np.asarray(fits & (low**2 * divisor <= 4 * square) & (4 * square <= high**2 * divisor))


def printed(sequence: str, version: str) -> tuple[str, str]:
    """Return mean and standard error of a cell of Table 1, as printed."""
    name = f"detail_quality.{sequence}.{version}"
    return published(f"{name}_mean").text, published(f"{name}_sem").text


@cache
def conventions_that_allow(cell: tuple[str, str], n: int = PEOPLE) -> tuple[Convention, ...]:
    """Return the conventions under which some n ratings would be printed as a cell."""
    histograms = all_histograms(n)
    return tuple(c for c in CONVENTIONS if matches(*printed(*cell), histograms, c).any())


def numbers_that_fit(cell: tuple[str, str], conventions: Collection[Convention] = CONVENTIONS) -> set[int]:
    """Return of how many ratings a cell can be, where conventions may differ from cell to cell."""
    return {n for n in TRIED if set(conventions_that_allow(cell, n)) & set(conventions)}


@cache
def possible_histograms(sequence: str, version: str) -> Counts:
    """Return all histograms of 17 ratings that agree with a cell, under one convention or another."""
    histograms = all_histograms(PEOPLE)
    allowed = [matches(*printed(sequence, version), histograms, c) for c in CONVENTIONS]
    return histograms[np.any(allowed, axis=0)]


# --- What paired tests can come to, over every pairing

BITS = 5  # of a packed count
MOST_PEOPLE = 2**BITS - 1
CHANGES = DIFFERENCES[DIFFERENCES != 0]
FIRST_CHANGE = BITS * 4  # below it lie the counts of all columns but the last


def reachable_differences(baseline: Counts, ours: Counts) -> Counts:
    """Return every histogram of the differences that some pairing of the ratings gives, (histograms, 9).

    The joint tables are built row by row. All that a half-built table decides about the rest is how much of
    each column is used and how often each difference has occurred; tables that agree in both are kept once.
    Both are packed into one whole number, so that adding a row is adding a number.

    >>> one, other = np.array([[1, 1, 0, 0, 0]]), np.array([[0, 1, 1, 0, 0]])  # 1, 2 and 2, 3
    >>> reachable_differences(one, other)[:, 4:7].tolist()  # of 0, 1, 2: 1 twice; or 0 and 2
    [[0, 2, 0], [1, 0, 1]]
    """
    n = int(baseline[0].sum())
    packed = np.unique(np.concatenate([_reachable(rows, ours) for rows in baseline]))
    changes = (packed[:, None] >> (BITS * np.arange(CHANGES.size))) & MOST_PEOPLE
    return np.insert(changes, 4, n - changes.sum(axis=1), axis=1)


def _reachable(rows: Counts, columns: Counts) -> NDArray[np.int64]:
    """Return the packed counts of differences of all tables with these row sums and one of the columns'."""
    states, used = np.zeros(1, dtype=np.int64), 0
    *others, last = np.argsort(rows, kind="stable")  # in the fullest row the columns leave no choice
    for row in others:
        cells = all_histograms(int(rows[row]))
        cells = cells[(cells <= columns.max(axis=0)).all(axis=1)]
        used += int(rows[row])
        states = np.unique((states[:, None] + _packed(cells, row)).ravel())
        left = columns[:, None] - _columns_used(states, used)
        states = states[(left >= 0).all(axis=2).any(axis=0)]
    left = columns[:, None] - _columns_used(states, used)
    final = [(states + _packed(cells, last))[(cells >= 0).all(axis=1)] for cells in left]
    return np.unique(np.concatenate(final) >> FIRST_CHANGE)


def _packed(cells: Counts, row: int) -> NDArray[np.int64]:
    packed = (cells[:, :-1] << (BITS * np.arange(4))).sum(axis=1)
    for column in range(5):
        if column != row:
            change = int(np.searchsorted(CHANGES, column - row))
            packed = packed + (cells[:, column] << (FIRST_CHANGE + BITS * change))
    return np.asarray(packed)


def _columns_used(states: NDArray[np.int64], used: int) -> Counts:
    columns = (states[:, None] >> (BITS * np.arange(4))) & MOST_PEOPLE
    return np.column_stack([columns, used - columns.sum(axis=1)])


class PairedTest(enum.Enum):
    """A two-sided test of paired differences; all but the first are exact."""

    T = "t test"
    SIGN_FLIP = "sign-flip test of the mean"
    SIGNED_RANK = "signed ranks, zeros ranked"
    SIGNED_RANK_DROPPED = "signed ranks, zeros dropped"
    SIGN = "sign test"


def p_values(differences: Counts, test: PairedTest) -> NDArray[np.float64]:
    """Return the two-sided p of sets of differences, (sets, n) -> (sets,); NaN for a t test of equal ones.

    Signed ranks are scores whose signs may flip, and so are signs alone: one enumeration serves all.
    """
    n, signs = differences.shape[1], np.sign(differences)
    if test is PairedTest.T:
        total, squares = differences.sum(axis=1), (differences**2).sum(axis=1)
        spread = n * squares - total**2  # n (n - 1) times the variance: whole, 0 only if all are alike
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.abs(total) * np.sqrt((n - 1) / spread)
        return np.where(spread > 0, 2 * special.stdtr(n - 1, -t), np.nan)
    if test in (PairedTest.SIGN, PairedTest.SIGN_FLIP):
        return sign_flip_p_values(signs if test is PairedTest.SIGN else differences)
    ranks = stats.rankdata(np.abs(differences), axis=1)
    if test is PairedTest.SIGNED_RANK_DROPPED:  # zeros have the lowest ranks: without them all others sink
        ranks = ranks - (differences == 0).sum(axis=1, keepdims=True)
    return sign_flip_p_values(np.rint(2 * ranks) * signs)  # midranks are halves


def counted_out(counts: Counts) -> Counts:
    """Return the differences that histograms of them count, in rising order, (histograms, n)."""
    ends = np.cumsum(counts, axis=1)
    return DIFFERENCES[(ends[:, :, None] <= np.arange(ends[0, -1])).sum(axis=1)]


@cache
def p_ranges() -> dict[PairedTest, list[Range]]:
    """Return the smallest and largest p of each test over all pairings, of the sequences in their order."""
    found: dict[PairedTest, list[Range]] = {test: [] for test in PairedTest}
    for name in SEQUENCES:
        sides = (possible_histograms(name, version) for version in VERSIONS)
        differences = counted_out(reachable_differences(*sides))
        for test in PairedTest:
            p = p_values(differences, test)
            found[test].append((float(np.nanmin(p)), float(np.nanmax(p))))
    return found


def with_holm(ranges: Sequence[Range]) -> list[Range]:
    """Return ranges of p with Holm's (1979) correction for their number.

    A p that is corrected so never falls when any of the p rises, and each pairing is free: the smallest
    come together from all the smallest, the largest from all the largest.
    """
    lows, highs = (holm([p[end] for p in ranges]) for end in (0, 1))
    return [(float(low or 0), float(high or 0)) for low, high in zip(lows, highs, strict=True)]


def verdict(p: Range) -> str:
    """Return what holds for every pairing at 5 %; p of exactly 5 % is enough."""
    if p[1] <= ALPHA:
        return "**differs, whatever the pairing**"
    return "depends on the pairing" if p[0] <= ALPHA else "not shown by any pairing"


def mean_difference(sequence: str) -> float:
    """Return the mean of ours less the baseline's, which no pairing changes [rating points]."""
    baseline, ours = (possible_histograms(sequence, v)[0] @ SCORES for v in VERSIONS)
    return float(ours - baseline) / PEOPLE


def correlations(sequence: str) -> tuple[Range, Range]:
    """Return which correlations within people are possible, and from which ones on a t test finds 5 %.

    The variance of the differences is s₁² + s₂² - 2 r s₁ s₂, and t is the mean difference over its standard
    error: the correlation r is all that the table lacks.
    """
    reach, needed = [], []
    critical = float(special.stdtrit(PEOPLE - 1, 1 - ALPHA / 2))
    for one, other in product(*(possible_histograms(sequence, v) for v in VERSIONS)):
        first, second = np.repeat(SCORES, one), np.repeat(SCORES, other)
        spreads = first.std(ddof=1), second.std(ddof=1)
        largest_variance = PEOPLE * ((second.mean() - first.mean()) / critical) ** 2
        needed.append((spreads[0] ** 2 + spreads[1] ** 2 - largest_variance) / (2 * spreads[0] * spreads[1]))
        # Sorted alike, and against each other: extremes of a sum of products (Hardy et al. 1934).
        reach += [np.corrcoef(first, order)[0, 1] for order in (second, second[::-1])]
    return (float(min(reach)), float(max(reach))), (float(min(needed)), float(max(needed)))


def unrelated_interval() -> tuple[float, Range]:
    """Return the mean difference over all sequences, and its 95 % interval if ratings were unrelated."""
    mean = float(np.mean([mean_difference(name) for name in SEQUENCES]))
    variances = [max(np.repeat(SCORES, h).var(ddof=1) for h in possible_histograms(*cell)) for cell in CELLS]
    error = float(np.sqrt(sum(variances) / PEOPLE)) / len(SEQUENCES)
    half = float(special.stdtrit(PEOPLE - 1, 1 - ALPHA / 2)) * error
    return mean, (mean - half, mean + half)


@cache
def least_even_totals() -> Counts:
    """Return the participants' sums of differences over the sequences, as uneven as they can be, (n,).

    They are that where all ratings of ours rise and all of the baseline fall from person to person, which
    makes every covariance as large as it can be. All choices of histograms are tried; of equal sums, one.
    """
    sums = np.zeros((1, PEOPLE), dtype=np.int64)
    for name, version in CELLS:
        sign = 1 if version == "ours" else -1
        side = np.sort([sign * np.repeat(SCORES, h) for h in possible_histograms(name, version)], axis=1)
        sums = np.unique((sums[:, None, :] + side[None, :, :]).reshape(-1, PEOPLE), axis=0)
    return np.asarray(sums[np.argmax((sums**2).sum(axis=1))])


# --- Choices and powers


def counts_printed_as(text: str, n: int = PEOPLE) -> list[int]:
    """Return the counts of n whose percentage, rounded or cut off, is printed so.

    >>> counts_printed_as("53", 17), counts_printed_as("53", 16)
    ([9], [])
    """
    shares = [Decimal(100 * k) / n for k in range(n + 1)]
    ways = (ROUND_HALF_UP, ROUND_DOWN)
    return [k for k, share in enumerate(shares) if text in {str(share.quantize(Decimal(1), w)) for w in ways}]


def chosen() -> dict[str, int]:
    """Return how many of 17 chose ours, sequence by sequence."""
    texts = {name: published(f"detail_quality.{name}.chosen_percent").text for name in SEQUENCES}
    return {name: count for name, text in texts.items() for count in counts_printed_as(text)}


def line_luminance(power: float) -> float:
    """Return the luminance at which the printed line P(L) has a power [cd/m^2].

    >>> round(line_luminance(1.800))  # (1.800 - 0.2945) / 0.001858
    810
    """
    return (power - published("power_model.base").number) / published("power_model.slope").number


def samples() -> tuple[list[float], list[float]]:
    """Return luminance [cd/m^2] and power [W] of the samples in the authors' program, both rising."""
    own = published_values("authors_power")[::-1]
    voltage = published("authors_power.voltage").number
    luminance = [value.number for value in own if value.name.endswith(".luminance")]
    return luminance, [voltage * value.number for value in own if value.name.endswith(".current")]


def nominal_line() -> tuple[float, float, float]:
    """Return a line's power at factors 0 and 1, through the baseline's four, and its largest miss [W]."""
    factors = [published(f"adaptation.{name}.factor").number for name in SEQUENCES]
    powers = [published(f"power.{name}.baseline").number for name in SEQUENCES]
    slope, base = np.polyfit(factors, powers, 1)
    miss = np.abs(np.polyval([slope, base], factors) - powers).max()
    return float(base), float(base + slope), float(miss)


# --- The tables


def between(ends: Iterable[str]) -> str:
    """Return a range in words; one number where both ends are written alike."""
    return " to ".join(dict.fromkeys(ends))


def named(cell: tuple[str, str]) -> str:
    """Return the name of a cell of Table 1, or of Table 3."""
    return f"{spaced(cell[0])}, {cell[1]}"


def short_p(p: float) -> str:
    """Return a p value with two significant digits, or that it is smaller than 0.0001."""
    return "< 0.0001" if p < 0.0001 else f"{p:.2g}"


def numbers_table() -> Iterator[Cells]:
    """Yield of how many ratings each cell can be."""
    yield ["cell", "printed", "n that fit, digits rounded or cut off", "n that fit, digits rounded"]
    fitting = [[numbers_that_fit(cell, ways) for ways in (CONVENTIONS, ROUNDED)] for cell in CELLS]
    for cell, numbers in zip(CELLS, fitting, strict=True):
        yield [
            named(cell),
            " ± ".join(printed(*cell)),
            *(", ".join(map(str, sorted(own))) for own in numbers),
        ]
    shared = [set.intersection(*both) for both in zip(*fitting, strict=True)]
    yield ["all cells, one n", "", *(", ".join(map(str, sorted(own))) or "none" for own in shared)]


def cells_table() -> Iterator[Cells]:
    """Yield what each cell fixes, if it is of 17 ratings."""
    yield ["cell", "sum", "sum of squares", "SEM, n - 1", "SEM, n", "histograms"]
    for name, version in CELLS:
        histograms = possible_histograms(name, version)
        totals, squares = histograms @ SCORES, histograms @ SCORES**2
        sem = np.sqrt((squares - totals**2 / PEOPLE) / (PEOPLE - 1) / PEOPLE)
        fixed = [" or ".join(map(str, np.unique(own).tolist())) for own in (totals, squares)]
        errors = [
            between(f"{end:.4f}" for end in (own.min(), own.max()))
            for own in (sem, sem * np.sqrt(1 - 1 / PEOPLE))
        ]
        yield [named((name, version)), *fixed, *errors, str(len(histograms))]


def conventions_table() -> Iterator[Cells]:
    """Yield how many cells each convention allows."""
    yield ["convention", "cells", "not"]
    failing = {c: [cell for cell in CELLS if c not in conventions_that_allow(cell)] for c in CONVENTIONS}
    for convention, cells in sorted(failing.items(), key=lambda item: len(item[1])):
        names = ", ".join(f"{spaced(name)} {version}" for name, version in cells)
        yield [str(convention), f"{len(CELLS) - len(cells)} of {len(CELLS)}", names]


def pairings_table() -> Iterator[Cells]:
    """Yield what the main tests can come to."""
    yield ["sequence", "mean difference", "sign-flip test", "t test", "t test, Holm",
           "correlation that p < 0.05 needs", "at 5 %, by itself"]  # fmt: skip
    flips, t = p_ranges()[PairedTest.SIGN_FLIP], p_ranges()[PairedTest.T]
    for name, flip, plain, corrected in zip(SEQUENCES, flips, t, with_holm(t), strict=True):
        reach, needed = correlations(name)
        words = between(f"{end:.2f}" for end in needed)
        if needed[1] < reach[0]:
            words = "any"
        elif needed[0] > reach[1]:
            words = "none possible"
        tests = [between(map(short_p, p)) for p in (flip, plain, corrected)]
        yield [spaced(name), f"{mean_difference(name):.2f}", *tests, words, verdict(flip)]


def tests_table() -> Iterator[Cells]:
    """Yield the range of p of every test, and with Holm's correction."""
    yield ["test", *map(spaced, SEQUENCES), *(f"{spaced(name)}, Holm" for name in SEQUENCES)]
    for test, ranges in p_ranges().items():
        yield [test.value, *(between(map(short_p, p)) for p in (*ranges, *with_holm(ranges)))]


def overall_table() -> Iterator[Cells]:
    """Yield what holds over all sequences."""
    yield ["over all sequences", ""]
    mean, interval = unrelated_interval()
    yield ["mean difference", f"{mean:.2f}"]
    ends = between(f"{end:.2f}" for end in interval)
    yield ["95 % CI if a person's eight ratings were unrelated", ends]
    (largest,) = p_values(least_even_totals()[None, :], PairedTest.T)
    yield ["largest p of the t test of the participants' means, over all pairings", short_p(largest)]


def choices_table() -> Iterator[Cells]:
    """Yield what the counts of choices say, and what they could have said."""
    yield ["sequence", "count", "95 % CI", "p, one half", "margin shown", "Bayes factor for one half"]
    counts = chosen()
    asked = [(spaced(name), count, PEOPLE) for name, count in counts.items()]
    asked.append(("all, if independent", sum(counts.values()), PEOPLE * len(counts)))
    for name, count, n in asked:
        ends = between(f"{end:.2f}" for end in clopper_pearson(count, n))
        margin = f"±{smallest_margin(count, n):.2f}"
        p = p_text(exact_p(count, n)) or ""
        yield [name, f"{count} of {n}", ends, p, margin, f"{bayes_factor(count, n):.1f}"]


def needed_table() -> Iterator[Cells]:
    """Yield what so many answers can show."""
    yield ["answers", ""]
    few = int(lower_critical(PEOPLE))
    yield [f"fewest of {PEOPLE} that differ from one half", str(PEOPLE - few)]
    yield [
        f"power of {PEOPLE} for a true share of 0.75",
        f"{100 * float(difference_power(PEOPLE, 0.75)):.0f} %",
    ]
    yield [f"share that {PEOPLE} find with 80 % power", f"{smallest_share_found(PEOPLE, POWER):.2f}"]
    for margin in (0.05, 0.1, 0.15):
        equal, other = answers_for_equivalence(margin, POWER), answers_to_find(0.5 + margin, POWER)
        yield [f"needed to show equivalence within ±{margin:.2f}, or to find {0.5 + margin:.2f}",
               f"{equal}; {other}"]  # fmt: skip
    even = [1 - 2 * stats.binom.sf(max(k, PEOPLE - k), PEOPLE, 0.5) for k in chosen().values()]
    yield ["chance that coins fall so even four times", f"{100 * float(np.prod(even)):.1f} %"]


def powers_table() -> Iterator[Cells]:
    """Yield the brightness factor that each power stands for, read in three ways."""
    yield ["sequence", "printed [W]", "on P(L) [cd/m²]", "nominal factor", "of Table 3's full brightness",
           "of 750 cd/m²", "between the samples"]  # fmt: skip
    luminance, power = samples()
    for name, version in product(SEQUENCES, (*VERSIONS, "full")):
        value = published(f"power.{name}.{version}")
        light = line_luminance(value.number)
        cells = [named((name, version)), value.text, f"{light:.0f}"]
        if version == "full":
            yield [*cells, "1", "1", *["beyond the samples"] * 2]
            continue
        full = line_luminance(published(f"power.{name}.full").number)
        read = float(np.interp(value.number, power, luminance))
        factors = [light / full, light / luminance[-1], read / luminance[-1]]
        yield [*cells, published(f"adaptation.{name}.factor").text, *(f"{own:.2f}" for own in factors)]


def power_facts_table() -> Iterator[Cells]:
    """Yield what else Table 3 and Equation 7 come to."""
    yield ["power", ""]
    slope, base = np.polyfit(*samples(), 1)
    yield ["line through the samples", f"{slope:.6f} L + {base:.4f} W"]
    printed_line = [published(f"power_model.{part}").text for part in ("slope", "base")]
    yield ["line as printed", "{} L + {} W".format(*printed_line)]
    _, at_full, miss = nominal_line()
    yield ["largest miss of a line through the baseline's four powers", f"{1000 * miss:.0f} mW"]
    yield ["that line at full brightness", f"{at_full:.2f} W"]
    for name in SEQUENCES:
        ours, baseline = (published(f"power.{name}.{v}").number for v in ("ours", "baseline"))
        more = f"{1000 * (ours - baseline):+.0f} mW ({100 * (ours / baseline - 1):+.1f} %)"
        yield [f"{spaced(name)}, ours less baseline", more]


def other_table() -> Iterator[Cells]:
    """Yield what follows from the numbers on adaptation and online control."""
    yield ["adaptation and online control", ""]
    for name in SEQUENCES:
        held, free = (published(f"adaptation.{name}.{c}").number for c in ("constrained", "unconstrained"))
        yield [f"{spaced(name)}: lag within the rate limit, share of that without", f"{held / free:.2f}"]
    ours, baseline = (published(f"online.sd_{v}").number for v in ("ours", "baseline"))
    ends = between(f"{(ours - s * 0.005) / (baseline + s * 0.005):.2f}" for s in (1, -1))
    yield [
        "SD of contrast loss, ours over baseline (by the printed digits)",
        f"{ours / baseline:.2f} ({ends})",
    ]


TABLES: dict[str, Callable[[], Iterator[Cells]]] = {
    "Which ratings can be behind Table 1: numbers of ratings": numbers_table,
    "What each cell fixes, of 17 ratings": cells_table,
    "Cells that each convention allows": conventions_table,
    "What the pairing decides: p over all pairings, two-sided": pairings_table,
    "Every test, over all pairings": tests_table,
    "All sequences": overall_table,
    "53 % and 47 %": choices_table,
    "What so many answers can show": needed_table,
    "The table of powers": powers_table,
    "Power": power_facts_table,
    "Adaptation and online control": other_table,
}


def markdown(table: Iterator[Cells]) -> str:
    """Return a table in Markdown."""
    head, *rows = table
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


# --- The figure


def pairings_figure() -> Any:
    """Draw the range of p over all pairings, for each sequence and test."""
    from evenlight.analysis import figure_style as style

    colours = {"**": style.OURS, "de": style.PARTICIPANT, "no": style.LIMIT}
    words = ("at most 0.05 in any pairing", "depends on the pairing", "above 0.05 in any")
    em = style.PAGE.em
    with style.look(replace(style.PAGE, dots_per_inch=120.0)):
        title = "What paired tests of Table 1 can give, over all pairings that agree with it"
        about = (f"{PEOPLE} pairs. Thick: from the smallest to the largest two-sided p. Thin, below: with "
                 f"Holm's correction for {len(SEQUENCES)} sequences.")  # fmt: skip
        lines, above = style.heading_lines(title, about, style.PAGE.width - 2 * em, em)
        left, step, top = 17.5 * em, 1.85 * em, above + 2.6 * em
        height = step * len(SEQUENCES) * (len(PairedTest) + 0.8)
        figure = style.new_figure(top + height + 3.9 * em)
        style.lines_at(figure, em, lines)
        axes = style.axes_at(figure, left, top, style.PAGE.width - left - 1.6 * em, height)
        places = {}
        for k, name in enumerate(SEQUENCES):
            first = k * (len(PairedTest) + 0.8)
            style.text_at(
                figure, em, top + step * (first + 0.62), spaced(name).capitalize(), fontweight="bold"
            )
            for j, (test, ranges) in enumerate(p_ranges().items()):
                places[first + j] = test.value
                colour = colours[verdict(ranges[k])[:2]]
                for p, at, width in ((ranges[k], 0.0, 7), (with_holm(ranges)[k], 0.38, 1.5)):
                    axes.plot(p, [first + j + at] * 2, color=colour, lw=width, solid_capstyle="butt")
        for colour, key in zip(colours.values(), words, strict=True):
            axes.plot([], [], color=colour, lw=7, label=key)
        axes.axvline(ALPHA, color=style.INK, lw=1.2, ls="--", zorder=0.5)
        axes.set(xscale="log", xlim=(1e-7, 1.15), ylim=(max(places) + 0.8, -0.8), xlabel="two-sided p")
        axes.set_yticks(list(places), list(places.values()))
        ticks = {1e-7: "10⁻⁷", 1e-5: "10⁻⁵", 1e-3: "0.001", 0.01: "0.01", 0.05: "0.05", 0.2: "0.2", 1: "1"}
        axes.set_xticks(list(ticks), list(ticks.values()))
        axes.minorticks_off()
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x", color=style.FAINT, lw=0.6)
        axes.spines["left"].set_visible(False)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.01), ncols=3, columnspacing=1.2)
    return figure


def main(folder: str | None = None) -> None:
    """Print every table, and draw the figure into a folder if one is named."""
    for heading, table in TABLES.items():
        print(f"## {heading}\n\n{markdown(table())}\n")
    if folder is not None:
        from evenlight.analysis.figure_style import write_figure

        write_figure(Path(folder) / "audit-pairings.png", pairings_figure())


if __name__ == "__main__":
    main(*sys.argv[1:2])

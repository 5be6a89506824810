"""The audit of the paper's printed numbers, `examples/paper_audit.py`, and the page that shows its tables."""

import importlib.util
import math
import re
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal, localcontext
from itertools import combinations, permutations, product
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "audit.md").read_text()
TEXT = " ".join(PAGE.split())


def loaded() -> ModuleType:
    spec = importlib.util.spec_from_file_location("paper_audit", ROOT / "examples" / "paper_audit.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


audit = loaded()


@pytest.fixture(scope="module")
def tables() -> dict[str, str]:
    """What the script prints, by heading; it has run as a reader runs it."""
    return {heading: audit.markdown(table()) for heading, table in audit.TABLES.items()}


def cells(tables: dict[str, str], heading: str) -> dict[str, list[str]]:
    rows = [line.strip("| ").split(" | ") for line in tables[heading].splitlines()[2:]]
    return {first: rest for first, *rest in rows}


def test_the_script_prints_its_tables_and_draws_its_figure(tables, capsys, tmp_path: Path) -> None:
    audit.main(str(tmp_path))
    printed = capsys.readouterr().out
    assert all(f"## {heading}\n\n{table}\n" in printed for heading, table in tables.items())
    assert (tmp_path / "audit-pairings.png").stat().st_size > 10_000


def test_the_page_shows_tables_as_the_script_prints_them(tables) -> None:
    shown = [heading for heading, table in tables.items() if table in PAGE]
    assert shown == [
        "Which ratings can be behind Table 1: numbers of ratings",
        "What the pairing decides: p over all pairings, two-sided",
        "The table of powers",
    ]


def test_the_page_tells_the_numbers_that_are_found(tables) -> None:
    every = cells(tables, "Every test, over all pairings")
    flips = every["sign-flip test of the mean"]
    holm = [ends.split(" to ")[0] for ends in (flips[4], flips[6])]
    assert f"the library ({holm[0]}) or the living room ({holm[1]})" in TEXT
    basement = [every[test][3].split(" to ")[1] for test in ("sign test", "signed ranks, zeros dropped")]
    assert f"the basement open too (up to {basement[0]} and {basement[1]})" in TEXT
    mean, interval, largest = (row[0] for row in cells(tables, "All sequences").values())
    assert f"rated {mean} points higher" in TEXT
    assert f"confidence interval would be {interval}" in TEXT
    assert f"gives p = {largest} by a t test" in TEXT
    fewest, power, *_, even = (row[0] for row in cells(tables, "What so many answers can show").values())
    assert f"The exact test needs {fewest}, and would find a true share of 0.75 in {power} of" in TEXT
    assert f"fall so even four times in {even} of" in TEXT
    choices = cells(tables, "53 % and 47 %")
    library, together = choices["library"], choices["all, if independent"]
    assert f"within {library[3]} of one half, and no closer ({together[3]} if all 68 were" in TEXT
    assert f"The Bayes factor for one half against any share is {library[4]}." in TEXT
    lags = list(cells(tables, "Adaptation and online control").values())
    told = "lag by {} (library), {} (gym), {} (living room) and {} (basement)"
    assert told.format(*(row[0] for row in lags[:4])) in TEXT
    assert lags[4][0].replace(" (", " times the baseline's (")[:-1] in TEXT


def test_every_page_that_an_open_point_names_is_there() -> None:
    pages = re.findall(r"\[why\]\((.*?)\)", PAGE)
    assert len(pages) == 21
    assert all((ROOT / "docs" / page).is_file() for page in pages)


def as_printed(histogram, convention) -> tuple[str, str]:
    """Print a mean and its standard error as a careful person would, in 60 digits."""
    ratings = [Decimal(int(s)) for s, k in zip(audit.SCORES, histogram, strict=True) for _ in range(k)]
    with localcontext() as context:
        context.prec = 60
        n = len(ratings)
        mean = sum(ratings) / n
        squares = sum((r - mean) ** 2 for r in ratings)
        sem = (squares / (n if convention.population else n - 1)).sqrt() / Decimal(n).sqrt()
        ways = {False: ROUND_HALF_UP, True: ROUND_DOWN}
        cent = Decimal("0.01")
        return (
            str(mean.quantize(cent, ways[convention.mean_cut_off])),
            str(sem.quantize(cent, ways[convention.sem_cut_off])),
        )


@pytest.mark.parametrize("convention", audit.CONVENTIONS, ids=str)
def test_a_histogram_matches_what_would_be_printed_of_it_and_nothing_else(convention) -> None:
    histograms = audit.all_histograms(7)  # no mean or standard error of 7 ratings ends in a half
    assert len(np.unique(histograms, axis=0)) == len(histograms) == math.comb(11, 4)
    printed = [as_printed(histogram, convention) for histogram in histograms]
    for mean, sem in sorted(set(printed))[::7]:
        found = audit.matches(mean, sem, histograms, convention)
        assert found.tolist() == [(mean, sem) == other for other in printed]


def test_seventeen_is_the_one_number_that_all_cells_share_and_the_gym_fits_fewer() -> None:
    fitting = {cell: audit.numbers_that_fit(cell) for cell in audit.CELLS}
    assert set.intersection(*fitting.values()) == {17}
    # 52/14 = 3.714 and 42/13 = 3.231: ratings may be missing there.
    assert {n for n in fitting["gym", "ours"] if n <= 17} == {14, 17}
    assert {n for n in fitting["gym", "baseline"] if n <= 17} == {13, 17}
    # 55/17 = 3.2353 is 3.24 rounded.
    assert 17 not in audit.numbers_that_fit(("gym", "baseline"), audit.ROUNDED)


def test_sums_are_fixed_by_the_printed_means() -> None:
    # 3.59 · 17 = 61.03, 3.76 · 17 = 63.92, ...; a printed digit is 0.17 of a sum.
    sums = {"library": (61, 64), "gym": (55, 63), "living_room": (65, 71), "basement": (59, 73)}
    for sequence, totals in sums.items():
        for version, total in zip(audit.VERSIONS, totals, strict=True):
            assert set(audit.possible_histograms(sequence, version) @ audit.SCORES) == {total}
        assert audit.mean_difference(sequence) == (totals[1] - totals[0]) / 17


def histogram(values, of) -> list[int]:
    return [list(values).count(v) for v in of]


ratings_of_six = st.lists(st.integers(1, 5), min_size=6, max_size=6)


@settings(max_examples=15, deadline=None)
@given(ratings_of_six, ratings_of_six)
def test_reachable_differences_are_those_of_all_permutations(baseline, ours) -> None:
    one, other = (np.array([histogram(values, audit.SCORES)]) for values in (baseline, ours))
    found = audit.reachable_differences(one, other)
    by_permuting = {
        tuple(histogram([o - b for o, b in zip(order, baseline, strict=True)], audit.DIFFERENCES))
        for order in set(permutations(ours))
    }
    assert len(np.unique(found, axis=0)) == len(found)
    assert {tuple(row) for row in found.tolist()} == by_permuting


def p_by_all_signs(scores) -> float:
    """The share of choices of signs at least as far from 0, each written out."""
    sums = [abs(np.dot(signs, np.abs(scores))) for signs in product((-1, 1), repeat=len(scores))]
    return float(np.mean(np.array(sums) >= abs(np.sum(scores)) - 1e-9))


@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(-4, 4), min_size=7, max_size=7))
def test_p_values_are_those_of_all_signs_and_scipys(differences) -> None:
    d, test = np.array(differences), audit.PairedTest
    kept = d[d != 0]
    expected = {
        test.SIGN_FLIP: p_by_all_signs(d),
        test.SIGNED_RANK: p_by_all_signs(np.sign(d) * stats.rankdata(np.abs(d))),
        test.SIGNED_RANK_DROPPED: p_by_all_signs(np.sign(kept) * stats.rankdata(np.abs(kept))),
        test.SIGN: stats.binomtest(int((d > 0).sum()), kept.size).pvalue if kept.size else 1.0,
    }
    if len(set(differences)) > 1:
        expected[test.T] = stats.ttest_1samp(d, 0).pvalue
    for one, p in expected.items():
        assert audit.p_values(d[None, :], one)[0] == pytest.approx(p, abs=1e-12), one


def test_the_ends_of_the_ranges_are_those_found_by_hand() -> None:
    ranges = audit.p_ranges()
    # Basement: differences add up to 14. Smallest p of t: 3 zeros and 14 ones, so Σd² = 14.
    d = [0] * 3 + [1] * 14
    assert ranges[audit.PairedTest.T][3][0] == pytest.approx(stats.ttest_1samp(d, 0).pvalue)
    # Any differences that add up to 14, 14 of them of one sign: only 2 of 2^14 choices are as extreme.
    assert ranges[audit.PairedTest.SIGN_FLIP][3][0] == 2 / 2**14
    # The library's three points need at least three people, if no one differs the other way: 2 / 2³.
    assert ranges[audit.PairedTest.SIGN_FLIP][0][0] == 0.25
    words = [audit.verdict(p) for p in ranges[audit.PairedTest.SIGN_FLIP]]
    depends = "depends on the pairing"
    assert words == ["not shown by any pairing", depends, depends, "**differs, whatever the pairing**"]
    assert all(audit.with_holm(own)[3][1] > 0.05 for own in ranges.values())


def holm_by_closed_testing(p_values) -> list[float]:
    """The largest Bonferroni p of all groups of hypotheses that one belongs to (Marcus et al. 1976)."""
    groups = [g for size in range(1, len(p_values) + 1) for g in combinations(range(len(p_values)), size)]
    bonferroni = {g: min(1.0, len(g) * min(p_values[k] for k in g)) for g in groups}
    return [max(p for g, p in bonferroni.items() if k in g) for k in range(len(p_values))]


def test_holm_ranges_are_the_extremes_over_every_choice_within_the_ranges() -> None:
    ranges = [(0.002, 0.3), (0.01, 0.02), (0.04, 0.9)]
    choices = product(*(np.geomspace(*ends, 7) for ends in ranges))
    adjusted = np.array([holm_by_closed_testing(p) for p in choices])
    for k, found in enumerate(audit.with_holm(ranges)):
        assert found == pytest.approx((adjusted[:, k].min(), adjusted[:, k].max()))


def test_a_t_test_at_the_needed_correlation_has_a_p_of_five_percent() -> None:
    # In the living room both standard deviations are known; t of a mean difference at correlation r.
    _, needed = audit.correlations("living_room")
    assert needed[0] == pytest.approx(needed[1])
    first, second = (
        np.repeat(audit.SCORES, audit.possible_histograms("living_room", v)[0]) for v in audit.VERSIONS
    )
    spreads = first.std(ddof=1), second.std(ddof=1)
    variance = spreads[0] ** 2 + spreads[1] ** 2 - 2 * needed[0] * spreads[0] * spreads[1]
    t = (second.mean() - first.mean()) / np.sqrt(variance / 17)
    assert 2 * stats.t.sf(t, 16) == pytest.approx(0.05)


def test_no_order_of_the_ratings_gives_less_even_totals() -> None:
    rng, worst = np.random.default_rng(1), audit.least_even_totals()
    # Differences of 3, 8, 6 and 14 points.
    assert worst.sum() == 31
    for _ in range(200):
        sides = [(rng.choice(audit.possible_histograms(*cell)), cell[1] == "ours") for cell in audit.CELLS]
        orders = [rng.permutation(np.repeat(audit.SCORES, h)) * (1 if ours else -1) for h, ours in sides]
        assert np.sum(np.sum(orders, axis=0) ** 2) <= np.sum(worst**2)


def test_the_percentages_are_nine_and_eight_of_seventeen() -> None:
    assert audit.chosen() == {"library": 9, "gym": 8, "living_room": 8, "basement": 9}
    # 2 of 3 is 66.67 %: rounded or cut off.
    assert audit.counts_printed_as("67", 3) == audit.counts_printed_as("66", 3) == [2]
    middle = 2 * math.comb(17, 8) / 2**17  # 8 or 9 of 17
    assert f"{100 * middle**4:.1f} % of experiments" in TEXT


def test_the_powers_are_read_on_the_line_and_between_the_samples(tables) -> None:
    powers = cells(tables, "The table of powers")
    # (0.959 - 0.2945) / 0.001858 = 357.6; over that of 1.800 W; 0.80 W at 290 and 1.10 W at 440 cd/m².
    of_full, read = (0.959 - 0.2945) / (1.8 - 0.2945), (290 + 150 * 0.159 / 0.3) / 750
    assert powers["library, baseline"] == [
        "0.959", "358", "0.5", f"{of_full:.2f}", f"{357.6 / 750:.2f}", f"{read:.2f}"
    ]  # fmt: skip
    # The line: factors 0.3, 0.4, 0.5, 0.7 (mean 0.475), powers 0.646, 0.800, 0.959, 1.258 (mean 0.91575):
    # Σ(x - x̄)(P - P̄) = 0.133975, Σ(x - x̄)² = 0.0875.
    base, at_full, miss = audit.nominal_line()
    assert at_full - base == pytest.approx(0.133975 / 0.0875)
    assert base == pytest.approx(0.91575 - 0.475 * 0.133975 / 0.0875)
    assert f"on one line to {1000 * miss:.0f} mW" in TEXT

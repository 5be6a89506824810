"""The section of the audit on what the pairing decides, which Table 1 does not print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evenlight.analysis.audit.audit_paired_tests import MAIN_TEST, PairedTest, PRange
from evenlight.analysis.audit.audit_pairing_statistics import ASSUMED_CORRELATIONS, UNPAIRED
from evenlight.analysis.audit.audit_ratings import SequenceRatings
from evenlight.analysis.audit.audit_statistics import ALL, Rows, between, p_between
from evenlight.analysis.audit.audit_verdict_words import other_tests_in_words, verdicts_in_words
from evenlight.analysis.findings import Drawing
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words, listed, p_in_words, spaced
from evenlight.data_schema.statistic import Statistic

BELOW = "correlation below which the t test cannot give p < 0.05"
ABOVE = "correlation above which the t test must give p < 0.05"
LARGEST = "largest possible correlation within people"


def pairing_section(
    ratings: Sequence[SequenceRatings],
    adjusted: Mapping[PairedTest, Sequence[PRange]],
    statistics: Sequence[Statistic],
    drawing: Drawing,
) -> Section:
    """Return the section."""
    found = Rows(statistics)
    return Section(
        "What the pairing decides",
        paragraphs=(
            "Everybody rated both versions, so the differences within people decide. Table 1 has the "
            "means, and with them the mean difference; how the two ratings of a person go together it has "
            "not. Every joint table of the two ratings that agrees with the printed numbers was tried, and "
            "the p of each test worked out for all of them; both ends of a range are attained by some "
            "pairing.",
            _verdicts(ratings, adjusted),
            _correlations_in_words([r.sequence for r in ratings], found),
            _total_in_words(ratings, found),
        ),
        tables=(_range_table(ratings, found), _context_table(ratings, found)),
        pictures=(drawing.picture,),
    )


def _verdicts(ratings: Sequence[SequenceRatings], adjusted: Mapping[PairedTest, Sequence[PRange]]) -> str:
    """Return which sequences differ, do not, or are open, by the main test and by the others."""
    names = [r.sequence for r in ratings]
    raw = {test: [r.ranges[test] for r in ratings] for test in PairedTest}
    return (
        f"By the {MAIN_TEST.value} at 5 %, each sequence by itself: "
        f"{verdicts_in_words(names, raw[MAIN_TEST])}. With Holm's correction for {len(names)} tests: "
        f"{verdicts_in_words(names, adjusted[MAIN_TEST])}. {other_tests_in_words(names, raw, adjusted)}"
    )


def _correlations_in_words(sequences: Sequence[str], found: Rows) -> str:
    """Return which correlations within people a t test needs, sequence by sequence."""
    by_need: dict[str, list[str]] = {"any": [], "none": [], "some": []}
    for sequence in sequences:
        need = _needed(found, sequence)
        name = spaced(sequence)
        above, below, most = (found.number("correlation", sequence, what) for what in (ABOVE, BELOW, LARGEST))
        words = {
            "any": f"at any in the {name}",
            "none": f"in the {name} it would have to be {below:.2f}, and can be {most:.2f} at most",
        }
        by_need[need if need in words else "some"].append(words.get(need, f"above {above:.2f} in the {name}"))
    enough = listed(by_need["some"] + by_need["any"]) if by_need["some"] or by_need["any"] else "nowhere"
    never = f"; {listed(by_need['none'])}" if by_need["none"] else ""
    return (
        "How plausible an end is, the correlation within people tells. A t test is sure to give p < 0.05 "
        f"where the two ratings of a person correlate {enough}{never}."
    )


def _total_in_words(ratings: Sequence[SequenceRatings], found: Rows) -> str:
    """Return what is known of the difference over all sequences."""
    alone = found.of("paired", ALL, "mean difference of ratings, if a person's ratings were unrelated")
    mean = found.number("paired", ALL, "mean difference of ratings")
    return (
        f"Over all sequences, ours is rated {abs(mean):.2f} points {'higher' if mean > 0 else 'lower'}. If a "
        f"person's {2 * len(ratings)} ratings had nothing in common, the 95 % interval would be "
        f"{alone.ci_low:.2f} to {alone.ci_high:.2f} ({p_in_words(alone.p_value or 0.0)}); over all pairings "
        f"the p of the {PairedTest.T.value} is {p_between(*found.ends('paired', ALL, PairedTest.T.value))}, "
        "the largest with people of whom those who rate ours high rate the baseline low in every sequence."
    )


def _range_table(ratings: Sequence[SequenceRatings], found: Rows) -> Table:
    """Return the table of the ranges of p."""
    rows: list[tuple[Cell, ...]] = []
    for r in ratings:
        for test in PairedTest:
            low, high = (
                found.of("paired", r.sequence, f"{end} p of the {test.value}")
                for end in ("smallest", "largest")
            )
            raw = p_between(low.value, high.value)
            holm = p_between(low.p_adjusted, high.p_adjusted)
            name = in_words(r.sequence) if test is PairedTest.T else ""
            rows.append((name, test.value, raw, holm, low.flag))
    return Table(
        f"Smallest and largest two-sided p over all pairings that agree with Table 1 ({ratings[0].n} pairs)",
        ("sequence", "test", "p", "p, Holm", "at 5 %, before Holm"),
        tuple(rows),
    )


def _context_table(ratings: Sequence[SequenceRatings], found: Rows) -> Table:
    """Return the table of mean differences, unpaired tests, correlations, and what so many pairs find."""
    rows: list[tuple[Cell, ...]] = []
    for r in ratings:
        possible = [
            f"{found.number('correlation', r.sequence, f'{end} possible correlation within people'):.2f}"
            for end in ("smallest", "largest")
        ]
        needed = _needed(found, r.sequence)
        unpaired = [p_between(*found.ends("unpaired", r.sequence, test)) for test in UNPAIRED]
        detectable = [
            found.number(
                "power_of_ratings", r.sequence, f"mean difference found with 80 % power, correlation {c:g}"
            )
            for c in ASSUMED_CORRELATIONS
        ]
        rows.append(
            (
                in_words(r.sequence),
                f"{found.number('paired', r.sequence, 'mean difference of ratings'):.2f}",
                between(*possible),
                needed,
                *unpaired,
                *(f"{d:.2f}" for d in detectable),
            )
        )
    return Table(
        "What the ratings are besides: correlation r within people, tests as if unpaired, and the mean "
        f"difference that {ratings[0].n} pairs find with 80 % power",
        ("sequence", "difference", "r possible", "r for p < 0.05", "p, Welch", "p, permutation",
         "found if r = 0", "found if r = 0.5"),
        tuple(rows),
    )  # fmt: skip


def _needed(found: Rows, sequence: str) -> str:
    """Return which correlations give p < 0.05, in words where all that are possible do, or none."""
    below = found.number("correlation", sequence, BELOW)
    above = found.number("correlation", sequence, ABOVE)
    if above < found.number("correlation", sequence, "smallest possible correlation within people"):
        return "any"
    if below > found.number("correlation", sequence, LARGEST):
        return "none"
    return "above " + between(f"{below:.2f}", f"{above:.2f}")

"""The section of the audit on 53 % and 47 %: the counts behind them, and what they can show."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.audit.audit_choice_statistics import MARGINS, TOLD_MARGIN
from evenlight.analysis.audit.audit_choices import ChosenCount, chosen_counts
from evenlight.analysis.audit.audit_statistics import ALL, Rows
from evenlight.analysis.findings import Drawing
from evenlight.analysis.inference.binomial_tests import ALPHA, HALF
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words, listed, p_in_words
from evenlight.data_schema.statistic import Statistic

SHARE = "share of choices of ours"
MARGIN = "smallest margin within which the share is shown to be one half"


def choice_section(statistics: Sequence[Statistic], drawing: Drawing) -> Section:
    """Return the section."""
    rows, counts = Rows(statistics), chosen_counts()
    even = rows.number("choices", ALL, "chance of four counts so even, if nobody could tell")
    return Section(
        _title(counts),
        paragraphs=(
            _counts_in_words(statistics, counts),
            _single_in_words(rows, counts[0].answers),
            _pooled_in_words(rows, counts),
            "Being chosen half of the time is chance in this task. It says that the two versions could not "
            "be told apart by it, in these sequences; not that nobody saw the brightness change, as both "
            "versions change with their content.",
        ),
        tables=(_count_table(counts, rows), _needed_table(rows)),
        pictures=(drawing.picture,),
        notes=(
            f"Coins would be so even in "
            f"{100 * even:.1f} % of experiments: rare, and no more than that, as it was looked at after the "
            "counts were seen.",
        ),
    )


def _printed_counts(counts: Sequence[ChosenCount]) -> dict[str, int]:
    """Return which count each printed percentage is, the largest first."""
    return {c.text: c.chosen for c in sorted(counts, key=lambda c: -c.chosen)}


def _title(counts: Sequence[ChosenCount]) -> str:
    """Return the percentages and their counts."""
    of = _printed_counts(counts)
    percentages, chosen = (
        listed([word.format(k) for k in ks]) for word, ks in (("{} %", of), ("{}", of.values()))
    )
    return f"{percentages}: {chosen} of {counts[0].answers}"


def _nearness(counts: Sequence[ChosenCount]) -> str:
    """Return how many counts are as near to one half as a count can be."""
    nearest = sum(abs(2 * c.chosen - c.answers) <= c.answers % 2 for c in counts)
    every = f"All {nearest}" if nearest == len(counts) else f"{nearest} of {len(counts)}"
    return f"{every} counts are as near to one half as {counts[0].answers} answers can be."


def _counts_in_words(statistics: Sequence[Statistic], counts: Sequence[ChosenCount]) -> str:
    """Return what the percentages are."""
    n = counts[0].answers
    numbers = [s.value for s in statistics if s.what.startswith("number of people for whom")]
    others = " and ".join(f"{value:.0f}" for value in numbers if value != n)
    smallest = min(s.p_value for s in statistics if s.what == SHARE and s.p_value is not None)
    found = "finds no" if smallest > ALPHA else "finds a"
    which = listed([f"{text} % is {chosen} of {n}" for text, chosen in _printed_counts(counts).items()])
    return (
        f"{which} (the percentages alone would fit {others} people as well). {_nearness(counts)} The exact "
        f"test {found} difference (smallest {p_in_words(smallest)})."
    )


def _single_in_words(rows: Rows, n: int) -> str:
    """Return what the answers to one sequence can show."""
    group = f"{n} answers"
    fewest = rows.number("power_of_choices", group, "fewest choices of ours that differ from one half")
    power = rows.number("power_of_choices", group, "power for a share of 0.75")
    found = rows.number("power_of_choices", group, "smallest share found with 80 % power")
    margin = rows.number("choices", "library", MARGIN)
    factor = rows.number("choices", "library", "Bayes factor for one half against any share")
    return (
        f"That no difference was found does not mean that there is none. The exact test calls {fewest:.0f} "
        f"or more of {n} different from one half. If ours were truly chosen in 75 % of such pairs, it would "
        f"find that in {100 * power:.0f} % of experiments; 80 % power needs a share of {found:.2f}. Turned "
        f"round: {n} answers divided as evenly as they can be show the share to lie within ±{margin:.2f} of "
        f"one half, so up to {HALF + margin:.2f}, and no closer. The Bayes factor for one half against any "
        f"share is {factor:.1f}, modest evidence for it."
    )


def _pooled_in_words(rows: Rows, counts: Sequence[ChosenCount]) -> str:
    """Return what all answers together can show."""
    n, total = counts[0].answers, sum(c.answers for c in counts)
    chosen, margin = sum(c.chosen for c in counts), rows.number("choices", ALL, MARGIN)
    needed = rows.number("choices_needed", ALL, "answers that show equivalence within 0.1 with 80 % power")
    return (
        f"All answers together are {chosen} of {total}. Were they independent, the margin would be "
        f"±{margin:.2f}; those of one person are rarely that, so that the truth lies between {n} and "
        f"{total} answers. A margin of ±0.10 takes {needed:.0f} independent answers for 80 % power."
    )


def _count_table(counts: Sequence[ChosenCount], found: Rows) -> Table:
    """Return the table of counts and what follows from them."""
    rows: list[tuple[Cell, ...]] = []
    names = [(c.sequence, in_words(c.sequence), f"{c.text} %") for c in counts]
    for group, name, text in [*names, (ALL, "All, if independent", "")]:
        share = found.of("choices", group, SHARE)
        chosen = found.of("choices", group, "choices of ours")
        others = [
            f"{found.number('choices', group, what):.2f}"
            for what in (
                "smallest margin within which the share is shown to be one half",
                f"p of equivalence within {TOLD_MARGIN:g}",
                "Bayes factor for one half against any share",
            )
        ]
        rows.append(
            (
                name,
                text,
                f"{chosen.value:.0f} of {chosen.n}",
                f"{share.ci_low:.2f} to {share.ci_high:.2f}",
                f"{share.p_value:.2f}",
                f"±{others[0]}",
                *others[1:],
            )
        )
    columns = (
        "sequence",
        "printed",
        "count",
        "95 % interval",
        "p, one half",
        "margin shown",
        f"p, within ±{TOLD_MARGIN:g}",
        "Bayes factor",
    )
    return Table("Choices of ours, asked which version showed a change in brightness", columns, tuple(rows))


def _needed_table(found: Rows) -> Table:
    """Return the table of how many answers would do."""
    rows: list[tuple[Cell, ...]] = []
    for margin in MARGINS:
        equal = f"answers that show equivalence within {margin:g} with 80 % power"
        different = f"answers that find a share of {HALF + margin:g} with 80 % power"
        rows.append(
            (f"±{margin:g}", *(f"{found.number('choices_needed', ALL, w):.0f}" for w in (equal, different)))
        )
    return Table(
        "Independent answers needed for 80 % power",
        ("margin", "to show equivalence", "to find a share at the margin"),
        tuple(rows),
    )

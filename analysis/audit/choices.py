"""The paper's choices between two versions: which counts are behind its percentages, what they can show."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal

import numpy as np
from scipy import special, stats

from evenlight.analysis.audit.rows import ALL, row
from evenlight.analysis.audit.table_ratings import OTHER_NUMBERS
from evenlight.analysis.inference.binomial_power import (
    answers_for_equivalence,
    answers_to_find,
    difference_power,
    lower_critical,
    smallest_share_found,
)
from evenlight.analysis.inference.binomial_tests import HALF, LEVEL, infer_share
from evenlight.analysis.published import SEQUENCES, published
from evenlight.data_schema.analysis_results import Statistic

MARGINS = (0.05, 0.10, 0.15)  # about one half, for which the answers needed are given
TOLD_MARGIN = 0.15  # of the equivalence test in the rows
SHARES = (0.6, 0.7, 0.75, 0.8)  # true shares, of which the power is given
POWER = 0.8
INDEPENDENT = "answers counted as independent"


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
    n, chosen = int(published("participants.viewing").number), []
    for sequence in SEQUENCES:
        text = published(f"detail_quality.{sequence}.chosen_percent").text
        counts = counts_printed_as(text, n)
        if len(counts) != 1:
            raise ValueError(f"{sequence}: {text} % should be one count of {n}, is {counts}")
        chosen.append(ChosenCount(sequence, text, counts[0], n))
    return tuple(chosen)


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
    """Return d' of an observer with this share of correct choices: √2 Φ⁻¹(share) (Green & Swets 1966).

    >>> round(detectability(0.76025), 3)  # Φ(1 / √2)
    1.0
    """
    return float(np.sqrt(2) * special.ndtri(share))


def choice_statistics() -> tuple[Statistic, ...]:
    """Return every number of the section."""
    counts = chosen_counts()
    rows = [s for count in counts for s in _share_rows(count.sequence, count.chosen, count.answers)]
    chosen, answers = sum(c.chosen for c in counts), sum(c.answers for c in counts)
    rows += _share_rows(ALL, chosen, answers, "four answers of each participant, taken for independent")
    texts = tuple(c.text for c in counts)
    for n in numbers_that_fit(texts):
        what = "number of people for whom 53 % and 47 % are counts"
        rows.append(row("choices", ALL, what, n, method="8 to 24 people tried"))
    what = "chance of four counts so even, if nobody could tell"
    rows.append(
        row("choices", ALL, what, chance_of_being_so_even(counts), n=answers,
            method=f"exact binomial, {INDEPENDENT}", flag="looked at after seeing the counts")
    )  # fmt: skip
    for n in (counts[0].answers, answers):
        rows += _limit_rows(n)
    for margin in MARGINS:
        needed = answers_for_equivalence(margin, POWER)
        what = f"answers that show equivalence within {margin:g} with 80 % power"
        rows.append(row("choices_needed", ALL, what, needed, method="exact equivalence test, true share 0.5"))
        needed = answers_to_find(HALF + margin, POWER)
        what = f"answers that find a share of {HALF + margin:g} with 80 % power"
        rows.append(row("choices_needed", ALL, what, needed, method="exact binomial test at 5 %"))
    return tuple(rows)


def _share_rows(group: str, chosen: int, answers: int, flag: str = "") -> list[Statistic]:
    """Return what a count says about the share behind it."""
    found = infer_share(chosen, answers, TOLD_MARGIN)
    low, high = found.clopper_pearson
    margin = found.smallest_margin
    within = f"exact equivalence test (two one-sided), margin {TOLD_MARGIN:g}"
    return [
        row("choices", group, "choices of ours", chosen, n=answers, method="the percentage as a count"),
        row("choices", group, "share of choices of ours", found.share, ci_low=low, ci_high=high, n=answers,
            interval=LEVEL, p_value=found.p_value, method="Clopper-Pearson, exact binomial test", flag=flag),
        row("choices", group, "smallest margin within which the share is shown to be one half", margin,
            n=answers, method="exact equivalence test at 5 %", flag=flag),
        row("choices", group, f"p of equivalence within {TOLD_MARGIN:g}", found.equivalence_p,
            p_value=found.equivalence_p, n=answers, method=within, flag=flag),
        row("choices", group, "Bayes factor for one half against any share", found.bayes_factor, n=answers,
            method="against a uniform share", flag=flag),
        row("choices", group, "d' at the far end of that margin", detectability(HALF + margin), n=answers,
            method="√2 Φ⁻¹(share)", flag=flag),
    ]  # fmt: skip


def _limit_rows(answers: int) -> list[Statistic]:
    """Return what so many answers find."""
    test = f"exact two-sided binomial test at 5 %, {INDEPENDENT}"
    few = int(lower_critical(answers))
    group = f"{answers} answers"
    rows = [
        row("power_of_choices", group, "fewest choices of ours that differ from one half", answers - few,
            n=answers, method=test),
        row("power_of_choices", group, "type I error", float(difference_power(answers, HALF)), n=answers,
            method=test),
        row("power_of_choices", group, "smallest share found with 80 % power",
            smallest_share_found(answers, POWER), n=answers, method=test),
    ]  # fmt: skip
    for share in SHARES:
        power = float(difference_power(answers, share))
        what = f"power for a share of {share:g}"
        rows.append(row("power_of_choices", group, what, power, n=answers, method=test))
    return rows

"""The counts behind 53 % and 47 % in rows: what they say, and what so many answers can show."""

from __future__ import annotations

from evenlight.analysis.audit.audit_choices import (
    chance_of_being_so_even,
    chosen_counts,
    detectability,
    numbers_that_fit,
)
from evenlight.analysis.audit.audit_statistics import ALL, row
from evenlight.analysis.inference.binomial_power import (
    answers_for_equivalence,
    answers_to_find,
    difference_power,
    lower_critical,
    smallest_share_found,
)
from evenlight.analysis.inference.binomial_tests import HALF, LEVEL, infer_share
from evenlight.data_schema.statistic import Statistic

MARGINS = (0.05, 0.10, 0.15)  # about one half, for which the answers needed are told
TOLD_MARGIN = 0.15  # of the equivalence test in the rows
SHARES = (0.6, 0.7, 0.75, 0.8)  # true shares, of which the power is told
POWER = 0.8
INDEPENDENT = "answers counted as independent"


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
    chance = chance_of_being_so_even(counts)
    rows.append(
        row(
            "choices",
            ALL,
            "chance of four counts so even, if nobody could tell",
            chance,
            n=answers,
            method=f"exact binomial, {INDEPENDENT}",
            flag="looked at after seeing the counts",
        )
    )
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

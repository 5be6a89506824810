"""What so many answers can and cannot show, whatever they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.binomial_power import (
    MOST_ANSWERS,
    answers_for_equivalence,
    answers_to_find,
    difference_power,
    equivalence_power,
    interval_coverage,
    lower_critical,
    smallest_margin_ever,
    smallest_share_found,
)
from evenlight.analysis.inference.binomial_tests import HALF
from evenlight.data_schema.analysis_results import Origin, Statistic

POWER = 0.8
THRESHOLD_SHARE = 0.75  # right answers at the threshold of a two-interval calibration
MIDDLE_SHARES = np.linspace(0.2, 0.8, 601)
BEYOND = f"more than {MOST_ANSWERS} answers"


@dataclass(frozen=True, slots=True)
class AnswerLimits:
    """What n independent answers can show about a share.

    Attributes
    ----------
    answers : int
        n.
    margin : float
        Within which a share counts as equivalent to 1/2.
    fewest_different : int or None
        From how many answers for one version on the share differs from 1/2 at 5 %; None if no number does.
    type_i_error : float
        How often the test finds a difference where there is none.
    share_found : float or None
        The smallest true share above 1/2 that is found with 80 % power.
    threshold_power : float
        How often a share of 0.75 is found.
    margin_ever : float
        The smallest margin that the most even answers show.
    equivalence_power : float
        How often a share of exactly 1/2 is shown to be within the margin.
    answers_equivalent, answers_different : int or None
        How many answers show that with 80 %, and find a share at the margin; None beyond 10 000.
    coverage : (float, float)
        Lowest and highest coverage of the 95 % interval (Clopper and Pearson), for shares of 0.2 to 0.8.
    """

    answers: int
    margin: float
    fewest_different: int | None
    type_i_error: float
    share_found: float | None
    threshold_power: float
    margin_ever: float
    equivalence_power: float
    answers_equivalent: int | None
    answers_different: int | None
    coverage: tuple[float, float]


def answer_limits(answers: int, margin: float) -> AnswerLimits:
    """Return what so many independent answers can show.

    >>> answer_limits(17, 0.15).fewest_different
    13
    """
    few = int(lower_critical(answers))
    coverage = interval_coverage(answers, MIDDLE_SHARES, mid_p=False)
    return AnswerLimits(
        answers=answers,
        margin=margin,
        fewest_different=answers - few if few >= 0 else None,
        type_i_error=float(difference_power(answers, HALF)),
        share_found=smallest_share_found(answers, POWER),
        threshold_power=float(difference_power(answers, THRESHOLD_SHARE)),
        margin_ever=smallest_margin_ever(answers),
        equivalence_power=float(equivalence_power(answers, HALF, margin)),
        answers_equivalent=answers_for_equivalence(margin, POWER),
        answers_different=answers_to_find(HALF + margin, POWER),
        coverage=(float(coverage.min()), float(coverage.max())),
    )


def limit_rows(limits: AnswerLimits) -> tuple[Statistic, ...]:
    """Return what so many answers can show, a row for each number."""
    n, margin = limits.answers, limits.margin
    found = "share above 0.5 found with 80 % power"
    rows: tuple[tuple[str, float | None, str], ...] = (
        ("answers for one version from which on p < 0.05", limits.fewest_different, "no number of them"),
        ("type I error of the exact test", limits.type_i_error, ""),
        (f"smallest {found}", limits.share_found, "no share is found: too few answers"),
        (f"power for a share of {THRESHOLD_SHARE:g}", limits.threshold_power, ""),
        ("smallest margin about 0.5 that they could show", limits.margin_ever, ""),
        (f"power to show a share of 0.5 within ±{margin:g}", limits.equivalence_power, ""),
        ("answers that show it with 80 % power", limits.answers_equivalent, BEYOND),
        (f"answers that find {HALF + margin:g} with 80 % power", limits.answers_different, BEYOND),
        ("lowest coverage of the 95 % interval for shares of 0.2 to 0.8", limits.coverage[0], ""),
        ("highest coverage of the 95 % interval for shares of 0.2 to 0.8", limits.coverage[1], ""),
    )
    return tuple(
        Statistic(
            "limits", f"{n} answers", what, None if value is None else float(value), "1", Origin.COMPUTED,
            n=n, method="exact, over all outcomes; n independent answers", flag=why if value is None else "",
        )
        for what, value, why in rows
    )  # fmt: skip

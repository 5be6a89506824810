"""Is one version nearly always shown second? Then its effect and that of the order cannot be told apart."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import special

from evenlight.analysis.integrity.answers import Answers, answers_of
from evenlight.analysis.integrity.concern import LEVEL, Concern, ConcernKind, noun_of
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few
from evenlight.data_schema.arrays import Array

FEWEST_PAIRS = 4  # fewer show no effect either
NEARLY = 0.8  # share of pairs in one order from which on the rest is too few to tell (choice)


def order_concerns(answers: Answers) -> tuple[Concern, ...]:
    """Return whether the order of the versions is nearly always the same, over all pairs or of some items."""
    pairs = _pairs(answers)
    if _one_order(pairs):
        n, second = pairs.size, int(pairs.sum())
        where, most = ("second", second) if 2 * second > n else ("first", n - second)
        share = f"all {n}" if most == n else f"{most} of {n}"
        words = (
            f"in the {noun_of(answers.task)} ours was shown {where} in {share} pairs, so that an effect of "
            "the version and one of the order cannot be told apart"
        )
        return (Concern(ConcernKind.VERSION_ORDER, words, threatens=True),)
    items = np.unique(answers.item[~np.isnan(answers.ours_second)])
    fixed = [k for k in items if _one_order(_pairs(answers, k), LEVEL / items.size)]
    if not fixed:
        return ()
    names = first_few([answers.items[k] for k in fixed])
    words = f"in the {noun_of(answers.task)} of {names} one version always came first, or nearly: "
    words += "its effect and that of the order cannot be told apart"
    return (Concern(ConcernKind.VERSION_ORDER, words, threatens=True),)


def confounded_order(data: TaskData[Any]) -> str:
    """Return in which order the versions came if it was nearly always the same one; empty if it was not.

    Parameters
    ----------
    data : TaskData
        All trials of a task with two versions.
    """
    pairs = _pairs(answers_of(data))
    if not _one_order(pairs):
        return ""
    always = "always" if pairs.all() or not pairs.any() else "nearly always"
    return f"ours was {always} shown {'second' if pairs.mean() > 0.5 else 'first'}"


def _pairs(answers: Answers, item: int | None = None) -> Array:
    """Return whether ours came second, once for each pair; of one item, or all."""
    chosen = (answers.ours != 0) & ~np.isnan(answers.ours_second)
    if item is not None:
        chosen &= answers.item == item
    second: Array = answers.ours_second[chosen]
    return second


def _one_order(second: Array, level: float | None = None) -> bool:
    """Return whether all pairs have one order, or clearly more than by chance nearly all.

    Parameters
    ----------
    second : array (n,)
        Whether ours came second.
    level : float, optional
        Of the one-sided exact test; without it, one order throughout is enough.
    """
    n, count = second.size, int(second.sum())
    most = max(count, n - count)
    if n < FEWEST_PAIRS or most < NEARLY * n:
        return False
    if level is None and most == n:
        return True
    chance = float(special.bdtrc(most - 1, n, 0.5))  # P(as many or more | either order is as likely)
    return chance <= (level or LEVEL)

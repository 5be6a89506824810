"""What the order of the two versions does to their ratings.

Whoever sees a version second may rate it higher or lower for that alone (an effect of the place), and the
version that was seen first may colour the rating of the other (carry-over). With ours first in some pairs and
second in others both can be told from the version's effect, as in a trial with two periods (Hills & Armitage
1979): the place shows in whether the *difference* depends on the order, carry-over in whether the *sum* does.

Both are read within each participant, who sees some sequences in one order and some in the other. What the
versions do in one sequence and not in another is taken off by least squares (effects of people, of sequences
and of the order), as it would else look like an order wherever one order is commoner. The test gives
the orders of each participant to another one: without an effect of the order they might as well have been
theirs, whatever the sequences do and however often either order was used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from evenlight.analysis.inference.exact_group_test import group_test
from evenlight.analysis.inference.paired_effects import Effect, group_difference
from evenlight.analysis.rating.rating_order_contrasts import (
    PERMUTATIONS,
    ContrastTest,
    SeenOrders,
    within_people,
)
from evenlight.analysis.rating.rating_pairs import common_denominator, whole_scores
from evenlight.data_schema.viewing import RatingTrial, Version

NO_PAIR = "nobody has rated both versions one after the other"


@dataclass(frozen=True, slots=True)
class OrderedPair:
    """Both versions of a sequence, as one participant rated them one after the other.

    Attributes
    ----------
    participant_id, sequence : str
        Who, and what.
    ours_first : bool
        Whether ours was shown before the baseline.
    difference, total : int
        Ours less baseline, and their sum [rating points].
    """

    participant_id: str
    sequence: str
    ours_first: bool
    difference: int
    total: int


@dataclass(frozen=True, slots=True)
class OrderEffects:
    """What the order does.

    Attributes
    ----------
    place : ContrastTest
        How much higher the version shown second is rated, within participants.
    carry_over : ContrastTest
        How much higher the mean of both versions is rated with ours first, within participants.
    by_sequence : dict of str to ContrastTest
        Mean difference between the versions of those who saw ours first, less that of those who saw it
        second.
    """

    place: ContrastTest
    carry_over: ContrastTest
    by_sequence: dict[str, ContrastTest]


def order_effects(
    trials: Sequence[RatingTrial],
    sequences: Sequence[str],
    rng: np.random.Generator,
    permutations: int = PERMUTATIONS,
) -> OrderEffects:
    """Return what the order does.

    Parameters
    ----------
    trials : sequence of RatingTrial
        All that count.
    sequences : sequence of str
        Names.
    rng : Generator
        Draws the permutations of the tests within participants.
    permutations : int
        How many.
    """
    pairs = ordered_pairs(trials)
    orders = seen_orders(pairs)
    second = [Fraction(-pair.difference, 2) for pair in pairs]
    level = [Fraction(pair.total, 2) for pair in pairs]
    return OrderEffects(
        place=within_people(orders, second, rng, permutations),
        carry_over=within_people(orders, level, rng, permutations),
        by_sequence={name: _between([p for p in pairs if p.sequence == name]) for name in sequences},
    )


def ordered_pairs(trials: Iterable[RatingTrial]) -> tuple[OrderedPair, ...]:
    """Return all pairs of which both versions were rated, one of them first."""
    found: dict[tuple[str, str, str, int], dict[Version, RatingTrial]] = {}
    for trial in trials:
        key = (trial.participant_id, trial.session_id, trial.sequence, trial.repetition)
        found.setdefault(key, {})[trial.version] = trial
    pairs = []
    for (who, _, sequence, _), own in found.items():
        if len(own) == 2 and len({trial.place_in_pair for trial in own.values()}) == 2:
            ours, baseline = own[Version.OURS], own[Version.BASELINE]
            pairs.append(
                OrderedPair(
                    who,
                    sequence,
                    ours.place_in_pair == 1,
                    ours.rating - baseline.rating,
                    ours.rating + baseline.rating,
                )
            )
    return tuple(pairs)


def seen_orders(pairs: Sequence[OrderedPair]) -> SeenOrders:
    """Return who saw what in which order; the repetitions of a sequence are counted."""
    seen: dict[tuple[str, str], int] = {}
    cells = []
    for pair in pairs:
        key = (pair.participant_id, pair.sequence)
        seen[key] = seen.get(key, 0) + 1
        cells.append((pair.participant_id, pair.sequence, seen[key]))
    return SeenOrders(tuple(cells), tuple(pair.ours_first for pair in pairs))


def _between(pairs: Sequence[OrderedPair]) -> ContrastTest:
    """Return whether the difference between the versions of a sequence depends on the order."""
    own: dict[str, dict[bool, list[Fraction]]] = {}
    for pair in pairs:
        seen = own.setdefault(pair.participant_id, {True: [], False: []})
        seen[pair.ours_first].append(Fraction(pair.difference))
    groups = [[_mean(seen[first]) for seen in own.values() if seen[first]] for first in (True, False)]
    if any(all(seen.values()) for seen in own.values()) or not all(groups):
        why = "no two groups: all saw the same order, or somebody saw both" if pairs else NO_PAIR
        return ContrastTest(Effect(None, flag=why), None, len(own))
    scores = whole_scores([*groups[0], *groups[1]])
    tested = group_test(scores[: len(groups[0])], scores[len(groups[0]) :])
    step = 1 / common_denominator([*groups[0], *groups[1]])
    first, second = ([float(mean) for mean in group] for group in groups)
    effect = group_difference(first, second, step)
    return ContrastTest(effect, tested.p_value, len(own))


def _mean(values: Sequence[Fraction]) -> Fraction:
    """Return a mean."""
    return sum(values, Fraction(0)) / len(values)

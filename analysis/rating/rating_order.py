"""What the order of the two versions does to their ratings.

People who see a version second may rate it higher or lower for that alone (an effect of the place), and the
version that was seen first may affect the rating of the other (carry-over). With ours first in some pairs and
second in others both can be separated from the version's effect, as in a trial with two periods (Hills &
Armitage 1979): the place shows in whether the *difference* depends on the order, carry-over in whether the
*sum* does.

Both are read within each participant, who sees some sequences in one order and some in the other. What the
versions do in one sequence and not in another is removed by least squares (effects of people, of sequences
and of the order), as it would otherwise look like an order effect wherever one order is commoner. The test
gives the orders of each participant to another one: without an effect of the order they might as well have
been theirs, whatever the sequences do and however often either order was used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from evenlight.analysis.inference.exact_tests import group_test
from evenlight.analysis.inference.paired_effects import Effect, group_difference, mean_difference
from evenlight.analysis.rating.rating_pairs import common_denominator, whole_scores
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

NO_PAIR = "nobody has rated both versions in an order that is known"
PERMUTATIONS = 9999
SAME_ORDER = "nobody saw both orders"
ONE_PERSON = "one participant: the order cannot be told from what the versions do in single sequences"
NOT_APART = "each sequence was shown in one order only: the order cannot be told from the sequence"
UNEVEN = "either order is not as frequent: the interval, by few people, may hold less than it says"
RARE = 0.3  # share of the rarer order in a sequence below which `UNEVEN` is said
NONE = 1e-9


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
        if {trial.place_in_pair for trial in own.values()} == {1, 2}:
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
        why = "no two groups: all saw the same order, or a participant saw both" if pairs else NO_PAIR
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


@dataclass(frozen=True, slots=True)
class ContrastTest:
    """A contrast between the two orders, with its test.

    Attributes
    ----------
    effect : Effect
        In rating points.
    p_value : float or None
        None where there is nothing to test; the effect's flag says why.
    n : int
        Participants.
    """

    effect: Effect
    p_value: float | None
    n: int


@dataclass(frozen=True, slots=True)
class SeenOrders:
    """In which order each pair was seen.

    Attributes
    ----------
    cells : tuple of (str, str, int)
        Participant, sequence and number of the repetition.
    ours_first : tuple of bool
        Whether ours was shown before the baseline.
    """

    cells: tuple[tuple[str, str, int], ...]
    ours_first: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class _ContrastTable:
    """Values and orders by participant and cell; nan for what was not seen."""

    values: Array
    orders: Array


def within_people(
    seen: SeenOrders, values: Sequence[Fraction], rng: np.random.Generator, permutations: int = PERMUTATIONS
) -> ContrastTest:
    """Return how much larger a value is with ours first, beside effects of people and of sequences.

    Parameters
    ----------
    seen : SeenOrders
        Of each pair.
    values : sequence of Fraction
        Of each pair.
    rng : Generator
        Draws the permutations.
    permutations : int
        How many; p counts the data among them (Edgington 1969).
    """
    table = _contrast_table(seen, values)
    n = len(table.values)
    why = _cannot(table)
    if why:
        return ContrastTest(Effect(None, flag=why), None, n)
    order, value = _residuals(table.orders), _residuals(table.values)
    squares = float(np.sum(order**2))
    if squares < NONE:
        return ContrastTest(Effect(None, flag=NOT_APART), None, n)
    slope = float(np.sum(order * value)) / squares
    # A participant's share in the slope, so scaled that their mean is the slope and that their scatter is its
    # standard error by participants, with the leverage of each (Bell & McCaffrey 2002).
    leverage = np.minimum(1 / n + np.sum(order**2, axis=1) / squares, 0.9)
    apart = n / squares * np.sum(order * (value - slope * order), axis=1) / np.sqrt(1 - leverage)
    shares = slope + apart - apart.mean()
    effect = mean_difference(np.where(np.abs(shares) < NONE, 0.0, shares), _step(seen, values))
    flags = [effect.flag, UNEVEN if _rarest(table.orders) < RARE else ""]
    effect = Effect(effect.value, effect.ci_low, effect.ci_high, "; ".join(f for f in flags if f))
    return ContrastTest(effect, _permuted_p(table, value, rng, permutations), n)


def _contrast_table(seen: SeenOrders, values: Sequence[Fraction]) -> _ContrastTable:
    """Return values and orders, with a row for each participant."""
    people = {who: row for row, who in enumerate(dict.fromkeys(cell[0] for cell in seen.cells))}
    columns = {key: k for k, key in enumerate(dict.fromkeys(cell[1:] for cell in seen.cells))}
    table = np.full((2, len(people), len(columns)), np.nan)
    for cell, first, value in zip(seen.cells, seen.ours_first, values, strict=True):
        table[:, people[cell[0]], columns[cell[1:]]] = float(value), float(first)
    return _ContrastTable(table[0], table[1])


def _cannot(table: _ContrastTable) -> str:
    """Return why there is no effect of the order; empty if there may be one."""
    if not table.values.size:
        return NO_PAIR
    if not any(np.ptp(row[~np.isnan(row)]) > 0 for row in table.orders):
        return SAME_ORDER
    return ONE_PERSON if len(table.orders) == 1 else ""


def _residuals(table: Array) -> Array:
    """Return what least squares leave of a table without effects of rows and columns; 0 in gaps."""
    known = ~np.isnan(table)
    rows, columns = np.nonzero(known)
    design = np.zeros((rows.size, sum(table.shape)))
    design[np.arange(rows.size), rows] = 1.0
    design[np.arange(rows.size), table.shape[0] + columns] = 1.0
    given = table[known]
    left = np.zeros(table.shape)
    left[known] = given - design @ np.linalg.lstsq(design, given, rcond=None)[0]
    return left


def _rarest(orders: Array) -> float:
    """Return the share of the rarer order, in the sequence in which it is rarest."""
    share = np.nanmean(orders, axis=0)
    return float(np.minimum(share, 1 - share).min())


def _step(seen: SeenOrders, values: Sequence[Fraction]) -> float:
    """Return the smallest difference between two contrasts that such values can show [rating points]."""
    own: dict[str, dict[bool, list[Fraction]]] = {}
    for (who, *_), first, value in zip(seen.cells, seen.ours_first, values, strict=True):
        own.setdefault(who, {True: [], False: []})[first].append(value)
    contrasts = [
        sum(one[True], Fraction(0)) / len(one[True]) - sum(one[False], Fraction(0)) / len(one[False])
        for one in own.values()
        if all(one.values())
    ]
    return 1 / common_denominator(contrasts)


def _permuted_p(
    table: _ContrastTable, value: Array, rng: np.random.Generator, permutations: int
) -> float | None:
    """Return p of the orders, exchanged between participants who saw the same sequences as often."""
    agreement = np.nan_to_num(table.orders) @ value.T  # of one's orders with another's values
    groups: dict[bytes, list[int]] = {}
    for row, orders in enumerate(table.orders):
        groups.setdefault(np.isnan(orders).tobytes(), []).append(row)
    # Only the sum within a group can change: about its mean, so that both sides count alike.
    found, drawn = 0.0, np.zeros(permutations)
    for rows in groups.values():
        own = agreement[np.ix_(rows, rows)]
        own = own - own.mean()
        found += float(np.trace(own))
        given = rng.permuted(np.tile(np.arange(len(rows)), (permutations, 1)), axis=1)
        drawn += own[given, np.arange(len(rows))].sum(axis=1)
    if len(groups) == len(table.orders):
        return None
    return (1 + int(np.sum(np.abs(drawn) >= abs(found) - NONE))) / (1 + permutations)

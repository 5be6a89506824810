"""One effect of the order of two versions, beside people and sequences: estimate, interval, test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from evenlight.analysis.inference.paired_effects import Effect, mean_difference
from evenlight.analysis.rating.rating_pairs import common_denominator
from evenlight.data_schema.arrays import Array

PERMUTATIONS = 9999
SAME_ORDER = "nobody saw both orders"
ONE_PERSON = "one participant: the order cannot be told from what the versions do in single sequences"
NOT_APART = "each sequence was shown in one order only: the order cannot be told from the sequence"
UNEVEN = "either order is not as frequent: the interval, by few people, may hold less than it says"
RARE = 0.3  # share of the rarer order in a sequence below which `UNEVEN` is said
NONE = 1e-9


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
class _Table:
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
    table = _table(seen, values)
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


def _table(seen: SeenOrders, values: Sequence[Fraction]) -> _Table:
    """Return values and orders, with a row for each participant."""
    people = {who: row for row, who in enumerate(dict.fromkeys(cell[0] for cell in seen.cells))}
    columns = {key: k for k, key in enumerate(dict.fromkeys(cell[1:] for cell in seen.cells))}
    table = np.full((2, len(people), len(columns)), np.nan)
    for cell, first, value in zip(seen.cells, seen.ours_first, values, strict=True):
        table[:, people[cell[0]], columns[cell[1:]]] = float(value), float(first)
    return _Table(table[0], table[1])


def _cannot(table: _Table) -> str:
    """Return why there is no effect of the order; empty if there may be one."""
    if not table.values.size:
        return SAME_ORDER
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


def _permuted_p(table: _Table, value: Array, rng: np.random.Generator, permutations: int) -> float | None:
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

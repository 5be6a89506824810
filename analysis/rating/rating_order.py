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

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np

from evenlight.analysis.inference import exact_tests
from evenlight.analysis.inference.paired_effects import Effect, group_difference, mean_difference
from evenlight.analysis.rating.rating_pairs import ADJUSTED_T, ALL, ONE, POINTS, Ratings, Sample, mean_of
from evenlight.analysis.report import Section
from evenlight.analysis.report_prose import section
from evenlight.analysis.rows import flag, p, table_of, with_interval
from evenlight.analysis.wording import in_words, of_track
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.rating_scale import exact
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

PERMUTATIONS = 9999
PLACE = "shown second less shown first"
CARRY_OVER = "mean of both versions, ours first less ours second"
NO_PAIR = "nobody has rated both versions in an order that is known"
RARE = 0.3  # share of the rarer order in a sequence below which an interval may hold less than it says
NONE = 1e-9
MOST_WORK = 2e8  # of an exact test between groups, n² Σ |score|: half a second
ANOTHER = "another method than that of p: they may disagree"

Contrast = tuple[Effect, int]  # between the two orders [rating points], with its p; and of how many people
# Of participant, sequence and repetition: whether ours came first, and a value.
Seen = Mapping[tuple[str, str, int], tuple[bool, Fraction]]


def describe_order(ratings: Ratings, rng: np.random.Generator) -> Section:
    """Add what the order does, within people and in each sequence; return the section on it."""
    unit = ratings.data.scale.unit
    overall, by_sequence = order_effects(ratings.data.trials, ratings.sequences, rng, unit=unit)
    within = (
        f"beside people and sequences; {PERMUTATIONS} permutations of the orders among participants; "
        f"interval: {ADJUSTED_T} ({ANOTHER})"
    )
    for what, contrast in overall.items():
        ratings.rows.add("order", ALL, what, POINTS, within, *contrast)
    between = (
        f"exact permutation test between the two orders; interval: Welch's t with pseudo answers ({ANOTHER})"
    )
    adjusted = exact_tests.holm([effect.p_value for effect, _ in by_sequence.values()])
    what, add = "ours less baseline, ours first less ours second", partial(ratings.rows.add, "order")
    for (name, contrast), holm in zip(by_sequence.items(), adjusted, strict=True):
        add(name, what, POINTS, between, *contrast, p_adjusted=holm)
    rows = ratings.rows.of("order")
    if all(row.value is None for row in rows):
        return section("rating_order", unknown=rows[0].flag)
    of = ": difference with the track first less that with the track second"
    table = table_of(
        "Effects of the order [rating points] with exact tests and confidence intervals (CI). The p of "
        "single sequences are not adjusted here; rating_statistics.csv has the adjusted ones too.",
        [(of_track(row.what) if row.group == ALL else f"{in_words(row.group)}{of}", row) for row in rows],
        (with_interval, p, lambda row: (row.n if row else None,), flag),
        ("effect", "value", "95 % CI", "p", "n", "remark"),
    )
    return section("rating_order", (table,), unknown="")


def order_effects(
    trials: Iterable[RatingTrial],
    sequences: Sequence[str],
    rng: np.random.Generator,
    permutations: int = PERMUTATIONS,
    unit: Fraction = ONE,
) -> tuple[dict[str, Contrast], dict[str, Contrast]]:
    """Return what the order does; `unit` is that of the scale.

    First within participants: how much higher the version shown second is rated (`PLACE`), and by how much
    the mean of both is higher with ours first (`CARRY_OVER`); p counts the data among the permutations
    (Edgington 1969). Then by sequence: the difference of those who saw ours first, less that of the others.
    """
    pairs = ordered_pairs(trials)
    halves = {
        PLACE: {cell: (first, -difference) for cell, (first, difference, _) in pairs.items()},
        CARRY_OVER: {cell: (first, total) for cell, (first, _, total) in pairs.items()},
    }
    overall = {what: _within_people(seen, rng, permutations, unit) for what, seen in halves.items()}
    return overall, {
        name: _between_people({cell: own[:2] for cell, own in pairs.items() if cell[1] == name}, unit)
        for name in sequences
    }


def ordered_pairs(
    trials: Iterable[RatingTrial],
) -> dict[tuple[str, str, int], tuple[bool, Fraction, Fraction]]:
    """Return of each pair that was rated in order whether ours came first, their difference, and their sum.

    Keys are participant, sequence and number of the repetition; the unit is rating points.
    """
    found: dict[tuple[str, str, str, int], dict[Version, RatingTrial]] = {}
    for trial in trials:
        key = (trial.participant_id, trial.session_id, trial.sequence, trial.repetition)
        found.setdefault(key, {})[trial.version] = trial
    pairs, times = {}, Counter[tuple[str, str]]()
    for (who, _, name, _), own in found.items():
        if {trial.place_in_pair for trial in own.values()} == {1, 2}:
            ours, baseline = own[Version.OURS], own[Version.BASELINE]
            times[who, name] += 1
            one, other = exact(ours.rating), exact(baseline.rating)
            pairs[who, name, times[who, name]] = (ours.place_in_pair == 1, one - other, one + other)
    return pairs


def _between_people(seen: Seen, unit: Fraction) -> Contrast:
    """Return by how much the difference in a sequence depends on the order."""
    own: dict[str, dict[bool, list[Fraction]]] = {}
    for (who, *_), (first, difference) in seen.items():
        own.setdefault(who, {True: [], False: []})[first].append(difference)
    groups = [[mean_of(by[first]) for by in own.values() if by[first]] for first in (True, False)]
    if any(all(by.values()) for by in own.values()) or not all(groups):
        why = "no two groups: all saw the same order, or a participant saw both" if seen else NO_PAIR
        return Effect(None, flag=why), len(own)
    both = Sample({str(k): mean for k, mean in enumerate([*groups[0], *groups[1]])}, unit)
    tested, rounding = both.for_tests(MOST_WORK / len(both.of))
    scores, n = tested.scores, len(groups[0])
    p_value = exact_tests.group_p_value(scores[:n], scores[n:])
    ours_first, second = ([float(mean) for mean in group] for group in groups)
    effect = group_difference(ours_first, second, both.step)
    return replace(effect, p_value=p_value, flag=effect.flag or rounding), len(own)


def _within_people(seen: Seen, rng: np.random.Generator, permutations: int, unit: Fraction) -> Contrast:
    """Return how much larger a value, given in halves, is with ours first, beside people and sequences."""
    people = {who: row for row, who in enumerate(dict.fromkeys(cell[0] for cell in seen))}
    columns = {key: k for k, key in enumerate(dict.fromkeys(cell[1:] for cell in seen))}
    orders, values = np.full((2, len(people), len(columns)), np.nan)
    for cell, (first, halves) in seen.items():
        place = people[cell[0]], columns[cell[1:]]
        orders[place], values[place] = first, halves / 2
    n = len(people)
    if why := _no_contrast(orders):
        return Effect(None, flag=why), n
    order, value = _residuals(orders), _residuals(values)
    squares = float(np.sum(order**2))
    if squares < NONE:
        why = "each sequence was shown in one order only: the order cannot be told from the sequence"
        return Effect(None, flag=why), n
    slope = float(np.sum(order * value)) / squares
    # A participant's share in the slope, so scaled that their mean is the slope and that their scatter is its
    # standard error by participants, with the leverage of each (Bell & McCaffrey 2002).
    leverage = np.minimum(1 / n + np.sum(order**2, axis=1) / squares, 0.9)
    apart = n / squares * np.sum(order * (value - slope * order), axis=1) / np.sqrt(1 - leverage)
    shares = slope + apart - apart.mean()
    effect = mean_difference(np.where(np.abs(shares) < NONE, 0.0, shares), _step(orders, values, unit))
    common = np.nanmean(orders, axis=0)
    uneven = "either order is not as frequent: the interval, by few people, may hold less than it says"
    flags = [effect.flag, uneven if np.minimum(common, 1 - common).min() < RARE else ""]
    p_value = _permuted_p(orders, value, rng, permutations)
    return replace(effect, flag="; ".join(own for own in flags if own), p_value=p_value), n


def _no_contrast(orders: Array) -> str:
    if not orders.size:
        return NO_PAIR
    if not any(np.ptp(row[~np.isnan(row)]) > 0 for row in orders):
        return "nobody saw both orders"
    alone = "one participant: the order cannot be told from what the versions do in single sequences"
    return alone if len(orders) == 1 else ""


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


def _step(orders: Array, values: Array, unit: Fraction) -> float:
    """Return the smallest difference between two contrasts that such values can show [rating points]."""

    def mean(row: Array) -> Fraction:
        return mean_of([exact(float(x)) for x in row])

    own = zip(orders, values, strict=True)
    halves = [(row[order == 1], row[order == 0]) for order, row in own]
    contrasts = [mean(first) - mean(second) for first, second in halves if first.size and second.size]
    return Sample({str(k): contrast for k, contrast in enumerate(contrasts)}, unit).step


def _permuted_p(orders: Array, value: Array, rng: np.random.Generator, permutations: int) -> float | None:
    """Return p of the orders, exchanged between participants who saw the same sequences as often."""
    agreement = np.nan_to_num(orders) @ value.T  # of one's orders with another's values
    groups: dict[bytes, list[int]] = {}
    for row, own in enumerate(orders):
        groups.setdefault(np.isnan(own).tobytes(), []).append(row)
    if len(groups) == len(orders):
        return None
    # Only the sum within a group can change: about its mean, so that both sides count alike.
    found, drawn = 0.0, np.zeros(permutations)
    for rows in groups.values():
        centred = agreement[np.ix_(rows, rows)]
        centred = centred - centred.mean()
        found += float(np.trace(centred))
        given = rng.permuted(np.tile(np.arange(len(rows)), (permutations, 1)), axis=1)
        drawn += centred[given, np.arange(len(rows))].sum(axis=1)
    return (1 + int(np.sum(np.abs(drawn) >= abs(found) - NONE))) / (1 + permutations)

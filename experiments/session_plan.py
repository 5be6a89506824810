"""The plan of a session: which level comes when, in blocks and passes, before any answer is known.

A block is a condition. Within a block the ramps come in passes, each of which holds every cell equally often
in a random order, so that drift and fatigue fall upon all of them alike; catch trials are spread evenly over
the passes and over the levels (docs/decisions/order-of-trials.md).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from evenlight.data_schema.display import Display
from evenlight.data_schema.ramp import Placement, Procedure, RampDesign
from evenlight.experiments.counterbalancing import williams_row
from evenlight.experiments.design import (
    RampCondition,
    RampLevel,
    ramp_conditions,
    ramp_levels,
    ramps_per_level,
    trial_count,
)
from evenlight.experiments.keyed_chance import Purpose, generator_for

SHORTEST_PASS = 8  # ramps: in shorter ones, the last trials of each could be foretold


@dataclass(frozen=True, slots=True)
class Slot:
    """One trial of the plan, whose rate adaptive placement leaves open.

    Attributes
    ----------
    number : int
        Place in the plan, from 0.
    block : int
        From 1.
    level : RampLevel
        Where it sets out.
    condition : RampCondition
        Screen, direction and duration.
    is_catch : bool
        Whether nothing changes.
    rate_index : int or None
        Which of the design's rates; None where adaptive placement decides, and in a catch trial.
    ramp_interval : int or None
        Which of two intervals holds the ramp; None in yes/no.
    """

    number: int
    block: int
    level: RampLevel
    condition: RampCondition
    is_catch: bool = False
    rate_index: int | None = None
    ramp_interval: int | None = None


@dataclass(frozen=True, slots=True)
class _Cell:
    """What a pass shows: a level, at a rate or at one that is left open; all but the place of a slot."""

    level: RampLevel
    is_catch: bool = False
    rate_index: int | None = None
    ramp_interval: int | None = None


def session_plan(design: RampDesign, display: Display, seed: int, order_index: int) -> tuple[Slot, ...]:
    """Return the trials of a session in order.

    Parameters
    ----------
    design : RampDesign
        Which ramps, how often.
    display : Display
        What they are shown on.
    seed, order_index : int
        Of the session; `order_index` is also the row of the counterbalanced order of blocks.
    """
    conditions = ramp_conditions(design)
    catches = _catches_by_condition(design, display, seed, order_index)
    slots: list[Slot] = []
    for block, which in enumerate(williams_row(len(conditions), order_index), start=1):
        for cell in _block(design, display, which, catches[which], (seed, order_index)):
            slots.append(
                Slot(
                    number=len(slots),
                    block=block,
                    level=cell.level,
                    condition=conditions[which],
                    is_catch=cell.is_catch,
                    rate_index=cell.rate_index,
                    ramp_interval=cell.ramp_interval,
                )
            )
    return tuple(slots)


def levels_of(design: RampDesign, display: Display, condition: RampCondition) -> list[RampLevel]:
    """Return the levels of a condition: those of its screen."""
    return [level for level in ramp_levels(design, display) if level.screen == condition.screen]


def _catches_by_condition(
    design: RampDesign, display: Display, seed: int, order_index: int
) -> list[list[RampLevel]]:
    """Return the levels of the catch trials of each condition, in the order in which they come.

    They are spread over levels and conditions as evenly as their number allows; where it does not go into
    the number of levels, chance decides which get one more.
    """
    conditions = ramp_conditions(design)
    places = [(which, level) for which, c in enumerate(conditions) for level in levels_of(design, display, c)]
    rng = generator_for(seed, order_index, Purpose.CATCH_LEVELS)
    order: list[list[RampLevel]] = [[] for _ in conditions]
    left = trial_count(design)[1]
    while left:
        for place in rng.permutation(len(places))[:left]:
            which, level = places[place]
            order[which].append(level)
            left -= 1
    return order


def _block(
    design: RampDesign,
    display: Display,
    which: int,
    catches: Sequence[RampLevel],
    session: tuple[int, int],
) -> list[_Cell]:
    """Return the trials of a block in order: passes, each shuffled, with their share of the catch trials."""
    passes = _passes(_ramps(design, display, which, session))
    total = sum(map(len, passes))
    offset = float(generator_for(*session, Purpose.CATCH_PLACES, which).random())
    trials: list[_Cell] = []
    shown = caught = 0
    for number, ramps in enumerate(passes):
        shown += len(ramps)
        due = math.floor(len(catches) * shown / total + offset) if shown < total else len(catches)
        mixed = [*ramps, *(_Cell(level, is_catch=True) for level in catches[caught:due])]
        caught = due
        order = generator_for(*session, Purpose.ORDER, which, number).permutation(len(mixed))
        trials += [mixed[i] for i in order]
    return trials


def _ramps(
    design: RampDesign, display: Display, which: int, session: tuple[int, int]
) -> list[tuple[_Cell, ...]]:
    """Return the ramps of a block, one tuple for each repetition of all cells."""
    levels = levels_of(design, display, ramp_conditions(design)[which])
    constant = design.placement is Placement.CONSTANT
    rate_indices = range(len(design.relative_rates)) if constant else (None,)
    repetitions = design.repetitions if constant else ramps_per_level(design)
    columns = []
    for number, (level, rate_index) in enumerate(itertools.product(levels, rate_indices)):
        intervals = _intervals(design, repetitions, session, (which, number))
        columns.append(
            [_Cell(level, rate_index=rate_index, ramp_interval=interval) for interval in intervals]
        )
    return list(zip(*columns, strict=True))


def _passes(repetitions: list[tuple[_Cell, ...]]) -> list[list[_Cell]]:
    """Return the passes: as many repetitions in each as make it long enough."""
    together = math.ceil(SHORTEST_PASS / len(repetitions[0]))
    return [
        list(itertools.chain.from_iterable(repetitions[start : start + together]))
        for start in range(0, len(repetitions), together)
    ]


def _intervals(
    design: RampDesign, n: int, session: tuple[int, int], key: tuple[int, int]
) -> list[int | None]:
    """Return in which interval each of n ramps is: half of them in each, in random order."""
    if design.procedure is Procedure.YES_NO:
        return [None] * n
    rng = generator_for(*session, Purpose.INTERVALS, *key)
    odd = int(rng.integers(2))
    return [1 + (int(i) + odd) % 2 for i in rng.permutation(n)]

"""The plan of a ramp session (Section 3.4): its levels, its conditions, and which comes when.

A block is a condition. Within a block the ramps come in passes, each of which holds every cell equally often
in a random order, so that drift and fatigue affect all of them alike; catch trials are spread evenly over
the passes and over the levels (docs/decisions/order-of-trials.md).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import Direction, Placement, Procedure, RampDesign
from evenlight.experiments.chance import Purpose, generator_for, williams_row
from evenlight.method.contrast.luminance import dimmed_luminance, displayed_luminance

SHORTEST_PASS = 8  # ramps: in shorter ones, the last trials of each could be foretold


@dataclass(frozen=True, slots=True)
class RampLevel:
    """One uniform screen at one brightness factor, before its ramp."""

    screen: str  # "white" or "gray"
    factor: float  # initial brightness factor b
    luminance: float  # initial luminance L = b · I + L_refl, I what the screen emits at b = 1 [cd/m^2]
    pixel_value: float = 1.0  # L' of the screen, in [0, 1]


@dataclass(frozen=True, slots=True)
class RampCondition:
    """What stays the same throughout a block: screen, direction, and duration of the ramp [s]."""

    screen: str
    direction: Direction
    duration: float


@dataclass(frozen=True, slots=True)
class PlannedRamp:
    """A trial of the session, not yet answered."""

    level: RampLevel  # where it sets out
    rate: float  # rate of change [cd/m^2/s], at least 0 whichever way the luminance goes; 0 in a catch trial
    final_luminance: float  # where it ends [cd/m^2]
    direction: Direction = Direction.DOWN  # which way the luminance goes, or would go in a catch trial
    duration: float = 5.0  # of the ramp [s]
    ramp_interval: int | None = None  # which of two intervals holds the ramp, 1 or 2; None in yes/no
    block: int = 1  # from 1; 0 for practice
    practice: bool = False  # whether it is left out of the analysis

    @property
    def is_catch(self) -> bool:
        """Whether nothing changes."""
        return self.rate == 0

    @property
    def columns(self) -> dict[str, Any]:
        """What the row of the answered trial says of it, by the attributes of `RampTrial`."""
        return {
            "screen": self.level.screen,
            "factor": self.level.factor,
            "initial_luminance": self.level.luminance,
            "final_luminance": self.final_luminance,
            "rate": self.rate,
            "duration": self.duration,
            "is_catch": self.is_catch,
            "procedure": Procedure.TWO_INTERVAL if self.ramp_interval else Procedure.YES_NO,
            "direction": self.direction,
            "ramp_interval": self.ramp_interval,
            "practice": self.practice,
            "block": self.block,
        }


def ramp_levels(design: RampDesign, display: Display) -> tuple[RampLevel, ...]:
    """Return the levels of a design on a display: each of its screens at every factor.

    >>> display = Display("d", 100.0, 0.0, 2.0, 30.0)
    >>> design = RampDesign(factors=(0.5, 1.0), gray_pixel_value=0.5)
    >>> [(level.screen, level.luminance) for level in ramp_levels(design, display)]
    [('white', 50.0), ('white', 100.0), ('gray', 12.5), ('gray', 25.0)]
    """
    pixel_values = {"white": design.white_pixel_value, "gray": design.gray_pixel_value}
    levels = []
    for screen in design.screens:
        emitted = float(displayed_luminance(pixel_values[screen], display)) - display.reflected_luminance
        levels += [
            RampLevel(screen, factor, float(dimmed_luminance(emitted, factor, display)), pixel_values[screen])
            for factor in design.factors
        ]
    return tuple(levels)


def ramp_conditions(design: RampDesign) -> tuple[RampCondition, ...]:
    """Return the conditions of a design, each of which is a block: screen by direction by duration.

    >>> [condition.screen for condition in ramp_conditions(RampDesign())]
    ['white', 'gray']
    """
    return tuple(
        RampCondition(screen, direction, duration)
        for screen in design.screens
        for direction in design.directions
        for duration in design.ramp_durations
    )


def trial_count(design: RampDesign) -> tuple[int, int]:
    """Return the number of ramps and of catch trials of a session; practice is not counted.

    >>> trial_count(RampDesign(factors=(1.0,), relative_rates=(0.02, 0.04), repetitions=4, catch_share=0.2))
    (16, 4)
    """
    ramps = len(ramp_conditions(design)) * len(design.factors) * ramps_per_level(design)
    share = design.catch_share if design.has_catch_trials else 0.0
    return ramps, round(ramps * share / (1 - share))


def ramps_per_level(design: RampDesign) -> int:
    """Return how many ramps each level has in each of its blocks.

    >>> ramps_per_level(RampDesign(relative_rates=(0.02, 0.04), repetitions=4))
    8
    """
    if design.placement is Placement.CONSTANT:
        return len(design.relative_rates) * design.repetitions
    return design.trials_per_level


def planned_ramp(
    level: RampLevel,
    condition: RampCondition,
    rate: float,
    *,
    ramp_interval: int | None = None,
    block: int = 0,
) -> PlannedRamp:
    """Return a trial at a level: the luminance changes linearly at a rate [cd/m^2/s]; block 0 is practice.

    >>> white = RampLevel("white", 1.0, 100.0)
    >>> planned_ramp(white, RampCondition("white", Direction.DOWN, 5.0), 2.0, block=1).final_luminance
    90.0
    """
    change = rate * condition.duration * (1 if condition.direction is Direction.UP else -1)
    return PlannedRamp(
        level=level,
        rate=rate,
        final_luminance=level.luminance + change,
        direction=condition.direction,
        duration=condition.duration,
        ramp_interval=ramp_interval,
        block=block,
        practice=block == 0,
    )


@dataclass(frozen=True, slots=True)
class Slot:
    """One trial of the plan, whose rate adaptive placement leaves open."""

    number: int  # place in the plan, from 0
    block: int  # from 1
    level: RampLevel  # where it sets out
    condition: RampCondition  # screen, direction and duration
    is_catch: bool = False  # whether nothing changes
    # which of the design's rates; None where adaptive placement decides, and in a catch trial
    rate_index: int | None = None
    ramp_interval: int | None = None  # which of two intervals holds the ramp; None in yes/no


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

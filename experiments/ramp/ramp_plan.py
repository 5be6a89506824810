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

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import Direction, Placement, Procedure, RampDesign
from evenlight.experiments.chance import Purpose, generator_for, williams_row
from evenlight.experiments.sessions.fixed_order import PlannedTrial
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
) -> PlannedTrial:
    """Return a trial at a level: the luminance changes linearly at a rate [cd/m^2/s]; block 0 is practice.

    Its row is that of `RampTrial`: the rate is at least 0 whichever way the luminance goes, and 0 in a catch
    trial; `ramp_interval` says which of two intervals holds the ramp, 1 or 2, and is None in yes/no. Its
    `level` is kept too.

    >>> white = RampLevel("white", 1.0, 100.0)
    >>> planned_ramp(white, RampCondition("white", Direction.DOWN, 5.0), 2.0, block=1).final_luminance
    90.0
    """
    change = rate * condition.duration * (1 if condition.direction is Direction.UP else -1)
    return PlannedTrial(
        {"level": level},
        screen=level.screen,
        factor=level.factor,
        initial_luminance=level.luminance,
        final_luminance=level.luminance + change,
        rate=rate,
        duration=condition.duration,
        is_catch=rate == 0,
        procedure=Procedure.TWO_INTERVAL if ramp_interval else Procedure.YES_NO,
        direction=condition.direction,
        ramp_interval=ramp_interval,
        practice=block == 0,
        block=block,
    )


def _slot(
    level: RampLevel,
    *,
    is_catch: bool = False,
    rate_index: int | None = None,
    ramp_interval: int | None = None,
) -> PlannedTrial:
    """Return a trial of the plan, but for its place: which of the design's rates, if any is decided."""
    shown = {"level": level, "rate_index": rate_index}
    return PlannedTrial(shown, is_catch=is_catch, ramp_interval=ramp_interval)


def session_plan(
    design: RampDesign, display: Display, seed: int, order_index: int
) -> tuple[PlannedTrial, ...]:
    """Return the trials of a session in order, whose rates adaptive placement leaves open.

    Each has its `number`, from 0, `block`, from 1, `level`, `condition`, `is_catch`, `ramp_interval` and
    `rate_index`: which of the design's rates, None in a catch trial and where the answers decide.

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
    slots: list[PlannedTrial] = []
    for block, which in enumerate(williams_row(len(conditions), order_index), start=1):
        for slot in _block(design, display, which, catches[which], (seed, order_index)):
            slots.append(slot.but(number=len(slots), block=block, condition=conditions[which]))
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
) -> list[PlannedTrial]:
    """Return the trials of a block in order: passes, each shuffled, with their share of the catch trials."""
    passes = _passes(_ramps(design, display, which, session))
    total = sum(map(len, passes))
    offset = float(generator_for(*session, Purpose.CATCH_PLACES, which).random())
    trials: list[PlannedTrial] = []
    shown = caught = 0
    for number, ramps in enumerate(passes):
        shown += len(ramps)
        due = math.floor(len(catches) * shown / total + offset) if shown < total else len(catches)
        mixed = [*ramps, *(_slot(level, is_catch=True) for level in catches[caught:due])]
        caught = due
        order = generator_for(*session, Purpose.ORDER, which, number).permutation(len(mixed))
        trials += [mixed[i] for i in order]
    return trials


def _ramps(
    design: RampDesign, display: Display, which: int, session: tuple[int, int]
) -> list[tuple[PlannedTrial, ...]]:
    """Return the ramps of a block, one tuple for each repetition of all cells."""
    levels = levels_of(design, display, ramp_conditions(design)[which])
    constant = design.placement is Placement.CONSTANT
    rate_indices = range(len(design.relative_rates)) if constant else (None,)
    repetitions = design.repetitions if constant else ramps_per_level(design)
    columns = []
    for number, (level, rate_index) in enumerate(itertools.product(levels, rate_indices)):
        intervals = _intervals(design, repetitions, session, (which, number))
        columns.append(
            [_slot(level, rate_index=rate_index, ramp_interval=interval) for interval in intervals]
        )
    return list(zip(*columns, strict=True))


def _passes(repetitions: list[tuple[PlannedTrial, ...]]) -> list[list[PlannedTrial]]:
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

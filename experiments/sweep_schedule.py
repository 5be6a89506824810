"""The readings of a sweep in their order: warm-up, levels in random order, a repeat at the end.

Each repeat of the levels has an order of its own: whatever drifts, drifts over all levels alike.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.sweep import LuminanceSweepDesign, PowerSweepDesign, SweepDesign, SweepPhase


@dataclass(frozen=True, slots=True)
class Level:
    """What a screen shows.

    Attributes
    ----------
    pixel_value : float
        L' of a uniform screen.
    factor : float or None
        Brightness factor b; None at full brightness, where pixel values are swept.
    """

    pixel_value: float
    factor: float | None


@dataclass(frozen=True, slots=True)
class PlannedReading:
    """A reading that is to be made.

    Attributes
    ----------
    index : int
        Its place in the sweep, from 0.
    phase : SweepPhase
        What it is for.
    repeat : int
        Which reading of its level, from 1.
    level : Level
        What is shown.
    due : float
        When at the earliest, since the first reading of the warm-up began [s]; 0 after the warm-up.
    """

    index: int
    phase: SweepPhase
    repeat: int
    level: Level
    due: float = 0.0


def planned_readings(
    design: SweepDesign, seed: int, *, with_factors: bool = True, by_hand: bool = False
) -> list[PlannedReading]:
    """Return the readings of a sweep, in order; the same for the same seed.

    Parameters
    ----------
    design : LuminanceSweepDesign or PowerSweepDesign
        What is measured.
    seed : int
        Of the order.
    with_factors : bool, optional
        Whether brightness factors can be shown.
    by_hand : bool, optional
        Whether a person reads the meter: then the warm-up is read at its beginning and its end only.

    >>> design = PowerSweepDesign(factors=(0.2, 0.6, 1.0), warm_up=120.0, warm_up_interval=60.0)
    >>> readings = planned_readings(design, seed=1)
    >>> len(readings), [reading.due for reading in readings[:3]]  # 3 of warm-up, 3 x 3, 3 at the end
    (15, [0.0, 60.0, 120.0])
    """
    rng = np.random.default_rng(seed)
    white = Level(1.0, None if isinstance(design, LuminanceSweepDesign) else 1.0)
    times = _warm_up(design)
    if by_hand:
        times = [times[0], *times[1:][-1:]]
    warm = [(SweepPhase.WARM_UP, repeat, white, due) for repeat, due in enumerate(times, start=1)]
    swept = _repeated(SweepPhase.SWEEP, levels_of(design, with_factors=with_factors), design.repeats, rng)
    last = _repeated(SweepPhase.DRIFT, _drift_levels(design), design.repeats, rng)
    readings = [PlannedReading(0, *reading) for reading in warm]
    readings += [PlannedReading(0, *reading) for reading in (*swept, *last)]
    return [dataclasses.replace(reading, index=index) for index, reading in enumerate(readings)]


def levels_of(design: SweepDesign, *, with_factors: bool = True) -> list[Level]:
    """Return the levels of a design, each once."""
    if isinstance(design, PowerSweepDesign):
        return [Level(1.0, factor) for factor in design.factors]
    factors = design.factors if with_factors else ()
    return [Level(value, None) for value in design.pixel_values] + [Level(1.0, factor) for factor in factors]


def _drift_levels(design: SweepDesign) -> list[Level]:
    """Return the levels that are measured again at the end."""
    if isinstance(design, PowerSweepDesign):
        return [Level(1.0, factor) for factor in design.drift_factors]
    return [Level(value, None) for value in design.drift_pixel_values]


def _warm_up(design: SweepDesign) -> list[float]:
    """Return when the warm-up is read: at its beginning, every interval, and at its end [s].

    Without a warm-up the white screen is read once all the same: some meters leave their remote mode when a
    dark screen is the first that they see.
    """
    steps = math.ceil(design.warm_up / design.warm_up_interval - 1e-9)
    return [step * design.warm_up_interval for step in range(steps)] + [design.warm_up]


def _repeated(
    phase: SweepPhase, levels: Sequence[Level], repeats: int, rng: np.random.Generator
) -> list[tuple[SweepPhase, int, Level]]:
    """Return some levels several times, each time in another order."""
    orders = [rng.permutation(len(levels)) for _ in range(repeats)]
    return [(phase, repeat, levels[i]) for repeat, order in enumerate(orders, start=1) for i in order]

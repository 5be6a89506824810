"""The design of a ramp session: its levels, its conditions, and the ramps that it asks for (Section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.ramp import Direction, Placement, Procedure, RampDesign
from evenlight.method.luminance import dimmed_luminance, displayed_luminance


@dataclass(frozen=True, slots=True)
class RampLevel:
    """One uniform screen at one brightness factor, before its ramp.

    Attributes
    ----------
    screen : str
        "white" or "gray".
    factor : float
        Initial brightness factor b.
    luminance : float
        Initial luminance L = b · I + L_refl, I what the screen emits at b = 1 [cd/m^2].
    pixel_value : float
        L' of the screen, in [0, 1].
    """

    screen: str
    factor: float
    luminance: float
    pixel_value: float = 1.0


@dataclass(frozen=True, slots=True)
class RampCondition:
    """What stays the same throughout a block: screen, direction, and duration of the ramp [s]."""

    screen: str
    direction: Direction
    duration: float


@dataclass(frozen=True, slots=True)
class PlannedRamp:
    """A trial of the session, not yet answered.

    Attributes
    ----------
    level : RampLevel
        Where it sets out.
    rate : float
        Rate of change [cd/m^2/s], at least 0 whichever way the luminance goes; 0 in a catch trial.
    final_luminance : float
        Where it ends [cd/m^2].
    direction : Direction
        Which way the luminance goes, or would go in a catch trial.
    duration : float
        Of the ramp [s].
    ramp_interval : int or None
        Which of two intervals holds the ramp, 1 or 2; None in yes/no.
    block : int
        From 1; 0 for practice.
    practice : bool
        Whether it is left out of the analysis.
    """

    level: RampLevel
    rate: float
    final_luminance: float
    direction: Direction = Direction.DOWN
    duration: float = 5.0
    ramp_interval: int | None = None
    block: int = 1
    practice: bool = False

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

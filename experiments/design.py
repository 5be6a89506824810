"""The order of a ramp session: which ramp comes when (Section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.ramp import RampDesign
from method.luminance import dimmed_luminance, displayed_luminance


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
    """

    screen: str
    factor: float
    luminance: float


@dataclass(frozen=True, slots=True)
class PlannedRamp:
    """A trial of the session, not yet answered.

    Attributes
    ----------
    level : RampLevel
        Where it sets out.
    rate : float
        Rate of decrease [cd/m^2/s]; 0 in a catch trial.
    final_luminance : float
        Where it ends [cd/m^2].
    """

    level: RampLevel
    rate: float
    final_luminance: float

    @property
    def is_catch(self) -> bool:
        """Whether nothing changes."""
        return self.rate == 0


def ramp_levels(design: RampDesign, display: Display) -> tuple[RampLevel, ...]:
    """Return the levels of a design on a display: both screens at every factor.

    >>> display = Display("d", 100.0, 0.0, 2.0, 30.0)
    >>> design = RampDesign(factors=(0.5, 1.0), gray_pixel_value=0.5)
    >>> [(level.screen, level.luminance) for level in ramp_levels(design, display)]
    [('white', 50.0), ('white', 100.0), ('gray', 12.5), ('gray', 25.0)]
    """
    pixel_values = {"white": design.white_pixel_value, "gray": design.gray_pixel_value}
    levels = []
    for screen, pixel_value in pixel_values.items():
        emitted = float(displayed_luminance(pixel_value, display)) - display.reflected_luminance
        levels += [
            RampLevel(screen, factor, float(dimmed_luminance(emitted, factor, display)))
            for factor in design.factors
        ]
    return tuple(levels)


def trial_count(design: RampDesign) -> tuple[int, int]:
    """Return the number of ramps and of catch trials of a session.

    >>> trial_count(RampDesign(factors=(1.0,), relative_rates=(0.02, 0.04), repetitions=4, catch_share=0.2))
    (16, 4)
    """
    ramps = 2 * len(design.factors) * len(design.relative_rates) * design.repetitions
    return ramps, round(ramps * design.catch_share / (1 - design.catch_share))


def ramp_order(design: RampDesign, display: Display, rng: np.random.Generator) -> list[PlannedRamp]:
    """Return the trials of a session in a random order, catch trials among them.

    Catch trials are spread over the levels as evenly as their number allows; where it does not go into the
    number of levels, chance decides which level gets one more.

    Parameters
    ----------
    design : RampDesign
        Which ramps, how often.
    display : Display
        What they are shown on.
    rng : numpy.random.Generator
        Source of the order.

    Raises
    ------
    InputError
        If a ramp would end below the luminance that the display reflects, which dimming cannot reach.
    """
    levels = ramp_levels(design, display)
    ramps = [
        _planned(level, relative * level.luminance, design, display)
        for level in levels
        for relative in design.relative_rates
        for _ in range(design.repetitions)
    ]
    each, over = divmod(trial_count(design)[1], len(levels))
    extra = set(rng.permutation(len(levels))[:over].tolist())
    catches = [
        _planned(level, 0.0, design, display)
        for index, level in enumerate(levels)
        for _ in range(each + (index in extra))
    ]
    trials = ramps + catches
    return [trials[i] for i in rng.permutation(len(trials))]


def _planned(level: RampLevel, rate: float, design: RampDesign, display: Display) -> PlannedRamp:
    """Return a trial, or refuse it if the display cannot get as dark."""
    final = level.luminance - rate * design.ramp_duration
    if final < display.reflected_luminance:
        raise InputError(
            f"the ramp from {level.luminance:.4g} cd/m^2 at {rate:.4g} cd/m^2/s would end at {final:.4g} "
            f"cd/m^2, below the {display.reflected_luminance:.4g} cd/m^2 that {display.name!r} reflects; "
            "take out the fastest relative_rates or the lowest factors of the design"
        )
    return PlannedRamp(level, rate, final)

"""A simulated luminance meter, and what any meter makes of light: noise, digits, range and time.

Ranges, digits and repeatability are those of catalogues, from memory: none was checked on an instrument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from evenlight.hardware.protocols import ContextDevice, Fault, Reading
from evenlight.hardware.simulated.panel import Simulation

if TYPE_CHECKING:
    import numpy as np

WORDS = {
    Fault.OVER_RANGE: "too bright for it: it measures up to {highest:g} cd/m^2",
    Fault.UNDER_RANGE: "too dark for it: it measures from {lowest:g} cd/m^2",
}


@dataclass(frozen=True, slots=True)
class MeterPhysics:
    """What is true of a simulated luminance meter."""

    # luminances between which it has a value [cd/m^2]
    lowest: float = 0.01
    highest: float = 299_900.0
    resolution: float = 0.01  # its smallest step [cd/m^2]
    significant_digits: int = 4  # that it shows of larger luminances
    proportional_noise: float = 0.002  # standard deviation of readings of the same light, as a share of it
    floor_noise: float = 0.002  # the same where there is no light [cd/m^2]
    calibration_error: float = 0.0  # share by which every reading is too high
    reading_time: float = 0.4  # that a reading of a bright screen takes [s]
    dark_reading_time: float = 3.0  # that one takes where there is next to no light [s]
    dim_luminance: float = 1.0  # where it takes half of the way from one to the other [cd/m^2]


def sensed(luminance: float, physics: MeterPhysics, rng: np.random.Generator) -> tuple[float, Fault | None]:
    """Return what a meter shows of a luminance [cd/m^2], and OVER_RANGE or UNDER_RANGE where it has no value.

    >>> import numpy as np
    >>> silent = MeterPhysics(proportional_noise=0.0, floor_noise=0.0)
    >>> sensed(123.456, silent, np.random.default_rng(0))
    (123.5, None)
    """
    sd = math.hypot(physics.proportional_noise * luminance, physics.floor_noise)
    seen = luminance * (1 + physics.calibration_error) + sd * float(rng.standard_normal())
    if seen < physics.lowest:
        return seen, Fault.UNDER_RANGE
    if seen > physics.highest:
        return seen, Fault.OVER_RANGE
    return in_digits(seen, physics), None


def in_digits(luminance: float, physics: MeterPhysics) -> float:
    """Return a luminance in the steps that a meter shows.

    >>> in_digits(0.0284, MeterPhysics()), in_digits(98764.0, MeterPhysics())
    (0.03, 98760.0)
    """
    if luminance == 0:
        return 0.0
    place = physics.significant_digits - 1 - math.floor(math.log10(abs(luminance)))
    step = max(physics.resolution, 10.0**-place)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return round(round(luminance / step) * step, decimals)


def reading_time(luminance: float, physics: MeterPhysics) -> float:
    """Return how long a reading takes: longer in the dark [s].

    >>> round(reading_time(1.0, MeterPhysics()), 3)
    1.7
    """
    dark_share = physics.dim_luminance / (physics.dim_luminance + max(luminance, 0.0))
    return physics.reading_time + (physics.dark_reading_time - physics.reading_time) * dark_share


class SimulatedLuminanceMeter(ContextDevice):
    """A luminance meter with noise, digits, range and reading time.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, noise, and the clock that a reading takes time on.
    physics : MeterPhysics, optional
        What is true of it.
    """

    _name = "the simulated luminance meter"

    def __init__(self, simulation: Simulation, physics: MeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or MeterPhysics()

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]: of the middle of the time that it takes.

        Raises
        ------
        InstrumentError
            If the panel is too bright or too dark for it, or it is closed.
        """
        self._require_open()
        simulation, physics = self._simulation, self._physics
        begun = simulation.clock()
        simulation.wait(reading_time(simulation.panel.luminance(), physics))
        ended = simulation.clock()
        luminance = simulation.panel.luminance((begun + ended) / 2)
        shown, fault = sensed(luminance, physics, simulation.rng)
        if fault is not None:
            words = WORDS[fault].format(lowest=physics.lowest, highest=physics.highest)
            raise self._error(words, fault)
        return Reading(shown, "cd/m^2", begun, ended, "simulated")

    def apparatus(self) -> dict[str, str]:
        """Return what is true of it."""
        physics = self._physics
        return {
            "model": "SIMULATED luminance meter",
            "noise": f"{physics.proportional_noise:g} of the luminance, and {physics.floor_noise:g} cd/m^2",
            "resolution": f"{physics.resolution:g} cd/m^2, {physics.significant_digits} digits",
            "range": f"{physics.lowest:g} to {physics.highest:g} cd/m^2",
            "calibration error": f"{physics.calibration_error:g} of the luminance",
        }

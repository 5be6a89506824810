"""A simulated luminance meter that looks at a simulated panel."""

from __future__ import annotations

from contextlib import AbstractContextManager

from evenlight.hardware.meter_physics import MeterPhysics, reading_time, sensed
from evenlight.hardware.protocols import Fault, InstrumentError, Reading
from evenlight.hardware.simulated_panel import Simulation

DEVICE = "the simulated luminance meter"
WORDS = {
    Fault.OVER_RANGE: "too bright for it: it measures up to {highest:g} cd/m^2",
    Fault.UNDER_RANGE: "too dark for it: it measures from {lowest:g} cd/m^2",
}


class SimulatedLuminanceMeter(AbstractContextManager["SimulatedLuminanceMeter"]):
    """A luminance meter with noise, digits, range and reading time.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, noise, and the clock that a reading takes time on.
    physics : MeterPhysics, optional
        What is true of it.
    """

    def __init__(self, simulation: Simulation, physics: MeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or MeterPhysics()
        self._is_open = True

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]: of the middle of the time that it takes.

        Raises
        ------
        InstrumentError
            If the panel is too bright or too dark for it, or it is closed.
        """
        if not self._is_open:
            raise InstrumentError(f"{DEVICE}: is closed", Fault.DISCONNECTED)
        simulation, physics = self._simulation, self._physics
        begun = simulation.clock()
        simulation.wait(reading_time(simulation.panel.luminance(), physics))
        ended = simulation.clock()
        luminance = simulation.panel.luminance((begun + ended) / 2)
        seen = sensed(luminance, physics, simulation.rng)
        if seen.fault is not None:
            words = WORDS[seen.fault].format(lowest=physics.lowest, highest=physics.highest)
            raise InstrumentError(f"{DEVICE}: {words}", seen.fault)
        return Reading(seen.luminance, "cd/m^2", begun, ended, "simulated")

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

    def close(self) -> None:
        """Let go of it; more than once does nothing."""
        self._is_open = False

    def __exit__(self, *_: object) -> None:
        self.close()

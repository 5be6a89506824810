"""What emulated luminance meters share: they look at the simulated panel, and take commands line by line."""

from __future__ import annotations

from abc import abstractmethod

from evenlight.hardware.meter_physics import MeterPhysics, Sensed, sensed
from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated_panel import Simulation

WHITE = (0.3127, 0.329)  # chromaticity of D65, which every emulated panel has


class EmulatedMeter:
    """A luminance meter at the other end of a link, which answers at once.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics
        What is true of it, but for the time that a reading takes.

    Attributes
    ----------
    fault : Fault or None
        What is wrong with the instrument itself from now on: OVER_RANGE, UNDER_RANGE, LOW_BATTERY.
    """

    def __init__(self, simulation: Simulation, physics: MeterPhysics) -> None:
        self._simulation, self._physics = simulation, physics
        self._came = b""
        self.fault: Fault | None = None

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, and answer the commands that are complete."""
        self._came += data
        answers = b""
        while (cut := self._end_of_command(self._came)) > 0:
            command, self._came = self._came[:cut], self._came[cut:]
            answers += self._answer(command.decode("ascii", errors="replace").strip("\r\n"))
        return answers

    def stream(self) -> bytes:
        """Return nothing: it speaks when it is asked."""
        return b""

    def _end_of_command(self, came: bytes) -> int:
        """Return how many bytes the first command has, 0 if it is not complete."""
        places = [came.find(ending) for ending in (b"\r\n", b"\r", b"\n") if ending in came]
        if not places:
            return 0
        first = min(places)
        return first + (2 if came[first : first + 2] == b"\r\n" else 1)

    def _look(self) -> Sensed:
        """Return what it makes of the panel now."""
        seen = sensed(self._simulation.panel.luminance(), self._physics, self._simulation.rng)
        return seen if self.fault is None else Sensed(seen.luminance, self.fault)

    @abstractmethod
    def _answer(self, command: str) -> bytes:
        """Return the answer to a command."""


def tristimulus(luminance: float) -> tuple[float, float, float]:
    """Return X, Y and Z of white light of a luminance [cd/m^2]."""
    x, y = WHITE
    return luminance * x / y, luminance, luminance * (1 - x - y) / y

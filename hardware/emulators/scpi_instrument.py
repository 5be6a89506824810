"""An emulated bench instrument that speaks SCPI and has the simulated panel at its terminals."""

from __future__ import annotations

from evenlight.hardware.simulated.panel import Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

SUPPLY = 5.0  # [V]
IDENTITY = "Evenlight,Emulated power analyser,EMULATED,1.0"
OVERLOAD = "9.9E37"
ALL = ("MEAS:POW?", "MEAS:VOLT?", "MEAS:CURR?")


class ScpiEmulator:
    """A SCPI instrument.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics, optional
        What is true of what it measures.
    known : tuple of str, optional
        The questions of measurement that it knows.
    identity : str, optional
        What it answers to *IDN?.

    Attributes
    ----------
    errors : list of str
        Its list of errors, oldest first; a test may add to it.
    """

    def __init__(
        self,
        simulation: Simulation,
        physics: PowerMeterPhysics | None = None,
        known: tuple[str, ...] = ALL,
        identity: str = IDENTITY,
    ) -> None:
        self._simulation, self._physics = simulation, physics or PowerMeterPhysics()
        self._known, self._identity = known, identity
        self._came = b""
        self.errors: list[str] = []

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a command, and return what is answered at once."""
        *lines, self._came = (self._came + data).split(b"\n")
        answers = (self._answer(line.decode("ascii", errors="replace").strip().upper()) for line in lines)
        return b"".join(f"{answer}\n".encode("ascii") for answer in answers if answer)

    def stream(self) -> bytes:
        """Return nothing: it speaks only when asked."""
        return b""

    def _answer(self, line: str) -> str:
        """Return the answer to one line."""
        if line in self._known:
            return self._measured(line)
        match line:
            case "*IDN?":
                return self._identity
            case "*CLS":
                self.errors.clear()
            case "SYST:ERR?":
                return self.errors.pop(0) if self.errors else '0,"No error"'
            case _:
                self.errors.append('-113,"Undefined header"')
        return ""

    def _measured(self, question: str) -> str:
        """Return a measured value, as NR3 numbers are written."""
        physics, simulation = self._physics, self._simulation
        true = simulation.panel.power()
        if true > physics.highest_power:
            return OVERLOAD
        noise = physics.noise * float(simulation.rng.standard_normal())
        power = true * (1 + physics.gain_error) + physics.zero_error + noise
        value = {"MEAS:POW?": power, "MEAS:VOLT?": SUPPLY, "MEAS:CURR?": power / SUPPLY}[question]
        return f"{value:+.6E}"

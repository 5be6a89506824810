"""An emulated power sensor under Linux's hwmon: files whose numbers are made when they are read."""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from evenlight.hardware.simulated.panel import Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

POLL = 0.0005  # [s] between two looks for a reader
BUS_VOLTAGE = 5.0  # [V]
CHIP = "ina226"
SHUNT_FULL_SCALE = (
    81.92  # [mV] at the end of an INA226's range; the shunt is one that makes them of the highest power
)


class HwmonEmulator(AbstractContextManager["HwmonEmulator"]):
    """A folder as Linux has one for a power sensor; power, current and voltage are named pipes.

    A named pipe reads like a file, and its number is made while it is read: none is older than that.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics, optional
        What is true of the sensor.

    Attributes
    ----------
    url : str
        The folder, which a driver opens.
    """

    def __init__(self, simulation: Simulation, physics: PowerMeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or PowerMeterPhysics()
        self._temporary = tempfile.TemporaryDirectory(prefix="evenlight-hwmon-")
        self.folder = Path(self._temporary.name)
        self.url = str(self.folder)
        (self.folder / "name").write_text(f"{CHIP}\n")
        (self.folder / "update_interval").write_text("2\n")  # [ms]
        highest = self._physics.highest_power
        self._files: dict[Path, Callable[[], float]] = {
            self.folder / "power1_input": lambda: self._power() * 1e6,
            self.folder / "curr1_input": lambda: self._power() / BUS_VOLTAGE * 1e3,
            self.folder / "in1_input": lambda: BUS_VOLTAGE * 1e3,
            self.folder / "in0_input": lambda: self._power() / highest * SHUNT_FULL_SCALE,
        }
        for path in self._files:
            os.mkfifo(path)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(timeout=5)
        self._temporary.cleanup()

    def _power(self) -> float:
        """Return the power that the sensor has now [W]."""
        physics, simulation = self._physics, self._simulation
        noise = physics.noise * float(simulation.rng.standard_normal())
        power = simulation.panel.power() * (1 + physics.gain_error) + physics.zero_error + noise
        return min(power, physics.highest_power)

    def _serve(self) -> None:
        """Give numbers to all readers, until the end."""
        while not self._ended.wait(POLL):
            for path, number in self._files.items():
                self._serve_file(path, number)

    def _serve_file(self, path: Path, number: Callable[[], float]) -> None:
        """Give a number to the reader of a file, if there is one."""
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:  # no reader, or it was taken away
            return
        try:
            # The next reader gets a pipe of its own: this one could not see where its number ends.
            fresh = path.with_suffix(".next")
            os.mkfifo(fresh)
            fresh.replace(path)
            os.write(descriptor, f"{round(number())}\n".encode())
        finally:
            os.close(descriptor)

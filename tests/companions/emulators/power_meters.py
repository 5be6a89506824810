"""Emulated power meters with the simulated panel: a Nordic PPK2, a SCPI instrument, a sensor under hwmon."""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from evenlight.hardware.drivers import nordic_ppk2 as stream
from evenlight.hardware.operating_system import require_unix
from evenlight.hardware.simulated.panel import Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SUPPLY = 5.0  # [V]
STEP = 0.0002  # [s] between two looks at the panel
RESISTANCES = (1003.35, 101.59, 10.30, 0.9636, 0.0564)  # [ohm] of the five ranges
RANGE_ENDS = (50e-6, 500e-6, 5e-3, 60e-3)  # [A] above which the next range is taken
OFFSET = 120.0  # of the converter, which the calibration takes off again
VOLTS_PER_COUNT = 1.8 / 163840 * 4  # 14 of the converter's 16 bits are sent
COMMAND_LENGTHS = {0x0C: 2, 0x0D: 3, 0x11: 2}  # all others are one byte
PACKET = 16  # words: 64 bytes
START, STOP, CALIBRATION = 0x06, 0x07, 0x19
SCPI_IDENTITY = "Evenlight,Emulated power analyser,EMULATED,1.0"
SCPI_OVERLOAD = "9.9E37"
SCPI_QUESTIONS = ("MEAS:POW?", "MEAS:VOLT?", "MEAS:CURR?")
POLL = 0.0005  # [s] between two looks for a reader of hwmon's files
CHIP = "ina226"
SHUNT_FULL_SCALE = 81.92  # [mV] at the end of an INA226's range, which the highest power reaches


class Ppk2Emulator:
    """A PPK2 in ampere mode with a simulated panel on it, D0 at the synchronisation line.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics, optional
        What is true of it; the noise is that of each of its 100 000 samples a second.

    Attributes
    ----------
    commands : list of bytes
        What it was sent.
    n_lost : int
        Words that were lost on the way.
    """

    def __init__(self, simulation: Simulation, physics: PowerMeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or PowerMeterPhysics()
        self._came, self._streaming = b"", False
        self._began, self._next = 0.0, 0
        self._last_packet = (-1, False)  # which it was, and whether it was lost
        self.commands: list[bytes] = []
        self.n_lost = 0

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a command, and return what is answered at once."""
        self._came += data
        answer = b""
        while self._came and len(self._came) >= (length := COMMAND_LENGTHS.get(self._came[0], 1)):
            command, self._came = self._came[:length], self._came[length:]
            self.commands.append(command)
            answer += self._obey(command[0])
        return answer

    def stream(self) -> bytes:
        """Return the words since the last call; the first at once."""
        if not self._streaming:
            return b""
        import numpy as np

        elapsed = (self._simulation.clock() - self._began) * (1 + self._physics.clock_drift)
        end = int(elapsed * stream.RAW_RATE) + 1
        numbers = np.arange(self._next, end)
        self._next = max(end, self._next)
        if not len(numbers):
            return b""
        kept = self._kept(numbers)
        self.n_lost += int(np.sum(~kept))
        return self._words(numbers)[kept].tobytes()

    def _kept(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which words are sent: they are lost by packets, as USB has them."""
        packets = numbers // PACKET
        lost = self._simulation.rng.random(packets[-1] - packets[0] + 1) < self._physics.lost_share
        if packets[0] == self._last_packet[0]:
            lost[0] = self._last_packet[1]
        self._last_packet = (int(packets[-1]), bool(lost[-1]))
        kept: NDArray[np.bool_] = ~lost[packets - packets[0]]
        return kept

    def _obey(self, code: int) -> bytes:
        """Return what a command is answered with."""
        if code == STOP:
            last = self.stream()
            self._streaming = False
            return last
        if code == START:
            self._began, self._next, self._streaming = self._simulation.clock(), 0, True
        return calibration().encode("ascii") if code == CALIBRATION else b""

    def _words(self, numbers: NDArray[np.int64]) -> NDArray[np.uint32]:
        """Return words by their numbers since the start."""
        import numpy as np

        times = self._began + numbers / stream.RAW_RATE / (1 + self._physics.clock_drift)
        looks = np.linspace(times[0], times[-1], max(2, int((times[-1] - times[0]) / STEP) + 1))
        panel = self._simulation.panel
        power = np.interp(times, looks, [panel.power(look) for look in looks])
        logic = np.array([panel.sync(look) for look in looks])
        noise = self._physics.noise * self._simulation.rng.standard_normal(len(numbers))
        current = (power * (1 + self._physics.gain_error) + self._physics.zero_error + noise) / SUPPLY
        ranges = np.searchsorted(RANGE_ENDS, current)
        counts = current * np.array(RESISTANCES)[ranges] / VOLTS_PER_COUNT + OFFSET / 4
        # As a converter does:
        converter = np.clip(np.rint(counts), 0, stream.CONVERTER_MASK).astype(np.uint32)
        counter = (numbers % stream.COUNTER_SIZE).astype(np.uint32)
        sync = logic[np.searchsorted(looks, times, side="right") - 1].astype(np.uint32)
        words: NDArray[np.uint32] = converter | ranges.astype(np.uint32) << stream.RANGE_SHIFT
        words |= counter << stream.COUNTER_SHIFT | sync << stream.LOGIC_SHIFT
        return words


def calibration() -> str:
    """Return the calibration that the instrument reports, as text."""
    constants = {"GS": 0.0, "GI": 1.0, "O": OFFSET, "S": 0.0, "I": 0.0, "UG": 1.0}
    lines = ["Calibrated: 1"]
    lines += [f"R{index}: {value:.4f}" for index, value in enumerate(RESISTANCES)]
    lines += [f"{name}{index}: {value:.4f}" for name, value in constants.items() for index in range(5)]
    return "\n".join([*lines, "VDD: 5000", "HW: 9173", "mode: 1", "IA: 56", "END", ""])


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
        known: tuple[str, ...] = SCPI_QUESTIONS,
        identity: str = SCPI_IDENTITY,
    ) -> None:
        self._simulation, self._physics = simulation, physics or PowerMeterPhysics()
        self._known, self._identity, self._came = known, identity, b""
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
        """Return the answer to one question; nothing to a command."""
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
            return SCPI_OVERLOAD
        power = physics.shown(true, simulation.rng)
        value = {"MEAS:POW?": power, "MEAS:VOLT?": SUPPLY, "MEAS:CURR?": power / SUPPLY}[question]
        return f"{value:+.6E}"


class PipedFiles(AbstractContextManager["PipedFiles"]):
    """A folder as Linux has one for a device; files whose numbers change are named pipes.

    A named pipe reads like a file, and its number is made while it is read: none is older than that.

    Parameters
    ----------
    texts : mapping of str to str
        What the other files say, by their path in the folder.
    numbers : mapping of str to callable
        What makes the numbers.

    Attributes
    ----------
    folder : Path
        The folder.
    """

    def __init__(self, texts: Mapping[str, str], numbers: Mapping[str, Callable[[], float]]) -> None:
        require_unix("an emulated sensor")
        self._temporary = tempfile.TemporaryDirectory(prefix="evenlight-emulated-")
        self.folder = Path(self._temporary.name)
        for name in (*texts, *numbers):
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (self.folder / name).write_text(f"{text}\n", encoding="utf-8")
        self._files = {self.folder / name: number for name, number in numbers.items()}
        for path in self._files:
            os.mkfifo(path)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(timeout=5)
        self._temporary.cleanup()

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


class HwmonEmulator(PipedFiles):
    """A power sensor under hwmon: power, current and voltage.

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
        highest = self._physics.highest_power
        super().__init__(
            {"name": CHIP, "update_interval": "2"},  # [ms]
            {
                "power1_input": lambda: self._power() * 1e6,
                "curr1_input": lambda: self._power() / SUPPLY * 1e3,
                "in1_input": lambda: SUPPLY * 1e3,
                "in0_input": lambda: self._power() / highest * SHUNT_FULL_SCALE,
            },
        )
        self.url = str(self.folder)

    def _power(self) -> float:
        """Return the power that the sensor has now [W]."""
        physics, simulation = self._physics, self._simulation
        return min(physics.shown(simulation.panel.power(), simulation.rng), physics.highest_power)

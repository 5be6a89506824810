"""An emulated Nordic PPK2: the bytes of its commands, calibration and stream, with the simulated panel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evenlight.hardware.drivers import ppk2_port as stream
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
        converter = np.clip(np.rint(counts), 0, stream.CONVERTER_MASK).astype(
            np.uint32
        )  # as a converter does
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

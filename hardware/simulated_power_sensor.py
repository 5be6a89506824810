"""What a power sensor makes of a simulated panel: samples at times of its own clock, with its own errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

from evenlight.hardware.simulated_panel import Simulation

STEP = 0.001  # [s] between two looks at the panel within one sample: panels answer in several
MEMORY = 60.0  # [s] that the panel is asked to remember, for the instruments beside this one


@dataclass(frozen=True, slots=True)
class PowerMeterPhysics:
    """What is true of a simulated power meter.

    Attributes
    ----------
    noise : float
        Standard deviation of one sample [W].
    gain_error : float
        Share by which all its powers are too high; 0 is a meter calibrated right.
    zero_error : float
        What it shows at no power [W].
    highest_power : float
        Above it the meter says overload [W].
    clock_start : float
        Its clock when the simulation begins [s].
    clock_drift : float
        Share by which its clock is faster than the computer's.
    lost_share, duplicated_share, corrupted_share : float
        Of the samples: not sent, sent twice, changed on the way.
    receive_jitter : float
        Mean of the time that a sample is under way [s].
    """

    noise: float = 0.002
    gain_error: float = 0.0
    zero_error: float = 0.0
    highest_power: float = 16.0
    clock_start: float = 1000.0
    clock_drift: float = 50e-6
    lost_share: float = 0.0
    duplicated_share: float = 0.0
    corrupted_share: float = 0.0
    receive_jitter: float = 0.001


@dataclass(frozen=True, slots=True)
class SensorSample:
    """One sample as the sensor took it, before anything is lost.

    Attributes
    ----------
    sequence : int
        From 0.
    device_time : float
        On the sensor's clock [s].
    taken : float
        On the computer's [s].
    power : float
        Mean since the sample before, with the sensor's errors [W].
    sync : bool
        Level of the synchronisation line.
    overload : bool
        Whether the true power was above what the sensor measures.
    """

    sequence: int
    device_time: float
    taken: float
    power: float
    sync: bool
    overload: bool


class SimulatedPowerSensor:
    """A power sensor that looks at a simulated panel.

    Samples are worked out when they are asked for, at the past times that they belong to: any clock will do.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics
        What is true of the sensor.
    """

    def __init__(self, simulation: Simulation, physics: PowerMeterPhysics) -> None:
        self._simulation, self.physics = simulation, physics
        self._switched_on = simulation.clock()
        self._began, self._rate, self._next = 0.0, 0.0, 0

    def device_time(self, time: float) -> float:
        """Return the sensor's clock at a time of the computer's [s]."""
        return self.physics.clock_start + (time - self._switched_on) * (1 + self.physics.clock_drift)

    def begin(self, rate: float) -> None:
        """Begin to sample at a rate of its own clock [Hz]."""
        self._began, self._rate, self._next = self._simulation.clock(), rate, 0

    def due(self) -> list[SensorSample]:
        """Return the samples taken since the last call, in order."""
        now, taken = self._simulation.clock(), []
        while (time := self._time_of(self._next)) <= now:
            taken.append(self._sample(self._next, time))
            self._next += 1
        if taken:
            self._simulation.panel.forget_before(now - MEMORY)
        return taken

    def _time_of(self, sequence: int) -> float:
        """Return when a sample is taken, on the computer's clock [s]."""
        return self._began + (sequence + 1) / (self._rate * (1 + self.physics.clock_drift))

    def _sample(self, sequence: int, time: float) -> SensorSample:
        """Return one sample."""
        physics = self.physics
        true = self._mean_power(time - 1 / self._rate, time)
        noise = physics.noise * float(self._simulation.rng.standard_normal())
        return SensorSample(
            sequence,
            self.device_time(time),
            time,
            power=true * (1 + physics.gain_error) + physics.zero_error + noise,
            sync=self._simulation.panel.sync(time),
            overload=true > physics.highest_power,
        )

    def _mean_power(self, begin: float, end: float) -> float:
        """Return the true mean power between two times [W], by the middles of short steps."""
        steps = max(2, math.ceil((end - begin) / STEP))
        length = (end - begin) / steps
        power = self._simulation.panel.power
        return sum(power(begin + (step + 0.5) * length) for step in range(steps)) / steps

"""A simulated power meter and its sensor: samples of a simulated panel, with its own clock and errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.drivers.power_sampling import SamplingMeter
from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated.panel import Simulation

if TYPE_CHECKING:
    import numpy as np

STEP = 0.001  # [s] between two looks at the panel within one sample: panels answer in several
MEMORY = 60.0  # [s] that the panel is asked to remember, for the instruments beside this one
SLOWEST, FASTEST = 0.1, 10_000.0  # [Hz]
SHORTEST_WAY = 0.0005  # [s] to the meter and back, each: what a USB port takes at least


@dataclass(frozen=True, slots=True)
class PowerMeterPhysics:
    """What is true of a simulated power meter."""

    noise: float = 0.002  # standard deviation of one sample [W]
    gain_error: float = 0.0  # share by which all its powers are too high; 0 is a meter calibrated right
    zero_error: float = 0.0  # what it shows at no power [W]
    highest_power: float = 16.0  # above it the meter says overload [W]
    clock_start: float = 1000.0  # its clock when the simulation begins [s]
    clock_drift: float = 50e-6  # share by which its clock is faster than the computer's
    # of the samples: not sent, sent twice, changed on the way
    lost_share: float = 0.0
    duplicated_share: float = 0.0
    corrupted_share: float = 0.0
    receive_jitter: float = 0.001  # mean of the time that a sample is under way [s]

    def shown(self, power: float, rng: np.random.Generator) -> float:
        """Return what the sensor makes of a true power, without a limit [W]."""
        return power * (1 + self.gain_error) + self.zero_error + self.noise * float(rng.standard_normal())


@dataclass(frozen=True, slots=True)
class SensorSample:
    """One sample as the sensor took it, before anything is lost."""

    sequence: int  # from 0
    device_time: float  # on the sensor's clock [s]
    taken: float  # on the computer's [s]
    power: float  # mean since the sample before, with the sensor's errors [W]
    sync: bool  # level of the synchronisation line
    overload: bool  # whether the true power was above what the sensor measures


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
        return self._began + (sequence + 1) / (self._rate * (1 + self.physics.clock_drift))

    def _sample(self, sequence: int, time: float) -> SensorSample:
        """Return one sample."""
        physics = self.physics
        true = self._mean_power(time - 1 / self._rate, time)
        return SensorSample(
            sequence,
            self.device_time(time),
            time,
            power=physics.shown(true, self._simulation.rng),
            sync=self._simulation.panel.sync(time),
            overload=true > physics.highest_power,
        )

    def _mean_power(self, begin: float, end: float) -> float:
        """Return the true mean power between two times [W], by the middles of short steps."""
        steps = max(2, math.ceil((end - begin) / STEP))
        length = (end - begin) / steps
        power = self._simulation.panel.power
        return sum(power(begin + (step + 0.5) * length) for step in range(steps)) / steps


class SimulatedPowerMeter(SamplingMeter):
    """A power meter with noise, a clock of its own, lost samples and a synchronisation input.

    Nothing in it takes time: samples are worked out for the past moments that they belong to.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics, optional
        What is true of the meter.

    >>> import numpy as np
    >>> from evenlight.hardware.simulated.clocks import WaitingClock
    >>> from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel
    >>> clock = WaitingClock()
    >>> panel = SimulatedPanel(PanelPhysics(base_power=0.3, power_per_luminance=0.002), clock.now)
    >>> simulation = Simulation(panel, np.random.default_rng(1), clock.now, clock.wait)
    >>> meter = SimulatedPowerMeter(simulation, PowerMeterPhysics(noise=0.0))
    >>> rate = meter.start(100.0)
    >>> clock.wait(1.0)
    >>> [round(sample.power, 6) for sample in meter.stop()][-1]  # 0.3 + 0.002 * 200
    0.7
    """

    _name, _rates = "the simulated power meter", (SLOWEST, FASTEST)

    def __init__(self, simulation: Simulation, physics: PowerMeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or PowerMeterPhysics()
        self._sensor = SimulatedPowerSensor(simulation, self._physics)
        self._under_way: list[PowerSample] = []
        self._last_arrival = 0.0

    def _begin(self, rate: float) -> float:
        self._under_way.clear()
        self._sensor.begin(rate)
        self._last_arrival = self._simulation.clock()
        return rate

    def _news(self) -> Sequence[PowerSample]:
        now = self._simulation.clock()
        self._take()
        arrived = [sample for sample in self._under_way if sample.received <= now]
        del self._under_way[: len(arrived)]
        return arrived

    def _rest(self) -> Sequence[PowerSample]:
        self._take()
        now, left = self._simulation.clock(), self._under_way
        self._under_way = []
        # All are in before the meter says that it ended.
        return [replace(sample, received=min(sample.received, now)) for sample in left]

    def ping(self) -> ClockPing:
        """Return one comparison of the meter's clock with the computer's, which ended just now."""
        self._require_open()
        there, back = (self._way() for _ in range(2))
        ended = self._simulation.clock()
        return ClockPing(ended - back - there, self._sensor.device_time(ended - back), ended)

    def apparatus(self) -> dict[str, str]:
        """Return what the meter says of itself."""
        return {
            "power_meter": "SIMULATED power meter",
            "power_meter_range": f"{self._physics.highest_power:g} W",
        }

    def _take(self) -> None:
        """Send what the sensor has sampled on its way, or lose it."""
        lost, twice = self._physics.lost_share, self._physics.duplicated_share
        for sample in self._sensor.due():
            if sample.overload:
                raise self._error(
                    f"the panel takes more than {self._physics.highest_power:g} W, the most that it measures",
                    Fault.OVER_RANGE,
                )
            chance = float(self._simulation.rng.random())
            copies = 0 if chance < lost else 2 if chance < lost + twice else 1
            self._under_way += [self._sent(sample)] * copies

    def _sent(self, sample: SensorSample) -> PowerSample:
        """Return a sample with the time at which it arrives: none overtakes another."""
        self._last_arrival = max(self._last_arrival, sample.taken + self._way())
        return PowerSample(sample.sequence, sample.device_time, self._last_arrival, sample.power, sample.sync)

    def _way(self) -> float:
        return SHORTEST_WAY + float(self._simulation.rng.exponential(self._physics.receive_jitter))

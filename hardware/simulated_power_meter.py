"""A power meter that is not there, looking at the simulated panel, in the same process."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager

from evenlight.data_schema.power_log import ClockPing, PowerSample
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.sample_rate import require_sample_rate
from evenlight.hardware.simulated_panel import Simulation
from evenlight.hardware.simulated_power_sensor import PowerMeterPhysics, SensorSample, SimulatedPowerSensor

SLOWEST, FASTEST = 0.1, 10_000.0  # [Hz]
SHORTEST_WAY = 0.0005  # [s] to the meter and back, each: what a USB port takes at least


class SimulatedPowerMeter(AbstractContextManager["SimulatedPowerMeter"]):
    """A power meter with noise, a clock of its own, lost samples and a synchronisation input.

    Nothing in it takes time: samples are worked out for the past moments that they belong to.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics, optional
        What is true of the meter.

    >>> import numpy as np
    >>> from evenlight.hardware.clocks import WaitingClock
    >>> from evenlight.hardware.simulated_panel import PanelPhysics, SimulatedPanel
    >>> clock = WaitingClock()
    >>> panel = SimulatedPanel(PanelPhysics(base_power=0.3, power_per_luminance=0.002), clock.now)
    >>> simulation = Simulation(panel, np.random.default_rng(1), clock.now, clock.wait)
    >>> meter = SimulatedPowerMeter(simulation, PowerMeterPhysics(noise=0.0))
    >>> rate = meter.start(100.0)
    >>> clock.wait(1.0)
    >>> [round(sample.power, 6) for sample in meter.stop()][-1]  # 0.3 + 0.002 * 200
    0.7
    """

    def __init__(self, simulation: Simulation, physics: PowerMeterPhysics | None = None) -> None:
        self._simulation, self._physics = simulation, physics or PowerMeterPhysics()
        self._sensor = SimulatedPowerSensor(simulation, self._physics)
        self._under_way: list[PowerSample] = []
        self._last_arrival = 0.0
        self._sampling, self._closed = False, False

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return it: the meter has any.

        Raises
        ------
        InstrumentError
            If the rate is outside what the meter has.
        """
        self._require_open()
        require_sample_rate(rate, SLOWEST, FASTEST, "the simulated power meter")
        self._under_way.clear()
        self._sensor.begin(rate)
        self._last_arrival, self._sampling = self._simulation.clock(), True
        return rate

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that have arrived since the last call, in order.

        Raises
        ------
        InstrumentError
            If the panel took more than the meter measures, or it was not started.
        """
        self._require_open()
        if not self._sampling:
            raise InstrumentError("the simulated power meter: is not sampling; start it first")
        now = self._simulation.clock()
        self._take()
        arrived = [sample for sample in self._under_way if sample.received <= now]
        del self._under_way[: len(arrived)]
        return arrived

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        if not self._sampling:
            return []
        self._sampling = False
        self._take()
        now, left = self._simulation.clock(), self._under_way
        self._under_way = []
        return [
            _received_by(sample, now) for sample in left
        ]  # all are in before the meter says that it ended

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

    def close(self) -> None:
        """Let go of the meter; more than once does nothing."""
        self._sampling, self._closed = False, True

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take(self) -> None:
        """Send what the sensor has sampled on its way, or lose it."""
        lost, twice = self._physics.lost_share, self._physics.duplicated_share
        for sample in self._sensor.due():
            if sample.overload:
                raise InstrumentError(
                    "the simulated power meter: the panel takes more than "
                    f"{self._physics.highest_power:g} W, the most that it measures",
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
        """Return how long something is under way [s]."""
        return SHORTEST_WAY + float(self._simulation.rng.exponential(self._physics.receive_jitter))

    def _require_open(self) -> None:
        """Refuse to work after `close`."""
        if self._closed:
            raise InstrumentError("the simulated power meter: is closed", Fault.DISCONNECTED)


def _received_by(sample: PowerSample, time: float) -> PowerSample:
    """Return a sample that had arrived by a time at the latest."""
    if sample.received <= time:
        return sample
    return PowerSample(sample.sequence, sample.device_time, time, sample.power, sample.sync)

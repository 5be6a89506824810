"""A simulated photodiode: the light of a simulated panel, with PWM, response, latency and noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.hardware.drivers.power_sampling import require_sample_rate
from evenlight.hardware.protocols import ContextDevice, LightBlock, LightStream
from evenlight.hardware.simulated.panel import Simulation

OWN_RATE, SLOWEST, FASTEST = 10_000.0, 100.0, 200_000.0  # [Hz]
SHORTEST_WAY, JITTER = 0.0002, 0.0005  # [s] each way of a question, and what comes on top, its mean
TEN_TO_NINETY = math.log(9)  # time constants from 10 to 90 % of an exponential change


@dataclass(frozen=True, slots=True)
class LightPhysics:
    """What is true of a simulated photodiode, and of the panel before it."""

    full_scale: float = 400.0  # mean luminance at which it saturates [cd/m^2]
    noise: float = 0.001  # standard deviation of a sample, as a share of full scale
    dark: float = 0.01  # value in darkness
    step: float = 1 / 4095  # between two values: 12 bits
    pwm_frequency: float = 240.0  # [Hz]
    pwm_depth: float = 0.5  # (max - min) / (max + min)
    pwm_duty: float = 0.5
    latency: float = 0.012  # from a flip until the light begins to change [s]
    rise: float = 0.006  # from 10 to 90 % [s]
    fall: float = 0.004
    clock_start: float = 1000.0  # its clock when the simulation begins [s]
    clock_drift: float = 50e-6  # share by which its clock is faster than the computer's


class SimulatedLightSampler(ContextDevice):
    """A photodiode that looks at a simulated panel; samples are worked out when they are asked for.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : LightPhysics, optional
        What is true of diode and panel.
    """

    _name = "the simulated photodiode"

    def __init__(self, simulation: Simulation, physics: LightPhysics | None = None) -> None:
        self._simulation, self.physics = simulation, physics or LightPhysics()
        self._began, self._rate, self._next = simulation.clock(), OWN_RATE, 0
        self._light = 0.0  # that the panel has reached [cd/m^2]

    def start(self, rate: float | None) -> LightStream:
        """Begin to sample at a rate [Hz], and return what comes."""
        self._require_open()
        self._rate = OWN_RATE if rate is None else rate
        require_sample_rate(self._rate, SLOWEST, FASTEST, self._name)
        self._next = math.ceil((self._simulation.clock() - self._began) * self._rate)
        self._light = self._simulation.panel.luminance()
        return LightStream(self._rate, full_scale=1.0, dc_coupled=True)

    def samples(self) -> Sequence[LightBlock]:
        """Return the samples that were taken since the last call."""
        self._require_open()
        now, physics = self._simulation.clock(), self.physics
        end = math.floor((now - self._began) * self._rate)
        if end < self._next:
            return []
        since = np.arange(self._next, end + 1) / self._rate
        self._next = end + 1
        light = self._followed(self._began + since) * self._pwm(since) / physics.full_scale
        noise = physics.noise * self._simulation.rng.standard_normal(len(since))
        values = np.clip(np.round((light + physics.dark + noise) / physics.step) * physics.step, 0.0, 1.0)
        times = physics.clock_start + since * (1 + physics.clock_drift)
        return [LightBlock(times, values, now)]

    def ping(self) -> ClockPing:
        """Return one comparison of the sampler's clock with the computer's, which ended just now."""
        self._require_open()
        now = self._simulation.clock()
        there, back = SHORTEST_WAY + self._simulation.rng.exponential(JITTER, size=2)
        asked = (now - back - self._began) * (1 + self.physics.clock_drift)
        return ClockPing(now - there - back, self.physics.clock_start + asked, now)

    def apparatus(self) -> dict[str, str]:
        """Return what the sampler says of itself."""
        return {"light_sampler": "SIMULATED photodiode"}

    def _followed(self, times: np.ndarray) -> np.ndarray:
        """Return the light of the panel, which follows what is shown exponentially [cd/m^2]."""
        physics, reached = self.physics, self._light
        rise, fall = (
            1 - math.exp(-TEN_TO_NINETY / (self._rate * time)) for time in (physics.rise, physics.fall)
        )
        light = np.empty(len(times))
        for k, time in enumerate(times.tolist()):
            # Since the sample before: what was shown in the middle of that time.
            away = self._simulation.panel.luminance(time - physics.latency - 0.5 / self._rate) - reached
            reached += away * (rise if away > 0 else fall)
            light[k] = reached
        self._light = reached
        return light

    def _pwm(self, times: np.ndarray) -> np.ndarray:
        """Return what the PWM makes of a steady light of 1, on average."""
        physics = self.physics
        low = (1 - physics.pwm_depth) / (1 + physics.pwm_depth)
        high = 1 / (physics.pwm_duty + (1 - physics.pwm_duty) * low)
        return np.where((times * physics.pwm_frequency) % 1 < physics.pwm_duty, high, high * low)

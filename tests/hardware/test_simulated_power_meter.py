"""The simulated power meter: its errors are those that it states, and any clock will do."""

from __future__ import annotations

import numpy as np
import pytest

from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import RefreshClock, WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import (
    MEMORY,
    SHORTEST_WAY,
    PowerMeterPhysics,
    SimulatedPowerMeter,
)

FULL = 0.2945 + 0.001858 * 200  # [W] of the panel at b = 1


def built(
    physics: PowerMeterPhysics, seed: int = 11
) -> tuple[SimulatedPowerMeter, WaitingClock, SimulatedPanel]:
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(), clock.now)
    simulation = Simulation(panel, np.random.default_rng(seed), clock.now, clock.wait)
    return SimulatedPowerMeter(simulation, physics), clock, panel


def test_noise_gain_and_zero_are_those_that_it_has() -> None:
    meter, clock, _ = built(PowerMeterPhysics(noise=0.005, gain_error=0.02, zero_error=0.003))
    meter.start(1000.0)
    clock.wait(10.0)
    powers = [sample.power for sample in meter.stop()]
    # 10 000 samples: mean within 5 * 0.005 / 100, standard deviation within 5 / sqrt(20000) of itself
    assert np.mean(powers) == pytest.approx(FULL * 1.02 + 0.003, abs=0.00025)
    assert np.std(powers) == pytest.approx(0.005, rel=0.036)


def test_its_clock_drifts_by_its_share_and_pings_tell_it() -> None:
    meter, clock, _ = built(PowerMeterPhysics(clock_drift=50e-6, receive_jitter=0.002))
    first = meter.ping()
    clock.wait(3600.0)
    last = meter.ping()
    for ping in (first, last):
        earliest, latest = (1000.0 + time * (1 + 50e-6) for time in (ping.sent, ping.received))
        assert earliest <= ping.device_time <= latest
    assert last.device_time - first.device_time == pytest.approx(3600 * (1 + 50e-6), abs=0.05)


def test_no_sample_comes_before_it_was_taken_and_none_overtakes_another() -> None:
    meter, clock, _ = built(PowerMeterPhysics(clock_drift=0.0, clock_start=0.0, receive_jitter=0.005))
    meter.start(500.0)
    samples = []
    for _ in range(200):
        clock.wait(0.01)
        came = meter.samples()
        assert all(sample.received <= clock.now() for sample in came)
        samples += came
    samples += meter.stop()
    received = [sample.received for sample in samples]
    assert received == sorted(received)
    ways = np.array(received) - [sample.device_time for sample in samples]
    assert ways[:-20].min() >= SHORTEST_WAY  # those of the end were in before the meter said that it ended
    assert ways.mean() > 0.005  # a queue: who waits for one before is later yet
    assert [sample.sequence for sample in samples] == list(range(1000))


def test_sync_is_the_panels_line_at_the_time_of_the_sample() -> None:
    meter, clock, panel = built(PowerMeterPhysics(clock_drift=0.0, clock_start=0.0))
    meter.start(100.0)
    clock.wait(0.105)
    panel.set_sync(True)
    clock.wait(0.1)
    assert [sample.sync for sample in meter.stop()] == [False] * 10 + [True] * 10


def test_a_sample_is_the_mean_since_the_one_before() -> None:
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(lag=1e-6), clock.now)
    simulation = Simulation(panel, np.random.default_rng(1), clock.now, clock.wait)
    meter = SimulatedPowerMeter(simulation, PowerMeterPhysics(noise=0.0, clock_drift=0.0))
    meter.start(10.0)
    clock.wait(0.05)  # half of the first tenth of a second
    panel.set_backlight(0.5)
    clock.wait(0.06)
    (sample,) = meter.stop()
    assert sample.power == pytest.approx(0.2945 + 0.001858 * 200 * 0.75, abs=1e-9)


def test_a_clock_that_counts_refreshes_will_do() -> None:
    clock = RefreshClock(60.0)
    panel = SimulatedPanel(PanelPhysics(), clock.now)
    simulation = Simulation(panel, np.random.default_rng(1), clock.now, lambda seconds: None)
    meter = SimulatedPowerMeter(simulation, PowerMeterPhysics(noise=0.0))
    meter.start(100.0)
    count = 0
    for _ in range(60):
        clock.advance()
        count += len(meter.samples())
    assert count + len(meter.stop()) == 100
    ping = meter.ping()
    assert ping.received == clock.now() == 1.0


def test_the_same_seed_gives_the_same_samples() -> None:
    def run() -> list[object]:
        meter, clock, _ = built(PowerMeterPhysics(lost_share=0.1, duplicated_share=0.1), seed=4)
        meter.start(100.0)
        clock.wait(1.0)
        return list(meter.stop())

    assert run() == run()


def test_the_panel_remembers_no_more_than_is_needed() -> None:
    meter, clock, panel = built(PowerMeterPhysics())
    meter.start(1.0)
    for _ in range(200):
        panel.set_sync(not panel.sync())
        clock.wait(1.0)
        meter.samples()
    assert len(panel._times) <= MEMORY + 3


def test_what_it_has_not_is_refused() -> None:
    meter, _, _ = built(PowerMeterPhysics())
    for rate in (0.0, -5.0, 20_000.0, float("nan")):
        with pytest.raises(InstrumentError, match="Hz, got"):
            meter.start(rate)


def test_after_closing_it_says_so() -> None:
    meter, _, _ = built(PowerMeterPhysics())
    with meter:
        meter.start(10.0)
    meter.close()
    for use in (meter.samples, meter.ping, lambda: meter.start(10.0)):
        with pytest.raises(InstrumentError, match="closed") as told:
            use()
        assert told.value.fault is Fault.DISCONNECTED

"""The power of a played video is recorded, whatever happens to the meter."""

import numpy as np
import pytest

from evenlight.data_schema.recordings.instrument_logs import ClockPing, PlayedFlip, PowerLog, PowerSample
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.experiments.playback.measured_play import PINGS_AT_ONCE, RATES, PowerRecording
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import SimulatedPowerMeter

LOG = PowerLog(True, "clip", 1.0, ("ours",), 60.0, 1000.0, 0.5, 0.5, True)


class Meter:
    """A simulated meter that fails at some pings, and takes no more than some rate."""

    def __init__(self, inner, bad_pings=(), fastest=1e9):
        self._inner, self._bad, self._fastest, self._pings = inner, bad_pings, fastest, 0

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def start(self, rate):
        if rate > self._fastest:
            raise InstrumentError("too fast", Fault.REFUSED)
        return self._inner.start(rate)

    def ping(self):
        self._pings += 1
        if self._pings in self._bad:
            raise InstrumentError("noise on the line", Fault.GARBLED)
        return self._inner.ping()


@pytest.fixture
def world():
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(), clock.now)
    simulation = Simulation(panel, np.random.default_rng(1), clock.now, clock.wait)
    return clock, panel, SimulatedPowerMeter(simulation)


def play(recording, clock, refreshes=60):
    recording.begin()
    for k in range(refreshes):
        clock.wait(1 / 60)
        recording.before_flip(None, k // 2)
        recording.after_flip(clock.now(), k // 2, 0.5, 0.5)


def test_every_sample_of_the_playing_is_on_the_disk(tmp_path, world):
    clock, panel, meter = world
    with PowerRecording(tmp_path, LOG, 500.0, meter, clock.now, panel) as recording:
        play(recording, clock)
    samples = read_rows(PowerSample, tmp_path / "power.csv")
    numbers = [sample.sequence for sample in samples]
    assert numbers == sorted(numbers)
    assert 490 <= len(samples) <= 510  # a second at 500 Hz
    assert len(read_rows(ClockPing, tmp_path / "clock.csv")) == 3 * PINGS_AT_ONCE
    assert read_json_record(PowerLog, tmp_path / "power_log.json").sample_rate == 500.0
    flips = read_rows(PlayedFlip, tmp_path / "flips.csv")
    assert [flip.sync for flip in flips[:6]] == [True, True, False, False, True, True]  # with every frame


def test_a_comparison_of_clocks_that_fails_on_its_way_costs_no_sample(tmp_path, world):
    clock, panel, meter = world
    bad = (2, PINGS_AT_ONCE + 1, PINGS_AT_ONCE + 2)
    with PowerRecording(tmp_path, LOG, 500.0, Meter(meter, bad), clock.now, panel) as recording:
        play(recording, clock)
    assert len(read_rows(PowerSample, tmp_path / "power.csv")) >= 490
    assert len(read_rows(ClockPing, tmp_path / "clock.csv")) == 3 * PINGS_AT_ONCE - len(bad)


def test_a_meter_that_is_asked_for_no_rate_has_the_highest_that_it_takes(tmp_path, world):
    clock, panel, meter = world
    with PowerRecording(tmp_path, LOG, None, Meter(meter, fastest=272.0), clock.now, panel):
        clock.wait(0.1)
    assert read_json_record(PowerLog, tmp_path / "power_log.json").sample_rate == 250.0
    assert max(RATES) == 1000.0


def test_what_came_before_a_meter_broke_is_kept(tmp_path, world):
    clock, panel, meter = world

    def play_until_it_breaks():
        with PowerRecording(tmp_path, LOG, 500.0, meter, clock.now, panel) as recording:
            play(recording, clock, refreshes=30)
            raise InstrumentError("the connection broke", Fault.DISCONNECTED)

    with pytest.raises(InstrumentError):
        play_until_it_breaks()
    assert 240 <= len(read_rows(PowerSample, tmp_path / "power.csv")) <= 260
    assert len(read_rows(PlayedFlip, tmp_path / "flips.csv")) == 30

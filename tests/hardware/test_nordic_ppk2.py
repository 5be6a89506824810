"""The PPK2 through the real library, over a pseudo-terminal: current times voltage, losses, its stream."""

from __future__ import annotations

import contextlib
import sys

import numpy as np
import pytest
from emulators.link import EmulatedLink
from emulators.power_meters import Ppk2Emulator, calibration

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers import nordic_ppk2 as stream
from evenlight.hardware.drivers.nordic_ppk2 import Ppk2PowerMeter
from evenlight.hardware.power_average import average_power
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

PATIENT = 30.0  # [s] that the emulated device's thread may be held up
FULL = 0.2945 + 0.001858 * 200  # [W]


class Bench:
    """A PPK2 on a panel, over a pseudo-terminal."""

    def __init__(self, physics: PowerMeterPhysics | None = None, panel: PanelPhysics | None = None) -> None:
        self.clock = WaitingClock()
        self.panel = SimulatedPanel(panel or PanelPhysics(), self.clock.now)
        simulation = Simulation(self.panel, np.random.default_rng(8), self.clock.now, self.clock.wait)
        self.emulator = Ppk2Emulator(simulation, physics)
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Bench:
        link = EmulatedLink(self.emulator, pseudo_terminal=True)
        self.url = self._stack.enter_context(link).url
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def meter(self, voltage: float = 5.0) -> Ppk2PowerMeter:
        address = f"{self.url}?voltage={voltage:g}"
        return self._stack.enter_context(Ppk2PowerMeter(address, self.clock.now, PATIENT))


def words(counters: list[int], counts: int = 500) -> bytes:
    """Return words of range 4 with some counters."""
    numbers = np.array(counters) % 64
    return (counts | 4 << 14 | numbers << 18).astype("<u4").tobytes()


def test_the_stream_of_words_is_the_same_in_whatever_parts_it_comes() -> None:
    data = words(list(range(300)))
    for size in (1, 3, 4, 7, 100, len(data)):
        reader = stream.WordStream()
        parts = [data[start : start + size] for start in range(0, len(data), size)]
        places = [reader.take(part)[1] for part in parts] + [reader.take(b"", is_last=True)[1]]
        assert np.concatenate(places).tolist() == list(range(300))
        assert (reader.n_lost, reader.seconds()) == (0, 0.003)


def test_lost_words_are_counted_by_the_counter_of_64() -> None:
    reader = stream.WordStream()
    counters = [*range(100), *range(110, 200)]
    places = np.concatenate([reader.take(words(counters))[1], reader.take(b"", is_last=True)[1]])
    assert places.tolist() == counters
    assert reader.n_lost == 10


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_lost_bytes_are_found_before_any_word_is_read_wrong(missing) -> None:
    data = words(list(range(200)), counts=700)
    reader, taken = stream.WordStream(), []
    data = data[:400] + data[400 + missing :]

    def take_all() -> None:
        for start in range(0, len(data), 20):
            taken.extend(reader.take(data[start : start + 20])[0].tolist())

    with pytest.raises(stream.OutOfStepError):
        take_all()
    assert 90 < len(taken) <= 100
    assert {word & stream.CONVERTER_MASK for word in taken} == {700}


def test_an_average_is_that_of_its_words_and_not_there_where_most_are_lost() -> None:
    places = np.array([*range(10), 10, 11, *range(20, 31)])  # the second has two words of ten
    currents = np.where(places < 20, 1.0, places - 24.5)
    rows = np.column_stack([places, currents])
    parts, rest = stream.complete_parts(rows, 10)
    assert [(int(part[0, 0]), part[:, 1].mean()) for part in parts] == [(0, 1.0), (20, 0.0)]  # of -4.5 to 4.5
    assert rest[:, 0].tolist() == [30]  # which the next word may follow
    assert stream.complete_parts(rows[:0], 10)[0] == []


def test_power_is_current_times_the_stated_voltage() -> None:
    with Bench(PowerMeterPhysics(noise=0.01)) as bench:
        for voltage, share in ((5.0, 1.0), (4.0, 0.8)):  # the emulated supply has 5 V, whatever is stated
            meter = bench.meter(voltage)
            average = average_power(meter, 0.3, 1000.0, bench.clock.now, bench.clock.wait)
            # 30 000 words of 10 mW noise and steps of 4 mW: 0.06 mW for the mean, five times that is allowed
            assert average.power == pytest.approx(FULL * share, abs=0.0003)
            assert average.n_samples == 300
            meter.close()


def test_every_measuring_range_is_read_right() -> None:
    # 4 µA, 40 µA, 0.4 mA, 4 mA, 40 mA, 0.4 A at 5 V: ranges 0, 0, 1, 2, 3, 4
    with Bench(PowerMeterPhysics(noise=1e-7), PanelPhysics(base_power=0.0, power_per_luminance=1.0)) as bench:
        meter = bench.meter()
        for power in (20e-6, 200e-6, 2e-3, 20e-3, 0.2, 2.0):
            bench.panel.set_backlight(power / 200)  # W for each of 200 cd/m2
            bench.clock.wait(1.0)
            average = average_power(meter, 0.02, 1000.0, bench.clock.now, bench.clock.wait)
            assert average.power == pytest.approx(power, rel=0.02)  # the converter's steps


def test_lost_words_leave_time_and_power_where_they_are() -> None:
    with Bench(PowerMeterPhysics(noise=0.01, lost_share=0.01, clock_drift=0.0)) as bench:
        meter = bench.meter()
        meter.start(1000.0)
        bench.clock.wait(1.0)
        samples = list(meter.stop())
        assert int(meter.apparatus()["power_meter_raw_samples_lost"]) == bench.emulator.n_lost > 500
        assert [sample.sequence for sample in samples] == list(range(1000))
        times = [sample.device_time for sample in samples]
        assert times[-1] - times[0] == pytest.approx(0.999)
        assert np.mean([sample.power for sample in samples]) == pytest.approx(FULL, abs=0.0003)


def test_d0_is_the_sync_input() -> None:
    with Bench(PowerMeterPhysics(clock_drift=0.0)) as bench:
        meter = bench.meter()
        meter.start(100.0)
        bench.clock.wait(0.105)
        bench.panel.set_sync(True)
        bench.clock.wait(0.1)
        assert [sample.sync for sample in meter.stop()] == [False] * 10 + [True] * 10


def test_more_than_one_ampere_is_over_range() -> None:
    with Bench(panel=PanelPhysics(base_power=6.0)) as bench:
        with pytest.raises(InstrumentError, match=r"1\.27\d A; a PPK2 measures up to 1 A") as told:
            average_power(bench.meter(), 0.1, 1000.0, bench.clock.now, bench.clock.wait)
        assert told.value.fault is Fault.OVER_RANGE


def test_it_is_told_to_be_an_ampere_meter_and_to_feed_the_panel() -> None:
    with Bench() as bench:
        bench.meter().start(100.0)  # which it answers, so it has read them all
        commands = bench.emulator.commands
        assert commands[0] == b"\x07"  # stop, whatever it was at
        assert commands[1] == b"\x19"  # tell the calibration
        assert commands[2] == b"\x11\x01"  # ampere meter
        assert set(commands[3:5]) == {b"\x0c\x01", b"\x0d\x13\x88"}  # power through; 5000 mV
        assert commands[5:] == [b"\x07", b"\x06"]  # stop, start


@pytest.mark.parametrize("said", ["", "?voltage=0.5", "?voltage=12", "?voltage=nan", "?volt=5"])
def test_without_a_voltage_that_it_takes_it_is_refused(said) -> None:
    with pytest.raises(InputError, match=r"voltage"):
        Ppk2PowerMeter(f"/dev/not-there{said}")


@pytest.mark.parametrize("missing", ["R4", "GI2", "UG0", "HW"])
def test_a_calibration_in_part_is_refused(missing) -> None:
    class Partial:
        def receive(self, data: bytes) -> bytes:
            lines = calibration().splitlines(keepends=True)
            kept = [line for line in lines if not line.startswith(f"{missing}:")]
            return "".join(kept).encode() if b"\x19" in data else b""

        def stream(self) -> bytes:
            return b""

    with (
        EmulatedLink(Partial(), pseudo_terminal=True) as link,
        pytest.raises(InstrumentError, match=f"in part; {missing} is missing") as told,
    ):
        Ppk2PowerMeter(f"{link.url}?voltage=5")
    assert told.value.fault is Fault.GARBLED


def test_an_error_that_the_library_swallows_is_told(caplog) -> None:
    with Bench() as bench:
        meter = bench.meter()
        meter._port.port.close()  # as a port that is gone under the library
        with pytest.raises(InstrumentError) as told:
            meter.start(100.0)
        assert told.value.fault is Fault.DISCONNECTED
    assert caplog.text == ""  # and nothing is left to be found in a log


def test_more_lost_than_the_counter_tells_is_found_at_the_end() -> None:
    with Bench(PowerMeterPhysics(clock_drift=0.0)) as bench:
        meter = bench.meter()
        meter.start(100.0)
        bench.clock.wait(1.0)
        bench.emulator._next += 64 * 400  # 0.256 s of which the counter shows nothing
        taken: list[PowerSample] = []
        while len(taken) < 74:  # of 10 ms each; the rest is on its way
            taken += meter.samples()
        meter._timeout = 0.0  # more will not come
        with pytest.raises(InstrumentError, match=r"make 0\.7\d+ s of 1\.000 s") as told:
            meter.stop()
        assert told.value.fault is Fault.GARBLED


def test_without_the_library_it_says_how_to_get_it(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "ppk2_api", None)
    with pytest.raises(InputError, match=r"pip install '\.\[instruments\]'"):
        Ppk2PowerMeter("/dev/not-there?voltage=5")

"""Our power board: its clock, what is lost on the way, and two devices on one link."""

from __future__ import annotations

import contextlib
import time

import numpy as np
import pytest
from emulators.link import EmulatedLink, FaultPlan, LinkFault
from emulators.power_board import BoardBuild, PowerBoardEmulator
from scripted_instrument import ScriptedInstrument

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers import board_protocol as protocol
from evenlight.hardware.drivers.board_link import PowerBoard, board_at
from evenlight.hardware.drivers.power_board import SILENCE, BoardBacklight, BoardPowerMeter
from evenlight.hardware.power_average import average_power, averaged
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

BASE, SLOPE = 0.2945, 0.001858 * 200  # [W] of the panel: P(b) = BASE + SLOPE * b
TIMEOUT = 30.0  # [s]


class Bench:
    """A board on a panel, over a pseudo-terminal, on a clock that goes while somebody waits."""

    def __init__(
        self,
        physics: PowerMeterPhysics | None = None,
        build: BoardBuild | None = None,
        plan: FaultPlan | None = None,
        panel: PanelPhysics | None = None,
    ) -> None:
        self.clock = WaitingClock()
        self.panel = SimulatedPanel(panel or PanelPhysics(), self.clock.now)
        rng = np.random.default_rng(8)
        self.simulation = Simulation(self.panel, rng, self.clock.now, self.clock.wait)
        self.emulator = PowerBoardEmulator(self.simulation, physics, build)
        self._plan, self._stack = plan, contextlib.ExitStack()

    def __enter__(self) -> Bench:
        link = EmulatedLink(self.emulator, self._plan, pseudo_terminal=True)
        self.url = self._stack.enter_context(link).url
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def meter(self, timeout: float = TIMEOUT) -> BoardPowerMeter:
        return self._stack.enter_context(BoardPowerMeter(self.url, self.clock.now, timeout))

    def recorded(self, meter: BoardPowerMeter, seconds: float, rate: float = 100.0) -> list[PowerSample]:
        meter.start(rate)
        self.clock.wait(seconds)
        return list(meter.stop())


def test_a_serial_line_is_not_asked_for_more_than_it_carries() -> None:
    with Bench(build=BoardBuild(native_usb=False)) as bench:
        meter = bench.meter()
        with pytest.raises(InstrumentError, match=r"samples at 1 to 272 Hz, got 300 Hz"):
            meter.start(300.0)
        assert meter.start(250.0) == pytest.approx(250.0)
    with Bench(build=BoardBuild(native_usb=False, highest_rate=100.0)) as bench:
        meter = bench.meter()
        with pytest.raises(InstrumentError, match=r"1 to 100 Hz, got 250 Hz"):  # the chip's own limit
            meter.start(250.0)


def test_the_rate_achieved_is_a_whole_number_of_microseconds() -> None:
    with Bench() as bench:
        assert bench.meter().start(300.0) == pytest.approx(1e6 / 3333)


def test_the_time_of_samples_goes_on_when_the_boards_clock_rolls_over() -> None:
    rollover = 2**32 * 1e-6  # after 71.6 minutes
    with Bench(PowerMeterPhysics(clock_start=rollover - 1.0, clock_drift=0.0)) as bench:
        meter = bench.meter()
        samples = bench.recorded(meter, 2.0)
        times = np.array([sample.device_time for sample in samples])
        assert times[0] == pytest.approx(rollover - 0.99)
        np.testing.assert_allclose(np.diff(times), 0.01, atol=2e-6)
        assert meter.ping().device_time == pytest.approx(rollover + 1.0)
        # and so after a pause longer than the counter, whose rounds no sample tells of
        bench.clock.wait(3 * rollover)
        assert bench.recorded(meter, 1.0)[0].device_time == pytest.approx(4 * rollover + 1.01)


def test_the_count_of_samples_goes_on_when_it_rolls_over() -> None:
    with Bench(PowerMeterPhysics(noise=0.0)) as bench:
        meter = bench.meter()
        samples = bench.recorded(meter, 70.0, rate=1000.0)
        assert len(samples) > 2**16
        assert [sample.sequence for sample in samples] == list(range(len(samples)))


def test_what_the_line_loses_doubles_and_disturbs_is_counted_and_nothing_guessed() -> None:
    physics = PowerMeterPhysics(noise=0.0, lost_share=0.02, duplicated_share=0.03, corrupted_share=0.04)
    with Bench(physics) as bench:
        meter = bench.meter()
        samples = bench.recorded(meter, 20.0)
        emulator = bench.emulator
        average = averaged(samples, begun=0.0, ended=20.0, seconds=20.0, sample_rate=100.0)
        assert int(meter.apparatus()["power_meter_corrupted_lines"]) == emulator.n_corrupted > 20
        assert average.n_duplicated == emulator.n_duplicated > 20
        lost_at_the_end = 1999 - samples[-1].sequence  # so few that they count as outside of the 20 s
        assert average.n_lost + lost_at_the_end == emulator.n_lost + emulator.n_corrupted
        assert average.power == pytest.approx(BASE + SLOPE, abs=1e-6)  # a microwatt is the line's last digit
        assert {round(sample.power, 4) for sample in samples} == {round(BASE + SLOPE, 4)}


def test_pings_and_the_backlight_work_while_it_samples() -> None:
    with Bench(PowerMeterPhysics(noise=0.0, clock_drift=0.0)) as bench:
        meter, backlight = bench.meter(), BoardBacklight(bench.url)
        meter.start(100.0)
        samples = []
        for factor in (0.5, 0.25):
            assert backlight.set_factor(factor) == pytest.approx(factor, abs=1 / 4095)
            bench.clock.wait(1.0)
            ping = meter.ping()
            assert ping.device_time == pytest.approx(1000.0 + bench.clock.now())
            samples += meter.samples()
        samples += meter.stop()
        powers = [sample.power for sample in samples]
        assert [sample.sequence for sample in samples] == list(range(200))
        assert powers[99] == pytest.approx(BASE + SLOPE * 2048 / 4095, abs=1e-6)
        assert powers[199] == pytest.approx(BASE + SLOPE * 1024 / 4095, abs=1e-6)
        backlight.close()


def test_a_ping_takes_less_than_a_fifth_of_a_frame() -> None:
    panel = SimulatedPanel(PanelPhysics(), time.monotonic)
    simulation = Simulation(panel, np.random.default_rng(8), time.monotonic, time.sleep)
    with (
        EmulatedLink(PowerBoardEmulator(simulation), pseudo_terminal=True) as link,
        BoardPowerMeter(link.url) as meter,
    ):
        meter.start(1000.0)
        pings = [meter.ping()]
        while min(ping.received - ping.sent for ping in pings) >= 0.003 and len(pings) < 2000:
            pings.append(meter.ping())  # others may have the processor meanwhile
        assert len(pings) < 2000
        assert all(ping.received >= ping.sent for ping in pings)


def test_the_sync_input_comes_with_each_sample() -> None:
    with Bench(PowerMeterPhysics(clock_drift=0.0)) as bench:
        meter = bench.meter()
        meter.start(100.0)
        bench.clock.wait(0.105)
        bench.panel.set_sync(True)
        bench.clock.wait(0.1)
        assert [sample.sync for sample in meter.stop()] == [False] * 10 + [True] * 10


def test_an_overload_is_an_error_and_no_power() -> None:
    with Bench(PowerMeterPhysics(highest_power=0.5)) as bench:
        meter = bench.meter()
        with pytest.raises(
            InstrumentError, match=r"INA226 measures, 0.5 W in all; take a smaller shunt"
        ) as told:
            average_power(meter, 0.5, 100.0, bench.clock.now, bench.clock.wait)
        assert told.value.fault is Fault.OVER_RANGE
        bench.panel.set_backlight(0.25)  # 0.387 W
        bench.clock.wait(1.0)
        average = average_power(meter, 0.5, 100.0, bench.clock.now, bench.clock.wait)
        assert average.power == pytest.approx(BASE + SLOPE / 4, abs=0.002)


def test_a_low_supply_of_the_board_is_an_error() -> None:
    with Bench(build=BoardBuild(supply_is_low=True)) as bench:
        with pytest.raises(InstrumentError, match="supply is too low") as told:
            average_power(bench.meter(), 0.5, 100.0, bench.clock.now, bench.clock.wait)
        assert told.value.fault is Fault.LOW_BATTERY


def test_a_sensor_that_is_gone_is_told_in_words() -> None:
    with Bench(build=BoardBuild(sensor_answers=False)) as bench:
        with pytest.raises(InstrumentError, match=r"four wires of I2C \(error 6: sensor lost\)") as told:
            average_power(bench.meter(), 0.5, 100.0, bench.clock.now, bench.clock.wait)
        assert (told.value.fault, told.value.code) == (Fault.REFUSED, "6")


def test_a_board_that_stops_sending_is_found_out() -> None:
    panel = SimulatedPanel(PanelPhysics(), lambda: 0.0)  # its time stands still: no sample is ever due
    simulation = Simulation(panel, np.random.default_rng(8), lambda: 0.0, time.sleep)
    with (
        EmulatedLink(PowerBoardEmulator(simulation), pseudo_terminal=True) as link,
        BoardPowerMeter(link.url) as meter,
    ):
        meter.start(1000.0)
        assert meter.samples() == []
        time.sleep(SILENCE + 0.01)
        with pytest.raises(InstrumentError, match=r"sent no sample for 1\.\d s at 1000 Hz") as told:
            meter.samples()
        assert told.value.fault is Fault.NO_REPLY


def test_another_version_of_the_protocol_is_refused() -> None:
    with Bench(build=BoardBuild(protocol_version="2")) as bench:
        with pytest.raises(InstrumentError, match=r"protocol=2.* speaks version 1") as told:
            bench.meter()
        assert told.value.fault is Fault.WRONG_INSTRUMENT


def test_zero_is_taken_only_near_zero_and_not_while_it_samples() -> None:
    dark = PanelPhysics(base_power=0.001, power_per_luminance=0.0)
    with Bench(panel=dark) as bench:
        meter = bench.meter()
        assert meter.zero() == pytest.approx(0.001 / 5, abs=1e-6)  # [A] at 5 V
        meter.start(10.0)
        with pytest.raises(InstrumentError, match="not while it samples"):
            meter.zero()
    with Bench() as bench, pytest.raises(InstrumentError, match="unplug the panel before zeroing") as told:
        bench.meter().zero()
    assert told.value.code == "8"


def test_a_board_left_sampling_by_another_program_is_taken_over() -> None:
    with Bench(PowerMeterPhysics(noise=0.0)) as bench:
        left = PowerBoard(bench.url)
        left.ask("START 100")
        bench.clock.wait(5.0)
        left.close()  # as a program that was killed: no STOP
        meter = bench.meter()
        samples = bench.recorded(meter, 1.0)
        assert [sample.sequence for sample in samples] == list(range(100))
        assert samples[0].received >= 5.0


@pytest.mark.parametrize("factor", [0.0, -0.1, 1.01, 1e-5, float("nan")])
def test_a_factor_that_the_board_has_not_is_refused(factor) -> None:
    with Bench() as bench, BoardBacklight(bench.url, timeout=TIMEOUT) as backlight:
        with pytest.raises(InstrumentError, match=r"has factors from 0.0002442 to 1, got"):
            backlight.set_factor(factor)
        assert backlight.read_factor() == 1.0


def test_the_backlight_dims_the_panel_and_is_left_as_it_was_found() -> None:
    with Bench() as bench:
        with PowerBoard(bench.url) as board:
            board.ask("B 3000")
        with BoardBacklight(bench.url, timeout=TIMEOUT) as backlight:
            assert backlight.set_factor(0.5) == 2048 / 4095
            assert backlight.read_factor() == 2048 / 4095
            assert backlight.smallest_factor() == backlight.step() == 1 / 4095
            assert backlight.min_interval() > 0
            bench.clock.wait(1.0)
            assert bench.panel.power() == pytest.approx(BASE + SLOPE * 2048 / 4095)
        with PowerBoard(bench.url) as board:
            assert board.ask("B?") == ["3000"]


def test_a_late_answer_of_the_backlight_is_not_that_to_the_next_question() -> None:
    # Replies: ID?, B?, then that to B 2048, which is late.
    plan = FaultPlan(LinkFault.LATE_REPLY, first=3, delay=0.7)
    with Bench(plan=plan) as bench, BoardBacklight(bench.url, timeout=0.5) as backlight:
        with pytest.raises(InstrumentError, match="no reply to 'B 2048'") as told:
            backlight.set_factor(0.5)
        assert told.value.fault is Fault.NO_REPLY
        assert backlight.set_factor(0.25) == 1024 / 4095
        assert backlight.read_factor() == 1024 / 4095


def test_a_board_without_pwm_is_no_backlight() -> None:
    with Bench(build=BoardBuild(pwm_steps=0)) as bench:
        with pytest.raises(InstrumentError, match="no PWM output"):
            BoardBacklight(bench.url, timeout=TIMEOUT)
        bench.meter()  # and its port is free again


def test_a_shared_board_is_closed_with_the_last_of_its_devices() -> None:
    with Bench() as bench:
        meter, backlight = BoardPowerMeter(bench.url), BoardBacklight(bench.url)
        board = board_at(bench.url, time.monotonic)
        board.release()  # this test's own share
        meter.close()
        assert board.is_open()
        assert backlight.set_factor(1.0) == 1.0
        backlight.close()
        assert not board.is_open()
        with pytest.raises(InstrumentError, match="closed"):
            backlight.set_factor(0.5)


@pytest.mark.parametrize(
    "said",
    [
        {"max_rate_hz": "nan"},
        {"max_rate_hz": "inf"},
        {"max_rate_hz": "0"},
        {"max_rate_hz": "-1000"},
        {"max_power_uw": "0"},
        {"max_power_uw": "-4096000"},
        {"pwm_steps": "-5"},
        {"pwm_steps": "1.5"},
    ],
)
def test_an_identity_that_no_board_has_is_refused(said) -> None:
    class Strange(PowerBoardEmulator):
        def _identity(self) -> str:
            words = super()._identity().split()
            return " ".join(
                f"{key}={said.get(key, value)}" if is_said else key
                for key, is_said, value in (word.partition("=") for word in words)
            )

    with Bench() as bench:
        bench.emulator.__class__ = Strange
        (value,) = said.values()
        with pytest.raises(InstrumentError, match="its identity cannot be read") as told:
            bench.meter()
        assert value in str(told.value)
        assert told.value.fault is Fault.WRONG_INSTRUMENT


@pytest.mark.parametrize(
    ("command", "reply"),
    [
        ("START", "0"),
        ("START", "-4000"),
        ("START", "nan"),
        ("START", "0.5"),
        ("CLOCK?", "nan"),
        ("CLOCK?", "-1"),
        ("CLOCK?", "inf"),
        ("CLOCK?", "12 13"),
        ("CLOCK?", ""),
        ("ZERO", "nan"),
    ],
)
def test_a_number_that_no_board_answers_is_garbled(command, reply) -> None:
    class Strange(PowerBoardEmulator):
        def _obey(self, name: str, argument: str) -> str:
            return reply if name == command else super()._obey(name, argument)

    with Bench() as bench:
        bench.emulator.__class__ = Strange
        meter = bench.meter()
        use = {"START": lambda: meter.start(100.0), "CLOCK?": meter.ping, "ZERO": meter.zero}[command]
        with pytest.raises(InstrumentError, match=r"answered '.*' where a (whole )?number.*belongs") as told:
            use()
        assert told.value.fault is Fault.GARBLED


def test_an_address_says_the_baud_rate_and_nothing_unknown() -> None:
    with Bench(build=BoardBuild(native_usb=False)) as bench:
        with BoardPowerMeter(f"{bench.url}?baud=921600") as meter:
            assert meter.start(1000.0) == 1000.0  # 0.85 * 92160 / 36 = 2176 Hz
        with pytest.raises(InputError, match=r"no option 'boud'; there is baud"):
            BoardPowerMeter(f"{bench.url}?boud=9600")
        with pytest.raises(InputError, match="baud must be a number above 0, got 'fast'"):
            BoardPowerMeter(f"{bench.url}?baud=fast")


def test_the_dialogue_is_the_one_that_is_documented() -> None:
    line = protocol.with_checksum
    identity = (
        "evenlight-power-board protocol=1 chip=INA226 serial=7 firmware=1.0 max_rate_hz=1000 line=uart "
        "max_power_uw=16384000 pwm_steps=4095"
    )
    script = ScriptedInstrument(
        [
            (line("1 ID?"), line(f"OK 1 ID? {identity}")),
            (line("2 STOP"), line("OK 2 STOP")),
            (line("3 CLOCK?"), line("OK 3 CLOCK? 4294967000000")),
            (line("4 START 100.000000"), line("OK 4 START 10000") + line("P 0 296 672300 1")),
            (line("5 STOP"), line("P 1 10296 -120 0") + line("OK 5 STOP")),
            (line("6 STOP"), line("OK 6 STOP")),
        ]
    )
    with EmulatedLink(script, pseudo_terminal=True) as link:
        with BoardPowerMeter(link.url, lambda: 7.0, TIMEOUT) as meter:
            assert meter.start(100.0) == 100.0
            first, second = meter.stop()
        script.finish()
    # 4294967000000 µs are 999 rounds of 2**32 µs and 4294671296 µs; 296 µs later lies in the round after
    ticks = 4294967000000 // 2**32 * 2**32 + 2**32 + 296
    assert (first.sequence, first.received, first.sync) == (0, 7.0, True)
    assert (first.device_time, first.power) == (pytest.approx(ticks * 1e-6), pytest.approx(0.6723))
    assert (second.power, second.sync) == (pytest.approx(-0.00012), False)

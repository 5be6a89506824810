"""Average power: weighted by time, each sample once, lost and duplicated ones counted."""

from __future__ import annotations

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.power_average import PowerAverage, average_power
from evenlight.hardware.power_average import averaged as averaged_over
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics, SimulatedPowerMeter


def rows(*numbers: tuple[int, float, float]) -> list[PowerSample]:
    """Return samples of sequence, time [s] and power [W]."""
    return [PowerSample(sequence, time, time, power) for sequence, time, power in numbers]


def averaged(samples: list[PowerSample], seconds: float) -> PowerAverage:
    """Average samples of some seconds at 1 Hz."""
    return averaged_over(samples, begun=0.0, ended=seconds, seconds=seconds, sample_rate=1.0)


def simulated(physics: PowerMeterPhysics) -> tuple[SimulatedPowerMeter, WaitingClock, SimulatedPanel]:
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(lag=1e-4), clock.now)
    simulation = Simulation(panel, np.random.default_rng(3), clock.now, clock.wait)
    return SimulatedPowerMeter(simulation, physics), clock, panel


def test_a_sample_counts_for_the_time_since_the_one_before() -> None:
    # 1 W for 1 s, then 4 W for 3 s by one slow sample: (1*1 + 4*3) / 4
    assert averaged(rows((0, 0.0, 9.0), (1, 1.0, 1.0), (2, 4.0, 4.0)), 4.0).power == 13 / 4


def test_a_gap_takes_the_mean_of_its_neighbours() -> None:
    # Samples each second; those of 2 s and 3 s are lost. 1 W in the first second, 3 W in the last, and
    # between them two seconds of (1 + 3) / 2: (1 + 2 + 2 + 3) / 4.
    average = averaged(rows((0, 0.0, 9.0), (1, 1.0, 1.0), (4, 4.0, 3.0)), 4.0)
    assert average.power == pytest.approx(8 / 4)
    assert (average.n_samples, average.n_lost) == (3, 2)
    assert average.status == "2 lost"


def test_a_sample_that_comes_twice_counts_once() -> None:
    once = averaged(rows((0, 0.0, 1.0), (1, 1.0, 2.0), (2, 2.0, 3.0)), 2.0)
    twice = averaged(rows((0, 0.0, 1.0), (1, 1.0, 2.0), (1, 1.0, 2.0), (2, 2.0, 3.0)), 2.0)
    assert (twice.power, twice.power_sd, twice.n_samples) == (once.power, once.power_sd, 3)
    assert (twice.n_duplicated, twice.n_lost, twice.status) == (1, 0, "1 came twice")


def test_an_average_that_stands_on_less_than_half_is_refused() -> None:
    with pytest.raises(InstrumentError, match="lost 3 of 5") as told:
        averaged(rows((0, 0.0, 1.0), (4, 4.0, 1.0)), 4.0)
    assert told.value.fault is Fault.GARBLED


def test_what_did_not_come_at_the_end_is_lost_too() -> None:
    # 10 s at 1 Hz are 10 samples, and 7 came; the meter's count tells of none that is missing.
    average = averaged(rows(*((k, float(k), 1.0) for k in range(7))), 10.0)
    assert (average.n_samples, average.n_lost, average.status) == (7, 3, "3 lost (3 at the ends)")


def test_what_did_not_come_at_the_beginning_is_lost_too() -> None:
    # Meters count from 0: of 10 samples, those of 0 to 3 did not come, nor did that of 6.
    average = averaged(rows(*((k, float(k), 1.0) for k in (4, 5, 7, 8, 9))), 10.0)
    assert (average.n_lost, average.status) == (5, "5 lost (4 at the ends)")


def test_a_meter_that_is_asked_and_has_no_answer_at_first_has_lost_them() -> None:
    # It counts its answers: the first, 0, came 4 s late; 6 samples cover 6 of 10 s.
    average = averaged(rows(*((k - 4, float(k), 1.0) for k in range(4, 10))), 10.0)
    assert (average.n_samples, average.n_lost) == (6, 4)


def test_a_meter_that_answers_more_slowly_than_it_said_has_lost_nothing() -> None:
    average = averaged(rows(*((k, 2.0 * k, 1.0) for k in range(5))), 10.0)  # each 2 s instead of each second
    assert (average.n_samples, average.n_lost, average.status) == (5, 0, "")


def test_where_samples_fall_in_a_time_and_the_meters_clock_lose_nothing() -> None:
    # Two of the ends fall outside; a clock that is 1 % slow makes 990 samples in 1000 s.
    assert averaged(rows(*((k, float(k), 1.0) for k in range(8))), 10.0).n_lost == 0
    assert averaged(rows(*((k, float(k), 1.0) for k in range(990))), 1000.0).n_lost == 0
    assert averaged(rows(*((k, float(k), 1.0) for k in range(980))), 1000.0).n_lost == 20


def test_a_meter_that_falls_silent_before_half_of_the_time_gives_no_average() -> None:
    with pytest.raises(
        InstrumentError, match=r"lost 6 of 10 samples, 6 of them at the .*fell silent"
    ) as told:
        averaged(rows(*((k, float(k), 1.0) for k in range(4))), 10.0)
    assert told.value.fault is Fault.NO_REPLY


def test_an_average_knows_how_long_it_was_to_last() -> None:
    class Falling(SimulatedPowerMeter):
        def samples(self) -> list[PowerSample]:
            return [one for one in super().samples() if one.sequence < 300]

        def stop(self) -> list[PowerSample]:
            return [one for one in super().stop() if one.sequence < 300]

    for seconds, lost in ((3.0, 0), (4.0, 100)):
        clock = WaitingClock()
        panel = SimulatedPanel(PanelPhysics(), clock.now)
        simulation = Simulation(panel, np.random.default_rng(3), clock.now, clock.wait)
        meter = Falling(simulation, PowerMeterPhysics(clock_drift=0.0))
        average = average_power(meter, seconds, 100.0, clock.now, clock.wait)
        assert average.n_lost == pytest.approx(lost, abs=1)
        assert average.n_samples == pytest.approx(300, abs=1)


def test_one_sample_is_no_average() -> None:
    with pytest.raises(InstrumentError, match="sent 1 samples"):
        averaged(rows((0, 0.0, 1.0)), 4.0)


def test_a_clock_that_goes_back_is_refused() -> None:
    with pytest.raises(InstrumentError, match="between its samples 1 and 2"):
        averaged(rows((0, 0.0, 1.0), (1, 2.0, 1.0), (2, 1.0, 1.0)), 4.0)


def test_time_goes_by_the_meters_own_clock() -> None:
    meter, clock, _ = simulated(PowerMeterPhysics(noise=0.0, clock_drift=0.01))
    average = average_power(meter, 10.0, 10.0, clock.now, clock.wait)
    # In 10 s of the computer it takes 10 * 10 * 1.01 samples; from the first to the last are 100 tenths.
    assert (average.n_samples, average.duration) == (101, pytest.approx(10.0))
    assert (average.begun, average.ended) == (0.0, pytest.approx(10.0))


def test_lost_and_duplicated_samples_leave_the_mean_where_it_is() -> None:
    physics = PowerMeterPhysics(noise=0.0, lost_share=0.1, duplicated_share=0.1)
    meter, clock, _ = simulated(physics)
    average = average_power(meter, 20.0, 100.0, clock.now, clock.wait)
    assert average.power == pytest.approx(0.2945 + 0.001858 * 200, rel=1e-9)
    # Binomial, n = 2000 and p = 0.1: 200 with a standard deviation of 13.4; five of them are allowed.
    assert abs(average.n_lost - 200) < 67
    assert abs(average.n_duplicated - 200) < 67
    assert average.n_samples + average.n_lost == pytest.approx(2000, abs=3)  # the last may be lost, too


def test_a_square_wave_has_the_mean_of_its_halves() -> None:
    meter, clock, panel = simulated(PowerMeterPhysics(noise=0.0, clock_drift=0.0))

    def wait(seconds: float) -> None:
        panel.set_backlight(1.0 if round(clock.now() / 0.01) % 2 else 0.5)
        clock.wait(seconds)

    average = average_power(meter, 4.0, 100.0, clock.now, wait)
    # Each 10 ms the other half: the mean of P(1) and P(0.5), but for the lag of 0.1 ms and one sample's end.
    assert average.power == pytest.approx(0.2945 + 0.001858 * 200 * 0.75, abs=0.002)


def test_too_short_a_time_is_refused_and_the_meter_stopped() -> None:
    meter, clock, _ = simulated(PowerMeterPhysics())
    with pytest.raises(InputError, match=r"at least 2 samples: 0.2 s at 10 Hz, got 0.1 s"):
        average_power(meter, 0.1, 10.0, clock.now, clock.wait)
    with pytest.raises(InstrumentError, match="start it first"):
        meter.samples()


def test_an_overload_ends_the_average_and_stops_the_meter() -> None:
    meter, clock, _ = simulated(PowerMeterPhysics(highest_power=0.5))
    with pytest.raises(InstrumentError, match=r"more than 0.5 W") as told:
        average_power(meter, 1.0, 10.0, clock.now, clock.wait)
    assert told.value.fault is Fault.OVER_RANGE
    with pytest.raises(InstrumentError, match="start it first"):
        meter.samples()


def test_an_interruption_stops_the_meter() -> None:
    meter, clock, _ = simulated(PowerMeterPhysics())

    def interrupted(seconds: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        average_power(meter, 1.0, 10.0, clock.now, interrupted)
    with pytest.raises(InstrumentError, match="start it first"):
        meter.samples()

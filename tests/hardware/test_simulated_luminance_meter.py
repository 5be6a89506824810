"""The simulated luminance meter: noise, digits, range, calibration and time are those that it states."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.luminance_meter import MeterPhysics, SimulatedLuminanceMeter, in_digits
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

SILENT = MeterPhysics(proportional_noise=0.0, floor_noise=0.0)
STEADY = PanelPhysics(peak_luminance=100.0, black_level=0.0, gamma=1.0, warm_up_share=0.0)


def looking_at(luminance: float, panel: PanelPhysics = STEADY) -> Simulation:
    """A panel of a luminance [cd/m^2]."""
    clock = WaitingClock()
    simulated = SimulatedPanel(panel, clock.now)
    simulated.show(luminance / panel.peak_luminance)
    return Simulation(simulated, np.random.default_rng(11), clock.now, clock.wait)


def test_without_noise_it_reads_the_panel_in_its_digits() -> None:
    assert SimulatedLuminanceMeter(looking_at(98.7654), SILENT).read_luminance().value == 98.77
    assert SimulatedLuminanceMeter(looking_at(0.1264), SILENT).read_luminance().value == 0.13


def test_the_noise_is_a_share_of_the_luminance_and_a_floor() -> None:
    """Of 2000 readings, the mean is within 4 standard errors and the deviation within 4 of its own."""
    physics = MeterPhysics(proportional_noise=0.003, floor_noise=0.04, resolution=1e-6, significant_digits=9)
    for luminance in (1.0, 80.0):
        meter = SimulatedLuminanceMeter(looking_at(luminance), physics)
        values = [meter.read_luminance().value for _ in range(2000)]
        sd = np.hypot(0.003 * luminance, 0.04)
        assert np.mean(values) == pytest.approx(luminance, abs=4 * sd / np.sqrt(2000))
        assert np.std(values) == pytest.approx(sd, rel=4 / np.sqrt(2 * 2000))


def test_an_error_of_calibration_is_in_every_reading_and_stated() -> None:
    meter = SimulatedLuminanceMeter(looking_at(50.0), dataclasses.replace(SILENT, calibration_error=0.02))
    assert meter.read_luminance().value == 51.0
    assert meter.apparatus()["calibration error"] == "0.02 of the luminance"
    assert "SIMULATED" in meter.apparatus()["model"]


def test_it_reads_more_slowly_in_the_dark_and_no_test_waits_for_it() -> None:
    """By hand: 0.4 + 2.6 / (1 + L), for L = 99 and 0.3 cd/m^2."""
    for luminance, duration in ((99.0, 0.426), (0.3, 2.4)):
        reading = SimulatedLuminanceMeter(looking_at(luminance), SILENT).read_luminance()
        assert reading.ended - reading.begun == pytest.approx(duration)


def test_a_reading_is_of_the_middle_of_its_time() -> None:
    """A cold panel at 30 % less, warming in 1 s: 1 - 0.3 exp(-0.5 T) after half of T = 0.4 + 2.6 / 71."""
    cold = dataclasses.replace(STEADY, warm_up_share=-0.3, warm_up_time=1.0)
    duration = 0.4 + 2.6 / 71.0
    fine = dataclasses.replace(SILENT, significant_digits=9, resolution=1e-6)
    reading = SimulatedLuminanceMeter(looking_at(100.0, cold), fine).read_luminance()
    assert reading.value == pytest.approx(100 * (1 - 0.3 * np.exp(-duration / 2)), abs=1e-5)


@pytest.mark.parametrize(
    ("luminance", "fault", "words"),
    [(0.004, Fault.UNDER_RANGE, "from 0.01"), (90.0, Fault.OVER_RANGE, "up to 80")],
)
def test_out_of_its_range_it_has_no_value(luminance: float, fault: Fault, words: str) -> None:
    meter = SimulatedLuminanceMeter(looking_at(luminance), dataclasses.replace(SILENT, highest=80.0))
    with pytest.raises(InstrumentError, match=words) as failed:
        meter.read_luminance()
    assert failed.value.fault is fault


def test_closed_it_reads_nothing() -> None:
    with SimulatedLuminanceMeter(looking_at(50.0)) as meter:
        pass
    meter.close()
    with pytest.raises(InstrumentError, match="closed"):
        meter.read_luminance()


@given(st.floats(1e-3, 1e5))
def test_digits_change_a_reading_by_half_a_step_at_most(luminance: float) -> None:
    """A step is 0.01 cd/m^2, or the fourth digit."""
    step = max(0.01, 10.0 ** (np.floor(np.log10(luminance)) - 3))
    assert abs(in_digits(luminance, SILENT) - luminance) <= 0.5 * step * (1 + 1e-9)

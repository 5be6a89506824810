"""The computer's own battery: units, signs and states as power_supply documents them, and faults in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evenlight.hardware.drivers.polled_power import BatteryPowerMeter
from evenlight.hardware.power_average import average_power
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock

# 11.4 V and 0.75 A: 8.55 W
LAPTOP = {"type": "Battery", "status": "Discharging", "voltage_now": "11400000", "current_now": "750000"}


@pytest.fixture(autouse=True)
def _linux(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(BatteryPowerMeter, "root", tmp_path)


def battery(root: Path, files: dict[str, str], name: str = "BAT0") -> Path:
    folder = root / "class/power_supply" / name
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in files.items():
        (folder / file).write_text(f"{text}\n")
    return folder


def power(url: str = "") -> float:
    with BatteryPowerMeter(url, lambda: 1.0) as meter:
        meter.start(1.0)
        (sample,) = meter.samples()
        return sample.power


@pytest.mark.parametrize("current", ["750000", "-750000"])
def test_whichever_sign_a_gauge_gives_it_is_what_is_drawn(tmp_path, current) -> None:
    """Linux, power_supply, 2020: gauges have three conventions, and user space cannot go by the sign."""
    battery(tmp_path, LAPTOP | {"current_now": current})
    assert power() == pytest.approx(8.55)


def test_power_now_in_microwatts_is_taken_where_it_is(tmp_path) -> None:
    battery(tmp_path, {"type": "Battery", "status": "Discharging", "power_now": "6723000"})
    assert power("BAT0") == pytest.approx(6.723)


@pytest.mark.parametrize("status", ["Charging", "Full", "Not charging", "Unknown", ""])
def test_a_battery_that_is_not_discharged_is_refused_in_words(tmp_path, status) -> None:
    battery(tmp_path, LAPTOP | {"status": status})
    with pytest.raises(
        InstrumentError, match=r"only while it is 'Discharging'.*pull the charging cable"
    ) as told:
        BatteryPowerMeter("")
    assert told.value.fault is Fault.REFUSED


def test_a_cable_that_is_plugged_in_meanwhile_ends_the_measurement(tmp_path) -> None:
    folder, clock = battery(tmp_path, LAPTOP), WaitingClock()
    meter = BatteryPowerMeter("", clock.now)

    def wait(seconds: float) -> None:
        clock.wait(seconds)
        if clock.now() > 3:
            (folder / "status").write_text("Charging\n")

    with pytest.raises(InstrumentError, match="'Charging'"):
        average_power(meter, 10.0, 1.0, clock.now, wait)


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"current_now": "0"}, Fault.IMPLAUSIBLE),
        ({"current_now": "75o000"}, Fault.GARBLED),
        ({"current_now": ""}, Fault.GARBLED),
        ({"current_now": "nan"}, Fault.GARBLED),
        ({"current_now": "1e6"}, Fault.GARBLED),
        ({"current_now": "75000000000"}, Fault.IMPLAUSIBLE),
        ({"voltage_now": "114"}, Fault.IMPLAUSIBLE),
        ({"voltage_now": "-11400000"}, Fault.IMPLAUSIBLE),
    ],
)
def test_a_number_that_no_battery_has_is_an_error_and_no_reading(tmp_path, changed, fault) -> None:
    folder = battery(tmp_path, LAPTOP)
    with BatteryPowerMeter("") as meter:
        meter.start(1.0)
        battery(tmp_path, changed, folder.name)
        with pytest.raises(InstrumentError) as told:
            meter.samples()
    assert told.value.fault is fault
    assert "BAT0" in str(told.value)


def test_units_are_settled_at_the_first_reading(tmp_path) -> None:
    """A gauge in mA and mV, then one number a thousand times as small: an error, not 1000 times the power."""
    battery(tmp_path, LAPTOP | {"current_now": "750", "voltage_now": "11400"})
    assert power() == pytest.approx(8.55)
    battery(tmp_path, LAPTOP)
    with BatteryPowerMeter("") as meter:
        meter.start(1.0)
        battery(tmp_path, {"current_now": "750"})
        with pytest.raises(InstrumentError, match=r"0\.00075 A"):
            meter.samples()


def test_the_battery_of_a_mouse_is_not_the_computers(tmp_path) -> None:
    battery(tmp_path, LAPTOP | {"scope": "Device"}, "hidpp_battery_0")
    battery(tmp_path, {"type": "Mains", "online": "0"}, "AC")
    with pytest.raises(InstrumentError, match="there is none") as told:
        BatteryPowerMeter("")
    assert told.value.fault is Fault.NOT_FOUND
    battery(tmp_path, LAPTOP)
    assert power() == pytest.approx(8.55)


def test_of_two_batteries_one_must_be_named(tmp_path) -> None:
    battery(tmp_path, LAPTOP)
    battery(tmp_path, LAPTOP | {"current_now": "500000"}, "BAT1")
    with pytest.raises(InstrumentError, match="several, battery:BAT0, battery:BAT1; give one of these"):
        BatteryPowerMeter("")
    assert power("BAT1") == pytest.approx(5.7)


def test_a_battery_without_power_says_what_is_missing(tmp_path) -> None:
    battery(tmp_path, {"type": "Battery", "status": "Discharging", "voltage_now": "11400000"})
    with pytest.raises(InstrumentError, match="neither power_now nor current_now with voltage_now"):
        BatteryPowerMeter("")


def test_a_value_that_stands_counts_for_as_long_as_it_stands(tmp_path) -> None:
    """A gauge renewed every 8 s, read every second: 8 s of 4 W and 4 s of 10 W are 6 W, not 7."""
    clock = WaitingClock()
    folder = battery(tmp_path, {"type": "Battery", "status": "Discharging", "power_now": "4000000"})

    def wait(seconds: float) -> None:
        clock.wait(seconds)
        (folder / "power_now").write_text("4000000" if clock.now() < 8.01 else "10000000")

    average = average_power(BatteryPowerMeter("", clock.now), 12.5, 1.0, clock.now, wait)
    assert average.power == pytest.approx(6.0, abs=0.1)


def test_no_made_up_number_in_many_random_faults(tmp_path) -> None:
    """A byte of status, current or voltage is another; a reading is the true one, or an error.

    A file of the kernel comes whole: that a number lacks its last digit is no fault that there is.
    """
    rng, folder = np.random.default_rng(21), battery(tmp_path, LAPTOP)
    n_errors = 0
    with BatteryPowerMeter("", lambda: 0.0) as meter:
        for _ in range(100):
            name = str(rng.choice(["status", "voltage_now", "current_now"]))
            text = bytearray(LAPTOP[name].encode())
            text[rng.integers(len(text))] = rng.choice(list(b"\0xe.,\xff/"))
            (folder / name).write_bytes(bytes(text))
            meter.start(1.0)
            try:
                assert meter.samples()[0].power == pytest.approx(8.55)
            except InstrumentError:
                n_errors += 1
            (folder / name).write_text(LAPTOP[name])
    assert n_errors > 80

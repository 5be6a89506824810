"""A power sensor under Linux's hwmon or iio: its files, their units, and what is wrong with them in words."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from emulators.power_meters import HwmonEmulator

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.polled_power import HwmonPowerMeter
from evenlight.hardware.power_average import average_power
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

FULL = 0.2945 + 0.001858 * 200  # [W]


@pytest.fixture(autouse=True)
def _linux(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(HwmonPowerMeter, "root", tmp_path)


def sensor(root: Path, files: dict[str, str], folder: str = "class/hwmon/hwmon3") -> Path:
    """Return the folder of a sensor with some files in it."""
    path = root / folder
    path.mkdir(parents=True)
    for name, text in files.items():
        (path / name).write_text(text)
    return path


def read(url: str) -> float:
    """Return one power that a driver reads."""
    with HwmonPowerMeter(url, lambda: 1.0) as meter:
        meter.start(10.0)
        (sample,) = meter.samples()
        return sample.power


@pytest.fixture
def simulation() -> Simulation:
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(), clock.now)
    return Simulation(panel, np.random.default_rng(2), clock.now, clock.wait)


def test_power_is_in_microwatts(tmp_path) -> None:
    sensor(tmp_path, {"name": "ina226\n", "power1_input": "672300\n"})
    assert read("ina226") == pytest.approx(0.6723)


def test_without_power_it_is_milliamperes_times_millivolts(tmp_path) -> None:
    folder = sensor(tmp_path, {"name": "ina3221\n", "curr2_input": "120\n", "in2_input": "5000\n"})
    assert read(f"{folder}?channel=2") == pytest.approx(0.12 * 5.0)


def test_power_of_iio_is_milliwatts_by_its_scale(tmp_path) -> None:
    files = {"name": "ina226\n", "in_power2_raw": "1600\n", "in_power2_scale": "0.42\n"}
    sensor(tmp_path, files, "bus/iio/devices/iio:device0")
    assert read("ina226") == pytest.approx(1600 * 0.42e-3)


def test_without_power_iio_gives_current_times_the_panels_voltage(tmp_path) -> None:
    files = {
        "in_current3_raw": "240\n",
        "in_current3_scale": "0.5\n",  # mA
        "in_voltage0_raw": "999\n",  # over the shunt: not the panel's
        "in_voltage0_scale": "0.0025\n",
        "in_voltage1_raw": "4000\n",
        "in_voltage_scale": "1.25\n",  # mV, of all voltages
    }
    folder = sensor(tmp_path, files, "bus/iio/devices/iio:device0")
    assert read(str(folder)) == pytest.approx(0.12 * 5.0)


def test_a_sensor_whose_shunt_is_at_its_end_is_over_range(tmp_path) -> None:
    # An INA226 tells up to 81.92 mV; hwmon has whole millivolts.
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "20480000\n", "in0_input": "82\n"})
    with pytest.raises(
        InstrumentError, match=r"82 mV over the shunt.*81.92 mV; take a smaller shunt"
    ) as told:
        HwmonPowerMeter(str(folder))
    assert told.value.fault is Fault.OVER_RANGE
    (folder / "in0_input").write_text("-82\n")
    with pytest.raises(InstrumentError, match="over the shunt"):
        HwmonPowerMeter(str(folder))
    (folder / "in0_input").write_text("80\n")
    HwmonPowerMeter(str(folder))


IIO = {
    "in_voltage0_raw": "32767\n",
    "in_voltage0_scale": "0.0025\n",  # mV
    "in_voltage1_raw": "4000\n",
    "in_voltage1_scale": "1.25\n",
    "in_current3_raw": "8191\n",
    "in_current3_scale": "0.1\n",
}


def test_a_shunt_at_its_end_is_over_range_under_iio_too(tmp_path) -> None:
    """The register of 16 bits ends at 32767, which times 2.5 µV is 81.9175 mV."""
    folder = sensor(tmp_path, {"name": "ina226\n", **IIO}, "bus/iio/devices/iio:device0")
    for raw in ("32767", "-32768"):
        (folder / "in_voltage0_raw").write_text(f"{raw}\n")
        with pytest.raises(InstrumentError, match=r"81.92 mV over the shunt.*take a smaller shunt") as told:
            HwmonPowerMeter(str(folder))
        assert told.value.fault is Fault.OVER_RANGE
    (folder / "in_voltage0_raw").write_text("32700\n")
    HwmonPowerMeter(str(folder))


def test_the_range_of_an_ina219_under_iio_goes_by_its_gain(tmp_path) -> None:
    """Data sheet SBOS448: 40 mV at gain 1, 320 mV at gain 1/8; its register has steps of 10 µV."""
    files = {"name": "ina219\n", **IIO, "in_voltage0_raw": "4000\n", "in_voltage0_scale": "0.01\n"}
    folder = sensor(tmp_path, files, "bus/iio/devices/iio:device0")
    HwmonPowerMeter(str(folder))
    (folder / "in_voltage0_hardwaregain").write_text("1\n")
    with pytest.raises(InstrumentError, match=r"40 mV over the shunt.* tells is 40 mV"):
        HwmonPowerMeter(str(folder))
    (folder / "in_voltage0_hardwaregain").write_text("0.125\n")
    HwmonPowerMeter(str(folder))


@pytest.mark.parametrize(
    ("voltage", "limit", "end"),
    [
        ("40", "", "40.96"),  # which of its two ranges it has is not told
        ("163", "", "163.84"),
        ("42", "", ""),
        ("40", "40", "40.96"),
        ("40", "163", ""),
        ("163", "163", "163.84"),
        ("20", "25", ""),  # a limit that somebody has set
        ("40", "25", "40.96"),
        ("120", "25", ""),
        ("40", "100", ""),
    ],
)
def test_an_ina228_ends_at_the_range_that_its_limit_tells(tmp_path, voltage, limit, end) -> None:
    files = {"name": "ina228\n", "power1_input": "2048000\n", "in0_input": f"{voltage}\n"}
    folder = sensor(tmp_path, files | ({"in0_max": f"{limit}\n"} if limit else {}))
    if not end:
        HwmonPowerMeter(str(folder))
        return
    with pytest.raises(InstrumentError, match=f"tells is {end} mV") as told:
        HwmonPowerMeter(str(folder))
    assert told.value.fault is Fault.OVER_RANGE


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected a number, got ''"),
        ("12mW\n", "got '12mW'"),
        ("nan\n", "got 'nan'"),
        ("1_0\n", "got '1_0'"),
        ("\x00", "got"),
    ],
)
def test_what_is_no_number_is_garbled(tmp_path, text, words) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": text})
    with pytest.raises(InstrumentError, match=f"power1_input: .*{words}") as told:
        HwmonPowerMeter(str(folder))
    assert told.value.fault is Fault.GARBLED


def test_a_current_that_flows_backwards_is_no_power(tmp_path) -> None:
    files = {"name": "ina219\n", "curr1_input": "-120\n", "in1_input": "5000\n"}
    folder = sensor(tmp_path, files)
    with pytest.raises(InstrumentError, match=r"-0.600 W, so the current flows backwards; swap"):
        HwmonPowerMeter(str(folder))
    (folder / "curr1_input").write_text("-1\n")  # a zero error of 5 mW
    assert read(str(folder)) == pytest.approx(-0.005)


def test_a_sensor_that_goes_away_is_disconnected(tmp_path) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "672300\n"})
    with HwmonPowerMeter(str(folder), lambda: 1.0) as meter:
        meter.start(10.0)
        (folder / "power1_input").unlink()
        with pytest.raises(InstrumentError, match=r"power1_input: is gone; was the sensor unplugged") as told:
            meter.samples()
        assert (told.value.fault, told.value.code) == (Fault.DISCONNECTED, "ENOENT")


def test_a_sensor_that_does_not_answer_is_told(tmp_path) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "672300\n"})
    (folder / "power1_input").unlink()
    (folder / "power1_input").mkdir()  # cannot be read, as a chip that is off the bus cannot
    with pytest.raises(InstrumentError, match=r"cannot be read \(Is a directory\); does the sensor") as told:
        HwmonPowerMeter(str(folder))
    assert told.value.fault is Fault.NO_REPLY


def test_a_file_that_may_not_be_read_says_what_to_do(tmp_path, monkeypatch) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "672300\n"})

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied")  # root, as which tests may run, is refused nothing

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(InstrumentError, match="may not be read; ask an administrator for a udev rule"):
        HwmonPowerMeter(str(folder))


def test_a_sensor_that_is_not_there_is_told_with_those_that_are(tmp_path, monkeypatch) -> None:
    sensor(tmp_path, {"name": "ina226\n", "power1_input": "1\n"})
    sensor(tmp_path, {"name": "coretemp\n", "temp1_input": "45000\n"}, "class/hwmon/hwmon0")
    with pytest.raises(
        InstrumentError, match=r"hwmon:ina219: .* no such device; there is hwmon:.*hwmon3 \(ina226\)$"
    ) as told:
        HwmonPowerMeter("ina219")
    assert told.value.fault is Fault.NOT_FOUND
    monkeypatch.setattr(HwmonPowerMeter, "root", tmp_path / "empty")
    with pytest.raises(InstrumentError, match="no such device; there is none"):
        HwmonPowerMeter("ina219")


def test_two_sensors_of_a_name_must_be_identifiable(tmp_path) -> None:
    for number in (3, 4):
        sensor(tmp_path, {"name": "ina226\n", "power1_input": "1\n"}, f"class/hwmon/hwmon{number}")
    with pytest.raises(InstrumentError, match=r"there are several, hwmon:.*hwmon3, hwmon:.*hwmon4; give one"):
        HwmonPowerMeter("ina226")


def test_a_sensor_of_something_else_is_the_wrong_instrument(tmp_path) -> None:
    folder = sensor(tmp_path, {"name": "coretemp\n", "temp1_input": "45000\n"})
    with pytest.raises(InstrumentError, match="coretemp measures no power on channel 1") as told:
        HwmonPowerMeter(str(folder))
    assert told.value.fault is Fault.WRONG_INSTRUMENT


@pytest.mark.parametrize("channel", ["1.5", "0", "-1", "two"])
def test_a_channel_is_a_whole_number(tmp_path, channel) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "1\n"})
    with pytest.raises(InputError, match="channel must be a"):
        HwmonPowerMeter(f"{folder}?channel={channel}")


def test_it_is_read_no_faster_than_the_sensor_converts(tmp_path) -> None:
    files = {"name": "ina226\n", "power1_input": "1\n", "update_interval": "20\n"}
    folder = sensor(tmp_path, files)
    with HwmonPowerMeter(str(folder)) as meter:
        assert meter.start(50.0) == 50.0
        for rate in (51.0, 0.0, float("nan")):
            with pytest.raises(InstrumentError, match=r"at 0\.1 to 50 Hz, got"):
                meter.start(rate)


def test_samples_come_at_the_rate_asked_for_by_the_computers_clock(tmp_path) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "500000\n"})
    now = [0.0]
    with HwmonPowerMeter(str(folder), lambda: now[0]) as meter:
        meter.start(10.0)
        times = []
        for step in range(101):  # looked at 100 times a second
            now[0] = step / 100
            times += [sample.device_time for sample in meter.samples()]
        assert times == pytest.approx(np.arange(11) / 10)
        now[0] = 5.0  # nobody looked for 4 s: none is made up, and they do not come in a rush
        assert [sample.sequence for sample in meter.samples()] == [11]
        assert meter.samples() == []
        assert meter.stop() == []
        assert meter.ping() is None


def test_the_emulated_sensor_tells_the_panels_power_at_the_time_of_reading(simulation) -> None:
    threads = set(threading.enumerate())
    with HwmonEmulator(simulation) as emulator, HwmonPowerMeter(emulator.url, simulation.clock) as meter:
        for factor in (1.0, 0.25):
            simulation.panel.set_backlight(factor)
            simulation.wait(1.0)
            average = average_power(meter, 1.0, 50.0, simulation.clock, simulation.wait)
            # 51 samples of 2 mW: 0.28 mW for their mean, five times that is allowed
            assert average.power == pytest.approx(0.2945 + 0.3716 * factor, abs=0.0014)
    assert set(threading.enumerate()) == threads
    assert not emulator.folder.exists()


def test_the_emulated_sensor_has_an_end(simulation) -> None:
    with HwmonEmulator(simulation, PowerMeterPhysics(highest_power=0.5)) as emulator:
        assert FULL > 0.5
        with pytest.raises(InstrumentError) as told:
            HwmonPowerMeter(emulator.url, simulation.clock)
        assert told.value.fault is Fault.OVER_RANGE


def test_after_closing_it_says_so(tmp_path) -> None:
    folder = sensor(tmp_path, {"name": "ina226\n", "power1_input": "1\n"})
    with HwmonPowerMeter(str(folder)) as meter, pytest.raises(InstrumentError, match="start it first"):
        meter.samples()
    meter.close()
    for use in (meter.samples, meter.ping, lambda: meter.start(10.0)):
        with pytest.raises(InstrumentError, match="closed"):
            use()

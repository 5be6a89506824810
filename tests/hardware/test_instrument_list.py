"""What `measure list` shows of a computer: ports with the instruments of their USB ids, what is missing."""

import importlib.util
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from evenlight.hardware.measure_command import known_instruments, list_lines, missing_lines


@dataclass
class Port:
    """A serial port, as pyserial lists one."""

    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


def shown(folder: Path, *ports: Port) -> list[str]:
    return list_lines(ports, folder)


def section(lines: list[str], title: str) -> list[str]:
    begin = lines.index(title) + 1
    return [line.strip() for line in lines[begin : lines.index("", begin)]]


def test_a_port_is_shown_with_the_instrument_of_its_usb_id(tmp_path: Path) -> None:
    """2145:4097 in decimal is the ColorCAL II: 0861:1001."""
    colorcal = Port("/dev/ttyACM0", "ColorCAL II", 2145, 4097, "3100042")
    (line,) = section(shown(tmp_path, colorcal), "Serial ports here")
    assert "USB 0861:1001" in line
    assert "serial number 3100042" in line
    assert line.endswith("CRS ColorCAL II: colorcal:/dev/ttyACM0")


def test_a_serial_converter_does_not_tell_what_hangs_on_it(tmp_path: Path) -> None:
    ftdi, bare = Port("/dev/ttyUSB0", "FT232R USB UART", 0x0403, 0x6001), Port("/dev/ttyS0")
    lines = section(shown(tmp_path, ftdi, bare), "Serial ports here")
    assert lines[0].endswith("a serial converter: its instrument does not show")
    assert lines[1] == "/dev/ttyS0"
    assert known_instruments(None, None) == {}


def test_what_linux_has_is_shown_as_a_rig_names_it(tmp_path: Path) -> None:
    files = {
        "class/backlight/intel_backlight/max_brightness": "1200\n",
        "class/backlight/intel_backlight/scale": "linear\n",
        "class/backlight/amdgpu_bl0/max_brightness": "255\n",
        "class/backlight/amdgpu_bl0/scale": "non-linear\n",
        "class/i2c-dev/i2c-5/name": "AMDGPU DM aux hw bus 1\n",
        "class/hwmon/hwmon3/name": "ina226\n",
        "class/hwmon/hwmon3/power1_input": "660000\n",
        "class/hwmon/hwmon4/name": "ina219\n",
        "class/hwmon/hwmon4/curr1_input": "130\n",
        "class/hwmon/hwmon4/in1_input": "5000\n",
        "class/hwmon/hwmon0/name": "coretemp\n",
        "class/hwmon/hwmon0/temp1_input": "45000\n",
        "bus/iio/devices/iio:device0/name": "ina226\n",
        "bus/iio/devices/iio:device0/in_power2_raw": "12\n",
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    lines = shown(tmp_path)
    assert section(lines, "Backlights here") == [
        "sysfs:amdgpu_bl0  255 steps, not linear in light: needs a measured `backlight_curve`",
        "sysfs:intel_backlight  1200 steps, linear in light",
    ]
    assert section(lines, "I2C buses here, for ddc") == ["ddc:5  AMDGPU DM aux hw bus 1"]
    assert section(lines, "Power sensors here, for hwmon") == [
        f"hwmon:{tmp_path}/class/hwmon/hwmon3  ina226: power1_input",
        f"hwmon:{tmp_path}/class/hwmon/hwmon4  ina219: current and voltage",
        f"hwmon:{tmp_path}/bus/iio/devices/iio:device0  ina226, iio",
    ]


def test_on_a_computer_that_has_nothing_each_list_says_so(tmp_path: Path) -> None:
    lines = shown(tmp_path / "nowhere")
    for title in ("Serial ports here", "Backlights here", "Power sensors here, for hwmon"):
        assert section(lines, title) == ["none"]


def test_what_is_not_installed_is_told_with_what_needs_it_and_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    told = list(missing_lines())
    assert "ppk2_api, for the power meter ppk2: pip install '.[instruments]' in the checkout" in told
    assert "spotread, for the luminance meter spotread: apt install argyll" in told
    assert "pylsl, for the trigger output lsl: pip install '.[lsl]' in the checkout" in told
    assert "adb, for the power meter adb: apt install adb" in told
    assert len(told) == 7
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert list(missing_lines()) == []

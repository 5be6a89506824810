"""A headset's battery over adb: what adb and a device say when something is wrong, and damaged lines."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evenlight.hardware.drivers.polled_power import AdbPowerMeter
from evenlight.hardware.protocols import Fault, InstrumentError

# 3.9 V and 0.5 A: 1.95 W
LINE = "Discharging,-500000,3900000"
MakeAdb = Callable[..., str]


@pytest.fixture
def make_adb(tmp_path) -> MakeAdb:
    """A program that prints what a file says, or does something else; how to open it."""
    numbers = itertools.count()

    def made(line: str = f"{LINE}|{LINE}", does: str = "", serial: str = "") -> str:
        folder = tmp_path / f"adb{next(numbers)}"
        folder.mkdir()
        (folder / "line").write_text(f"{line}\nQuest 3\n")
        program = folder / "adb"
        program.write_text(f'#!/bin/sh\necho "$@" >> {folder}/asked\n{does or f"cat {folder}/line"}\n')
        program.chmod(0o700)
        return f"{serial}@{program}"

    return made


def folder_of(address: str) -> Path:
    return Path(address.partition("@")[2]).parent


def says(address: str, line: str) -> None:
    """Change what the device prints."""
    (folder_of(address) / "line").write_text(f"{line}|{line}\nQuest 3\n")


def power(meter: AdbPowerMeter) -> float:
    meter.start(20.0)
    (sample,) = meter.samples()
    return sample.power


@pytest.mark.parametrize(
    "words",
    [
        "adb: no devices/emulators found",
        "adb: device 'XYZ' not found",
        "error: more than one device/emulator",
        "error: device unauthorized.",
        "error: device offline",
        "error: insufficient permissions for device",
    ],
)
def test_a_device_that_adb_cannot_use_is_told_in_adbs_own_words(make_adb, words) -> None:
    address = make_adb(does=f'printf "%s\\nmore of it\\n" "{words}" >&2; exit 1', serial="XYZ")
    with pytest.raises(InstrumentError) as told:
        AdbPowerMeter(address)
    assert told.value.fault is Fault.NOT_FOUND
    assert f"adb:XYZ: adb says {words!r}; does `adb devices` list it" in str(told.value)
    assert "\n" not in str(told.value)


def test_the_device_that_is_named_is_asked(make_adb) -> None:
    for serial, begin in (("192.168.1.20:5555", "-s 192.168.1.20:5555 shell"), ("", "shell")):
        with AdbPowerMeter(address := make_adb(serial=serial)) as meter:
            assert "Quest 3" in meter.apparatus()["power_meter"]
        assert (folder_of(address) / "asked").read_text().startswith(begin)


def test_without_adb_it_says_how_to_get_it() -> None:
    with pytest.raises(
        InstrumentError, match=r"^adb: no program '/nowhere/adb'; install it with: apt install adb"
    ):
        AdbPowerMeter("@/nowhere/adb")


@pytest.mark.parametrize("status", ["Charging", "Full", "Not charging"])
def test_a_device_that_charges_is_refused_with_the_way_over_the_network(make_adb, status) -> None:
    line = LINE.replace("Discharging", status)
    with pytest.raises(InstrumentError, match=r"adb tcpip 5555.*adb connect") as told:
        AdbPowerMeter(make_adb(f"{line}|{line}"))
    assert told.value.fault is Fault.REFUSED


def test_a_battery_that_the_maker_keeps_from_adb_is_told(make_adb) -> None:
    with pytest.raises(InstrumentError, match="may not read current_now"):
        AdbPowerMeter(make_adb(",,|,,"))


def test_samples_carry_the_computers_time(make_adb) -> None:
    address, now = make_adb(), itertools.count(10.0)
    with AdbPowerMeter(address, lambda: next(now)) as meter:
        meter.start(1.0)  # at 10
        (first,) = meter.samples()  # asked at 11, and answered at 12
        says(address, LINE.replace("-500000", "400000"))
        (second,) = meter.samples()
        assert meter.ping() is None
    assert [(one.sequence, one.device_time) for one in (first, second)] == [(0, 11.5), (1, 13.5)]
    np.testing.assert_allclose([first.power, second.power], [1.95, 1.56])


def test_a_current_that_fits_neither_unit_is_refused_in_words(make_adb) -> None:
    """8 mA in microampere; as milliampere it would be 31 W."""
    line = "Discharging,-8000,3900000"
    with pytest.raises(InstrumentError, match=r"sent 31\.2 W; what it measures is 0\.02 to 25 W"):
        AdbPowerMeter(make_adb(f"{line}|{line}"))


def test_milliamperes_are_known_by_their_size_and_said(make_adb) -> None:
    """321 µA would be 1 mW: a phone that shows a film takes a thousand times as much (as Samsung's do)."""
    line = "Discharging,-321,4063"
    with AdbPowerMeter(address := make_adb(f"{line}|{line}")) as meter:
        assert "current in milliampere, voltage in millivolt" in meter.apparatus()["power_meter_units"]
        says(address, "Discharging,-321000,4063")
        with pytest.raises(InstrumentError, match=r"sent 1304\.22 W"):
            power(meter)


@pytest.mark.parametrize(
    ("does", "words", "fault"),
    [
        ("echo 'error: device offline' >&2; exit 1", "says 'error: device offline'", Fault.DISCONNECTED),
        ("exit 1", "says 'nothing'", Fault.DISCONNECTED),
        ("echo 'Charging,900000,3900000|Charging,900000,3900000'", "'Charging'", Fault.REFUSED),
        ("echo 'Discharging,500000,39|Discharging,500000,39'", "2 to 100 V", Fault.IMPLAUSIBLE),
        ("exec sleep 20", r"no answer within 0\.5 s", Fault.NO_REPLY),
    ],
)
def test_what_goes_wrong_while_it_samples_is_an_error(make_adb, does, words, fault) -> None:
    with AdbPowerMeter(address := make_adb()) as meter:
        if fault is Fault.NO_REPLY:
            meter._timeout = 0.5
        (folder_of(address) / "adb").write_text(f"#!/bin/sh\n{does}\n")
        with pytest.raises(InstrumentError, match=words) as told:
            power(meter)
    assert told.value.fault is fault


def test_no_made_up_number_in_damaged_lines(make_adb) -> None:
    """Bytes lost, doubled, changed, a line cut off: a reading is the true one, or an error."""
    rng, whole = np.random.default_rng(21), f"{LINE}|{LINE}\nQuest 3\n".encode()
    found, n_errors = [], 0
    with AdbPowerMeter(address := make_adb()) as meter:
        for _ in range(100):
            line = bytearray(whole)
            for _ in range(int(rng.integers(1, 3))):
                place = int(rng.integers(len(line)))
                match int(rng.integers(4)):
                    case 0:
                        del line[place]
                    case 1:
                        line.insert(place, line[place])
                    case 2:
                        line[place] ^= 1 << int(rng.integers(8))
                    case _:
                        del line[place + 1 :]
            (folder_of(address) / "line").write_bytes(bytes(line))
            try:
                found.append(power(meter))
            except InstrumentError:
                n_errors += 1
    assert found == pytest.approx([1.95] * len(found))  # where only the model's name is damaged
    assert n_errors > 50

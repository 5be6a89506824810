"""A headset's battery over adb: what adb and a device say when something is wrong, and damaged lines."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

import numpy as np
import pytest

from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.adb_power import AdbPowerMeter
from evenlight.hardware.protocols import Fault, InstrumentError

# 3.9 V and 0.5 A: 1.95 W
LINE = "0,4711.25,-500000,3900000,Discharging"
HEADER = "List of devices attached"
QUEST = f"{HEADER}\n1WMHH8\tdevice\n\n"
MakeAdb = Callable[..., str]


@pytest.fixture
def make_adb(tmp_path) -> MakeAdb:
    """A program that answers as written down: to `devices`, to one question, and to the loop."""
    numbers = itertools.count()

    def made(devices: str = QUEST, once: str = "", loop: str = "sleep 10", serial: str = "") -> str:
        folder = tmp_path / f"adb{next(numbers)}"
        folder.mkdir()
        (folder / "devices").write_text(devices)
        (folder / "once").write_text(once or f"{twice(LINE)}\nQuest 3\n")
        program = folder / "adb"
        program.write_text(
            f'#!/bin/sh\necho "$@" >> {folder}/asked\ncase "$*" in\ndevices) cat {folder}/devices;;\n'
            f'*while*) {loop};;\n*"\\$u|\\$u"*) echo "4712.50|4712.50";;\n*) cat {folder}/once;;\nesac\n'
        )
        program.chmod(0o700)
        return f"{serial}@{program}"

    return made


def samples_of(meter: AdbPowerMeter, wanted: int = 3) -> list[PowerSample]:
    meter.start(5.0)
    end, found = time.monotonic() + 60, []
    while len(found) < wanted and time.monotonic() < end:
        found += meter.samples()
        time.sleep(0.01)
    return [*found, *meter.stop()]


def printed(*lines: str) -> str:
    return f"printf '%s\\n' {' '.join(repr(line) for line in lines)}; sleep 10"


def twice(line: str) -> str:
    return f"{len(line)}|{line}|{line}"


@pytest.mark.parametrize(
    ("devices", "serial", "words"),
    [
        (f"{HEADER}\n\n", "", "no such device; `adb devices` lists none"),
        (QUEST, "XYZ", r"adb:XYZ: no such device; `adb devices` lists adb:1WMHH8 \(device\)"),
        (f"{QUEST.strip()}\nR58M\tdevice\n", "", "several devices; name one.*1WMHH8.*adb:R58M"),
        (
            f"{HEADER}\n1WMHH8\tunauthorized\n",
            "",
            "adb:1WMHH8: adb calls it 'unauthorized'.*allow USB debugging",
        ),
        (
            f"{HEADER}\n192.168.1.20:5555\toffline\n",
            "192.168.1.20:5555",
            "'offline'; it does not answer: wake",
        ),
        (f"{HEADER}\n1WMHH8\tno permissions (verify udev rules); see [x]\n", "", "install the udev rules"),
        ("* daemon not running; starting now\n", "", "no such device"),
    ],
)
def test_a_device_that_adb_cannot_use_is_told_in_one_line(make_adb, devices, serial, words) -> None:
    with pytest.raises(InstrumentError, match=words) as told:
        AdbPowerMeter(make_adb(devices, serial=serial))
    assert told.value.fault is Fault.NOT_FOUND
    assert "\n" not in str(told.value)


def test_a_list_that_begins_with_the_servers_words_is_read(make_adb) -> None:
    words = "* daemon not running; starting now at tcp:5037\n* daemon started successfully\n"
    with AdbPowerMeter(make_adb(words + QUEST)) as meter:
        assert "Quest 3" in meter.apparatus()["power_meter"]


def test_without_adb_it_says_how_to_get_it() -> None:
    with pytest.raises(InstrumentError, match="no program '/nowhere/adb'; install it with: apt install adb"):
        AdbPowerMeter("@/nowhere/adb")


@pytest.mark.parametrize("status", ["Charging", "Full", "Not charging"])
def test_a_device_that_charges_is_refused_with_the_way_over_the_network(make_adb, status) -> None:
    with pytest.raises(InstrumentError, match=r"adb tcpip 5555.*adb connect") as told:
        AdbPowerMeter(make_adb(once=twice(LINE.replace("Discharging", status))))
    assert told.value.fault is Fault.REFUSED


def test_a_battery_that_the_maker_keeps_from_adb_is_told(make_adb) -> None:
    with pytest.raises(InstrumentError, match="may not read current_now"):
        AdbPowerMeter(make_adb(once=twice("0,4711.25,,,")))


def test_samples_carry_the_devices_time_and_count_and_the_computers(make_adb) -> None:
    lines = [twice(f"{n},{4711.25 + n},{500000 + 1000 * n},3900000,Discharging") for n in range(3)]
    before = time.monotonic()
    with AdbPowerMeter(make_adb(loop=printed(*lines))) as meter:
        found = samples_of(meter)
        ping = meter.ping()
    assert [(one.sequence, one.device_time) for one in found] == [(0, 4711.25), (1, 4712.25), (2, 4713.25)]
    np.testing.assert_allclose([one.power for one in found], [1.95, 1.9539, 1.9578])
    assert all(before < one.received < time.monotonic() for one in found)
    assert ping is not None
    assert ping.device_time == 4712.5
    assert before < ping.sent < ping.received


def test_a_current_that_fits_neither_unit_is_refused_in_words(make_adb) -> None:
    """8 mA in microampere; as milliampere it would be 31 W."""
    with pytest.raises(InstrumentError, match="its unit cannot be told"):
        AdbPowerMeter(make_adb(once=twice("0,4711.25,-8000,3900000,Discharging")))


def test_milliamperes_are_known_by_their_size_and_said(make_adb) -> None:
    """321 µA would be 1 mW: a phone that shows a film takes a thousand times as much (as Samsung's do)."""
    once = twice("0,4711.25,-321,4063,Discharging")
    loop = printed(once, twice("1,4712.25,-321000,4063,Discharging"))
    with AdbPowerMeter(make_adb(once=once, loop=loop)) as meter:
        assert "current in milliampere, voltage in millivolt" in meter.apparatus()["power_meter_units"]
        with pytest.raises(InstrumentError, match=r"sent 1304\.22 W"):
            samples_of(meter)


@pytest.mark.parametrize(
    ("loop", "words", "fault"),
    [
        ("echo 'error: device offline'; exit 1", r"broke \(error: device offline\)", Fault.DISCONNECTED),
        ("exit 1", "connection broke", Fault.DISCONNECTED),
        (printed(twice(LINE), twice("1,4712.25,900000,3900000,Charging")), "'Charging'", Fault.REFUSED),
        (printed(twice("1,4712.25,500000,39,Discharging")), "2 to 100 V", Fault.IMPLAUSIBLE),
    ],
)
def test_what_goes_wrong_while_it_samples_is_an_error(make_adb, loop, words, fault) -> None:
    with AdbPowerMeter(make_adb(loop=loop)) as meter, pytest.raises(InstrumentError, match=words) as told:
        samples_of(meter)
    assert told.value.fault is fault


def test_a_device_that_falls_asleep_is_told(make_adb) -> None:
    now = [0.0]
    with AdbPowerMeter(make_adb(), lambda: now[0]) as meter:
        meter.start(1.0)
        now[0] = 9.0
        assert meter.samples() == []
        now[0] = 11.0
        with pytest.raises(InstrumentError, match="silent for 10 s; did it fall asleep") as told:
            meter.samples()
    assert told.value.fault is Fault.NO_REPLY


def test_an_adb_that_hangs_is_given_up(make_adb, tmp_path) -> None:
    program = tmp_path / "hung"
    program.write_text("#!/bin/sh\nexec sleep 20\n")
    program.chmod(0o700)
    with pytest.raises(InstrumentError, match=r"no answer within 0\.2 s") as told:
        AdbPowerMeter(f"@{program}", timeout=0.2)
    assert told.value.fault is Fault.NO_REPLY


@pytest.mark.slow
def test_no_made_up_number_in_5000_damaged_lines(make_adb, tmp_path) -> None:
    """Bytes lost, doubled, changed, lines torn or merged: a sample is one that was sent, under its number."""
    rng = np.random.default_rng(21)
    sent, damaged = {}, []
    for n in range(5000):
        current = int(rng.integers(200_000, 900_000))
        sent[n] = (100.0 + n, current * 3.9 * 1e-6)
        line = bytearray(twice(f"{n},{100 + n}.00,-{current},3900000,Discharging").encode() + b"\n")
        for _ in range(int(rng.integers(0, 3))):
            place = int(rng.integers(max(len(line), 1)))
            if place >= len(line):
                continue
            match int(rng.integers(5)):
                case 0:
                    del line[place]
                case 1:
                    line.insert(place, line[place])
                case 2:
                    line[place] ^= 1 << int(rng.integers(8))
                case 3:
                    del line[place:]
                case _:
                    line += line[place:]
        damaged.append(bytes(line))
    for part in range(50):
        (tmp_path / f"part{part:02}").write_bytes(b"".join(damaged[100 * part : 100 * part + 100]))
    loop = f"for part in {tmp_path}/part*; do cat $part; sleep 0.01; done; echo; echo end"
    found, n_errors = [], 0
    with AdbPowerMeter(make_adb(loop=loop)) as meter:
        meter.start(20.0)
        while True:
            try:
                found += meter.samples()
            except InstrumentError as error:
                if error.fault is Fault.DISCONNECTED:
                    break
                n_errors += 1
    assert max(one.sequence for one in found) > 4990  # all was read
    assert n_errors < 5  # a damaged line counts as lost, but for the same damage to both of its halves
    assert 1000 < len(found) < 4500
    for one in found:
        assert (one.device_time, pytest.approx(one.power)) == sent[one.sequence]

"""A backlight belongs to the program that uses it: a second is told who has it, nothing is left over."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from emulators.ddc_monitor import EmulatedMonitor, emulated_control
from emulators.link import EmulatedLink

import evenlight
from evenlight.hardware.drivers.ddc_backlight import DdcBacklight
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
from evenlight.hardware.protocols import Fault, InstrumentError

ROOT = Path(evenlight.__file__).parents[1]
HOLD = """
import sys
from pathlib import Path
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
with SysfsBacklight("panel", Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    folder = tmp_path / "panel"
    folder.mkdir()
    for name in ("max_brightness", "brightness"):
        (folder / name).write_text("100\n")
    return folder


@pytest.fixture
def holder(panel: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that uses the panel."""
    command = [sys.executable, "-c", HOLD, str(panel.parent)]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/locks").exists(), reason="the list of locks is Linux's")
def test_another_process_is_named_and_the_lock_ends_when_it_is_killed(panel, holder) -> None:
    with pytest.raises(InstrumentError, match=rf"panel: is in use by process {holder.pid} \(python") as told:
        SysfsBacklight("panel", panel.parent)
    assert told.value.fault is Fault.BUSY
    assert "\n" not in str(told.value)
    holder.kill()
    holder.wait()
    with SysfsBacklight("panel", panel.parent) as backlight:
        assert backlight.set_factor(0.5) == 0.5
    assert sorted(file.name for file in panel.iterdir()) == ["brightness", "max_brightness"]  # nothing left


def test_a_second_opening_in_this_process_is_refused_until_the_first_is_closed(panel) -> None:
    with (
        SysfsBacklight("panel", panel.parent),
        pytest.raises(InstrumentError, match="panel: is in use by this program already; end that first"),
    ):
        SysfsBacklight("panel", panel.parent)
    SysfsBacklight("panel", panel.parent).close()


def test_a_backlight_that_could_not_be_opened_is_not_locked(panel) -> None:
    (panel / "brightness").write_text("broken\n")
    with pytest.raises(InstrumentError, match="expected a whole number, got 'broken'"):
        SysfsBacklight("panel", panel.parent)
    (panel / "brightness").write_text("100\n")
    SysfsBacklight("panel", panel.parent).close()


@pytest.mark.slow
def test_a_monitor_is_locked_by_the_file_of_its_bus(tmp_path) -> None:
    bus = tmp_path / "i2c-5"
    bus.touch()
    with (
        EmulatedLink(EmulatedMonitor()) as first,
        EmulatedLink(EmulatedMonitor()) as second,
        DdcBacklight(5, panel=emulated_control(first.url), bus=bus),
        pytest.raises(InstrumentError, match="ddc:5: is in use by this program") as told,
    ):
        DdcBacklight(5, panel=emulated_control(second.url), bus=bus)
    assert told.value.fault is Fault.BUSY
    with EmulatedLink(EmulatedMonitor()) as link:
        DdcBacklight(5, panel=emulated_control(link.url), bus=bus).close()


@pytest.mark.parametrize("reported", ["101", "-1"])
def test_a_brightness_beyond_its_highest_is_no_factor(panel, reported) -> None:
    with SysfsBacklight("panel", panel.parent) as backlight:
        (panel / "brightness").write_text(f"{reported}\n")
        with pytest.raises(
            InstrumentError, match=rf"panel: reports step {reported}; it has 0 to 100"
        ) as told:
            backlight.read_factor()
        assert told.value.fault is Fault.IMPLAUSIBLE
    (panel / "brightness").write_text(f"{reported}\n")
    with pytest.raises(InstrumentError, match=f"reports step {reported}"):
        SysfsBacklight("panel", panel.parent)


@pytest.mark.parametrize("text", ["1_0", "٣", "1e2", "", "10 20", "nan"])  # an Arabic 3
def test_a_file_that_holds_no_whole_number_is_no_brightness(panel, text) -> None:
    with SysfsBacklight("panel", panel.parent) as backlight:
        (panel / "brightness").write_text(f"{text}\n", encoding="utf-8")
        with pytest.raises(InstrumentError, match="expected a whole number"):
            backlight.read_factor()

"""What every driver promises, of all of ours, and what ours promise where a line fails (`emulators.ours`)."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import line_faults as faults
import pytest
from emulators import ddc_monitor
from emulators.ours import OURS, attach
from line_faults import Breakable, FaultySubject, require_told_not_restored, warm_white_panel

from evenlight.data_schema.errors import InputError
from evenlight.hardware import rig as rigs
from evenlight.hardware.backlight_curve import BacklightCurve, LinearizedBacklight
from evenlight.hardware.backlights import LoggedBacklight
from evenlight.hardware.conformance import meters
from evenlight.hardware.conformance.conform import PROMISES, nothing_left_open
from evenlight.hardware.conformance.subject import Subject
from evenlight.hardware.driver import SIMULATED, NamedDriver
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.simulated.panel import SimulatedBacklight

LUMINANCE, POWER, BACKLIGHT = InstrumentKind
PATIENT = 30.0  # [s] where no reply is made late or left out: threads of a busy machine may be held up


SUBJECTS = [
    FaultySubject(kind, NamedDriver(name, driver, "", emulated=True), PATIENT)
    if (kind, name) in OURS
    else Subject(kind, NamedDriver(name, driver, "", emulated=False))
    for kind in InstrumentKind
    for name, driver in kind.ours.items()
    if driver.place
]
# A person and a folder of Linux: tests hand them in, and the simulated device is their simulation.
WITHOUT_EMULATOR = ("manual", "sysfs", SIMULATED)
AT_ONCE = 24  # devices
# One after the other: a PPK2 sends 100 000 samples a second, which the others' threads would make late.
ALONE = (("ppk2",),)
LIBRARIES = ("serial", "ppk2_api", "monitorcontrol", "pyvisa", "pyvisa_py", "psychopy")  # of devices
# About the clock: tests/hardware/test_conformance.py tries them on one that it sets.
IN_TIME = (meters.power_keeps_time, meters.power_follows)


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """What only ends a hang, or tells it, is generous: two dozen threads share a busy machine."""
    monkeypatch.setattr(faults, "LONGEST_LAG", PATIENT)
    monkeypatch.setattr(ddc_monitor, "PATIENCE", faults.TIMEOUT)


def called(subject: Subject) -> str:
    return f"{subject.kind.name.lower()} {subject.named.name}"


Check = Callable[[Subject], None]


def kept(promise: Callable[[Any], None]) -> Check:
    """A promise, tried on a driver that is opened for it."""

    def check(subject: Subject) -> None:
        with subject.bench() as bench, bench.checked:
            promise(bench)

    return check


def faulty(kind: InstrumentKind | None = None, *, line: bool = True) -> list[FaultySubject]:
    """The drivers that have emulated instruments: of a kind, at the end of a line."""
    return [
        one
        for one in SUBJECTS
        if isinstance(one, FaultySubject) and kind in (None, one.kind) and (one.has_line or not line)
    ]


def keep(pairs: list[tuple[Check, Any]], at_once: int = AT_ONCE) -> None:
    """Try promises at once, for devices wait more than they work; what is left open is counted at the end."""
    assert pairs

    def tried_once(pair: tuple[Check, Any]) -> str:
        check, subject = pair
        try:
            check(subject)
        except Exception as error:
            return f"{called(subject)}: {error!r}"
        return ""

    queues = [[pair for pair in pairs if pair[1].named.name in names] for names in ALONE]
    with nothing_left_open(), ThreadPoolExecutor(at_once) as pool:
        said = [*pool.map(tried_once, [pair for pair in pairs if not any(pair in queue for queue in queues)])]
        for queue in pool.map(lambda queue: [tried_once(pair) for pair in queue], queues):
            said += queue
    assert list(filter(None, said)) == []


@pytest.mark.real_time  # emulated devices answer within tenths of a second, by the clock
@pytest.mark.parametrize(
    "promise",
    dict.fromkeys(one for kind in PROMISES.values() for one in kind if one not in IN_TIME),
    ids=lambda p: p.__name__,
)
def test_every_driver_keeps_its_promises(promise: Callable[[Any], None]) -> None:
    subjects = [
        one for one in SUBJECTS if promise in PROMISES[one.kind] and one.named.name not in ("manual", "sysfs")
    ]
    keep([(kept(promise), one) for one in subjects])


def test_every_driver_tells_of_a_line_that_is_dead() -> None:
    keep([(faults.dead_line_is_told, one) for one in faulty()])


@pytest.mark.real_time
def test_every_driver_tells_of_what_is_not_there_or_cannot_be_put_back() -> None:
    keep([(faults.absent_is_named, one) for one in faulty(line=False)], 1)  # no port comes back as another's
    keep([(faults.not_restored_is_told, one) for one in faulty(BACKLIGHT)], 1)  # each has 0.3 s to answer


@pytest.mark.real_time  # tests/hardware spoils replies on lines whose time passes only while a driver waits
def test_no_driver_makes_up_a_reading_where_a_reply_goes_wrong() -> None:
    keep([(faults.nothing_is_made_up(fault), one) for fault in faults.WORDS for one in faulty()])


def test_every_driver_is_imported_on_a_computer_without_device_libraries() -> None:
    """In a process of its own, where importing one of them fails."""
    modules = dict.fromkeys(one.named.driver.load().__module__ for one in SUBJECTS)
    lines = [f"import sys; sys.path[:] = {sys.path!r}; sys.modules.update(dict.fromkeys({LIBRARIES}))"]
    lines += [f"import {module}" for module in modules]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("subject", SUBJECTS, ids=called)
def test_every_driver_has_something_to_be_tried_on(subject: Subject) -> None:
    """An emulated instrument, or it is the simulation in this process."""
    assert isinstance(subject, FaultySubject) == (subject.named.name not in WITHOUT_EMULATOR)


@pytest.mark.parametrize(
    "device",
    [
        lambda seen: rigs.open_luminance_meter("simulated:ls100", time.monotonic, seen),
        lambda seen: rigs.open_power_meter("simulated:hwmon", time.monotonic, seen),
    ],
    ids=["luminance", "power"],
)
def test_an_emulated_instrument_says_that_it_is_none(
    device: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    attach(monkeypatch)
    with device(warm_white_panel()) as opened:
        assert "SIMULATED" in " ".join(opened.apparatus().values())


def sysfs(folder: Path) -> Breakable:
    """A panel of Linux whose folder is taken away."""

    @contextmanager
    def breakable() -> Iterator[tuple[Any, Callable[[], object]]]:
        panel = folder / "panel"
        panel.mkdir()
        for file in ("max_brightness", "brightness"):
            (panel / file).write_text("100")
        yield SysfsBacklight("panel", folder), lambda: shutil.rmtree(panel)

    return breakable


def simulated(_: Path) -> Breakable:
    """A simulated panel that does not follow any more."""

    @contextmanager
    def breakable() -> Iterator[tuple[Any, Callable[[], object]]]:
        gone: list[bool] = []

        def follow(_: float) -> None:
            if gone:
                raise InstrumentError("the panel is gone", Fault.DISCONNECTED)

        yield SimulatedBacklight(lambda: 0.0, follow=follow), lambda: gone.append(True)

    return breakable


def wrapped(folder: Path) -> Breakable:
    """One that is set by luminance, and whose settings are kept."""

    @contextmanager
    def breakable() -> Iterator[tuple[Any, Callable[[], object]]]:
        with simulated(folder)() as (device, break_it):
            curve = BacklightCurve((0.1, 0.5, 1.0), (2.0, 50.0, 200.0))
            yield LoggedBacklight(LinearizedBacklight(device, curve), time.monotonic), break_it

    return breakable


@pytest.mark.parametrize("made", [sysfs, simulated, wrapped])
def test_a_backlight_that_cannot_be_left_as_it_was_found_is_told_of_and_hides_no_other_exception(
    made: Callable[[Path], Breakable], tmp_path: Path
) -> None:
    require_told_not_restored(made(tmp_path))


NOWHERE = {
    "ddc": "250",
    "ppk2": "/dev/no_such_port?voltage=5.0",
    "scpi": "127.0.0.1:1",
    "visa": "TCPIP::127.0.0.1::1::SOCKET",
    "spotread": "1",
}


@pytest.mark.parametrize("subject", [one for one in SUBJECTS if isinstance(one, FaultySubject)], ids=called)
def test_an_instrument_that_is_not_there_is_named_with_where_it_was_sought(
    subject: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", os.devnull)  # nor a program that drives one
    address = NOWHERE.get(subject.named.name, "/dev/no_such_port")
    name = f"{subject.named.name}:{address}"
    rig = replace(load_rig("simulated")[0], backlight=name)
    with pytest.raises((InstrumentError, InputError)) as refused, nothing_left_open():
        {
            InstrumentKind.LUMINANCE: lambda: rigs.open_luminance_meter(name, time.monotonic),
            InstrumentKind.POWER: lambda: rigs.open_power_meter(name, time.monotonic),
            InstrumentKind.BACKLIGHT: lambda: rigs.open_backlight(rig, time.monotonic),
        }[subject.kind]()
    assert isinstance(refused.value, InstrumentError)
    assert refused.value.fault in (Fault.NOT_FOUND, Fault.NO_REPLY)
    words = str(refused.value)
    assert address.partition("?")[0] in words or subject.named.name in words
    assert "\n" not in words
    assert len(words) > 40  # what it is, where, and what to do

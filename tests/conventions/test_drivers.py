"""What every driver promises, over all that the rig can open: a new one is tested without a word here."""

import inspect
import math
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.hardware import rig as rigs
from evenlight.hardware.backlight_curve import BacklightCurve, LinearizedBacklight
from evenlight.hardware.backlights import LoggedBacklight
from evenlight.hardware.driver_table import (
    BACKLIGHTS,
    LUMINANCE_METERS,
    POWER_METERS,
    SIMULATED,
    Driver,
    LinkKind,
)
from evenlight.hardware.emulators.link import EmulatedLink, FaultPlan, LinkFault
from evenlight.hardware.protocols import (
    TRANSIENT,
    Backlight,
    Fault,
    InstrumentError,
    LuminanceMeter,
    PowerMeter,
    Reading,
)
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

pytestmark = pytest.mark.slow

ROOT = Path(evenlight.__file__).parents[1]
LIBRARIES = ("serial", "ppk2_api", "monitorcontrol", "pyvisa", "pyvisa_py", "psychopy", "numpy", "scipy")
PROTOCOLS: dict[str, tuple[type, dict[str, Driver]]] = {
    "luminance": (LuminanceMeter, LUMINANCE_METERS),
    "power": (PowerMeter, POWER_METERS),
    "backlight": (Backlight, BACKLIGHTS),
}
DRIVERS = [
    (kind, name) for kind, (_, table) in PROTOCOLS.items() for name, driver in table.items() if driver.place
]
# A person and a folder of Linux: tests hand them in, and the simulated device is their simulation.
WITHOUT_EMULATOR = {("luminance", "manual"), ("backlight", "sysfs")}
OPENED = [
    (kind, name if name == SIMULATED else f"{SIMULATED}:{name}")
    for kind, name in DRIVERS
    if (kind, name) not in WITHOUT_EMULATOR
]


def driver_of(kind: str, name: str) -> Driver:
    return PROTOCOLS[kind][1][name]


def simulation() -> Simulation:
    """A warm white panel in real time; its luminance is 200 cd/m^2, and its power 0.2945 + 0.3716 W."""
    panel = SimulatedPanel(PanelPhysics(warm_up_share=0.0), time.monotonic)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(5), time.monotonic, time.sleep)


def opened(kind: str, name: str, seen: Simulation) -> AbstractContextManager[Any]:
    """Open a device as the rig does."""
    if kind == "luminance":
        return rigs.open_luminance_meter(name, time.monotonic, seen)
    if kind == "power":
        return rigs.open_power_meter(name, time.monotonic, seen)
    device = rigs.open_backlight(replace(load_rig("simulated")[0], backlight=name), time.monotonic, seen)
    assert device is not None
    return device


def held() -> tuple[int, int]:
    """How many files and threads there are."""
    return len(list(Path("/proc/self/fd").iterdir())), threading.active_count()


@pytest.fixture
def nothing_left() -> Iterator[None]:
    before = held()
    yield
    end = time.monotonic() + 2
    while held() != before and time.monotonic() < end:  # a thread may be on its last way
        time.sleep(0.01)
    assert held() == before


@pytest.mark.parametrize(("kind", "name"), DRIVERS)
def test_a_driver_has_each_method_of_its_protocol_with_the_same_arguments(kind: str, name: str) -> None:
    protocol, cls = PROTOCOLS[kind][0], driver_of(kind, name).load()
    parts = [part for part in protocol.__mro__ if getattr(part, "_is_protocol", False)]
    methods = {n: f for part in parts for n, f in vars(part).items() if inspect.isfunction(f)}
    methods.pop("__init__", None)
    methods.pop("__subclasshook__", None)
    assert {"__enter__", "__exit__", "close"} < set(methods)
    for method, promised in methods.items():
        if method.startswith("_") and method not in ("__enter__", "__exit__"):
            continue
        own = inspect.signature(getattr(cls, method)).parameters
        if method.startswith("__"):
            assert callable(getattr(cls, method))
            continue
        wanted = inspect.signature(promised).parameters
        assert list(own)[: len(wanted)] == list(wanted), method
        extra = list(own.values())[len(wanted) :]
        assert all(one.default is not inspect.Parameter.empty for one in extra), method


@pytest.mark.parametrize(("kind", "name"), DRIVERS)
def test_a_driver_that_sets_a_zero_says_what_comes_before(kind: str, name: str) -> None:
    cls = driver_of(kind, name).load()
    assert hasattr(cls, "zero") == hasattr(cls, "before_zero")


@pytest.mark.parametrize(("kind", "name"), DRIVERS)
def test_nothing_is_read_by_looking_at_an_attribute(kind: str, name: str) -> None:
    cls = driver_of(kind, name).load()
    properties = [n for n, member in inspect.getmembers(cls) if isinstance(member, property)]
    assert [n for n in properties if not n.startswith("_")] == []


def test_every_driver_is_imported_on_a_computer_without_device_libraries() -> None:
    """In a process of its own, where importing one of them fails."""
    modules = {
        f"evenlight.hardware.{place.partition(':')[0]}"
        for kind, name in DRIVERS
        for place in (driver_of(kind, name).place, driver_of(kind, name).emulator)
        if place
    }
    lines = [f"import sys; sys.modules.update(dict.fromkeys({LIBRARIES}))", *(f"import {m}" for m in modules)]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("kind", "name"), DRIVERS)
def test_every_driver_has_something_to_be_tried_on(kind: str, name: str) -> None:
    """An emulated instrument, or it is the simulation in this process."""
    driver = driver_of(kind, name)
    if (kind, name) in WITHOUT_EMULATOR or name == SIMULATED:
        assert not driver.emulator
        return
    assert callable(driver.load_emulator())


@pytest.mark.parametrize("kind", PROTOCOLS)
def test_measure_list_says_of_every_driver_what_it_drives_and_how_it_is_named(kind: str) -> None:
    for name, driver in PROTOCOLS[kind][1].items():
        if (kind, name) != ("power", SIMULATED):  # not listed
            assert driver.instrument
            assert driver.address.startswith(name)
            assert driver.settings


@pytest.mark.parametrize(("kind", "name"), OPENED)
@pytest.mark.usefixtures("nothing_left")
def test_a_device_works_in_a_context_is_closed_as_often_as_one_likes_and_then_refuses(
    kind: str, name: str
) -> None:
    seen = simulation()
    with opened(kind, name, seen) as device:
        if kind == "luminance":
            reading = device.read_luminance()
            assert isinstance(reading, Reading)
            assert reading.unit == "cd/m^2"
            assert reading.value == pytest.approx(200.0, rel=0.05)  # the worst class of meters
            assert reading.begun <= reading.ended
        elif kind == "power":
            assert device.start(20.0) > 0
            time.sleep(0.3)
            samples = [*device.samples(), *device.stop()]
            assert samples[-1].power == pytest.approx(0.6661, rel=0.05)
        else:
            achieved = device.set_factor(0.5)
            assert achieved == pytest.approx(0.5, abs=device.step() / 2)
            time.sleep(0.05)  # ten times the lag of the panel's light
            assert seen.panel.luminance() == pytest.approx(200.0 * achieved, rel=0.01)
        if kind != "backlight":
            assert "SIMULATED" in " ".join(device.apparatus().values())
    device.close()
    device.close()
    with pytest.raises(InstrumentError) as refused:
        {
            "luminance": lambda: device.read_luminance(),
            "power": lambda: device.start(20.0),
            "backlight": lambda: device.set_factor(0.5),
        }[kind]()
    assert refused.value.fault is Fault.DISCONNECTED


@pytest.mark.parametrize("name", [name for kind, name in OPENED if kind == "backlight"])
def test_no_backlight_takes_a_factor_that_it_has_not(name: str) -> None:
    with opened("backlight", name, simulation()) as device:
        for factor in (0.0, -0.1, device.smallest_factor() / 2, 1.001, 2.0, math.nan, math.inf):
            with pytest.raises(InstrumentError) as refused:
                device.set_factor(factor)
            assert refused.value.fault is Fault.REFUSED


def backlight_that_breaks(name: str, folder: Path, stack: ExitStack) -> tuple[Any, Callable[[], object]]:
    """An open backlight of a driver, and what makes it impossible to put back."""
    if name == "sysfs":
        panel = folder / "panel"
        panel.mkdir()
        for file in ("max_brightness", "brightness"):
            (panel / file).write_text("100")
        return driver_of("backlight", name).load()("panel", folder), lambda: shutil.rmtree(panel)
    if name == SIMULATED:
        gone: list[bool] = []

        def follow(factor: float) -> None:
            if gone:
                raise InstrumentError("the panel is gone", Fault.DISCONNECTED)

        return driver_of("backlight", name).load()(lambda: 0.0, follow=follow), lambda: gone.append(True)
    driver = driver_of("backlight", name)
    terminal = driver.link is LinkKind.TERMINAL
    link = EmulatedLink(driver.load_emulator()(simulation()), pseudo_terminal=terminal)
    stack.enter_context(link)
    return driver.open_at(link.url, time.monotonic, timeout=0.3), link.unplug


@pytest.mark.parametrize("name", [name for kind, name in DRIVERS if kind == "backlight"])
@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.usefixtures("nothing_left")
def test_a_backlight_that_cannot_be_left_as_it_was_found_is_released_and_told_of(
    name: str, wrapped: bool, tmp_path: Path
) -> None:
    with ExitStack() as stack:
        device, break_it = backlight_that_breaks(name, tmp_path, stack)
        if wrapped:
            curve = BacklightCurve((0.1, 0.5, 1.0), (2.0, 50.0, 200.0))
            device = LoggedBacklight(LinearizedBacklight(device, curve), time.monotonic)
        device.set_factor(0.5)
        break_it()
        with pytest.raises(InstrumentError):
            device.close()
        device.close()  # once was enough
        with pytest.raises(InstrumentError) as refused:
            device.set_factor(0.5)
        assert refused.value.fault is Fault.DISCONNECTED


@pytest.mark.parametrize("name", [name for kind, name in DRIVERS if kind == "backlight"])
@pytest.mark.parametrize("how", ["with", "finally", "callback"])
@pytest.mark.usefixtures("nothing_left")
def test_a_backlight_that_cannot_be_left_as_it_was_found_hides_no_other_exception(
    name: str, how: str, tmp_path: Path
) -> None:
    with ExitStack() as links:
        device, break_it = backlight_that_breaks(name, tmp_path, links)

        def used() -> None:
            break_it()
            raise KeyboardInterrupt

        def used_and_closed() -> None:
            with ExitStack() as stack:
                if how == "with":
                    stack.enter_context(device)
                elif how == "callback":
                    stack.callback(device.close)
                try:
                    used()
                finally:
                    if how == "finally":
                        device.close()

        with pytest.raises(KeyboardInterrupt) as interrupted:
            used_and_closed()
        (note,) = interrupted.value.__notes__
        assert "could not be left as it was found" in note


@pytest.mark.parametrize("name", [name for kind, name in OPENED if kind == "power"])
def test_no_power_meter_takes_a_rate_that_it_has_not(name: str) -> None:
    with opened("power", name, simulation()) as device:
        for rate in (0.0, -1.0, 1e9, math.nan, math.inf):
            with pytest.raises(InstrumentError) as refused:
                device.start(rate)
            assert refused.value.fault is Fault.REFUSED


def open_and_use(driver: Driver, url: str, kind: str) -> None:
    """Open a device and ask it on and on: a break is noticed at once, or by a question soon after."""
    with driver.open_at(url, time.monotonic, timeout=0.3) as device:
        if kind == "power":
            device.start(20.0)
        ask = getattr(device, {"luminance": "read_luminance", "power": "samples"}.get(kind, "read_factor"))
        for _ in range(300):
            time.sleep(0.02)
            ask()


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (kind, name)
        for kind, name in DRIVERS
        if driver_of(kind, name).emulator and driver_of(kind, name).link is not LinkKind.OWN
    ],
)
@pytest.mark.parametrize("first", [1, 3])
@pytest.mark.usefixtures("nothing_left")
def test_a_cable_that_is_pulled_while_a_device_is_opened_or_used_is_an_error(
    kind: str, name: str, first: int
) -> None:
    """Whichever reply breaks off, nothing stays open, and no other exception comes out."""
    driver = driver_of(kind, name)
    plan = FaultPlan(LinkFault.DISCONNECT, first=first)
    terminal = driver.link is LinkKind.TERMINAL
    with EmulatedLink(driver.load_emulator()(simulation()), plan, pseudo_terminal=terminal) as link:
        with pytest.raises(InstrumentError) as failed:
            open_and_use(driver, link.url, kind)
        assert failed.value.fault in (Fault.DISCONNECTED, Fault.BUSY, *TRANSIENT, Fault.WRONG_INSTRUMENT)
        assert link.url.rpartition(":")[2] in str(failed.value) or "ddc:0" in str(failed.value)


NOWHERE = {
    "ddc": "250",
    "ppk2": "/dev/no_such_port?voltage=5.0",
    "scpi": "127.0.0.1:1",
    "visa": "TCPIP::127.0.0.1::1::SOCKET",
    "spotread": "1",
}


@pytest.mark.parametrize(
    ("kind", "name"), [(k, n) for k, n in DRIVERS if n != SIMULATED and (k, n) not in WITHOUT_EMULATOR]
)
@pytest.mark.usefixtures("nothing_left")
def test_an_instrument_that_is_not_there_is_named_with_where_it_was_sought(
    kind: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", os.devnull)  # nor a program that drives one
    address = NOWHERE.get(name, "/dev/no_such_port")
    with pytest.raises((InstrumentError, InputError)) as refused:
        opened(kind, f"{name}:{address}", simulation())
    assert isinstance(refused.value, InstrumentError)
    assert refused.value.fault in (Fault.NOT_FOUND, Fault.NO_REPLY)
    words = str(refused.value)
    assert address.partition("?")[0] in words or name in words
    assert "\n" not in words
    assert len(words) > 40  # what it is, where, and what to do

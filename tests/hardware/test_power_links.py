"""Every power meter with a link, over real links on the loopback: breaks, and other users of a port.

Replies that go wrong, of these meters too: tests/conventions/test_drivers.py.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from emulators.link import EmulatedLink, FaultPlan, LinkFault
from emulators.power_board import PowerBoardEmulator
from emulators.power_meters import Ppk2Emulator, ScpiEmulator

from evenlight.hardware.drivers.board_link import PowerBoard
from evenlight.hardware.drivers.nordic_ppk2 import Ppk2PowerMeter
from evenlight.hardware.drivers.power_board import BoardPowerMeter
from evenlight.hardware.drivers.scpi_power import ScpiPowerMeter, VisaPowerMeter
from evenlight.hardware.power_average import PowerAverage, average_power
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError, PowerMeter
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

FULL, DIMMED = 0.6661, 0.2945 + 0.001858 * 200 * 0.25  # [W] of the panel at b = 1 and 0.25
PATIENT = 30.0  # [s] where nothing is to be waited for
TIMEOUT = 0.35  # [s] where it is waited for
RATE = 200.0  # [Hz]


@dataclass(frozen=True)
class Meter:
    """A driver, what it talks to, and where a sampling begins among what that sends."""

    driver: Any
    emulator: Any
    pseudo_terminal: bool
    address: Callable[[str], str]
    first_of_sampling: int  # reply, from 1, that is the first after a measurement was begun


def visa_address(url: str) -> str:
    where = urlsplit(url)
    return f"TCPIP::{where.hostname}::{where.port}::SOCKET"


METERS = {
    # ID?, STOP, CLOCK?, START
    "board": Meter(BoardPowerMeter, PowerBoardEmulator, True, str, 5),
    # calibration, first words
    "ppk2": Meter(Ppk2PowerMeter, Ppk2Emulator, True, lambda url: f"{url}?voltage=5.0", 3),
    # *IDN? twice, MEAS:POW? and SYST:ERR? with *IDN? after each
    "scpi": Meter(ScpiPowerMeter, ScpiEmulator, False, str, 7),
    "visa": Meter(VisaPowerMeter, ScpiEmulator, False, visa_address, 7),
}
PYVISA = ("scpi", "visa")
every_meter = pytest.mark.parametrize("meter", METERS.values(), ids=METERS.keys())


@pytest.fixture
def clock() -> WaitingClock:
    return WaitingClock()


@pytest.fixture
def simulation(clock: WaitingClock) -> Simulation:
    panel = SimulatedPanel(PanelPhysics(), clock.now)
    return Simulation(panel, np.random.default_rng(5), clock.now, clock.wait)


@pytest.fixture(autouse=True)
def nothing_left_open() -> Iterator[None]:
    """Refuse a test after which a file or a thread is left that was not there before it."""
    files, threads = open_files(), set(threading.enumerate())
    yield
    assert set(threading.enumerate()) <= threads
    assert open_files() <= files


def open_files() -> set[str]:
    """Return what this process has open, but for what Python's own event loops and logs keep."""
    found = set()
    for entry in Path("/proc/self/fd").iterdir():
        try:
            found.add(f"{entry.name} {entry.readlink()}")
        except OSError:  # the folder itself
            continue
    return {name for name in found if "tty" in name or "pts" in name or "ptmx" in name or "socket" in name}


def opened(
    meter: Meter, simulation: Simulation, plan: FaultPlan | None, stack: contextlib.ExitStack
) -> PowerMeter:
    """Return a driver on a link that goes wrong by a plan; both are closed with the stack."""
    emulator = meter.emulator(simulation)
    link = stack.enter_context(EmulatedLink(emulator, plan, pseudo_terminal=meter.pseudo_terminal))
    timeout = TIMEOUT if plan else PATIENT
    return stack.enter_context(meter.driver(meter.address(link.url), simulation.clock, timeout))


def name_of(meter: Meter) -> str:
    """Return the name of a driver."""
    return next(name for name, other in METERS.items() if other is meter)


def fault_of(measure: Callable[[], object]) -> Fault | None:
    """Return the fault that a measurement ends with, None where it succeeds."""
    try:
        measure()
    except InstrumentError as error:
        return error.fault
    return None


@pytest.mark.real_time  # how much of a sample has come when the link breaks is the clock's
@every_meter
def test_a_disconnection_while_it_is_measured_is_told_and_ends_the_link(meter, simulation) -> None:
    with contextlib.ExitStack() as stack:
        plan = FaultPlan(LinkFault.DISCONNECT, first=meter.first_of_sampling)
        device = opened(meter, simulation, plan, stack)
        average = partial(average_power, device, 0.5, RATE, simulation.clock, simulation.wait)
        faults = [fault_of(average) for _ in range(3)]
    # PyVISA-py takes a closed socket for a silent one, and notices it at the second or the third try.
    silent = {Fault.NO_REPLY, Fault.GARBLED} if name_of(meter) in PYVISA else {Fault.DISCONNECTED}
    assert faults[0] in silent
    assert faults[1] in {*silent, Fault.DISCONNECTED}
    assert faults[2] is Fault.DISCONNECTED


@every_meter
def test_a_second_program_is_told_that_the_port_is_in_use(meter, simulation) -> None:
    with EmulatedLink(meter.emulator(simulation), pseudo_terminal=meter.pseudo_terminal) as link:
        address = meter.address(link.url)
        with meter.driver(address, simulation.clock, PATIENT):
            # In one process two devices share a board, so the other program is the link alone.
            other = PowerBoard if meter.driver is BoardPowerMeter else meter.driver
            with pytest.raises(InstrumentError, match="another program") as told:
                other(address, simulation.clock, TIMEOUT)
            # PyVISA-py takes a socket that was closed for a silent one, unless it was closed while it wrote.
            others = {Fault.NO_REPLY, Fault.DISCONNECTED} if name_of(meter) in PYVISA else {Fault.BUSY}
            assert told.value.fault in others
        end = time.monotonic() + PATIENT
        while True:  # it is free again, once the other end has seen that it was closed
            try:
                with meter.driver(address, simulation.clock, PATIENT) as device:
                    device.start(RATE)
                break
            except InstrumentError as busy:
                if busy.fault not in {Fault.NO_REPLY, Fault.DISCONNECTED} or time.monotonic() > end:
                    raise


@every_meter
def test_another_instrument_is_recognised(meter, simulation) -> None:
    class Ls100:
        def receive(self, data: bytes) -> bytes:
            return b"OK00,   48.1\r\n"

        def stream(self) -> bytes:
            return b""

    with (
        EmulatedLink(Ls100(), pseudo_terminal=meter.pseudo_terminal) as link,
        pytest.raises(InstrumentError, match=r"OK00.* which instrument is .*\?") as told,
    ):
        meter.driver(meter.address(link.url), simulation.clock, TIMEOUT)
    assert told.value.fault is Fault.WRONG_INSTRUMENT


@every_meter
def test_an_instrument_that_is_pulled_out_ends_the_measurement_within_its_time_out(meter) -> None:
    panel = SimulatedPanel(PanelPhysics(), time.monotonic)
    simulation = Simulation(panel, np.random.default_rng(5), time.monotonic, time.sleep)
    with EmulatedLink(meter.emulator(simulation), pseudo_terminal=meter.pseudo_terminal) as link:
        device = meter.driver(meter.address(link.url), time.monotonic, TIMEOUT)
        device.start(RATE)
        link.unplug()
        # PyVISA-py takes a closed socket for a silent one, until it writes to it again.
        expected = Fault.NO_REPLY if name_of(meter) in PYVISA else Fault.DISCONNECTED
        found, pause = None, 0.01
        for _ in range(round((2 * TIMEOUT + 1) / pause)):  # looks: fewer a second on a busy machine
            found = found or fault_of(device.samples)
            time.sleep(0 if found else pause)
        assert found is expected
        device.close()


def averaged(device: PowerMeter, simulation: Simulation) -> PowerAverage:
    """Return the average over half a second of the simulation."""
    return average_power(device, 0.5, RATE, simulation.clock, simulation.wait)


def dim(simulation: Simulation) -> None:
    """Dim the panel, and let it settle."""
    simulation.panel.set_backlight(0.25)
    simulation.wait(1.0)


def averaged_at_last(device: PowerMeter, simulation: Simulation) -> PowerAverage:
    """Return the average of the first try that succeeds, of six, as a sweep makes them."""
    for _ in range(5):
        with contextlib.suppress(InstrumentError):
            return averaged(device, simulation)
    return averaged(device, simulation)


@every_meter
def test_a_late_reply_is_never_taken_for_a_later_one(meter, simulation) -> None:
    with contextlib.ExitStack() as stack:
        plan = FaultPlan(LinkFault.LATE_REPLY, first=meter.first_of_sampling, delay=2 * TIMEOUT)
        device = opened(meter, simulation, plan, stack)
        assert fault_of(lambda: averaged(device, simulation)) in TRANSIENT
        dim(simulation)  # what is late tells of the panel undimmed, and is not there yet
        assert averaged_at_last(device, simulation).power == pytest.approx(DIMMED, abs=0.001)


@every_meter
def test_a_meter_finds_the_power_of_the_panel(meter, simulation) -> None:
    # 100 samples of 2 mW noise: 0.2 mW for their mean, five times that is allowed
    with contextlib.ExitStack() as stack:
        device = opened(meter, simulation, None, stack)
        assert averaged(device, simulation).power == pytest.approx(FULL, abs=0.001)


@every_meter
def test_what_is_closed_or_not_started_says_so(meter, simulation) -> None:
    with EmulatedLink(meter.emulator(simulation), pseudo_terminal=meter.pseudo_terminal) as link:
        device = meter.driver(meter.address(link.url), simulation.clock, PATIENT)
        with pytest.raises(InstrumentError, match="start it first"):
            device.samples()
        assert list(device.stop()) == []
        device.start(RATE)
        device.close()
        device.close()
        for use in (device.samples, device.ping, lambda: device.start(RATE)):
            with pytest.raises(InstrumentError, match="closed") as told:
                use()
            assert told.value.fault is Fault.DISCONNECTED


@every_meter
def test_a_rate_that_it_has_not_is_refused(meter, simulation) -> None:
    with contextlib.ExitStack() as stack:
        device = opened(meter, simulation, None, stack)
        for rate in (0.0, -1.0, 1e6, float("nan")):
            with pytest.raises(InstrumentError, match="Hz, got"):
                device.start(rate)

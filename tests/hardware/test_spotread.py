"""ArgyllCMS's spotread: what the program prints becomes a reading or an error, never an old reading."""

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from emulators.link import FaultPlan, LinkFault
from emulators.luminance_meters import WHITE
from emulators.spotread import WORDS, EmulatedSpotread

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.spotread import Spotread
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

TIMEOUT = 3.0  # [s] the program itself takes some 0.05 s to start, on a busy machine a second
PANEL = PanelPhysics(peak_luminance=100.0, black_level=0.0, gamma=1.0, warm_up_share=0.0)


def _children() -> set[str]:
    """The processes that this one has started, those that ended and were not waited for among them."""
    return {
        number for task in Path("/proc/self/task").glob("*/children") for number in task.read_text().split()
    }


@pytest.fixture(autouse=True)
def _nothing_left_open() -> Iterator[None]:
    """No file descriptor, thread or process outlives a test."""
    files, threads = set(Path("/proc/self/fd").iterdir()), set(threading.enumerate())
    processes = _children()
    yield
    assert set(Path("/proc/self/fd").iterdir()) <= files
    assert set(threading.enumerate()) <= threads
    assert _children() <= processes


@pytest.fixture
def simulation() -> Simulation:
    """A steady panel, linear in pixel value, at 50 cd/m^2."""
    clock = WaitingClock()
    panel = SimulatedPanel(PANEL, clock.now)
    panel.show(0.5)
    return Simulation(panel, np.random.default_rng(5), clock.now, clock.wait)


def test_a_reading_is_what_the_program_prints(simulation: Simulation) -> None:
    """0.2 % of 50 cd/m^2 is 0.1; five of them."""
    with EmulatedSpotread(simulation) as emulated, Spotread(emulated.url) as meter:
        reading = meter.read_luminance()
        assert reading.value == pytest.approx(50.0, abs=0.5)
        assert reading.chromaticity == pytest.approx(WHITE)
        assert meter.apparatus() == {
            "model": "/dev/bus/usb/003/008 (X-Rite i1 DisplayPro, ColorMunki Display)",
            "program": "ArgyllCMS spotread 2.3.1",
        }


@pytest.mark.parametrize("fault", list(WORDS))
def test_what_the_program_complains_of_is_an_error_in_words(fault: Fault, simulation: Simulation) -> None:
    with EmulatedSpotread(simulation) as emulated, Spotread(emulated.url) as meter:
        emulated.dialogue.fault = fault
        with pytest.raises(InstrumentError) as failed:
            meter.read_luminance()
        assert failed.value.fault is fault
        assert WORDS[fault] in str(failed.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (LinkFault.NO_REPLY, Fault.NO_REPLY),
        (LinkFault.LATE_REPLY, Fault.NO_REPLY),
        (LinkFault.PARTIAL_LINE, Fault.NO_REPLY),  # the program hangs with half a line printed
        (LinkFault.GARBAGE, Fault.GARBLED),
    ],
)
def test_a_run_that_fails_says_so_and_the_next_reading_is_of_what_is_shown_then(
    fault: LinkFault, expected: Fault, simulation: Simulation
) -> None:
    plan = FaultPlan(fault, first=2, delay=TIMEOUT + 0.2)
    with (
        EmulatedSpotread(simulation, plan=plan) as emulated,
        Spotread(emulated.url, timeout=TIMEOUT) as meter,
    ):
        with pytest.raises(InstrumentError) as failed:
            meter.read_luminance()
        assert failed.value.fault is expected
        assert failed.value.fault in TRANSIENT
        simulation.panel.show(1.0)
        assert meter.read_luminance().value == pytest.approx(100.0, rel=0.01)


def test_a_program_that_ends_in_mid_measurement_gave_no_reading(simulation: Simulation) -> None:
    plan = FaultPlan(LinkFault.DISCONNECT, first=2)
    with (
        EmulatedSpotread(simulation, plan=plan) as emulated,
        Spotread(emulated.url, timeout=TIMEOUT) as meter,
        pytest.raises(InstrumentError, match="ended without a result after 'Result is XYZ") as failed,
    ):
        meter.read_luminance()
    assert failed.value.fault is Fault.GARBLED


@pytest.mark.slow
def test_a_program_that_stops_while_it_looks_for_instruments_is_ended(simulation: Simulation) -> None:
    """The real one does, where a serial port takes its question and never answers."""
    plan = FaultPlan(LinkFault.PARTIAL_LINE, first=1)
    with (
        EmulatedSpotread(simulation, plan=plan) as emulated,
        pytest.raises(InstrumentError, match=r"took longer than 3 s.*a port that does not answer") as failed,
    ):
        Spotread(emulated.url, timeout=TIMEOUT)
    assert failed.value.fault is Fault.NO_REPLY


def test_an_instrument_that_is_not_in_the_list_is_refused_with_those_that_are(simulation: Simulation) -> None:
    with (
        EmulatedSpotread(simulation) as emulated,
        pytest.raises(
            InstrumentError, match=r"instrument 3: not in its list; there is 1 \(/dev/bus"
        ) as failed,
    ):
        Spotread(emulated.url.replace("1@", "3@"))
    assert failed.value.fault is Fault.NOT_FOUND


def test_a_port_without_a_colorimeter_is_another_instrument(simulation: Simulation) -> None:
    with (
        EmulatedSpotread(simulation) as emulated,
        Spotread(emulated.url.replace("1@", "2@")) as meter,  # a serial port
        pytest.raises(InstrumentError, match="no instrument that it knows") as failed,
    ):
        meter.read_luminance()
    assert failed.value.fault is Fault.WRONG_INSTRUMENT


def test_a_screen_that_shows_as_zero_is_too_dark_and_no_value(simulation: Simulation) -> None:
    """The program shows what is below zero as 0, so 0 stands for more than one luminance."""
    script = 'case "$1" in -*\\?) echo "Version 2.3.1"; echo "    1 = \'x\'" ;; *) echo "%s" ;; esac'
    line = "Result is XYZ: 0.000000 0.000000 0.000000, Yxy: 0.000000 0.333333 0.333333"
    with EmulatedSpotread(simulation) as emulated:
        program = Path(emulated.url.partition("@")[2])
        program.write_text("#!/bin/sh\n" + script.replace("%s", line) + "\n")
        with (
            Spotread(emulated.url) as meter,
            pytest.raises(InstrumentError, match="too dark") as failed,
        ):
            meter.read_luminance()
    assert failed.value.fault is Fault.UNDER_RANGE


def test_a_program_that_is_not_there_or_another_one_is_refused() -> None:
    with pytest.raises(InstrumentError, match="no such program; install ArgyllCMS") as failed:
        Spotread("1@/nowhere/spotread")
    assert failed.value.fault is Fault.NOT_FOUND
    with pytest.raises(InstrumentError, match="is not ArgyllCMS's spotread") as failed:
        Spotread(f"1@{sys.executable}")
    assert failed.value.fault is Fault.WRONG_INSTRUMENT


def test_an_address_that_is_no_number_is_bad_input() -> None:
    with pytest.raises(InputError, match="expected a number of its list"):
        Spotread("i1display")

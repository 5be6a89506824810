"""Luminance meters over real links: what goes wrong ends in a clear error, and no late reply is taken."""

import re
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulators.link import EmulatedLink, FaultPlan, LinkFault
from emulators.luminance_meters import (
    WHITE,
    EmulatedColorCal,
    EmulatedCs100a,
    EmulatedLs100,
    EmulatedLs110,
    EmulatedPr650,
    EmulatedPr655,
    EmulatedPr670,
)

from evenlight.hardware.drivers.colorcal import ColorCal
from evenlight.hardware.drivers.konica_minolta import Cs100a, Ls100, Ls110
from evenlight.hardware.drivers.photo_research import Pr650, Pr655, Pr670
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError, LuminanceMeter
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

TIMEOUT = 2.0  # [s] two dozen drivers share the process
LATE = 2.6  # [s] after the driver gave up
DIM, BRIGHT = 50.0, 100.0  # [cd/m^2]
STEADY = PanelPhysics(peak_luminance=BRIGHT, black_level=0.0, gamma=1.0, warm_up_share=0.0)


@dataclass(frozen=True)
class Bench:
    """A driver, and the instrument that is emulated for it."""

    open: Callable[[str], LuminanceMeter]
    emulator: Callable[[Simulation], Any]
    beginning: int  # replies before the first reading
    vital: int = 1  # the first of them that cannot be done without
    terminal: bool = False  # 8N1, so that a pseudo-terminal will do
    chromaticity: bool = True


@pytest.fixture(autouse=True)
def _fast(monkeypatch) -> None:
    monkeypatch.setattr(Pr655, "interval", 0.0005)


def opened(driver: type[Any]) -> Callable[[str], LuminanceMeter]:
    """How a driver is opened, fast."""
    return lambda url: driver(url, timeout=TIMEOUT)


BENCHES = {
    "ls100": Bench(opened(Ls100), EmulatedLs100, 1, chromaticity=False),
    "ls100 short": Bench(opened(Ls100), lambda s: EmulatedLs100(s, width=5), 1, chromaticity=False),
    "ls110": Bench(opened(Ls110), EmulatedLs110, 1, chromaticity=False),
    "cs100a": Bench(opened(Cs100a), EmulatedCs100a, 1),
    "pr655": Bench(opened(Pr655), EmulatedPr655, 6, vital=2, terminal=True),
    "pr670": Bench(opened(Pr670), EmulatedPr670, 6, vital=2, terminal=True),
    "pr650": Bench(opened(Pr650), EmulatedPr650, 2, terminal=True),
    "colorcal": Bench(opened(ColorCal), EmulatedColorCal, 8, terminal=True),
}
LS100_FAULTS = {Fault.OVER_RANGE: "ER10", Fault.UNDER_RANGE: "OK13", Fault.LOW_BATTERY: "ER30"}
PR655_FAULTS = {Fault.OVER_RANGE: "-2", Fault.UNDER_RANGE: "-8"}  # it has no code for its battery
OWN_FAULTS = {
    "ls100": LS100_FAULTS,
    "ls110": LS100_FAULTS,
    "cs100a": {**LS100_FAULTS, Fault.OVER_RANGE: "OK12"},
    "pr655": PR655_FAULTS,
    "pr670": PR655_FAULTS,
    "pr650": {Fault.OVER_RANGE: "19", Fault.UNDER_RANGE: "10", Fault.LOW_BATTERY: "17"},
    "colorcal": {Fault.UNDER_RANGE: "OK00"},  # its code for too much light is not known
}


@pytest.fixture(autouse=True)
def _nothing_left_open() -> Iterator[None]:
    """No file descriptor and no thread outlives a test."""
    files, threads = set(Path("/proc/self/fd").iterdir()), set(threading.enumerate())
    yield
    assert set(Path("/proc/self/fd").iterdir()) <= files
    assert set(threading.enumerate()) <= threads


def steady_panel() -> Simulation:
    """A steady panel, linear in pixel value, at 50 cd/m^2."""
    clock = WaitingClock()
    panel = SimulatedPanel(STEADY, clock.now)
    panel.show(DIM / BRIGHT)
    return Simulation(panel, np.random.default_rng(5), clock.now, clock.wait)


@pytest.fixture
def simulation() -> Simulation:
    return steady_panel()


def each_driver(check: Callable[..., None], *cases: Any) -> None:
    """Check every driver, in every case, on its own panel."""
    at_once(check, [(name, *case) for name in BENCHES for case in (cases or ((),))])


def at_once(check: Callable[..., None], cases: Sequence[tuple[Any, ...]]) -> None:
    """Check all cases, of a driver and more, at once: mostly they wait for what does not come."""
    with ThreadPoolExecutor(len(cases)) as pool:
        done = {case: pool.submit(check, case[0], steady_panel(), *case[1:]) for case in cases}
    failed = {case: error for case, result in done.items() if (error := result.exception())}
    assert not failed, "; ".join(f"{case}: {error!r}" for case, error in failed.items())


def linked(
    name: str, simulation: Simulation, plan: FaultPlan | None = None, emulator: Any = None
) -> AbstractContextManager[EmulatedLink]:
    """The link to a bench's instrument."""
    bench = BENCHES[name]
    return EmulatedLink(emulator or bench.emulator(simulation), plan, pseudo_terminal=bench.terminal)


def first_reading(meter: LuminanceMeter, tries: int = 5) -> float:
    """The first reading that comes, as a sweep would take it: what fails on its way is tried again."""
    for _ in range(tries):
        try:
            return meter.read_luminance().value
        except InstrumentError as error:
            if error.fault not in TRANSIENT:
                raise
    raise AssertionError(f"no reading in {tries} tries")


def test_the_luminance_of_the_panel_is_read_within_five_standard_deviations() -> None:
    """0.2 % of 50 cd/m^2 is 0.1; five of them with the last digit's half step make 0.55."""

    def check(name: str, simulation: Simulation) -> None:
        with linked(name, simulation) as link, BENCHES[name].open(link.url) as meter:
            reading = meter.read_luminance()
            assert reading.value == pytest.approx(DIM, abs=0.55)
            assert reading.unit == "cd/m^2"
            assert reading.begun <= reading.ended
            if BENCHES[name].chromaticity:
                assert reading.chromaticity == pytest.approx(WHITE, abs=1e-3)
            else:
                assert reading.chromaticity is None
            assert meter.apparatus()["model"]

    each_driver(check)


@pytest.mark.slow
def test_a_late_reply_is_never_taken_for_that_to_a_later_question() -> None:
    """Late is the reading, or the reading and what is asked to find one's place again."""

    def check(name: str, simulation: Simulation, late: int) -> None:
        bench = BENCHES[name]
        plan = FaultPlan(LinkFault.LATE_REPLY, first=bench.beginning + 1, count=late, delay=LATE)
        with linked(name, simulation, plan) as link, bench.open(link.url) as meter:
            with pytest.raises(InstrumentError) as failed:
                meter.read_luminance()
            assert failed.value.fault is Fault.NO_REPLY
            for share in (1.0, 0.2, 1.0, 0.2):  # a reply that is one behind would be so for good
                simulation.panel.show(share)
                assert first_reading(meter) == pytest.approx(share * BRIGHT, rel=0.015)

    each_driver(check, (1,), (2,))


@pytest.mark.parametrize("fault", [LinkFault.LATE_REPLY, LinkFault.NO_REPLY, LinkFault.GARBAGE])
def test_a_pr650_whose_values_are_late_does_not_give_those_of_an_earlier_measurement(
    simulation: Simulation, fault: LinkFault
) -> None:
    plan = FaultPlan(fault, first=4, delay=LATE)  # 2 to begin, 1 for the measurement, then its values
    with linked("pr650", simulation, plan) as link, BENCHES["pr650"].open(link.url) as meter:
        with pytest.raises(InstrumentError):
            meter.read_luminance()
        simulation.panel.show(1.0)
        assert first_reading(meter) == pytest.approx(BRIGHT, rel=0.012)


def test_a_link_that_breaks_in_mid_measurement_is_closed_for_good() -> None:
    def check(name: str, simulation: Simulation) -> None:
        bench = BENCHES[name]
        plan = FaultPlan(LinkFault.DISCONNECT, first=bench.beginning + 1)
        with linked(name, simulation, plan) as link, bench.open(link.url) as meter:
            for _ in range(2):
                with pytest.raises(InstrumentError) as failed:
                    meter.read_luminance()
                assert failed.value.fault is Fault.DISCONNECTED
            meter.close()
            meter.close()

    each_driver(check)


def test_an_instruments_own_fault_is_told_with_its_code_and_words_and_never_as_a_value() -> None:
    words = {Fault.OVER_RANGE: "bright|beyond", Fault.UNDER_RANGE: "dark|below", Fault.LOW_BATTERY: "battery"}

    def check(name: str, simulation: Simulation) -> None:
        emulator = BENCHES[name].emulator(simulation)
        with linked(name, simulation, emulator=emulator) as link, BENCHES[name].open(link.url) as meter:
            for fault, code in OWN_FAULTS[name.split()[0]].items():
                emulator.fault = fault
                with pytest.raises(InstrumentError, match=words[fault]) as failed:
                    meter.read_luminance()
                assert (failed.value.fault, failed.value.code) == (fault, code)
                emulator.fault = None
                assert meter.read_luminance().value == pytest.approx(DIM, rel=0.015)

    each_driver(check)


def test_a_colorcal_that_refuses_tells_the_code_though_nobody_knows_its_words(simulation: Simulation) -> None:
    emulator = EmulatedColorCal(simulation)
    with (
        linked("colorcal", simulation, emulator=emulator) as link,
        ColorCal(link.url, timeout=TIMEOUT) as meter,
    ):
        emulator.fault = Fault.OVER_RANGE
        with pytest.raises(InstrumentError, match="too bright for it\\? \\(error ER10\\)") as failed:
            meter.read_luminance()
        assert failed.value.fault is Fault.REFUSED


def test_another_instrument_is_recognised_and_named() -> None:
    def check(name: str, simulation: Simulation, emulator: type[Any], advice: str) -> None:
        with (
            linked(name, simulation, emulator=emulator(simulation)) as link,
            pytest.raises(InstrumentError, match=advice) as failed,
            BENCHES[name].open(link.url) as meter,
        ):
            meter.read_luminance()
        assert failed.value.fault is Fault.WRONG_INSTRUMENT

    at_once(
        check,
        [
            ("ls100", EmulatedCs100a, "name it cs100a"),
            ("ls110", EmulatedCs100a, "name it cs100a"),
            ("cs100a", EmulatedLs100, "name it ls100 or ls110"),
            ("ls100", EmulatedPr650, "no Konica Minolta meter's reply"),
            ("pr655", EmulatedPr670, "is a PR-670; name it pr670"),
            ("pr670", EmulatedPr655, "is a PR-655; name it pr655"),
            ("pr655", EmulatedPr650, "no PR-655's reply"),
            ("pr655", EmulatedLs100, "no PR-655's reply"),
            ("pr650", EmulatedLs100, "no PR-650's reply"),
        ],
    )


def test_a_pr655_in_remote_mode_is_no_pr650(simulation: Simulation) -> None:
    emulator = EmulatedPr655(simulation)
    emulator.remote = True
    with (
        linked("pr650", simulation, emulator=emulator) as link,
        pytest.raises(InstrumentError, match="name it pr655 or pr670") as failed,
    ):
        Pr650(link.url, timeout=TIMEOUT)
    assert failed.value.fault is Fault.WRONG_INSTRUMENT


def test_an_instrument_whose_lines_end_otherwise_is_asked_about(simulation: Simulation) -> None:
    with (
        linked("colorcal", simulation, emulator=EmulatedLs100(simulation)) as link,
        pytest.raises(InstrumentError, match=r"'ER00.*is it a CRS ColorCAL II\?"),
    ):
        ColorCal(link.url, timeout=TIMEOUT)


def test_a_port_that_is_in_use_is_refused() -> None:
    """A serial port is locked; a socket turns the second client away."""

    def check(name: str, simulation: Simulation) -> None:
        with linked(name, simulation) as link, BENCHES[name].open(link.url) as meter:
            with pytest.raises(InstrumentError) as failed:
                BENCHES[name].open(link.url)
            assert failed.value.fault is (Fault.BUSY if BENCHES[name].terminal else Fault.DISCONNECTED)
            assert meter.read_luminance().value == pytest.approx(DIM, rel=0.015)

    each_driver(check)


def test_a_locked_serial_port_is_refused_at_seven_data_bits_too(simulation: Simulation) -> None:
    with (
        EmulatedLink(EmulatedLs100(simulation), pseudo_terminal=True) as link,
        Ls100(link.url, timeout=TIMEOUT),
        pytest.raises(InstrumentError, match="in use by another program") as failed,
    ):
        Ls100(link.url, timeout=TIMEOUT)
    assert failed.value.fault is Fault.BUSY


def test_a_cs100a_whose_chromaticity_is_out_of_range_still_has_a_luminance(simulation: Simulation) -> None:
    emulator = EmulatedCs100a(simulation)
    emulator.chromaticity_fails = True
    with linked("cs100a", simulation, emulator=emulator) as link, Cs100a(link.url, timeout=TIMEOUT) as meter:
        reading = meter.read_luminance()
    assert reading.value == pytest.approx(DIM, rel=0.015)
    assert reading.chromaticity is None
    assert reading.status == "OK11: chromaticity out of range"


@pytest.mark.parametrize("emulator", [EmulatedPr655, EmulatedPr670])
def test_a_spectroradiometer_is_left_in_its_own_hands(
    emulator: type[EmulatedPr655], simulation: Simulation
) -> None:
    instrument = emulator(simulation)
    name = instrument.model.lower().replace("-", "")
    with linked(name, simulation, emulator=instrument) as link:
        with BENCHES[name].open(link.url) as meter:
            assert instrument.remote
            assert meter.apparatus()["serial number"] == instrument.serial_number
        with BENCHES[name].open(link.url):  # its answer shows that the end of the first session has come
            assert instrument.remote


def test_a_pr655_that_another_program_left_in_remote_mode_is_taken_over(simulation: Simulation) -> None:
    emulator = EmulatedPr655(simulation)
    emulator.remote = True
    with linked("pr655", simulation, emulator=emulator) as link, BENCHES["pr655"].open(link.url) as meter:
        assert meter.read_luminance().value == pytest.approx(DIM, rel=0.015)


@pytest.mark.parametrize("fault", [LinkFault.NO_REPLY, LinkFault.LATE_REPLY])
def test_a_pr655_whose_word_for_remote_mode_is_lost_or_late_is_asked_whether_it_is_in_it(
    fault: LinkFault, simulation: Simulation
) -> None:
    plan = FaultPlan(fault, first=1, delay=LATE)
    with linked("pr655", simulation, plan) as link, BENCHES["pr655"].open(link.url) as meter:
        assert meter.read_luminance().value == pytest.approx(DIM, rel=0.015)


def test_a_colorcal_sets_its_zero_in_the_dark_only(simulation: Simulation) -> None:
    with linked("colorcal", simulation) as link, ColorCal(link.url, timeout=TIMEOUT) as meter:
        with pytest.raises(InstrumentError, match="cover the sensor") as failed:
            meter.zero()
        assert (failed.value.fault, failed.value.code) == (Fault.REFUSED, "ER11")
        simulation.panel.show(0.0)
        meter.zero()


@pytest.mark.slow
def test_a_reading_that_fails_on_its_way_says_so_and_the_next_one_is_right() -> None:
    def check(name: str, simulation: Simulation, fault: LinkFault, expected: Fault) -> None:
        bench = BENCHES[name]
        plan = FaultPlan(fault, first=bench.beginning + 1)
        with linked(name, simulation, plan) as link, bench.open(link.url) as meter:
            with pytest.raises(InstrumentError, match=re.escape(link.url)) as failed:
                meter.read_luminance()
            assert failed.value.fault is expected
            simulation.panel.show(1.0)
            assert first_reading(meter) == pytest.approx(BRIGHT, rel=0.012)

    each_driver(
        check,
        (LinkFault.NO_REPLY, Fault.NO_REPLY),
        (LinkFault.PARTIAL_LINE, Fault.GARBLED),
        (LinkFault.GARBAGE, Fault.GARBLED),
    )


@pytest.mark.slow
def test_an_instrument_that_fails_while_it_is_opened_leaves_no_port_open() -> None:
    def check(name: str, simulation: Simulation, fault: LinkFault) -> None:
        plan = FaultPlan(fault, first=BENCHES[name].vital, delay=LATE)
        with (
            linked(name, simulation, plan) as link,
            pytest.raises(InstrumentError, match=re.escape(link.url)),
        ):
            BENCHES[name].open(link.url)

    each_driver(check, *((fault,) for fault in LinkFault))


@pytest.mark.parametrize("name", BENCHES)
def test_a_port_that_is_not_there_is_named(name: str) -> None:
    with pytest.raises(InstrumentError, match=r"/dev/nowhere.*measure list") as failed:
        BENCHES[name].open("/dev/nowhere")
    assert failed.value.fault is Fault.NOT_FOUND

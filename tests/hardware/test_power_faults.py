"""Power meters and backlights whose replies fail at random: an error, or what was measured."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from emulators.link import EmulatedLink
from faulty_power_devices import DEVICES, PATIENT, BenchSupply, short_silences
from spoilt_replies import Tally

from evenlight.hardware.drivers.nordic_ppk2 import Ppk2PowerMeter
from evenlight.hardware.drivers.power_board import BoardPowerMeter
from evenlight.hardware.drivers.scpi_power import NumberForm, ScpiPowerMeter, VisaPowerMeter
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, InstrumentError

EXCHANGES = 200
SOON = 5.0  # [s] in which a wrong port is told, as the documents promise
TICK = 0.005  # [s]


@pytest.mark.slow
def test_nothing_is_made_up_whatever_happens_to_replies() -> None:
    """All at once, as most of the time is waited; by hand: tests/companions/faulty_power_devices.py 5000."""

    def run(name: str) -> Tally:
        return DEVICES[name](EXCHANGES, np.random.default_rng(21))

    with short_silences(), ThreadPoolExecutor(len(DEVICES)) as pool:
        tallies = dict(zip(DEVICES, pool.map(run, DEVICES), strict=True))
    assert {name: tally.made_up for name, tally in tallies.items()} == {name: [] for name in DEVICES}
    for name, tally in tallies.items():
        assert tally.exchanges >= EXCHANGES, name
        assert tally.right > EXCHANGES / 5, name  # and it goes on measuring
        assert tally.right + sum(tally.errors.values()) == tally.exchanges, name


class Shifted(BenchSupply):
    """A supply whose every answer comes one question late, after a line that nobody asked for."""

    def __init__(self) -> None:
        super().__init__("{:.2f}", 1.25)
        self.held: list[bytes] = []

    def receive(self, data: bytes) -> bytes:
        answers = super().receive(data).splitlines(keepends=True)
        if not self.held:
            return b"".join(answers)
        due, self.held = self.held, self.held[1:] + answers
        return due[0] if answers else b""


def test_one_stray_line_shifts_no_answer() -> None:
    supply = Shifted()
    with (
        short_silences(),
        EmulatedLink(supply) as link,
        ScpiPowerMeter(link.url, timeout=PATIENT) as meter,
    ):
        meter.start(1000.0)
        meter._dialogue._timeout = 0.1
        supply.held = [b"49.5\n"]
        end = time.monotonic() + PATIENT
        found: list[object] = []
        while found.count("error") < 2 and len(found) < 50 and time.monotonic() < end:
            try:
                found += [sample.power for sample in meter.samples()]
            except InstrumentError as error:
                assert error.fault in (Fault.GARBLED, Fault.NO_REPLY)  # noqa: PT017 # each one
                found.append("error")
    assert "error" in found
    assert 49.5 not in found


@pytest.mark.parametrize(
    ("answer", "power"), [("1.25W", 1.25), ("500mW", 0.5), ("+1.25E+00V", None), ("1E30", None)]
)
def test_units_are_read_and_what_no_panel_takes_is_refused(answer, power) -> None:
    class Fixed(BenchSupply):
        def _unit(self, unit: str) -> str:
            return answer if unit == "MEAS:POW?" else super()._unit(unit)

    with EmulatedLink(Fixed("", 0.0)) as link, contextlib.ExitStack() as stack:
        if power is None:
            with pytest.raises(InstrumentError, match=r"1e\+30 W|does not measure power"):
                stack.enter_context(ScpiPowerMeter(link.url, timeout=PATIENT)).start(100.0)
            return
        meter = stack.enter_context(ScpiPowerMeter(link.url, timeout=PATIENT))
        meter.start(100.0)
        assert [sample.power for sample in [*meter.samples(), *meter.stop()]] == [power]


class Yokogawa:
    """A WT310: items of what NUM:VAL? sends, U, I and P from the factory (IM WT310-17EN, NUMeric group)."""

    def __init__(self, *, header: bool, follows_item: bool = True) -> None:
        self._came, self._header, self._follows = b"", header, follows_item
        self._items, self._number = ["U,1", "I,1", "P,1"], 3

    def receive(self, data: bytes) -> bytes:
        *lines, self._came = (self._came + data).split(b"\n")
        answers = [self._unit(line.decode()) for line in lines]
        return "".join(f"{answer}\n" for answer in answers if answer).encode()

    def stream(self) -> bytes:
        return b""

    def _unit(self, unit: str) -> str:
        values = {"U,1": "5.0000E+00", "I,1": "0.2500E+00", "P,1": "1.2500E+00"}
        match unit.split(" "):
            case ["*IDN?"]:
                return "YOKOGAWA,WT310,C2PH17004V,F1.03"
            case ["STAT:ERR?"]:
                return '0,"No error"'
            case ["NUM:NUM", number]:
                self._number = int(number)
            case ["NUM:ITEM1", item] if self._follows:
                self._items[0] = item
            case ["NUM:ITEM1?"]:
                return (":NUM:NORM:ITEM1 " if self._header else "") + self._items[0]
            case ["NUM:VAL?"]:
                return ",".join(values[item] for item in self._items[: self._number])
        return ""


@pytest.mark.parametrize("header", [True, False])
def test_a_yokogawa_is_asked_for_power_and_nothing_else(header) -> None:
    with (
        EmulatedLink(Yokogawa(header=header)) as link,
        ScpiPowerMeter(link.url, timeout=PATIENT) as meter,
    ):
        meter.start(100.0)
        assert [sample.power for sample in [*meter.samples(), *meter.stop()]] == [1.25]
        assert meter.apparatus()["power_meter_asked"] == "NUM:VAL?"


def test_a_yokogawa_whose_first_number_is_not_power_is_refused() -> None:
    with (
        EmulatedLink(Yokogawa(header=False, follows_item=False)) as link,
        pytest.raises(InstrumentError, match="does not measure power"),
    ):
        ScpiPowerMeter(link.url, timeout=PATIENT)


class Echoing(BenchSupply):
    """A supply behind a serial converter that sends back what it is sent."""

    def receive(self, data: bytes) -> bytes:
        return data + super().receive(data)


def test_questions_that_are_sent_back_are_no_answers() -> None:
    supply = Echoing("{:.4f}", 0.66)
    with EmulatedLink(supply) as link, ScpiPowerMeter(link.url, timeout=PATIENT) as meter:
        meter.start(100.0)
        samples = [*meter.samples(), *meter.stop()]
    assert [sample.power for sample in samples] == [float(supply.measured)]


def test_a_number_that_lost_a_digit_is_not_whole() -> None:
    """By hand: decimals that are missing, a magnitude that fell; a step that lasts is believed."""
    form = NumberForm()
    assert [form.is_whole(text, float(text)) for text in ("9.98",) * 4][-1]
    for text, whole in (("10.02", True), ("9.97", True), ("9.9", False), ("997", False), (".97", False)):
        assert form.is_whole(text, float(text)) is whole, text
    assert form.is_whole("19.50", 19.5) is False  # twice as much: believed when it comes again and again
    assert [form.is_whole(text, float(text)) for text in ("19.51", "19.49", "19.50")] == [False, False, True]
    assert form.is_whole("9.50", 9.5) is False  # 19.50 without its 1


def test_an_instrument_that_leaves_out_zeros_at_the_end_is_read_all_the_same() -> None:
    """Nine of ten numbers have four decimals, one less: it is asked for again."""
    rng, form = np.random.default_rng(4), NumberForm()
    answers = [f"{0.6 + 0.0001 * k:.6g}" for k in rng.integers(0, 300, size=400)]
    found = [form.is_whole(text, float(text)) for text in answers]
    assert np.mean(found) > 0.8
    assert form.is_whole("6123", 6123.0) is False


def test_the_noise_of_a_panel_that_is_off_is_read() -> None:
    form, answers = NumberForm(), ("0.000", "0.003", "-0.001", "0.002", "0.000", "0.001")
    assert [form.is_whole(text, float(text)) for text in answers] == [False] * 3 + [True] * 3


@pytest.mark.parametrize("power", [1e30, -1e30, float("nan"), float("inf")])
@pytest.mark.parametrize("driver", ["scpi", "visa", "board", "hwmon", "ppk2", "of_a_package"])
def test_no_driver_gives_a_power_that_no_panel_takes(driver, power) -> None:
    with pytest.raises(InstrumentError, match="W; what it measures is") as told:
        require_power(driver, "the meter", power)
    assert told.value.fault is Fault.IMPLAUSIBLE
    require_power(driver, "the meter", 4.9)


class Wrong:
    """What is at a wrong port."""

    def __init__(self, answer: bytes = b"", unasked: bytes = b"", every: float = 1.0) -> None:
        self._answer, self._unasked, self._every, self._next = answer, unasked, every, 0.0

    def receive(self, data: bytes) -> bytes:
        return b"" if self._answer == b"-" else self._answer or data

    def stream(self) -> bytes:
        if not self._unasked or time.monotonic() < self._next:
            return b""
        self._next = time.monotonic() + self._every
        return self._unasked


GPS = b"$GPGGA,092751.000,5321.6802,N,00630.3371,W,1,8,1.03,61.7,M,55.3,M,,*75\r\n"
WRONG: dict[str, Callable[[], Any]] = {
    "silent": lambda: Wrong(b"-"),
    "another instrument": lambda: Wrong(b"OK00,   48.1\r\n"),
    "receiver of satellites": lambda: Wrong(b"-", GPS, 0.3),
    "never quiet": lambda: Wrong(b"-", b"0.1234\n", 0.001),
    "sends back": lambda: Wrong(),
}
OPENERS: dict[str, Callable[[Any], Any]] = {
    "scpi": lambda link: ScpiPowerMeter(link.url),
    "visa": lambda link: VisaPowerMeter(f"TCPIP::127.0.0.1::{urlsplit(link.url).port}::SOCKET"),
    "board": lambda link: BoardPowerMeter(link.url),
    "ppk2": lambda link: Ppk2PowerMeter(f"{link.url}?voltage=5.0"),
}


@pytest.fixture
def no_thread_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) <= before


class WokenClock(threading.Thread):
    """Counts how often a thread was woken: a machine that holds up threads holds up this clock as well."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.now, self._ended = 0.0, threading.Event()

    def run(self) -> None:
        while not self._ended.wait(TICK):
            self.now += TICK

    def end(self) -> None:
        self._ended.set()
        self.join()


@pytest.fixture
def clock() -> Iterator[WokenClock]:
    ticking = WokenClock()
    ticking.start()
    yield ticking
    ticking.end()


def told_at(driver: str, wrong: str, clock: WokenClock) -> tuple[float, InstrumentError]:
    """How long it takes to tell that a port is wrong [s], and how it is told."""
    with EmulatedLink(WRONG[wrong](), pseudo_terminal=driver == "ppk2") as link:
        begun = clock.now
        with pytest.raises(InstrumentError) as told:
            OPENERS[driver](link)
        return clock.now - begun, told.value


@pytest.mark.slow
@pytest.mark.usefixtures("no_thread_left")
def test_a_wrong_port_is_told_soon(clock: WokenClock) -> None:
    """With the time-outs that users have, all at once, but for VISA: its sessions end with one another."""
    cases = [
        (driver, wrong) for driver in OPENERS for wrong in WRONG if driver != "visa" or wrong == "silent"
    ]
    with ThreadPoolExecutor(len(cases)) as pool:
        found = dict(zip(cases, pool.map(lambda case: told_at(*case, clock), cases), strict=True))
    assert max(took for took, _ in found.values()) > 0.5  # the clock goes: silence is waited for
    for case, (took, error) in found.items():
        assert took < SOON, case
        assert error.fault in (Fault.NO_REPLY, Fault.GARBLED, Fault.WRONG_INSTRUMENT), case
        assert "\n" not in str(error), case
        if case[1] in ("another instrument", "receiver of satellites"):
            assert error.fault is Fault.WRONG_INSTRUMENT, (case, str(error))


def test_a_port_where_nobody_listens_is_told_at_once(clock: WokenClock) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(InstrumentError):
        ScpiPowerMeter(f"127.0.0.1:{port}")
    assert clock.now < SOON

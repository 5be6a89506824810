"""A monitor over DDC/CI: the library's framing and checksums, our timing, and what monitors do wrong."""

import contextlib
import itertools
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from emulators import ddc_monitor
from emulators.ddc_monitor import EmulatedMonitor, emulated_control
from emulators.link import EmulatedLink, FaultPlan, LinkFault

from evenlight.hardware.drivers.ddc_backlight import (
    BRIGHTNESS,
    COMMAND_INTERVAL,
    REPLY_DELAY,
    DdcBacklight,
    checksum,
)
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError


@contextmanager
def on_the_desk(monitor: EmulatedMonitor, plan: FaultPlan | None = None) -> Iterator[DdcBacklight]:
    with EmulatedLink(monitor, plan) as link, DdcBacklight(7, panel=emulated_control(link.url)) as backlight:
        yield backlight


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait longer for a reply, and still less than for one that is late."""
    monkeypatch.setattr(ddc_monitor, "PATIENCE", 0.5)


@pytest.fixture(autouse=True)
def nothing_stays_open() -> Iterator[None]:
    files, threads = open_files(), threading.active_count()
    yield
    assert (open_files(), threading.active_count()) == (files, threads)


class Listening(EmulatedMonitor):
    """A monitor that notes when each message came, and what it was."""

    def __init__(self, **options: int) -> None:
        super().__init__(**options)
        self.heard: list[tuple[float, bytes]] = []

    def receive(self, data: bytes) -> bytes:
        self.heard.append((time.monotonic(), data))
        return super().receive(data)


def test_a_question_and_its_reply_are_those_that_monitors_have_been_seen_to_exchange() -> None:
    """Brightness 75 of 100: 6E 88 02 00 10 00 00 64 00 4B 8B; the question 51 82 01 10 AC."""
    monitor = EmulatedMonitor()
    monitor.step = 75
    reply = bytes.fromhex("6e 88 02 00 10 00 00 64 00 4b 8b")
    assert monitor.receive(bytes.fromhex("51 82 01 10 ac")) == reply
    assert checksum(reply[:-1]) == reply[-1]


def test_the_nearest_step_is_set_and_told_and_the_monitor_left_as_it_was_found() -> None:
    monitor = EmulatedMonitor()
    monitor.step = 80
    with on_the_desk(monitor) as backlight:
        assert backlight.set_factor(0.503) == 0.5
        assert monitor.step == 50
        assert backlight.read_factor() == 0.5
        assert backlight.step() == backlight.smallest_factor() == 0.01
    assert monitor.step == 80
    backlight.close()


def test_a_monitor_has_as_many_steps_as_it_says() -> None:
    with on_the_desk(EmulatedMonitor(highest=255)) as backlight:
        assert backlight.set_factor(0.2) == 51 / 255
        assert backlight.smallest_factor() == 1 / 255


def test_no_two_messages_come_closer_than_50_ms_though_the_library_would_send_them_at_once() -> None:
    monitor = Listening()
    with on_the_desk(monitor) as backlight:
        begun = time.monotonic()
        for factor in (0.9, 0.8, 0.7):
            backlight.set_factor(factor)
        took = time.monotonic() - begun
        assert took >= 2 * backlight.min_interval()  # from the first to the third
    times = [moment for moment, _ in monitor.heard]
    gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
    assert len(gaps) == 8  # found; three times set and read back; set as it was found, and read back
    assert min(gaps) > COMMAND_INTERVAL - 0.01  # heard by another thread, a little early or late


def test_each_message_waits_for_the_one_before_on_the_clock_handed_in() -> None:
    time_now, waits = [0.0], []

    def wait(seconds: float) -> None:
        waits.append(seconds)
        time_now[0] += seconds

    with EmulatedLink(EmulatedMonitor()) as link:
        control = emulated_control(link.url)
        with DdcBacklight(0, lambda: time_now[0], wait, control) as backlight:
            backlight.set_factor(0.5)
    # After opening, after the question for the brightness, after a setting and after its check, and so again
    # after the setting that leaves it as it was found.
    assert waits == pytest.approx([COMMAND_INTERVAL] * 5)


def test_an_interruption_while_it_is_opened_closes_the_bus(monkeypatch) -> None:
    def interrupted(code: int) -> None:
        raise KeyboardInterrupt

    with EmulatedLink(EmulatedMonitor()) as link:
        control = emulated_control(link.url)
        monkeypatch.setattr(control, "get_vcp_feature", interrupted)
        with pytest.raises(KeyboardInterrupt):
            DdcBacklight(7, panel=control)
        assert control.fd is None  # and nothing stays open, which every test here looks for


def test_a_setting_that_the_monitor_does_not_take_fails_loudly() -> None:
    with (
        on_the_desk(EmulatedMonitor(lowest_taken=30)) as backlight,
        pytest.raises(InstrumentError, match=r"monitor ddc:7: was set to step 20, and says 30; does a power"),
    ):
        backlight.set_factor(0.2)


@pytest.mark.parametrize("factor", [0.0, -0.1, 1.01, float("nan"), 0.001])
def test_a_factor_that_a_monitor_has_not_is_refused_and_nothing_is_sent(factor: float) -> None:
    monitor = Listening()
    with on_the_desk(monitor) as backlight:
        before = len(monitor.heard)
        with pytest.raises(InstrumentError, match=r"monitor ddc:7: has factors from 0\.01 to 1"):
            backlight.set_factor(factor)
        assert len(monitor.heard) == before


def test_a_monitor_without_brightness_says_so_and_stays_closed() -> None:
    with (
        pytest.raises(InstrumentError, match="no brightness that is set over DDC/CI") as refused,
        on_the_desk(EmulatedMonitor(has_brightness=False)),
    ):
        pass
    assert refused.value.fault is Fault.REFUSED
    assert refused.value.code == "Unsupported VCP code"


@pytest.mark.parametrize("fault", list(LinkFault))
@pytest.mark.parametrize("first", [1, 2])
def test_every_fault_of_the_link_is_an_error_and_a_transient_one_passes(fault: LinkFault, first: int) -> None:
    """The first reply is to the constructor's question; the second to the check of a setting."""
    with EmulatedLink(EmulatedMonitor(), FaultPlan(fault, first, delay=1.0)) as link:
        control = emulated_control(link.url)
        if first == 1:
            with pytest.raises(InstrumentError, match="monitor ddc:7") as failed:
                DdcBacklight(7, panel=control)
            assert failed.value.fault in (*TRANSIENT, Fault.DISCONNECTED)
            assert control.fd is None
            return
        backlight = DdcBacklight(7, panel=control)
        with pytest.raises(InstrumentError, match="monitor ddc:7") as failed:
            backlight.set_factor(0.3)
        assert failed.value.fault in (*TRANSIENT, Fault.DISCONNECTED)
        if fault is LinkFault.DISCONNECT:
            for use in (lambda: backlight.set_factor(0.4), backlight.close):
                with pytest.raises(InstrumentError) as gone:
                    use()
                assert gone.value.fault is Fault.DISCONNECTED
                assert control.fd is None
            return
        with backlight:
            assert set_at_last(backlight, 0.4, tries=1 if fault is not LinkFault.LATE_REPLY else 60) == 0.4
            assert backlight.read_factor() == 0.4


def set_at_last(backlight: DdcBacklight, factor: float, tries: int) -> float:
    """The step that is set once what is late has come."""
    for _ in range(tries - 1):
        with contextlib.suppress(InstrumentError):
            return backlight.set_factor(factor)
    return backlight.set_factor(factor)


def test_a_late_reply_is_not_taken_for_the_answer_to_a_later_question() -> None:
    """The brightness changes on the monitor itself after the question whose reply comes late."""
    monitor = EmulatedMonitor()
    with on_the_desk(monitor, FaultPlan(LinkFault.LATE_REPLY, first=2, delay=1.0)) as backlight:
        with pytest.raises(InstrumentError, match="no reply; is it switched on, and is DDC/CI enabled"):
            backlight.read_factor()  # its answer, 100 of 100, is on its way
        monitor.step = 40
        answers: list[float] = []
        end = time.monotonic() + 60
        while len(answers) < 2 and time.monotonic() < end:
            with contextlib.suppress(InstrumentError):
                answers.append(backlight.read_factor())
        assert answers == [0.4, 0.4]


def test_a_reply_whose_checksum_is_wrong_is_no_brightness() -> None:
    class Noisy(EmulatedMonitor):
        def receive(self, data: bytes) -> bytes:
            reply = bytearray(super().receive(data))
            if reply and reply[4] == BRIGHTNESS:
                reply[9] ^= 0x08  # one bit of the brightness
            return bytes(reply)

    with (
        pytest.raises(InstrumentError, match=r"sent what is no reply \(checksum does not match: 8") as failed,
        on_the_desk(Noisy()),
    ):
        pass
    assert failed.value.fault is Fault.GARBLED


def test_a_bus_that_is_not_there_or_may_not_be_opened_is_told_with_what_to_do(monkeypatch) -> None:
    with pytest.raises(InstrumentError, match="ddc:250: no such I2C bus; on Linux load the module") as absent:
        DdcBacklight(250)
    assert absent.value.fault is Fault.NOT_FOUND

    def refuse(path: str, flags: int) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(InstrumentError, match="may not be opened; on Linux, join the group i2c"):
        DdcBacklight(250)


def test_without_its_library_the_extra_to_install_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "monitorcontrol.vcp.vcp_linux", None)
    with pytest.raises(InstrumentError, match=r"pip install '\.\[instruments\]'") as missing:
        DdcBacklight(5)
    assert missing.value.fault is Fault.NOT_FOUND


def test_the_pauses_are_those_that_the_standard_asks_for() -> None:
    """DDC/CI 1.1: 40 ms for the monitor to have its reply ready, 50 ms between two messages."""
    assert (REPLY_DELAY, COMMAND_INTERVAL) == (0.04, 0.05)

"""Triggers over real links: bytes on a pseudo-terminal, markers in the network; and pulses."""

import inspect
import os
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.hardware.driver_table import TRIGGERS
from evenlight.hardware.drivers import serial_trigger
from evenlight.hardware.protocols import Fault, InstrumentError, TriggerOutput
from evenlight.hardware.rig import opened_triggers

ROOT = Path(evenlight.__file__).parents[1]


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """The recorder's end of a serial line, and the name of ours."""
    recorder, ours = os.openpty()
    tty.setraw(recorder)
    yield recorder, os.ttyname(ours)
    for end in (recorder, ours):
        os.close(end)


@pytest.mark.parametrize("name", TRIGGERS)
def test_a_driver_has_the_methods_of_the_protocol(name: str) -> None:
    cls = TRIGGERS[name].load()
    for method in ("send", "apparatus", "close"):
        promised = inspect.signature(getattr(TriggerOutput, method)).parameters
        assert list(inspect.signature(getattr(cls, method)).parameters) == list(promised)


def test_a_serial_trigger_is_one_byte_at_the_baud_rate_asked_for(line: tuple[int, str]) -> None:
    recorder, port = line
    with opened_triggers([f"serial:{port}?baud=57600"]) as (outputs):
        (output,) = outputs.values()
        assert termios.tcgetattr(recorder)[5] == termios.B57600
        took = []
        for code in (1, 2, 255) * 3:
            begun = time.perf_counter()
            output.send(code, "any")
            took.append(time.perf_counter() - begun)
            assert os.read(recorder, 10) == bytes([code])
        assert min(took) < 0.01  # on a busy machine another may take longer
        assert output.apparatus() == {"sends": "one byte at 57600 baud, 8N1"}


class NotingPort:
    """A serial port that notes when its lines go up and down; a pseudo-terminal has no such lines."""

    def __init__(self) -> None:
        self.noted: list[tuple[str, bool, float]] = []

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("rts", "dtr"):
            self.noted.append((name, value, time.monotonic()))
        else:
            super().__setattr__(name, value)

    def close(self) -> None:
        pass


@pytest.mark.parametrize("name", ["rts", "dtr"])
def test_a_line_trigger_is_a_pulse_that_ends_by_itself(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    port = NotingPort()
    monkeypatch.setattr(serial, "serial_for_url", lambda *_, **__: port)
    with opened_triggers([f"{name}:/dev/any?pulse_ms=200"]) as outputs:
        for output in outputs.values():
            output.send(1, "any")
            assert port.noted[-1][1] is True  # the pulse is not waited for
    assert [(line, level) for line, level, _ in port.noted] == [(name, False), (name, True), (name, False)]
    assert 0.2 <= port.noted[2][2] - port.noted[1][2] < 1.0  # ends late on a machine with other things to do


class HandClock:
    """Time as the driver sees it, which passes where the test says, however busy the machine is."""

    def __init__(self) -> None:
        self.now = 1.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


def test_triggers_one_frame_apart_are_two_pulses_however_long_a_pulse_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The second of a flip shares the pulse of the first; the next flip's ends it and has its own in full."""
    port, clock = NotingPort(), HandClock()
    monkeypatch.setattr(serial, "serial_for_url", lambda *_, **__: port)
    monkeypatch.setattr(serial_trigger, "time", clock)
    with opened_triggers(["rts:/dev/any?pulse_ms=150"]) as outputs:
        (output,) = outputs.values()
        output.send(4, "video_offset")
        clock.now += 0.0005
        output.send(7, "question_onset")
        assert len(port.noted) == 2  # the port when it was opened, and the first pulse
        clock.now += 0.0064
        output.send(8, "answer")
        assert clock.now == pytest.approx(1.0069 + 0.001)  # between the end of a pulse and the next
    assert [level for _, level, _ in port.noted] == [False, True, False, True, False]
    assert port.noted[4][2] - port.noted[3][2] >= 0.15


@pytest.mark.parametrize(
    ("names", "error", "says"),
    [
        (
            ["serial:/dev/no_such_port"],
            InstrumentError,
            "the trigger port at /dev/no_such_port: cannot be opened",
        ),
        (
            ["rts:/dev/no_such_port"],
            InstrumentError,
            "the trigger port at /dev/no_such_port: cannot be opened",
        ),
        (
            ["parallel:0x378"],
            InputError,
            "there is no trigger output 'parallel'; there is serial, rts, dtr, lsl",
        ),
        (["serial:/dev/any?speed=9"], InputError, "there is no option 'speed'; there is baud"),
        (["simulated", "simulated"], InputError, "triggers must differ"),
    ],
)
def test_a_device_that_is_not_there_is_refused_in_one_line(
    names: list[str], error: type[Exception], says: str
) -> None:
    with pytest.raises(error) as refused, opened_triggers(names):
        pass
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_cable_that_is_pulled_is_an_error_of_the_next_trigger() -> None:
    recorder, ours = os.openpty()
    with opened_triggers([f"serial:{os.ttyname(ours)}"]) as outputs:
        for end in (recorder, ours):
            os.close(end)
        for output in outputs.values():
            with pytest.raises(InstrumentError, match="the connection broke") as broken:
                output.send(1, "any")
            assert broken.value.fault is Fault.DISCONNECTED
            with pytest.raises(InstrumentError, match="no longer connected"):
                output.send(2, "any")


def test_without_its_library_lsl_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with (
        pytest.raises(InstrumentError, match=r"pip install '\.\[lsl\]'"),
        opened_triggers(["lsl:any"]),
    ):
        pass


INLET = """
import sys, time, pylsl
from evenlight.hardware.rig import opened_triggers

with opened_triggers([f"lsl:{sys.argv[1]}"]) as outputs:
    (stream,) = pylsl.resolve_byprop("name", sys.argv[1], timeout=20)
    inlet = pylsl.StreamInlet(stream)
    inlet.open_stream(timeout=20)
    (output,) = outputs.values()
    for code, label in ((1, "ramp_onset"), (2, "ramp_offset")):
        sent = pylsl.local_clock()
        output.send(code, label)
        (marker,), stamp = inlet.pull_sample(timeout=20)
        print(marker, 0 <= stamp - sent < 0.1, inlet.info().type())
"""


def test_an_inlet_receives_the_labels_as_markers_with_their_times(tmp_path: Path) -> None:
    """Over the loopback of this computer, in a process of its own: the library's threads outlive a stream."""
    pytest.importorskip("pylsl", reason="pylsl is not installed: pip install '.[lsl]'")
    settings = tmp_path / "lsl_api.cfg"
    settings.write_text("[multicast]\nResolveScope = machine\n[ports]\nIPv6 = disable\n")
    done = subprocess.run(
        [sys.executable, "-c", INLET, f"evenlight-test-{os.getpid()}"],
        cwd=ROOT,
        env=os.environ | {"LSLAPICFG": str(settings), "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["ramp_onset True Markers", "ramp_offset True Markers"]

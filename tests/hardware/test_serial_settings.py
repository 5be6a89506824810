"""What each driver sets its serial port to, as the instrument's manual has it: observed at pyserial."""

import re
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import serial
from emulators.link import EmulatedLink
from emulators.ours import OURS, LinkKind, open_at
from emulators.power_board import PowerBoardEmulator

from evenlight.hardware.driver_table import BACKLIGHTS, LUMINANCE_METERS, POWER_METERS
from evenlight.hardware.drivers.serial_link import SerialLink
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation


@dataclass(frozen=True)
class SerialLine:
    """How an instrument talks; None where its library, and not a driver of ours, frames what is sent."""

    baud_rate: int
    data_bits: int
    parity: str
    stop_bits: int
    sent_end: bytes | None
    received_end: bytes | None


MINOLTA = SerialLine(4800, 7, "E", 2, b"\r\n", b"\r\n")
BOARD = SerialLine(115200, 8, "N", 1, b"\n", b"\n")
# None of them has flow control.
LINES = {
    "ls100": MINOLTA,  # psychopy-minolta, hrl; the manual was not available
    "ls110": MINOLTA,  # as the LS-100
    "cs100a": MINOLTA,  # CS-100A manual p. 6
    # psychopy-photoresearch and Psychtoolbox's PR655Toolbox: no handshake; CR ends a command in Psychtoolbox
    "pr655": SerialLine(9600, 8, "N", 1, b"\r", b"\r\n"),
    "pr670": SerialLine(9600, 8, "N", 1, b"\r", b"\r\n"),
    "pr650": SerialLine(9600, 8, "N", 1, b"\n", b"\r\n"),  # psychopy-photoresearch: LF ends a command
    "colorcal": SerialLine(115200, 8, "N", 1, b"\n", b"\n\r"),  # psychopy-crs; USB takes any rate
    "board": BOARD,  # docs/power-board.md, "The lines"
    "ppk2": SerialLine(9600, 8, "N", 1, None, None),  # ppk2-api 0.9.2; USB takes any rate
}
DRIVERS = [each for each in OURS if OURS[each].link is not LinkKind.OWN]
NOT_SERIAL = {"scpi", "visa", "ddc", "exec"}  # PyVISA's resources, an I2C bus, a program


def simulation() -> Simulation:
    panel = SimulatedPanel(PanelPhysics(warm_up_share=0.0), time.monotonic)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(5), time.monotonic, time.sleep)


class Listener:
    """An emulated instrument, and all that was sent to it."""

    def __init__(self, kind: InstrumentKind, name: str) -> None:
        self._emulator = OURS[kind, name].emulator(simulation())
        self.sent = b""

    def receive(self, data: bytes) -> bytes:
        self.sent += data
        answer: bytes = self._emulator.receive(data)
        return answer

    def stream(self) -> bytes:
        streamed: bytes = self._emulator.stream()
        return streamed


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), DRIVERS, ids=lambda one: getattr(one, "name", one))
def test_a_port_is_opened_as_the_manual_says(
    kind: InstrumentKind, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Any] = []
    ends: set[bytes] = set()
    create, read_until = serial.SerialBase.__init__, SerialLink.read_until

    def recorded(port: Any, *arguments: Any, **settings: Any) -> None:
        create(port, *arguments, **settings)
        opened.append(port)

    def told(link: SerialLink, end: bytes, timeout: float | None = None) -> bytes:
        ends.add(end)
        return read_until(link, end, timeout)

    monkeypatch.setattr(serial.SerialBase, "__init__", recorded)
    monkeypatch.setattr(SerialLink, "read_until", told)
    listener = Listener(kind, name)
    with (
        EmulatedLink(listener, pseudo_terminal=OURS[kind, name].link is LinkKind.TERMINAL) as link,
        open_at(kind, name, link.url, time.monotonic),
    ):
        if name in NOT_SERIAL:
            assert opened == []
            return
        (port,) = opened
        line, settings = LINES[name], port.get_settings()
    assert (settings["baudrate"], settings["bytesize"]) == (line.baud_rate, line.data_bits)
    assert (settings["parity"], settings["stopbits"]) == (line.parity, line.stop_bits)
    assert [settings[control] for control in ("xonxoff", "rtscts", "dsrdtr")] == [False] * 3
    if line.sent_end is not None:
        assert set(re.findall(rb"[\r\n]+", listener.sent)) == {line.sent_end}
        assert ends - {b"REMOTE MODE"} == {line.received_end}


def test_what_users_read_of_a_serial_line_is_what_the_driver_sets() -> None:
    """Where `measure list` gives a rate at all: USB that looks serial takes any."""
    for name in ("ls100", "ls110", "cs100a"):
        assert LUMINANCE_METERS[name].settings.startswith("4800 baud, 7 data bits, even parity, 2 stop bits")
    for name in ("pr650", "pr655", "pr670"):
        assert LUMINANCE_METERS[name].settings.startswith("9600 baud, 8N1")
    for board in (POWER_METERS["board"], BACKLIGHTS["board"]):
        assert board.settings.startswith("115200 8N1")
    assert "9600 8N1" in POWER_METERS["scpi"].settings


def test_another_rate_of_a_board_reaches_the_port(monkeypatch: pytest.MonkeyPatch) -> None:
    """docs/power-board.md: `board:PORT?baud=921600`."""
    rates: list[int] = []
    open_url = serial.serial_for_url

    def recorded(url: str, **settings: Any) -> Any:
        rates.append(settings["baudrate"])
        return open_url(url, **settings)

    monkeypatch.setattr(serial, "serial_for_url", recorded)
    driver = POWER_METERS["board"]
    with (
        EmulatedLink(PowerBoardEmulator(simulation()), pseudo_terminal=True) as link,
        driver.load()(f"{link.url}?baud=921600"),
    ):
        assert rates == [921600]

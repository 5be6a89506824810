"""Parity of a line of seven bits: checked by the port itself, or here where it is handed over."""

import termios
from collections.abc import Callable

import pytest
import serial
from emulators.link import EmulatedLink

from evenlight.hardware.drivers.konica_minolta import Cs100a, Ls100
from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.protocols import Fault, InstrumentError, Reading

READING = b"OK00,  123.4\r\n"


def with_parity(sent: bytes) -> bytes:
    """Seven bits, with an eighth that makes the number of ones even."""
    return bytes(byte | (bin(byte).count("1") % 2) << 7 for byte in sent)


class Handed:
    """An LS-100 on a port that hands over eight bits; its reading is what it is told to be."""

    def __init__(self, reading: bytes, coded: Callable[[bytes], bytes] = with_parity) -> None:
        self._reading, self._coded = reading, coded

    def receive(self, data: bytes) -> bytes:
        return self._reading if b"MES" in data else self._coded(b"OK00\r\n")

    def stream(self) -> bytes:
        return b""


def read(reading: bytes, *, terminal: bool) -> float:
    with (
        EmulatedLink(Handed(reading), pseudo_terminal=terminal) as link,
        Ls100(link.url, timeout=30.0) as meter,
    ):
        return meter.read_luminance().value


@pytest.mark.parametrize("terminal", [True, False])
def test_bytes_with_their_parity_on_top_are_read(terminal: bool) -> None:
    assert read(with_parity(READING), terminal=terminal) == 123.4


@pytest.mark.parametrize("terminal", [True, False])
def test_a_flipped_bit_is_told_by_its_parity_and_not_read(terminal: bool) -> None:
    """1 is 0110001, 3 is 0110011: one bit makes 323.4 of 123.4."""
    whole = with_parity(READING)
    place = READING.index(b"1")
    flipped = whole[:place] + bytes([whole[place] ^ 0b10]) + whole[place + 1 :]
    assert bytes(byte & 0x7F for byte in flipped) == b"OK00,  323.4\r\n"
    with pytest.raises(InstrumentError, match=r"wrong parity in .*323\.4") as refused:
        read(flipped, terminal=terminal)
    assert refused.value.fault is Fault.GARBLED


def test_every_single_flipped_bit_of_a_cs100as_reading_is_told() -> None:
    """Whichever of its 28 times 8; a bit of parity alone changes no number, and may pass."""
    sent = b"OK00,  123.4, .3120, .3290\r\n"
    whole = with_parity(sent)
    replies = [
        whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :]
        for place in range(len(whole))
        for bit in range(8)
    ]

    class Flipping(Handed):
        n = 0

        def receive(self, data: bytes) -> bytes:
            return replies[self.n] if b"MES" in data else super().receive(data)

    instrument = Flipping(b"")
    found: list[Reading | InstrumentError] = []
    with EmulatedLink(instrument) as link, Cs100a(link.url, timeout=0.15) as meter:
        for instrument.n in range(0, len(replies), 13):  # each bit in turn: 13 and 8 have no common factor
            try:
                found.append(meter.read_luminance())
            except InstrumentError as error:
                found.append(error)
    readings = [one for one in found if isinstance(one, Reading)]
    assert {(reading.value, reading.chromaticity) for reading in readings} <= {(123.4, (0.312, 0.329))}
    assert len(found) - len(readings) > 10
    assert {one.fault for one in found if isinstance(one, InstrumentError)} <= {Fault.GARBLED, Fault.NO_REPLY}


def test_a_line_without_an_eighth_bit_is_read_as_it_is() -> None:
    """As a port hands it over that checks parity itself."""
    with EmulatedLink(Handed(READING, bytes)) as link, Ls100(link.url, timeout=30.0) as meter:
        assert meter.read_luminance().value == 123.4


def test_a_byte_that_a_port_has_found_wrong_comes_as_nul_and_is_refused() -> None:
    """What a terminal with INPCK and without PARMRK hands over (termios(3))."""
    with (
        EmulatedLink(Handed(b"OK00,  \x0023.4\r\n", bytes)) as link,
        Ls100(link.url, timeout=30.0) as meter,
        pytest.raises(InstrumentError, match="wrong parity"),
    ):
        meter.read_luminance()


@pytest.mark.parametrize(("parity", "checked"), [("E", True), ("O", True), ("N", False)])
def test_parity_is_switched_on_in_the_driver_of_a_terminal(
    parity: str, checked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """pyserial switches it off whenever it sets up a port. A pseudo-terminal keeps the flag."""
    ports: list[serial.Serial] = []
    open_url = serial.serial_for_url

    def kept(url: str, **settings: object) -> serial.Serial:
        ports.append(open_url(url, **settings))
        return ports[-1]

    monkeypatch.setattr(serial, "serial_for_url", kept)
    with EmulatedLink(Handed(READING), pseudo_terminal=True) as link:
        data_bits = 8 if parity == "N" else 7
        opened = SerialLink(link.url, LineSettings(data_bits=data_bits, parity=parity), "a meter")
        input_flags = termios.tcgetattr(ports[0].fileno())[0]
        opened.close()
    assert bool(input_flags & termios.INPCK) is checked
    if checked:
        assert not input_flags & (termios.IGNPAR | termios.PARMRK)  # a wrong byte becomes NUL

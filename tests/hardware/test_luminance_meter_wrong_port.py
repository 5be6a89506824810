"""A port where another device is, or none, is told within 5 s, whichever luminance meter was named."""

import time
from collections.abc import Callable

import pytest

from evenlight.hardware.drivers import serial_link, serial_meter
from evenlight.hardware.drivers.colorcal import ColorCal
from evenlight.hardware.drivers.konica_minolta import Ls100
from evenlight.hardware.drivers.photo_research import Pr650, Pr655
from evenlight.hardware.drivers.serial_meter import SerialMeter
from evenlight.hardware.emulators.link import EmulatedLink
from evenlight.hardware.protocols import Fault, InstrumentError

LONGEST = 5.0  # [s]
SPEED = 20  # times as fast as in real time go the limits of the opening, and nothing else
DRIVERS = (Ls100, Pr655, Pr650, ColorCal)  # the others open as one of these does
GPS = (
    b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\r\n"  # NMEA 0183, once a second
)


class Device:
    """What answers, and what comes by itself, each so often [s]."""

    def __init__(self, answer: Callable[[bytes], bytes], chatter: bytes = b"", every: float = 1.0) -> None:
        self._answer, self._chatter, self._every = answer, chatter, every
        self._next = time.monotonic()

    def receive(self, data: bytes) -> bytes:
        return self._answer(data)

    def stream(self) -> bytes:
        if not self._chatter or time.monotonic() < self._next:
            return b""
        self._next = time.monotonic() + self._every
        return self._chatter


def nothing(_: bytes) -> bytes:
    return b""


def echo(data: bytes) -> bytes:
    """A modem: it echoes, and knows no command."""
    return data + (b"\r\nERROR\r\n" if b"\r" in data or b"\n" in data else b"")


DEVICES: dict[str, Callable[[], Device]] = {
    "nothing": lambda: Device(nothing),
    "GPS": lambda: Device(nothing, GPS, 1.0 / SPEED),
    "modem": lambda: Device(echo),
    "never silent": lambda: Device(nothing, b"\x00\xffU" * 20, 0.0),
    "lines without end": lambda: Device(nothing, b"12.3\r\n" * 10, 0.0),
    "another instrument": lambda: Device(lambda _: b"*IDN? UNKNOWN\n"),
}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """What limits the opening, and is below 5 s in all."""
    assert serial_meter.OPENING_TIME + serial_link.LONGEST_BURST <= LONGEST
    monkeypatch.setattr(serial_meter, "OPENING_TIME", serial_meter.OPENING_TIME / SPEED)
    monkeypatch.setattr(serial_link, "LONGEST_BURST", serial_link.LONGEST_BURST / SPEED)
    monkeypatch.setattr("evenlight.hardware.drivers.photo_research.BETWEEN_CHARACTERS", 0.0025)
    monkeypatch.setattr("evenlight.hardware.drivers.photo_research.ENTERING_TIME", 0.075)


@pytest.mark.parametrize("device", DEVICES)
def test_a_wrong_port_is_told_in_time_though_a_measurement_may_take_a_minute(device: str) -> None:
    for driver in DRIVERS:
        options = {"interval": 0.0025} if issubclass(driver, Pr655) else {}
        with EmulatedLink(DEVICES[device]()) as link:
            begun = time.monotonic()
            with pytest.raises(InstrumentError) as refused:
                driver(link.url, **options)
            took = time.monotonic() - begun
        assert took < LONGEST / SPEED + 1.0, (driver, took)  # and what a busy machine adds
        assert refused.value.fault in (Fault.NO_REPLY, Fault.GARBLED, Fault.WRONG_INSTRUMENT)
        assert link.url in str(refused.value)


def test_the_limits_are_those_of_opening_and_not_of_a_measurement() -> None:
    """Whose time-outs stay as long as the instruments need."""
    for driver in DRIVERS:
        assert issubclass(driver, SerialMeter)
        assert driver.line.timeout >= 10.0

"""A port where another device is, or none, is told within 5 s, whichever luminance meter was named."""

from collections.abc import Callable

import pytest

from evenlight.hardware.drivers import serial_link, serial_meter
from evenlight.hardware.drivers.colorcal import ColorCal
from evenlight.hardware.drivers.konica_minolta import Ls100
from evenlight.hardware.drivers.photo_research import Pr650, Pr655
from evenlight.hardware.drivers.serial_meter import SerialMeter
from evenlight.hardware.protocols import Fault, InstrumentError

LONGEST = 5.0  # [s]
PORT = "/dev/ttyUSB7"
LOOK = 0.0005  # [s] that one look at the port takes
DRIVERS = (Ls100, Pr655, Pr650, ColorCal)  # the others open as one of these does
GPS = (
    b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\r\n"  # NMEA 0183, once a second
)


class Clock:
    """Goes on when somebody waits, and not otherwise: how busy the machine is makes no difference."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class Port:
    """A serial port with a device behind it: what it answers, and what comes by itself, each so often [s]."""

    def __init__(
        self, clock: Clock, answer: Callable[[bytes], bytes], chatter: bytes = b"", every: float = 1.0
    ) -> None:
        self._clock, self._answer, self._chatter, self._every = clock, answer, chatter, every
        self._next, self._came, self.is_open = clock.now, b"", True

    def write(self, data: bytes) -> None:
        self._came += self._answer(data)

    def read(self, _: int) -> bytes:
        self._clock.now += LOOK
        if self._chatter and self._clock.now >= self._next:
            self._next = self._clock.now + self._every
            self._came += self._chatter
        came, self._came = self._came, b""
        return came

    def flush(self) -> None:
        pass

    def close(self) -> None:
        self.is_open = False


def nothing(_: bytes) -> bytes:
    return b""


def echo(data: bytes) -> bytes:
    """A modem: it echoes, and knows no command."""
    return data + (b"\r\nERROR\r\n" if b"\r" in data or b"\n" in data else b"")


DEVICES: dict[str, Callable[[Clock], Port]] = {
    "nothing": lambda clock: Port(clock, nothing),
    "GPS": lambda clock: Port(clock, nothing, GPS),
    "modem": lambda clock: Port(clock, echo),
    "never silent": lambda clock: Port(clock, nothing, b"\x00\xffU" * 20, 0.0),
    "lines without end": lambda clock: Port(clock, nothing, b"12.3\r\n" * 10, 0.0),
    "another instrument": lambda clock: Port(clock, lambda _: b"*IDN? UNKNOWN\n"),
}


@pytest.mark.parametrize("driver", DRIVERS, ids=lambda driver: driver.__name__)
@pytest.mark.parametrize("device", DEVICES)
def test_a_wrong_port_is_told_in_time_though_a_measurement_may_take_a_minute(
    device: str, driver: type[SerialMeter], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    port = DEVICES[device](clock)
    for module in (serial_link, serial_meter):
        monkeypatch.setattr(module, "time", clock)
    monkeypatch.setattr(serial_link, "_open", lambda url, settings, name: port)
    begun = clock.now
    with pytest.raises(InstrumentError) as refused:
        driver(PORT)
    assert 0 < clock.now - begun <= LONGEST
    assert refused.value.fault in (Fault.NO_REPLY, Fault.GARBLED, Fault.WRONG_INSTRUMENT)
    assert PORT in str(refused.value)
    assert not port.is_open


def test_the_limits_are_those_of_opening_and_not_of_a_measurement() -> None:
    """Whose time-outs stay as long as the instruments need."""
    for driver in DRIVERS:
        assert issubclass(driver, SerialMeter)
        assert driver.longest >= 10.0

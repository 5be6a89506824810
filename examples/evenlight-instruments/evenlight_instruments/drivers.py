"""A luminance meter, a power meter and a lamp, each with what Evenlight is told of it.

The protocols are evenlight.LuminanceMeter, PowerMeter and Backlight. A driver is made of an address, a clock
[s] and the time that an answer may take [s]; it opens the instrument, or raises InstrumentError.
"""

from collections.abc import Callable, Sequence
from typing import Any

from evenlight import (
    ClockPing,
    ContextDevice,
    Driver,
    Fault,
    InstrumentError,
    PowerSample,
    Reading,
    restore_and_release,
)
from evenlight_instruments.emulated import emulated
from evenlight_instruments.line import NumberedLine

LOWEST_RATE, HIGHEST_RATE = 1.0, 50.0  # [Hz]


class Instrument(ContextDevice):
    """What the three share: the line, and the refusal to work when closed."""

    def __init__(self, address: str, clock: Callable[[], float], timeout: float | None = None) -> None:
        self._line, self._clock = NumberedLine(address, type(self).__name__.lower(), timeout), clock
        self._name = self._line.name  # as messages name it
        try:
            self._serial_number = f"{self._ask('S?'):.0f}"
            self._begin()
        except BaseException:
            self._line.close()
            raise

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself."""
        return {"model": f"example {type(self).__name__.lower()}", "serial_number": self._serial_number}

    def close(self) -> None:
        """Let go of the instrument; more than once does nothing."""
        self._closed = True
        self._line.close()

    def _begin(self) -> None:
        """Get the instrument ready."""

    def _ask(self, command: str) -> float:
        """Return the answer to a command."""
        self._require_open()
        return self._line.ask(command)


class Spot(Instrument):
    """The luminance meter."""

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]."""
        begun = self._clock()
        luminance = self._ask("L?")
        return Reading(luminance, "cd/m^2", begun, self._clock())


class Watt(Instrument):
    """The power meter, which is asked for each sample."""

    _period = 0.0  # [s] 0 where it does not sample

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return it."""
        self._require_open()
        if not LOWEST_RATE <= rate <= HIGHEST_RATE:
            raise InstrumentError(f"{self._name}: samples at 1 to 50 Hz, got {rate:g} Hz", Fault.REFUSED)
        self._period, self._due, self._count = 1 / rate, self._clock(), 0
        return rate

    def samples(self) -> Sequence[PowerSample]:
        """Return a sample if one is due."""
        self._require_open()
        if not self._period:
            raise InstrumentError(f"{self._name}: is not sampling; start it first", Fault.REFUSED)
        asked = self._clock()
        if asked < self._due:
            return []
        self._due = max(self._due + self._period, asked)
        power, came = self._ask("W?"), self._clock()
        self._count += 1
        return [PowerSample(self._count - 1, (asked + came) / 2, came, power)]

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling; no sample waits to be taken."""
        self._period = 0.0
        return []

    def ping(self) -> ClockPing | None:
        """Return None: the samples carry the computer's own time."""
        return None


class Lamp(Instrument):
    """The backlight, in 200 steps."""

    STEPS = 200

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor, and return the one achieved."""
        self._require_open()
        if not 1 / self.STEPS <= factor <= 1:
            raise InstrumentError(f"{self._name}: has factors from 0.005 to 1, got {factor:g}", Fault.REFUSED)
        return self._set(round(factor * self.STEPS))

    def read_factor(self) -> float:
        """Return the brightness factor that it reports."""
        return self._ask("B?") / self.STEPS

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return 1 / self.STEPS

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return 1 / self.STEPS

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return 0.02

    def close(self) -> None:
        """Leave the lamp as it was found; more than once does nothing."""
        if not self._closed:
            self._closed = True
            restore_and_release(lambda: self._set(self._found), self._line.close)

    def _begin(self) -> None:
        """Remember how it was found."""
        self._found = round(self._ask("B?"))

    def _set(self, step: int) -> float:
        """Set a step, and return the factor that the lamp says it has."""
        taken = self._line.ask(f"B {step}")
        if taken != step:
            raise InstrumentError(f"{self._name}: was set to step {step}, and says {taken:g}")
        return taken / self.STEPS


TRIED_ON: dict[str, Any] = {"emulator": emulated}
SPOT = Driver(Spot, "example spot meter", "example-spot:PORT", "115200 8N1", **TRIED_ON)
WATT = Driver(Watt, "example power meter", "example-watt:PORT", "115200 8N1; 1 to 50 Hz", **TRIED_ON)
LAMP = Driver(Lamp, "example lamp", "example-lamp:PORT", "115200 8N1; 200 steps", **TRIED_ON)

"""Devices of packages and programs: what they return is checked, and whatever they raise is told in one line.

Our own drivers are trusted, and tested. Of another's nothing is known but its protocol: a reading that is
none, a number that cannot be and any exception become an `InstrumentError` that names driver and package.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from numbers import Real
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.backlights import restore_and_release
from evenlight.hardware.driver import NamedDriver
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.plausibility import require_luminance, require_power
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError, Reading

FASTEST = 1e6  # [Hz] no power meter sends more samples
ROUNDING = 1e-9  # of a factor that was computed


class GuardedDevice(ContextDevice):
    """A device of a package, of any kind.

    Parameters
    ----------
    named : NamedDriver
        What its name says.
    opener : callable
        Opens it.

    Attributes
    ----------
    link : ExitStack
        What is closed after the driver: the link to an emulated instrument.

    Raises
    ------
    InstrumentError
        If it cannot be opened, whatever its driver raises.
    """

    def __init__(self, named: NamedDriver, opener: Callable[[], Any]) -> None:
        self._driver = named.name
        package = named.driver.package
        self._note = {"driver": f"{named.name}, driver of the package {package}"} if package else {}
        if named.emulated:
            self._note["instrument"] = "SIMULATED: the driver on an emulated instrument"
        self._name = f"{named.name}{named.address and ':'}{textwrap.shorten(named.address, 80)}"
        self._name += f" (driver of the package {package})" if package else ""
        with self._told():
            self._inner = opener()
        self.link = ExitStack()

    def unguarded(self) -> Any:
        """Return the driver itself, for the test of conformance."""
        return self._inner

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself, and whose driver it is."""
        with self._told():
            said = self._inner.apparatus()
        if not isinstance(said, Mapping):
            raise self._wrong("its apparatus", "a dictionary of words", said)
        return {str(key): str(words) for key, words in said.items()} | self._note

    def close(self) -> None:
        """Let go of the device, which is left as it was found; more than once does nothing."""
        if not self._closed:
            self._closed = True
            restore_and_release(self._close_inner, self.link.close)

    def _close_inner(self) -> None:
        with self._told():
            self._inner.close()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turn whatever a driver raises into one line."""
        try:
            yield
        except (InstrumentError, InputError):
            raise
        except (Exception, SystemExit) as error:
            words = " ".join(str(error).split())
            raise self._error(f"{type(error).__name__}: {words}") from error

    def _called(self, method: str, *arguments: Any) -> Any:
        self._require_open()
        with self._told():
            return getattr(self._inner, method)(*arguments)

    def _number(self, what: str, value: Any) -> float:
        """Return a number that the driver gave, if it is one; nan and inf are told apart by who asks."""
        if isinstance(value, bool) or not isinstance(value, Real):
            raise self._wrong(what, "a number", value)
        try:
            return float(value)
        except OverflowError:
            return math.inf

    def _finite(self, what: str, value: Any) -> float:
        number = self._number(what, value)
        if not math.isfinite(number):
            raise self._wrong(what, "a finite number", number)
        return number

    def _wrong(self, what: str, expected: str, value: object) -> InstrumentError:
        return self._error(f"{what} must be {expected}, got {value!r:.60}")


class GuardedLuminanceMeter(GuardedDevice):
    """A luminance meter of a package."""

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]."""
        found = self._called("read_luminance")
        if not isinstance(found, Reading) or found.unit != "cd/m^2":
            raise self._wrong("a reading", "an evenlight.Reading in 'cd/m^2'", found)
        value = self._number("a luminance", found.value)
        begun, ended = self._finite("begun", found.begun), self._finite("ended", found.ended)
        if begun > ended:
            raise self._wrong("the times of a reading", "begun <= ended", (begun, ended))
        x_y = found.chromaticity
        if x_y is not None:
            if not isinstance(x_y, Sequence) or len(x_y) != 2:
                raise self._wrong("a chromaticity", "CIE 1931 x and y, or None", x_y)
            x_y = (self._number("x", x_y[0]), self._number("y", x_y[1]))
        require_luminance(self._driver, self._name, value, x_y)
        return Reading(value, "cd/m^2", begun, ended, str(found.status), x_y)

    def zero(self) -> float | None:
        """Set the zero, of a driver that does."""
        found = self._called("zero")
        return None if found is None else self._finite("the zero", found)


class GuardedPowerMeter(GuardedDevice):
    """A power meter of a package."""

    _last: PowerSample | None = None  # since the start

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved."""
        achieved = self._number("the rate achieved", self._called("start", rate))
        if not 0 < achieved <= FASTEST:
            raise self._wrong("the rate achieved", f"above 0 Hz, and {FASTEST:g} Hz at most", achieved)
        self._last = None
        return achieved

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order."""
        return self._checked(self._called("samples"))

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        return self._checked(self._called("stop"))

    def ping(self) -> ClockPing | None:
        """Return one comparison of the instrument's clock with the computer's."""
        found = self._called("ping")
        if found is not None and not isinstance(found, ClockPing):
            raise self._wrong("a comparison of clocks", "an evenlight.ClockPing or None", found)
        return found

    zero = GuardedLuminanceMeter.zero

    def _checked(self, samples: Any) -> list[PowerSample]:
        if not isinstance(samples, Sequence):
            raise self._wrong("samples", "a sequence of evenlight.PowerSample", samples)
        for sample in samples:
            if not isinstance(sample, PowerSample):
                raise self._wrong("a sample", "an evenlight.PowerSample", sample)
            require_power(self._driver, self._name, self._number("a power", sample.power))
            last, self._last = self._last or sample, sample
            times = self._finite("a time", last.device_time), self._finite("a time", sample.device_time)
            if sample.sequence < last.sequence or times[1] < times[0]:
                what = f"sample {sample.sequence} at {times[1]:g} s after {last.sequence} at {times[0]:g} s"
                raise self._error(f"its samples go back: {what}", Fault.GARBLED)
        return list(samples)


class GuardedBacklight(GuardedDevice):
    """A backlight of a package."""

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved."""
        achieved = self._share("the factor achieved", self._called("set_factor", factor))
        if abs(achieved - factor) > self.step() + ROUNDING:
            raise self._error(f"was set to {factor:.4g}, and says {achieved:.4g}")
        return achieved

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        return self._share("the factor that it reports", self._called("read_factor"))

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return self._share("the smallest factor", self._called("smallest_factor"))

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return self._share("the step", self._called("step"))

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        interval = self._number("the shortest interval", self._called("min_interval"))
        if not 0 <= interval < math.inf:
            raise self._wrong("the shortest interval", "0 s or more", interval)
        return interval

    def _share(self, what: str, value: Any) -> float:
        share = self._number(what, value)
        if not 0 <= share <= 1:
            fault = Fault.IMPLAUSIBLE
            raise self._error(f"{what} must lie between 0 and 1, got {share:g}", fault)
        return share


GUARDS: dict[InstrumentKind, type[GuardedDevice]] = {
    InstrumentKind.LUMINANCE: GuardedLuminanceMeter,
    InstrumentKind.POWER: GuardedPowerMeter,
    InstrumentKind.BACKLIGHT: GuardedBacklight,
}

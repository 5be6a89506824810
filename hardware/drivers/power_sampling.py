"""What drivers of power meters share: when they sample, at which rates, and the options of an address."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.protocols import ContextDevice, InstrumentError

ROUNDING = 1e-6  # of a period, in a clock that adds up
BACKWARDS = -0.05  # [W] further below zero than any zero error of a meter for panels
RATE_ROUNDING = 1e-9  # of a rate that was computed


class SamplingMeter(ContextDevice):
    """A power meter that has samples to give between `start` and `stop`."""

    def ping(self) -> ClockPing | None:
        """Return None: the samples carry the computer's own time, or are counted from it."""
        self._require_open()
        return None

    def _require_sampling(self, *, is_sampling: bool) -> None:
        self._require_open()
        if not is_sampling:
            raise InstrumentError(f"{self._name}: is not sampling; start it first")

    def _require_forwards(self, power: float, cure: str) -> None:
        """Refuse a power [W] further below zero than any zero error."""
        if power < BACKWARDS:
            raise InstrumentError(
                f"{self._name}: the power is {power:.3f} W, so the current flows backwards; {cure}"
            )


class PolledSampling:
    """The times and the count of an instrument's samples that the computer asks for one by one.

    A value that is asked for late makes the distance to the one before longer; none is made up, and none is
    lost: the count is of values that were read.
    """

    def __init__(self) -> None:
        self._period, self._due, self._count = 0.0, 0.0, 0
        self.is_running = False

    def begin(self, rate: float, now: float) -> None:
        """Begin to ask at a rate [Hz], the first time now [s]."""
        self._period, self._due, self._count = 1 / rate, now, 0
        self.is_running = True

    def end(self) -> None:
        """Ask no more."""
        self.is_running = False

    def is_due(self, now: float) -> bool:
        """Return whether the next value is to be asked for, and count on from there if it is."""
        if now < self._due - ROUNDING * self._period:
            return False
        self._due += self._period
        if self._due <= now:  # what was missed is not made up for in a rush
            self._due = now + self._period
        return True

    def sample(self, power: float, sent: float, received: float) -> PowerSample:
        """Return the sample of a value that was asked for and came at two times of the computer [s].

        The instrument measured somewhere between the two; their middle stands for it.
        """
        self._count += 1
        return PowerSample(self._count - 1, (sent + received) / 2, received, power)


class PolledMeter(SamplingMeter):
    """A power meter that the computer reads whenever a value is due; its samples carry the computer's time.

    Parameters
    ----------
    name : str
        The device, as messages have it.
    clock : callable
        The computer's clock [s].
    rates : tuple of float
        Lowest and highest rate at which it may be read [Hz].
    why : str
        What explains the highest rate, for the message where more is asked for.

    Raises
    ------
    InstrumentError
        If it cannot be read now.
    """

    def __init__(self, name: str, clock: Callable[[], float], rates: tuple[float, float], why: str) -> None:
        self._name, self._clock, self._rates, self._why = name, clock, rates, why
        self._sampling = PolledSampling()
        self._read_power()

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return it.

        Raises
        ------
        InstrumentError
            If the device has no new value that often.
        """
        self._require_open()
        require_sample_rate(rate, *self._rates, self._name + self._why)
        self._sampling.begin(rate, self._clock())
        return rate

    def samples(self) -> Sequence[PowerSample]:
        """Return a sample if one is due.

        Raises
        ------
        InstrumentError
            If the device cannot be read, or its power is no measurement.
        """
        self._require_sampling(is_sampling=self._sampling.is_running)
        sent = self._clock()
        if not self._sampling.is_due(sent):
            return []
        power = self._read_power()
        return [self._sampling.sample(power, sent, self._clock())]

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling; no sample waits to be taken."""
        self._sampling.end()
        return []

    def close(self) -> None:
        """Let go of the device; more than once does nothing."""
        self._sampling.end()
        super().close()

    @abstractmethod
    def _read_power(self) -> float:
        """Return the power now [W]."""


def require_sample_rate(rate: float, lowest: float, highest: float, device: str) -> None:
    """Refuse a sample rate that a power meter does not have; nothing is clipped.

    Parameters
    ----------
    rate : float
        What was asked for [Hz].
    lowest, highest : float
        What there is [Hz].
    device : str
        The instrument, as messages name it.

    >>> require_sample_rate(100.0, 1.0, 1000.0, "the meter")
    """
    if not lowest * (1 - RATE_ROUNDING) <= rate <= highest * (1 + RATE_ROUNDING):
        raise InstrumentError(f"{device}: samples at {lowest:g} to {highest:g} Hz, got {rate:g} Hz")


def split_address(address: str, driver: str, options: Mapping[str, str]) -> tuple[str, dict[str, float]]:
    """Return an address and the numbers above 0 that were said with it; as `split_words`.

    >>> split_address("/dev/ttyACM0?voltage=5.0", "ppk2", {"voltage": "the supply's [V]"})
    ('/dev/ttyACM0', {'voltage': 5.0})
    """
    place, said = split_words(address, driver, options)
    return place, {name: positive(text, f"{driver}:{address}: {name}") for name, text in said.items()}


def split_words(address: str, driver: str, options: Mapping[str, str]) -> tuple[str, dict[str, str]]:
    """Return an address and the words that were said with it.

    Parameters
    ----------
    address : str
        Without the driver's name.
    driver : str
        Its name, as messages have it.
    options : mapping of str to str
        What may be said, and what it is, in words.

    Raises
    ------
    InputError
        If something else is said, or there is no address.
    """
    place, _, said = address.partition("?")
    given = f"{driver}:{address}"
    if not place:
        raise InputError(f"{given}: names no instrument; `evenlight measure list` shows what there is")
    words: dict[str, str] = {}
    for part in filter(None, said.split("&")):
        name, _, text = part.partition("=")
        if name not in options:
            known = ", ".join(f"{key} ({meaning})" for key, meaning in options.items()) or "none"
            raise InputError(f"{given}: there is no option {name!r}; there is {known}")
        words[name] = text
    return place, words


def positive(text: str, what: str) -> float:
    """Return a number above 0 that was written as text."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise InputError(f"{what} must be a number above 0, got {text!r}")
    return number

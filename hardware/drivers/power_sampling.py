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
    """A power meter that has samples to give between `start` and `stop`; each driver says which."""

    _rates: tuple[float, float]  # lowest and highest that it has [Hz]
    _why = ""  # what explains them, after the device's name in the message where another is asked for
    _sampling = False

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved: the nearest that the instrument has.

        Raises
        ------
        InstrumentError
            If the rate is outside what the instrument has, or it refuses.
        """
        self._require_open()
        require_sample_rate(rate, *self._rates, self._name + self._why)
        achieved = self._begin(rate)
        self._sampling = True
        return achieved

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once.

        Raises
        ------
        InstrumentError
            OVER_RANGE where the instrument could not measure; NO_REPLY, GARBLED or DISCONNECTED where nothing
            of use comes any more.
        """
        self._require_open()
        if not self._sampling:
            raise self._error("is not sampling; start it first")
        return self._news()

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken.

        Raises
        ------
        InstrumentError
            If the instrument says that it had an error while it sampled, or more was lost than it can count.
        """
        if not self._sampling:
            return []
        self._sampling = False
        return self._rest()

    def ping(self) -> ClockPing | None:
        """Return None: the samples carry the computer's own time, or are counted from it."""
        self._require_open()
        return None

    def close(self) -> None:
        """Let go of the instrument; more than once does nothing."""
        self._sampling = False
        super().close()

    @abstractmethod
    def _begin(self, rate: float) -> float:
        """Begin to sample, and return the rate achieved [Hz]."""

    @abstractmethod
    def _news(self) -> Sequence[PowerSample]:
        """Return what came since the last call; at once."""

    def _rest(self) -> Sequence[PowerSample]:
        """End the sampling, and return what had not been taken."""
        return []

    def _require_forwards(self, power: float, cure: str) -> None:
        """Refuse a power [W] further below zero than any zero error."""
        if power < BACKWARDS:
            raise self._error(f"the power is {power:.3f} W, so the current flows backwards; {cure}")


class PolledMeter(SamplingMeter):
    """A power meter that the computer asks for values one by one; its samples carry the computer's time.

    A value that is asked for late makes the distance to the one before longer; none is made up, and none is
    lost: the count is of values that were read.
    """

    _clock: Callable[[], float]  # the computer's [s]
    _count = 0

    def _begin(self, rate: float) -> float:
        self._period, self._due, self._count = 1 / rate, self._clock(), 0
        return rate

    def _news(self) -> Sequence[PowerSample]:
        sent = self._clock()
        return [self._sample(self._read_power(), sent, self._clock())] if self._is_due(sent) else []

    def _is_due(self, now: float) -> bool:
        """Return whether the next value is to be asked for, and count on from there if it is."""
        if now < self._due - ROUNDING * self._period:
            return False
        self._due += self._period
        if self._due <= now:  # what was missed is not made up for in a rush
            self._due = now + self._period
        return True

    def _sample(self, power: float, sent: float, received: float) -> PowerSample:
        """Return the sample of a value that was asked for and came at two times of the computer [s].

        The instrument measured somewhere between the two; their middle stands for it.
        """
        self._count += 1
        return PowerSample(self._count - 1, (sent + received) / 2, received, power)

    def _read_power(self) -> float:
        """Return the power now [W]."""
        raise NotImplementedError  # of a meter whose values take more than one call


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

"""The Nordic Power Profiler Kit II as a power meter: current in the panel's supply, times its stated voltage.

Tested against an emulated PPK2 through the library ppk2-api, not on one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.power_sampling import (
    SamplingMeter,
    require_sample_rate,
    split_address,
)
from evenlight.hardware.drivers.ppk2_port import (
    CONVERTER_MASK,
    LOGIC_SHIFT,
    RAW_RATE,
    Average,
    Averages,
    OutOfStepError,
    Ppk2Port,
    WordStream,
)
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, InstrumentError

TIMEOUT = 1.0  # [s]
SLOWEST, FASTEST = 10.0, 10_000.0  # [Hz]
LOWEST_VOLTAGE, HIGHEST_VOLTAGE = 0.8, 5.0  # [V]
HIGHEST_CURRENT = 1.0  # [A]
LARGEST_GAP = 0.1  # [s] by which count and clock may differ at the end: the stream's way through USB
LARGEST_DRIFT = 0.001  # and share of the time: no quartz is so wrong
OPTIONS = {"voltage": "of the panel's supply [V]"}


class Ppk2PowerMeter(SamplingMeter):
    """A PPK2 in ampere mode, between a panel and its supply.

    It measures no voltage, so power is current times the voltage that the address states. Times are its own
    count of samples from the computer's time at the start, not corrected for drift (some 30 ms in ten
    minutes): wire the frames' line to D0 where frames matter.

    Parameters
    ----------
    url : str
        Its port with the supply's voltage, e.g. "/dev/ttyACM0?voltage=5.0".
    clock : callable, optional
        The computer's clock [s]; time-outs go by the computer's own.
    timeout : float, optional
        How long it may be silent [s].

    Raises
    ------
    InputError
        If no voltage is stated, or one that a PPK2 does not take; if its library is not installed.
    InstrumentError
        If there is no PPK2 at the port.
    """

    def __init__(
        self, url: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        port, options = split_address(url, "ppk2", OPTIONS)
        self._voltage = _voltage_of(options, f"ppk2:{url}")
        self._clock, self._timeout = clock, TIMEOUT if timeout is None else timeout
        self._port = Ppk2Port(port, max(self._timeout, TIMEOUT))
        self._name = self._port.name
        self._began = self._period = self._last_news = 0.0
        self._words, self._averages, self._early = WordStream(), Averages(1), b""
        self._sampling = False
        try:
            self._port.use_as_ampere_meter(self._voltage)
        except BaseException:
            self._port.close()
            raise

    def start(self, rate: float) -> float:
        """Begin to sample, and return the rate achieved: 100 kHz over a whole number [Hz].

        Raises
        ------
        InstrumentError
            If the rate is outside 10 Hz to 10 kHz, or nothing comes.
        """
        self._require_open()
        require_sample_rate(rate, SLOWEST, FASTEST, self._name)
        self._port.stop()  # and forget what is on its way
        width = round(RAW_RATE / rate)
        self._words, self._averages = WordStream(), Averages(width)
        self._period = width / RAW_RATE
        self._began = self._clock()
        self._port.start()
        self._early = self._first_bytes()
        self._sampling = True
        return 1 / self._period

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once.

        Raises
        ------
        InstrumentError
            OVER_RANGE above 1 A; GARBLED where bytes were lost; NO_REPLY or DISCONNECTED.
        """
        self._require_sampling(is_sampling=self._sampling)
        data, self._early = self._early + self._port.read(), b""
        if data:
            self._last_news = time.monotonic()
        elif time.monotonic() > self._last_news + self._timeout:
            raise InstrumentError(
                f"{self._name}: sent nothing for {self._timeout:g} s; is it still plugged in?",
                Fault.NO_REPLY,
            )
        return self._averaged(data)

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken.

        Raises
        ------
        InstrumentError
            GARBLED where more was lost than the instrument's counter of 64 can show.
        """
        if not self._sampling:
            return []
        self._sampling = False
        elapsed = self._clock() - self._began
        samples = self._averaged(self._early + self._port.stop())
        end = time.monotonic() + self._timeout
        while not self._is_all_counted(elapsed) and time.monotonic() < end:  # on a computer that is busy
            samples += self._averaged(self._port.drain())
        samples += self._averaged(b"", is_last=True)
        self._require_all_counted(elapsed)
        return samples

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself."""
        said = self._port.calibration
        return {
            "power_meter": f"Nordic PPK2, hardware {said['HW']}",
            "power_meter_calibrated": said["Calibrated"],
            "power_meter_supply": f"{self._voltage:g} V, as stated",
            "power_meter_raw_samples_lost": str(self._words.n_lost),
        }

    def close(self) -> None:
        """End the stream, and let go of the instrument, which still feeds the panel."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._sampling:
                self._sampling = False
                self._port.stop()
        except InstrumentError:
            pass  # the port is let go of, whatever the instrument says
        finally:
            self._port.close()

    def _first_bytes(self) -> bytes:
        """Return the first bytes of the stream, which say that it has begun."""
        end = time.monotonic() + self._timeout
        while time.monotonic() < end:
            if data := self._port.read():
                self._last_news = time.monotonic()
                return data
            time.sleep(0.0005)
        raise InstrumentError(
            f"{self._name}: no reply to the start of a measurement; unplug it, and plug it in again",
            Fault.NO_REPLY,
        )

    def _averaged(self, data: bytes, *, is_last: bool = False) -> list[PowerSample]:
        """Return the samples that some bytes complete."""
        import numpy as np

        received = self._clock()
        try:
            words, places = self._words.take(data, is_last=is_last)
        except OutOfStepError as error:
            raise InstrumentError(f"{self._name}: {error}", Fault.GARBLED) from None
        currents = np.array(self._port.currents(words.tobytes()), dtype=np.float64)
        if len(currents) != len(words):
            raise InstrumentError(f"{self._name}: sent what is no measurement", Fault.GARBLED)
        if np.any(words & CONVERTER_MASK == CONVERTER_MASK):
            raise self._over_range("its converter is at its end")
        sync = (words >> LOGIC_SHIFT & 1).astype(np.bool_)
        return [self._sample(average, received) for average in self._averages.take(places, currents, sync)]

    def _sample(self, average: Average, received: float) -> PowerSample:
        """Return the sample that an average is."""
        if average.current > HIGHEST_CURRENT:
            raise self._over_range(f"{average.current:.3f} A")
        power = average.current * self._voltage
        self._require_forwards(power, "swap VIN and VOUT")
        require_power("ppk2", self._name, power)
        time_at_end = self._began + (average.index + 1) * self._period
        return PowerSample(average.index, time_at_end, received, power, average.sync)

    def _over_range(self, what: str) -> InstrumentError:
        """Return the error of a current that a PPK2 does not measure."""
        return InstrumentError(
            f"{self._name}: {what}; a PPK2 measures up to {HIGHEST_CURRENT:g} A", Fault.OVER_RANGE
        )

    def _is_all_counted(self, elapsed: float) -> bool:
        """Return whether the samples make the time that has passed [s]."""
        counted = self._words.length() / RAW_RATE
        return abs(counted - elapsed) <= LARGEST_GAP + LARGEST_DRIFT * elapsed

    def _require_all_counted(self, elapsed: float) -> None:
        """Refuse a stream whose samples make less time than has passed [s]; a loss of 64 does not show."""
        if not self._is_all_counted(elapsed):
            counted = self._words.length() / RAW_RATE
            raise InstrumentError(
                f"{self._name}: its samples make {counted:.3f} s of {elapsed:.3f} s measured; the "
                "computer takes them too slowly, or the cable is bad",
                Fault.GARBLED,
            )


def _voltage_of(options: dict[str, float], address: str) -> float:
    """Return the supply's voltage that an address states [V]."""
    voltage = options.get("voltage")
    if voltage is None or not LOWEST_VOLTAGE <= voltage <= HIGHEST_VOLTAGE:
        got = "none" if voltage is None else f"{voltage:g} V"
        raise InputError(
            f"{address}: state the voltage of the panel's supply, {LOWEST_VOLTAGE:g} to "
            f"{HIGHEST_VOLTAGE:g} V, as in ppk2:/dev/ttyACM0?voltage=5.0 (a PPK2 measures current only); "
            f"got {got}"
        )
    return voltage

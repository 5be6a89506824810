"""The Nordic Power Profiler Kit II as a power meter: current in the panel's supply, times its stated voltage.

The library ppk2-api (GPLv2) is imported when an instrument is opened, and is no part of Evenlight. It logs an
error of the port and goes on, accepts a part of a calibration, and counts no lost words: errors here, and a
count. Tested against an emulated PPK2 through the library, not on one.

A word has 32 bits, least significant byte first: bits 0-13 the converter, 14-16 the measuring range, 18-23 a
counter, 24-31 the digital inputs D0 to D7. The counter's place is that of Nordic's application, and was not
confirmed on a device.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.power_sampling import SamplingMeter, split_address
from evenlight.hardware.drivers.serial_link import port_error
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, Instrument, InstrumentError

TIMEOUT = 1.0  # [s]
SLOWEST, FASTEST, RAW_RATE = 10.0, 10_000.0, 100_000  # [Hz]
LOWEST_VOLTAGE, HIGHEST_VOLTAGE, HIGHEST_CURRENT = 0.8, 5.0, 1.0  # [V], [A]
QUIET, LONGEST_STREAM = 0.1, 3.0  # [s] without a byte: the stream has ended; in which it must have
LARGEST_GAP = 0.1  # [s] by which count and clock may differ at the end: the stream's way through USB
LARGEST_DRIFT = 0.001  # and share of the time: no quartz is so wrong
LINES = [f"{name}{index}" for name in ("R", "GS", "GI", "O", "S", "I", "UG") for index in range(5)]
FIELDS = ("Calibrated", *LINES, "HW", "IA")  # of the calibration that it reports
WORD = 4  # bytes
CONVERTER_MASK = 0x3FFF
RANGE_SHIFT, RANGE_MASK, RANGES = 14, 0x7, 5
COUNTER_SHIFT, COUNTER_SIZE, LOGIC_SHIFT = 18, 64, 24
LOOK_AHEAD = 4  # words that must follow on after a jump of the counter, or it was no loss
FULLEST = 0.5  # share of its words that a sample needs


class Ppk2PowerMeter(SamplingMeter, Instrument):
    """A PPK2 in ampere mode, between a panel and its supply.

    It measures no voltage, so power is current times the voltage that the address states. Times are its own
    count of samples from the computer's time at the start, not corrected for drift (some 30 ms in ten
    minutes): wire the frames' line to D0 where frames matter.

    The address is its port with the supply's voltage, "/dev/ttyACM0?voltage=5.0"; parameters as of
    `Instrument`.
    """

    longest = TIMEOUT
    _rates = (SLOWEST, FASTEST)

    def _open(self, address: str) -> None:
        place, options = split_address(address, "ppk2", {"voltage": "of the panel's supply [V]"})
        self._voltage = options.get("voltage", 0.0)
        if not LOWEST_VOLTAGE <= self._voltage <= HIGHEST_VOLTAGE:
            raise InputError(
                f"ppk2:{address}: state the voltage of the panel's supply, {LOWEST_VOLTAGE:g} to "
                f"{HIGHEST_VOLTAGE:g} V, as in ppk2:/dev/ttyACM0?voltage=5.0: a PPK2 measures current only"
            )
        self._name, self._stream = f"the PPK2 at {place}", WordStream()
        self._api = _opened(place, self._name, max(self._timeout, TIMEOUT))
        self._port = self._api.ser = _CheckedPort(self._api.ser)
        try:
            self._do(self._api.stop_measuring)  # a program that crashed may have left it streaming
            self._drained()
            self._calibration = self._read_calibration(time.monotonic() + max(self._timeout, TIMEOUT))
            self._do(self._api.use_ampere_meter)
            self._do(self._api.set_source_voltage, round(self._voltage * 1000))
            self._do(self._api.toggle_DUT_power, "ON")
        except BaseException:
            self._port.close()
            raise

    def _begin(self, rate: float) -> float:
        self._do(self._api.stop_measuring)
        self._drained()  # what is on its way
        self._width = round(RAW_RATE / rate)  # words of a sample
        self._stream = WordStream()
        self._rows = np.empty((0, 3))  # place, current [A] and D0 of the words of the next sample
        self._began = self._clock()
        self._do(self._api.start_measuring)
        self._last_news = time.monotonic()
        while not (early := self._read()):
            if time.monotonic() > self._last_news + self._timeout:
                raise self._error(
                    "no reply to the start of a measurement; unplug it, and plug it in again", Fault.NO_REPLY
                )
            time.sleep(0.0005)
        self._early = early
        return RAW_RATE / self._width  # a whole number of words

    def _news(self) -> Sequence[PowerSample]:
        data, self._early = self._early + self._read(), b""
        if data:
            self._last_news = time.monotonic()
        elif time.monotonic() > self._last_news + self._timeout:
            raise self._error(
                f"sent nothing for {self._timeout:g} s; is it still plugged in?", Fault.NO_REPLY
            )
        return self._averaged(data)

    def _rest(self) -> Sequence[PowerSample]:
        elapsed = self._clock() - self._began
        self._do(self._api.stop_measuring)
        samples = self._averaged(self._early + self._drained())
        allowed, end = LARGEST_GAP + LARGEST_DRIFT * elapsed, time.monotonic() + self._timeout
        while abs(self._stream.seconds() - elapsed) > allowed and time.monotonic() < end:
            samples += self._averaged(self._drained())  # on a computer that is busy
        samples += self._averaged(b"", is_last=True)
        if abs((counted := self._stream.seconds()) - elapsed) > allowed:
            raise self._error(
                f"its samples make {counted:.3f} s of {elapsed:.3f} s measured; the "
                "computer takes them too slowly, or the cable is bad",
                Fault.GARBLED,
            )
        return samples

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself."""
        return {
            "power_meter": f"Nordic PPK2, hardware {self._calibration['HW']}",
            "power_meter_calibrated": self._calibration["Calibrated"],
            "power_meter_supply": f"{self._voltage:g} V, as stated",
            "power_meter_raw_samples_lost": str(self._stream.n_lost),
        }

    def close(self) -> None:
        """End the stream, and let go of the instrument, which still feeds the panel."""
        if not self._closed and self._sampling:
            self._api.stop_measuring()  # which logs what the port says
        self._port.close()
        super().close()

    def _averaged(self, data: bytes, *, is_last: bool = False) -> list[PowerSample]:
        received = self._clock()
        try:
            words, places = self._stream.take(data, is_last=is_last)
        except OutOfStepError as error:
            raise self._error(f"{error}", Fault.GARBLED) from None
        currents = np.array(self._api.get_samples(words.tobytes())[0] if len(words) else []) * 1e-6
        if len(currents) != len(words):
            raise self._error("sent what is no measurement", Fault.GARBLED)
        if np.any(words & CONVERTER_MASK == CONVERTER_MASK):
            raise self._over_range("its converter is at its end")
        rows = np.vstack([self._rows, np.column_stack([places, currents, words >> LOGIC_SHIFT & 1])])
        parts, self._rows = complete_parts(rows, self._width)
        return [self._sample(part, received) for part in parts]

    def _sample(self, rows: NDArray[np.float64], received: float) -> PowerSample:
        current, index = float(rows[:, 1].mean()), int(rows[0, 0] // self._width)
        if current > HIGHEST_CURRENT:
            raise self._over_range(f"{current:.3f} A")
        power = current * self._voltage
        self._require_forwards(power, "swap VIN and VOUT")
        require_power("ppk2", self._name, power)
        ended = self._began + (index + 1) * self._width / RAW_RATE
        return PowerSample(index, ended, received, power, bool(rows[-1, 2]))

    def _over_range(self, what: str) -> InstrumentError:
        return self._error(f"{what}; a PPK2 measures up to {HIGHEST_CURRENT:g} A", Fault.OVER_RANGE)

    def _read_calibration(self, end: float) -> dict[str, str]:
        """Return what it reports; the library waits half a second, and is asked again until a time [s]."""
        while True:
            self._port.heard = b""
            try:
                taken = self._do(self._api.get_modifiers)
            except UnicodeDecodeError:
                taken = None
            heard = self._port.heard.decode("ascii", errors="replace").strip()
            said = dict(re.findall(r"^(\w+): (\S+)\r?$", heard, re.MULTILINE))
            missing = [field for field in FIELDS if field not in said]
            if taken and not missing:
                self._drained()  # the answer to an earlier question, which would be taken for words
                return said
            fault, words = (
                Fault.GARBLED,
                f"its calibration came in part; {(missing or ['END'])[0]} is missing",
            )
            if not heard:
                fault, words = Fault.NO_REPLY, "no reply; a PPK2 has two ports, is it the other one?"
            elif len(missing) == len(FIELDS) and heard.isascii() and " ".join(heard.split()).isprintable():
                fault = Fault.WRONG_INSTRUMENT
                words = f"answers {heard[:60]!r}, and is no PPK2; which instrument is at this port?"
            if fault is Fault.WRONG_INSTRUMENT or time.monotonic() >= end:
                raise self._error(words, fault)

    def _read(self) -> bytes:
        parts = []
        while part := self._do(self._api.get_data):
            parts.append(part)
        return b"".join(parts)

    def _drained(self) -> bytes:
        came, begun = b"", time.monotonic()
        last = begun
        while time.monotonic() < last + QUIET:
            if part := self._read():
                came, last = came + part, time.monotonic()
            else:
                time.sleep(QUIET / 20)
            if last > begun + LONGEST_STREAM:
                raise self._error("does not stop streaming; unplug it, and plug it in again", Fault.GARBLED)
        return came

    def _do(self, call: Callable[..., Any], *arguments: Any) -> Any:
        """Return what a call of the library returns; an error of the port, logged or not, closes it."""
        if not self._port.port.is_open:
            raise self._error("is no longer connected", Fault.DISCONNECTED)
        try:
            returned = call(*arguments)
            if self._port.error is not None:
                raise self._port.error
        except (OSError, TypeError) as error:  # TypeError: pyserial's, where the file is gone in between
            self._port.close()
            raise self._error(f"the connection broke ({error})", Fault.DISCONNECTED) from None
        return returned


class OutOfStepError(ValueError):
    """The bytes that came are no words of a PPK2, or not from their beginning."""


class WordStream:
    """Makes words of bytes, and finds by their counter which were lost.

    A jump of the counter is a loss only where the words after it follow on; else bytes are missing, and what
    comes is not read right any more. So the last words are kept until it is known.
    """

    def __init__(self) -> None:
        self._rest, self._kept = b"", np.empty(0, dtype="<u4")
        self._counter, self._place, self.n_lost = -1, -1, 0

    def seconds(self) -> float:
        """Return how long the instrument has counted, lost words among them [s]."""
        return (self._place + 1) / RAW_RATE

    def take(self, data: bytes, *, is_last: bool = False) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """Return the words that are sure, and the place of each in the instrument's own count, from 0.

        `data` is what came, and `is_last` says that no more will; raises OutOfStepError.
        """
        data = self._rest + data
        whole = len(data) // WORD * WORD
        self._rest = data[whole:]
        words = np.concatenate([self._kept, np.frombuffer(data[:whole], dtype="<u4")])
        counters = (words >> COUNTER_SHIFT).astype(np.int64) % COUNTER_SIZE
        before = counters[:1] - 1 if self._counter < 0 else self._counter
        steps = (np.diff(counters, prepend=before) - 1) % COUNTER_SIZE + 1
        jumps = np.flatnonzero(steps != 1)
        # The same counter twice is a word too many rather than 63 lost.
        if (
            np.any(steps == COUNTER_SIZE)
            or np.any(np.diff(jumps) <= LOOK_AHEAD)
            or np.any((words >> RANGE_SHIFT & RANGE_MASK) >= RANGES)
        ):
            raise OutOfStepError("its counter does not count, so bytes were lost on the way")
        n_sure = len(words) if is_last else max(len(words) - LOOK_AHEAD, 0)
        if is_last and len(jumps) and jumps[-1] > len(words) - 1 - LOOK_AHEAD:
            n_sure = int(jumps[-1])  # nothing can follow that would distinguish a loss from nonsense
        self._kept = words[n_sure:]
        places = self._place + steps[:n_sure].cumsum()
        if n_sure:
            self.n_lost += int(places[-1]) - self._place - n_sure
            self._counter, self._place = int(counters[n_sure - 1]), int(places[-1])
        return words[:n_sure], places


def complete_parts(
    rows: NDArray[np.float64], width: int
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the rows of each complete sample, and those of the next.

    `rows` begin with the place of a word; a sample is `width` words, the lost ones counted, and is left out
    where it lost more than half of them.
    """
    *parts, rest = np.split(rows, np.flatnonzero(np.diff(rows[:, 0] // width)) + 1)
    return [part for part in parts if len(part) >= FULLEST * width], rest


class _CheckedPort:
    """The port that the library uses: what was read last, and the error of writing that the library logs."""

    def __init__(self, port: Any) -> None:
        self.port, self.heard = port, b""
        self.error: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.port, name)

    def read(self, size: int) -> bytes:
        data = bytes(self.port.read(size))
        self.heard = (self.heard + data)[-4096:]
        return data

    def write(self, data: bytes) -> None:
        try:
            self.port.write(data)
        except OSError as error:
            self.error = error


def _opened(place: str, name: str, timeout: float) -> Any:
    try:
        from ppk2_api import ppk2_api
    except ImportError:
        raise InputError(
            "ppk2: needs the extra of instruments: pip install '.[instruments]' in the checkout (ppk2-api)"
        ) from None
    try:
        # 9600 8N1 without flow control: ppk2-api's own. USB that looks serial takes any rate.
        return ppk2_api.PPK2_API(place, timeout=0, write_timeout=timeout, exclusive=True)
    except (OSError, ValueError) as error:
        raise port_error(name, error) from None

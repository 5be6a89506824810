"""The port of a PPK2 and the words that it streams.

The library ppk2-api (GPLv2) is imported when an instrument is opened, and is not part of Evenlight. It logs
an error of the port and goes on, and it accepts a part of a calibration silently: both end in an error here.

The instrument streams 100 000 words a second, which are checked by their counter, and averaged to the rate
asked for. A word has 32 bits, least significant byte first: bits 0-13 the converter, 14-16 the measuring
range, 18-23 a counter, 24-31 the digital inputs D0 to D7. The counter's place is that of Nordic's
application, and was not confirmed on a device.
"""

from __future__ import annotations

import itertools
import re
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.serial_link import port_error
from evenlight.hardware.protocols import Fault, InstrumentError

if TYPE_CHECKING:
    import numpy as np
    import serial
    from numpy.typing import NDArray

QUIET = 0.1  # [s] without a byte: the instrument has ended its stream
LONGEST_STREAM = 3.0  # [s] in which it must have
LINES = [f"{name}{index}" for name in ("R", "GS", "GI", "O", "S", "I", "UG") for index in range(5)]
FIELDS = ("Calibrated", *LINES, "HW", "IA")  # of the calibration that it reports
RAW_RATE = 100_000  # [Hz]
WORD = 4  # bytes
CONVERTER_MASK = 0x3FFF
RANGE_SHIFT, RANGE_MASK, RANGES = 14, 0x7, 5
COUNTER_SHIFT, COUNTER_SIZE = 18, 64
LOGIC_SHIFT = 24
LOOK_AHEAD = 4  # words that must follow on after a jump of the counter, or it was no loss
FULLEST = 0.5  # share of its words that an average needs


class Ppk2Port:
    """An open PPK2.

    Parameters
    ----------
    port : str
        Its serial port.
    timeout : float
        How long it may take to take a command, and to tell its calibration [s].

    Raises
    ------
    InputError
        If the library is not installed.
    InstrumentError
        If there is no such port, or what answers is no PPK2.
    """

    def __init__(self, port: str, timeout: float) -> None:
        library = _library()
        self.name = f"the PPK2 at {port}"
        try:
            # 9600 8N1 without flow control: ppk2-api's own. USB that looks serial takes any rate.
            self._api: Any = library.PPK2_API(port, timeout=0, write_timeout=timeout, exclusive=True)
        except (OSError, ValueError) as error:
            raise port_error(self.name, error) from None
        self._port = _CheckedPort(self._api.ser)
        self._api.ser = self._port
        try:
            self.command(self._api.stop_measuring)  # a program that crashed may have left it streaming
            self.drain()
            self.calibration = self._patiently_read_calibration(time.monotonic() + timeout)
        except BaseException:
            self.close()
            raise

    def use_as_ampere_meter(self, voltage: float) -> None:
        """Measure the current of a panel with its own supply, of a voltage [V], and let it through."""
        self.command(self._api.use_ampere_meter)
        self.command(self._api.set_source_voltage, round(voltage * 1000))
        self.command(self._api.toggle_DUT_power, "ON")

    def start(self) -> None:
        """Begin to stream."""
        self._api.remainder = {"sequence": b"", "len": 0}
        self.command(self._api.start_measuring)

    def stop(self) -> bytes:
        """End the stream, and return what was still on its way."""
        self.command(self._api.stop_measuring)
        return self.drain()

    def read(self) -> bytes:
        """Return what has come; at once."""
        parts = []
        while part := self._guarded(self._api.get_data):
            parts.append(part)
        return b"".join(parts)

    def drain(self) -> bytes:
        """Return what comes until nothing more does."""
        parts, begun = [], time.monotonic()
        last = begun
        while time.monotonic() < last + QUIET:
            if part := self.read():
                parts.append(part)
                last = time.monotonic()
            else:
                time.sleep(QUIET / 20)
            if last > begun + LONGEST_STREAM:
                raise InstrumentError(
                    f"{self.name}: does not stop streaming; unplug it, and plug it in again", Fault.GARBLED
                )
        return b"".join(parts)

    def currents(self, words: bytes) -> list[float]:
        """Return the currents that whole words hold [A], by the library's calibration."""
        if not words:
            return []
        microamperes, _ = self._api.get_samples(words)
        return [current * 1e-6 for current in microamperes]

    def command(self, send: Any, *arguments: Any) -> None:
        """Let the library send a command, and raise what it swallows."""
        self._guarded(send, *arguments)
        if (error := self._port.swallowed()) is not None:
            raise self._broken(error)

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        self._port.close()

    def _guarded(self, call: Any, *arguments: Any) -> Any:
        """Return what a call of the library returns; an error of the port closes it."""
        if self._port.is_closed():
            raise InstrumentError(f"{self.name}: is no longer connected", Fault.DISCONNECTED)
        try:
            return call(*arguments)
        except (OSError, TypeError) as error:  # TypeError: pyserial's, where the file is gone in between
            raise self._broken(error) from None

    def _broken(self, error: Exception) -> InstrumentError:
        """Close the port, and return the error of a connection that is gone."""
        self.close()
        return InstrumentError(f"{self.name}: the connection broke ({error})", Fault.DISCONNECTED)

    def _patiently_read_calibration(self, end: float) -> dict[str, str]:
        """Return the calibration; the library waits for half a second, and is asked again until a time."""
        while True:
            try:
                calibration = self._read_calibration()
            except InstrumentError as error:
                if error.fault not in (Fault.NO_REPLY, Fault.GARBLED) or time.monotonic() >= end:
                    raise
            else:
                self.drain()  # the answer to an earlier question, which would be taken for words
                return calibration

    def _read_calibration(self) -> dict[str, str]:
        """Return the calibration that the instrument reports, once the library has taken all of it."""
        self._port.listen()
        try:
            taken = self._guarded(self._api.get_modifiers)
        except UnicodeDecodeError:
            taken = None
        heard = self._port.heard()
        if self._port.swallowed() is not None or not heard:
            raise InstrumentError(
                f"{self.name}: no reply; a PPK2 has two ports, is it the other one?", Fault.NO_REPLY
            )
        said = dict(re.findall(r"^(\w+): (\S+)\r?$", heard.decode("ascii", errors="replace"), re.MULTILINE))
        if not any(field in said for field in FIELDS):
            raise _wrong_instrument(self.name, heard)
        missing = [field for field in FIELDS if field not in said]
        if not taken or missing:
            raise InstrumentError(
                f"{self.name}: its calibration came in part; {', '.join(missing) or 'END'} is missing",
                Fault.GARBLED,
            )
        return said


class _CheckedPort:
    """The port that the library writes to and reads from: it keeps the errors that the library swallows."""

    def __init__(self, port: serial.Serial) -> None:
        self._port, self._error = port, list[OSError]()
        self._heard: bytearray | None = None

    @property
    def in_waiting(self) -> int:  # an attribute, as the library reads it
        """How many bytes have come."""
        return self._port.in_waiting

    def read(self, size: int) -> bytes:
        """Return some of them."""
        data = bytes(self._port.read(size))
        if self._heard is not None:
            self._heard += data
        return data

    def write(self, data: bytes) -> None:
        """Send some bytes, and keep the error if they cannot be sent."""
        try:
            self._port.write(data)
        except OSError as error:
            self._error.append(error)

    def swallowed(self) -> OSError | None:
        """Return the first error since the last call."""
        errors, self._error = self._error, []
        return errors[0] if errors else None

    def listen(self) -> None:
        """Keep what is read from now on."""
        self._heard = bytearray()

    def heard(self) -> bytes:
        """Return what was read since `listen`, and keep no more."""
        heard, self._heard = bytes(self._heard or b""), None
        return heard

    def is_closed(self) -> bool:
        """Return whether the port is closed."""
        return not self._port.is_open

    def close(self) -> None:
        """Close the port; more than once does nothing."""
        self._port.close()


def _library() -> Any:
    """Return the library, if it is installed."""
    try:
        from ppk2_api import ppk2_api
    except ImportError:
        raise InputError(
            "ppk2: needs the extra of instruments: pip install '.[instruments]' in the checkout (ppk2-api)"
        ) from None
    return ppk2_api


def _wrong_instrument(name: str, heard: bytes) -> InstrumentError:
    """Return the error of an answer that no PPK2 gives."""
    text = heard.decode("ascii", errors="replace").strip()
    if text.isascii() and " ".join(text.split()).isprintable():
        return InstrumentError(
            f"{name}: answers {text[:60]!r}, and is no PPK2; which instrument is at this port?",
            Fault.WRONG_INSTRUMENT,
        )
    return InstrumentError(f"{name}: its calibration cannot be read; it sent {heard[:20]!r}", Fault.GARBLED)


class OutOfStepError(ValueError):
    """The bytes that came are no words of a PPK2, or not from their beginning."""


@dataclass(frozen=True, slots=True)
class Average:
    """The mean of some neighbouring words."""

    index: int  # which it is, from 0
    current: float  # mean [A]
    sync: bool  # level of D0 at its end


class WordStream:
    """Makes words of bytes, and finds by the counter which were lost.

    A jump of the counter is a loss only where the words after it follow on; else bytes are missing, and what
    comes is not read right any more. The last words of each lot are kept until it is known.
    """

    def __init__(self) -> None:
        import numpy as np

        self._rest = b""
        self._held = np.empty(0, dtype="<u4")
        self._last_counter: int | None = None
        self._last_place = -1
        self.n_lost = 0

    def take(self, data: bytes, *, is_last: bool = False) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """Return the words that are sure, and the place of each in the instrument's own count, from 0.

        Parameters
        ----------
        data : bytes
            What came.
        is_last : bool, optional
            Whether no more will come.

        Raises
        ------
        OutOfStepError
            If bytes are missing, or what came is from no PPK2.
        """
        import numpy as np

        data = self._rest + data
        whole = len(data) // WORD * WORD
        self._rest = data[whole:]
        words = np.concatenate([self._held, np.frombuffer(data[:whole], dtype="<u4")])
        steps = self._steps(words)
        jumps = np.flatnonzero(steps != 1)
        # The same counter twice is a word too many rather than 63 lost.
        if (
            np.any(steps == COUNTER_SIZE)
            or np.any(np.diff(jumps) <= LOOK_AHEAD)
            or np.any((words >> RANGE_SHIFT & RANGE_MASK) >= RANGES)
        ):
            raise OutOfStepError("its counter does not count, so bytes were lost on the way")
        sure = len(words) if is_last else max(len(words) - LOOK_AHEAD, 0)
        if is_last and len(jumps) and jumps[-1] > len(words) - 1 - LOOK_AHEAD:
            sure = int(jumps[-1])  # nothing can follow that would distinguish a loss from nonsense
        self._held = words[sure:]
        return self._placed(words[:sure], steps[:sure])

    def length(self) -> int:
        """Return how many words the instrument has counted so far, the lost ones among them."""
        return self._last_place + 1

    def _steps(self, words: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return by how much the counter went on to each word: 1, or more where some were lost."""
        import numpy as np

        counters = (words >> COUNTER_SHIFT).astype(np.int64) % COUNTER_SIZE
        if not len(counters):
            return counters
        before = counters[0] - 1 if self._last_counter is None else self._last_counter
        return (np.diff(counters, prepend=before) - 1) % COUNTER_SIZE + 1

    def _placed(
        self, words: NDArray[np.uint32], steps: NDArray[np.int64]
    ) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """Return words and their places, and remember where they ended."""
        places = self._last_place + steps.cumsum()
        if len(words):
            self._last_counter = int(words[-1] >> COUNTER_SHIFT) % COUNTER_SIZE
            self._last_place = int(places[-1])
            self.n_lost += int(steps.sum()) - len(steps)
        return words, places


class Averages:
    """Averages neighbouring words.

    Parameters
    ----------
    width : int
        How many make one average, the lost ones counted.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._index, self._sum, self._count, self._sync = 0, 0.0, 0, False

    def take(
        self, places: NDArray[np.int64], currents: NDArray[np.float64], sync: NDArray[np.bool_]
    ) -> list[Average]:
        """Return the averages that are complete; one that lost more than half of its words is left out.

        Parameters
        ----------
        places : numpy.ndarray of int
            Place of each word in the instrument's count, rising.
        currents : numpy.ndarray of float
            Their currents [A].
        sync : numpy.ndarray of bool
            Their levels of D0.
        """
        import numpy as np

        indices = places // self._width
        edges = np.flatnonzero(np.diff(indices, prepend=-1, append=-1))
        complete: list[Average] = []
        for start, end in itertools.pairwise(edges):
            if indices[start] != self._index:
                complete += self._finished()
                self._index, self._sum, self._count = int(indices[start]), 0.0, 0
            self._sum += float(currents[start:end].sum())
            self._count += int(end - start)
            self._sync = bool(sync[end - 1])
        return complete

    def _finished(self) -> list[Average]:
        """Return the average that is complete, if it holds enough."""
        if self._count < FULLEST * self._width:
            return []
        return [Average(self._index, self._sum / self._count, self._sync)]

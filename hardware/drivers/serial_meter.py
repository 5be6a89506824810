"""What luminance meters on a serial line share: opening, asking, and taking no late reply for a new one.

After a question that got no answer, or half of one, the answer may still come, and would look like that to
the next question, of another luminance. So the next question is preceded by one whose answer looks like
nothing else: whatever comes before that answer is thrown away.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.protocols import TRANSIENT, ContextDevice, Fault, InstrumentError, Reading

QUIET = 0.05  # [s] that the line has been quiet before it is asked again
MOST_SKIPPED = 50  # lines: one that never stops sending has no answer in it

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True)
class MeterAnswer:
    """What an instrument answered to the question for a reading."""

    luminance: float  # as it gave it [cd/m^2]
    status: str  # its own word or code
    chromaticity: tuple[float, float] | None = None  # CIE 1931 x and y, if it gave them


class SerialMeter(ContextDevice):
    """A luminance meter on a serial line; each instrument says what it is asked, and how answers are read.

    Parameters
    ----------
    url : str
        A port, or a URL of pyserial.
    clock : callable, optional
        Of the readings' times [s]. Time-outs go by the computer's own clock, for a line takes real time.
    timeout : float, optional
        How long a reply may take, in place of what the instrument needs [s].

    Raises
    ------
    InstrumentError
        If the port cannot be opened, or what answers is not the instrument; the port is closed then.
    """

    maker = model = ""  # as messages name the instrument
    line: LineSettings  # as its manual has them, with the longest time that a reply takes
    wake = "is it switched on?"  # what makes the instrument listen, for the person at the bench
    zero_is_a_reading = True  # False where 0 is what is left of a difference, and may stand for anything dark

    def __init__(
        self, url: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        settings = self.line if timeout is None else dataclasses.replace(self.line, timeout=timeout)
        device = f"{self.maker} {self.model}"
        self._clock, self._timeout = clock, settings.timeout
        self._in_doubt = False  # whether an answer may still be on its way
        self._link = SerialLink(url, settings, device)
        try:
            with self._advice():
                self._link.forget(QUIET)
                self._begin()
        except BaseException as error:
            self._link.close()
            if isinstance(error, InstrumentError) and error.fault is Fault.GARBLED:
                raise InstrumentError(f"{error}; is it a {device}?", error.fault, error.code) from None
            raise

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2].

        Raises
        ------
        InstrumentError
            If there is none; the link is then fit for the next, or closed for good.
        """
        (begun, found), ended = self._ask(lambda: (self._clock(), self._found_luminance())), self._clock()
        return Reading(found.luminance, "cd/m^2", begun, ended, found.status, found.chromaticity)

    def close(self) -> None:
        """Let go of the instrument; more than once does nothing."""
        if self._link.is_open:
            with contextlib.suppress(InstrumentError):  # it may be gone; the port is closed either way
                self._leave()
        self._link.close()

    @abstractmethod
    def _begin(self) -> None:
        """Get the instrument ready, and refuse another one."""

    @abstractmethod
    def _measure(self) -> MeterAnswer:
        """Ask for one reading."""

    @abstractmethod
    def _resynchronise(self) -> None:
        """Exchange something whose answer looks like nothing else, and throw away what comes before it."""

    def _leave(self) -> None:
        """Hand the instrument back to its keys, where it has a command for that."""
        return

    def _ask(self, question: Callable[[], Answer]) -> Answer:
        """Return the answer to a question, and of no earlier one."""
        with self._advice():
            if self._in_doubt:
                self._link.forget(QUIET)
                self._resynchronise()
            self._in_doubt = True  # until the answer is there, even after an interruption
            try:
                answer = question()
            except InstrumentError as error:
                self._in_doubt = error.fault in TRANSIENT
                raise
            self._in_doubt = False
            return answer

    def _found_luminance(self) -> MeterAnswer:
        """Return one reading, if its luminance is one: a number, and not below zero."""
        found = self._measure()
        if not math.isfinite(found.luminance):
            raise self._error(f"sent {found.luminance} as a luminance", Fault.GARBLED)
        if found.luminance < 0 or (found.luminance == 0 and not self.zero_is_a_reading):
            raise self._error(
                f"too dark for it: it makes {found.luminance:.4g} cd/m^2 of the screen, which is not above "
                "its zero",
                Fault.UNDER_RANGE,
                found.status,
            )
        return found

    def _next_line(self, skip: Callable[[str], bool] = lambda line: False) -> str:
        """Return the next line that is not blank, and not one to be skipped."""
        end = time.monotonic() + self._timeout
        for _ in range(MOST_SKIPPED):
            line = self._link.read_line(max(end - time.monotonic(), 0.0)).strip("\r\n >")
            if line and not skip(line):
                return line
        raise self._error("sends line after line that was not asked for", Fault.GARBLED)

    def _wait_for_line(self, wanted: Callable[[str], bool]) -> None:
        """Throw away lines, garbled ones too, up to one that is wanted."""
        end = time.monotonic() + self._timeout
        for _ in range(MOST_SKIPPED):
            try:
                line = self._link.read_line(max(end - time.monotonic(), 0.0)).strip("\r\n >")
            except InstrumentError as error:
                if error.fault is not Fault.GARBLED or time.monotonic() >= end:
                    raise
                continue
            if wanted(line):
                return
        raise self._error("does not answer what it is asked", Fault.GARBLED)

    def _error(self, words: str, fault: Fault, code: str = "") -> InstrumentError:
        """Return an error that names the device and its port."""
        return InstrumentError(f"{self._link.name}: {words}", fault, code)

    @contextlib.contextmanager
    def _advice(self) -> Iterator[None]:
        """Add to an error of an instrument that does not answer what would make it listen."""
        try:
            yield
        except InstrumentError as error:
            if error.fault is not Fault.NO_REPLY:
                raise
            raise InstrumentError(f"{error} {self.wake}", error.fault, error.code) from None

"""What luminance meters on a serial line share: opening, asking, and taking nothing else for an answer.

After a question that got no answer, or half of one, the answer may still come, and would look like that to
the next question, of another luminance. So the next question is preceded by one whose answer looks like
nothing else, the landmark: whatever comes before that answer is thrown away. A reading is followed by the
landmark, too: if anything else comes before its answer, or before the next question, something spoke that
was not asked, and the reading may be its.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import re
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import TypeVar

from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.plausibility import require_luminance
from evenlight.hardware.protocols import Fault, Instrument, InstrumentError, Reading

QUIET = 0.05  # [s] that the line has been quiet before it is asked again
OPENING_TIME = 4.0  # [s] in which what is there has to be known for the instrument, or for none
LANDMARK_TIME = 10.0  # [s] in which its answer comes, after what the instrument is about to do
BLANK = "\r\n >"  # what ends lines and prompts
MOST_SKIPPED = 50  # lines: one that never stops sending has no answer in it

SECOND = "does a second instrument answer, or does something else use the port?"

Answer = TypeVar("Answer")


# What an instrument answered: its luminance [cd/m^2], its own word or code, CIE 1931 x and y if it gave them.
MeterAnswer = tuple[float, str, tuple[float, float] | None]


class SerialMeter(Instrument):
    """A luminance meter on a serial line; each instrument says what it is asked, and how answers are read.

    The address is a port, or a URL of pyserial; parameters as of `Instrument`. The port is closed where what
    answers is not the instrument.
    """

    driver = ""  # its name in `hardware.driver_table`
    maker = model = ""  # as messages name the instrument
    line: LineSettings  # as its manual has them
    wake = "is it switched on?"  # what makes the instrument listen, for the person at the bench
    zero_is_a_reading = True  # False where 0 is what is left of a difference, and may stand for anything dark

    def _open(self, address: str) -> None:
        device = f"{self.maker} {self.model}"
        self._in_doubt = False  # whether an answer may still be on its way
        self._n_checked = 2  # of `_n_checks`, the last time
        self._n_due = 0  # landmarks that were asked for, and have not come
        self._link = SerialLink(address, dataclasses.replace(self.line, timeout=self._timeout), device)
        self._name = self._link.name
        self._all_over = time.monotonic() + OPENING_TIME  # when the last answer has to be there
        try:
            with self._advice():
                self._link.forget(QUIET)
                self._begin()
        except BaseException as error:
            self._link.close()
            if isinstance(error, InstrumentError) and error.fault is Fault.GARBLED:
                raise InstrumentError(f"{error}; is it a {device}?", error.fault, error.code) from None
            raise
        self._all_over = math.inf

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2].

        Raises
        ------
        InstrumentError
            If there is none; the link is then fit for the next, or closed for good.
        """
        begun, (luminance, status, x_y) = self._ask(lambda: (self._clock(), self._found_luminance()))
        return Reading(luminance, "cd/m^2", begun, self._clock(), status, x_y)

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
    def _send_landmark(self) -> None:
        """Ask something whose answer looks like nothing else."""

    @abstractmethod
    def _is_landmark(self, line: str) -> bool:
        """Return whether a line is the answer to `_send_landmark`."""

    def _ask_landmark(self) -> None:
        self._n_due += 1
        self._send_landmark()

    def _require_no_more(self) -> None:
        """Refuse a reading after which more comes than it: what is asked after it is answered next."""
        for _ in range(self._n_checks()):
            self._require_landmark()

    def _n_checks(self) -> int:
        """Return how often something is asked after a reading: once and twice in turn.

        Thus answers that are all late by one reading do not stay in step with the questions.
        """
        self._n_checked = 3 - self._n_checked
        return self._n_checked

    def _require_landmark(self) -> None:
        self._ask_landmark()
        if not self._is_landmark(line := self._next_line()):
            raise self._error(f"sent {line!r} besides its answer; {SECOND}", Fault.GARBLED)
        self._n_due -= 1

    def _resynchronise(self) -> None:
        """Throw away all that comes until each landmark that was asked for has come, then one more."""
        thrown = self._link.forget(QUIET).decode("ascii", errors="replace")
        for line in re.split("[\r\n]+", thrown):
            self._n_due -= self._n_due > 0 and self._is_landmark(line.strip(BLANK))
        with contextlib.suppress(InstrumentError):  # what has not come in all that time is lost
            self._wait_for_landmarks()
        self._n_due = 0
        self._ask_landmark()
        self._wait_for_landmarks()
        self._require_landmark()
        self._link.forget()

    def _wait_for_landmarks(self) -> None:
        while self._n_due:
            self._wait_for_line(self._is_landmark)
            self._n_due -= 1

    def _require_copy(self, line: str, copy: str) -> None:
        if copy != line:
            raise self._error(f"sent {line!r}, then {copy!r} for it; {SECOND}", Fault.GARBLED)

    def _leave(self) -> None:
        """Hand the instrument back to its keys, where it has a command for that."""
        return

    def _ask(self, question: Callable[[], Answer]) -> Answer:
        """Return the answer to a question, and of no earlier one."""
        with self._advice():
            if self._in_doubt:
                self._resynchronise()
            self._in_doubt = True  # until the answer is there, even after an error or an interruption
            if unasked := self._link.forget().decode("ascii", errors="replace").strip(BLANK):
                raise self._error(f"sent {unasked[:60]!r}, which was not asked for; {SECOND}", Fault.GARBLED)
            answer = question()
            self._in_doubt = False
            return answer

    def _found_luminance(self) -> MeterAnswer:
        luminance, status, x_y = self._measure()
        if luminance < 0 or (luminance == 0 and not self.zero_is_a_reading):
            raise self._error(
                f"too dark for it: it makes {luminance:.4g} cd/m^2 of the screen, which is not above its "
                "zero",
                Fault.UNDER_RANGE,
                status,
            )
        require_luminance(self.driver, self._name, luminance, x_y)
        return luminance, status, x_y

    def _next_line(self, skip: Callable[[str], bool] = lambda line: False) -> str:
        end = self._end()
        for _ in range(MOST_SKIPPED):
            line = self._link.read_line(max(end - time.monotonic(), 0.0)).strip(BLANK)
            if line and not skip(line):
                return line
        raise self._error("sends line after line that was not asked for", Fault.GARBLED)

    def _wait_for_line(self, wanted: Callable[[str], bool]) -> None:
        end = min(self._end(), time.monotonic() + LANDMARK_TIME)
        for _ in range(MOST_SKIPPED):
            try:
                line = self._link.read_line(max(end - time.monotonic(), 0.0)).strip(BLANK)
            except InstrumentError as error:
                if error.fault is not Fault.GARBLED or time.monotonic() >= end:
                    raise
                continue
            if wanted(line):
                return
        raise self._error("does not answer what it is asked", Fault.GARBLED)

    def _end(self) -> float:
        return min(time.monotonic() + self._timeout, self._all_over)

    @contextlib.contextmanager
    def _advice(self) -> Iterator[None]:
        try:
            yield
        except InstrumentError as error:
            if error.fault is not Fault.NO_REPLY:
                raise
            raise InstrumentError(f"{error} {self.wake}", error.fault, error.code) from None

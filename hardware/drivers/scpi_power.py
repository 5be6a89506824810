"""Bench instruments that speak SCPI as power meters: supplies, power analysers, multimeters.

Tested against an emulated instrument over sockets and PyVISA-py, not on one.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.power_sampling import (
    PolledSampling,
    SamplingMeter,
    require_sample_rate,
    split_address,
)
from evenlight.hardware.drivers.scpi_answers import (
    SHOWN,
    NumberForm,
    error_in,
    error_in_words,
    is_error,
    number_in,
)
from evenlight.hardware.drivers.scpi_dialogue import ScpiDialogue
from evenlight.hardware.drivers.scpi_lines import ScpiLine, SocketLine, VisaLine
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, InstrumentError

TIMEOUT = 5.0  # [s] a multimeter may average over a second or more
SLOWEST, FASTEST = 0.01, 1000.0  # [Hz]
PROBE = 1.8  # [s] in which an instrument answers a question that it knows
PATIENCE = 0.005  # [s] that a call of `samples` waits for an answer; a slow one is there at the next call
OPTIONS = {"voltage": "of the supply [V], for an instrument that measures current only"}
MOST_ERRORS = 20  # that an instrument's list is read of
MOST_ASKED = 24  # times for one value, before its changing forms are an error
YOKOGAWA = "YOKOGAWA"  # maker of the power analysers WT300 to WT5000, which know no MEAS
# Makes power the only one of the numbers that NUM:VAL? sends; the display keeps its own (IM WT310-17EN, the
# group NUMeric).
FIRST_ITEM = ("NUM:FORM ASC", "NUM:NUM 1", "NUM:ITEM1 P,1")
IS_POWER = re.compile(r"(.*\s)?P(,1)?", re.IGNORECASE)  # NUM:ITEM1? with and without its header


class ScpiPowerMeter(SamplingMeter):
    """A SCPI instrument over a raw socket; its samples carry the computer's time.

    It is asked for power, or for voltage and current where it has no power. The next question goes out when
    `samples` is called and one is due; an answer that is not there at once is taken by a later call.

    Parameters
    ----------
    url : str
        "HOST", "HOST:PORT" or a serial port; "?voltage=5.0" after it for an instrument that measures current
        only, with the voltage of the supply.
    clock : callable, optional
        The computer's clock [s]; time-outs go by the computer's own.
    timeout : float, optional
        How long an answer may take [s].

    Raises
    ------
    InstrumentError
        If nothing answers, it does not speak SCPI, or it measures no power.
    """

    def __init__(
        self, url: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        place, options = split_address(url, self._driver(), OPTIONS)
        self._clock, self._timeout = clock, TIMEOUT if timeout is None else timeout
        self._voltage = options.get("voltage")
        self._line = self._open_line(place, self._timeout)
        self._name = self._line.name
        self._sampling, self._pending = PolledSampling(), _Pending()
        try:
            self._dialogue = ScpiDialogue(self._line, self._timeout)
            self._is_yokogawa = self._dialogue.identity.upper().startswith(YOKOGAWA)
            self._questions = self._find_questions()
            self._list_of_errors = self._find_errors()
        except BaseException:
            self._line.close()
            raise
        self._forms = [NumberForm() for _ in self._questions]

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved: no higher than it answers.

        Raises
        ------
        InstrumentError
            If the rate is one that no such instrument has, or it does not measure.
        """
        self._require_open()
        require_sample_rate(rate, SLOWEST, FASTEST, self._name)
        if not all(form.is_known() for form in self._forms):
            self._measure()
        self._dialogue.get_in_step()
        begun = time.monotonic()
        self._measure()
        achieved = min(rate, 1 / (time.monotonic() - begun))
        self._sampling.begin(achieved, self._clock())
        return achieved

    def samples(self) -> Sequence[PowerSample]:
        """Return a sample if one has come; ask for the next if it is due.

        Raises
        ------
        InstrumentError
            OVER_RANGE where the instrument reports an overload; NO_REPLY, GARBLED or DISCONNECTED.
        """
        self._require_sampling(is_sampling=self._sampling.is_running)
        if not self._dialogue.is_asked:
            self._dialogue.get_in_step()
            if not self._sampling.is_due(self._clock()):
                return []
            self._begin()
        return self._come_in(time.monotonic() + PATIENCE)

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the sample that was asked for last.

        Raises
        ------
        InstrumentError
            If the instrument had an error while it sampled, in its words.
        """
        if not self._sampling.is_running:
            return []
        self._sampling.end()
        left = self._come_in(math.inf) if self._dialogue.is_asked else []
        code, words = self._read_error()
        if code:
            raise InstrumentError(f"{self._name}: {error_in_words(code, words)}", Fault.REFUSED, str(code))
        return left

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself."""
        supply = "" if self._voltage is None else f" times {self._voltage:g} V"
        return {
            "power_meter": self._dialogue.identity,
            "power_meter_asked": " and ".join(self._questions) + supply,
        }

    def close(self) -> None:
        """Let go of the instrument; more than once does nothing."""
        self._sampling.end()
        self._closed = True
        self._line.close()

    def _driver(self) -> str:
        """Return the driver's name, as messages have it."""
        return "scpi"

    def _open_line(self, place: str, timeout: float) -> ScpiLine:
        """Return an open line to a place."""
        return SocketLine(place, timeout)

    def _find_questions(self) -> dict[str, str]:
        """Return the questions whose answers make power, with the unit of each."""
        if self._is_yokogawa:
            for command in FIRST_ITEM:
                self._dialogue.send(command)
            if IS_POWER.fullmatch(self._dialogue.answer_if_known("NUM:ITEM1?", PROBE)):
                return {"NUM:VAL?": "W"}
        choices = (
            ({"MEAS:CURR?": "A"},)
            if self._voltage
            else ({"MEAS:POW?": "W"}, {"MEAS:VOLT?": "V", "MEAS:CURR?": "A"})
        )
        for questions in choices:
            if all(self._understands(question, unit) for question, unit in questions.items()):
                return questions
        wanted = (
            "current" if self._voltage else "power, nor voltage and current; give ?voltage= for an ammeter"
        )
        raise InstrumentError(
            f"{self._name}: {self._dialogue.identity} does not measure {wanted}", Fault.WRONG_INSTRUMENT
        )

    def _understands(self, question: str, unit: str) -> bool:
        """Return whether the instrument answers a question with a number."""
        if not (answer := self._dialogue.answer_if_known(question, PROBE)):
            return False
        try:
            number_in(answer, unit, self._name)
        except InstrumentError as error:
            return error.fault is not Fault.GARBLED
        return True

    def _find_errors(self) -> str:
        """Clear the list of errors of those of the search; return the question for it, if there is one."""
        self._dialogue.send("*CLS")
        question = "STAT:ERR?" if self._is_yokogawa else "SYST:ERR?"
        return question if is_error(self._dialogue.answer_if_known(question, PROBE)) else ""

    def _measure(self) -> None:
        """Wait for the power now."""
        self._begin()
        self._come_in(math.inf)

    def _begin(self, n_asked: int = 0) -> None:
        """Send the first question of a sample."""
        self._pending = _Pending(self._clock(), n_asked)
        self._dialogue.begin(next(iter(self._questions)))

    def _come_in(self, end: float) -> list[PowerSample]:
        """Return the sample that was asked for, nothing if its answers are not there by a time [s]."""
        pending, questions = self._pending, list(self._questions.items())
        while (answer := self._dialogue.answer_before(end)) is not None:
            place = len(pending.values)
            value = number_in(answer, questions[place][1], self._name)
            if not self._forms[place].is_whole(answer, value):
                self._ask_once_more(answer)
                pending = self._pending
                continue
            pending.values.append(value)
            if len(pending.values) == len(questions):
                return [self._sample(pending)]
            self._dialogue.begin(questions[place + 1][0])
        return []

    def _ask_once_more(self, answer: str) -> None:
        """Ask anew for all of a sample, one of whose answers may have lost a digit."""
        if self._pending.n_asked == MOST_ASKED:
            raise InstrumentError(
                f"{self._name}: answers {answer[:SHOWN]!r}, and each time in another form; is the line bad?",
                Fault.GARBLED,
            )
        self._begin(self._pending.n_asked + 1)

    def _sample(self, pending: _Pending) -> PowerSample:
        """Return the sample that some answers make."""
        power = math.prod(pending.values) * (self._voltage or 1.0)
        require_power(self._driver(), self._name, power)
        self._require_forwards(power, "swap the leads")
        since = time.monotonic() - self._dialogue.came
        return self._sampling.sample(power, pending.sent, max(self._clock() - since, pending.sent))

    def _read_error(self) -> tuple[int, str]:
        """Return the last of the instrument's errors, 0 where it had none, and clear them."""
        last = (0, "")
        for _ in range(MOST_ERRORS if self._list_of_errors else 0):
            answer = self._dialogue.ask(self._list_of_errors)
            try:
                code, words = error_in(answer)
            except ValueError as error:
                raise InstrumentError(
                    f"{self._name}: its errors cannot be read ({error})", Fault.GARBLED
                ) from None
            if code == 0:
                break
            last = (code, words)
        return last


class VisaPowerMeter(ScpiPowerMeter):
    """A SCPI instrument at whatever PyVISA reaches; as `ScpiPowerMeter`, but each answer is waited for.

    Parameters
    ----------
    url : str
        PyVISA's name of the resource; "?voltage=5.0" after it as for `ScpiPowerMeter`.
    clock, timeout
        As of `ScpiPowerMeter`.
    """

    def _driver(self) -> str:
        return "visa"

    def _open_line(self, place: str, timeout: float) -> ScpiLine:
        return VisaLine(place, timeout)


@dataclass(slots=True)
class _Pending:
    """A sample that was begun: when, and what has come of it."""

    sent: float = 0.0  # on the clock of the samples [s]
    n_asked: int = 0  # how often it was begun before
    values: list[float] = field(default_factory=list)

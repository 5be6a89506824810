"""Bench instruments that speak SCPI as power meters: supplies, power analysers, multimeters.

Tested against an emulated instrument over sockets and PyVISA-py, not on one.
"""

from __future__ import annotations

import math
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
from evenlight.hardware.drivers.scpi_lines import (
    ScpiLine,
    SocketLine,
    VisaLine,
    error_in,
    error_in_words,
    is_error,
    is_identity,
    number_in,
)
from evenlight.hardware.protocols import Fault, InstrumentError

TIMEOUT = 5.0  # [s] a multimeter may average over a second or more
SLOWEST, FASTEST = 0.01, 1000.0  # [Hz]
PROBE = 2.0  # [s] in which an instrument answers a question that it knows
MOMENT = 0.0005  # [s] between two looks at the line
PATIENCE = 0.005  # [s] that a call of `samples` waits for an answer; a slow one is there at the next call
OPTIONS = {"voltage": "of the supply [V], for an instrument that measures current only"}
MOST_ERRORS = 20  # that an instrument's list is read of


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
        self._in_step = True  # whether the next line that comes is the answer to the next question
        try:
            self._identity = self._identify()
            self._questions = self._find_questions()
        except BaseException:
            self._line.close()
            raise

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved: no higher than it answers.

        Raises
        ------
        InstrumentError
            If the rate is one that no such instrument has, or it does not measure.
        """
        self._require_open()
        require_sample_rate(rate, SLOWEST, FASTEST, self._name)
        self._pending = _Pending()
        self._get_in_step()
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
        if not self._pending.is_asked:
            self._get_in_step()
            if not self._sampling.is_due(self._clock()):
                return []
            self._ask_next()
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
        left = self._come_in(math.inf) if self._pending.is_asked else []
        code, words = self._read_error()
        if code:
            raise InstrumentError(f"{self._name}: {error_in_words(code, words)}", Fault.REFUSED, str(code))
        return left

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself."""
        supply = "" if self._voltage is None else f" times {self._voltage:g} V"
        return {
            "power_meter": self._identity,
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

    def _identify(self) -> str:
        """Return what the instrument calls itself; refuse what speaks no SCPI."""
        try:
            self._line.forget()
            self._line.write("*IDN?")
            identity = self._line.answer(self._timeout)
        except InstrumentError as error:
            if error.fault is Fault.DISCONNECTED:
                raise InstrumentError(
                    f"{self._name}: closed the connection at once; is another program connected to it?",
                    Fault.BUSY,
                ) from None
            raise
        if not is_identity(identity):
            raise InstrumentError(
                f"{self._name}: answers {identity[:60]!r} to *IDN?, and that is no SCPI instrument's; "
                "which instrument is there?",
                Fault.WRONG_INSTRUMENT,
            )
        return identity

    def _find_questions(self) -> tuple[str, ...]:
        """Return the questions whose answers make power."""
        self._line.write("*CLS")
        choices = (("MEAS:CURR?",),) if self._voltage else (("MEAS:POW?",), ("MEAS:VOLT?", "MEAS:CURR?"))
        for questions in choices:
            if all(self._understands(question) for question in questions):
                return questions
        wanted = (
            "current" if self._voltage else "power, nor voltage and current; give ?voltage= for an ammeter"
        )
        raise InstrumentError(
            f"{self._name}: {self._identity} does not measure {wanted}", Fault.WRONG_INSTRUMENT
        )

    def _understands(self, question: str) -> bool:
        """Return whether the instrument answers a question with a number."""
        self._line.write(question)
        answers = []
        try:
            answers.append(self._line.answer(min(PROBE, self._timeout)))
        except InstrumentError as error:
            if error.fault is not Fault.NO_REPLY:
                raise
        self._line.write("SYST:ERR?")
        while not answers or not is_error(answers[-1]):
            answers.append(self._line.answer(self._timeout))
        return len(answers) > 1 and error_in(answers[-1])[0] == 0

    def _measure(self) -> float:
        """Return the power now [W], waiting for it."""
        self._pending = _Pending()
        self._ask_next()
        (sample,) = self._come_in(math.inf)
        return sample.power

    def _ask_next(self) -> None:
        """Send the next question of a sample."""
        if not self._pending.is_asked:
            self._pending = _Pending(is_asked=True, sent=self._clock())
        self._pending.asked = time.monotonic()
        self._line.write(self._questions[len(self._pending.values)])

    def _come_in(self, end: float) -> list[PowerSample]:
        """Return the sample that was asked for, nothing if its answers are not there by a time [s]."""
        pending = self._pending
        while len(pending.values) < len(self._questions):
            answer = self._answer_before(end)
            if answer is None:
                return []
            pending.values.append(self._number(answer))
            if len(pending.values) < len(self._questions):
                self._ask_next()
        self._pending = _Pending()
        power = math.prod(pending.values) * (self._voltage or 1.0)
        self._require_forwards(power, "swap the leads")
        return [self._sampling.sample(power, pending.sent, self._clock())]

    def _answer_before(self, end: float) -> str | None:
        """Return an answer that is there by a time [s]; raise if it took longer than an answer may."""
        try:
            while (answer := self._line.answer_waiting()) is None:
                if time.monotonic() > self._pending.asked + self._timeout:
                    raise InstrumentError(
                        f"{self._name}: no reply to {self._questions[len(self._pending.values)]} within "
                        f"{self._timeout:g} s; is it switched on, and remote?",
                        Fault.NO_REPLY,
                    )
                if time.monotonic() >= end:
                    return None
                time.sleep(MOMENT)
        except InstrumentError:
            self._lose_step()
            raise
        return answer

    def _number(self, answer: str) -> float:
        """Return the number of an answer."""
        try:
            return number_in(answer, self._name)
        except InstrumentError:
            self._lose_step()
            raise

    def _lose_step(self) -> None:
        """Take no line for an answer until the instrument has identified itself again."""
        self._in_step, self._pending = False, _Pending()

    def _get_in_step(self) -> None:
        """Make sure that the next line is the answer to the next question.

        After a question without an answer, its answer may come yet: it is waited for until the line is quiet,
        and whatever comes before the instrument's name is thrown away.
        """
        if self._in_step:
            return
        self._line.forget()
        self._line.write("*IDN?")
        end = time.monotonic() + self._timeout
        while self._line.answer(max(end - time.monotonic(), 0.0)) != self._identity:
            pass
        self._in_step = True

    def _read_error(self) -> tuple[int, str]:
        """Return the last of the instrument's errors, 0 where it had none, and clear them."""
        self._get_in_step()
        last = (0, "")
        for _ in range(MOST_ERRORS):
            self._line.write("SYST:ERR?")
            try:
                code, words = error_in(self._line.answer(self._timeout))
            except (InstrumentError, ValueError) as error:
                self._lose_step()
                if isinstance(error, InstrumentError):
                    raise
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
    """A sample that was begun: what was asked when, and what has come of it."""

    is_asked: bool = False
    sent: float = 0.0  # on the clock of the samples [s]
    asked: float = 0.0  # on the computer's own [s]
    values: list[float] = field(default_factory=list)

"""Questions to a SCPI instrument, each paired with its answer (docs/decisions/scpi-in-step.md).

A line that nobody asked for would shift all answers by one. So every question goes out together with a number
of its own, which the instrument repeats in the same line; one that takes no two questions in a line is asked
for its name after every answer, and the answer counts once the name has come.
"""

from __future__ import annotations

import itertools
import math
import time

from evenlight.hardware.drivers.scpi_answers import SHOWN, is_identity
from evenlight.hardware.drivers.scpi_lines import ScpiLine
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError

MOMENT = 0.0005  # [s] between two looks at the line
# [s] for its name, and for the numbers that not every instrument repeats: a wrong port is told soon
OPENING, REPEATING = 1.5, 0.8
NAME = "*IDN?"
# What the register *ESE is set to and asked for: bits that every instrument keeps (IEEE 488.2, 11.5.1).
NUMBERS = tuple(number for number in range(4, 64) if not number & 2)


class ScpiDialogue:
    """What is asked, and what is answered to it.

    Parameters
    ----------
    line : ScpiLine
        To the instrument.
    timeout : float
        How long an answer may take [s].

    Raises
    ------
    InstrumentError
        If nothing answers, or what does is no SCPI instrument.
    """

    def __init__(self, line: ScpiLine, timeout: float) -> None:
        self._line, self._timeout, self._name = line, timeout, line.name
        self._numbers = itertools.cycle(NUMBERS)
        self._question, self._sent, self._number, self._asked = "", "", "", 0.0
        self._answer: str | None = None  # that has come, and waits for the name after it
        self._in_step = True  # whether nothing but the answer to the next question can come
        self.came = 0.0  # when the last answer did, on the computer's own clock [s]
        self.identity = self._identify(min(timeout, OPENING))
        self._is_joined = self._repeats_numbers(min(timeout, REPEATING))

    @property
    def is_asked(self) -> bool:
        """Whether an answer is waited for."""
        return bool(self._question)

    def begin(self, question: str) -> None:
        """Send a question; `answer_before` has its answer."""
        if self._question or not self._line.is_quiet():  # an answer that nobody took, or asked for
            self.lose_step()
        self.get_in_step()
        self._question, self._number, self._answer = question, str(next(self._numbers)), None
        self._asked = time.monotonic()
        self.send(f"{question};*ESE {self._number};*ESE?" if self._is_joined else question)

    def answer_before(self, end: float) -> str | None:
        """Return the answer to the last question, None if it is not there by a time [s].

        Raises
        ------
        InstrumentError
            NO_REPLY if it took longer than an answer may; GARBLED if something else came; DISCONNECTED.
        """
        try:
            while not self._completes(line := self._line.answer_waiting(self._left())):
                if self._left() <= 0:
                    raise InstrumentError(
                        f"{self._name}: no reply to {self._question} within {self._timeout:g} s; is it "
                        "switched on, and remote?",
                        Fault.NO_REPLY,
                    )
                if line is None and time.monotonic() >= end:
                    return None
                time.sleep(0 if line else MOMENT)
        except InstrumentError:
            self.lose_step()
            raise
        self._question = ""
        return self._answer

    def ask(self, question: str) -> str:
        """Return the answer to a question, waiting for it; raises as `answer_before`."""
        self.begin(question)
        return self.answer_before(math.inf) or ""

    def answer_if_known(self, question: str, timeout: float) -> str:
        """Return the answer to a question that the instrument may not know, nothing if none comes."""
        whole, self._timeout = self._timeout, min(timeout, self._timeout)
        try:
            return self.ask(question)
        except InstrumentError as error:
            if error.fault not in TRANSIENT:
                raise
            return ""
        finally:
            self._timeout = whole

    def send(self, message: str) -> None:
        """Send a question or command; some serial converters send it back as a line of its own."""
        self._sent = message
        self._line.write(message)

    def lose_step(self) -> None:
        """Take no line for an answer until one has come that only a question asked from now on has."""
        self._in_step, self._question = False, ""

    def get_in_step(self) -> None:
        """Make sure that the next line is the answer to the next question.

        What is late is waited for until the line is quiet; what comes before the mark is thrown away.
        """
        if self._in_step:
            return
        self._line.forget()
        mark, question = self.identity, NAME
        if self._is_joined:
            mark = str(next(self._numbers))
            question = f"*ESE {mark};*ESE?"
        self.send(question)
        end = time.monotonic() + self._timeout
        while (line := self._line.answer(max(end - time.monotonic(), 0.0))).lstrip("+") != mark:
            if time.monotonic() > end:
                raise InstrumentError(
                    f"{self._name}: sends {line[:SHOWN]!r} and more that was not asked for", Fault.GARBLED
                )
        self._in_step = True

    def _left(self) -> float:
        """Return how long the line that is waited for may take yet [s]."""
        return self._asked + self._timeout - time.monotonic()

    def _completes(self, line: str | None) -> bool:
        """Return whether a line completes the answer: no line does not, nor the question sent back."""
        if line is None or line == self._sent:
            return False
        mark, wanted = line, self.identity
        if self._is_joined or self._answer is None:
            self.came = self._asked = time.monotonic()
            self._answer = line
            if not self._is_joined:
                self.send(NAME)
                return False
            (self._answer, _, mark), wanted = line.rpartition(";"), self._number
        if mark.strip().lstrip("+") != wanted:
            raise InstrumentError(
                f"{self._name}: {line[:SHOWN]!r} came, which is no answer to {self._question}; does another "
                "program ask it, too, or is the line disturbed?",
                Fault.GARBLED,
            )
        return True

    def _first_answer(self, question: str, timeout: float) -> str:
        """Return the next line after a question, its echo left out."""
        self.send(question)
        line = self._line.answer(timeout)
        return self._line.answer(timeout) if line == self._sent else line

    def _identify(self, timeout: float) -> str:
        """Return what the instrument calls itself, each time that it is asked; refuse what speaks no SCPI."""
        try:
            self._line.forget()
            names = [self._first_answer(NAME, timeout) for _ in range(2)]
        except InstrumentError as error:
            if error.fault is Fault.DISCONNECTED:
                raise InstrumentError(
                    f"{self._name}: closed the connection at once; is another program connected to it?",
                    Fault.BUSY,
                ) from None
            raise
        if len(set(names)) > 1 or not is_identity(names[0]):
            answers = " and then ".join(repr(name[:SHOWN]) for name in dict.fromkeys(names))
            raise InstrumentError(
                f"{self._name}: answers {answers} to {NAME}, and that is no SCPI instrument's; "
                "which instrument is there?",
                Fault.WRONG_INSTRUMENT,
            )
        return names[0]

    def _repeats_numbers(self, timeout: float) -> bool:
        """Return whether the instrument takes several questions in one line, and repeats numbers."""
        first, second = next(self._numbers), next(self._numbers)
        try:
            line = self._first_answer(f"*ESE {first};*ESE?;*ESE {second};*ESE?", timeout)
        except InstrumentError as error:
            if error.fault not in TRANSIENT:
                raise
            line = ""
        repeats = [number.strip().lstrip("+") for number in line.split(";")] == [str(first), str(second)]
        self._is_joined, self._in_step = repeats, repeats
        return repeats

"""A program that runs beside us and speaks JSON, a line for each question and each answer (docs/drivers.md).

An answer repeats the `id` of its question. Whatever else comes ends the program, which the next question
starts anew: so a late or doubled answer is never taken for the next. What it prints on standard error is
shown when it fails. It is ended with all that it has started.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import shlex
import shutil
import signal
import subprocess
import textwrap
import time
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.hardware.operating_system import require_unix
from evenlight.hardware.protocols import Fault, InstrumentError

AT_ONCE = 65536  # bytes
LONGEST_LINE = 65536  # bytes: what is longer is no answer
LARGEST = 1e300  # of any unit
KEPT = 4096  # bytes of standard error
SHOWN = 80  # characters of what came that a message quotes
GRACE = 1.0  # [s] in which a program ends when its standard input does, or when it is asked to
FAULTS = {each.value: each for each in (Fault.OVER_RANGE, Fault.UNDER_RANGE, Fault.LOW_BATTERY, Fault.BUSY)}


class ProgramLines:
    """The lines of a program, which is started with the first question.

    Parameters
    ----------
    command : str
        The program and its arguments, as a shell splits them; no shell runs them.

    Raises
    ------
    InputError
        If the command cannot be split.
    InstrumentError
        If there is no such program.
    """

    def __init__(self, command: str) -> None:
        self.name = f"exec:{textwrap.shorten(command, SHOWN, placeholder='…')}"
        require_unix(self.name)
        try:
            self._words = shlex.split(command)
        except ValueError as error:
            raise InputError(f"{self.name}: {error}; quote words as a shell takes them") from None
        if not self._words or shutil.which(self._words[0]) is None:
            program = self._words[0] if self._words else ""
            raise InstrumentError(
                f"{self.name}: there is no program {program!r} that can be run; give its path, and make it "
                "executable",
                Fault.NOT_FOUND,
            )
        self._process: Any = None  # a Popen with its three pipes
        self._came = self._said = b""  # of standard output, not yet taken; the last of standard error
        self._id = 0  # of the last question

    def ask(self, question: dict[str, Any], timeout: float) -> dict[str, Any]:
        """Return the answer to a question, which gets an id, within a time [s]; else end the program."""
        end = time.monotonic() + timeout
        try:
            self._send(question)
            while not (answers := self.lines_within(max(end - time.monotonic(), 0.0), most=1)):
                if time.monotonic() >= end:
                    raise self.error(f"no answer within {timeout:g} s", Fault.NO_REPLY)
            if answers[0].get("id") != self._id:
                found = json.dumps(answers[0])[:SHOWN]
                raise self.error(f'answered {found!r}, without "id": {self._id}', Fault.GARBLED)
        except BaseException:
            self.end()
            raise
        return answers[0]

    def lines_within(self, wait: float, most: int = -1) -> list[dict[str, Any]]:
        """Return the whole lines that are there; wait for what comes next for some time [s] if none is."""
        if b"\n" not in self._came or most < 0:
            self._take(wait)
        *lines, self._came = self._came.split(b"\n", most)
        if len(self._came) > LONGEST_LINE and not lines:
            raise self.error("prints a line without an end", Fault.GARBLED)
        return [self._parsed(line) for line in lines]

    def end(self) -> None:
        """End the program, and all that it has started; more than once does nothing."""
        process, self._process = self._process, None
        if process is None:
            return
        for pipe in (process.stdin, process.stdout):  # without a reader, what prints on and on ends
            with contextlib.suppress(OSError):
                pipe.close()
        for number in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(GRACE)
                break
            self._signal(process, number)
        self._signal(process, signal.SIGKILL)  # what it has started, and left
        process.wait()
        process.stderr.close()

    def error(self, words: str, fault: Fault = Fault.REFUSED) -> InstrumentError:
        """Return an error that names the program, with the last line of its standard error."""
        lines = [line for line in self._said.decode(errors="replace").splitlines() if line.strip()]
        said = f"; it said {lines[-1].strip()[:SHOWN]!r}" if lines else ""
        return InstrumentError(f"{self.name}: {words}{said}", fault)

    def number(self, answer: dict[str, Any], key: str) -> float:
        """Return a number of an answer, if it is there and one, and the answer tells of no error."""
        if "error" in answer:
            fault = FAULTS.get(str(answer.get("fault")), Fault.REFUSED)
            raise InstrumentError(
                f"{self.name}: {' '.join(str(answer['error']).split())[: 2 * SHOWN]}", fault
            )
        value = answer.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
            raise self.error(f"expected a number {key}, got {json.dumps(answer)[:SHOWN]!r}", Fault.GARBLED)
        return float(value)

    def _send(self, question: dict[str, Any]) -> None:
        if self._process is None:
            self._came = self._said = b""
            try:
                self._process = subprocess.Popen(
                    self._words,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    start_new_session=True,  # Ctrl-C is for us: we put a backlight back, and end the program
                )
            except OSError as error:
                raise self.error(f"cannot be run ({error.strerror})", Fault.NOT_FOUND) from None
        os.set_blocking(self._process.stdin.fileno(), False)
        self._id += 1
        with contextlib.suppress(OSError):  # it reads none, or has ended: what it prints tells
            os.write(self._process.stdin.fileno(), json.dumps({"id": self._id} | question).encode() + b"\n")

    def _take(self, wait: float) -> None:
        """Take what the program has printed; wait for it for some time [s] at most."""
        if self._process is None:
            raise self.error("does not run any more", Fault.DISCONNECTED)
        out, err = self._process.stdout, self._process.stderr
        ready, _, _ = select.select([out, err], [], [], wait)
        part = os.read(err.fileno(), AT_ONCE) if err in ready else b""
        self._said = (self._said + part)[-KEPT:]
        if out not in ready:
            if err in ready and not part:
                time.sleep(min(wait, 0.01))  # it has closed its standard error, which is always ready then
            return
        if part := os.read(out.fileno(), AT_ONCE):
            self._came += part
        elif self._came:
            self._came += b"\n"  # the last line of a program that has ended
        else:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
            if select.select([err], [], [], 0)[0]:
                self._said = (self._said + os.read(err.fileno(), AT_ONCE))[-KEPT:]
            code = self._process.poll()
            self.end()
            how = "closed its output" if code is None else f"ended with code {code}"
            raise self.error(f"{how}, and gave no answer", Fault.DISCONNECTED)

    def _parsed(self, line: bytes) -> dict[str, Any]:
        try:
            answer = json.loads(line)
        except (ValueError, RecursionError):
            answer = None
        if not isinstance(answer, dict):
            shown = line.decode(errors="backslashreplace").strip()[:SHOWN]
            words = f"printed {shown!r}, which is no JSON object; anything else goes to standard error"
            raise self.error(words, Fault.GARBLED)
        return answer

    @staticmethod
    def _signal(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, number)

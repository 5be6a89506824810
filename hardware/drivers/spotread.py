"""Any colorimeter or spectrometer that ArgyllCMS knows, through its program `spotread`.

Each reading is one run of the program, so that no late answer can be taken for that to a later question.
Written from the program's source, and tested against a program that prints the same lines, not against an
instrument.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from collections.abc import Sequence

from evenlight.data_schema.errors import InputError
from evenlight.hardware.plausibility import require_luminance
from evenlight.hardware.protocols import Fault, Instrument, InstrumentError, Reading

READING_TIME = 60.0  # [s] a colorimeter takes some 10 s in the dark, and some seconds to be found
LISTING_TIME = 20.0  # [s] it looks for instruments at every port
ADDRESS = re.compile(r"(\d*)(?:@(.+))?")
# Emissive, with Yxy, without a calibration at the start, once. Its answer to a question is to give up.
OPTIONS = ("-e", "-x", "-N", "-O")
GIVE_UP = "q\nq\n"
NUMBER = r"(-?\d+\.\d{6})"  # printf's %f
RESULT = re.compile(rf"Result is XYZ: {NUMBER} {NUMBER} {NUMBER}, Yxy: {NUMBER} {NUMBER} {NUMBER}\r?\n")
LISTED = re.compile(r"^\s+(\d+) = '(.*)'", re.M)
VERSION = re.compile(r"Version (\S+)")

# What it prints, from spotread.c and the drivers of its instruments; the first that is there says why.
REASONS: tuple[tuple[str, str, Fault], ...] = (
    (r"No ports found|No instrument at port", "no instrument there; is it plugged in?", Fault.NOT_FOUND),
    (r"Device being used", "another program uses the instrument; end that first", Fault.BUSY),
    (r"Permission denied", "may not be opened; install ArgyllCMS's udev rules", Fault.NOT_FOUND),
    (
        r"Unknown, inappropriate or no instrument detected",
        "no instrument that it knows; `spotread -?` lists the ports",
        Fault.WRONG_INSTRUMENT,
    ),
    (r"doesn't support it", "the instrument cannot measure light of a display", Fault.WRONG_INSTRUMENT),
    (r"[Bb]attery (level )?too low", "its battery is low: charge or change it", Fault.LOW_BATTERY),
    (r"[Ss]aturat|too high|[Tt]oo bright", "too bright for it", Fault.OVER_RANGE),
    (r"Light level is too low", "too dark for it", Fault.UNDER_RANGE),
    (
        r"needs (a )?calibration",
        "it has to be calibrated first: run `spotread -e` at the bench, and do what it says",
        Fault.REFUSED,
    ),
    (r"wrong position", "its sensor is in the wrong position: turn it to the display", Fault.REFUSED),
    (r"misread", "it misread", Fault.GARBLED),
    (r"communication problem", "its reply was lost", Fault.NO_REPLY),
    (
        r"Failed to initialise communications|Communications failure|Instrument Access Failed",
        "it does not answer; is it still plugged in?",
        Fault.DISCONNECTED,
    ),
    (r"fatal error", "it failed", Fault.REFUSED),
)


class Spotread(Instrument):
    """An instrument of ArgyllCMS.

    The address is the instrument's number in the program's list, 1 if left out; then, if the program is not
    on the path, "@" and where it is: "", "2", "2@/opt/argyll/bin/spotread". Parameters as of `Instrument`.
    """

    longest = READING_TIME

    def _open(self, address: str) -> None:
        match = ADDRESS.fullmatch(address)
        if match is None:
            raise InputError(
                f"spotread:{address}: expected a number of its list, and @PROGRAM if it is not on the path"
            )
        self._number, self._program = match[1] or "1", match[2] or "spotread"
        self._name = f"spotread, instrument {self._number}"
        self._version, self._instrument = self._looked_up()

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2].

        Raises
        ------
        InstrumentError
            If there is none.
        """
        self._require_open()
        begun = self._clock()
        printed = self._run([*OPTIONS, "-c", self._number], self._timeout)
        ended = self._clock()
        results = list(RESULT.finditer(printed))
        if not results:
            raise self._failure(printed)
        X, Y, Z, luminance, x, y = (float(number) for number in results[0].groups())
        total = X + Y + Z
        agree = luminance == Y and math.isclose(x * total, X, abs_tol=2e-6 * (1 + total))
        if len(results) > 1 or not agree:  # it was to measure once, and prints Y twice
            raise self._error(f"printed no single result{_last_line(printed)}", Fault.GARBLED)
        if luminance <= 0:  # it shows what is below zero as 0
            raise self._error("too dark for it: it shows 0", Fault.UNDER_RANGE)
        require_luminance("spotread", self._name, luminance, (x, y))
        return Reading(luminance, "cd/m^2", begun, ended, "Result is XYZ", (x, y))

    def apparatus(self) -> dict[str, str]:
        """Return what the program says of itself and of the instrument."""
        return {"model": self._instrument, "program": f"ArgyllCMS spotread {self._version}"}

    def _looked_up(self) -> tuple[str, str]:
        if shutil.which(self._program) is None:
            raise InstrumentError(
                f"{self._program}: no such program; install ArgyllCMS (on Debian: apt install argyll)",
                Fault.NOT_FOUND,
            )
        printed = self._run(["-?"], min(LISTING_TIME, self._timeout))
        version = VERSION.search(printed)
        if version is None:
            raise InstrumentError(f"{self._program}: is not ArgyllCMS's spotread", Fault.WRONG_INSTRUMENT)
        listed = dict(LISTED.findall(printed))
        if self._number not in listed:
            names = ", ".join(f"{number} ({name})" for number, name in listed.items()) or "none"
            raise self._error(f"not in its list; there is {names}", Fault.NOT_FOUND)
        return version[1], listed[self._number]

    def _run(self, options: Sequence[str], timeout: float) -> str:
        environment = os.environ | {"ARGYLL_NOT_INTERACTIVE": "1"}
        try:
            done = subprocess.run(
                [self._program, *options],
                input=GIVE_UP.encode(),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment,
                timeout=timeout,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            printed = _text(error.stdout or b"")
            raise self._error(
                f"took longer than {timeout:g} s and was ended{_last_line(printed)}; does it "
                "wait for a key, or for a port that does not answer?",
                Fault.NO_REPLY,
            ) from None
        except OSError as error:
            raise InstrumentError(
                f"{self._program}: cannot be run ({error.strerror})", Fault.NOT_FOUND
            ) from None
        return _text(done.stdout)

    def _failure(self, printed: str) -> InstrumentError:
        for pattern, words, fault in REASONS:
            if found := re.search(pattern, printed):
                return self._error(f"{words} ({_line_of(printed, found)!r})", fault, found[0])
        return self._error(f"ended without a result{_last_line(printed)}", Fault.GARBLED)


def _text(printed: bytes) -> str:
    return printed.decode("utf-8", errors="backslashreplace")


def _line_of(printed: str, found: re.Match[str]) -> str:
    begin = printed.rfind("\n", 0, found.start()) + 1
    end = printed.find("\n", found.end())
    return printed[begin : end if end >= 0 else None].strip()


def _last_line(printed: str) -> str:
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    return f" after {lines[-1][:80]!r}" if lines else ", having printed nothing"

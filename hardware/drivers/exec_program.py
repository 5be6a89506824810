"""Instruments that a program of the user's drives, one line of JSON for each reading or setting.

For whatever has no driver here: a vendor's library, another language, a script (docs/drivers.md). What these
devices return is checked by `hardware.guarded_devices`, as that of packages.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.backlights import require_factor, restore_and_release
from evenlight.hardware.drivers.power_sampling import SamplingMeter, require_sample_rate
from evenlight.hardware.drivers.program_lines import ProgramLines
from evenlight.hardware.protocols import Fault, Instrument, Reading

READING_TIME = 60.0  # [s] a spectrometer takes as long in the dark
SETTING_TIME = 10.0  # [s]
SLOWEST, FASTEST = 0.1, 10_000.0  # [Hz] as fast as lines of text are read
SILENCE = 2.0  # [s] without a sample, or the time of
SILENT_SAMPLES = 10  # samples if that is longer


class ExecDevice(Instrument):
    """What the three share: the program, which is started with the first question.

    The address is the program and its arguments; parameters as of `Instrument`.
    """

    longest = SETTING_TIME

    def _open(self, address: str) -> None:
        self._program = ProgramLines(address)
        self._name = self._program.name

    def _identity(self, model: str, serial: str) -> dict[str, str]:
        self._require_open()
        answer = self._program.ask({"read": "apparatus"}, self._timeout)
        said = {model: answer.get("model", "a program's"), serial: answer.get("serial_number")}
        known = {key: " ".join(str(words).split()) for key, words in said.items() if words is not None}
        return known | {"program": self._name}

    def close(self) -> None:
        """End the program; more than once does nothing."""
        self._closed = True
        self._program.end()


class ExecLuminanceMeter(ExecDevice):
    """A luminance meter behind a program."""

    longest = READING_TIME

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2]."""
        self._require_open()
        begun = self._clock()
        answer = self._program.ask({"read": "luminance"}, self._timeout)
        ended = self._clock()
        luminance = self._program.number(answer, "luminance_cd_m2")
        x_y = None
        if "x" in answer or "y" in answer:
            x_y = (self._program.number(answer, "x"), self._program.number(answer, "y"))
        return Reading(luminance, "cd/m^2", begun, ended, str(answer.get("status", "")), x_y)

    def apparatus(self) -> dict[str, str]:
        """Return what the program says of the instrument, and which program it is."""
        return self._identity("model", "serial number")


class ExecPowerMeter(SamplingMeter, ExecDevice):
    """A power meter behind a program, which runs from `start` to `stop`."""

    _rates = (SLOWEST, FASTEST)

    def _begin(self, rate: float) -> float:
        self.stop()
        answer = self._program.ask({"rate_hz": rate}, self._timeout)
        self._rate, self._count = self._program.number(answer, "rate_hz"), 0
        require_sample_rate(self._rate, SLOWEST, FASTEST, f"{self._name}: the rate that it states")
        self._looked, self._heard = self._clock(), time.monotonic()  # when a sample was heard of last
        return self._rate

    def _news(self) -> Sequence[PowerSample]:
        answers, before, now = self._program.lines_within(0.0), self._looked, self._clock()
        self._looked = now
        if answers:
            self._heard = time.monotonic()
        elif time.monotonic() - self._heard > max(SILENCE, SILENT_SAMPLES / self._rate):
            raise self._program.error("sends no more samples", Fault.NO_REPLY)
        # Those without a time of their own came evenly since the last look.
        return [
            self._sample(answer, before + (now - before) * place / len(answers), now)
            for place, answer in enumerate(answers, start=1)
        ]

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling and the program, and return the samples that had not been taken."""
        try:
            return self.samples() if self._sampling else []
        finally:
            self._sampling = False
            self._program.end()

    def apparatus(self) -> dict[str, str]:
        """Return what the program says of the instrument, and which program it is; not while it samples."""
        try:
            return self._identity("power_meter", "power_meter_serial")
        finally:
            self._program.end()

    def _sample(self, answer: dict[str, Any], came: float, received: float) -> PowerSample:
        power = self._program.number(answer, "power_w")
        time_ = self._program.number({"time_s": came} | answer, "time_s")
        count = self._program.number({"count": self._count} | answer, "count")
        if count < 0 or count != int(count):
            raise self._program.error(f"its samples are out of order at count {count:g}", Fault.GARBLED)
        self._count = int(count) + 1
        return PowerSample(int(count), time_, received, power, answer.get("sync") is True)


class ExecBacklight(ExecDevice):
    """A backlight behind a program, left as it was found."""

    def _open(self, address: str) -> None:
        super()._open(address)
        try:
            answer = self._program.ask({"read": "factor"}, self._timeout)
            keys = ("factor", "smallest_factor", "step", "min_interval_s")
            numbers = [self._program.number({"min_interval_s": 0.0} | answer, key) for key in keys]
            self._found, self._smallest, self._step, self._interval = numbers
            if not (0 <= self._found <= 1 and self._smallest > 0 and self._step > 0):
                words = "factor must lie between 0 and 1; smallest_factor and step must be above 0"
                raise self._program.error(words, Fault.IMPLAUSIBLE)
        except BaseException:
            self._program.end()
            raise

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device."""
        self._require_open()
        require_factor(factor, self._smallest, self._name)
        return self._asked({"factor": factor})

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        self._require_open()
        return self._asked({"read": "factor"})

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return self._smallest

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return self._step

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._interval

    def close(self) -> None:
        """Leave the device as it was found, and end the program; more than once does nothing."""
        if not self._closed:
            self._closed = True
            restore_and_release(lambda: self._asked({"factor": self._found}), self._program.end)

    def _asked(self, question: dict[str, Any]) -> float:
        return self._program.number(self._program.ask(question, self._timeout), "factor")

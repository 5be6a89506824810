"""Our power board as a power meter and as the PWM of a backlight, which share the board at a port.

The port is closed with the last of them. Tested against an emulated board, not on one.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence

from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.backlights import SteppedBacklight
from evenlight.hardware.drivers import board_protocol as protocol
from evenlight.hardware.drivers.board_link import TIMEOUT, board_at
from evenlight.hardware.drivers.board_protocol import number_in, whole_in
from evenlight.hardware.drivers.power_sampling import SamplingMeter
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, Instrument, InstrumentError

SILENCE = 1.0  # [s] without a sample, or 20 of them, after which a board has stopped sending
SILENT_SAMPLES = 20
ZEROING = 3.0  # [s] that the board may take to average its zero


class BoardPowerMeter(SamplingMeter, Instrument):
    """The power meter of a power board; parameters as of `PowerBoard`."""

    before_zero = "unplug the panel from the board's output, so that no current flows"
    longest = TIMEOUT
    _why = ", sensor and line,"

    def _open(self, address: str) -> None:
        self._board = board_at(address, self._clock, self._timeout)
        self._name, self._rates = self._board.name, (protocol.SLOWEST, self._board.identity.highest_rate)
        self._pending: list[PowerSample] = []

    def _begin(self, rate: float) -> float:
        self._board.ask("STOP")  # a program that crashed may have left it sampling
        self._board.sample_lines()
        self._pending.clear()
        self._started = self._board_clock()
        self._sequence, self._ticks = _counters(self._started)
        # a whole number of µs between samples
        self._rate = 1e6 / whole_in(self._board.ask(f"START {rate:.6f}"), self._name, lowest=1)
        self._last_sample = time.monotonic()
        return self._rate

    def _news(self) -> Sequence[PowerSample]:
        self._take()  # without lines that were disturbed: their samples are lost
        silence = time.monotonic() - self._last_sample
        if silence > max(SILENCE, SILENT_SAMPLES / self._rate):
            raise self._error(
                f"sent no sample for {silence:.1f} s at {self._rate:g} Hz; {self._board.corrupted_lines} "
                "lines were disturbed since it was opened",
                Fault.NO_REPLY,
            )
        return self._handed_over()

    def _rest(self) -> Sequence[PowerSample]:
        self._board.ask("STOP")
        self._take()
        return self._handed_over()

    def ping(self) -> ClockPing:
        """Return one comparison of the board's clock with the computer's; also while it samples."""
        self._require_open()
        if self._sampling:
            self._take()  # so that the answer waits behind nothing
        sent = self._clock()
        ticks = self._board_clock()
        return ClockPing(sent, ticks * 1e-6, self._clock())

    def zero(self) -> float:
        """Let the board take the current now, with the panel unplugged, for zero; return what it was [A].

        Raises
        ------
        InstrumentError
            If the current is not near zero, or the board is sampling.
        """
        self._require_open()
        return number_in(self._board.ask("ZERO", ZEROING), self._name) * 1e-6

    def apparatus(self) -> dict[str, str]:
        """Return what the board says of itself."""
        said = self._board.identity
        return {
            "power_meter": f"{protocol.FAMILY}, {said.chip}",
            "power_meter_serial": said.serial_number,
            "power_meter_firmware": said.firmware,
            "power_meter_range": f"{said.highest_power:g} W",
            "power_meter_corrupted_lines": str(self._board.corrupted_lines),
        }

    def close(self) -> None:
        """End the sampling, and let go of the board; more than once does nothing."""
        if not self._closed:
            self._closed, self._sampling = True, False
            try:
                with contextlib.suppress(InstrumentError):  # whatever it says: the next START stops it
                    self._board.ask("STOP")
            finally:
                self._board.release()

    def _take(self) -> None:
        for received, body in self._board.sample_lines():
            try:
                line = protocol.parse_sample(body)
            except ValueError as error:
                raise self._error(f"sent {error}", Fault.GARBLED) from None
            ticks = self._ticks.next(line.ticks)
            if ticks <= self._started:  # of the sampling before, and late
                continue
            self._last_sample = time.monotonic()
            self._require_measurement(line)
            self._pending.append(
                PowerSample(
                    self._sequence.next(line.sequence),
                    ticks * 1e-6,
                    received,
                    line.power,
                    protocol.Flag.SYNC in line.flags,
                )
            )

    def _require_measurement(self, line: protocol.SampleLine) -> None:
        require_power("board", self._name, line.power)
        flag = protocol.Flag
        if line.flags & (flag.SHUNT_OVERLOAD | flag.BUS_OVERLOAD):
            what = "current" if flag.SHUNT_OVERLOAD in line.flags else "voltage"
            sensor = self._board.identity
            raise self._error(
                f"the {what} is above what the {sensor.chip} measures, "
                f"{sensor.highest_power:g} W in all; take a smaller shunt, or a sensor of a wider range",
                Fault.OVER_RANGE,
                f"flags {int(line.flags):X}",
            )
        if flag.LOW_SUPPLY in line.flags:
            raise self._error(
                "its own supply is too low to measure right; take another USB port or cable",
                Fault.LOW_BATTERY,
                f"flags {int(line.flags):X}",
            )

    def _handed_over(self) -> list[PowerSample]:
        pending, self._pending = self._pending, []
        return pending

    def _board_clock(self) -> int:
        return whole_in(self._board.ask("CLOCK?"), self._name, lowest=0)


class BoardBacklight(SteppedBacklight, Instrument):
    """The PWM output of a power board, which dims a backlight; parameters as of `PowerBoard`."""

    longest = TIMEOUT
    _min_interval = 0.005  # [s] a command there and back

    def _open(self, address: str) -> None:
        self._board = board_at(address, self._clock, self._timeout)
        self._name, self._steps = self._board.name, self._board.identity.pwm_steps
        try:
            if self._steps == 0:
                raise self._error(protocol.ERROR_WORDS[7], code="7")
            self._found = self._read_step()
        except BaseException:
            self._board.release()
            raise

    def _set(self, step: int) -> None:
        achieved = self._step_in(self._board.ask(f"B {step}"))
        if achieved != step:
            raise self._error(f"the backlight was set to step {step}, and the board says {achieved}")

    def _read_step(self) -> int:
        return self._step_in(self._board.ask("B?"))

    def _step_in(self, words: list[str]) -> int:
        step = whole_in(words, self._name, lowest=0)
        if step > self._steps:
            raise self._error(f"reports step {step} of {self._steps}", Fault.GARBLED)
        return step

    def _release(self) -> None:
        self._board.release()


def _counters(ticks: int) -> tuple[protocol.UnwrappedCounter, protocol.UnwrappedCounter]:
    """Return the counters of samples and of time at START, given all of the board's clock [µs]."""
    return protocol.UnwrappedCounter(protocol.SEQUENCE_BITS, 0), protocol.UnwrappedCounter(
        protocol.TIME_BITS, ticks
    )

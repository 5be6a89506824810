"""The two devices of our power board: a power meter, and the PWM of a backlight.

Both take the board's port, or an open `PowerBoard` that they share:

    board = PowerBoard("/dev/ttyACM0", clock)
    meter, backlight = BoardPowerMeter(board, clock), BoardBacklight(board)

The port is closed with the last of them. Tested against an emulated board, not on one.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence

from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.backlights import SteppedBacklight
from evenlight.hardware.drivers import board_protocol as protocol
from evenlight.hardware.drivers.board_link import PowerBoard, shared_board
from evenlight.hardware.drivers.board_protocol import number_in, whole_in
from evenlight.hardware.drivers.power_sampling import SamplingMeter, require_sample_rate
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, InstrumentError

SILENCE = 1.0  # [s] without a sample, or 20 of them, after which a board has stopped sending
SILENT_SAMPLES = 20
ZEROING = 3.0  # [s] that the board may take to average its zero
MIN_INTERVAL = 0.005  # [s] a command there and back


class BoardPowerMeter(SamplingMeter):
    """The power meter of a power board.

    Parameters
    ----------
    url : str or PowerBoard
        The board's port, or an open board.
    clock : callable, optional
        The computer's clock, for the times at which samples arrive [s].
    timeout : float, optional
        How long a reply may take [s].
    """

    before_zero = "unplug the panel from the board's output, so that no current flows"

    def __init__(
        self,
        url: str | PowerBoard,
        clock: Callable[[], float] = time.monotonic,
        timeout: float | None = None,
    ) -> None:
        self._board, self._clock = shared_board(url, clock, timeout), clock
        self._name = self._board.name()
        self._pending: list[PowerSample] = []
        self._sequence, self._ticks = _counters(0)
        self._rate, self._last_sample, self._started = 0.0, 0.0, 0
        self._sampling = False

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved: a whole number of µs between samples.

        Raises
        ------
        InstrumentError
            If sensor or line have no such rate, or the board refuses.
        """
        self._require_open()
        highest = self._board.highest_rate()
        require_sample_rate(rate, protocol.SLOWEST, highest, f"{self._name}, sensor and line,")
        self._board.ask("STOP")  # a program that crashed may have left it sampling
        self._board.sample_lines()
        self._pending.clear()
        self._started = self._board_clock()
        self._sequence, self._ticks = _counters(self._started)
        period = whole_in(self._board.ask(f"START {rate:.6f}"), self._name, lowest=1)
        self._rate = 1e6 / period
        self._last_sample, self._sampling = time.monotonic(), True
        return self._rate

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once.

        A line with a wrong checksum is a lost sample.

        Raises
        ------
        InstrumentError
            OVER_RANGE where the sensor saturated; NO_REPLY or GARBLED where nothing of use comes any more.
        """
        self._require_sampling(is_sampling=self._sampling)
        self._take()
        self._require_news()
        return self._handed_over()

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        if not self._sampling:
            return []
        self._sampling = False
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
        identity = self._board.identity()
        return {
            "power_meter": f"{protocol.FAMILY}, {identity.chip}",
            "power_meter_serial": identity.serial_number,
            "power_meter_firmware": identity.firmware,
            "power_meter_range": f"{identity.highest_power:g} W",
            "power_meter_corrupted_lines": str(self._board.corrupted_lines()),
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
                raise InstrumentError(f"{self._name}: sent {error}", Fault.GARBLED) from None
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
        identity, flag = self._board.identity(), protocol.Flag
        if line.flags & (flag.SHUNT_OVERLOAD | flag.BUS_OVERLOAD):
            what = "current" if flag.SHUNT_OVERLOAD in line.flags else "voltage"
            raise InstrumentError(
                f"{self._name}: the {what} is above what the {identity.chip} measures, "
                f"{identity.highest_power:g} W in all; take a smaller shunt, or a sensor of a wider range",
                Fault.OVER_RANGE,
                f"flags {int(line.flags):X}",
            )
        if flag.LOW_SUPPLY in line.flags:
            raise InstrumentError(
                f"{self._name}: its own supply is too low to measure right; take another USB port or cable",
                Fault.LOW_BATTERY,
                f"flags {int(line.flags):X}",
            )

    def _require_news(self) -> None:
        silence = time.monotonic() - self._last_sample
        if silence > max(SILENCE, SILENT_SAMPLES / self._rate):
            raise InstrumentError(
                f"{self._name}: sent no sample for {silence:.1f} s at {self._rate:g} Hz; "
                f"{self._board.corrupted_lines()} lines were disturbed since it was opened",
                Fault.NO_REPLY,
            )

    def _handed_over(self) -> list[PowerSample]:
        pending, self._pending = self._pending, []
        return pending

    def _board_clock(self) -> int:
        return whole_in(self._board.ask("CLOCK?"), self._name, lowest=0)


class BoardBacklight(SteppedBacklight):
    """The PWM output of a power board, which dims a backlight.

    Parameters
    ----------
    url, clock, timeout
        As of `BoardPowerMeter`.

    Raises
    ------
    InstrumentError
        If the board has no PWM output.
    """

    def __init__(
        self,
        url: str | PowerBoard,
        clock: Callable[[], float] = time.monotonic,
        timeout: float | None = None,
    ) -> None:
        self._board = shared_board(url, clock, timeout)
        super().__init__(self._board.name(), MIN_INTERVAL)
        try:
            self._steps = self._board.identity().pwm_steps
            if self._steps == 0:
                raise InstrumentError(f"{self._name}: {protocol.ERROR_WORDS[7]}", code="7")
            self._found = self._read_step()
        except BaseException:
            self._board.release()
            raise

    def _set(self, step: int) -> None:
        achieved = self._step_in(self._board.ask(f"B {step}"))
        if achieved != step:
            raise InstrumentError(
                f"{self._name}: the backlight was set to step {step}, and the board says {achieved}"
            )

    def _read_step(self) -> int:
        return self._step_in(self._board.ask("B?"))

    def _step_in(self, words: list[str]) -> int:
        step = whole_in(words, self._name, lowest=0)
        if step > self._steps:
            raise InstrumentError(f"{self._name}: reports step {step} of {self._steps}", Fault.GARBLED)
        return step

    def _release(self) -> None:
        self._board.release()


def _counters(ticks: int) -> tuple[protocol.UnwrappedCounter, protocol.UnwrappedCounter]:
    """Return the counters of samples and of time at START, given all of the board's clock [µs]."""
    return protocol.UnwrappedCounter(protocol.SEQUENCE_BITS, 0), protocol.UnwrappedCounter(
        protocol.TIME_BITS, ticks
    )

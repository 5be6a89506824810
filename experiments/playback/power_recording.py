"""Records the power of a panel while videos are played on it: samples, clocks, and what was shown when."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path

from evenlight.data_schema.recordings.dataset_layout import (
    CLOCK_PINGS,
    FLASHES,
    FLIPS,
    POWER_LOG,
    POWER_SAMPLES,
)
from evenlight.data_schema.recordings.instrument_logs import (
    ClockPing,
    FlashMark,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError, PowerMeter
from evenlight.hardware.simulated.panel import SimulatedPanel

PINGS_AT_ONCE = 5  # the one that took the shortest bounds the clocks' difference best
# [Hz] From 1000 on, the energy of single frames is within 1 % (docs/decisions/power-synchronisation.md).
RATES = (1000.0, 500.0, 250.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)


class PowerRecording(AbstractContextManager["PowerRecording"]):
    """The power meter at work beside a player, and the files that it fills.

    Parameters
    ----------
    folder : Path
        Where the files go.
    log : PowerLog
        What is recorded; its sample rate is what the meter achieves.
    rate : float or None
        That the meter is asked for [Hz]; None for the highest of `RATES` that it has.
    meter : PowerMeter
        The meter; it is started here, and stopped at the end.
    clock : callable
        That of the flips [s].
    panel : SimulatedPanel, optional
        A simulated panel, which is told what is shown.

    Raises
    ------
    InputError
        If a file is there already.
    InstrumentError
        If the meter does not start.
    """

    def __init__(
        self,
        folder: Path,
        log: PowerLog,
        rate: float | None,
        meter: PowerMeter,
        clock: Callable[[], float],
        panel: SimulatedPanel | None = None,
    ) -> None:
        self._meter, self._clock, self._panel = meter, clock, panel
        self._sync, self._last_frame = False, (-1, -1)  # pass and video frame
        with ExitStack() as stack:
            log = dataclasses.replace(log, sample_rate=_started(meter, rate))
            write_json_record(folder / POWER_LOG, log)
            tables = ((POWER_SAMPLES, PowerSample), (CLOCK_PINGS, ClockPing), (FLIPS, PlayedFlip))
            self._tables = {
                name: stack.enter_context(AppendedRows(folder / name, cls))
                for name, cls in (*tables, (FLASHES, FlashMark))
            }
            self._open = stack.pop_all()
        self.compare_clocks()

    @property
    def sync(self) -> bool:
        """Level of the synchronisation line: it changes with every new video frame."""
        return self._sync

    def next_sync(self, pass_index: int, video_frame: int) -> bool:
        """Return the level that the synchronisation line takes with a frame that is about to be shown."""
        if self._last_frame != (pass_index, video_frame):
            self._last_frame, self._sync = (pass_index, video_frame), not self._sync
        return self._sync

    def showed(self, flip: PlayedFlip) -> None:
        """Take what a refresh showed, right after it."""
        if self._panel is not None:
            self._panel.set_backlight(flip.achieved_factor)
            self._panel.set_sync(flip.sync)
        self._tables[FLIPS].append([flip], to_disk=False)
        self.take_samples()

    def flashed(self, factor: float) -> None:
        """Take a change of a flash marker, right after it appeared."""
        if self._panel is not None:
            self._panel.set_backlight(factor)
        self._tables[FLASHES].append([FlashMark(self._clock(), factor)])
        self.take_samples()

    def take_samples(self) -> None:
        """Write down the samples that came; at once."""
        self._tables[POWER_SAMPLES].append(self._meter.samples(), to_disk=False)

    def compare_clocks(self) -> None:
        """Compare the meter's clock with the computer's, some times in a row.

        Never while a video is played: the answer takes time, and more of it if it gets lost.
        """
        for _ in range(PINGS_AT_ONCE):
            self._ping()

    def _ping(self) -> None:
        """Compare the clocks once, if the meter has one of its own."""
        try:
            ping = self._meter.ping()
        except InstrumentError as error:
            if error.fault not in TRANSIENT:
                raise
            return  # there are others; a meter that stays silent is told by its samples
        if ping is not None:
            self._tables[CLOCK_PINGS].append([ping], to_disk=False)

    def close(self) -> None:
        """Stop the meter, write down its last samples, and close the files."""
        with self._open:
            self._tables[POWER_SAMPLES].append(self._meter.stop())
            self.compare_clocks()

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.close()
        else:  # what broke it is told; the meter may be gone
            with self._open, suppress(InstrumentError):
                self._tables[POWER_SAMPLES].append(self._meter.samples())


def _started(meter: PowerMeter, rate: float | None) -> float:
    """Start a meter at a rate, or at the highest of `RATES` that it has, and return the one achieved [Hz]."""
    if rate is not None:
        return meter.start(rate)
    for possible in RATES:
        try:
            return meter.start(possible)
        except InstrumentError as error:
            if error.fault is not Fault.REFUSED or possible == RATES[-1]:
                raise
    raise AssertionError("RATES is empty")

"""The readings of a sweep: their files, their order, and how one is made.

Every reading is on the disk before the next level is shown; what fails on its way is tried again. Each repeat
of the levels has an order of its own: whatever drifts, drifts over all levels alike.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from filelock import FileLock

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.record_kinds import READINGS_OF_SWEEP
from evenlight.data_schema.recordings.dataset_layout import EVENTS, READINGS, SWEEP_MANIFEST, sweep_folder
from evenlight.data_schema.recordings.session import EventKind, SessionEvent, SessionStatus
from evenlight.data_schema.recordings.sweep import (
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    PowerSweepDesign,
    ReadingStatus,
    SweepDesign,
    SweepManifest,
    SweepPhase,
)
from evenlight.data_schema.storage.append_log import mend_last_line
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.experiments.sessions.session_store import Clock, TimedLogs, Utc, held_folder, read_lines
from evenlight.experiments.sweeps.sweep_devices import AchievedLevel, SweepDevices, SweepLevel
from evenlight.hardware.power_average import average_power
from evenlight.hardware.protocols import (
    TRANSIENT,
    Fault,
    InstrumentError,
    LuminanceMeter,
    PowerMeter,
    Reading,
)

Result = TypeVar("Result")
TIME_DECIMALS = 6
SweepReading = LuminanceReading | PowerReading


class SweepStore(TimedLogs):
    """An open sweep: its manifest, its readings so far, and the only way to record more.

    Attributes
    ----------
    manifest : SweepManifest
        As it is on the disk.
    readings : list of LuminanceReading or PowerReading
        Those recorded so far, in order.
    away : float or None
        How long a resumed sweep was away [s]; None where no clock tells.
    """

    _uncounted = 0.0  # of the time away

    def __init__(self, folder: Path, manifest: SweepManifest, lock: FileLock, utc: Utc) -> None:
        super().__init__(folder, (READINGS,), lock, utc)
        self.manifest = manifest
        self.readings: list[SweepReading] = []
        self.away: float | None = 0.0

    def use_clock(self, clock: Clock) -> None:
        """Count time with a clock [s] from now on, from the last line and the time away."""
        super().use_clock(clock)
        self._started -= self._uncounted
        self._uncounted = 0.0

    def came_back(self) -> None:
        """Note how long the sweep was away: from the last line of the logs until now, by the time of day."""
        said = [record.utc for record in (*self.events, *self.readings) if record.utc]
        now = self.utc()
        if not said or not now:
            self.away = None
            return
        away = datetime.fromisoformat(now) - datetime.fromisoformat(max(said))
        self.away = self._uncounted = max(away.total_seconds(), 0.0)

    @property
    def last_time(self) -> float:
        """Time of the last event or reading [s]."""
        return max(super().last_time, max((reading.ended for reading in self.readings), default=0.0))

    @property
    def done(self) -> set[int]:
        """Indices of the readings that the design asks for and that are recorded."""
        return {reading.index for reading in self.readings if reading.again_of is None}

    def write(self, reading: SweepReading) -> None:
        """Record a reading; when this returns it cannot be lost any more."""
        self._logs[READINGS].append(reading)
        self.readings.append(reading)

    def change(self, **changes: object) -> None:
        """Change the manifest: how far the sweep got, what its instruments say of themselves."""
        self.manifest = dataclasses.replace(self.manifest, **changes)  # type: ignore[arg-type] # its own fields
        write_json_record(self.folder / SWEEP_MANIFEST, self.manifest)


def begin_sweep(dataset: Path, manifest: SweepManifest, utc: Utc) -> SweepStore:
    """Open a sweep that is not there yet, and write its manifest.

    Raises
    ------
    InputError
        If it is there already: data are never overwritten; or another program writes it right now.
    """
    folder = sweep_folder(dataset, manifest.task, manifest.session_id)
    with held_folder(folder) as lock:
        refuse_existing(folder)
        write_json_record(folder / SWEEP_MANIFEST, manifest)
        return SweepStore(folder, manifest, lock, utc)


def refuse_existing(folder: Path) -> None:
    """Refuse to begin a sweep that is there already."""
    if (folder / SWEEP_MANIFEST).exists() or (folder / READINGS).exists():
        raise InputError(
            f"{folder}: this sweep is there already and data are never overwritten; go on with it with "
            "--resume, or give another --session"
        )


def resume_sweep(dataset: Path, task: str, session_id: str, utc: Utc) -> SweepStore:
    """Open a sweep that was interrupted, with all its readings.

    Raises
    ------
    InputError
        If there is no such sweep, a line cannot be used, or another program writes it.
    """
    folder = sweep_folder(dataset, task, session_id)
    manifest = read_sweep_manifest(folder)
    with held_folder(folder) as lock:
        torn = {name: mend_last_line(folder / name) for name in (READINGS, EVENTS)}
        readings = read_lines(READINGS_OF_SWEEP[task].record, folder / READINGS)
        events = read_lines(SessionEvent, folder / EVENTS)
        store = SweepStore(folder, manifest, lock, utc)
    store.readings, store.events = readings, events
    store.change(status=SessionStatus.RUNNING)
    store.came_back()
    store.use_clock(float)
    store.note_resumed(torn)
    return store


def read_sweep_manifest(folder: Path) -> SweepManifest:
    """Return the manifest of a sweep that is there."""
    if not (folder / SWEEP_MANIFEST).is_file():
        there = sorted(path.parent.name for path in folder.parent.glob(f"*/{SWEEP_MANIFEST}"))
        known = f"there is {', '.join(there[:8])}" if there else f"{folder.parent} has none"
        raise InputError(f"{folder}: there is no sweep to resume; {known}")
    return read_json_record(SweepManifest, folder / SWEEP_MANIFEST)


@dataclass(frozen=True, slots=True)
class PlannedReading:
    """A reading that is to be made."""

    index: int  # its place in the sweep, from 0
    phase: SweepPhase  # what it is for
    repeat: int  # which reading of its level, from 1
    level: SweepLevel  # what is shown
    # when at the earliest, since the first reading of the warm-up began [s]; 0 after the warm-up
    due: float = 0.0


def planned_readings(
    design: SweepDesign, seed: int, *, with_factors: bool = True, by_hand: bool = False
) -> list[PlannedReading]:
    """Return the readings of a sweep, in order; the same for the same seed.

    Parameters
    ----------
    design : LuminanceSweepDesign or PowerSweepDesign
        What is measured.
    seed : int
        Of the order.
    with_factors : bool, optional
        Whether brightness factors can be shown.
    by_hand : bool, optional
        Whether a person reads the meter: then the warm-up is read at its beginning and its end only.

    >>> design = PowerSweepDesign(factors=(0.2, 0.6, 1.0), warm_up=120.0, warm_up_interval=60.0)
    >>> readings = planned_readings(design, seed=1)
    >>> len(readings), [reading.due for reading in readings[:3]]  # 3 of warm-up, 3 x 3, 3 at the end
    (15, [0.0, 60.0, 120.0])
    """
    rng = np.random.default_rng(seed)
    white = SweepLevel(1.0, None if isinstance(design, LuminanceSweepDesign) else 1.0)
    times = _warm_up(design)
    if by_hand:
        times = [times[0], *times[1:][-1:]]
    warm = [(SweepPhase.WARM_UP, repeat, white, due) for repeat, due in enumerate(times, start=1)]
    swept = _repeated(SweepPhase.SWEEP, levels_of(design, with_factors=with_factors), design.repeats, rng)
    last = _repeated(SweepPhase.DRIFT, _drift_levels(design), design.repeats, rng)
    readings = [PlannedReading(0, *reading) for reading in warm]
    readings += [PlannedReading(0, *reading) for reading in (*swept, *last)]
    return [dataclasses.replace(reading, index=index) for index, reading in enumerate(readings)]


def levels_of(design: SweepDesign, *, with_factors: bool = True) -> list[SweepLevel]:
    """Return the levels of a design, each once."""
    if isinstance(design, PowerSweepDesign):
        return [SweepLevel(1.0, factor) for factor in design.factors]
    factors = design.factors if with_factors else ()
    return [SweepLevel(value, None) for value in design.pixel_values] + [
        SweepLevel(1.0, factor) for factor in factors
    ]


def _drift_levels(design: SweepDesign) -> list[SweepLevel]:
    if isinstance(design, PowerSweepDesign):
        return [SweepLevel(1.0, factor) for factor in design.drift_factors]
    return [SweepLevel(value, None) for value in design.drift_pixel_values]


def _warm_up(design: SweepDesign) -> list[float]:
    """Return when the warm-up is read: at its beginning, every interval, and at its end [s].

    Without a warm-up the white screen is read once all the same: some meters leave their remote mode when a
    dark screen is the first that they see.
    """
    steps = math.ceil(design.warm_up / design.warm_up_interval - 1e-9)
    return [step * design.warm_up_interval for step in range(steps)] + [design.warm_up]


def _repeated(
    phase: SweepPhase, levels: Sequence[SweepLevel], repeats: int, rng: np.random.Generator
) -> list[tuple[SweepPhase, int, SweepLevel]]:
    """Return some levels several times, each time in another order."""
    orders = [rng.permutation(len(levels)) for _ in range(repeats)]
    return [(phase, repeat, levels[i]) for repeat, order in enumerate(orders, start=1) for i in order]


class SweepReader:
    """Makes the readings of a sweep.

    Parameters
    ----------
    store : SweepStore
        Where failures are noted, and whose time counts.
    devices : SweepDevices
        Screen and instruments.
    """

    def __init__(self, store: SweepStore, devices: SweepDevices) -> None:
        self._store, self._devices = store, devices
        self._design: SweepDesign = store.manifest.design
        self._attempts = 1  # that the last reading took

    def read(self, planned: PlannedReading) -> SweepReading:
        """Return a reading.

        Raises
        ------
        InstrumentError
            If it failed for good, or more often than the design allows.
        PausePressed
            If the pause key was pressed while the level settled.
        """
        screen = self._devices.screen
        shown = screen.show(planned.level)
        screen.wait(self._design.settle)
        if isinstance(self._design, PowerSweepDesign):
            return self._power(planned, shown, self._design)
        return self._luminance(planned, shown)

    def _luminance(self, planned: PlannedReading, shown: AchievedLevel) -> LuminanceReading:
        meter = self._devices.luminance_meter
        assert meter is not None
        begun = self._store.now()
        reading, status, attempts = self._read_luminance(meter, planned)
        x, y = reading.chromaticity if reading and reading.chromaticity else (None, None)
        return LuminanceReading(
            pixel_value=shown.pixel_value,
            factor=planned.level.factor,
            luminance=reading.value if reading else None,
            status=ReadingStatus.OK if reading else ReadingStatus.UNDER_RANGE,
            meter_status=status,
            begun=self._time(reading.begun) if reading else round(begun, TIME_DECIMALS),
            ended=self._time(reading.ended) if reading else round(self._store.now(), TIME_DECIMALS),
            chromaticity_x=x,
            chromaticity_y=y,
            **self._about(planned, shown, attempts),
        )

    def _about(self, planned: PlannedReading, shown: AchievedLevel, attempts: int) -> dict[str, Any]:
        """Return what readings of either kind say of themselves."""
        return {
            "index": planned.index,
            "phase": planned.phase,
            "repeat": planned.repeat,
            "achieved_factor": shown.achieved_factor,
            "attempts": attempts,
            "utc": self._store.utc(),
        }

    def _power(self, planned: PlannedReading, shown: AchievedLevel, design: PowerSweepDesign) -> PowerReading:
        meter, screen = self._devices.power_meter, self._devices.screen
        assert meter is not None
        power_meter: PowerMeter = meter
        average, attempts = self._tried(
            planned,
            lambda: average_power(power_meter, design.average, design.sample_rate, screen.now, screen.wait),
        )
        luminance: float | None = None
        status: ReadingStatus | None = None
        if self._devices.luminance_meter is not None:
            reading, _, more = self._read_luminance(self._devices.luminance_meter, planned)
            luminance = reading.value if reading else None
            status = ReadingStatus.OK if reading else ReadingStatus.UNDER_RANGE
            attempts = max(attempts, more)
        return PowerReading(
            factor=planned.level.factor or 1.0,
            luminance=luminance,
            luminance_status=status,
            power=average.power,
            power_sd=average.power_sd,
            duration=average.duration,
            n_samples=average.n_samples,
            n_lost=average.n_lost,
            n_duplicated=average.n_duplicated,
            meter_status=average.status,
            begun=self._time(average.begun),
            ended=self._time(average.ended),
            **self._about(planned, shown, attempts),
        )

    def _read_luminance(
        self, meter: LuminanceMeter, planned: PlannedReading
    ) -> tuple[Reading | None, str, int]:
        """Return what a meter reads, None where the screen is too dark for it; its status; and the tries."""
        try:
            reading, attempts = self._tried(
                planned, lambda: self._devices.screen.while_shown(meter.read_luminance)
            )
        except InstrumentError as error:
            if error.fault is not Fault.UNDER_RANGE:
                raise
            return None, error.code or str(error), self._attempts
        return reading, reading.status, attempts

    def _tried(self, planned: PlannedReading, read: Callable[[], Result]) -> tuple[Result, int]:
        """Return a result, and how many tries it took: what fails on its way may come at the next try."""
        attempt = 1
        while True:
            self._attempts = attempt
            try:
                return read(), attempt
            except InstrumentError as error:
                if error.fault is Fault.UNDER_RANGE:
                    raise
                again = error.fault in TRANSIENT and attempt <= self._design.retries
                outcome = "tried again" if again else "given up"
                detail = f"{error.fault.value}: {error}; {outcome}"
                self._store.note(EventKind.READING_FAILED, detail, planned.index, attempt)
                if not again:
                    raise
                attempt += 1

    def _time(self, time: float) -> float:
        """Return a time on the devices' clock as that since the sweep began [s]."""
        return round(self._store.since_beginning(time), TIME_DECIMALS)

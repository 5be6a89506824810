"""The files of a sweep: every reading is on the disk before the next level is shown."""

from __future__ import annotations

import dataclasses
from datetime import datetime
from pathlib import Path

from filelock import FileLock

from evenlight.data_schema.append_log import mend_last_line
from evenlight.data_schema.dataset_layout import EVENTS, READINGS, SWEEP_MANIFEST, sweep_folder
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.record_kinds import READINGS_OF_SWEEP
from evenlight.data_schema.session import EventKind, SessionEvent, SessionStatus
from evenlight.data_schema.sweep import LuminanceReading, PowerReading, SweepManifest
from evenlight.data_schema.text_files import read_json_record, write_json_record
from evenlight.experiments.log_files import hold_folder, read_lines
from evenlight.experiments.timed_logs import Clock, TimedLogs, Utc

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
        """Note how long nobody was there: from the last line of the logs until now, by the time of day."""
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
    lock = hold_folder(folder)
    try:
        if (folder / SWEEP_MANIFEST).exists() or (folder / READINGS).exists():
            raise InputError(
                f"{folder}: this sweep is there already and data are never overwritten; go on with it with "
                "--resume, or give another --session"
            )
        write_json_record(folder / SWEEP_MANIFEST, manifest)
        store = SweepStore(folder, manifest, lock, utc)
    except BaseException:
        lock.release()
        raise
    return store


def resume_sweep(dataset: Path, task: str, session_id: str, utc: Utc) -> SweepStore:
    """Open a sweep that was interrupted, with all its readings.

    Raises
    ------
    InputError
        If there is no such sweep, a line cannot be used, or another program writes it.
    """
    folder = sweep_folder(dataset, task, session_id)
    manifest = read_sweep_manifest(folder)
    lock = hold_folder(folder)
    try:
        torn = {name: mend_last_line(folder / name) for name in (READINGS, EVENTS)}
        readings = read_lines(READINGS_OF_SWEEP[task].record, folder / READINGS)
        events = read_lines(SessionEvent, folder / EVENTS)
        store = SweepStore(folder, manifest, lock, utc)
    except BaseException:
        lock.release()
        raise
    store.readings, store.events = readings, events
    store.change(status=SessionStatus.RUNNING)
    store.came_back()
    store.use_clock(float)
    store.note(EventKind.RESUMED)
    for name, text in torn.items():
        if text:
            store.note(EventKind.LINE_TORN, f"{name}: {text}")
    return store


def read_sweep_manifest(folder: Path) -> SweepManifest:
    """Return the manifest of a sweep that is there."""
    if not (folder / SWEEP_MANIFEST).is_file():
        there = sorted(path.parent.name for path in folder.parent.glob(f"*/{SWEEP_MANIFEST}"))
        known = f"there is {', '.join(there[:8])}" if there else f"{folder.parent} has none"
        raise InputError(f"{folder}: there is no sweep to resume; {known}")
    return read_json_record(SweepManifest, folder / SWEEP_MANIFEST)

"""The files of a sweep, measured or imported: every reading is on the disk before the next level is shown."""

from __future__ import annotations

import dataclasses
from collections import Counter
from datetime import datetime
from pathlib import Path

from filelock import FileLock

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.record_kinds import READINGS_OF_SWEEP
from evenlight.data_schema.recordings.dataset_layout import EVENTS, READINGS, SWEEP_MANIFEST, sweep_folder
from evenlight.data_schema.recordings.session import EventKind, SessionEvent, SessionStatus
from evenlight.data_schema.recordings.sweep import (
    FEWEST_READINGS,
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    SweepManifest,
)
from evenlight.data_schema.storage.append_log import mend_last_line
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.experiments.sessions.dataset import require_dataset
from evenlight.experiments.sessions.session_store import Clock, TimedLogs, Utc, hold_folder, read_lines
from evenlight.hardware.luminance_table import luminance_readings_from_csv
from evenlight.hardware.rig_files import TABLE

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


def is_imported(luminance_meter: str, task: str) -> bool:
    """Return whether a sweep is imported: its rig names a table in place of a luminance meter."""
    return task == "luminance-sweep" and luminance_meter.startswith(TABLE)


def import_sweep(dataset: Path, manifest: SweepManifest, *, resume: bool) -> tuple[int, Path]:
    """Write the readings of a table as a sweep; return how many there are, and the sweep's folder.

    The time of the readings is unknown, so the sweep and what is fitted to it carry no date.

    Parameters
    ----------
    dataset : Path
        Where to.
    manifest : SweepManifest
        What the sweep is, but for its levels, which are the table's: of its design only L_refl counts.
    resume : bool
        Whether an import that was interrupted is to be finished.

    Raises
    ------
    InputError
        If the table has too few readings of a level, or is none, or is not as it was.
    """
    path = Path(manifest.rig.luminance_meter.removeprefix(TABLE))
    readings = luminance_readings_from_csv(path)
    reflected = getattr(manifest.design, "reflected_luminance", 0.0)
    design = dataclasses.replace(_design_of_table(readings, path), reflected_luminance=reflected)
    if resume:
        store = resume_sweep(dataset, manifest.task, manifest.session_id, str)
    else:
        require_dataset(dataset, manifest.simulated, manifest.provenance)
        new = dataclasses.replace(manifest, design=design, n_readings=len(readings), started="")
        store = begin_sweep(dataset, new, str)
    with store:
        done = len(store.readings)
        if store.manifest.design != design or store.readings != readings[:done]:
            raise InputError(f"{path}: is not as it was when its import began; give another --session")
        if not store.happened(EventKind.STARTED):
            store.note(EventKind.STARTED, f"readings made elsewhere, from {path.name}")
        for reading in readings[done:]:
            store.write(reading)
        store.note(EventKind.COMPLETED)
        store.change(status=SessionStatus.COMPLETE, apparatus={"luminance meter: table": path.name})
        return len(readings), store.folder


def _design_of_table(readings: list[LuminanceReading], path: Path) -> LuminanceSweepDesign:
    """Return the design that a table followed."""
    counts = Counter((reading.pixel_value, reading.factor) for reading in readings)
    (value, factor), fewest = min(counts.items(), key=lambda item: item[1])
    if fewest < FEWEST_READINGS:
        level = f"pixel value {value:g}" + ("" if factor is None else f" at brightness factor {factor:g}")
        raise InputError(
            f"{path}: has {fewest} reading(s) of {level}; give at least {FEWEST_READINGS} of each level, so "
            "that noise can be told from what the display does"
        )
    values = tuple(sorted({value for value, factor in counts if factor is None}))
    factors = tuple(sorted({factor for _, factor in counts if factor is not None}))
    try:
        return LuminanceSweepDesign(
            path.stem, values, factors, fewest, settle=0.0, warm_up=0.0, drift_pixel_values=()
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None

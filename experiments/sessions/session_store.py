"""The files of one session, and the timed logs that a sweep has too: no crash of the program loses a trial.

Every task has the same: `manifest.json` before the first trial; `trials.jsonl`, `frames.jsonl` and
`events.jsonl`, whose lines are on the disk before the next trial begins; a lock, which the system lets go
when the program ends, however it ends.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from filelock import FileLock

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.recordings.dataset_layout import (
    EVENTS,
    FRAMES,
    HEADSET,
    LOCK,
    MANIFEST,
    TRIALS,
    session_folder,
)
from evenlight.data_schema.recordings.dataset_writing import export_behaviour
from evenlight.data_schema.recordings.headset import HeadsetLog
from evenlight.data_schema.recordings.session import (
    TASKS,
    EventKind,
    SessionEvent,
    SessionManifest,
    SessionStatus,
)
from evenlight.data_schema.storage.append_log import AppendLog, mend_last_line, sync_folder
from evenlight.data_schema.storage.text_files import (
    parse_json,
    read_json_record,
    read_text,
    write_json_record,
)
from evenlight.data_schema.storage.whole_files import held_lock
from evenlight.experiments.calibration_age import utc_now
from evenlight.experiments.stage import SentTrigger

LONGEST_REASON = 200  # letters of an error's message, in the log of events
Clock = Callable[[], float]
Utc = Callable[[], str]


class TimedLogs:
    """Open logs: of events, and of whatever else is recorded.

    Parameters
    ----------
    folder : Path
        Where they lie.
    names : iterable of str
        Their files, but for that of the events.
    lock : FileLock
        Of the folder, held; it is let go at the end.
    utc : callable
        Returns the time of day as text.

    Attributes
    ----------
    folder : Path
        Where they lie.
    events : list of SessionEvent
        What happened so far.
    """

    def __init__(self, folder: Path, names: Iterable[str], lock: FileLock, utc: Utc) -> None:
        self.folder, self.utc = folder, utc
        self.events: list[SessionEvent] = []
        self._lock = lock
        self._clock: Clock = float  # of 0.0 s, until there is one
        self._started = 0.0
        self._logs = {name: AppendLog(folder / name) for name in (*names, EVENTS)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the files and let go of the folder."""
        for log in self._logs.values():
            log.close()
        self._lock.release()

    def use_clock(self, clock: Clock) -> None:
        """Count time with a clock [s] from now on, from where the last event was."""
        self._clock = clock
        self._started = clock() - self.last_time

    def now(self) -> float:
        """Return the time since the beginning [s]."""
        return max(self._clock() - self._started, 0.0)

    def since_beginning(self, time: float) -> float:
        """Return a time on the clock in use as the time since the beginning [s]."""
        return max(time - self._started, 0.0)

    @property
    def last_time(self) -> float:
        """Time of the last event [s]."""
        return max((event.time for event in self.events), default=0.0)

    def note(
        self, kind: EventKind, detail: str = "", trial_index: int | None = None, attempt: int | None = None
    ) -> None:
        """Record an event."""
        event = SessionEvent(kind, self.now(), self.utc(), trial_index, attempt, detail)
        self._logs[EVENTS].append(event)
        self.events.append(event)

    def note_trigger(self, sent: SentTrigger, trial_index: int | None, attempt: int | None) -> None:
        """Record a trigger, at the time of its flip, and what is wrong with devices that did not take it."""
        if sent.delay is not None:
            what = trial_index, attempt, sent.label, sent.code, sent.delay
            event = SessionEvent(EventKind.TRIGGER_SENT, self.since_beginning(sent.time), "", *what)
            self._logs[EVENTS].append(event)
            self.events.append(event)
        for failure in sent.failures:
            self.note(EventKind.TRIGGER_FAILED, failure, trial_index, attempt)

    def note_resumed(self, torn: Mapping[str, str | None]) -> None:
        """Record that all goes on, and what was torn from the end of each file."""
        self.note(EventKind.RESUMED)
        for name, text in torn.items():
            if text:
                self.note(EventKind.LINE_TORN, f"{name}: {text}")

    def note_failure(self, error: BaseException) -> None:
        """Record what ended the program."""
        self.note(EventKind.STOPPED, f"{type(error).__name__.strip('_')}: {error}"[:LONGEST_REASON])

    def happened(self, kind: EventKind) -> bool:
        """Return whether something happened already."""
        return any(event.kind is kind for event in self.events)


@contextmanager
def held_folder(folder: Path) -> Iterator[FileLock]:
    """Yield the lock of a session's folder, held; it is let go if the block fails.

    The folder is made if it is not there.

    Raises
    ------
    InputError
        If another program holds it, or it cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for parent in (folder.parent, folder.parent.parent):
            sync_folder(parent)
    except OSError as error:
        raise InputError(
            f"cannot write to the folder {folder}: {error.strerror or error}; choose another with --out"
        ) from error
    busy = f"{folder}: another program is writing this session; wait until it ends"
    lock = held_lock(folder / LOCK, busy)
    try:
        yield lock
    except BaseException:
        lock.release()
        raise


def read_lines(cls: type[Any], path: Path) -> list[Any]:
    """Return the records of a log, one per line; none where there is no log yet."""
    if not path.exists():
        return []
    records = []
    for number, line in enumerate(read_text(path, f"one {cls.__name__} per line").split("\n"), start=1):
        if line.strip():
            where = f"{path}, line {number}"
            records.append(record_from_mapping(cls, parse_json(line, where, f"a {cls.__name__}"), where))
    return records


class SessionStore(TimedLogs):
    """An open session: its manifest, what was recorded, and the only way to record more.

    Attributes
    ----------
    manifest : SessionManifest
        As it is on the disk.
    trials : list
        The trials recorded so far, practice included, in order.
    """

    def __init__(self, dataset: Path, manifest: SessionManifest, lock: FileLock, utc: Utc) -> None:
        folder = session_folder(dataset, manifest.participant_id, manifest.session_id)
        super().__init__(folder, (TRIALS, FRAMES), lock, utc)
        self.dataset = dataset
        self.manifest = manifest
        self.trials: list[Any] = []

    def write_in_headset(self, logs: Iterable[HeadsetLog]) -> None:
        """Record what a headset showed in a trial, before the trial's own line; also of one interrupted."""
        for log in logs:
            if HEADSET not in self._logs:
                self._logs[HEADSET] = AppendLog(self.folder / HEADSET)
            self._logs[HEADSET].append(log)

    def write_trial(self, trial: Any, frames: Iterable[Any] = ()) -> None:
        """Record an answered trial; when this returns it cannot be lost any more.

        The frames go first: a trial whose line is there has its frames too.
        """
        for frame in frames:
            self._logs[FRAMES].append(frame)
        self._logs[TRIALS].append(trial)
        self.trials.append(trial)

    def describe(self, apparatus: dict[str, str]) -> None:
        """Note in the manifest what the devices say of themselves."""
        self.manifest = dataclasses.replace(self.manifest, apparatus=apparatus)
        write_json_record(self.folder / MANIFEST, self.manifest)

    def finish(self, status: SessionStatus) -> None:
        """Export the trials as a table, and note last how far the session got: until then it is resumed."""
        export_behaviour(self.dataset, self.manifest, self.trials)
        self.manifest = dataclasses.replace(self.manifest, status=status)
        write_json_record(self.folder / MANIFEST, self.manifest)

    def attempt_at(self, trial_index: int) -> int:
        """Return which attempt at a trial comes next: one more than were begun."""
        begun = (e for e in self.events if e.kind is EventKind.TRIAL_BEGUN and e.trial_index == trial_index)
        return 1 + sum(1 for _ in begun)


def begin_session(dataset: Path, manifest: SessionManifest, utc: Utc = utc_now) -> SessionStore:
    """Open a session that is not there yet, and write its manifest.

    Parameters
    ----------
    dataset : Path
        Where to.
    manifest : SessionManifest
        What it is.
    utc : callable, optional
        Returns the time of day as text; empty text for a session that is the same whenever it is run.

    Raises
    ------
    InputError
        If it is there already: data are never overwritten; or another program writes it right now.
    """
    folder = session_folder(dataset, manifest.participant_id, manifest.session_id)
    with held_folder(folder) as lock:
        if (folder / MANIFEST).exists() or (folder / TRIALS).exists():
            raise InputError(
                f"{folder}: this session is there already and data are never overwritten; go on with it "
                "with --resume, or give another --session"
            )
        write_json_record(folder / MANIFEST, manifest)
        return SessionStore(dataset, manifest, lock, utc)


def resume_session(dataset: Path, participant_id: str, session_id: str, utc: Utc = utc_now) -> SessionStore:
    """Open a session that was interrupted: mend what a crash tore, and mark the trial that it broke.

    Raises
    ------
    InputError
        If there is no such session, it is complete, a line cannot be used, or another program writes it.
    """
    folder = session_folder(dataset, participant_id, session_id)
    if not (folder / MANIFEST).is_file():
        raise InputError(f"{folder}: there is no session to resume; {_known_sessions(dataset)}")
    with held_folder(folder) as lock:
        manifest = read_json_record(SessionManifest, folder / MANIFEST)
        if manifest.status is SessionStatus.COMPLETE:
            raise InputError(f"{folder}: this session is complete; give another --session")
        if manifest.status is SessionStatus.DECLINED:
            raise InputError(f"{folder}: the participant declined to take part; nothing is resumed")
        torn = {name: mend_last_line(folder / name) for name in (TRIALS, FRAMES, HEADSET, EVENTS)}
        trials = read_lines(TASKS[manifest.task].trial, folder / TRIALS)
        events = read_lines(SessionEvent, folder / EVENTS)
        store = SessionStore(dataset, manifest, lock, utc)
    store.trials, store.events = trials, events
    store.manifest = dataclasses.replace(manifest, status=SessionStatus.RUNNING)
    write_json_record(folder / MANIFEST, store.manifest)
    store.use_clock(float)
    _note_what_broke(store, torn)
    return store


def _note_what_broke(store: SessionStore, torn: dict[str, str | None]) -> None:
    """Note that the session goes on, what was torn, and the trial that was shown and not answered."""
    store.note_resumed(torn)
    broken = _broken_trial(store)
    if broken is not None:
        reason = "the program ended during this trial; it is shown again"
        store.note(EventKind.TRIAL_INTERRUPTED, reason, broken.trial_index, broken.attempt)


def _broken_trial(store: SessionStore) -> SessionEvent | None:
    """Return the beginning of the trial that was being shown when the program ended; None if none was."""
    of_trials = (EventKind.TRIAL_BEGUN, EventKind.TRIAL_INTERRUPTED)
    last = next((event for event in reversed(store.events) if event.kind in of_trials), None)
    if last is None or last.kind is EventKind.TRIAL_INTERRUPTED:
        return None
    return None if any(trial.trial_index == last.trial_index for trial in store.trials) else last


def _known_sessions(dataset: Path) -> str:
    found = sorted(path.parent for path in dataset.glob(f"sub-*/ses-*/{MANIFEST}"))
    if not found:
        return f"{dataset} has none"
    names = [f"{p.parent.name.removeprefix('sub-')}/{p.name.removeprefix('ses-')}" for p in found]
    shown = ", ".join(names[:8]) + (", …" if len(names) > 8 else "")
    return f"{dataset} has (participant/session) {shown}"

"""A session as far as it has got, read from its files as they grow: they are never touched."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import RampDesign, RampTrial, trial_seconds
from evenlight.data_schema.recordings.session import (
    TASKS,
    EventKind,
    SessionEvent,
    SessionManifest,
    SessionStatus,
)
from evenlight.data_schema.storage.text_files import parse_json, read_json_record
from evenlight.experiments.live_view.thresholds_so_far import LevelSoFar, ThresholdsSoFar


class GrowingLog:
    """A log of one JSON object per line; a line without its end waits until it is whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._taken = 0  # bytes

    def new_lines(self) -> list[str]:
        """Return the whole lines that have come since the last call; none where there is no log yet."""
        try:
            with self.path.open("rb") as stream:
                if stream.seek(0, os.SEEK_END) <= self._taken:
                    return []
                stream.seek(self._taken)
                content = stream.read()
        except FileNotFoundError:
            return []
        whole = content[: content.rfind(b"\n") + 1]
        self._taken += len(whole)
        return [line for line in whole.decode(errors="replace").split("\n") if line.strip()]


class SessionSoFar:
    """What a session has recorded so far, and what follows from it.

    Parameters
    ----------
    folder : Path
        Of the session.

    Raises
    ------
    InputError
        If its manifest or a line cannot be used, or its task is unknown.
    """

    def __init__(self, folder: Path) -> None:
        self.trials: list[Any] = []
        self.events: list[SessionEvent] = []
        self._logs = {name: GrowingLog(folder / name) for name in (TRIALS, EVENTS)}
        self._path, self._manifest_time = folder / MANIFEST, -1
        self._thresholds: ThresholdsSoFar | None = None
        self.update()

    def update(self) -> None:
        """Read what is new."""
        changed = self._path.stat().st_mtime_ns
        if changed != self._manifest_time:
            self.manifest, self._manifest_time = read_json_record(SessionManifest, self._path), changed
        if self.manifest.task not in TASKS:
            raise InputError(f"{self._path}: the task {self.manifest.task!r} is not known here")
        if self._thresholds is None and isinstance(self.manifest.design, RampDesign):
            self._thresholds = ThresholdsSoFar(self.manifest.design)
        self.events += self._records(EVENTS, SessionEvent)
        new = self._records(TRIALS, TASKS[self.manifest.task].trial)
        self.trials += new
        if self._thresholds:
            for trial in new:
                self._thresholds.take(trial)

    def _records(self, name: str, cls: type[Any]) -> list[Any]:
        """Return the records of a log that are new."""
        lines, where = self._logs[name].new_lines(), str(self._logs[name].path)
        return [record_from_mapping(cls, parse_json(line, where, cls.__name__), where) for line in lines]

    @property
    def ended(self) -> bool:
        """Whether nothing more comes."""
        return self.manifest.status is not SessionStatus.RUNNING

    @property
    def silence(self) -> float:
        """For how long no event was recorded [s]: a session may have been killed."""
        return time.time() - self._logs[EVENTS].path.stat().st_mtime

    @property
    def usable(self) -> list[Any]:
        """The trials that count."""
        return [trial for trial in self.trials if trial.usable]

    @property
    def flagged(self) -> int:
        """How many trials are left out of the analysis."""
        return sum(not (trial.practice or trial.usable) for trial in self.trials)

    @property
    def state(self) -> str:
        """What goes on, in words."""
        if self.ended:
            aborted = self.manifest.status is SessionStatus.ABORTED
            return "stopped; go on with --resume" if aborted else str(self.manifest.status.value)
        shown = (EventKind.TRIAL_BEGUN, EventKind.PAGE_SHOWN)
        last = next((event for event in reversed(self.events) if event.kind in shown), None)
        if last is None:
            return "begins"
        if last.kind is EventKind.PAGE_SHOWN:
            return f"page {last.detail}"
        index, practised = last.trial_index or 0, sum(trial.practice for trial in self.trials)
        return f"trial {index + 1 - practised}" if index >= practised and self.usable else "first trials"

    @property
    def seconds_left(self) -> float | None:
        """The trials left at the pace so far, breaks and repeats included [s]; None before there is a pace.

        A session of ramps goes by its design before the first answer.
        """
        design, done = self.manifest.design, len(self.usable)
        left = self.manifest.n_trials - done
        first = self.usable[0].trial_index if done else -1
        begun = next((event.time for event in self.events if event.trial_index == first), None)
        if begun is None:
            return left * trial_seconds(design) if isinstance(design, RampDesign) else None
        return left / done * (self.events[-1].time - begun)

    @property
    def false_alarms(self) -> tuple[int, int] | None:
        """Of how many usable trials without a change: those in which one was seen, and all of them."""
        catches = [t.success for t in self.usable if isinstance(t, RampTrial) and t.is_catch]
        return (sum(catches), len(catches)) if catches else None

    @property
    def dropped(self) -> int | None:
        """In how many trials frames were dropped; None where refreshes are counted and not timed."""
        if self.manifest.apparatus.get("clock", "").startswith("refreshes"):
            return None
        return sum(bool(getattr(trial, "frames_dropped", None)) for trial in self.trials)

    @property
    def levels(self) -> list[LevelSoFar]:
        """Thresholds so far, of a ramp session."""
        return self._thresholds.levels() if self._thresholds else []

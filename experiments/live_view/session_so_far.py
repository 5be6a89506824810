"""A session as far as it has got, read from its files as they grow: they are never touched."""

from __future__ import annotations

import json
import math
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES, MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import BREAK_TIME, Procedure, RampDesign, RampTrial, trial_seconds
from evenlight.data_schema.recordings.session import (
    TASKS,
    EventKind,
    SessionEvent,
    SessionManifest,
    SessionStatus,
)
from evenlight.data_schema.storage.text_files import parse_json, read_json_record
from evenlight.experiments.live_view.thresholds_so_far import LevelSoFar, ThresholdsSoFar

FLIP_TIMES = "flip_times_s"  # in the frame logs of all tasks
ANSWERS_SHOWN = 4
BETWEEN_TRIALS = (EventKind.PAGE_SHOWN, EventKind.PAUSED, EventKind.TRIAL_INTERRUPTED, EventKind.RESUMED)
ROUTINE = (  # of which an experimenter need not be told
    *BETWEEN_TRIALS[:2],
    *(EventKind.STARTED, EventKind.CONSENT_GIVEN, EventKind.KEYS_TRIED, EventKind.PRACTISED),
    *(EventKind.TRIAL_BEGUN, EventKind.TRIAL_FLAGGED, EventKind.TRIGGER_SENT),
    *(EventKind.CONTINUED, EventKind.COMPLETED),
)


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
        self.longest_frame = 0.0  # between two flips of a trial [s]
        self._logs = {name: GrowingLog(folder / name) for name in (TRIALS, EVENTS, FRAMES)}
        self._path, self._manifest_time = folder / MANIFEST, -1
        self._thresholds: ThresholdsSoFar | None = None
        self.update()

    def update(self) -> None:
        """Read what is new."""
        changed = self._path.stat().st_mtime_ns
        if changed != self._manifest_time:
            self.manifest, self._manifest_time = read_json_record(SessionManifest, self._path), changed
        design = self.manifest.design
        if self.manifest.task not in TASKS:
            raise InputError(f"{self._path}: the task {self.manifest.task!r} is not known here")
        if self._thresholds is None and isinstance(design, RampDesign):
            self._thresholds = ThresholdsSoFar(design)
        self.events += self._records(EVENTS, SessionEvent)
        new = self._records(TRIALS, TASKS[self.manifest.task].trial)
        self.trials += new
        for trial in new if self._thresholds else ():
            self._thresholds.take(trial)  # type: ignore[union-attr] # none are taken where there is none
        for line in self._logs[FRAMES].new_lines():
            flips = json.loads(line).get(FLIP_TIMES, [])
            gaps = (later - earlier for earlier, later in pairwise(flips))
            self.longest_frame = max(self.longest_frame, *gaps, 0.0)

    def _records(self, name: str, cls: type[Any]) -> list[Any]:
        """Return the records of a log that are new."""
        lines, where = self._logs[name].new_lines(), str(self._logs[name].path)
        return [record_from_mapping(cls, parse_json(line, where, cls.__name__), where) for line in lines]

    @property
    def ended(self) -> bool:
        """Whether nothing more comes."""
        return self.manifest.status is not SessionStatus.RUNNING

    @property
    def last_change(self) -> float:
        """When the last event was recorded, on the clock of the computer [s]."""
        return self._logs[EVENTS].path.stat().st_mtime

    @property
    def title(self) -> str:
        """Which session it is."""
        manifest = self.manifest
        return f"{manifest.task}, participant {manifest.participant_id}, session {manifest.session_id}"

    @property
    def levels(self) -> list[LevelSoFar]:
        """Thresholds so far, of a ramp session."""
        return self._thresholds.levels() if self._thresholds else []

    @property
    def two_interval(self) -> bool:
        """Whether a ramp is in one of two intervals."""
        return getattr(self.manifest.design, "procedure", None) is Procedure.TWO_INTERVAL

    @property
    def usable(self) -> list[Any]:
        """The trials that count."""
        return [trial for trial in self.trials if trial.usable]

    @property
    def flagged(self) -> int:
        """How many trials are left out of the analysis."""
        return sum(not (trial.practice or trial.usable) for trial in self.trials)

    @property
    def time_used(self) -> float:
        """Since the session began [s]."""
        return max((event.time for event in self.events), default=0.0)

    def to_come(self) -> tuple[float | None, int | None]:
        """Return the time left [s], breaks included, and in how many usable trials the next break is due.

        The pace is the mean time from a trial to the next, where no page came between; flagged trials are
        shown again as often as so far. Before there is a pace it is None; so is a break that does not come.
        """
        design, done = self.manifest.design, len(self.usable)
        left, (pace, rest) = self.manifest.n_trials - done, self._paces()
        every = min(
            getattr(design, "trials_between_breaks", 0) or math.inf,
            60 * getattr(design, "minutes_between_breaks", 0) / (pace or math.inf) or math.inf,
        )
        due = max(every - self._since_break(), 1)
        breaks = 0 if due >= left else 1 + int((left - due - 1) // every)
        return None if pace is None else left * pace + breaks * rest, round(due) if breaks else None

    def _since_break(self) -> int:
        """Return how many usable trials there were since the last break, or the beginning."""
        since = [trial.trial_index for trial in self.usable]
        for event in reversed(self.events):
            if _is_page(event, "break"):
                after = {e.trial_index for e in self.events if e.time > event.time}
                return sum(index in after for index in since)
        return len(since)

    def _paces(self) -> tuple[float | None, float]:
        """Return the time that a usable trial takes, None where nobody knows, and that of a break [s]."""
        design, practice = self.manifest.design, {t.trial_index for t in self.trials if t.practice}
        times: dict[str, list[float]] = {"trial": [], "break": []}
        begun = ("", 0.0)
        for event in self.events:
            if event.kind is EventKind.TRIAL_BEGUN and event.trial_index not in practice:
                times.setdefault(begun[0], []).append(event.time - begun[1])
                begun = "trial", event.time
            elif event.kind in BETWEEN_TRIALS and not (begun[0] == "break" and event.detail != "break"):
                begun = ("break" if _is_page(event, "break") else ""), event.time
        rest = float(np.mean(times["break"] or [BREAK_TIME]))
        if not times["trial"]:
            return (trial_seconds(design) if isinstance(design, RampDesign) else None), rest
        again = getattr(design, "repeat_flagged", False) and self.usable
        shown = 1 + self.flagged / len(self.usable) if again else 1.0
        return shown * float(np.mean(times["trial"])), rest

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
            return {"break": "break", "pause": "paused"}.get(last.detail, f"page {last.detail}")
        index, practised = last.trial_index or 0, sum(trial.practice for trial in self.trials)
        over = not practised or any(_is_page(event, "practice_end") for event in self.events)
        name = f"trial {index + 1 - practised}" if over else f"practice trial {index + 1}"
        return f"{name} is {'answered' if len(self.trials) > index else 'shown'}"

    @property
    def practice(self) -> str:
        """How the practice went, in words."""
        judged = [event.detail for event in self.events if event.kind is EventKind.PRACTISED]
        trials = [trial for trial in self.trials if trial.practice]
        if judged or not trials:
            return judged[-1] if judged else "none yet"
        if not isinstance(trials[0], RampTrial):
            return f"{len(trials)} shown"
        return f"{sum(trial.success != trial.is_catch for trial in trials)} of {len(trials)} right"

    @property
    def answers(self) -> str:
        """What the usable answers come to, in words: of ramps their shares, of all tasks how long they took.

        Of a viewing experiment nothing else is told: who knows how it goes may tell the participant.
        """
        usable = self.usable
        times = [trial.response_time for trial in usable if trial.response_time is not None]
        parts = [f"{np.median(times):.1f} s each"] if times else []
        ramps = [t.success for t in usable if isinstance(t, RampTrial) and not t.is_catch]
        catches = [t.success for t in usable if isinstance(t, RampTrial) and t.is_catch]
        if ramps:
            word = "right" if self.two_interval else "yes"
            parts.insert(0, f"{word} in {100 * np.mean(ramps):.0f} % of {len(ramps)} ramps")
        if catches:
            share = f"{100 * np.mean(catches):.0f} %"
            parts.insert(0, f"false alarms {sum(catches)} of {len(catches)} ({share})")
        return ", ".join(parts) or "none yet"

    @property
    def last_answers(self) -> str:
        """The last answers, the newest last."""
        return ", ".join(map(_answer, self.trials[-ANSWERS_SHOWN:])) or "none yet"

    @property
    def frames(self) -> str:
        """What is known of dropped frames, in words."""
        dropped = [getattr(trial, "frames_dropped", None) or 0 for trial in self.trials]
        words = f"dropped in {sum(map(bool, dropped))} of {len(dropped)} trials"
        words += f", {max(dropped)} at most" if any(dropped) else ""
        words += f"; longest frame {1000 * self.longest_frame:.1f} ms" if self.longest_frame else ""
        rig = self.manifest.rig
        return words + (f" (refresh {1000 / rig.refresh_rate:.1f} ms)" if rig else "")

    @property
    def note(self) -> str:
        """The last event that is not routine."""
        last = next((event for event in reversed(self.events) if event.kind not in ROUTINE), None)
        return f"{last.kind.value.replace('_', ' ')} {last.detail}".strip() if last else ""


def _is_page(event: SessionEvent, name: str) -> bool:
    """Return whether a page was shown."""
    return event.kind is EventKind.PAGE_SHOWN and event.detail == name


def _answer(trial: Any) -> str:
    """Return an answer in words; of a viewing experiment only how long it took."""
    if not isinstance(trial, RampTrial):
        return "answered" if trial.response_time is None else f"{trial.response_time:.1f} s"
    word = trial.response.value
    if trial.procedure is Procedure.TWO_INTERVAL:
        word = "right" if trial.success else "wrong"
    rate = "no change:" if trial.is_catch else f"{100 * trial.rate / trial.initial_luminance:.2g} %/s"
    return f"{rate} {word}"

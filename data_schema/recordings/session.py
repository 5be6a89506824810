"""A session: its manifest, written before its first trial, and the log of what happened."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import count, described, quantity, record
from evenlight.data_schema.recordings.ramp import FrameLog, RampDesign, RampTrial
from evenlight.data_schema.recordings.rating_scale import ONE_TO_FIVE, RatingScale
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.search import SearchDesign, SearchTrial, ViewLog
from evenlight.data_schema.recordings.viewing import (
    ClipLog,
    ComparisonDesign,
    ComparisonTrial,
    RatingDesign,
    RatingTrial,
    Stimulus,
)

Design = RampDesign | RatingDesign | ComparisonDesign | SearchDesign


@dataclass(frozen=True, slots=True)
class TaskRecords:
    """The records of a task: its design, a line of `trials.jsonl`, a line of `frames.jsonl`."""

    design: type[Any]
    trial: type[Any]
    frames: type[Any] = ClipLog


# Everything that goes by a task's name looks it up here; `evenlight.register_task` adds tasks of others.
TASKS = {
    "ramp": TaskRecords(RampDesign, RampTrial, FrameLog),
    "rating": TaskRecords(RatingDesign, RatingTrial),
    "comparison": TaskRecords(ComparisonDesign, ComparisonTrial),
    "search": TaskRecords(SearchDesign, SearchTrial, ViewLog),
}
BUILT_IN_TASKS = tuple(TASKS)


class SessionStatus(enum.Enum):
    """How far a session got."""

    RUNNING = "running"
    COMPLETE = "complete"
    ABORTED = "aborted"
    DECLINED = "declined"  # without consent: no trial was shown, and none will be
    IMPORTED = "imported"  # from another program's file: complete as far as that goes


WHOLE = (SessionStatus.COMPLETE, SessionStatus.IMPORTED)  # all trials are there that there will be


@record
class ImportSource:
    """The file of another program that a session was imported from, and how it was read."""

    file: str = described("which of the files it was, without its name, which may be a person's")
    file_format: str = described("what kind of table it is, as it was recognized")
    sha256: str = described("SHA-256 of the file")
    columns: dict[str, str] = described("its column for each of Evenlight's", factory=dict)
    units: dict[str, str] = described("unit of a column, as stated", factory=dict)
    values: dict[str, str] = described("its values for each of Evenlight's, as `version:ours`", factory=dict)
    constants: dict[str, str] = described("what holds for all rows, as stated", factory=dict)
    scale: RatingScale | None = described(
        "scale of the ratings; null if there are none, or for 1 to 5 in whole points", default=None
    )


@record
class SessionManifest:
    """What a session is: who, which task and design, on which display."""

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    task: str = described("experiment: ramp, rating, comparison, search, or a registered one")
    simulated: bool = described("true if a simulated observer answers")
    status: SessionStatus = described("how far the session got")
    n_trials: int = count(
        "usable trials that the design asks for, or an imported file holds; practice and trials shown again "
        "are not counted"
    )
    display: Display | None = described("display it ran on; null if unknown")
    design: Design | None = described("what was shown, and how; null if unknown")
    provenance: Provenance = described("how the file was made")
    order_index: int = count(
        "row of the counterbalanced order of blocks: the participant's place in the data set", default=0
    )
    rig: Rig | None = described("what it ran on; null from a simulation without a rig", default=None)
    pages: dict[str, str] = described(
        "SHA-256 of each page of instructions, by its name; font: of a lab's own", factory=dict
    )
    apparatus: dict[str, str] = described("what window, driver and keyboard say of themselves", factory=dict)
    started: str = described("when it began, UTC (ISO 8601); empty without a clock", default="")
    stimuli: tuple[Stimulus, ...] = described(
        "sequences of a viewing experiment, with their tracks", default=()
    )
    source: ImportSource | None = described("the file it was imported from; null if none", default=None)

    def __post_init__(self) -> None:
        known = TASKS.get(self.task)
        if known is not None and not isinstance(self.design, known.design | None):
            raise ValueError(
                f"the design of the task {self.task!r} must be a {known.design.__name__}, got a "
                f"{type(self.design).__name__}"
            )

    @property
    def order_known(self) -> bool:
        """Whether `trial_index` is the order in which trials were shown, not only that of a file's rows."""
        return self.source is None or "trial_index" in self.source.columns

    @property
    def scale(self) -> RatingScale:
        """The scale of its ratings: 1 to 5 in whole points, where an imported file had no other."""
        return (self.source and self.source.scale) or ONE_TO_FIVE

    @staticmethod
    def types_in(content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the type of `design` in the manifest of a known task; `mapping` asks for it."""
        task = content.get("task")
        if not isinstance(task, str) or task not in TASKS:
            return {}  # what is no text is refused with the other keys
        return {"design": TASKS[task].design | None}


class EventKind(enum.Enum):
    """What happened in a session."""

    STARTED = "started"
    RESUMED = "resumed"
    PAGE_SHOWN = "page_shown"
    CONSENT_GIVEN = "consent_given"
    CONSENT_DECLINED = "consent_declined"
    KEYS_TRIED = "keys_tried"  # each key of the task was pressed; its detail has those pressed instead
    PRACTISED = "practised"  # practice with a criterion is over: passed or not, and with how many right
    TRIAL_BEGUN = "trial_begun"
    TRIAL_INTERRUPTED = "trial_interrupted"  # shown, not answered: it is shown again
    TRIAL_FLAGGED = "trial_flagged"  # answered, left out of the analysis
    CHANGED = "changed"  # apparatus, software or pages are others than the manifest says
    READING_DOUBTED = "reading_doubted"  # contradicted those before it, and was repeated at once
    READING_FAILED = "reading_failed"  # of an instrument; tried again, or the reason for the stop
    OLD_CALIBRATION = "old_calibration"  # used because the operator asked for it
    RECALIBRATED = "recalibrated"  # the display has another calibration than in the last sessions
    LINE_TORN = "line_torn"  # what a crash left of a line; its text is kept here
    PAUSED = "paused"
    CONTINUED = "continued"
    STOPPED = "stopped"  # by the experimenter or the participant
    COMPLETED = "completed"
    TRIGGER_SENT = "trigger_sent"  # to other recorders, when a stimulus began or ended
    TRIGGER_FAILED = "trigger_failed"  # a device took none, and gets no more in this session


@record
class SessionEvent:
    """One event of a session, as one line of `events.jsonl`."""

    kind: EventKind = described("what happened")
    time: float = quantity("s", "since the session began", minimum=0.0)
    utc: str = described("when, UTC (ISO 8601); empty without a clock", default="")
    trial_index: int | None = count("trial in which it happened, if in one", default=None)
    attempt: int | None = count("attempt at that trial", minimum=1, default=None)
    detail: str = described("more about it: the page's name, the torn line, the reason", default="")
    code: int | None = quantity("1", "what a trigger sent", minimum=1, maximum=255, default=None)
    delay: float | None = quantity(
        "s", "from a trigger's flip, at `time_s`, until all devices had taken it", minimum=0.0, default=None
    )

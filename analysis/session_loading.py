"""Reading the sessions of one task from a data set, checked line by line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.provenance import sha256_of_bytes, sha256_of_file
from evenlight.data_schema.recordings.dataset_layout import MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.ramp import Trial as AnyTrial
from evenlight.data_schema.recordings.rating_scale import ONE_TO_FIVE, RatingScale
from evenlight.data_schema.recordings.roll_call import RollCall, SessionUse, call_roll
from evenlight.data_schema.recordings.session import WHOLE, SessionManifest
from evenlight.data_schema.recordings.viewing import RatingTrial
from evenlight.data_schema.storage.text_files import read_json, read_json_lines

Trial = TypeVar("Trial", bound=AnyTrial)


@dataclass(frozen=True, slots=True)
class Session(Generic[Trial]):
    """One session of an experiment.

    Attributes
    ----------
    folder : Path
        Where it lies.
    manifest : SessionManifest
        What it is.
    trials : tuple of trials
        Those that count: without practice, and without flagged ones.
    n_practice, n_flagged : int
        Trials that were left out.
    n_repeated : int
        Trials that count, and had been shown before and interrupted.
    """

    folder: Path
    manifest: SessionManifest
    trials: tuple[Trial, ...]
    n_practice: int = 0
    n_flagged: int = 0
    n_repeated: int = 0

    @property
    def remarks(self) -> list[str]:
        """What is to be said about it: trials that are missing or do not count."""
        manifest, used, remarks = self.manifest, len(self.trials), []
        if manifest.status not in WHOLE or used < manifest.n_trials:
            words = f"{manifest.status.value} with {used} of {manifest.n_trials} trials; they are used"
            remarks.append(f"the session is {words}")
        if self.n_repeated:
            remarks.append(f"{self.n_repeated} trials had been shown before and interrupted; they are used")
        if self.n_flagged:
            remarks.append(f"trials left out: {self.n_flagged} flagged (dropped frames)")
        return [f"{self.folder}: {words}" for words in remarks]


@dataclass(frozen=True, slots=True)
class TaskData(Generic[Trial]):
    """All sessions of one task in a data set.

    Attributes
    ----------
    task : str
        A key of `data_schema.recordings.session.TASKS`.
    sessions : tuple of Session
        In order of participant and session.
    simulated : bool
        Whether simulated observers answered.
    sha256 : str
        Of the manifests and trials that were read.
    warnings : tuple of str
        What is wrong but does not forbid the use: sessions cut short, a torn last line, trials left out.
    rows : tuple of trials
        Trials that were not read from sessions, as of a table in memory (`task_data_of`).
    roll : RollCall or None
        All sessions of the data set, those of other tasks too; None of trials in memory.
    scale : RatingScale
        Of ratings.
    departures : tuple of str
        From what was pre-registered, in words.
    """

    task: str
    sessions: tuple[Session[Trial], ...]
    simulated: bool
    sha256: str
    warnings: tuple[str, ...]
    rows: tuple[Trial, ...] = ()
    roll: RollCall | None = None
    scale: RatingScale = ONE_TO_FIVE
    departures: tuple[str, ...] = ()

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials that count."""
        return tuple(trial for session in self.sessions for trial in session.trials) + self.rows

    @property
    def participant_ids(self) -> tuple[str, ...]:
        """The participants, in order."""
        known = [session.manifest.participant_id for session in self.sessions]
        return tuple(dict.fromkeys(known + [trial.participant_id for trial in self.rows]))

    @property
    def order_known(self) -> bool:
        """Whether the order of trials is that in which they were shown; not always in imported sessions."""
        return all(session.manifest.order_known for session in self.sessions)

    @property
    def designed_sequences(self) -> tuple[str, ...]:
        """The sequences of the sessions' designs, in their order; none of trials whose design is unknown."""
        designs = (session.manifest.design for session in self.sessions)
        viewed = (design for design in designs if not isinstance(design, RampDesign | None))
        return tuple(dict.fromkeys(name for design in viewed for name in design.sequences))


def task_data_of(task: str, trials: Iterable[Trial], simulated: bool = False) -> TaskData[Trial]:
    """Return trials in memory as the data of a task, without sessions and files.

    Practice and flagged trials are left out.

    Parameters
    ----------
    task : str
        Which one, a key of `data_schema.recordings.session.TASKS`.
    trials : iterable of trials
        Of the class of that task.
    simulated : bool
        Whether simulated observers answered.

    Raises
    ------
    InputError
        If there is no trial that counts.
    """
    rows = tuple(trial for trial in trials if trial.usable)
    if not rows:
        raise InputError(f"no {task} trial counts: expected one that is neither practice nor flagged")
    return TaskData(task, (), simulated, sha256="", warnings=(), rows=rows)


def undamaged_roll(dataset: Path) -> RollCall:
    """Return the roll-call of a data set, or refuse one with a session that cannot be read or told apart.

    Raises
    ------
    InputError
        If there is no such folder, trials without a manifest, or a manifest that cannot be read.
    """
    roll = call_roll(dataset)
    for entry in roll.sessions:
        if entry.use is SessionUse.DAMAGED:
            raise InputError(f"{dataset / entry.folder}: {entry.why}")
    return roll


def load_task(dataset: Path, task: str, cls: type[Trial], roll: RollCall | None = None) -> TaskData[Trial]:
    """Return the sessions of a task.

    A session that cannot be used is left out, as its roll-call says.

    Parameters
    ----------
    dataset : Path
        The data set.
    task : str
        Which one, a key of `data_schema.recordings.session.TASKS`.
    cls : type
        The class of its trials.
    roll : RollCall, optional
        That of the data set, from `undamaged_roll`.

    Raises
    ------
    InputError
        If there is no trial that counts, a session has trials but no manifest, a record is not as it should
        be, or simulated and recorded sessions are mixed; the message names the file, and the line.
    """
    roll = roll or undamaged_roll(dataset)
    warnings: list[str] = []
    sessions, flagged = [], 0
    for entry in roll.read:
        if entry.task != task:
            continue
        session, torn = _read_session(dataset / entry.folder, cls)
        flagged += session.n_flagged
        warnings += torn
        if session.trials:
            sessions.append(session)
            warnings += session.remarks
        else:
            left_out = f"{session.n_practice} of practice, {session.n_flagged} flagged (dropped frames)"
            roll = roll.without(entry.folder, f"it has no trial that counts ({left_out})")
    if not sessions:
        raise InputError(_nothing_to_read(dataset, task, roll, flagged))
    simulated = {session.manifest.simulated for session in sessions}
    if len(simulated) > 1:
        raise InputError(
            f"{dataset}: holds simulated and recorded {task} sessions; put them in two data sets"
        )
    warnings += _shown_otherwise(task, sessions)
    scales = {session.manifest.scale: session.folder for session in sessions}
    if len(scales) > 1:
        told = " and ".join(f"{scale} ({folder.relative_to(dataset)})" for scale, folder in scales.items())
        raise InputError(
            f"{dataset}: ratings on different scales, {told}; put them in data sets of their own"
        )
    files = [session.folder / name for session in sessions for name in (MANIFEST, TRIALS)]
    digests = (f"{path.relative_to(dataset).as_posix()} {sha256_of_file(path)}\n" for path in files)
    sha256 = sha256_of_bytes("".join(digests).encode())
    scale = next(iter(scales))
    return TaskData(task, tuple(sessions), simulated.pop(), sha256, tuple(warnings), roll=roll, scale=scale)


def _shown_otherwise(task: str, sessions: Iterable[Session[Trial]]) -> list[str]:
    shown = {(each.name, each.video_sha256) for own in sessions for each in own.manifest.stimuli}
    several = sorted(name for name, count in Counter(name for name, _ in shown).items() if count > 1)
    what = "scene, path or rings" if task == "search" else "video"
    return [f"{task}: sessions differ in the {what} that they showed as {name}" for name in several]


def _nothing_to_read(dataset: Path, task: str, roll: RollCall, flagged: int) -> str:
    """Return what a data set has instead of sessions of a task that can be read."""
    own = sum(entry.task == task for entry in roll.sessions)
    none = f"whose {flagged} trials are all flagged (dropped frames)" if flagged else "without any trial"
    found = f"{own} {none}" if own else "no session"
    why = f"; {roll.warnings[0]}" if roll.warnings else ""
    return f"{dataset}: expected {task} sessions (sub-*/ses-*/{MANIFEST} and {TRIALS}), found {found}{why}"


def _read_session(folder: Path, cls: type[Trial]) -> tuple[Session[Trial], list[str]]:
    """Return a session, and whether its last line was torn by an interruption."""
    path, about = folder / TRIALS, folder / MANIFEST
    told = read_json(about, "the manifest of a session")
    manifest = record_from_mapping(SessionManifest, told, str(about))
    lines, torn = read_json_lines(path, "one trial per line") if path.exists() else ([], None)
    trials = [record_from_mapping(cls, content, f"{path}, line {number}") for number, content in lines]
    seen: set[int] = set()
    for trial in trials:
        _require_own(trial, manifest, path)
        if trial.trial_index in seen:
            raise InputError(
                f"{path}: trial {trial.trial_index} is there twice; each trial_index may appear once in a "
                "session"
            )
        seen.add(trial.trial_index)
    session = Session(
        folder,
        manifest,
        tuple(trial for trial in trials if trial.usable),
        n_practice=sum(trial.practice for trial in trials),
        n_repeated=sum(trial.usable and trial.attempt > 1 for trial in trials),
        n_flagged=sum(not trial.practice and not trial.usable for trial in trials),
    )
    words = f"{path}, line {torn}: the last line is torn and was left out; the trial was not complete"
    return session, [words] if torn else []


def _require_own(trial: AnyTrial, manifest: SessionManifest, path: Path) -> None:
    for name in ("participant_id", "session_id", "simulated"):
        got, right = getattr(trial, name), getattr(manifest, name)
        if got != right:
            raise InputError(
                f"{path}: trial {trial.trial_index}: {name} is {got!r}, but {right!r} in the session's "
                f"{MANIFEST}"
            )
    if isinstance(trial, RatingTrial) and (problem := manifest.scale.refusal(trial.rating)):
        raise InputError(f"{path}: trial {trial.trial_index}: {problem}")

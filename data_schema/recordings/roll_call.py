"""The roll-call of a data set: which sessions it holds, which of them are read, and why the others are not.

Whoever reads, checks or exports a data set goes by it, so that all agree on who took part.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError, shown
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.quantities import count, described, record
from evenlight.data_schema.recordings.dataset_layout import DESCRIPTION, MANIFEST, PARTICIPANTS, TRIALS
from evenlight.data_schema.recordings.session import TASKS, SessionStatus
from evenlight.data_schema.storage.text_files import read_json, read_text

SUBJECT = re.compile("sub-[0-9A-Za-z]+")
SESSION = re.compile("ses-[0-9A-Za-z]+")
# Names that are to be one of these, as far as a reader can tell: `Sub-02`, `sub_02`, `sub-02 copy`.
NEARLY = {SUBJECT: re.compile("sub[-_ ].*", re.IGNORECASE), SESSION: re.compile("ses[-_ ].*", re.IGNORECASE)}
MISNAMED = "its name is not {} with letters and digits after it; rename it, or move it out of the data set"
WHOSE = ("participant_id", "session_id")
MEASURED = ("response_time_s", "search_time_s", "onset_s")
DISTINCT_TIMES = 3  # that agree in two sessions by no chance
SIMULATED_TRIALS = 30  # whose random answers agree by no chance


class SessionUse(enum.Enum):
    """What becomes of a session."""

    READ = "read"
    LEFT_OUT = "left_out"  # nothing is wrong with it, and there is nothing to read
    WRONG = "wrong"  # left out until it is put right: its name, its task, no trial though complete, a copy
    DAMAGED = "damaged"  # refused: trials without a manifest, or files that cannot be read


@record
class RollEntry:
    """One session of a data set, or a folder that should be one."""

    folder: str = described("its folder, below the data set's")
    participant_id: str = described("participant by the manifest, or by the folder without one")
    session_id: str = described("session by the manifest, or by the folder without one", default="")
    task: str | None = described("task by the manifest; null if it names none", default=None)
    status: str = described("how far it got, by the manifest; empty if it does not say", default="")
    display: str = described("its display and calibration by the manifest; empty if unknown", default="")
    source: str = described("name of the file that it was imported from; empty if recorded", default="")
    n_trials: int = count("lines of its trials, practice and all", default=0)
    use: SessionUse = described("what becomes of it", default=SessionUse.READ)
    why: str = described("why it is not read; empty if it is", default="")


@record
class RollCall:
    """Who took part in a data set: its sessions, its list of participants, and where they disagree."""

    dataset: str = described("name of its folder")
    sessions: tuple[RollEntry, ...] = described("its sessions, in order of their folders")
    listed: tuple[str, ...] = described("participants of participants.tsv, without `sub-`", default=())
    remarks: tuple[str, ...] = field(
        default=(), metadata={"doc": "where list, folders and manifests disagree; links out of the data set"}
    )

    @property
    def read(self) -> tuple[RollEntry, ...]:
        """The sessions that are read."""
        return tuple(entry for entry in self.sessions if entry.use is SessionUse.READ)

    @property
    def tasks(self) -> tuple[str, ...]:
        """The tasks of which sessions are read, in the order of `TASKS`."""
        return tuple(task for task in TASKS if any(entry.task == task for entry in self.read))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be said about it: each session that is not read and why, and the remarks."""
        left = (f"{e.folder} is left out: {e.why}" for e in self.sessions if e.use is not SessionUse.READ)
        return (*left, *self.remarks)

    def without(self, folder: str, why: str) -> RollCall:
        """Return the roll-call with one more session left out."""
        left = (_not_read(e, SessionUse.LEFT_OUT, why) if e.folder == folder else e for e in self.sessions)
        return dataclasses.replace(self, sessions=tuple(left))


def call_roll(dataset: Path) -> RollCall:
    """Return the roll-call of a data set; nothing that is wrong with a session stops it.

    Parameters
    ----------
    dataset : Path
        Folder of the data set.

    Raises
    ------
    InputError
        If there is no such folder.
    """
    if not dataset.is_dir():
        raise InputError(f"{dataset}: no such folder; expected a data set ({DESCRIPTION}, sub-* folders)")
    found = [entry for folder in sorted(dataset.glob("*")) for entry in _of_participant(dataset, folder)]
    entries = _without_copies(dataset, found)
    folders = dict.fromkeys(entry.folder.partition("/")[0] for entry in entries)
    listed, remarks = _listed(dataset, [name for name in folders if SUBJECT.fullmatch(name)])
    remarks += [remark for entry in entries for remark in _about(dataset, entry)]
    return RollCall(dataset.resolve().name, tuple(entries), tuple(listed), tuple(remarks))


def folders_named(parent: Path, pattern: re.Pattern[str]) -> list[Path]:
    """Return the folders of a name, in order."""
    return sorted(path for path in parent.glob("*") if path.is_dir() and pattern.fullmatch(path.name))


def _of_participant(dataset: Path, folder: Path) -> Iterator[RollEntry]:
    """Yield the sessions in a folder of a data set; none if it is no participant's."""
    entry = RollEntry(folder.name, folder.name.removeprefix("sub-"))
    if SUBJECT.fullmatch(folder.name) and (folder.is_dir() or folder.is_symlink()):
        sessions = [one for path in sorted(folder.glob("*")) for one in _of_session(entry, path)]
        yield from sessions or [_not_read(entry, SessionUse.LEFT_OUT, "it holds no session folder (ses-*)")]
    elif _should_be(folder, SUBJECT, f"*/{TRIALS}"):
        yield _not_read(entry, SessionUse.WRONG, MISNAMED.format("sub-"))


def _of_session(participant: RollEntry, folder: Path) -> Iterator[RollEntry]:
    """Yield the session in a folder of a participant; none if it is no session's."""
    entry = dataclasses.replace(
        participant,
        folder=f"{participant.folder}/{folder.name}",
        session_id=folder.name.removeprefix("ses-"),
    )
    if SESSION.fullmatch(folder.name) and folder.is_dir():
        try:
            yield _by_manifest(entry, folder)
        except InputError as error:
            yield _not_read(entry, SessionUse.DAMAGED, str(error).removeprefix(f"{folder}/"))
    elif _should_be(folder, SESSION, TRIALS):
        yield _not_read(entry, SessionUse.WRONG, MISNAMED.format("ses-"))


def _should_be(folder: Path, pattern: re.Pattern[str], trials: str) -> bool:
    nearly = NEARLY[pattern].fullmatch(folder.name) is not None
    return folder.is_dir() and not folder.name.startswith(".") and (nearly or any(folder.glob(trials)))


def _not_read(entry: RollEntry, use: SessionUse, why: str) -> RollEntry:
    return dataclasses.replace(entry, use=use, why=why)


def _by_manifest(entry: RollEntry, folder: Path) -> RollEntry:
    """Return an entry with what the manifest of the session says, or refuse one that says nothing."""
    entry = dataclasses.replace(entry, n_trials=len(_lines(folder / TRIALS)))
    if not (folder / MANIFEST).exists():
        if entry.n_trials:
            raise InputError(
                f"holds {TRIALS} but no {MANIFEST}; restore the manifest, or move the session out of the "
                "data set"
            )
        return _not_read(entry, SessionUse.LEFT_OUT, f"it holds no {MANIFEST} and no trial")
    content = read_json(folder / MANIFEST, "the manifest of a session")
    if not isinstance(content, dict):
        raise InputError(f"{MANIFEST}: expected names and values, got {shown(content)}")
    known = ("participant_id", "session_id", "task", "status")
    told: dict[str, Any] = {key: content[key] for key in known if isinstance(content.get(key), str)}
    if isinstance(content.get("display"), dict):
        with suppress(InputError):  # what is wrong with it is said where the session is read
            display = record_from_mapping(Display, content["display"], MANIFEST)
            told["display"] = f"{display.name}: {display.calibration}"
    source = content.get("source")
    if isinstance(source, dict) and isinstance(source.get("file"), str):
        told["source"] = source["file"]
    entry = dataclasses.replace(entry, **told)
    if entry.task is None:
        return _not_read(entry, SessionUse.WRONG, f"{MANIFEST}: task: got {shown(content.get('task'))}")
    return _as_used(entry, entry.task)


def _as_used(entry: RollEntry, task: str) -> RollEntry:
    if task not in TASKS:
        meant = next((known for known in TASKS if known.lower() == task.strip().lower()), None)
        if meant is not None:
            return _not_read(entry, SessionUse.WRONG, f"{MANIFEST}: task: expected {meant!r}, got {task!r}")
        why = f"its task {task!r} is none of {', '.join(TASKS)}, and is not registered (EVENLIGHT_TASKS)"
        return _not_read(entry, SessionUse.LEFT_OUT, why)
    if entry.status == SessionStatus.DECLINED.value:
        return _not_read(entry, SessionUse.LEFT_OUT, "the participant declined")
    if not entry.n_trials:
        done = entry.status in (SessionStatus.COMPLETE.value, SessionStatus.IMPORTED.value)
        use = SessionUse.WRONG if done else SessionUse.LEFT_OUT
        return _not_read(entry, use, f"it has no trial (status: {entry.status or 'none'})")
    return entry


def _lines(path: Path) -> list[str]:
    """Return the lines of a file of trials that hold anything; none if there is no such file."""
    if not path.exists():
        return []
    return [line for line in read_text(path, "one trial per line in JSON").split("\n") if line.strip()]


def _without_copies(dataset: Path, entries: list[RollEntry]) -> list[RollEntry]:
    """Return the entries with copies marked: of two, that whose folder agrees with its manifest is read."""
    first: dict[object, str] = {}
    marked = {}
    for entry in sorted(entries, key=lambda entry: not _agrees(entry)):
        if entry.use is not SessionUse.READ:
            continue
        trials = _fingerprint(_lines(dataset / entry.folder / TRIALS))
        named = (entry.participant_id, entry.session_id)
        twin = first.get(trials) if trials else None
        if twin is not None:
            why = f"its trials are those of {twin}; a copy counts once"
        elif named in first:
            twin = first[named]
            why = f"by its {MANIFEST} it is session {named[1]} of participant {named[0]}, which {twin} is"
        if twin is not None:
            marked[entry.folder] = dataclasses.replace(entry, use=SessionUse.WRONG, why=why)
            continue
        first |= {named: entry.folder} | ({trials: entry.folder} if trials else {})
    return [marked.get(entry.folder, entry) for entry in entries]


def _agrees(entry: RollEntry) -> bool:
    return entry.folder == f"sub-{entry.participant_id}/ses-{entry.session_id}"


def _fingerprint(lines: list[str]) -> str:
    """Return the SHA-256 of trials without whose they are; empty where two people's may agree by chance.

    Measured times of two sessions agree by no chance, nor do many answers that were drawn at random. A few
    answers without times, as of another laboratory's table, well may.
    """
    trials, times = [], set()
    try:
        for line in lines:
            trial = json.loads(line)
            times |= {(key, trial[key]) for key in MEASURED if trial.get(key) is not None}
            trials.append({key: value for key, value in trial.items() if key not in WHOSE})
    except (ValueError, AttributeError, TypeError, RecursionError):
        return ""  # no record; whoever reads it says so
    drawn = len(trials) >= SIMULATED_TRIALS and all(trial.get("simulated") is True for trial in trials)
    if len(times) < DISTINCT_TIMES and not drawn:
        return ""
    return sha256_of_bytes(json.dumps(trials, sort_keys=True).encode())


def _about(dataset: Path, entry: RollEntry) -> Iterator[str]:
    if entry.use is SessionUse.READ and not _agrees(entry):
        yield (
            f"{entry.folder} is read as session {entry.session_id} of participant {entry.participant_id}, as "
            f"its {MANIFEST} says"
        )
    if leads_out(dataset / entry.folder / TRIALS, dataset):
        yield f"{entry.folder} is a link out of the data set; it is read, and not exported"


def leads_out(path: Path, dataset: Path) -> bool:
    """Return whether a path inside a data set is, by links, one outside of it."""
    try:
        return not path.resolve().is_relative_to(dataset.resolve())
    except (OSError, RuntimeError):  # a circle of links leads nowhere
        return True


def _listed(dataset: Path, folders: list[str]) -> tuple[list[str], list[str]]:
    path = dataset / PARTICIPANTS
    if not path.exists():
        return [], []
    try:
        lines = read_text(path, "the list of participants").split("\n")
    except InputError as error:
        return [], [str(error).removeprefix(f"{dataset}/")]
    first, *cells = (line.split("\t")[0].strip() for line in lines if line.strip() or line is lines[0])
    names = [cell for cell in dict.fromkeys(cells) if SUBJECT.fullmatch(cell)]
    if first != "participant_id" or len(names) < len(set(cells)):
        return [], [
            f"{PARTICIPANTS} is no list of participant_id and sub-XX; `evenlight validate` says where"
        ]
    waiting = [name for name in names if name not in folders]
    unknown = [name for name in folders if name not in names]
    remarks = (
        [f"without a session, though {PARTICIPANTS} lists them: {', '.join(waiting)}"] if waiting else []
    )
    remarks += [f"not listed in {PARTICIPANTS}: {', '.join(unknown)}"] if unknown else []
    return [name.removeprefix("sub-") for name in names], remarks

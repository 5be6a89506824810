"""Reading a data set: its ramp sessions, checked line by line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from data_schema.dataset_layout import DESCRIPTION, MANIFEST, TRIALS, session_folder, session_folders
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.mapping import record_from_mapping
from data_schema.provenance import sha256_of_bytes, sha256_of_file
from data_schema.ramp import RampDesign, RampTrial
from data_schema.session import SessionManifest, SessionStatus
from data_schema.text_files import read_json, read_text
from method.luminance import dimmed_luminance, displayed_luminance

ROUNDING = 1e-6  # relative, of a luminance that was computed and written


@dataclass(frozen=True, slots=True)
class RampSession:
    """One session of the ramp experiment.

    Attributes
    ----------
    manifest : SessionManifest
        What it is.
    trials : tuple of RampTrial
        Those that count: without practice, and without flagged ones.
    n_practice, n_flagged : int
        Trials that were left out.
    n_repeated : int
        Trials that count, and had been shown before and interrupted.
    """

    manifest: SessionManifest
    trials: tuple[RampTrial, ...]
    n_practice: int = 0
    n_flagged: int = 0
    n_repeated: int = 0

    @property
    def design(self) -> RampDesign:
        """What was shown."""
        return ramp_design(self.manifest)


def ramp_design(manifest: SessionManifest) -> RampDesign:
    """Return the design of a ramp session; its manifest has made sure that it is one."""
    return cast(RampDesign, manifest.design)


@dataclass(frozen=True, slots=True)
class RampData:
    """All ramp sessions of a data set.

    Attributes
    ----------
    sessions : tuple of RampSession
        In order of participant and session.
    display : Display
        The one display of all sessions.
    simulated : bool
        Whether simulated observers answered.
    sha256 : str
        Of the manifests and trials that were read.
    warnings : tuple of str
        What is amiss but does not forbid the use: sessions cut short, a torn last line, trials left out.
    """

    sessions: tuple[RampSession, ...]
    display: Display
    simulated: bool
    sha256: str
    warnings: tuple[str, ...]

    @property
    def trials(self) -> tuple[RampTrial, ...]:
        """All trials of all sessions that count."""
        return tuple(trial for session in self.sessions for trial in session.trials)

    @property
    def participant_ids(self) -> tuple[str, ...]:
        """The participants, in order."""
        return tuple(dict.fromkeys(session.manifest.participant_id for session in self.sessions))


def load_ramp_data(dataset: Path) -> RampData:
    """Return the ramp sessions of a data set.

    Raises
    ------
    InputError
        If there is no ramp trial, a session has trials but no manifest, a record is not as it should be,
        sessions ran on different displays, or simulated and recorded sessions are mixed; the message
        names the file, and the line.
    """
    if not dataset.is_dir():
        raise InputError(f"{dataset}: no such folder; expected a data set ({DESCRIPTION}, sub-* folders)")
    _require_manifests(dataset)
    warnings: list[str] = []
    sessions = []
    files = []
    for folder in session_folders(dataset):
        if _task(folder / MANIFEST) != "ramp":
            continue
        session, remarks = _read_session(folder)
        sessions.append(session)
        warnings += remarks
        files += [folder / MANIFEST, folder / TRIALS]
    if not any(session.trials for session in sessions):
        flagged = sum(session.n_flagged for session in sessions)
        none = f"whose {flagged} trials are all flagged (dropped frames)" if flagged else "without any trial"
        found = f"{len(sessions)} {none}" if sessions else "no session"
        raise InputError(
            f"{dataset}: expected ramp sessions (sub-*/ses-*/{MANIFEST} and {TRIALS}), found {found}"
        )
    display = _one_display(sessions, dataset)
    for session in sessions:
        _check_levels(session, dataset)
    digests = (f"{path.relative_to(dataset).as_posix()} {sha256_of_file(path)}\n" for path in files)
    return RampData(
        sessions=tuple(sessions),
        display=display,
        simulated=_all_or_none_simulated(sessions, dataset),
        sha256=sha256_of_bytes("".join(digests).encode()),
        warnings=tuple(warnings),
    )


def has_ramp_sessions(dataset: Path) -> bool:
    """Return whether a data set holds anything that `load_ramp_data` would read or refuse."""
    trials = dataset.glob(f"sub-*/ses-*/{TRIALS}")
    if any(not (path.parent / MANIFEST).exists() for path in trials):
        return True
    return any(_task(folder / MANIFEST) == "ramp" for folder in session_folders(dataset))


def _require_manifests(dataset: Path) -> None:
    """Refuse trials without a manifest, which nothing else would read or miss."""
    for trials in sorted(dataset.glob(f"sub-*/ses-*/{TRIALS}")):
        if not (trials.parent / MANIFEST).exists():
            raise InputError(
                f"{trials.parent}: holds {TRIALS} but no {MANIFEST}; restore the manifest, or move the "
                "session out of the data set"
            )


def _task(manifest: Path) -> object:
    """Return the task that a manifest names, whatever else it holds."""
    content = read_json(manifest, "the manifest of a session")
    return content.get("task") if isinstance(content, dict) else None


def _read_session(folder: Path) -> tuple[RampSession, list[str]]:
    """Return a session and what is to be said about it."""
    path = folder / MANIFEST
    manifest = record_from_mapping(SessionManifest, read_json(path, "the manifest of a session"), str(path))
    trials, warnings = _read_trials(folder / TRIALS)
    seen: set[int] = set()
    for trial in trials:
        _check_trial(trial, manifest, seen, folder / TRIALS)
        seen.add(trial.trial_index)
    session = RampSession(
        manifest,
        tuple(trial for trial in trials if trial.usable),
        n_practice=sum(trial.practice for trial in trials),
        n_repeated=sum(trial.usable and trial.attempt > 1 for trial in trials),
        n_flagged=sum(not trial.practice and not trial.usable for trial in trials),
    )
    return session, warnings + _remarks(session, folder)


def _remarks(session: RampSession, folder: Path) -> list[str]:
    """Return what is to be said about a session: trials that are missing or do not count."""
    manifest, used = session.manifest, len(session.trials)
    remarks = []
    if manifest.status is not SessionStatus.COMPLETE or used < manifest.n_trials:
        remarks.append(
            f"{folder}: the session is {manifest.status.value} with {used} of {manifest.n_trials} "
            "trials; they are used"
        )
    if session.n_repeated:
        remarks.append(
            f"{folder}: {session.n_repeated} trials had been shown before and interrupted; they are used"
        )
    if session.n_flagged:
        remarks.append(f"{folder}: trials left out: {session.n_flagged} flagged (dropped frames)")
    return remarks


def _check_trial(trial: RampTrial, manifest: SessionManifest, seen: set[int], path: Path) -> None:
    """Refuse a trial that does not belong to its session, or is there twice."""
    where = f"{path}: trial {trial.trial_index}"
    own = (trial.participant_id, trial.session_id, trial.simulated, trial.procedure.value)
    expected = (
        manifest.participant_id,
        manifest.session_id,
        manifest.simulated,
        ramp_design(manifest).procedure.value,
    )
    names = ("participant_id", "session_id", "simulated", "procedure")
    for name, got, right in zip(names, own, expected, strict=True):
        if got != right:
            raise InputError(f"{where}: {name} is {got!r}, but {right!r} in the session's {MANIFEST}")
    if trial.trial_index in seen:
        raise InputError(f"{where} is there twice; each trial_index may appear once in a session")


def _check_levels(session: RampSession, dataset: Path) -> None:
    """Refuse trials that the session's design and display cannot have shown."""
    manifest, design = session.manifest, session.design
    folder = session_folder(dataset, manifest.participant_id, manifest.session_id)
    pixel_values = {"white": design.white_pixel_value, "gray": design.gray_pixel_value}
    for trial in session.trials:
        where = f"{folder / TRIALS}: trial {trial.trial_index}"
        if trial.factor not in design.factors or trial.screen not in design.screens:
            raise InputError(
                f"{where}: the session's design has no {trial.screen} screen at factor {trial.factor:g}"
            )
        full = displayed_luminance(pixel_values[trial.screen], manifest.display)
        emitted = full - manifest.display.reflected_luminance
        right = float(dimmed_luminance(emitted, trial.factor, manifest.display))
        if abs(trial.initial_luminance - right) > ROUNDING * right:
            raise InputError(
                f"{where}: initial_luminance_cd_m2 is {trial.initial_luminance:g}, but {trial.screen} at "
                f"factor {trial.factor:g} has {right:g} cd/m^2 on the session's display"
            )


def _read_trials(path: Path) -> tuple[list[RampTrial], list[str]]:
    """Return the trials of a file, and a warning if its last line was torn by an interruption."""
    if not path.exists():
        return [], []
    trials: list[RampTrial] = []
    lines = list(_numbered_lines(path))
    for place, (number, line) in enumerate(lines, start=1):
        where = f"{path}, line {number}"
        try:
            content = json.loads(line)
        except json.JSONDecodeError as error:
            if place == len(lines):
                return trials, [
                    f"{where}: the last line is torn and was left out; the trial was not complete"
                ]
            raise InputError(f"{where}: not valid JSON ({error.msg}); expected one trial per line") from None
        trials.append(record_from_mapping(RampTrial, content, where))
    return trials, []


def _numbered_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Return the lines of a text file that hold anything, with their numbers."""
    for number, line in enumerate(read_text(path, "one trial per line in JSON").splitlines(), start=1):
        if line.strip():
            yield number, line


def _one_display(sessions: list[RampSession], dataset: Path) -> Display:
    """Return the display of all sessions, or refuse a data set of several."""
    first = sessions[0].manifest
    for session in sessions[1:]:
        other = session.manifest
        if other.display.fingerprint != first.display.fingerprint:
            raise InputError(
                f"{dataset}: session {other.session_id} of participant {other.participant_id} ran on the "
                f"display {other.display.name!r}, session {first.session_id} of participant "
                f"{first.participant_id} on {first.display.name!r} with other photometry; a rate limit holds "
                "for one display: fit them apart"
            )
    return first.display


def _all_or_none_simulated(sessions: list[RampSession], dataset: Path) -> bool:
    """Return whether the sessions are simulated, or refuse a mixture."""
    kinds = {session.manifest.simulated for session in sessions}
    if len(kinds) > 1:
        raise InputError(f"{dataset}: holds simulated and recorded ramp sessions; put them in two data sets")
    return kinds.pop()

"""Checking a data set: each of its files, and whether they agree with each other."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from evenlight.data_schema.dataset_layout import (
    DESCRIPTION,
    FRAMES,
    MANIFEST,
    PARTICIPANTS,
    SWEEPS,
    TRIALS,
    behaviour_file,
)
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.file_checks import CheckedFile, check_file
from evenlight.data_schema.mapping import keys_of, record_from_mapping, shown, type_hints
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.ramp import TrialFlag
from evenlight.data_schema.record_kind import RecordKind
from evenlight.data_schema.record_kinds import FRAMES_OF_TASK, SESSION_MANIFEST, TRIALS_OF_TASK
from evenlight.data_schema.session import SessionManifest, SessionStatus
from evenlight.data_schema.sweep_checks import check_sweep
from evenlight.data_schema.text_files import columns_of, csv_rows, plain_cell, read_json, read_text
from evenlight.data_schema.viewing import Version

SUBJECT = re.compile("sub-[0-9A-Za-z]+")
SESSION = re.compile("ses-[0-9A-Za-z]+")
PERSONAL = re.compile("name|birth|dob|mail|phone|address|initials", re.IGNORECASE)
ROUNDING = 1e-6  # relative, of a luminance


def is_dataset(folder: Path) -> bool:
    """Return whether a folder looks like a data set."""
    return any((folder / name).is_file() for name in (DESCRIPTION, PARTICIPANTS)) or any(
        folder.glob(f"sub-*/ses-*/{MANIFEST}")
    )


def check_dataset(dataset: Path) -> Iterator[CheckedFile]:
    """Yield every file of a data set that was checked, with the problems in it and with the others.

    The description comes first, then the sessions, the sweeps, and the list of participants.
    """
    yield _check_description(dataset)
    simulated: dict[str, bool] = {}
    for folder in _folders(dataset, SUBJECT):
        sessions = _folders(folder, SESSION)
        if not sessions:
            yield _blamed(folder, "participant", "holds no session folder (ses-*)")
        for session in sessions:
            for checked in check_session(dataset, session):
                if isinstance(checked.record, SessionManifest):
                    simulated[folder.name] = checked.record.simulated
                yield checked
    sweeps = sorted(path for path in (dataset / SWEEPS).glob("*") if path.is_dir())
    for sweep in sweeps:
        yield from check_sweep(sweep)
    columns = dataset / PARTICIPANTS
    if simulated or columns.exists() or not sweeps:  # nobody takes part in a sweep
        yield _check_participants(dataset, simulated)
        yield _check_column_descriptions(columns.with_suffix(".json"), ["participant_id"])


def _folders(parent: Path, pattern: re.Pattern[str]) -> list[Path]:
    """Return the folders of a name, in order."""
    return sorted(path for path in parent.iterdir() if path.is_dir() and pattern.fullmatch(path.name))


def _blamed(path: Path, words: str, problem: str) -> CheckedFile:
    """Return a file, or its place, with one problem."""
    checked = CheckedFile(path, words)
    checked.blame(problem)
    return checked


def check_session(dataset: Path, folder: Path) -> Iterator[CheckedFile]:
    """Yield the files of a session: its manifest, its trials, and their export as a table."""
    if not (folder / MANIFEST).is_file():
        yield _blamed(folder / MANIFEST, "session manifest", "no such file; every session has one")
        return
    checked = check_file(folder / MANIFEST, SESSION_MANIFEST)
    manifest = checked.record
    if manifest is not None:
        _compare_with_folders(checked, manifest, folder)
    trials = _check_trials(folder, manifest)
    yield checked
    yield trials
    if (folder / FRAMES).is_file():
        yield _check_frames(folder, trials, FRAMES_OF_TASK.get(manifest.task) if manifest else None)
    if isinstance(manifest, SessionManifest):
        yield from _check_export(dataset, manifest, trials)


def _compare_with_folders(checked: CheckedFile, manifest: SessionManifest, folder: Path) -> None:
    """Note where a manifest names another participant or session than its folders."""
    for key, got, right in (
        ("participant_id", manifest.participant_id, folder.parent.name.removeprefix("sub-")),
        ("session_id", manifest.session_id, folder.name.removeprefix("ses-")),
    ):
        if got != right:
            checked.blame(f"{key}: expected {right!r}, as in the folder's name, got {got!r}")


def _check_trials(folder: Path, manifest: SessionManifest | None) -> CheckedFile:
    """Return the trials of a session with their problems; unchecked those of a task without a record."""
    kind = TRIALS_OF_TASK.get(manifest.task) if manifest else None
    if kind is None:
        return CheckedFile(folder / TRIALS, "")
    if not (folder / TRIALS).is_file():
        checked = CheckedFile(folder / TRIALS, kind.words)
        if manifest and manifest.status is SessionStatus.COMPLETE and manifest.n_trials:
            checked.blame(f"no such file; the session is complete with {manifest.n_trials} trials")
        else:
            checked.notes.append(f"{checked.path}: no such file; the session has no trial yet")
        return checked
    checked = check_file(folder / TRIALS, kind)
    _find_repeated(checked)
    if manifest is not None:
        _compare_with_manifest(checked, manifest)
    return checked


def _check_frames(folder: Path, trials: CheckedFile, kind: RecordKind | None) -> CheckedFile:
    """Return the frame logs of a session: every trial that counts its frames has one for each interval."""
    if kind is None:
        return CheckedFile(folder / FRAMES, "")
    checked = check_file(folder / FRAMES, kind)
    logged = {(log.trial_index, log.attempt, log.interval) for _, log in checked.records}
    for line, trial in trials.records:
        if trial.n_frames is None:
            continue
        for interval in range(1, trial.intervals + 1):
            if (trial.trial_index, trial.attempt, interval) not in logged:
                checked.blame(
                    f"no frames of trial {trial.trial_index}, attempt {trial.attempt}, interval {interval}, "
                    f"which line {line} of {TRIALS} has"
                )
    return checked


def _find_repeated(checked: CheckedFile) -> None:
    """Note trials that are there twice."""
    first: dict[int, int] = {}
    for line, trial in checked.records:
        earlier = first.setdefault(trial.trial_index, line)
        if earlier != line:
            checked.blame(f"trial_index: {trial.trial_index} is there already, in line {earlier}", line)


def _compare_with_manifest(checked: CheckedFile, manifest: SessionManifest) -> None:
    """Note trials that are not of their session, and how many there are."""
    for line, trial in checked.records:
        for key in ("participant_id", "session_id", "simulated"):
            got, right = getattr(trial, key), getattr(manifest, key)
            if got != right:
                checked.blame(f"{key}: expected {right!r}, as in {MANIFEST}, got {got!r}", line)
        brightest = manifest.display.peak_luminance + manifest.display.reflected_luminance
        highest = _brightest_of(trial)
        if highest > brightest * (1 + ROUNDING):
            checked.blame(
                f"luminance: expected at most {brightest:g} cd/m^2, which the session's display reaches, "
                f"got {highest:g}",
                line,
            )
        _compare_with_stimuli(checked, line, trial, manifest)
    count, planned = sum(trial.usable for _, trial in checked.records), manifest.n_trials
    flagged = sum(trial.flag is not TrialFlag.NONE for _, trial in checked.records)
    if manifest.status is SessionStatus.COMPLETE and not planned - flagged <= count <= planned:
        checked.blame(f"expected {planned} usable trials, because the session is complete, got {count}")
    elif count > planned:
        checked.blame(f"expected at most {planned} trials, as in {MANIFEST}, got {count}")
    elif manifest.status is not SessionStatus.COMPLETE:
        checked.notes.append(
            f"{checked.path}: the session is {manifest.status.value}, with {count} of {planned} trials"
        )
    if flagged:
        checked.notes.append(f"{checked.path}: {flagged} trial(s) are flagged and left out of the analysis")


def _compare_with_stimuli(checked: CheckedFile, line: int, trial: Any, manifest: SessionManifest) -> None:
    """Note where a trial of a viewing experiment is not of the sequences that the manifest has."""
    sequence, stimuli = getattr(trial, "sequence", None), {each.name: each for each in manifest.stimuli}
    if sequence is None:
        return
    if sequence not in stimuli:
        checked.blame(
            f"sequence: expected one of {', '.join(stimuli)}, as in {MANIFEST}, got {sequence!r}", line
        )
        return
    stimulus, version = stimuli[sequence], getattr(trial, "version", Version.OURS)
    expected = {"baseline_factor": stimulus.baseline_factor}
    expected["mean_factor"] = stimulus.mean_factor if version is Version.OURS else stimulus.baseline_factor
    if version is Version.BASELINE:
        expected["factor"] = stimulus.baseline_factor
    for key, right in expected.items():
        got = getattr(trial, key, right)
        if abs(got - right) > ROUNDING:
            checked.blame(
                f"{key}: expected {right:g}, as {sequence!r} has it in {MANIFEST}, got {got:g}", line
            )


def _brightest_of(trial: Any) -> float:
    """Return the highest luminance that a trial names, 0 if it names none [cd/m^2]."""
    names = ("initial_luminance", "final_luminance", "background_luminance")
    return max(float(getattr(trial, name, 0.0)) for name in names)


def _check_export(dataset: Path, manifest: SessionManifest, trials: CheckedFile) -> Iterator[CheckedFile]:
    """Yield the exported table of a session and the description of its columns."""
    path = behaviour_file(dataset, manifest.participant_id, manifest.session_id, manifest.task)
    kind = TRIALS_OF_TASK.get(manifest.task)
    if kind is None:
        return
    if not path.is_file():
        if manifest.status is SessionStatus.COMPLETE and trials.records:
            yield _blamed(path, "exported trials", f"no such file; {TRIALS} is to be exported there")
        return
    yield _check_exported_rows(path, kind.record, trials)
    yield _check_column_descriptions(path.with_suffix(".json"), columns_of(kind.record))


def _check_exported_rows(path: Path, cls: type[Any], trials: CheckedFile) -> CheckedFile:
    """Return the exported table, compared with the trials that it was made from."""
    checked = check_table(path, cls)
    if checked.problems or trials.problems:
        return checked
    if len(checked.records) != len(trials.records):
        checked.blame(f"expected {len(trials.records)} rows, as {TRIALS}, got {len(checked.records)}")
    for (line, row), (other, trial) in zip(checked.records, trials.records, strict=False):
        if row != trial:
            keys = [key for key in row.__slots__ if getattr(row, key) != getattr(trial, key)]
            checked.blame(f"{', '.join(keys)}: not as in line {other} of {TRIALS}", line)
    return checked


def check_table(path: Path, cls: type[Any]) -> CheckedFile:
    """Return a table of records with tabs between its cells, as BIDS has them."""
    checked = CheckedFile(path, "exported trials")
    columns, names, kinds = columns_of(cls), list(keys_of(cls)[0].values()), type_hints(cls)
    note = checked.problems.append
    try:
        for line, cells in csv_rows(path, columns, "exported trials", "\t", lambda error: note(str(error))):
            where = f"{path}, line {line}"
            try:
                row = {
                    key: plain_cell(kinds[name], cell, f"{where}: {key}")
                    for key, name, cell in zip(columns, names, cells, strict=True)
                }
                checked.records.append((line, record_from_mapping(cls, row, where)))
            except InputError as error:
                note(str(error))
    except InputError as error:
        note(str(error))
    return checked


def _check_column_descriptions(path: Path, columns: list[str]) -> CheckedFile:
    """Return the file that describes the columns of an exported table."""
    checked = CheckedFile(path, "description of columns")
    try:
        content = read_json(path, "a description of columns")
    except InputError as error:
        checked.problems.append(str(error))
        return checked
    if not isinstance(content, dict):
        checked.blame(f"expected a table of columns and what they mean, got {shown(content)}")
        return checked
    for column in columns:
        if column not in content:
            checked.blame(f"the column {column!r} is not described")
    return checked


def _check_description(dataset: Path) -> CheckedFile:
    """Return the description of a data set, as BIDS asks for it."""
    path = dataset / DESCRIPTION
    checked = CheckedFile(path, "description of a data set")
    try:
        content = read_json(path, "the description of a data set")
        if not isinstance(content, dict):
            raise InputError(f"{path}: expected Name, BIDSVersion and more, got {shown(content)}")
        for key in ("Name", "BIDSVersion"):
            if not isinstance(content.get(key), str) or not content[key]:
                checked.blame(f"{key}: expected text, got {shown(content.get(key))}")
        if "provenance" in content:
            record_from_mapping(Provenance, content["provenance"], f"{path}: provenance")
    except InputError as error:
        checked.problems.append(str(error))
    return checked


def _check_participants(dataset: Path, simulated: dict[str, bool]) -> CheckedFile:
    """Return the list of participants, compared with the folders and their manifests."""
    path = dataset / PARTICIPANTS
    checked = CheckedFile(path, "list of participants")
    try:
        rows = list(_participant_rows(checked))
    except InputError as error:
        checked.problems.append(str(error))
        return checked
    listed: dict[str, int] = {}
    for line, row in rows:
        name = row["participant_id"]
        if not SUBJECT.fullmatch(name):
            checked.blame(f"participant_id: expected sub- and letters or digits, got {shown(name)}", line)
        elif listed.setdefault(name, line) != line:
            checked.blame(f"participant_id: {name!r} is there already, in line {listed[name]}", line)
        said, true = row.get("simulated"), simulated.get(name)
        if said is not None and true is not None and said != str(true).lower():
            checked.blame(f"simulated: expected {str(true).lower()!r}, as in {MANIFEST}, got {said!r}", line)
    _compare_names(checked, listed, [folder.name for folder in _folders(dataset, SUBJECT)])
    return checked


def _participant_rows(checked: CheckedFile) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield the rows of the list of participants; BIDS leaves all columns but the first to its writer."""
    lines = read_text(checked.path, "the list of participants").split("\n")
    header = lines[0].split("\t")
    for column in personal_columns(header):
        checked.blame(f"column {column!r}: expected no personal data; take the column out", 1)
    if header[0] != "participant_id":
        raise InputError(
            f"{checked.path}, line 1: expected the first column participant_id, got {shown(header[0])}"
        )
    for number, line in enumerate(lines[1:], start=2):
        cells = line.split("\t")
        if not line:
            continue
        if len(cells) != len(header):
            checked.blame(f"expected {len(header)} cells, got {len(cells)}", number)
        yield number, dict(zip(header, cells, strict=False))


def personal_columns(header: Iterable[str]) -> list[str]:
    """Return the columns of a table that by their names hold what tells who somebody is.

    >>> personal_columns(["participant_id", "full_name", "age_band", "birthday"])
    ['full_name', 'birthday']
    """
    return [column for column in header if PERSONAL.search(column)]


def _compare_names(checked: CheckedFile, listed: dict[str, int], folders: Iterable[str]) -> None:
    """Note participants that have a folder and no row; a row without a folder is one of a roster."""
    folders = list(folders)
    for name in folders:
        if name not in listed:
            checked.blame(f"{name!r} has a folder and is not listed")
    for name, line in listed.items():
        if name not in folders:
            checked.notes.append(f"{checked.path}, line {line}: {name!r} is listed and has no session yet")

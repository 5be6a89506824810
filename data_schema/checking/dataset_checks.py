"""Checking a data set: each of its files, and whether they agree with each other."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from evenlight.data_schema.checking.file_checks import CheckedFile
from evenlight.data_schema.checking.session_checks import (
    check_column_descriptions,
    check_session,
    check_sweep,
)
from evenlight.data_schema.errors import InputError, shown
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_layout import (
    DESCRIPTION,
    MANIFEST,
    PARTICIPANTS,
    SWEEPS,
    TRIALS,
)
from evenlight.data_schema.recordings.display_calibrations import (
    calibrations_in_words,
    ramp_sessions,
    why_apart,
)
from evenlight.data_schema.recordings.roll_call import (
    SESSION,
    SUBJECT,
    RollCall,
    SessionUse,
    call_roll,
    folders_named,
    leads_out,
)
from evenlight.data_schema.recordings.session import TASKS, SessionManifest
from evenlight.data_schema.storage.text_files import read_json, read_text

PERSONAL = re.compile("name|birth|dob|mail|phone|address|initials", re.IGNORECASE)


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
    for folder in folders_named(dataset, SUBJECT):
        sessions = folders_named(folder, SESSION)
        if not sessions:
            yield CheckedFile.blamed(folder, "participant", "holds no session folder (ses-*)")
        for session in sessions:
            for checked in check_session(dataset, session):
                if isinstance(checked.record, SessionManifest):
                    simulated[folder.name] = checked.record.simulated
                yield checked
    roll = call_roll(dataset)
    yield from _check_roll(dataset, roll)
    yield from _check_displays(dataset, roll)
    sweeps = sorted(path for path in (dataset / SWEEPS).glob("*") if path.is_dir())
    for sweep in sweeps:
        yield from check_sweep(sweep)
    columns = dataset / PARTICIPANTS
    if simulated or columns.exists() or not sweeps:  # a sweep has no participants
        yield _check_participants(dataset, simulated)
        yield check_column_descriptions(columns.with_suffix(".json"), ["participant_id"])


def _check_roll(dataset: Path, roll: RollCall) -> Iterator[CheckedFile]:
    for entry in roll.sessions:
        folder = dataset / entry.folder
        if entry.use is SessionUse.WRONG:
            yield CheckedFile.blamed(folder, "session", entry.why)
        elif entry.task not in (None, *TASKS):
            yield CheckedFile(folder, "session", notes=[f"{folder}: it is left out: {entry.why}"])
        elif leads_out(folder / TRIALS, dataset):
            yield CheckedFile(folder, "session", notes=[f"{folder}: it is a link out of the data set"])


def _check_displays(dataset: Path, roll: RollCall) -> Iterator[CheckedFile]:
    sessions = ramp_sessions(dataset, roll)
    if why := why_apart(sessions):
        yield CheckedFile.blamed(dataset, "displays of ramp sessions", why)
    elif said := calibrations_in_words(sessions):
        yield CheckedFile(dataset, "displays of ramp sessions", notes=[f"{dataset}: {said}"])


def _check_description(dataset: Path) -> CheckedFile:
    path = dataset / DESCRIPTION
    checked = CheckedFile(path, "description of a data set")
    try:
        content = read_json(path, "the description of a data set")
        if not isinstance(content, dict):
            raise InputError(f"{path}: expected Name, BIDSVersion and more, got {shown(content)}")
        for key in ("name", "description") if "@context" in content else ("Name", "BIDSVersion"):
            if not isinstance(content.get(key), str) or not content[key]:
                checked.blame(f"{key}: expected text, got {shown(content.get(key))}")
        if "provenance" in content:
            record_from_mapping(Provenance, content["provenance"], f"{path}: provenance")
    except InputError as error:
        checked.problems.append(str(error))
    return checked


def _check_participants(dataset: Path, simulated: dict[str, bool]) -> CheckedFile:
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
        listed_as, true = row.get("simulated"), simulated.get(name)
        if listed_as is not None and true is not None and listed_as != str(true).lower():
            checked.blame(
                f"simulated: expected {str(true).lower()!r}, as in {MANIFEST}, got {listed_as!r}", line
            )
    _compare_names(checked, listed, [folder.name for folder in folders_named(dataset, SUBJECT)])
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
    """Return the columns of a table whose names suggest personal data.

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

"""Writing a data set: a BIDS-like folder of sessions, each with its manifest, trials and exported table."""

from __future__ import annotations

import dataclasses
import enum
import json
import re
import typing
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.recordings.dataset_layout import (
    DATASET_LOCK,
    DESCRIPTION,
    MANIFEST,
    NOT_OF_BIDS,
    PARTICIPANTS,
    PREREGISTRATIONS,
    STUDY,
    SWEEPS,
    TRIALS,
    behaviour_file,
    session_folder,
)
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.data_schema.storage.append_log import record_line
from evenlight.data_schema.storage.result_folders import new_folder
from evenlight.data_schema.storage.tables import safe_cell
from evenlight.data_schema.storage.text_files import read_json, read_text, write_json, write_json_record
from evenlight.data_schema.storage.whole_files import LOCKED, PARTIAL, held_lock, make_folder, write_whole

BIDS_VERSION = "1.10.0"
MISSING = "n/a"  # BIDS: how a table says that there is no value
LONGEST_WAIT = 30.0  # [s] for another session to put its participant on the list
PARTICIPANT_COLUMNS = {
    "participant_id": {"Description": "participant"},
    "simulated": {
        "Description": "whether a simulated observer answered",
        "Levels": {"true": "simulated", "false": "a person"},
    },
}
README = Path(__file__).with_name("dataset_readme.txt")


@contextmanager
def new_dataset(dataset: Path) -> Iterator[Path]:
    """Yield a folder to write a new data set into; it appears whole, under its own name, when the block ends.

    Raises
    ------
    InputError
        If there is something at that place already: data are never overwritten.
    """
    there = f"{dataset}: is there already and data are never overwritten; give a new folder as `out`"
    with new_folder(dataset, there) as fresh:
        yield fresh


def enrol(dataset: Path, participant_id: str, simulated: bool, provenance: Provenance) -> int:
    """Put a participant on a data set's list, which is made if there is none, and return the place on it.

    A list that names participants without a session is a roster: no one else is put on it.

    Raises
    ------
    InputError
        If the data set holds the other kind of participants, recorded or simulated, or a roster without this
        one; if it cannot be written.
    """
    with _data_set(dataset, simulated, provenance):
        header, rows = _participant_table(dataset)
        listed = [row[0] for row in rows]
        name = f"sub-{participant_id}"
        if name in listed:
            return listed.index(name)
        _refuse_likely_slip(name, listed, dataset)
        waiting = [other for other in listed if not (dataset / other).is_dir()]
        if waiting:
            raise InputError(
                f"participant {participant_id!r} is not on the list {dataset / PARTICIPANTS}; waiting for a "
                f"session are {', '.join(waiting[:8])}; give one of these, or put {name} on the list"
            )
        values = {"participant_id": name, "simulated": _cell(simulated)}
        _write_participant_table(dataset, header, [*rows, [values.get(column, MISSING) for column in header]])
        return len(rows)


def require_dataset(dataset: Path, simulated: bool, provenance: Provenance) -> None:
    """Make a folder a data set that may hold sweeps, if it is none yet.

    Raises
    ------
    InputError
        If it holds the other kind of data, recorded or simulated, or other things; if it cannot be written.
    """
    with _data_set(dataset, simulated, provenance):
        ignored = dataset / ".bidsignore"
        lines = read_text(ignored, "what BIDS is to ignore").splitlines() if ignored.exists() else []
        if SWEEPS not in lines:  # a data set of before there were sweeps
            write_whole(ignored, "".join(f"{line}\n" for line in (*lines, SWEEPS)))


@contextmanager
def _data_set(dataset: Path, simulated: bool, provenance: Provenance) -> Iterator[None]:
    make_folder(dataset, 0o700)  # what people answered is for its owner to share
    busy = f"{dataset}: another program has been writing it for {LONGEST_WAIT:g} s; try again when it ends"
    lock = held_lock(dataset / DATASET_LOCK, busy, LONGEST_WAIT)
    try:
        if not (dataset / DESCRIPTION).exists():
            begun = (DATASET_LOCK, PARTIAL.format(DESCRIPTION), LOCKED.format(DESCRIPTION))
            planned = (STUDY, *(path.name for path in dataset.glob(PREREGISTRATIONS)))
            if any(path.name not in begun + planned for path in dataset.iterdir()):
                raise InputError(
                    f"{dataset}: holds other things than a data set; give a new or empty folder as `out`"
                )
        write_description(dataset, "Evenlight sessions", simulated, provenance)
        if (dataset / PARTICIPANTS).exists():
            _describe_participants(dataset)
        _refuse_other_kind(dataset, simulated)
        yield
    finally:
        lock.release()


def _refuse_likely_slip(name: str, listed: list[str], dataset: Path) -> None:
    """Refuse a new participant who differs from one on the list in zeros or capitals only."""
    twin = next((other for other in listed if _without_zeros(other) == _without_zeros(name)), None)
    if twin is not None:
        raise InputError(
            f"participant {name.removeprefix('sub-')!r} is new in {dataset}, and "
            f"{twin.removeprefix('sub-')!r} is there: give that, or one that differs in more than zeros or "
            "capitals"
        )


def _without_zeros(name: str) -> str:
    return name.removeprefix("sub-").lower().lstrip("0")


def _refuse_other_kind(dataset: Path, simulated: bool) -> None:
    """Refuse to mix recorded and simulated sessions: nothing could be fitted to the mixture."""
    there = bool(read_json(dataset / DESCRIPTION, "the description of a data set").get("Simulated"))
    if there != simulated:
        kinds = {True: "simulated", False: "recorded"}
        raise InputError(
            f"{dataset}: holds {kinds[there]} sessions, this one is {kinds[simulated]}; "
            "keep them in two data sets, and give another folder as `out`"
        )


def _participant_table(dataset: Path) -> tuple[list[str], list[list[str]]]:
    path = dataset / PARTICIPANTS
    if not path.exists():
        there = [folder.name for folder in sorted(dataset.glob("sub-*"))]
        if there:
            raise InputError(
                f"{path}: no such file, though there is {there[0]}; restore the list, it holds the order of "
                "the participants"
            )
        return list(PARTICIPANT_COLUMNS), []
    lines = [line.split("\t") for line in read_text(path, "the list of participants").splitlines() if line]
    if not lines or lines[0][0] != "participant_id":
        raise InputError(f"{path}, line 1: expected the first column participant_id")
    for number, row in enumerate(lines[1:], start=2):
        if not re.fullmatch("sub-[0-9A-Za-z]+", row[0]):
            raise InputError(
                f"{path}, line {number}: expected a participant such as sub-{number - 1:02d}, got {row[0]!r}"
            )
    return lines[0], lines[1:]


def _write_participant_table(dataset: Path, header: list[str], rows: list[list[str]]) -> None:
    """Write the list of participants, and what its columns mean where nothing says it yet."""
    write_whole(dataset / PARTICIPANTS, _tsv(header, rows))
    _describe_participants(dataset)


def _describe_participants(dataset: Path) -> None:
    text = f"{json.dumps(PARTICIPANT_COLUMNS, indent=2)}\n"
    _write_missing((dataset / PARTICIPANTS).with_suffix(".json"), text)


def write_description(
    dataset: Path, name: str, simulated: bool, provenance: Provenance, origin: str = "recorded with Evenlight"
) -> None:
    """Write `dataset_description.json`: what the data set is, and whether anybody took part in it.

    The README says the same in words, with the `origin` of the sessions. What is there stays.
    """
    description = {
        "Name": f"{name} (simulated: no person took part)" if simulated else name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "Simulated": simulated,
        "GeneratedBy": [{"Name": "Evenlight", "Version": provenance.software_version}],
        "provenance": mapping_from_record(provenance),
    }
    kind = "SIMULATED: no person took part" if simulated else "people"
    _write_missing(dataset / DESCRIPTION, f"{json.dumps(description, indent=2, ensure_ascii=False)}\n")
    _write_missing(dataset / "README", README.read_text(encoding="utf-8").format(kind=kind, origin=origin))
    _write_missing(dataset / ".bidsignore", "".join(f"{name}\n" for name in NOT_OF_BIDS))


def _write_missing(path: Path, text: str) -> None:
    """Write a file that is not there: what killed a session may have come between it and the one before."""
    if not path.exists():
        write_whole(path, text)


def write_participants(dataset: Path, participant_ids: Iterable[str], simulated: bool) -> None:
    """Write `participants.tsv` and the description of its columns."""
    rows = [[f"sub-{participant}", _cell(simulated)] for participant in participant_ids]
    _write_participant_table(dataset, list(PARTICIPANT_COLUMNS), rows)


def write_session(dataset: Path, manifest: SessionManifest, trials: Iterable[Any]) -> None:
    """Write one session: its manifest, its trials line by line, and their export as a BIDS table."""
    trials = list(trials)
    folder = session_folder(dataset, manifest.participant_id, manifest.session_id)
    write_json_record(folder / MANIFEST, manifest)
    write_whole(folder / TRIALS, "".join(record_line(trial) for trial in trials))
    export_behaviour(dataset, manifest, trials)


def export_behaviour(dataset: Path, manifest: SessionManifest, trials: list[Any]) -> None:
    """Write a session's trials as a BIDS table, with a description of every column beside it."""
    if not trials:
        return
    path = behaviour_file(dataset, manifest.participant_id, manifest.session_id, manifest.task)
    cls = type(trials[0])
    columns = [file_key(field) for field in dataclasses.fields(cls)]
    rows = [[_cell(value) for value in mapping_from_record(trial).values()] for trial in trials]
    write_whole(path, _tsv(columns, rows))
    described = column_descriptions(cls, manifest.task)
    if manifest.source and manifest.source.scale:
        described["rating"] |= {"Minimum": manifest.scale.lowest, "Maximum": manifest.scale.highest}
    write_json(path.with_suffix(".json"), described)


def column_descriptions(cls: type[Any], task: str) -> dict[str, Any]:
    """Return the BIDS description of the columns that a trial record makes: meaning, unit and levels."""
    kinds = typing.get_type_hints(cls)
    sidecar: dict[str, Any] = {"TaskName": task}
    for field in dataclasses.fields(cls):
        entry: dict[str, Any] = {"Description": field.metadata["doc"]}
        unit = field.metadata.get("unit")
        if unit and unit != "1":
            entry["Units"] = unit
        kind = kinds[field.name]
        if kind is bool:
            entry["Levels"] = {"true": "yes", "false": "no"}
        elif isinstance(kind, type) and issubclass(kind, enum.Enum):
            entry["Levels"] = {member.value: member.name.lower() for member in kind}
        sidecar[file_key(field)] = entry
    return sidecar


def _tsv(columns: list[str], rows: Iterable[list[str]]) -> str:
    return "".join("\t".join(map(safe_cell, cells)) + "\n" for cells in [columns, *rows])


def _cell(value: object) -> str:
    if value is None:
        return MISSING
    return str(value).lower() if isinstance(value, bool) else str(value)

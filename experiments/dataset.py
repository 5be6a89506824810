"""Writing a data set: a BIDS-like folder of sessions, each with its manifest, trials and exported table."""

from __future__ import annotations

import dataclasses
import enum
import json
import typing
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from data_schema.dataset_layout import (
    DESCRIPTION,
    MANIFEST,
    PARTICIPANTS,
    SIMULATED_TRUTH,
    TRIALS,
    behaviour_file,
    session_folder,
)
from data_schema.errors import InputError
from data_schema.files import results_folder, write_whole
from data_schema.mapping import mapping_from_record
from data_schema.provenance import Provenance
from data_schema.quantities import file_key
from data_schema.session import SessionManifest
from data_schema.text_files import write_json, write_json_record

BIDS_VERSION = "1.10.0"
MISSING = "n/a"  # BIDS: how a table says that there is no value


@contextmanager
def new_dataset(dataset: Path) -> Iterator[Path]:
    """Yield a folder to write a new data set into; it appears whole, under its own name, when the block ends.

    Raises
    ------
    InputError
        If there is something at that place already: data are never overwritten.
    """
    if dataset.exists() and (not dataset.is_dir() or any(dataset.iterdir())):
        raise InputError(
            f"{dataset}: is there already and data are never overwritten; give a new folder with --out"
        )
    with results_folder(dataset) as staging:
        yield staging


def write_description(dataset: Path, name: str, simulated: bool, provenance: Provenance) -> None:
    """Write `dataset_description.json`: what the data set is, and whether anybody took part in it."""
    write_json(
        dataset / DESCRIPTION,
        {
            "Name": f"{name} (simulated: no person took part)" if simulated else name,
            "BIDSVersion": BIDS_VERSION,
            "DatasetType": "raw",
            "Simulated": simulated,
            "GeneratedBy": [{"Name": "Evenlight", "Version": provenance.software_version}],
            "provenance": mapping_from_record(provenance),
        },
    )
    own_files = (f"**/{MANIFEST}", f"**/{TRIALS}", SIMULATED_TRUTH)
    write_whole(dataset / ".bidsignore", "".join(f"{name}\n" for name in own_files))


def write_participants(dataset: Path, participant_ids: Iterable[str], simulated: bool) -> None:
    """Write `participants.tsv` and the description of its columns."""
    rows = [[f"sub-{participant}", _cell(simulated)] for participant in participant_ids]
    path = dataset / PARTICIPANTS
    write_whole(path, _tsv(["participant_id", "simulated"], rows))
    write_json(
        path.with_suffix(".json"),
        {
            "participant_id": {"Description": "participant"},
            "simulated": {
                "Description": "whether a simulated observer answered",
                "Levels": {"true": "simulated", "false": "a person"},
            },
        },
    )


def write_session(dataset: Path, manifest: SessionManifest, trials: Iterable[Any]) -> None:
    """Write one session: its manifest, its trials line by line, and their export as a BIDS table."""
    trials = list(trials)
    folder = session_folder(dataset, manifest.participant_id, manifest.session_id)
    write_json_record(folder / MANIFEST, manifest)
    write_whole(folder / TRIALS, "".join(trial_line(trial) for trial in trials))
    export_behaviour(dataset, manifest, trials)


def trial_line(trial: Any) -> str:
    """Return a trial as one line of `trials.jsonl`, its end included."""
    return json.dumps(mapping_from_record(trial), allow_nan=False) + "\n"


def export_behaviour(dataset: Path, manifest: SessionManifest, trials: list[Any]) -> None:
    """Write a session's trials as a BIDS table, with a description of every column beside it."""
    path = behaviour_file(dataset, manifest.participant_id, manifest.session_id, manifest.task)
    cls = type(trials[0]) if trials else None
    if cls is None:
        return
    columns = [file_key(field) for field in dataclasses.fields(cls)]
    rows = [[_cell(value) for value in mapping_from_record(trial).values()] for trial in trials]
    write_whole(path, _tsv(columns, rows))
    write_json(path.with_suffix(".json"), column_descriptions(cls, manifest.task))


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
    """Return a table with tabs between its cells."""
    return "".join("\t".join(cells) + "\n" for cells in [columns, *rows])


def _cell(value: object) -> str:
    """Return a value as a cell of a BIDS table."""
    if value is None:
        return MISSING
    return str(value).lower() if isinstance(value, bool) else str(value)

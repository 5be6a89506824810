"""Psych-DS: a data set as other laboratories' tools look for it.

Written from the specification, schema 1.5.0: a `dataset_description.json` of schema.org's
vocabulary with every column under `variableMeasured`, and tables named by key and value, ending in
`_data.csv`, in the folder `data/`. Files that it does not define are allowed beside `data/`, and stand in
`.psychds-ignore`: there lie the sessions, as Evenlight reads them.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evenlight.data_schema.export.bids import IGNORED, README, copy_files, exported_files, tables_in
from evenlight.data_schema.export.shared_tables import shared_descriptions, shared_table
from evenlight.data_schema.recordings.dataset_layout import DESCRIPTION, PARTICIPANTS, SIMULATED_TRUTH, SWEEPS
from evenlight.data_schema.recordings.dataset_writing import MISSING
from evenlight.data_schema.storage.tables import csv_text
from evenlight.data_schema.storage.text_files import read_json, read_text, write_json
from evenlight.data_schema.storage.whole_files import results_folder, write_whole

PARTICIPANT_TABLE = "group-participants_data.csv"
NOT_DEFINED = ("sub-*", SWEEPS, PARTICIPANTS, str(Path(PARTICIPANTS).with_suffix(".json")), SIMULATED_TRUTH)
ABOUT_DATA = """
`data` holds the same tables in the layout of Psych-DS.
"""


def export_psych_ds(dataset: Path, folder: Path) -> int:
    """Write a data set in the layout of Psych-DS, and return how many tables it has.

    Parameters
    ----------
    dataset : Path
        Data set with exported tables (`sub-*/ses-*/beh/*_beh.tsv`).
    folder : Path
        Where to; it must not hold anything.

    Raises
    ------
    InputError
        As of `exported_files`.
    """
    files = exported_files(dataset, folder)
    tables = {psych_ds_name(table.name): table for table in tables_in(files)}
    tables[PARTICIPANT_TABLE] = dataset / PARTICIPANTS
    description = read_json(dataset / DESCRIPTION, "the description of a data set")
    others = {dataset / name for name in (DESCRIPTION, README, IGNORED)}
    variables: dict[str, dict[str, Any]] = {}
    with results_folder(folder) as staging:
        copy_files([path for path in files if path not in others], dataset, staging)
        for name, table in tables.items():
            header, *rows = shared_table(table)
            write_whole(staging / "data" / name, csv_text(header, rows))
            variables |= _variables(header, table.with_suffix(".json"))
        write_json(staging / DESCRIPTION, _description(description, variables.values()))
        if dataset / README in files:
            about = read_text(dataset / README, "what the data set is")
            write_whole(staging / f"{README}.md", about + ABOUT_DATA)
        write_whole(staging / ".psychds-ignore", "".join(f"{pattern}\n" for pattern in NOT_DEFINED))
    return len(tables_in(files))


def psych_ds_name(bids_name: str) -> str:
    """Return the name of a table in Psych-DS, whose keys are written out.

    >>> psych_ds_name("sub-01_ses-02_task-ramp_beh.tsv")
    'subject-01_session-02_task-ramp_data.csv'
    """
    name = bids_name.replace("sub-", "subject-", 1).replace("_ses-", "_session-", 1)
    return name.replace("_beh.tsv", "_data.csv")


def _variables(columns: Iterable[str], sidecar: Path) -> dict[str, dict[str, Any]]:
    """Return the columns of a table as PropertyValue of schema.org, by their BIDS description."""
    content = shared_descriptions(sidecar)
    return {name: _variable(name, content.get(name, {})) for name in columns}


def _variable(name: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Return one column as a PropertyValue."""
    found: dict[str, Any] = {
        "@type": "PropertyValue",
        "name": name,
        "description": entry.get("Description", name),
    }
    if "Units" in entry:
        found["unitText"] = entry["Units"]
    if "Levels" in entry:
        found["value"] = "; ".join(f"{level}: {meaning}" for level, meaning in entry["Levels"].items())
    return found


def _description(bids: dict[str, Any], variables: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return the description of the data set."""
    simulated = bool(bids.get("Simulated"))
    who = "Simulated participants: no person took part." if simulated else "Recorded with participants."
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "schemaVersion": "Psych-DS 1.5.0",
        "name": bids.get("Name", "Evenlight sessions"),
        "description": f"Sessions on temporal brightness management, one row per trial. {who}",
        "variableMeasured": list(variables),
        "keywords": ["psychophysics", "luminance", "brightness", "temporal brightness management"],
        "missingValueCodes": [MISSING],
    }

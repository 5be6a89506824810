"""Psych-DS: a data set as other laboratories' tools look for it.

Written from the specification, schema 1.5.0: a `dataset_description.json` of schema.org's
vocabulary with every column under `variableMeasured`, and tables named by key and value, ending in
`_data.csv`, in the folder `data/`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evenlight.data_schema.export.bids import exported_tables, refuse_personal_data, refuse_used_folder
from evenlight.data_schema.recordings.dataset_layout import DESCRIPTION, PARTICIPANTS
from evenlight.data_schema.storage.tables import csv_text
from evenlight.data_schema.storage.text_files import read_json, read_text, write_json
from evenlight.data_schema.storage.whole_files import results_folder, write_whole

MISSING_CODES = ("n/a",)


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
        If there is no table to export, or the folder holds something.
    """
    tables = exported_tables(dataset)
    refuse_personal_data(dataset)
    refuse_used_folder(folder)
    description = read_json(dataset / DESCRIPTION, "the description of a data set")
    variables: dict[str, dict[str, Any]] = {}
    with results_folder(folder) as staging:
        for table in tables:
            _write_table(table, staging / "data" / psych_ds_name(table.name))
            variables |= _variables(table.with_suffix(".json"))
        participants = dataset / PARTICIPANTS
        if participants.exists():
            _write_table(participants, staging / "data" / "group-participants_data.csv")
            variables |= _variables(participants.with_suffix(".json"))
        write_json(staging / DESCRIPTION, _description(description, variables.values()))
        write_whole(staging / "README.md", read_text(dataset / "README", "what the data set is"))
    return len(tables)


def psych_ds_name(bids_name: str) -> str:
    """Return the name of a table in Psych-DS, whose keys are written out.

    >>> psych_ds_name("sub-01_ses-02_task-ramp_beh.tsv")
    'subject-01_session-02_task-ramp_data.csv'
    """
    name = bids_name.replace("sub-", "subject-", 1).replace("_ses-", "_session-", 1)
    return name.replace("_beh.tsv", "_data.csv")


def _write_table(source: Path, target: Path) -> None:
    """Write a table with tabs as one with commas."""
    lines = [line.split("\t") for line in read_text(source, "an exported table").split("\n") if line]
    write_whole(target, csv_text(lines[0], lines[1:]))


def _variables(sidecar: Path) -> dict[str, dict[str, Any]]:
    """Return the columns that a BIDS description names, as PropertyValue of schema.org."""
    content = read_json(sidecar, "a description of columns")
    columns = {name: entry for name, entry in content.items() if isinstance(entry, dict)}
    return {name: _variable(name, entry) for name, entry in columns.items()}


def _variable(name: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Return one column as a PropertyValue."""
    found: dict[str, Any] = {"@type": "PropertyValue", "name": name, "description": entry["Description"]}
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
        "missingValueCodes": list(MISSING_CODES),
    }

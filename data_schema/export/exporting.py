"""A data set for others, in the layouts of BIDS and Psych-DS, whole and checked: it can be read back.

Tables are shared with one name per participant in all of them, so that they join, and without empty cells; in
a data set itself a table of trials has `01` and empty cells, as the trials do, and the list of participants
`sub-01`.

Psych-DS is written from its specification, schema 1.5.0: a `dataset_description.json` of schema.org's
vocabulary with every column under `variableMeasured`, and tables named by key and value, ending in
`_data.csv`, in the folder `data/`. Files that it does not define are allowed beside `data/`, and stand in
`.psychds-ignore`: there lie the sessions, as Evenlight reads them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from evenlight.data_schema.checking.dataset_checks import personal_columns
from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.recordings.dataset_layout import (
    BEHAVIOUR_FOLDER,
    DESCRIPTION,
    EVENTS,
    FRAMES,
    HEADSET,
    MANIFEST,
    NOT_OF_BIDS,
    PARTICIPANTS,
    PREREGISTRATIONS,
    READINGS,
    SIMULATED_TRUTH,
    STUDY,
    SWEEP_MANIFEST,
    SWEEPS,
    TRIALS,
    require_apart,
)
from evenlight.data_schema.recordings.dataset_writing import MISSING
from evenlight.data_schema.recordings.roll_call import call_roll, leads_out
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.study import spdx_name, study_of
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.result_folders import new_folder
from evenlight.data_schema.storage.tables import cell_words, csv_text
from evenlight.data_schema.storage.text_files import read_json, read_text, write_json
from evenlight.data_schema.storage.whole_files import write_whole


def shared_table(path: Path) -> list[list[str]]:
    """Return the lines of a table from its header on, with `sub-01` for `01` and `n/a` for an empty cell.

    Parameters
    ----------
    path : Path
        A table with tabs: of trials or of participants.

    Raises
    ------
    InputError
        If it cannot be read, or a line has not as many cells as the first.
    """
    header, *rows = [line.split("\t") for line in read_text(path, "a table").rstrip("\n").split("\n")]
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise InputError(f"{path}, line {number}: expected {len(header)} cells, got {len(row)}")
        for place, (name, cell) in enumerate(zip(header, row, strict=True)):
            shared = f"sub-{cell.removeprefix('sub-')}" if name == "participant_id" else cell
            row[place] = shared if shared.strip() else MISSING
    return [header, *rows]


def shared_descriptions(path: Path) -> dict[str, Any]:
    """Return the descriptions of a table's columns; a level that was an empty cell is `n/a`."""
    content: dict[str, Any] = read_json(path, "a description of columns")
    for entry in content.values() if isinstance(content, dict) else ():
        if isinstance(entry, dict) and isinstance(entry.get("Levels"), dict):
            entry["Levels"] = {level or MISSING: words for level, words in entry["Levels"].items()}
    return content


IGNORED = ".bidsignore"
THERE = "{}: is there already; give a new folder"
README = "README"
# All that Evenlight or BIDS reads in a data set; what else lies there stays there.
EXPORTED = (
    DESCRIPTION,
    README,
    IGNORED,
    PARTICIPANTS,
    str(Path(PARTICIPANTS).with_suffix(".json")),
    SIMULATED_TRUTH,
    PREREGISTRATIONS,
    *(f"sub-*/ses-*/{name}" for name in (MANIFEST, TRIALS, FRAMES, HEADSET, EVENTS)),
    *(f"sub-*/ses-*/{BEHAVIOUR_FOLDER}/*_beh.{end}" for end in ("tsv", "json")),
    *(f"{SWEEPS}/*/{name}" for name in (SWEEP_MANIFEST, READINGS, EVENTS)),
)


def export_bids(dataset: Path, folder: Path) -> int:
    """Copy what BIDS defines of a data set and what Evenlight reads, and return how many tables there are.

    What BIDS does not define stands in `.bidsignore`.

    Parameters
    ----------
    dataset : Path
        Data set of sessions.
    folder : Path
        Where to; it must not hold anything.

    Raises
    ------
    InputError
        As of `exported_files`.
    """
    files = exported_files(dataset, folder)
    ignored = dataset / IGNORED
    lines = read_text(ignored, "what BIDS is to ignore").split("\n") if ignored in files else []
    with new_folder(folder, THERE.format(folder)) as staging:
        copy_files(files, dataset, staging)
        write_json(staging / DESCRIPTION, description_of(dataset))
        patterns = dict.fromkeys((*filter(None, lines), *NOT_OF_BIDS))
        write_whole(staging / IGNORED, "".join(f"{pattern}\n" for pattern in patterns))
    return len(tables_in(files))


STUDY_KEYS = {"authors": "Authors", "licence": "License", "ethics": "EthicsApprovals"}  # names of BIDS


def description_of(dataset: Path) -> dict[str, Any]:
    """Return the description of a data set, with authors, licence and ethics as its `study.toml` has them."""
    told = mapping_from_record(study_of(dataset))
    told["licence"] = spdx_name(told["licence"]) or told["licence"]
    description: dict[str, Any] = read_json(dataset / DESCRIPTION, "the description of a data set")
    return description | {STUDY_KEYS[key]: value for key, value in told.items() if value}


def notes_on_study(dataset: Path) -> Iterator[str]:
    """Yield what is to be said of authors, licence and ethics: what is blank, a licence that SPDX lacks."""
    description, file = description_of(dataset), dataset / STUDY
    if blanks := [key for key, name in STUDY_KEYS.items() if not description.get(name)]:
        how = "fill it in" if file.exists() else f"`evenlight new study {dataset}` writes it, to fill in"
        yield f"{file}: says no {' and no '.join(blanks)}, so the export has none; {how}"
    licence = description.get("License", "")
    if licence and not spdx_name(licence):
        yield f"{file}: SPDX knows no licence {licence!r}; it is told as given"


def exported_files(dataset: Path, folder: Path) -> list[Path]:
    """Return the files of a data set that are exported, after a check of all that it holds.

    Sessions that the participant declined are not.

    Raises
    ------
    InputError
        If there is no table of trials, `evenlight validate` finds a problem, a column looks like personal
        data, a file is a link out of the data set, or the folder to write holds something.
    """
    paths = {path for pattern in EXPORTED for path in dataset.glob(pattern)}
    files = sorted(path for path in paths if path.is_file() or path.is_symlink())
    if not tables_in(files):
        raise InputError(
            f"{dataset}: no table to export (sub-*/ses-*/{BEHAVIOUR_FOLDER}/*_beh.tsv); "
            "an interrupted session gets its table when it is resumed or complete"
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(THERE.format(folder))
    require_apart(folder, dataset)
    for path in files:
        if leads_out(path, dataset):
            raise InputError(
                f"{path}: leads out of the data set, to {path.resolve()}; put the file itself there, or take "
                "the link away"
            )
    _refuse_personal_data(dataset)
    _refuse_problems(dataset)
    declined = SessionStatus.DECLINED.value  # nobody agreed to anything being shared
    left = {dataset / entry.folder for entry in call_roll(dataset).sessions if entry.status == declined}
    return [path for path in files if left.isdisjoint(path.parents)]


def tables_in(files: list[Path]) -> list[Path]:
    """Return the tables of trials among some files."""
    return [path for path in files if path.match(f"{BEHAVIOUR_FOLDER}/*_beh.tsv")]


def copy_files(files: list[Path], dataset: Path, folder: Path) -> None:
    """Write files of a data set to the same places in a folder: tables as shared, others byte by byte."""
    for path in files:
        target = folder / path.relative_to(dataset)
        if path.suffix == ".tsv":
            write_whole(target, "".join("\t".join(cells) + "\n" for cells in shared_table(path)))
        elif path.with_suffix(".tsv") in files:
            write_json(target, shared_descriptions(path))
        else:
            try:
                with open_input(path, "a file of a data set") as stream:
                    write_whole(target, stream.read())
            except OSError as error:
                raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _refuse_problems(dataset: Path) -> None:
    """Refuse a data set with problems: whoever gets the export could not put them right."""
    if "@context" in read_json(dataset / DESCRIPTION, "the description of a data set"):
        raise InputError(f"{dataset}: is an export in the layout of Psych-DS; export the data set itself")
    problems = [problem for checked in validate(dataset) for problem in checked.problems]
    if problems:
        more = f", the first of {len(problems)} problems" if len(problems) > 1 else ""
        raise InputError(
            f"{problems[0]}{more}; a data set is exported when `evenlight validate` finds no problem in it"
        )


def _refuse_personal_data(dataset: Path) -> None:
    path = dataset / PARTICIPANTS
    if path.exists():
        header = read_text(path, "the list of participants").split("\n")[0].split("\t")
        for column in personal_columns(header):
            raise InputError(f"{path}: the column {column!r} looks like personal data; take it out first")


PARTICIPANT_TABLE = "group-participants_data.csv"
NOT_DEFINED = (
    "sub-*",
    SWEEPS,
    PARTICIPANTS,
    str(Path(PARTICIPANTS).with_suffix(".json")),
    SIMULATED_TRUTH,
    PREREGISTRATIONS,
)
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
    description = description_of(dataset)
    others = {dataset / name for name in (DESCRIPTION, README, IGNORED)}
    variables: dict[str, dict[str, Any]] = {}
    with new_folder(folder, THERE.format(folder)) as staging:
        copy_files([path for path in files if path not in others], dataset, staging)
        for name, table in tables.items():
            header, *rows = shared_table(table)
            write_whole(staging / "data" / name, csv_text(header, [[*map(cell_words, row)] for row in rows]))
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
    content = shared_descriptions(sidecar)
    return {name: _variable(name, content.get(name, {})) for name in columns}


def _variable(name: str, entry: dict[str, Any]) -> dict[str, Any]:
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
    simulated = bool(bids.get("Simulated"))
    who = "Simulated participants: no person took part." if simulated else "Recorded with participants."
    about = "Sessions on temporal brightness management, one row per trial."
    approved = (f"Ethics approval: {approval}." for approval in bids.get("EthicsApprovals", ()))
    licence = bids.get("License", "")
    known = {
        "author": [{"@type": "Person", "name": name} for name in bids.get("Authors", ())],
        "license": f"https://spdx.org/licenses/{licence}" if spdx_name(licence) == licence else licence,
    }
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "schemaVersion": "Psych-DS 1.5.0",
        "name": bids.get("Name", "Evenlight sessions"),
        "description": " ".join([about, who, *approved]),
        "variableMeasured": list(variables),
        "keywords": ["psychophysics", "luminance", "brightness", "temporal brightness management"],
        "missingValueCodes": [MISSING],
        **{key: value for key, value in known.items() if value},
    }

"""BIDS: the part of a data set that others read, without the files that only Evenlight does."""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.checking.dataset_checks import personal_columns
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import BEHAVIOUR_FOLDER, DESCRIPTION, PARTICIPANTS
from evenlight.data_schema.storage.text_files import read_text
from evenlight.data_schema.storage.whole_files import results_folder, write_whole


def export_bids(dataset: Path, folder: Path) -> int:
    """Copy the files of a data set that BIDS defines, and return how many tables of trials there are.

    Parameters
    ----------
    dataset : Path
        Data set of sessions.
    folder : Path
        Where to; it must not hold anything.

    Raises
    ------
    InputError
        If there is no table of trials, or the folder holds something.
    """
    tables = exported_tables(dataset)
    refuse_personal_data(dataset)
    refuse_used_folder(folder)
    names = [DESCRIPTION, "README", PARTICIPANTS, str(Path(PARTICIPANTS).with_suffix(".json"))]
    files = [dataset / name for name in names if (dataset / name).is_file()]
    with results_folder(folder) as staging:
        for path in [*files, *tables, *(table.with_suffix(".json") for table in tables)]:
            write_whole(staging / path.relative_to(dataset), read_text(path, "a file of a data set"))
    return len(tables)


def exported_tables(dataset: Path) -> list[Path]:
    """Return the tables of trials of a data set, or refuse one that has none."""
    tables = sorted(dataset.glob(f"sub-*/ses-*/{BEHAVIOUR_FOLDER}/*_beh.tsv"))
    if not tables:
        raise InputError(
            f"{dataset}: no table to export (sub-*/ses-*/{BEHAVIOUR_FOLDER}/*_beh.tsv); "
            "an interrupted session gets its table when it is resumed or complete"
        )
    return tables


def refuse_personal_data(dataset: Path) -> None:
    """Refuse a list of participants with personal data."""
    path = dataset / PARTICIPANTS
    if path.exists():
        header = read_text(path, "the list of participants").split("\n")[0].split("\t")
        for column in personal_columns(header):
            raise InputError(f"{path}: the column {column!r} looks like personal data; take it out first")


def refuse_used_folder(folder: Path) -> None:
    """Refuse a folder that holds something: nothing is overwritten."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is there already; give a new folder")

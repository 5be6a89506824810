"""BIDS: a data set for others, whole and checked, so that what reads the data set reads its export too."""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.checking.dataset_checks import personal_columns
from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.export.shared_tables import shared_descriptions, shared_table
from evenlight.data_schema.recordings.dataset_layout import (
    BEHAVIOUR_FOLDER,
    DESCRIPTION,
    EVENTS,
    FRAMES,
    HEADSET,
    LOCK,
    MANIFEST,
    PARTICIPANTS,
    READINGS,
    SIMULATED_TRUTH,
    SWEEP_MANIFEST,
    SWEEPS,
    TRIALS,
    require_apart,
)
from evenlight.data_schema.recordings.roll_call import call_roll, leads_out
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.storage.text_files import read_json, read_text, write_json
from evenlight.data_schema.storage.whole_files import is_partial, results_folder, write_whole

IGNORED = ".bidsignore"
README = "README"
OWN_FILES = (
    *(f"**/{name}" for name in (MANIFEST, TRIALS, FRAMES, HEADSET, EVENTS, LOCK)),
    SIMULATED_TRUTH,
    SWEEPS,
)
# All that Evenlight or BIDS reads in a data set; what else lies there stays there.
EXPORTED = (
    DESCRIPTION,
    README,
    IGNORED,
    PARTICIPANTS,
    str(Path(PARTICIPANTS).with_suffix(".json")),
    SIMULATED_TRUTH,
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
    with results_folder(folder) as staging:
        copy_files(files, dataset, staging)
        patterns = dict.fromkeys((*filter(None, lines), *OWN_FILES))
        write_whole(staging / IGNORED, "".join(f"{pattern}\n" for pattern in patterns))
    return len(tables_in(files))


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
    if folder.exists() and (not folder.is_dir() or any(not is_partial(path) for path in folder.iterdir())):
        raise InputError(f"{folder}: is there already; give a new folder")
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
                write_whole(target, path.read_bytes())
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
    """Refuse a list of participants with personal data."""
    path = dataset / PARTICIPANTS
    if path.exists():
        header = read_text(path, "the list of participants").split("\n")[0].split("\t")
        for column in personal_columns(header):
            raise InputError(f"{path}: the column {column!r} looks like personal data; take it out first")

"""Writing another program's table as a data set."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from evenlight.data_schema.checking.dataset_checks import personal_columns
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_mapping import ImportMapping, ImportRequest
from evenlight.data_schema.importing.imported_trials import coded, imported_trials, wanted_rows
from evenlight.data_schema.importing.source_cells import TRUTHS, taken_columns
from evenlight.data_schema.importing.source_tables import SourceTable, read_sources
from evenlight.data_schema.provenance import provenance_now, sha256_of_file
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.recordings.dataset_writing import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.rating_scale import scale_of
from evenlight.data_schema.recordings.roll_call import SessionUse, call_roll
from evenlight.data_schema.recordings.session import TASKS, ImportSource, SessionManifest, SessionStatus
from evenlight.data_schema.storage.tables import csv_text


def import_dataset(request: ImportRequest, dataset: Path) -> list[str]:
    """Write a new data set from another program's files, and return what is to be said of it.

    What the table does not tell stays unknown (docs/decisions/roll-call.md).

    Raises
    ------
    InputError
        If they cannot be read as trials of the task, or there is something at the data set's place.
    """
    table = read_sources(request.paths)
    taken = taken_columns(table, request.mapping)
    who = taken.columns.get("participant_id", "")
    if personal_columns([who]):
        raise InputError(
            f"{table.path}: the column {who!r} for participant_id looks like personal data; expected codes"
        )
    adopted = not request.simulated and _simulated(table, taken)
    request = dataclasses.replace(request, simulated=request.simulated or adopted)
    rows, told, ids = imported_trials(table, taken, request)
    key_file = dataset.with_name(f"{dataset.name}.key.csv") if coded(ids) else None
    if key_file:
        told.append(
            f"participant_id: codes {min(ids.values())} to {max(ids.values())}, as not all ids are letters "
            f"and digits, and may be names; {key_file} says whose they are: keep it apart from the data"
        )
    told += ["simulated: all rows say so"] if adopted else []
    trials = [trial for _, trial in rows]
    scale = None
    if request.task == "rating":
        column = taken.columns.get("rating", "rating")
        given = [(table.place(row, column), trial.rating) for row, trial in rows]
        scale, said = scale_of(given, request.scale)
        told.append(said)
    elif request.scale:
        raise InputError(f"--scale is of ratings, not of a {request.task}")
    sessions: dict[tuple[str, str], list[Any]] = {}
    files: dict[tuple[str, str], Path] = {}
    for row, trial in rows:
        key = (trial.participant_id, trial.session_id)
        sessions.setdefault(key, []).append(trial)
        if files.setdefault(key, row.path) != row.path:
            raise InputError(
                f"{row.path}: session {key[1]} of participant {key[0]} is in {files[key]} too; name the "
                "column that tells sessions apart (--column session_id=THEIRS), or join the two files"
            )
    sources = {
        path: dataclasses.replace(
            _source(path, f"file {number} of {len(request.paths)}", table, taken), scale=scale
        )
        for number, path in enumerate(request.paths, start=1)
    }
    with new_dataset(dataset) as staging, _new_key(key_file, ids):
        _write(request, staging, {key: sources[path] for key, path in files.items()}, sessions)
    people = len({participant for participant, _ in sessions})
    counts = {"participant": people, "session": len(sessions), "trial": len(trials)}
    words = [f"{number} {what}{'s' * (number != 1)}" for what, number in counts.items()]
    others = f" and {len(request.paths) - 1} more" if len(request.paths) > 1 else ""
    head = f"{table.path}{others}: {table.file_format}, {len(table.rows)} rows"
    return [
        head,
        *_taken(sources[table.path], taken.record),
        *told,
        _unknown(request, trials),
        f"{', '.join(words)} in {dataset}",
    ]


def _write(
    request: ImportRequest,
    staging: Path,
    sources: dict[tuple[str, str], ImportSource],
    sessions: dict[tuple[str, str], list[Any]],
) -> None:
    files = {source.file: source.sha256 for source in sources.values()}
    provenance = provenance_now(inputs=files)
    people = list(dict.fromkeys(participant for participant, _ in sessions))
    number = len(request.paths)
    kind = next(iter(sources.values())).file_format
    names = f"{number} file{'s' * (number != 1)} ({kind})"  # without their names, which may be people's
    origin = f"imported from {names} into Evenlight"
    write_description(staging, f"{request.task} trials of {names}", request.simulated, provenance, origin)
    write_participants(staging, people, request.simulated)
    for (participant, session), trials in sessions.items():
        source = sources[participant, session]
        manifest = SessionManifest(
            participant_id=participant,
            session_id=session,
            task=request.task,
            simulated=request.simulated,
            status=SessionStatus.IMPORTED,
            n_trials=sum(trial.usable for trial in trials),
            display=request.display,
            design=None,
            provenance=dataclasses.replace(provenance, inputs={source.file: source.sha256}),
            order_index=people.index(participant),
            source=source,
        )
        write_session(staging, manifest, sorted(trials, key=lambda trial: trial.trial_index))
    for entry in call_roll(staging).sessions:
        if entry.use is SessionUse.WRONG:
            raise InputError(
                f"{request.paths[0]}: participant {entry.participant_id}, session {entry.session_id}: "
                f"{entry.why}; take one of them out"
            )


@contextmanager
def _new_key(path: Path | None, ids: dict[str, str]) -> Iterator[None]:
    """Write whose codes they are, for its owner alone; it goes again if the block fails."""
    if path is None:
        yield
        return
    text = csv_text(("participant_id", "source_id"), ((code, text) for text, code in ids.items()))
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            path.chmod(0o600)
            file.write(text)
    except OSError as error:
        raise InputError(
            f"{path}: the key of the participants' codes cannot be written ({error.strerror}); a key that is "
            "there is never overwritten: move it, or give another folder as `out`"
        ) from None
    try:
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _simulated(table: SourceTable, taken: ImportMapping) -> bool:
    column = next((name for name in table.columns if name.lower() == "simulated"), None)
    rows = wanted_rows(table, taken) if column else []
    said = [(line, table.cell(cells, column or "").lower()) for line, cells in rows]
    known = {TRUTHS.get(text) for _, text in said if text}
    if True in known and known != {True}:
        line = next(line for line, text in said if text and not TRUTHS.get(text))
        raise InputError(
            f"{table.place(line, column or '')}: not simulated, but others are; import them apart (--only)"
        )
    return True in known


def _source(path: Path, name: str, table: SourceTable, taken: ImportMapping) -> ImportSource:
    values: dict[str, str] = {}
    private: dict[str, dict[str, str]] = {"participant_id": {}}  # whose values may be names
    for ours, meanings in (taken.values | private).items():
        for theirs, value in meanings.items():
            key = f"{ours}:{value}"
            values[key] = f"{values[key]}, {theirs}" if key in values else theirs
    return ImportSource(
        file=name,
        file_format=table.file_format,
        sha256=sha256_of_file(path),
        columns=taken.columns | taken.wide,
        units=taken.units,
        values=values,
        constants={ours: text for ours, text in taken.constants.items() if ours not in private},
    )


def _taken(source: ImportSource, record: type[Any]) -> Iterator[str]:
    """Yield what was taken for what; constants without a unit are in ours, which the key names."""
    keys = {field.name: file_key(field) for field in dataclasses.fields(record)}
    for ours, theirs in source.columns.items():
        yield f"  {ours}: {theirs!r}" + (f" [{source.units[ours]}]" if ours in source.units else "")
    for ours, value in source.constants.items():
        said = f" [{source.units[ours]}]" if ours in source.units else ""
        yield f"  {ours if said else keys[ours]}: {value}{said} in all rows"
    for value, theirs in source.values.items():
        yield f"  {value} for {theirs!r}"


def _unknown(request: ImportRequest, trials: list[Any]) -> str:
    names = [] if request.display else ["display"]
    names += ["design"]
    for field in dataclasses.fields(TASKS[request.task].trial):
        if field.default is not None and all(getattr(trial, field.name) is None for trial in trials):
            names.append(file_key(field))
    return f"unknown: {', '.join(names)}"

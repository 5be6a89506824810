"""Writing another program's table as a data set."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evenlight.data_schema.checking.dataset_checks import personal_columns
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_request import ImportRequest
from evenlight.data_schema.importing.imported_trials import imported_trials, wanted_rows
from evenlight.data_schema.importing.source_cells import TRUTHS, taken_columns
from evenlight.data_schema.provenance import provenance_now, sha256_of_file
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.recordings.dataset_writing import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.participant_ids import are_codes, written_key
from evenlight.data_schema.recordings.rating_scale import RatingScale, scale_of
from evenlight.data_schema.recordings.roll_call import SessionUse, call_roll
from evenlight.data_schema.recordings.session import ImportSource, SessionManifest, SessionStatus
from evenlight.data_schema.storage.foreign_tables import ForeignTable, read_foreign_tables
from evenlight.data_schema.storage.tables import as_number

Session = tuple[str, str]


def import_dataset(request: ImportRequest, dataset: Path) -> list[str]:
    """Write a new data set from another program's files, and return what is to be said of it.

    What the table does not tell stays unknown (docs/decisions/roll-call.md).

    Raises
    ------
    InputError
        If they cannot be read as trials of the task, or there is something at the data set's place.
    """
    table = read_foreign_tables(request.paths, request.settings)
    taken = taken_columns(table, request)
    who = taken.columns.get("participant_id", "")
    if personal_columns([who]):
        raise InputError(
            f"{table.path}: the column {who!r} for participant_id looks like personal data; expected codes"
        )
    adopted = not request.simulated and _simulated(table, taken)
    taken = dataclasses.replace(taken, simulated=request.simulated or adopted)
    rows, told, ids = imported_trials(table, taken)
    key_file = dataset.with_name(f"{dataset.name}.key.csv") if are_codes(ids) else None
    if key_file:
        told.append(
            f"participant_id: codes {min(ids.values())} to {max(ids.values())}, as an id needs a digit and "
            f"no blanks, and else may be a name; {key_file} says whose they are: keep it apart from the data"
        )
    told += ["simulated: all rows say so"] if adopted else []
    scale = None
    if request.task == "rating":
        scale, said = scale_of([(table.place(row), trial.rating) for row, trial in rows], request.scale)
        told.append(said)
    elif request.scale:
        raise InputError(f"--scale is of ratings, not of a {request.task}")
    sources = {
        path: _source(path, f"file {number} of {len(request.paths)}", table, taken, scale)
        for number, path in enumerate(request.paths, start=1)
    }
    sessions = _sessions(rows)
    with new_dataset(dataset) as staging, written_key(key_file, ids):
        _write(taken, staging, sources, sessions, table.title)
    people = len({participant for participant, _ in sessions})
    counts = {"participant": people, "session": len(sessions), "trial": len(rows)}
    words = [f"{number} {what}{'s' * (number != 1)}" for what, number in counts.items()]
    others = f" and {len(request.paths) - 1} more" if len(request.paths) > 1 else ""
    head = f"{table.path}{others}: {table.file_format}, {len(table.rows)} rows"
    if table.encodings:
        seen = "" if "encoding" in request.settings else ", as it is no UTF-8 (--encoding says otherwise)"
        head += f"; read as {' and '.join(table.encodings)}{seen}"
    told += [f"title: {table.title}"] if table.title else []
    unknown = _unknown(request, [trial for _, trial in rows])
    source = sources[table.path]
    return [head, *_taken(source, taken), *told, unknown, f"{', '.join(words)} in {dataset}"]


def _sessions(rows: list[tuple[Any, Any]]) -> dict[Session, tuple[Path, list[Any]]]:
    """Return the file and the trials of each session."""
    sessions: dict[Session, tuple[Path, list[Any]]] = {}
    for row, trial in rows:
        key = (trial.participant_id, trial.session_id)
        file, trials = sessions.setdefault(key, (row.path, []))
        trials.append(trial)
        if file != row.path:
            raise InputError(
                f"{row.path}: session {key[1]} of participant {key[0]} is in {file} too; name the "
                "column that tells sessions apart (--column session_id=THEIRS), or join the two files"
            )
    return sessions


def _write(
    request: ImportRequest,
    staging: Path,
    sources: dict[Path, ImportSource],
    sessions: dict[Session, tuple[Path, list[Any]]],
    title: str,
) -> None:
    provenance = provenance_now(inputs={source.file: source.sha256 for source in sources.values()})
    people = list(dict.fromkeys(participant for participant, _ in sessions))
    kinds = Counter(source.file_format for source in sources.values())
    # Without the names of the files, which may be people's.
    names = ", ".join(f"{number} file{'s' * (number != 1)} ({kind})" for kind, number in kinds.items())
    origin = f"imported from {names} into Evenlight"
    title = title or f"{request.task} trials of {names}"
    write_description(staging, title, request.simulated, provenance, origin)
    write_participants(staging, people, request.simulated)
    for (participant, session), (path, trials) in sessions.items():
        source = sources[path]
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


def _simulated(table: ForeignTable, taken: ImportRequest) -> bool:
    column = next((name for name in table.columns if name.lower() == "simulated"), "")
    said = [(line, as_number(table.cell(cells, column)).lower()) for line, cells in wanted_rows(table, taken)]
    others = [line for line, text in said if text and not TRUTHS.get(text)]
    simulated = any(TRUTHS.get(text) for _, text in said)
    if simulated and others:
        raise InputError(
            f"{table.place(others[0], column)}: not simulated, but others are; import them apart (--only)"
        )
    return simulated


def _source(
    path: Path, name: str, table: ForeignTable, taken: ImportRequest, scale: RatingScale | None
) -> ImportSource:
    """Return what a file was, and how it was read, without what may be names of participants."""
    values: dict[str, str] = {}
    for ours, meanings in taken.values.items():
        for theirs, value in meanings.items() if ours != "participant_id" else ():
            key = f"{ours}:{value}"
            values[key] = f"{values[key]}, {theirs}" if key in values else theirs
    return ImportSource(
        file=name,
        file_format=table.file_format,
        sha256=sha256_of_file(path),
        columns=taken.columns | taken.wide,
        units=taken.units,
        values=values,
        scale=scale,
        constants={ours: text for ours, text in taken.constants.items() if ours != "participant_id"},
    )


def _taken(source: ImportSource, request: ImportRequest) -> Iterator[str]:
    """Yield what was taken for what; constants without a unit are in ours, which the key names."""
    for ours, theirs in source.columns.items():
        yield f"  {ours}: {theirs!r}" + (f" [{source.units[ours]}]" if ours in source.units else "")
    for ours, value in source.constants.items():
        said = f" [{source.units[ours]}]" if ours in source.units else ""
        yield f"  {ours if said else file_key(request.fields[ours])}: {value}{said} in all rows"
    yield from (f"  {value} for {theirs!r}" for value, theirs in source.values.items())


def _unknown(request: ImportRequest, trials: list[Any]) -> str:
    fields = (each for each in dataclasses.fields(request.record) if each.default is not None)
    names = [file_key(f) for f in fields if all(getattr(trial, f.name) is None for trial in trials)]
    return f"unknown: {', '.join([*([] if request.display else ['display']), 'design', *names])}"

"""Checking a session or a sweep: manifest, trials or readings, and whether they agree with each other."""

from __future__ import annotations

import math
import types
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from evenlight.data_schema.checking.file_checks import CheckedFile, check_file
from evenlight.data_schema.errors import InputError, shown
from evenlight.data_schema.mapping import keys_of, record_from_mapping, type_hints
from evenlight.data_schema.record_kinds import KIND_OF, READINGS_OF_SWEEP, RecordKind, kind_of
from evenlight.data_schema.recordings.dataset_layout import (
    FRAMES,
    HEADSET,
    MANIFEST,
    READINGS,
    SWEEP_MANIFEST,
    TRIALS,
    behaviour_file,
)
from evenlight.data_schema.recordings.dataset_writing import MISSING
from evenlight.data_schema.recordings.headset import HeadsetLog
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.session import TASKS, WHOLE, SessionManifest, SessionStatus
from evenlight.data_schema.recordings.sweep import SweepManifest
from evenlight.data_schema.recordings.viewing import RatingTrial, Version
from evenlight.data_schema.storage.tables import columns_of, csv_rows, optional_columns, plain_cell
from evenlight.data_schema.storage.text_files import read_json, read_text

ROUNDING = 1e-6  # relative, of a luminance


def check_session(dataset: Path, folder: Path) -> Iterator[CheckedFile]:
    """Yield the files of a session: its manifest, its trials, and their export as a table."""
    if not (folder / MANIFEST).is_file():
        yield CheckedFile.blamed(folder / MANIFEST, "session manifest", "no such file; every session has one")
        return
    checked = check_file(folder / MANIFEST, KIND_OF[SessionManifest])
    manifest = checked.record
    if manifest is not None:
        _compare_with_folders(checked, manifest, folder)
    trials = _check_trials(folder, manifest)
    yield checked
    yield trials
    if (folder / FRAMES).is_file():
        known = TASKS.get(manifest.task) if manifest else None
        yield _check_frames(folder / FRAMES, trials, kind_of(known.frames) if known else None)
    if (folder / HEADSET).is_file() or (trials.records and _in_headset(manifest)):
        yield _check_frames(folder / HEADSET, trials, KIND_OF[HeadsetLog])
    if isinstance(manifest, SessionManifest):
        yield from _check_export(dataset, manifest, trials)


def _compare_with_folders(checked: CheckedFile, manifest: SessionManifest, folder: Path) -> None:
    for key, got, right in (
        ("participant_id", manifest.participant_id, folder.parent.name.removeprefix("sub-")),
        ("session_id", manifest.session_id, folder.name.removeprefix("ses-")),
    ):
        if got != right:
            checked.blame(f"{key}: expected {right!r}, as in the folder's name, got {got!r}")


def _check_trials(folder: Path, manifest: SessionManifest | None) -> CheckedFile:
    known = TASKS.get(manifest.task) if manifest else None
    kind = kind_of(known.trial) if known else None
    if kind is None:
        return CheckedFile(folder / TRIALS, "")
    if not (folder / TRIALS).is_file():
        checked = CheckedFile(folder / TRIALS, kind.words)
        if manifest and manifest.status in WHOLE and manifest.n_trials:
            state = manifest.status.value
            checked.blame(f"no such file; the session is {state} with {manifest.n_trials} trials")
        else:
            checked.notes.append(f"{checked.path}: no such file; the session has no trial yet")
        return checked
    checked = check_file(folder / TRIALS, kind)
    _find_repeated(checked, "trial_index")
    if manifest is not None:
        _compare_with_manifest(checked, manifest)
    return checked


def _in_headset(manifest: SessionManifest | None) -> bool:
    """Return whether someone wore a headset in a session; a rehearsal may not have opened one."""
    rig = manifest.rig if manifest is not None and not manifest.simulated else None
    return rig is not None and rig.in_headset


def _check_frames(path: Path, trials: CheckedFile, kind: RecordKind | None) -> CheckedFile:
    """Return the frame logs of a session: every trial that counts its frames has one for each interval."""
    if kind is None:
        return CheckedFile(path, "")
    checked = check_file(path, kind)
    logged = {(log.trial_index, log.attempt, log.interval) for _, log in checked.records}
    for line, trial in trials.records:
        if trial.n_frames is None:
            continue
        for interval in range(1, trial.intervals + 1):
            if (trial.trial_index, trial.attempt, interval) not in logged:
                checked.blame(
                    f"no frames of trial {trial.trial_index}, attempt {trial.attempt}, interval {interval}, "
                    f"which line {line} of {TRIALS} has"
                )
    return checked


def _find_repeated(checked: CheckedFile, key: str) -> None:
    first: dict[int, int] = {}
    for line, record in checked.records:
        index = getattr(record, key)
        earlier = first.setdefault(index, line)
        if earlier != line:
            checked.blame(f"{key}: {index} is there already, in line {earlier}", line)


def _compare_with_manifest(checked: CheckedFile, manifest: SessionManifest) -> None:
    for line, trial in checked.records:
        for key in ("participant_id", "session_id", "simulated"):
            got, right = getattr(trial, key), getattr(manifest, key)
            if got != right:
                checked.blame(f"{key}: expected {right!r}, as in {MANIFEST}, got {got!r}", line)
        panel, highest = manifest.display, _brightest_of(trial)
        brightest = panel.peak_luminance + panel.reflected_luminance if panel else math.inf
        if highest > brightest * (1 + ROUNDING):
            checked.blame(
                f"luminance: expected at most {brightest:g} cd/m^2, which the session's display reaches, "
                f"got {highest:g}",
                line,
            )
        _compare_with_stimuli(checked, line, trial, manifest)
        if isinstance(trial, RatingTrial) and (problem := manifest.scale.refusal(trial.rating)):
            checked.blame(problem, line)
    count, planned = sum(trial.usable for _, trial in checked.records), manifest.n_trials
    flagged = sum(trial.flag is not TrialFlag.NONE for _, trial in checked.records)
    if manifest.status in WHOLE and not planned - flagged <= count <= planned:
        state = manifest.status.value
        checked.blame(f"expected {planned} usable trials, because the session is {state}, got {count}")
    elif count > planned:
        checked.blame(f"expected at most {planned} trials, as in {MANIFEST}, got {count}")
    elif manifest.status not in WHOLE:
        checked.notes.append(
            f"{checked.path}: the session is {manifest.status.value}, with {count} of {planned} trials"
        )
    if flagged:
        checked.notes.append(f"{checked.path}: {flagged} trial(s) are flagged and left out of the analysis")


def _compare_with_stimuli(checked: CheckedFile, line: int, trial: Any, manifest: SessionManifest) -> None:
    sequence, stimuli = getattr(trial, "sequence", None), {each.name: each for each in manifest.stimuli}
    known = tuple(stimuli) or getattr(manifest.design, "sequences", ())  # neither, if it was imported
    if sequence is None or not known:
        return
    if sequence not in known:
        checked.blame(
            f"sequence: expected one of {', '.join(known)}, as in {MANIFEST}, got {sequence!r}", line
        )
    if sequence not in stimuli:
        return
    stimulus, version = stimuli[sequence], getattr(trial, "version", Version.OURS)
    expected = {"baseline_factor": stimulus.baseline_factor}
    expected["mean_factor"] = stimulus.mean_factor if version is Version.OURS else stimulus.baseline_factor
    if version is Version.BASELINE:
        expected["factor"] = stimulus.baseline_factor
    for key, right in expected.items():
        got = getattr(trial, key, None)
        if got is not None and abs(got - right) > ROUNDING:
            checked.blame(
                f"{key}: expected {right:g}, as {sequence!r} has it in {MANIFEST}, got {got:g}", line
            )


def _brightest_of(trial: Any) -> float:
    names = ("initial_luminance", "final_luminance", "background_luminance")
    return max(float(getattr(trial, name, None) or 0.0) for name in names)


def _check_export(dataset: Path, manifest: SessionManifest, trials: CheckedFile) -> Iterator[CheckedFile]:
    path = behaviour_file(dataset, manifest.participant_id, manifest.session_id, manifest.task)
    known = TASKS.get(manifest.task)
    if known is None:
        return
    if not path.is_file():
        if manifest.status in WHOLE and trials.records:
            yield CheckedFile.blamed(
                path, "exported trials", f"no such file; {TRIALS} is to be exported there"
            )
        return
    yield _check_exported_rows(path, known.trial, trials)
    described = columns_of(known.trial)
    with suppress(InputError):  # which the table has told
        header = read_text(path, "exported trials").partition("\n")[0].split("\t")
        described = [column for column in described if column in header]
    yield check_column_descriptions(path.with_suffix(".json"), described)


def _check_exported_rows(path: Path, cls: type[Any], trials: CheckedFile) -> CheckedFile:
    checked = _check_table(path, cls)
    if checked.problems or trials.problems:
        return checked
    if len(checked.records) != len(trials.records):
        checked.blame(f"expected {len(trials.records)} rows, as {TRIALS}, got {len(checked.records)}")
    for (line, row), (other, trial) in zip(checked.records, trials.records, strict=False):
        keys = [key for key in row.__slots__ if _told(getattr(row, key)) != _told(getattr(trial, key))]
        if keys:
            checked.blame(f"{', '.join(keys)}: not as in line {other} of {TRIALS}", line)
    return checked


def _told(value: Any) -> Any:
    """Return what a table can tell of a value: "n/a" for none and for an empty text."""
    return MISSING if value in (None, "") else value


def _check_table(path: Path, cls: type[Any]) -> CheckedFile:
    checked = CheckedFile(path, "exported trials")
    columns, names, kinds = columns_of(cls), list(keys_of(cls)[0].values()), type_hints(cls)
    whose = columns.index("participant_id")
    note, optional = checked.problems.append, optional_columns(cls)  # a table of before they were there
    try:
        rows = csv_rows(path, columns, "exported trials", "\t", lambda error: note(str(error)), optional)
        for line, cells in rows:
            where = f"{path}, line {line}"
            cells[whose] = cells[whose].removeprefix("sub-")  # as exports name a participant
            try:
                row = {
                    key: plain_cell(kinds[name], cell)
                    for key, name, cell in zip(columns, names, cells, strict=True)
                    if key not in optional or not _is_default(kinds[name], cell)
                }
                checked.records.append((line, record_from_mapping(cls, row, where)))
            except InputError as error:
                note(str(error))
    except InputError as error:
        note(str(error))
    return checked


def _is_default(kind: Any, cell: str) -> bool:
    """Return whether a cell stands for its column's default: an empty one, which is `n/a` in an export."""
    return not cell or (cell == MISSING and not isinstance(kind, types.UnionType))


def check_column_descriptions(path: Path, columns: list[str]) -> CheckedFile:
    """Return the file that describes the columns of an exported table."""
    checked = CheckedFile(path, "description of columns")
    try:
        content = read_json(path, "a description of columns")
    except InputError as error:
        checked.problems.append(str(error))
        return checked
    if not isinstance(content, dict):
        checked.blame(f"expected a table of columns and what they mean, got {shown(content)}")
        return checked
    for column in columns:
        if column not in content:
            checked.blame(f"the column {column!r} is not described")
    return checked


def check_sweep(folder: Path) -> Iterator[CheckedFile]:
    """Yield the files of a sweep that were checked: its manifest and its readings."""
    if not (folder / SWEEP_MANIFEST).is_file():
        yield CheckedFile.blamed(
            folder / SWEEP_MANIFEST, "sweep manifest", "no such file; every sweep has one"
        )
        return
    checked = check_file(folder / SWEEP_MANIFEST, KIND_OF[SweepManifest])
    manifest = checked.record
    if isinstance(manifest, SweepManifest) and folder.name != f"{manifest.task}_{manifest.session_id}":
        checked.blame(
            f"expected the task and session of its folder {folder.name!r}, got {manifest.task!r} and "
            f"{manifest.session_id!r}"
        )
    yield checked
    if isinstance(manifest, SweepManifest):
        yield _check_readings(folder / READINGS, manifest)


def _check_readings(path: Path, manifest: SweepManifest) -> CheckedFile:
    kind = READINGS_OF_SWEEP[manifest.task]
    if not path.is_file():
        checked = CheckedFile(path, kind.words)
        checked.notes.append(f"{path}: no such file; the sweep has no reading yet")
        if manifest.status is SessionStatus.COMPLETE:
            checked.blame(f"no such file; the sweep is complete with {manifest.n_readings} readings")
        return checked
    checked = check_file(path, kind)
    _find_repeated(checked, "index")
    before = 0.0
    for line, reading in checked.records:
        if reading.begun < before:
            checked.blame(f"begun_s: {reading.begun:g} s is before the reading above had ended", line)
        before = reading.ended
        _compare_with_design(checked, line, reading.factor, manifest)
    count = len({reading.index for _, reading in checked.records if reading.again_of is None})
    planned = manifest.n_readings
    if count > planned or (manifest.status is SessionStatus.COMPLETE and count < planned):
        checked.blame(f"expected {planned} readings, as in {SWEEP_MANIFEST}, got {count}")
    elif manifest.status is not SessionStatus.COMPLETE:
        checked.notes.append(
            f"{path}: the sweep is {manifest.status.value}, with {count} of {planned} readings"
        )
    return checked


def _compare_with_design(
    checked: CheckedFile, line: int, factor: float | None, manifest: SweepManifest
) -> None:
    """Note a reading at a brightness factor that the design has not; full brightness warms every panel up."""
    if factor not in (None, 1.0, *manifest.design.factors):
        checked.blame(f"factor: expected one of the design's, got {factor:g}", line)

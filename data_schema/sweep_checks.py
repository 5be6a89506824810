"""Checking a sweep: its manifest and its readings, and whether they agree with each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from evenlight.data_schema.dataset_layout import READINGS, SWEEP_MANIFEST
from evenlight.data_schema.file_checks import CheckedFile, check_file
from evenlight.data_schema.record_kinds import READINGS_OF_SWEEP
from evenlight.data_schema.record_kinds import SWEEP_MANIFEST as MANIFEST_KIND
from evenlight.data_schema.session import SessionStatus
from evenlight.data_schema.sweep import SweepManifest


def check_sweep(folder: Path) -> Iterator[CheckedFile]:
    """Yield the files of a sweep that were checked: its manifest and its readings."""
    if not (folder / SWEEP_MANIFEST).is_file():
        missing = CheckedFile(folder / SWEEP_MANIFEST, MANIFEST_KIND.words)
        missing.blame("no such file; every sweep has one")
        yield missing
        return
    checked = check_file(folder / SWEEP_MANIFEST, MANIFEST_KIND)
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
    """Return the readings of a sweep, compared with its manifest."""
    kind = READINGS_OF_SWEEP[manifest.task]
    if not path.is_file():
        checked = CheckedFile(path, kind.words)
        checked.notes.append(f"{path}: no such file; the sweep has no reading yet")
        if manifest.status is SessionStatus.COMPLETE:
            checked.blame(f"no such file; the sweep is complete with {manifest.n_readings} readings")
        return checked
    checked = check_file(path, kind)
    first: dict[int, int] = {}
    before = 0.0
    for line, reading in checked.records:
        earlier = first.setdefault(reading.index, line)
        if earlier != line:
            checked.blame(f"index: {reading.index} is there already, in line {earlier}", line)
        if reading.begun < before:
            checked.blame(f"begun_s: {reading.begun:g} s is before the reading above had ended", line)
        before = reading.ended
        _compare_with_design(checked, line, reading.factor, manifest)
    count, planned = len(first), manifest.n_readings
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

"""Readings of a table, made elsewhere, as a sweep."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_writing import require_dataset
from evenlight.data_schema.recordings.session import EventKind, SessionStatus
from evenlight.data_schema.recordings.sweep import (
    FEWEST_READINGS,
    LuminanceReading,
    LuminanceSweepDesign,
    SweepManifest,
)
from evenlight.experiments.sweeps.sweep_readings import begin_sweep, resume_sweep
from evenlight.hardware.luminance_table import luminance_readings_from_csv
from evenlight.hardware.rig_files import TABLE


def is_imported(luminance_meter: str, task: str) -> bool:
    """Return whether a sweep is imported: its rig names a table in place of a luminance meter."""
    return task == "luminance-sweep" and luminance_meter.startswith(TABLE)


def import_sweep(dataset: Path, manifest: SweepManifest, *, resume: bool) -> tuple[int, Path]:
    """Write the readings of a table as a sweep; return how many there are, and the sweep's folder.

    The time of the readings is unknown, so the sweep and what is fitted to it carry no date.

    Parameters
    ----------
    dataset : Path
        Where to.
    manifest : SweepManifest
        What the sweep is, but for its levels, which are the table's: of its design only L_refl counts.
    resume : bool
        Whether an import that was interrupted is to be finished.

    Raises
    ------
    InputError
        If the table has too few readings of a level, or is none, or is not as it was.
    """
    path = Path(manifest.rig.luminance_meter.removeprefix(TABLE))
    readings = luminance_readings_from_csv(path)
    reflected = getattr(manifest.design, "reflected_luminance", 0.0)
    design = dataclasses.replace(_design_of_table(readings, path), reflected_luminance=reflected)
    if resume:
        store = resume_sweep(dataset, manifest.task, manifest.session_id, str)
    else:
        require_dataset(dataset, manifest.simulated, manifest.provenance)
        new = dataclasses.replace(manifest, design=design, n_readings=len(readings), started="")
        store = begin_sweep(dataset, new, str)
    with store:
        done = len(store.readings)
        if store.manifest.design != design or store.readings != readings[:done]:
            raise InputError(f"{path}: is not as it was when its import began; give another --session")
        if not store.happened(EventKind.STARTED):
            store.note(EventKind.STARTED, f"readings made elsewhere, from {path.name}")
        for reading in readings[done:]:
            store.write(reading)
        store.note(EventKind.COMPLETED)
        store.change(status=SessionStatus.COMPLETE, apparatus={"luminance meter: table": path.name})
        return len(readings), store.folder


def _design_of_table(readings: list[LuminanceReading], path: Path) -> LuminanceSweepDesign:
    counts = Counter((reading.pixel_value, reading.factor) for reading in readings)
    (value, factor), fewest = min(counts.items(), key=lambda item: item[1])
    if fewest < FEWEST_READINGS:
        level = f"pixel value {value:g}" + ("" if factor is None else f" at brightness factor {factor:g}")
        raise InputError(
            f"{path}: has {fewest} reading(s) of {level}; give at least {FEWEST_READINGS} of each level, so "
            "that noise can be told from what the display does"
        )
    values = tuple(sorted({value for value, factor in counts if factor is None}))
    factors = tuple(sorted({factor for _, factor in counts if factor is not None}))
    try:
        return LuminanceSweepDesign(
            path.stem, values, factors, fewest, settle=0.0, warm_up=0.0, drift_pixel_values=()
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None

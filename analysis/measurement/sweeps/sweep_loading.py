"""Reading a sweep: its manifest and readings, checked line by line, and whether any level is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.record_kinds import READINGS_OF_SWEEP
from evenlight.data_schema.recordings.dataset_layout import READINGS, SWEEP_MANIFEST, sweep_folders
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.sweep import (
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    SweepManifest,
    SweepPhase,
)
from evenlight.data_schema.recordings.sweep_fit import SuspectReading
from evenlight.data_schema.storage.text_files import read_json_lines, read_json_record

HALF_CODE = 0.5 / 255 + 1e-9  # of a display with 8 bits, the coarsest there is
Reading = TypeVar("Reading", LuminanceReading, PowerReading)


@dataclass(frozen=True, slots=True)
class Sweep(Generic[Reading]):
    """A sweep whose every level was read.

    Attributes
    ----------
    manifest, readings : SweepManifest, tuple of LuminanceReading or PowerReading
        What it is, and its readings in the order in which they were taken.
    inputs : dict of str to str
        SHA-256 of the manifest and of the readings, by the names of their files.
    warnings : tuple of str
        What is wrong but does not forbid the use.
    left_out, suspects : tuple of LuminanceReading or PowerReading, tuple of SuspectReading
        Readings that contradict the others, and what is said of them: `suspects.without_suspects`.
    """

    manifest: SweepManifest
    readings: tuple[Reading, ...]
    inputs: dict[str, str]
    warnings: tuple[str, ...] = ()
    left_out: tuple[Reading, ...] = ()
    suspects: tuple[SuspectReading, ...] = ()

    def of_phase(self, phase: SweepPhase) -> tuple[Reading, ...]:
        """Return the readings that were taken for one purpose."""
        return tuple(reading for reading in self.readings if reading.phase is phase)

    @property
    def complete(self) -> bool:
        """Whether all readings are there that the design asks for."""
        return _is_complete(self.manifest, (*self.readings, *self.left_out))


def load_manifest(folder: Path) -> SweepManifest:
    """Return the manifest of a sweep's folder."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected a sweep ({SWEEP_MANIFEST} and {READINGS})")
    return read_json_record(SweepManifest, folder / SWEEP_MANIFEST)


def load_luminance_sweep(folder: Path) -> Sweep[LuminanceReading]:
    """Return a luminance sweep.

    Raises
    ------
    InputError
        If a record is not as it should be, a reading is there twice or was not asked for, or a level has no
        reading at all; the message names the file, and the line or the levels.
    """
    return _load(folder, LuminanceReading)


def load_power_sweep(folder: Path) -> Sweep[PowerReading]:
    """Return a power sweep; what is refused is the same as of a luminance sweep."""
    return _load(folder, PowerReading)


def _load(folder: Path, cls: type[Reading]) -> Sweep[Reading]:
    """Return the sweep of a folder, with readings of a class."""
    manifest = load_manifest(folder)
    expected = READINGS_OF_SWEEP[manifest.task].record
    if expected is not cls:
        raise InputError(f"{folder / SWEEP_MANIFEST}: is of a {manifest.task}, which has no {cls.__name__}s")
    readings, warnings = _read_readings(folder / READINGS, cls)
    _require_each_once(readings, folder / READINGS)
    warnings += _require_every_level(manifest, readings, folder)
    if not _is_complete(manifest, readings):
        warnings.append(
            f"{folder}: the sweep is {manifest.status.value} with {_planned(readings)} of "
            f"{manifest.n_readings} readings; every level has one, and they are used (--resume takes the "
            "rest)"
        )
    inputs = {name: sha256_of_file(folder / name) for name in (SWEEP_MANIFEST, READINGS)}
    return Sweep(manifest, tuple(readings), inputs, tuple(warnings))


def _is_complete(manifest: SweepManifest, readings: Sequence[LuminanceReading | PowerReading]) -> bool:
    """Return whether all readings are there that the design asks for."""
    return manifest.status is SessionStatus.COMPLETE and _planned(readings) >= manifest.n_readings


def _planned(readings: Sequence[LuminanceReading | PowerReading]) -> int:
    """Return how many readings the design asked for, without those that repeated one at once."""
    return sum(reading.again_of is None for reading in readings)


def _read_readings(path: Path, cls: type[Reading]) -> tuple[list[Reading], list[str]]:
    """Return the readings of a file, and a warning if its last line was torn by an interruption."""
    lines, torn = read_json_lines(path, "one reading per line")
    readings = [record_from_mapping(cls, content, f"{path}, line {number}") for number, content in lines]
    return readings, [f"{path}, line {torn}: the last line is torn and was left out"] if torn else []


def _require_each_once(readings: Sequence[LuminanceReading | PowerReading], path: Path) -> None:
    """Refuse a reading that is there twice."""
    seen: set[int] = set()
    for reading in readings:
        if reading.index in seen:
            raise InputError(f"{path}: reading {reading.index} is there twice; each index may appear once")
        seen.add(reading.index)


def _require_every_level(
    manifest: SweepManifest, readings: Sequence[LuminanceReading | PowerReading], folder: Path
) -> list[str]:
    """Refuse a sweep in which a level has no reading, or a reading has a level that was not asked for.

    Brightness factors are missing as a whole where the rig had nothing to make them with; that is said.
    """
    design, remarks = manifest.design, []
    wanted = {"factor": design.factors}
    if isinstance(design, LuminanceSweepDesign):
        wanted["pixel value"] = design.pixel_values
    swept = [reading.level for reading in readings if reading.phase is SweepPhase.SWEEP]
    for name, levels in wanted.items():
        got = [level for kind, level in swept if kind == name]
        for level in got:
            if not any(_same(level, asked) for asked in levels):
                raise InputError(
                    f"{folder / READINGS}: holds the {name} {level:g}, which the design in {SWEEP_MANIFEST} "
                    "does not ask for"
                )
        missing = [asked for asked in levels if not any(_same(level, asked) for level in got)]
        if missing and not got and len(wanted) == 2 and name == "factor" and swept:
            remarks.append(f"{folder}: no brightness factors were measured; there is no brightness.csv")
        elif missing:
            raise InputError(_missing(manifest, name, missing, len(levels), folder))
    return remarks


def _missing(
    manifest: SweepManifest, name: str, missing: Sequence[float], n_levels: int, folder: Path
) -> str:
    """Return which levels a sweep lacks, and what to do."""
    few = ", ".join(f"{level:g}" for level in missing[:8]) + (", …" if len(missing) > 8 else "")
    return (
        f"{folder}: the sweep is {manifest.status.value} and has no reading of the {name}s {few} "
        f"({len(missing)} of {n_levels} levels); finish it with `evenlight run {manifest.task} --session "
        f"{manifest.session_id} --resume`"
    )


def _same(level: float, asked: float) -> bool:
    """Return whether a level is the one that was asked for, as near as the codes of a display come to it."""
    return abs(level - asked) <= HALF_CODE


@dataclass(frozen=True, slots=True)
class ChosenSweep:
    """The sweep of a task that is fitted, and those that are not.

    Attributes
    ----------
    task, folder : str, Path
        "luminance-sweep" or "power-sweep"; of the newest complete one, or of the newest, if none is complete.
    others : tuple of str
        Names of the folders of the others.
    """

    task: str
    folder: Path
    others: tuple[str, ...]


def newest_sweeps(dataset: Path) -> tuple[ChosenSweep, ...]:
    """Return the newest complete sweep of each task that a data set has sweeps of: by start, then by name."""
    chosen = []
    for task in READINGS_OF_SWEEP:
        folders = sweep_folders(dataset, task)
        if folders:
            newest = max(folders, key=_age)
            others = tuple(folder.name for folder in folders if folder != newest)
            chosen.append(ChosenSweep(task, newest, others))
    return tuple(chosen)


def _age(folder: Path) -> tuple[bool, str, str]:
    """Return what sweeps are ordered by."""
    manifest = load_manifest(folder)
    return manifest.status is SessionStatus.COMPLETE, manifest.started, folder.name

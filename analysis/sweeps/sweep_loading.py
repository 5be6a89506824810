"""Reading a sweep: checked line by line and level by level, and which of its readings contradict others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from scipy import stats

from evenlight.analysis.sweeps.repeated_readings import (
    LATE,
    Noise,
    RelativeChange,
    Repeats,
    change_at_the_end,
    late_change,
)
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
from evenlight.method.suspect_readings import CLEAR, TOLERANCES, Tolerance, suspect_readings

FEWEST_LATE = 5  # readings of the warm-up, of which a line can tell one that is off
ALIKE = 0.02  # levels that are nearer than this may read alike
DARK = 10  # times the floor of what is tolerated: below, levels may read alike
NORMAL_MAD = 0.6745  # median absolute deviation of normal noise, over its standard deviation
KINDS = {"pixel value": "L'", "factor": "b"}
PHASES = {SweepPhase.WARM_UP: "warm-up", SweepPhase.SWEEP: "sweep", SweepPhase.DRIFT: "at the end"}
IMPORTED = "csv:"  # begins the name of a table in place of a luminance meter
HALF_CODE = 0.5 / 255 + 1e-9  # of a display with 8 bits, the coarsest there is
Reading = TypeVar("Reading", LuminanceReading, PowerReading)
Quantity = Callable[[Any], float | None]  # what was read, of a reading; None if it has none


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
        Readings that contradict the others, and what is said of them: `without_suspects`.
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
    def n_planned(self) -> int:
        """How many readings the design asked for are there: without those that repeated one at once."""
        return sum(reading.again_of is None for reading in (*self.readings, *self.left_out))

    @property
    def complete(self) -> bool:
        """Whether all readings are there that the design asks for."""
        done = self.manifest.status is SessionStatus.COMPLETE
        return done and self.n_planned >= self.manifest.n_readings

    def repeats(self, phase: SweepPhase, value: Quantity, level: tuple[str, float] | None = None) -> Repeats:
        """Return one number and the time [s] of each reading of a phase, and level, that has it."""
        own = (r for r in self.of_phase(phase) if level is None or r.level == level)
        return repeats_of(own, value)

    def changes(self, value: Quantity, noise: Noise) -> tuple[RelativeChange, RelativeChange]:
        """Return the change of a number from the sweep to the repeats at the end, and late in the warm-up."""
        levels = sorted({r.level for r in self.of_phase(SweepPhase.DRIFT)})
        phases = (SweepPhase.SWEEP, SweepPhase.DRIFT)
        repeated = [[self.repeats(phase, value, level) for phase in phases] for level in levels]
        warm_up = self.repeats(SweepPhase.WARM_UP, value)
        return change_at_the_end(repeated, noise), late_change(warm_up, noise)

    def is_apart(self, value: Quantity, tolerance: Tolerance) -> bool:
        """Return whether the readings of any level in the sweep differ by more than is tolerated."""
        levels = (repeats_of(own, value) for own in by_level(self.of_phase(SweepPhase.SWEEP)))
        return any(np.ptp(own.values) > tolerance.of(own.mean) for own in levels if own.values.size)

    @property
    def n_stale(self) -> int:
        """How many readings repeat the one before to the last digit, though another level was shown.

        Then a meter, or its driver, gave an old value. One pair may be chance; in the dark, and where a
        display is as bright as it gets, levels do read alike.
        """
        most = max(self._n_stale_in(unit, tolerance) for unit, tolerance in TOLERANCES.items())
        return most if most > 1 else 0

    def _n_stale_in(self, unit: str, tolerance: Tolerance) -> int:
        """Return the number for one of the units that a reading may have."""
        every = sorted((*self.readings, *self.left_out), key=attrgetter("index"))
        own = [(r, value) for r in every if (value := r.measured.get(unit)) is not None]
        brightest = max((value for _, value in own), default=0.0)
        bright = brightest - float(tolerance.of(brightest))
        return sum(
            value == before
            and DARK * tolerance.floor < value < bright
            and reading.index == earlier.index + 1
            and reading.level[0] == earlier.level[0]
            and abs(reading.level[1] - earlier.level[1]) > ALIKE
            for (earlier, before), (reading, value) in pairwise(own)
        )


def by_level(readings: Iterable[Reading]) -> list[list[Reading]]:
    """Return the readings of each level, the levels in order."""
    level = attrgetter("level")
    return [list(own) for _, own in groupby(sorted(readings, key=level), key=level)]


def repeats_of(readings: Iterable[Any], value: Quantity) -> Repeats:
    """Return one number and the time [s] of each reading that has it."""
    pairs = [(number, (r.begun + r.ended) / 2) for r in readings if (number := value(r)) is not None]
    values = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return Repeats(values[:, 0], values[:, 1])


def load_manifest(folder: Path) -> SweepManifest:
    """Return the manifest of a sweep's folder."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected a sweep ({SWEEP_MANIFEST} and {READINGS})")
    return read_json_record(SweepManifest, folder / SWEEP_MANIFEST)


def load_sweep(folder: Path) -> Sweep[Any]:
    """Return the sweep of a folder.

    Raises
    ------
    InputError
        If a record is not as it should be, a reading is there twice or was not asked for, or a level has no
        reading at all; the message names the file, and the line or the levels.
    """
    manifest, path = load_manifest(folder), folder / READINGS
    cls = READINGS_OF_SWEEP[manifest.task].record
    lines, torn = read_json_lines(path, "one reading per line")
    readings = [record_from_mapping(cls, content, f"{path}, line {number}") for number, content in lines]
    warnings = [f"{path}, line {torn}: the last line is torn and was left out"] if torn else []
    for index, times in Counter(reading.index for reading in readings).items():
        if times > 1:
            raise InputError(f"{path}: reading {index} is there twice; each index may appear once")
    warnings += _require_every_level(manifest, readings, folder)
    inputs = {name: sha256_of_file(folder / name) for name in (SWEEP_MANIFEST, READINGS)}
    sweep = Sweep(manifest, tuple(readings), inputs)
    if not sweep.complete:
        warnings.append(
            f"{folder}: the sweep is {manifest.status.value} with {sweep.n_planned} of "
            f"{manifest.n_readings} readings; every level has one, and they are used (--resume takes the "
            "rest)"
        )
    return replace(sweep, warnings=tuple(warnings))


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
            if not any(abs(level - asked) <= HALF_CODE for asked in levels):
                raise InputError(
                    f"{folder / READINGS}: holds the {name} {level:g}, which the design in {SWEEP_MANIFEST} "
                    "does not ask for"
                )
        missing = [asked for asked in levels if not any(abs(level - asked) <= HALF_CODE for level in got)]
        if missing and not got and len(wanted) == 2 and name == "factor" and swept:
            remarks.append(f"{folder}: no brightness factors were measured; there is no brightness.csv")
        elif missing:
            few = ", ".join(f"{level:g}" for level in missing[:8]) + (", …" if len(missing) > 8 else "")
            raise InputError(
                f"{folder}: the sweep is {manifest.status.value} and has no reading of the {name}s {few} "
                f"({len(missing)} of {len(levels)} levels); finish it with `evenlight run {manifest.task} "
                f"--session {manifest.session_id} --resume`"
            )
    return remarks


def without_suspects(sweep: Sweep[Reading]) -> Sweep[Reading]:
    """Return a sweep whose readings do not contradict each other; those left out stand beside them."""
    found: list[SuspectReading] = []
    for unit in TOLERANCES:
        measured = [reading for reading in sweep.readings if unit in reading.measured]
        for kind in KINDS:
            own = [r for r in measured if r.level[0] == kind and r.phase is not SweepPhase.WARM_UP]
            found.extend(_swept(sweep, own, unit))
        found.extend(_warming_up(sweep, [r for r in measured if r.phase is SweepPhase.WARM_UP], unit))
    out = {each.index for each in found if each.left_out}
    return replace(
        sweep,
        readings=tuple(reading for reading in sweep.readings if reading.index not in out),
        left_out=tuple(reading for reading in sweep.readings if reading.index in out),
        suspects=tuple(sorted(found, key=lambda each: each.index)),
    )


def _swept(sweep: Sweep[Reading], own: Sequence[Reading], unit: str) -> Iterator[SuspectReading]:
    values = np.array([r.measured[unit] for r in own], dtype=np.float64)
    levels = np.array([r.level[1] for r in own])
    found = suspect_readings(values, levels, TOLERANCES[unit])
    for place in np.flatnonzero(found.left_out | found.out_of_order):
        count = (levels == levels[place]) & ~found.left_out & ~np.isnan(values)
        others = float(np.median(values[count])) if count.any() else None
        yield _named(sweep, own[int(place)], (unit, others), out=bool(found.left_out[place]))


def _warming_up(sweep: Sweep[Reading], warm: Sequence[Reading], unit: str) -> Iterator[SuspectReading]:
    """Return which readings late in the warm-up lie off the line of Theil and Sen through them.

    Those before tell nothing that is used.
    """
    told = [r for r in warm if r.measured[unit] is not None]
    late = [r for r in told if r.ended >= LATE * told[-1].ended]
    values, times = np.array([r.measured[unit] for r in late], dtype=np.float64), [r.ended for r in late]
    if len(late) < FEWEST_LATE or len(set(times)) < len(late):
        return
    line = float(stats.theilslopes(values, times)[0]) * np.array(times)
    line += np.median(values - line)
    off = np.abs(values - line)
    fits = off <= np.maximum(TOLERANCES[unit].of(line), CLEAR * float(np.median(off)) / NORMAL_MAD)
    for place in np.flatnonzero(~fits):
        yield _named(sweep, late[int(place)], (unit, float(np.median(values[fits]))), out=True)


def _named(
    sweep: Sweep[Reading], reading: Reading, compared: tuple[str, float | None], *, out: bool
) -> SuspectReading:
    """Return the record of a suspect reading; `compared` is the unit, and what its level is otherwise."""
    (unit, others), table = compared, sweep.manifest.rig.luminance_meter
    row = f"line {sweep.readings.index(reading) + 1} of {READINGS}"
    if table.startswith(IMPORTED) and reading.meter_status.startswith("line "):
        row = f"{reading.meter_status} of {Path(table.removeprefix(IMPORTED)).name}"
    kind, level = reading.level
    again = [r.measured[unit] for r in sweep.readings if r.again_of == reading.index]
    read = ", ".join("too dark" if value is None else f"{value:.5g}" for value in again)
    return SuspectReading(
        index=reading.index,
        row=row,
        level=f"{KINDS[kind]} = {level:.4g}, {PHASES[reading.phase]}, reading {reading.repeat}"
        + (f", read again at once: {read}" if read else ""),
        value=reading.measured[unit],
        unit=unit,
        others=others,
        left_out=out,
    )


def newest_sweeps(dataset: Path) -> dict[Path, tuple[str, ...]]:
    """Return the sweeps of a data set that are fitted, and the names of the others of the same task.

    Of each task, that is the newest complete one, or the newest, if none is complete: by start, then by name.
    """
    chosen = {}
    for task in READINGS_OF_SWEEP:
        if folders := sweep_folders(dataset, task):
            newest = max(folders, key=_age)
            chosen[newest] = tuple(folder.name for folder in folders if folder != newest)
    return chosen


def _age(folder: Path) -> tuple[bool, str, str]:
    manifest = load_manifest(folder)
    return manifest.status is SessionStatus.COMPLETE, manifest.started, folder.name

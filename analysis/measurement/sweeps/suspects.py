"""The readings of a sweep that contradict the others: named by their row, and left out of its fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from evenlight.analysis.measurement.sweeps.repeated_readings import LATE
from evenlight.analysis.measurement.sweeps.sweep_loading import Reading, Sweep
from evenlight.data_schema.recordings.dataset_layout import READINGS
from evenlight.data_schema.recordings.sweep import SweepPhase
from evenlight.data_schema.recordings.sweep_fit import SuspectReading
from evenlight.method.suspect_readings import CLEAR, TOLERANCES, suspect_readings

FEWEST_LATE = 5  # readings of the warm-up, of which a line can tell one that is off
NORMAL_MAD = 0.6745  # median absolute deviation of normal noise, over its standard deviation
KINDS = {"pixel value": "L'", "factor": "b"}
IMPORTED = "csv:"  # begins the name of a table in place of a luminance meter


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
    """Return which readings of some levels contradict the others."""
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
    when = {SweepPhase.WARM_UP: "warm-up", SweepPhase.SWEEP: "sweep", SweepPhase.DRIFT: "at the end"}
    return SuspectReading(
        index=reading.index,
        row=row,
        level=f"{KINDS[kind]} = {level:.4g}, {when[reading.phase]}, reading {reading.repeat}"
        + (f", read again at once: {read}" if read else ""),
        value=reading.measured[unit],
        unit=unit,
        others=others,
        left_out=out,
    )


def in_words(suspects: Sequence[SuspectReading], most: int = 5) -> str:
    """Return suspect readings in words, each with its row and what the others of its level are."""
    words = []
    for each in suspects[:most]:
        value = "too dark for the meter" if each.value is None else f"{each.value:.5g} {each.unit}"
        if each.left_out:
            others = (
                "and no two readings of its level agree"
                if each.others is None
                else f"where the others of its level have {each.others:.5g}"
            )
        else:
            others = "agrees with its level, which is out of order with its neighbours, and counts"
        words.append(f"{each.row} ({each.level}): {value}, {others}")
    more = len(suspects) - most
    return "; ".join(words) + (f"; and {more} more, in the json file" if more > 0 else "")

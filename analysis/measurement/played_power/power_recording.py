"""The recording of a played video's power, read and checked: samples (lost, doubled), flips, pings."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import (
    CLOCK_PINGS,
    FLASHES,
    FLIPS,
    POWER_LOG,
    POWER_SAMPLES,
)
from evenlight.data_schema.recordings.instrument_logs import (
    ClockPing,
    FlashMark,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.recordings.played_power import SampleCount
from evenlight.data_schema.storage.tables import columns_of, optional_columns, read_rows
from evenlight.data_schema.storage.text_files import read_json_record, read_text

STALL = 3.0  # intervals between two samples in succession: the meter has not measured all that time


@dataclass(frozen=True, slots=True, eq=False)
class Flips:
    """What was shown when: a place for each refresh that showed a frame.

    Attributes
    ----------
    pass_index, video_frame : array of int, (N,)
        Which time through the video, and which frame of it.
    version, factor : array of str, (N,), array, (N,)
        How it was dimmed, and the brightness factor b that was achieved.
    flip, sync : array, (N,), array of bool, (N,)
        When it appeared, on the computer's clock, rising [s]; level of the synchronisation line from then on.
    """

    pass_index: NDArray[np.int64]
    video_frame: NDArray[np.int64]
    version: NDArray[np.str_]
    flip: Array
    factor: Array
    sync: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A played video and the power samples that came meanwhile.

    Attributes
    ----------
    log, flips, flashes : PowerLog, Flips, sequence of FlashMark
        What it was measured on, what was shown, and the markers, in order.
    samples, n_duplicated : Samples, int
        Each sample once, in the meter's order, and how many came again.
    pings : array, (N, 3)
        Sent, the meter's time, received [s].
    where : str
        The file of the samples, for messages.
    """

    log: PowerLog
    samples: Samples
    n_duplicated: int
    pings: Array
    flips: Flips
    flashes: Sequence[FlashMark]
    where: str


def load_recording(folder: Path) -> Recording:
    """Return what is in the folder of a played video's power.

    Raises
    ------
    InputError
        If a file is missing, torn or contradicts itself; it names the file and the line.
    """
    log = read_json_record(PowerLog, folder / POWER_LOG)
    samples, n_duplicated = samples_once(_read_samples(folder / POWER_SAMPLES), folder / POWER_SAMPLES)
    pings = [] if not (folder / CLOCK_PINGS).exists() else read_rows(ClockPing, folder / CLOCK_PINGS)
    flashes = [] if not (folder / FLASHES).exists() else read_rows(FlashMark, folder / FLASHES)
    _require_rising([mark.time for mark in flashes], folder / FLASHES, "time_s")
    return Recording(
        log=log,
        samples=samples,
        n_duplicated=n_duplicated,
        pings=np.array([(p.sent, p.device_time, p.received) for p in pings]).reshape(-1, 3),
        flips=_read_flips(folder / FLIPS, log),
        flashes=flashes,
        where=str(folder / POWER_SAMPLES),
    )


def _read_samples(path: Path) -> Samples:
    """Return the samples of a table as they came.

    There may be millions, so they are read as columns; a table in which anything is odd is read once more,
    row by row, for the line and the reason.
    """
    columns = _columns(path)
    if columns is None:
        rows = read_rows(PowerSample, path)
        columns = {name: np.array([getattr(row, name) for row in rows]) for name in _KINDS}
    return Samples(**columns)


_KINDS: dict[str, Any] = {
    "sequence": np.int64,
    "device_time": np.float64,
    "received": np.float64,
    "power": np.float64,
    "sync": np.bool_,
}


def _columns(path: Path) -> dict[str, NDArray[Any]] | None:
    """Return the columns of a table of samples; None where it is not plainly one."""
    import pandas as pd

    keys = dict(zip(_KINDS, columns_of(PowerSample), strict=True))
    header = next(csv.reader([read_text(path, "a power sample table").partition("\n")[0]]), [])
    if set(header) | optional_columns(PowerSample) != set(keys.values()) or len(set(header)) < len(header):
        return None
    kinds = {keys[name]: kind for name, kind in _KINDS.items() if keys[name] in header}
    try:
        table = pd.read_csv(path, dtype=kinds, encoding="utf-8-sig")
    except (ValueError, OSError, OverflowError):  # a parser's error is a ValueError
        return None
    # A row with a cell too many would make pandas take the first column for an index.
    if len(table) == 0 or not isinstance(table.index, pd.RangeIndex):
        return None
    found = {name: table[key].to_numpy() for name, key in keys.items() if key in table}
    found.setdefault("sync", np.zeros(len(table), dtype=bool))
    plain = all(np.isfinite(found[name]).all() for name in ("device_time", "received", "power"))
    return found if plain and found["sequence"].min() >= 0 else None


def _read_flips(path: Path, log: PowerLog) -> Flips:
    """Return what was shown, checked against the log's order of passes."""
    rows = read_rows(PlayedFlip, path)
    if not rows:
        raise InputError(f"{path}: holds no flip, so nothing was played; expected a row for each refresh")
    _require_rising([row.flip for row in rows], path, "flip_s")
    for line, row in enumerate(rows, start=2):
        before = rows[line - 3] if line > 2 else row
        if row.pass_index < before.pass_index:
            raise InputError(f"{path}, line {line}: pass {row.pass_index} comes after {before.pass_index}")
        if row.pass_index == before.pass_index and row.video_frame < before.video_frame:
            raise InputError(
                f"{path}, line {line}: frame {row.video_frame} comes after {before.video_frame} in the same "
                "pass; expected the frames of a video in their order"
            )
        if row.pass_index >= len(log.passes) or log.passes[row.pass_index] != row.version:
            planned = log.passes[row.pass_index] if row.pass_index < len(log.passes) else "no such pass"
            raise InputError(
                f"{path}, line {line}: pass {row.pass_index} is {row.version!r}, but {planned!r} in "
                f"{POWER_LOG}"
            )
    return Flips(
        pass_index=np.array([row.pass_index for row in rows]),
        video_frame=np.array([row.video_frame for row in rows]),
        version=np.array([row.version for row in rows]),
        flip=np.array([row.flip for row in rows]),
        factor=np.array([row.achieved_factor for row in rows]),
        sync=np.array([row.sync for row in rows]),
    )


def _require_rising(times: Sequence[float], path: Path, key: str) -> None:
    """Refuse times of which one is not after the one before."""
    for line, (before, time) in enumerate(pairwise(times), start=3):
        if time <= before:
            raise InputError(
                f"{path}, line {line}: {key} {time:.6f} is not after {before:.6f} in the line before"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of a power meter, as columns.

    Attributes
    ----------
    sequence : array of int, (N,)
        The meter's own count.
    device_time, received : array, (N,)
        When, on the meter's clock, and when they had arrived, on the computer's [s].
    power, sync : array, (N,), array of bool, (N,)
        Mean power since the sample before [W], and the level of the synchronisation input at that moment.
    """

    sequence: NDArray[np.int64]
    device_time: Array
    received: Array
    power: Array
    sync: NDArray[np.bool_]

    @property
    def interval(self) -> float:
        """Time from one sample to the next, its median [s]."""
        return float(np.median(np.diff(self.device_time) / np.diff(self.sequence)))


def samples_once(samples: Samples, where: Path | str) -> tuple[Samples, int]:
    """Return each sample once, and how many came again.

    Parameters
    ----------
    samples : Samples
        As they came.
    where : Path or str
        The file, whose first sample is in line 2, for messages.

    Raises
    ------
    InputError
        If the count goes back to a sample that had not come, a sample comes again with other content, the
        meter's clock does not run on, or there are fewer than two samples.
    """
    new = np.ones(len(samples.sequence), dtype=bool)
    new[1:] = samples.sequence[1:] > np.maximum.accumulate(samples.sequence)[:-1]
    once = _chosen(samples, new)
    for row in np.flatnonzero(~new):
        first = int(np.searchsorted(once.sequence, samples.sequence[row]))
        number, line = int(samples.sequence[row]), int(row) + 2
        if once.sequence[first] != number:
            raise InputError(
                f"{where}, line {line}: sequence {number} comes after higher ones and is no repetition; "
                "did the meter restart? Measure again, in one go"
            )
        if (once.device_time[first], once.power[first]) != (samples.device_time[row], samples.power[row]):
            raise InputError(f"{where}, line {line}: sequence {number} is there twice, with another content")
    if len(once.sequence) < 2:
        raise InputError(f"{where}: holds {len(once.sequence)} sample(s); expected those of a whole playing")
    stuck = np.flatnonzero(np.diff(once.device_time) <= 0)
    if len(stuck):
        at = int(np.flatnonzero(new)[stuck[0] + 1]) + 2
        before, time = once.device_time[stuck[0] : stuck[0] + 2]
        raise InputError(
            f"{where}, line {at}: device_time_s {time:.6f} is not after {before:.6f} of the sample before; "
            "the meter's clock must run on"
        )
    return once, int((~new).sum())


def _chosen(samples: Samples, rows: NDArray[np.bool_]) -> Samples:
    """Return some of the samples."""
    return Samples(
        samples.sequence[rows],
        samples.device_time[rows],
        samples.received[rows],
        samples.power[rows],
        samples.sync[rows],
    )


@dataclass(frozen=True, slots=True, eq=False)
class EnergyKnots:
    """Energy since the first sample, at the ends of samples and gaps.

    Attributes
    ----------
    times, energy : array, (K,)
        When, on the meter's clock [s], and the energy from the first time to this one [J].
    sample_times : array, (N,)
        When the samples ended [s].
    gap_starts, gap_ends : array, (G,)
        Times without a sample, in which power was interpolated [s].
    """

    times: Array
    energy: Array
    sample_times: Array
    gap_starts: Array
    gap_ends: Array


def energy_knots(samples: Samples) -> EnergyKnots:
    """Return the energy at the end of each sample.

    A sample is the mean since the sample before, so that mean times interval is the energy of the interval,
    whatever the power did in it. A lost sample takes its energy with it: in its time, power is the mean of
    the samples before and after.

    Parameters
    ----------
    samples : Samples
        Each once.

    >>> ones = np.ones(3)
    >>> count, time = np.array([1, 2, 4]), np.array([1.0, 2.0, 4.0])
    >>> knots = energy_knots(Samples(count, time, ones, np.array([5.0, 1.0, 3.0]), ones > 0))
    >>> knots.times.tolist(), knots.energy.tolist()
    ([1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 3.0, 6.0])
    """
    time, power = samples.device_time, samples.power
    steps, counts = np.diff(time), np.diff(samples.sequence)
    own = steps / counts
    stalled = own > STALL * samples.interval
    own[stalled] = samples.interval
    is_gap = (counts > 1) | stalled
    gap_ends = (time[1:] - own)[is_gap]
    # Without a gap only the sample's own stretch; with one, the gap's before it.
    lengths = np.column_stack([steps - own, own])
    powers = np.column_stack([(power[:-1] + power[1:]) / 2, power[1:]])
    kept = np.column_stack([is_gap, np.ones_like(is_gap)])
    energy = np.cumsum((lengths * powers)[kept])
    ends = np.column_stack([time[1:] - own, time[1:]])[kept]
    return EnergyKnots(
        times=np.append(time[0], ends),
        energy=np.append(0.0, energy),
        sample_times=time,
        gap_starts=time[:-1][is_gap],
        gap_ends=gap_ends,
    )


def count_samples(samples: Samples, n_duplicated: int) -> SampleCount:
    """Return which samples came.

    Parameters
    ----------
    samples : Samples
        Each once.
    n_duplicated : int
        How many came again.
    """
    knots = energy_knots(samples)
    gaps = knots.gap_ends - knots.gap_starts
    duration = float(samples.device_time[-1] - samples.device_time[0])
    return SampleCount(
        n_samples=len(samples.sequence),
        n_lost=int((np.diff(samples.sequence) - 1).sum()),
        n_duplicated=n_duplicated,
        duration=duration,
        bridged_share=float(gaps.sum() / duration),
        longest_gap=float(gaps.max(initial=0.0)),
    )

"""The recording of a played video's power, read and checked: samples (lost, doubled), flips, pings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
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
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.tables import columns_of, optional_columns, read_rows
from evenlight.data_schema.storage.text_files import read_json_record

STALL = 3.0  # intervals between two samples in succession: the meter has not measured all that time


class Samples(NamedTuple):
    """Samples of a power meter, as columns of (N,)."""

    sequence: NDArray[np.int64]  # the meter's own count
    device_time: Array  # when, on the meter's clock [s]
    received: Array  # when they had arrived, on the computer's [s]
    power: Array  # mean power since the sample before [W]
    sync: NDArray[np.bool_]  # level of the synchronisation input at that moment

    @property
    def interval(self) -> float:
        """Time from one sample to the next, its median [s]."""
        return float(np.median(np.diff(self.device_time) / np.diff(self.sequence)))


class Flips(NamedTuple):
    """What was shown when: a place for each refresh that showed a frame, as columns of (N,)."""

    pass_index: NDArray[np.int64]  # which time through the video
    video_frame: NDArray[np.int64]
    version: NDArray[np.str_]  # how it was dimmed
    flip: Array  # when it appeared, on the computer's clock, rising [s]
    achieved_factor: Array  # b
    sync: NDArray[np.bool_]  # level of the synchronisation line from then on


Columns = TypeVar("Columns", Samples, Flips)


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
    where, inputs : str, dict of str to str
        The file of the samples, for messages, and SHA-256 of all files by their names.
    """

    log: PowerLog
    samples: Samples
    n_duplicated: int
    pings: Array
    flips: Flips
    flashes: Sequence[FlashMark]
    where: str
    inputs: Mapping[str, str] = field(default_factory=dict)


def load_recording(folder: Path) -> Recording:
    """Return what is in the folder of a played video's power.

    Raises
    ------
    InputError
        If a file is missing, torn or contradicts itself; it names the file and the line.
    """
    log = read_json_record(PowerLog, folder / POWER_LOG)
    samples, n_duplicated = samples_once(_read_samples(folder / POWER_SAMPLES), folder / POWER_SAMPLES)
    pings = read_rows(ClockPing, folder / CLOCK_PINGS) if (folder / CLOCK_PINGS).exists() else []
    flashes = read_rows(FlashMark, folder / FLASHES) if (folder / FLASHES).exists() else []
    _require_rising([mark.time for mark in flashes], folder / FLASHES, "time_s")
    names = (POWER_LOG, POWER_SAMPLES, CLOCK_PINGS, FLIPS, FLASHES)
    return Recording(
        log=log,
        samples=samples,
        n_duplicated=n_duplicated,
        pings=np.array([(p.sent, p.device_time, p.received) for p in pings]).reshape(-1, 3),
        flips=_read_flips(folder / FLIPS, log),
        flashes=flashes,
        where=str(folder / POWER_SAMPLES),
        inputs={name: sha256_of_file(folder / name) for name in names if (folder / name).exists()},
    )


def _read_samples(path: Path) -> Samples:
    """Return the samples of a table as they came.

    There may be millions, so they are read as columns; a table in which anything is odd is read once more,
    row by row, for the line and the reason.
    """
    return _columns(path) or _of_rows(Samples, read_rows(PowerSample, path))


def _columns(path: Path) -> Samples | None:
    """Return the samples of a table; None where it is not plainly one."""
    import pandas as pd

    keys = dict(zip(Samples._fields, columns_of(PowerSample), strict=True))
    kinds = dict.fromkeys(keys.values(), np.float64) | {keys["sequence"]: np.int64, keys["sync"]: np.bool_}
    try:
        with open_input(path, "a power sample table") as stream, np.errstate(invalid="raise"):
            table = pd.read_csv(stream, dtype=kinds, encoding="utf-8-sig", skip_blank_lines=False)
    except (ValueError, OSError, ArithmeticError):  # a parser's error is a ValueError
        return None
    # Of two columns with one name, pandas renames the second; a row with a cell too many would make it take
    # the first column for an index.
    named = set(table) | optional_columns(PowerSample) == set(keys.values())
    if not named or len(table) == 0 or not isinstance(table.index, pd.RangeIndex):
        return None
    table = table.assign(**{keys["sync"]: table.get(keys["sync"], False)})
    found = Samples(*(table[key].to_numpy() for key in keys.values()))
    plain = all(np.isfinite(column).all() for column in (found.device_time, found.received, found.power))
    return found if plain and found.sequence.min() >= 0 else None


def _of_rows(kind: type[Columns], rows: Sequence[Any]) -> Columns:
    return kind(*(np.array([getattr(row, name) for row in rows]) for name in kind._fields))


def _read_flips(path: Path, log: PowerLog) -> Flips:
    """Return what was shown, checked against the log's order of passes."""
    rows = read_rows(PlayedFlip, path)
    if not rows:
        raise InputError(f"{path}: holds no flip, so nothing was played; expected a row for each refresh")
    _require_rising([row.flip for row in rows], path, "flip_s")
    planned_of = dict(enumerate(log.passes))
    for line, (before, row) in enumerate(pairwise([rows[0], *rows]), start=2):
        planned = planned_of.get(row.pass_index, "no such pass")
        if row.pass_index < before.pass_index:
            raise InputError(f"{path}, line {line}: pass {row.pass_index} comes after {before.pass_index}")
        if row.pass_index == before.pass_index and row.video_frame < before.video_frame:
            raise InputError(
                f"{path}, line {line}: frame {row.video_frame} comes after {before.video_frame} in the same "
                "pass; expected the frames of a video in their order"
            )
        if row.version != planned:
            raise InputError(
                f"{path}, line {line}: pass {row.pass_index} is {row.version!r}, but {planned!r} in "
                f"{POWER_LOG}"
            )
    return _of_rows(Flips, rows)


def _require_rising(times: Sequence[float], path: Path, key: str) -> None:
    for line, (before, time) in enumerate(pairwise(times), start=3):
        if time <= before:
            raise InputError(
                f"{path}, line {line}: {key} {time:.6f} is not after {before:.6f} in the line before"
            )


def samples_once(samples: Samples, where: Path | str) -> tuple[Samples, int]:
    """Return each sample once, and how many came again.

    Parameters
    ----------
    samples, where : Samples, Path or str
        As they came, and the file, whose first sample is in line 2, for messages.

    Raises
    ------
    InputError
        If the count goes back to a sample that had not come, a sample comes again with other content, the
        meter's clock does not run on, or there are fewer than two samples.
    """
    new = np.ones(len(samples.sequence), dtype=bool)
    new[1:] = samples.sequence[1:] > np.maximum.accumulate(samples.sequence)[:-1]
    chosen: Iterator[Any] = (column[new] for column in samples)
    once = Samples(*chosen)
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


class EnergyKnots(NamedTuple):
    """Energy since the first sample, at the ends of samples and gaps."""

    times: Array  # (K,): when, on the meter's clock [s]
    energy: Array  # (K,): from the first time to this one [J]
    gap_starts: Array  # (G,): times without a sample, in which power was interpolated [s]
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
        gap_starts=time[:-1][is_gap],
        gap_ends=gap_ends,
    )


def count_samples(samples: Samples, n_duplicated: int) -> SampleCount:
    """Return which samples came, of samples that are there once and the number of those that came again."""
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

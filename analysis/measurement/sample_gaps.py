"""Lost and duplicated samples of a power meter, and the energy that they leave known and unknown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame_energy import SampleCount

STALL = 3.0  # intervals between two samples in succession: the meter has not measured all that time


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of a power meter, as columns.

    Attributes
    ----------
    sequence : array of int, (N,)
        The meter's own count.
    device_time : array, (N,)
        When, on the meter's clock [s].
    received : array, (N,)
        When they had arrived, on the computer's clock [s].
    power : array, (N,)
        Mean power since the sample before [W].
    sync : array of bool, (N,)
        Level of the synchronisation input at that moment.
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
                f"{where}, line {line}: sequence {number} comes after higher ones and is no repetition; was "
                "the meter started anew? Measure again, in one go"
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
    times : array, (K,)
        When, on the meter's clock [s].
    energy : array, (K,)
        Energy from the first time to this one, on the meter's clock [J].
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

"""Energy of each frame of a played video: the integral of power from its flip to the next frame's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from evenlight.analysis.measurement.clock_line import ClockLine
from evenlight.analysis.measurement.power_recording import Flips
from evenlight.analysis.measurement.sample_gaps import Samples, energy_knots
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame_energy import LEFT_OUT, FrameEnergy, FrameFlag

LONGEST_BRIDGE = 0.05  # [s] power may do anything in a longer time without samples


@dataclass(frozen=True, slots=True, eq=False)
class FrameSpans:
    """Frames as they were shown.

    Attributes
    ----------
    pass_index, video_frame : array of int, (N,)
        Which time through the video, and which frame of it.
    version : array of str, (N,)
        How it was dimmed.
    begun, ended : array, (N,)
        When it appeared and when it had gone, on the computer's clock [s].
    factor : array, (N,)
        Brightness factor b that was achieved, its mean over that time.
    """

    pass_index: NDArray[np.int64]
    video_frame: NDArray[np.int64]
    version: NDArray[np.str_]
    begun: Array
    ended: Array
    factor: Array


def frame_spans(flips: Flips, refresh_rate: float) -> FrameSpans:
    """Return the frames that some refreshes showed.

    A frame lasts until the next one appears; the last one of a pass until the refresh after its last flip.
    After a dropped refresh that is longer, and so is the frame.

    Parameters
    ----------
    flips : Flips
        What was shown when.
    refresh_rate : float
        Of the display [Hz].
    """
    new_pass = np.append(True, np.diff(flips.pass_index) != 0)
    first = np.flatnonzero(new_pass | np.append(True, np.diff(flips.video_frame) != 0))
    following = np.append(flips.flip[1:], np.inf)
    last_of_pass = np.append(new_pass[1:], True)
    ends = np.where(last_of_pass, np.minimum(flips.flip + 1 / refresh_rate, following), following)
    lasts = ends - flips.flip
    sums = np.add.reduceat(flips.factor * lasts, first)
    return FrameSpans(
        pass_index=flips.pass_index[first],
        video_frame=flips.video_frame[first],
        version=flips.version[first],
        begun=flips.flip[first],
        ended=ends[np.append(first[1:], len(ends)) - 1],
        factor=np.clip(sums / np.add.reduceat(lasts, first), 0.0, 1.0),
    )


def frame_energies(samples: Samples, spans: FrameSpans, line: ClockLine) -> list[FrameEnergy]:
    """Return the energy of each frame.

    Energy is known at the end of each sample, as samples are means since the sample before. Between, it is
    interpolated by a cubic that rises where it does (PCHIP): power then has no steps, and the mean of each
    sample is kept. Where samples are longer than frames, that would make waves that nobody has measured, and
    energy is interpolated linearly: a frame has its share of a mean.

    Parameters
    ----------
    samples : Samples
        Each once.
    spans : FrameSpans
        The frames, on the computer's clock.
    line : ClockLine
        The meter's clock on the computer's.
    """
    knots = energy_knots(samples)
    times, energy = line.to_computer(knots.times), knots.energy * (1 + line.drift)
    covered = (spans.begun >= times[0]) & (spans.ended <= times[-1])
    begun, ended = (np.clip(edge, times[0], times[-1]) for edge in (spans.begun, spans.ended))
    if samples.interval < np.median(spans.ended - spans.begun):
        curve = PchipInterpolator(times - times[0], energy)
        energies = curve(ended - times[0]) - curve(begun - times[0])
    else:
        energies = np.interp(ended, times, energy) - np.interp(begun, times, energy)
    starts, ends = line.to_computer(knots.gap_starts), line.to_computer(knots.gap_ends)
    long = ends - starts > LONGEST_BRIDGE
    bridged = _overlap(begun, ended, starts, ends)
    in_long = _overlap(begun, ended, starts[long], ends[long])
    sampled = np.searchsorted(line.to_computer(knots.sample_times), np.stack([begun, ended]), side="right")
    unresolved = (sampled[1] == sampled[0]) | (spans.ended - spans.begun < samples.interval)
    kinds = np.select([~covered, in_long > 0, unresolved], [0, 1, 2], 3)
    order = (FrameFlag.OUTSIDE, FrameFlag.GAP, FrameFlag.UNRESOLVED, FrameFlag.OK)
    return _records(spans, energies, bridged, sampled[1] - sampled[0], [order[kind] for kind in kinds])


def _overlap(begun: Array, ended: Array, starts: Array, ends: Array) -> Array:
    """Return how long some spans overlap gaps that do not overlap each other [s]."""
    if len(starts) == 0:
        return np.zeros(len(begun))
    corners = np.column_stack([starts, ends]).ravel()
    inside = np.column_stack([np.cumsum(ends - starts) - (ends - starts), np.cumsum(ends - starts)]).ravel()
    return np.asarray(np.interp(ended, corners, inside) - np.interp(begun, corners, inside))


def _records(
    spans: FrameSpans, energies: Array, bridged: Array, counts: NDArray[np.int64], flags: Sequence[FrameFlag]
) -> list[FrameEnergy]:
    """Return the energies as records."""
    lasts = spans.ended - spans.begun
    return [
        FrameEnergy(
            pass_index=int(spans.pass_index[k]),
            version=str(spans.version[k]),
            video_frame=int(spans.video_frame[k]),
            begun=float(spans.begun[k]),
            duration=float(lasts[k]),
            energy=None if flag in LEFT_OUT else float(energies[k]),
            power=None if flag in LEFT_OUT else float(energies[k] / lasts[k]),
            factor=float(spans.factor[k]),
            n_samples=int(counts[k]),
            bridged_share=float(np.clip(bridged[k] / lasts[k], 0.0, 1.0)),
            flag=flag,
        )
        for k, flag in enumerate(flags)
    ]

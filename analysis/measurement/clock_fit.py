"""The meter's clock on the computer's: by edges, pings, flash markers or arrivals, whatever there is."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.measurement.arrival_clock import carries_computer_time, computer_time, fit_arrivals
from evenlight.analysis.measurement.clock_line import ClockEstimate
from evenlight.analysis.measurement.flash_marks import fit_flashes
from evenlight.analysis.measurement.ping_clock import fit_pings
from evenlight.analysis.measurement.power_recording import Flips, Recording
from evenlight.analysis.measurement.sync_edges import LATE_FLIP, Changes, fit_edges
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame_energy import ClockFit, ClockFlag

DISAGREEMENT = 0.2  # share of pings that the edges' clock may miss


def fit_clock(recording: Recording) -> ClockFit:
    """Return the meter's clock on the computer's, by the best that there is.

    Edges of the synchronisation input come first, then pings, then flash markers; then samples that carry the
    computer's time, or their arrival. What was there and could not be used is in the flags.

    Parameters
    ----------
    recording : Recording
        What was recorded.
    """
    samples, flips = recording.samples, recording.flips
    played = (float(flips.flip[0]), float(flips.flip[-1]))
    arrivals = fit_arrivals(samples)
    stretch = arrivals.line.to_meter(played)
    pings = fit_pings(recording.pings, (stretch[0], stretch[1])) if len(recording.pings) else None
    flashes = None if pings else fit_flashes(samples, recording.flashes, played, arrivals)
    flags: tuple[ClockFlag, ...] = ()
    if recording.log.sync_connected:
        edges = fit_edges(samples, changes_of(flips), pings or flashes or arrivals)
        if isinstance(edges, ClockEstimate):
            return edges.record(_doubts(edges, recording.pings))
        flags = (edges,)
    if best := pings or flashes:
        return best.record(flags)
    if recording.flashes:
        flags = (*flags, ClockFlag.FLASHES_NOT_FOUND)
    if carries_computer_time(samples):
        return computer_time(samples).record(flags)
    return arrivals.record(flags)


def changes_of(flips: Flips) -> Changes:
    """Return when the synchronisation line changed with the frames shown."""
    at = np.flatnonzero(flips.sync[1:] != flips.sync[:-1]) + 1
    return Changes(flips.flip[at], flips.sync[at])


def _doubts(edges: ClockEstimate, pings: Array) -> tuple[ClockFlag, ...]:
    """Return a flag if the pings say otherwise than the edges."""
    if len(pings) == 0 or ClockFlag.DISAGREES in edges.flags:
        return ()
    told = edges.line.to_computer(pings[:, 1])
    off = np.maximum(pings[:, 0] - told, told - pings[:, 2])
    return (ClockFlag.DISAGREES,) * bool((off > (edges.bound or 0.0) + LATE_FLIP).mean() > DISAGREEMENT)

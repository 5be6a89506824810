"""A meter's clock from pings: the line with the most room between all questions and their answers."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.measurement.clock_line import ClockEstimate
from evenlight.analysis.measurement.clock_windows import MOST_DRIFT, ClockWindows
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame_energy import ClockFlag, ClockMethod

VAGUE_DRIFT = 0.001  # a range of drifts wider than this says nothing about a clock with a crystal
MOST_ODD = 0.2  # share of pings that may contradict the others


def fit_pings(pings: Array, stretch: tuple[float, float]) -> ClockEstimate:
    """Return the meter's clock by its pings.

    The meter told its time after the question and before the answer, so each ping is a window that the line
    goes through, the narrower the quicker the answer came (Cristian 1989). Of the lines that do, the one is
    taken that stays farthest from the windows' ends: slow pings do not bear on it. The others say how far off
    it may be.

    Parameters
    ----------
    pings : array, (N, 3)
        Sent, the meter's time, received [s]; at least one.
    stretch : (float, float)
        First and last time on the meter's clock at which it is to hold [s].
    """
    odd = _windows(pings).missed() if _windows(pings).middle()[1] < 0 else np.zeros(len(pings), dtype=bool)
    linear = bool(odd.mean() <= MOST_ODD)
    windows = _windows(pings[~odd]) if linear else _windows(pings)
    slowest, fastest = windows.drifts()
    vague = linear and fastest - slowest > VAGUE_DRIFT and slowest <= 0 <= fastest
    line, room = windows.middle(0.0 if vague else MOST_DRIFT)
    bound = windows.bound(line, stretch) if linear else float(windows.half_widths.max() - min(room, 0.0))
    return ClockEstimate(
        method=ClockMethod.PINGS,
        line=line,
        residual_sd=float(np.std(windows.middles - line.to_computer(windows.at))),
        bound=bound,
        n_used=len(windows.at),
        n_rejected=len(pings) - len(windows.at),
        flags=(ClockFlag.NOT_LINEAR,) * (not linear) + (ClockFlag.OFFSET_ONLY,) * vague,
    )


def _windows(pings: Array) -> ClockWindows:
    """Return between which times of the computer the meter told its own."""
    return ClockWindows(at=pings[:, 1], low=pings[:, 0], high=pings[:, 2])

"""A meter's clock from when its samples arrived: a line below all of them."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.measurement.clock_line import ClockEstimate, ClockLine
from evenlight.analysis.measurement.clock_windows import line_below
from evenlight.analysis.measurement.sample_gaps import Samples
from evenlight.data_schema.frame_energy import ClockFlag, ClockMethod

STRETCHES = 200  # of each, the sample that arrived soonest
SOONEST = -0.001  # [s] the computer's own time stamps are not later than the arrival, but for rounding
LATEST = 2.0  # [s] nor long before it


def carries_computer_time(samples: Samples) -> bool:
    """Return whether the samples' times can be the computer's: right before they arrived.

    Parameters
    ----------
    samples : Samples
        Of a meter that cannot be pinged.
    """
    delays = samples.received - samples.device_time
    return bool(delays.min() >= SOONEST and delays.max() <= LATEST)


def computer_time(samples: Samples) -> ClockEstimate:
    """Return the clock of a meter whose samples carry the computer's time: nothing to fit."""
    line = ClockLine(reference=float(samples.device_time[0]), offset=0.0)
    flags = (ClockFlag.UNKNOWN_LATENCY,)
    return ClockEstimate(ClockMethod.COMPUTER_TIME, line, None, None, 0, 0, flags)


def fit_arrivals(samples: Samples) -> ClockEstimate:
    """Return the meter's clock by the arrival of its samples.

    No sample arrives before it was made: the line is below all delays, as close to them as it can be (Moon et
    al. 1999). How long the fastest sample took remains unknown.

    Parameters
    ----------
    samples : Samples
        Each once.
    """
    delays = samples.received - samples.device_time
    parts = np.array_split(np.arange(len(delays)), min(STRETCHES, len(delays)))
    soonest = np.array([part[np.argmin(delays[part])] for part in parts])
    times, lowest = samples.device_time[soonest], delays[soonest]
    middle = float((samples.device_time[0] + samples.device_time[-1]) / 2)
    offset, drift = line_below(times, lowest, middle)
    above = delays - offset - drift * (samples.device_time - middle)
    flags = (ClockFlag.UNKNOWN_LATENCY,)
    line = ClockLine(middle, offset, drift)
    return ClockEstimate(ClockMethod.ARRIVALS, line, float(above.std()), None, len(delays), 0, flags)

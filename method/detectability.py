"""How well the brightness changes of a track can be detected, by the calibration of its rate limit.

A track is cut into windows as long as the ramps of the calibration. Each counts as one of its ramps, of the
window's mean rate relative to the limit, seen by the median participant, who watches a plain screen for it.
Windows are independent observations (docs/decisions/calm-tracks.md).
"""

from __future__ import annotations

import math

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.method.psychometric import PsychometricFunction, d_prime, yes_probability


def function_of(limit: RateLimit) -> PsychometricFunction | None:
    """Return the median participant's psychometric function of rate / limit; None if it is not known.

    >>> from evenlight.data_schema.rate_limit import RateLimitForm
    >>> function_of(RateLimit("published", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))) is None
    True
    """
    if limit.width is None or limit.guess_rate is None or limit.procedure is None:
        return None
    return PsychometricFunction(1.0, limit.width, limit.guess_rate, limit.lapse_rate or 0.0)


def detectability(
    limit: RateLimit, rate_ratios: Array, durations: Array
) -> tuple[float, int, float | None] | None:
    """Return how well someone who watches all of a track for changes detects them.

    Parameters
    ----------
    limit : RateLimit
        With its psychometric function and the duration of its ramps.
    rate_ratios, durations : array, (N,)
        Rate from each frame to the next over the limit, signed; how long each frame is shown [s].

    Returns
    -------
    (d_prime, windows, windows_noticed) : (float, int, float or None), or None
        d′ of the whole track, √Σ d′² over its windows; how many they are, and in how many a change is
        expected to be reported, false alarms among them: None where the task was to choose between two
        intervals, which tells nothing of the criterion for saying so. None in all if the limit's calibration
        does not tell.
    """
    function = function_of(limit)
    if function is None or limit.ramp_duration is None:
        return None
    ratios = window_ratios(rate_ratios, durations, limit.ramp_duration)
    two = limit.procedure is Procedure.TWO_INTERVAL
    total = float(np.linalg.norm(d_prime(ratios, function, two_intervals=two)))
    noticed = None if two else float(yes_probability(ratios, function).sum())
    return total, len(ratios), noticed


def window_ratios(rate_ratios: Array, durations: Array, window: float) -> Array:
    """Return the size of the mean ratio of rate to limit in windows of equal length.

    What goes up and down again within a window cancels: a ramp is judged by where it gets to.

    Parameters
    ----------
    rate_ratios, durations : array, (N,)
        Signed; how long each frame is shown [s].
    window : float
        About how long windows are [s]: as near to it as a whole number of them allows.

    >>> window_ratios(np.array([1.0, 1.0, -1.0, 0.0]), np.ones(4), 2.0).tolist()
    [1.0, 0.5]
    """
    ends = np.append(0.0, np.cumsum(durations))
    edges = np.linspace(0.0, ends[-1], max(math.floor(ends[-1] / window + 0.5), 1) + 1)
    changed = np.interp(edges, ends, np.append(0.0, np.cumsum(rate_ratios * durations)))
    return np.asarray(np.abs(np.diff(changed)) / np.diff(edges))

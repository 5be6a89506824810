"""How well the brightness changes of a track can be detected, by the calibration of its rate limit.

A track is cut into windows as long as the ramps of the calibration. Each counts as one of its ramps, of the
window's mean rate relative to the limit, seen by someone who watches a plain screen for it. Windows are
independent observations (docs/decisions/calm-tracks.md). By the same function the limit is moved to another
share of detections (docs/decisions/threshold-definition.md).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import special

from evenlight.data_schema.arguments import number
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import ArgumentError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.tracks.brightness_track import WatchedTrack
from evenlight.method.psychometric import (
    TWO_INTERVAL_GUESS_RATE,
    PsychometricFunction,
    d_prime,
    rate_at,
    yes_probability,
)

# Of people whom a limit's file does not tell: the prior of the width (`analysis.calibration`), by which its
# 95 % interval reaches 1.8 times as far either way; brightness studies find an SD of ln(threshold) of 0.2 to
# 0.35 between people. Without a guess rate, none, as the published limit was fitted.
ASSUMED_WIDTH, ASSUMED_WIDTH_RATIO, ASSUMED_SD = 1.6, 1.8, 0.35
SENSITIVE = float(special.ndtri(0.95))  # of 100 people, 5 see more than this one


def function_of(limit: RateLimit) -> PsychometricFunction | None:
    """Return the median participant's psychometric function of rate / limit; None if it is not known.

    >>> from evenlight.data_schema.rate_limit import RateLimitForm
    >>> function_of(RateLimit("published", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))) is None
    True
    """
    if limit.width is None or limit.guess_rate is None or limit.procedure is None:
        return None
    own = PsychometricFunction(1.0, limit.width, limit.guess_rate, limit.lapse_rate or 0.0)
    return own if limit.noticed is None else replace(own, threshold=1 / _ratio(own, limit.noticed))


def _ratio(function: PsychometricFunction, noticed: float) -> float:
    """Return the rate that is noticed in a share of the trials, guesses and lapses aside, over the threshold.

    >>> round(_ratio(PsychometricFunction(3.0, width=2.0, guess_rate=0.5, lapse_rate=0.0), 0.5), 9)
    1.0
    """
    rise = 1 - function.guess_rate - function.lapse_rate
    return float(rate_at(function.guess_rate + rise * noticed, function)) / function.threshold


def with_assumed(limit: RateLimit) -> tuple[RateLimit, str]:
    """Return a limit with what its file does not tell of people, by other studies, and what that is.

    >>> with_assumed(RateLimit("published", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0)))[1]
    'width 1.6 of the psychometric function, SD 0.35 of ln(threshold) between people'
    """
    told: dict[str, tuple[Any, str]] = {
        "width": (ASSUMED_WIDTH, f"width {ASSUMED_WIDTH:g} of the psychometric function"),
        "participant_sd": (ASSUMED_SD, f"SD {ASSUMED_SD:g} of ln(threshold) between people"),
        "guess_rate": (TWO_INTERVAL_GUESS_RATE if limit.procedure is Procedure.TWO_INTERVAL else 0.0, ""),
        "procedure": (Procedure.YES_NO, ""),
    }
    missing = {name: one for name, one in told.items() if getattr(limit, name) is None}
    known = replace(limit, **{name: value for name, (value, _) in missing.items()})
    if known.width_range is None and known.width is not None:
        ends = known.width / ASSUMED_WIDTH_RATIO, known.width * ASSUMED_WIDTH_RATIO
        known = replace(known, width_range=ends)
    return known, ", ".join(words for _, words in missing.values() if words)


def limit_at_share(limit: RateLimit, noticed: float) -> RateLimit:
    """Return the rate limit for another share of detections than that of 75 % of the trials.

    ln ΔL moves by (logit noticed - logit of F at the threshold) · width / (2 ln 19), the same at every
    luminance, thresholds and band with it. The band is widened by what is not known of the width, as if
    independent of the curve (it nearly is: docs/decisions/threshold-definition.md).

    Parameters
    ----------
    limit : RateLimit
        As fitted; what it does not tell of people is assumed (`with_assumed`).
    noticed : float
        Share of the trials in which the median participant notices a change at the limit, beyond guesses and
        lapses: above 0 and below 1.

    Raises
    ------
    InputError
        If the share is none, or the limit was moved to one already.

    >>> limit = RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0), width=2 * np.log(19))
    >>> round(float(limit_at_share(limit, 0.5)(50.0)), 9)  # e^(logit 0.5 - logit 0.75) = 1/3 as fast
    0.666666667
    """
    if not 0 < number("noticed", noticed) < 1:
        percent = f" ({noticed / 100:g} is {noticed:g} %)" if 1 < noticed < 100 else ""
        raise ArgumentError("noticed", f"must be a share above 0 and below 1, got {noticed:g}{percent}")
    if limit.noticed is not None:
        raise ArgumentError("noticed", f"the rate limit {limit.name!r} is for a share already")
    known = with_assumed(limit)[0]
    own = function_of(known)
    assert own is not None  # all that it needs is assumed
    ratio = _ratio(own, noticed)
    ends = sorted(_ratio(replace(own, width=width), noticed) for width in known.width_range or ())
    curve, edges = limit(limit.band_luminance), (limit.band_lower, limit.band_upper)
    lower, upper = (_moved(np.array(edge), curve, ratio, end) for edge, end in zip(edges, ends, strict=True))
    first, *others = limit.coefficients
    coefficients = (first + math.log(ratio), *others)
    if limit.form is RateLimitForm.RATE:
        coefficients = tuple(ratio * one for one in limit.coefficients)
    return replace(
        limit,
        coefficients=coefficients,
        band_lower=lower,
        band_upper=upper,
        point_rate=tuple(ratio * rate for rate in limit.point_rate),
        noticed=noticed,
    )


def _moved(edge: Array, curve: Array, ratio: float, end: float) -> tuple[float, ...]:
    """Return an edge of a band times a ratio, widened by the end of its interval: independent errors."""
    with np.errstate(divide="ignore", invalid="ignore"):  # of rates of 0, which stay
        distance = np.log(edge / curve)
        wider = np.hypot(distance, math.log(end / ratio)) - np.abs(distance)
    side = 1.0 if end >= ratio else -1.0
    return tuple((ratio * edge * np.exp(side * np.nan_to_num(wider))).tolist())


def watched(limit: RateLimit, rate_ratios: Array, durations: Array) -> WatchedTrack | None:
    """Return how well a track's changes are noticed; None if the limit does not tell how long ramps were.

    Parameters
    ----------
    limit : RateLimit
        What it does not tell of people is assumed.
    rate_ratios, durations : array, (N,)
        Rate from each frame to the next over the limit, signed; how long each frame is shown [s].
    """
    known, assumed = with_assumed(limit)
    own = function_of(known)
    if limit.ramp_duration is None or own is None:
        return None
    ratios = window_ratios(rate_ratios, durations, limit.ramp_duration)
    faster = np.exp(SENSITIVE * (known.participant_sd or 0.0) * np.array([[0.0], [1.0]]))
    rise = (yes_probability(faster * ratios, own) - own.guess_rate) / (1 - own.guess_rate - own.lapse_rate)
    median, sensitive = np.clip(rise.mean(axis=1), 0.0, 1.0).tolist()
    two, total = limit.procedure is Procedure.TWO_INTERVAL, None
    if function_of(limit) is not None:
        total = float(np.linalg.norm(d_prime(ratios, own, two_intervals=two)))
    return WatchedTrack(len(ratios), median, sensitive, total, assumed)


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

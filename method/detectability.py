"""How well the brightness changes of a track can be detected, by the calibration of its rate limit.

A track is cut into windows as long as the ramps of the calibration. Each counts as one of its ramps, of the
window's mean rate relative to the limit, seen by someone who watches a plain screen for it. Windows are
independent observations (docs/decisions/calm-tracks.md). By the same function the limit is moved to another
share of detections (docs/decisions/rate-constraint.md).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evenlight.data_schema.arguments import number
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import ArgumentError
from evenlight.data_schema.rate_limit import BandKind, RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.tracks.brightness_track import WatchedTrack
from evenlight.method.psychometric import TWO_INTERVAL_GUESS_RATE, WIDTH_LOGITS, threshold_logit

# Of people whom a limit's file does not tell: the prior of the width (`analysis.calibration`), by which its
# 95 % interval reaches 1.8 times as far either way; brightness studies find an SD of ln(threshold) of 0.2 to
# 0.35 between people. Without a guess rate, none, as the published limit was fitted.
ASSUMED_WIDTH, ASSUMED_WIDTH_RATIO, ASSUMED_SD = 1.6, 1.8, 0.35
SIMULTANEOUS = 4 / 3  # standard deviations of a simultaneous band for one of a pointwise band
SENSITIVE = float(scipy.special.ndtri(0.95))  # of 100 people, 5 see more than this one


def with_assumed(limit: RateLimit) -> tuple[RateLimit, str]:
    """Return a limit with what its file does not tell of people, by other studies, and what that is.

    >>> with_assumed(RateLimit("published", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0)))[1]
    'width 1.6 of the psychometric function, SD 0.35 of ln(threshold) between people'
    """
    told: dict[str, tuple[Any, str]] = {
        "width": (ASSUMED_WIDTH, f"width {ASSUMED_WIDTH:g} of the psychometric function"),
        "participant_sd": (ASSUMED_SD, f"SD {ASSUMED_SD:g} of ln(threshold) between people"),
        "guess_rate": (TWO_INTERVAL_GUESS_RATE if limit.procedure is Procedure.TWO_INTERVAL else 0.0, ""),
    }
    missing = {name: one for name, one in told.items() if getattr(limit, name) is None}
    known = replace(limit, **{name: value for name, (value, _) in missing.items()})
    if known.width_range is None and known.width is not None:
        ends = known.width / ASSUMED_WIDTH_RATIO, known.width * ASSUMED_WIDTH_RATIO
        known = replace(known, width_range=ends)
    return known, ", ".join(words for _, words in missing.values() if words)


def share_noticed(rate_ratio: ArrayLike, limit: RateLimit) -> Array:
    """Return in which share of the trials the median participant notices a change, guesses and lapses aside.

    Parameters
    ----------
    rate_ratio : array_like, any shape
        Its rate over the limit, at least 0.
    limit : RateLimit
        What it does not tell of people is assumed (`with_assumed`).

    >>> share_noticed([0.0, 1.0], RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))).tolist()
    [0.0, 0.75]
    """
    known = with_assumed(limit)[0]
    assert known.width is not None
    with np.errstate(divide="ignore"):  # ln 0 = -inf is meant: nothing to see
        distance = np.log(np.asarray(rate_ratio, dtype=np.float64))
    return np.asarray(scipy.special.expit(WIDTH_LOGITS * distance / known.width + _logit_at(known)))


def _logit_at(known: RateLimit) -> float:
    if known.noticed is not None:
        return float(scipy.special.logit(known.noticed))
    return float(threshold_logit(known.guess_rate or 0.0))


def limit_at_share(limit: RateLimit, noticed: float) -> RateLimit:
    """Return the rate limit for another share of detections than that of 75 % of the trials.

    ln ΔL moves by (logit noticed - logit of F at the threshold) · width / (2 ln 19), the same at every
    luminance, thresholds and band with it. The band is widened by what is not known of the width, as if
    independent of the curve (it nearly is: docs/decisions/rate-constraint.md).

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
    assert known.width is not None
    further = float(scipy.special.logit(noticed)) - _logit_at(known)
    ratio, *ends = (
        math.exp(further * width / WIDTH_LOGITS) for width in (known.width, *(known.width_range or ()))
    )
    ends.sort()  # the widest function lies lowest below the fitted share
    further_sds = SIMULTANEOUS if limit.band_kind is BandKind.SIMULTANEOUS else 1.0
    curve, edges = limit(limit.band_luminance), (limit.band_lower, limit.band_upper)
    lower, upper = (
        _moved(np.array(edge), curve, ratio, (end / ratio) ** further_sds)
        for edge, end in zip(edges, ends, strict=True)
    )
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


def _moved(edge: Array, curve: Array, ratio: float, further: float) -> tuple[float, ...]:
    """Return an edge of a band about a curve, times a ratio, and further out by an independent error."""
    with np.errstate(divide="ignore", invalid="ignore"):  # of rates of 0, which stay
        distance = np.log(edge / curve)
        wider = np.hypot(distance, math.log(further)) - np.abs(distance)
    side = 1.0 if further >= 1 else -1.0
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
    if limit.ramp_duration is None:
        return None
    ratios = window_ratios(rate_ratios, durations, limit.ramp_duration)
    sensitive = math.exp(SENSITIVE * (known.participant_sd or 0.0)) * ratios
    median, sharp = (float(share_noticed(own, known).mean()) for own in (ratios, sensitive))
    return WatchedTrack(len(ratios), median, sharp, assumed)


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

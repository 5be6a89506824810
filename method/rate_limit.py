"""The rate limit ΔL(L), the fastest luminance change allowed (Section 3.4), and rates of modulation (Eq. 6).

`rate_limit_at` takes arrays; `scalar_rate_limit` one luminance at a time, for loops from frame to frame.
The paper prints the constraint as an equality, which would make every frame change at the largest rate. Meant
is a limit, and on the change that the *modulation* makes: content may cut from dark to bright at will.
See docs/decisions/rate-constraint.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.method.choices import LimitCurve

ScalarRateLimit = Callable[[float], float]
RateLimitFunction = Callable[[Array], Array]

ROUNDING = 1e-9  # share of the rate limit that is left, so that no rounding oversteps it
MOST_TRIES = 60  # to find a step that the limit allows at its far end; two are enough where ΔL is smooth


def rate_limit_at(
    limit: RateLimit, luminance: ArrayLike, curve: LimitCurve = LimitCurve.FITTED
) -> NDArray[np.float64]:
    """Return ΔL, the rate of luminance change detected in 75 % of the trials, at a luminance L.

    "Detected" is answered "yes" (yes/no) or identified correctly (2IFC): `limit.procedure` says which.

    Outside the measured luminances it is held, as `RateLimit` says, which this calls for the fitted curve.

    Parameters
    ----------
    limit : RateLimit
        The fitted curve.
    luminance : array_like, any shape
        L [cd/m^2], at least 0.
    curve : LimitCurve
        The fitted curve, or the lower edge of its band.

    Returns
    -------
    array, shape of luminance
        ΔL [cd/m^2/s]; 0 at L = 0, and where a polynomial of the rate itself falls below 0.

    Raises
    ------
    InputError
        If the lower edge is asked for and the limit has no band.

    >>> flat = RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))
    >>> rate_limit_at(flat, [5.0, 10.0, 50.0, 200.0]).tolist()
    [1.0, 2.0, 2.0, 2.0]
    """
    if curve is LimitCurve.FITTED:
        return limit(luminance)
    values = np.asarray(luminance, dtype=np.float64)
    low, high = limit.luminance_range
    rate = _lower_edge(limit, np.clip(values, low, high))
    return np.asarray(rate * (np.minimum(values, low) / low))


def _lower_edge(limit: RateLimit, luminance: NDArray[np.float64]) -> NDArray[np.float64]:
    if not limit.band_luminance:
        raise InputError(
            f"the rate limit {limit.name!r} has no band (too few points or people to estimate one); "
            f"use the fitted curve"
        )
    return np.interp(luminance, limit.band_luminance, limit.band_lower)


def require_same_display(limit: RateLimit, display: Display) -> None:
    """Raise `InputError` if a rate limit was fitted on another display than the one it is used for.

    Thresholds hold for the luminances, the black level and the white of the display they were measured on.
    """
    if not limit.holds_for(display):
        same_name = " of other photometry" if limit.display_name == display.name else ""
        missing = "" if limit.display else "name the display that it was fitted on (`display`), "
        raise InputError(
            f"the rate limit {limit.name!r} was fitted on the display {limit.display_name!r}{same_name}, "
            f"not on {display.name!r}: {missing}measure a limit on {display.name!r} (`evenlight run ramp`, "
            "then `evenlight fit`) and give it as `rate_limit`, or borrow this one, unproven there, "
            "with `other_display_ok`"
        )


def require_known(limit: RateLimit, accept_wide_band: bool = False) -> None:
    """Raise `InputError` if a rate limit is known too badly for use (docs/decisions/wide-bands.md).

    Parameters
    ----------
    limit : RateLimit
        Without a band, it passes only if no model of this program fitted it (a preset, an older file).
    accept_wide_band : bool
        Whether any width will do, and none.

    >>> band = {"band_luminance": (1.0, 9.0), "band_lower": (0.5, 0.1), "band_upper": (1.0, 1.0)}
    >>> limit = RateLimit("r", "d", "", RateLimitForm.RATE, (0.7,), (1.0, 9.0), **band)
    >>> require_known(limit)
    Traceback (most recent call last):
        ...
    evenlight.data_schema.errors.InputError: the rate limit 'r' is not known well enough: at 9 cd/m^2 its \
95 % pointwise band reaches from 0.1 to 1 cd/m^2/s, a ratio of 10; at most 4 is of use; measure more \
participants, or accept that (`accept_wide_band`)
    """
    if limit.wide_band and not accept_wide_band:
        moved = "" if limit.noticed is None else f" where {100 * limit.noticed:g} % is noticed"
        nearer = "choose a share (`noticed`) nearer that of the fit, " * bool(moved)
        raise InputError(
            f"the rate limit {limit.name!r} is not known well enough{moved}: {limit.wide_band}; {nearer}"
            "measure more participants, or accept that (`accept_wide_band`)"
        )


def scalar_rate_limit(
    limit: RateLimit, reflected: float = 0.0, curve: LimitCurve = LimitCurve.FITTED
) -> ScalarRateLimit:
    """Return a function that gives ΔL [cd/m^2/s] at a luminance that a display emits [cd/m^2].

    It gives what `rate_limit_at` gives, but for rounding, forty times as fast for one number.

    Parameters
    ----------
    limit : RateLimit
        The fitted curve.
    reflected : float
        L_refl, which adds to what is emitted [cd/m^2].
    curve : LimitCurve
        The fitted curve, or the lower edge of its band.

    Raises
    ------
    InputError
        If the lower edge is asked for and the limit has no band.

    >>> flat = RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))
    >>> [scalar_rate_limit(flat)(luminance) for luminance in (0.0, 5.0, 50.0, 200.0)]
    [0.0, 1.0, 2.0, 2.0]
    """
    if curve is LimitCurve.SAFE:
        rate_limit_at(limit, limit.luminance_range, curve)  # raises where there is no band
        inside = _scalar_lower_edge(limit)
    else:
        inside = _scalar_polynomial(limit)
    return partial(_held_outside, inside, limit.luminance_range, reflected)


def _held_outside(
    inside: ScalarRateLimit, measured: tuple[float, float], reflected: float, emitted: float
) -> float:
    """Return ΔL: below the measured luminances the relative rate is held, above them the rate is."""
    low, high = measured
    luminance = emitted + reflected
    if luminance < low:
        return inside(low) * luminance / low
    return inside(min(luminance, high))


def _scalar_lower_edge(limit: RateLimit) -> ScalarRateLimit:
    at, lower = limit.band_luminance, limit.band_lower

    def rate(luminance: float) -> float:
        return float(np.interp(luminance, at, lower))

    return rate


def _scalar_polynomial(limit: RateLimit) -> ScalarRateLimit:
    falling = [float(c) for c in legendre.leg2poly(np.array(limit.coefficients))[::-1]]
    low, high = limit.luminance_range
    if limit.form is RateLimitForm.LOG_LOG:
        low, high = math.log(low), math.log(high)
    span = (high - low) or 1.0  # of one luminance: a constant
    logarithmic, of_rate = limit.form is RateLimitForm.LOG_LOG, limit.form is RateLimitForm.RATE

    def rate(luminance: float) -> float:
        place = math.log(luminance) if logarithmic else luminance
        z, value = (2 * place - low - high) / span, 0.0
        for coefficient in falling:
            value = value * z + coefficient
        return max(value, 0.0) if of_rate else math.exp(value)

    return rate


def step_luminance(mean_luminance: Array) -> Array:
    """Return the luminance that a step of the factor acts on: the mean of Ī_i and Ī_{i+1} [cd/m^2].

    Parameters
    ----------
    mean_luminance : array, (N,)
        Ī, mean luminance of each frame at factor 1 [cd/m^2].

    Returns
    -------
    array, (N-1,)

    >>> step_luminance(np.array([10.0, 20.0])).tolist()
    [15.0]
    """
    return (mean_luminance[:-1] + mean_luminance[1:]) / 2


def modulation_rate(factors: Array, mean_luminance: Array, durations: Array) -> Array:
    """Return the luminance change per second that the modulation makes from each frame to the next.

    Parameters
    ----------
    factors, mean_luminance, durations : array, (N,)
        b; Ī at factor 1 [cd/m^2]; how long each frame is shown [s].

    Returns
    -------
    array, (N,)
        (b_{i+1} - b_i) · (mean of Ī_i, Ī_{i+1}) / Δt, signed, 0 in the last frame [cd/m^2/s].

    >>> modulation_rate(np.array([0.5, 0.6]), np.array([10.0, 10.0]), np.array([0.5, 0.5])).round(9).tolist()
    [2.0, 0.0]
    """
    rate = np.diff(factors) * step_luminance(mean_luminance) / durations[:-1]
    return np.append(rate, 0.0)


def allowed_rate(
    factors: Array, mean_luminance: Array, rate_limit: RateLimitFunction, allowances: Array | None = None
) -> Array:
    """Return the largest rate allowed from each frame to the next: the lower of its two ends' limits.

    Parameters
    ----------
    factors, mean_luminance : array, (N,)
        b; Ī at factor 1 [cd/m^2].
    rate_limit : function
        ΔL [cd/m^2/s] of the luminance that the modulation makes, b·Ī [cd/m^2].
    allowances : array, (N-1,), optional
        How many times that limit each step may reach; infinite where it is free.

    Returns
    -------
    array, (N,)
        [cd/m^2/s]; in the last frame its own limit.

    >>> allowed_rate(np.ones(3), np.full(3, 9.0), lambda x: x, np.array([0.0, 2.0])).tolist()
    [0.0, 18.0, 9.0]
    """
    limit = rate_limit(factors * mean_luminance)
    of_steps = np.minimum(limit[:-1], limit[1:])
    if allowances is not None:
        free = np.isinf(allowances)
        of_steps = np.where(free, np.inf, of_steps * np.where(free, 1.0, allowances))
    return np.append(of_steps, limit[-1])


def largest_rate_ratio(rate: Array, allowed: Array) -> float:
    """Return the largest ratio of a step's rate to what is allowed; no change is 0 under any limit.

    >>> largest_rate_ratio(np.array([-2.0, 0.0]), np.array([4.0, 0.0]))
    0.5
    """
    speed = np.abs(rate)
    moving = speed > 0
    if not moving.any():
        return 0.0
    with np.errstate(divide="ignore", over="ignore"):  # next to nothing allowed: infinitely too fast
        return float(np.max(speed[moving] / allowed[moving]))


def furthest_factor(
    factor: float, goal: float, luminance: tuple[float, float], seconds: float, rate_limit: ScalarRateLimit
) -> float:
    """Return how far towards a goal one step of the factor may lead, within ΔL at both of its ends.

    Parameters
    ----------
    factor, goal : float
        b before the step, and where it is to lead.
    luminance : tuple of float
        Ī before and after it, at factor 1 [cd/m^2].
    seconds : float
        Δt [s].
    rate_limit : function
        ΔL [cd/m^2/s] of b·Ī [cd/m^2].

    Returns
    -------
    float
        |Δb| · (mean of both Ī) / Δt ≤ ΔL of b·Ī before and after; at the goal but for rounding if it may be.

    >>> round(furthest_factor(0.5, 0.9, (40.0, 60.0), 0.1, lambda luminance: 2.0), 6)
    0.504
    """
    way = 1.0 if goal > factor else -1.0
    size = _largest_step(factor, goal, luminance, seconds, rate_limit)
    furthest = factor + way * size
    if abs(furthest - factor) > size:  # a step may be so small that the sum's last digit oversteps
        furthest = math.nextafter(furthest, factor)
    return furthest


def _largest_step(
    factor: float, goal: float, luminance: tuple[float, float], seconds: float, rate_limit: ScalarRateLimit
) -> float:
    size, way = abs(goal - factor), (1.0 if goal > factor else -1.0)
    before, after = luminance
    mean = (before + after) / 2
    if mean == 0:
        return size  # in the dark a change of the factor is not seen
    per_rate = (1 - ROUNDING) * seconds / mean
    size = min(size, per_rate * rate_limit(factor * before))
    for _ in range(MOST_TRIES):
        allowed = per_rate * rate_limit((factor + way * size) * after)
        if size <= allowed:
            return size
        size = allowed
    return 0.0

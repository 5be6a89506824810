"""The rate limit ΔL(L) at one luminance at a time, for loops that go from frame to frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.polynomial import legendre

from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.method.choices import LimitCurve
from evenlight.method.rate_limit import rate_limit_at

ScalarRateLimit = Callable[[float], float]


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
        inside = _lower_edge(limit)
    else:
        inside = _polynomial(limit)
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


def _lower_edge(limit: RateLimit) -> ScalarRateLimit:
    """Return the lower edge of the band as a function of one luminance."""
    at, lower = limit.band_luminance, limit.band_lower

    def rate(luminance: float) -> float:
        return float(np.interp(luminance, at, lower))

    return rate


def _polynomial(limit: RateLimit) -> ScalarRateLimit:
    """Return the fitted polynomial as a function of one luminance."""
    falling = [float(c) for c in legendre.leg2poly(np.array(limit.coefficients))[::-1]]
    low, high = limit.luminance_range
    if limit.form is RateLimitForm.LOG_LOG:
        low, high = math.log(low), math.log(high)
    logarithmic, of_rate = limit.form is RateLimitForm.LOG_LOG, limit.form is RateLimitForm.RATE

    def rate(luminance: float) -> float:
        place = math.log(luminance) if logarithmic else luminance
        z, value = (2 * place - low - high) / (high - low), 0.0
        for coefficient in falling:
            value = value * z + coefficient
        return max(value, 0.0) if of_rate else math.exp(value)

    return rate

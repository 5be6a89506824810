"""The rate limit ΔL(L), evaluated: the fastest luminance change allowed (Section 3.4)."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.method.choices import LimitCurve


def rate_limit_at(
    limit: RateLimit, luminance: ArrayLike, curve: LimitCurve = LimitCurve.FITTED
) -> NDArray[np.float64]:
    """Return ΔL, the rate of luminance change detected in 75 % of the trials, at a luminance L.

    "Detected" is noticed in yes/no, told right of two intervals: `limit.procedure` says which.

    Outside the measured luminances the polynomial means nothing. Below them the relative rate ΔL/L is held
    (thresholds are near-Weber), above them the rate is (see docs/decisions/rate-limit-outside-its-range.md).

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
    values = np.asarray(luminance, dtype=np.float64)
    low, high = limit.luminance_range
    inside = np.clip(values, low, high)
    rate = _fitted(limit, inside) if curve is LimitCurve.FITTED else _lower_edge(limit, inside)
    return np.asarray(rate * (np.minimum(values, low) / low))


def _fitted(limit: RateLimit, luminance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the polynomial's rate within the measured luminances."""
    low, high = limit.luminance_range
    if limit.form is RateLimitForm.LOG_LOG:
        luminance, low, high = np.log(luminance), float(np.log(low)), float(np.log(high))
    position = (2 * luminance - low - high) / (high - low)
    value = legendre.legval(position, np.asarray(limit.coefficients))
    if limit.form is RateLimitForm.RATE:
        return np.asarray(np.maximum(value, 0.0))
    return np.asarray(np.exp(value))


def _lower_edge(limit: RateLimit, luminance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lower edge of the band within the measured luminances."""
    if not limit.band_luminance:
        raise InputError(
            f"the rate limit {limit.name!r} has no band (too few points to estimate one); "
            f"use the fitted curve"
        )
    return np.interp(luminance, limit.band_luminance, limit.band_lower)


def require_same_display(limit: RateLimit, display: Display) -> None:
    """Raise `InputError` if a rate limit was fitted on another display than the one it is used for.

    Thresholds hold for the luminances, the black level and the white of the display they were measured on.
    """
    if limit.display_fingerprint != display.fingerprint:
        same_name = " of other photometry" if limit.display_name == display.name else ""
        raise InputError(
            f"the rate limit {limit.name!r} was fitted on the display {limit.display_name!r}{same_name}, "
            f"not on {display.name!r}; calibrate {display.name!r}, or accept it with --other-display-ok"
        )

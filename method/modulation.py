"""The luminance change that the modulation makes between frames, and how fast it may be (Eq. 6).

The paper prints the constraint as an equality, which would make every frame change at the largest rate. Meant
is a limit, and on the change that the *modulation* makes: content may cut from dark to bright at will.
See docs/decisions/rate-constraint.md.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evenlight.data_schema.arrays import Array

RateLimitFunction = Callable[[Array], Array]


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

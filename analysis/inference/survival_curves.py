"""Kaplan-Meier curves of times of which some are only known to be longer than a limit.

The curve is S(t) = Π (1 - d_i / n_i) over the times at which something was found, d_i of the n_i that were
still being searched for (Kaplan & Meier, 1958). Its pointwise confidence interval is that of ln(-ln S)
(Kalbfleisch & Prentice, 1980), which keeps within 0 and 1; the median's is all times at which that interval
holds one half (Brookmeyer & Crowley, 1982).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.data_schema.arrays import Array

NOT_REACHED = "not reached: no more than half were found"
NO_UPPER_END = "the interval has no upper end: perhaps half are never found within the time"
TOO_FEW = "too few for an interval"

HALF = 0.5 + 1e-12  # products of shares that are one half may miss it by a rounding


@dataclass(frozen=True, slots=True)
class SurvivalCurve:
    """Share that is not yet found, over time.

    Attributes
    ----------
    times : array (k,)
        When something was found, rising [s].
    survival, low, high : array (k,)
        Share not yet found from then on, and the ends of its pointwise confidence interval.
    n, n_found : int
        How many were searched for, and found.
    last : float
        Longest time that was watched: beyond it nothing is known [s].
    median, median_low, median_high : float or None
        Time until half are found, and its confidence interval [s]; None where it was not reached, or has no
        such end.
    flag : str
        What is to be said about the median; empty for nothing.
    """

    times: Array
    survival: Array
    low: Array
    high: Array
    n: int
    n_found: int
    last: float
    median: float | None
    median_low: float | None
    median_high: float | None
    flag: str = ""


def kaplan_meier(times: Array, found: NDArray[np.bool_], level: float = 0.95) -> SurvivalCurve:
    """Return the Kaplan-Meier curve of search times.

    Parameters
    ----------
    times : array (n,)
        Until found, or until the search was given up [s]; n >= 1.
    found : array (n,) of bool
        Whether found.
    level : float
        Of the intervals.

    >>> half = kaplan_meier(np.array([2.0, 3.0, 30.0]), np.array([True, True, False]))
    >>> half.median, half.survival.round(3).tolist()
    (3.0, [0.667, 0.333])
    """
    last = float(np.max(times))
    nothing = np.zeros(0)
    if not np.any(found):
        return SurvivalCurve(
            nothing, nothing, nothing, nothing, times.size, 0, last, None, None, None, NOT_REACHED
        )
    curve = _survfunc(times, found)
    event = curve.n_events > 0
    at, survival = curve.surv_times[event], curve.surv_prob[event]
    low, high = _log_log_interval(survival, curve.surv_prob_se[event], level)
    median = _middle(at, survival)
    ends = _first(at, low <= HALF), _first(at, high <= HALF)
    flag = NOT_REACHED if median is None else NO_UPPER_END if ends[1] is None else ""
    if 2.0 ** (1 - times.size) > 1 - level:  # all could lie on one side of the median more often than that
        ends, flag = (None, None), flag or TOO_FEW
    n_found = int(np.count_nonzero(found))
    return SurvivalCurve(at, survival, low, high, times.size, n_found, last, median, *ends, flag)


def restricted_mean(curve: SurvivalCurve, limit: float) -> float:
    """Return the mean time until found or until a limit, whichever is first: the area under the curve [s].

    Parameters
    ----------
    curve : SurvivalCurve
        The curve, watched at least until the limit.
    limit : float
        The limit [s].

    >>> restricted_mean(kaplan_meier(np.array([2.0, 30.0]), np.array([True, False])), 30.0)
    16.0
    """
    inside = curve.times < limit
    edges = np.concatenate([[0.0], curve.times[inside], [limit]])
    heights = np.concatenate([[1.0], curve.survival[inside]])
    return float(np.sum(np.diff(edges) * heights))


def _survfunc(times: Array, found: NDArray[np.bool_]) -> Any:
    """Return statsmodels' estimate, with Greenwood's standard error."""
    from statsmodels.duration.survfunc import SurvfuncRight  # a second to import

    return SurvfuncRight(times, found.astype(int))


def _log_log_interval(survival: Array, error: Array, level: float) -> tuple[Array, Array]:
    """Return the pointwise interval S^exp(±z se / (S ln S)); where S is 0 there is none but 0 itself."""
    z = float(special.ndtri(0.5 + level / 2))
    low, high = np.zeros_like(survival), np.zeros_like(survival)
    some = survival > 1e-12
    spread = z * error[some] / (survival[some] * np.log(survival[some]))  # below 0
    low[some] = survival[some] ** np.exp(-spread)
    high[some] = survival[some] ** np.exp(spread)
    return low, high


def _middle(times: Array, survival: Array) -> float | None:
    """Return when the curve passes one half; the middle of the time for which it is just that.

    So the median of an even number of times is the usual one. Where the curve stays at one half to the end,
    nobody knows when more than half would be found.
    """
    first, below = _first(times, survival <= HALF), _first(times, survival < 1 - HALF)
    return None if first is None or below is None else (first + below) / 2


def _first(times: Array, reached: NDArray[np.bool_]) -> float | None:
    """Return the first time at which something holds; None if it never does."""
    return float(times[np.argmax(reached)]) if np.any(reached) else None

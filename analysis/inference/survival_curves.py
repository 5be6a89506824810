"""Kaplan-Meier curves of times of which some are only known to be longer than a limit.

The curve is S(t) = Π (1 - d_i / n_i) over the times at which something was found, d_i of the n_i that were
still being searched for (Kaplan & Meier, 1958). Its pointwise confidence interval is that of ln(-ln S)
(Kalbfleisch & Prentice, 1980), which keeps within 0 and 1; the median's is all times at which that interval
holds one half (Brookmeyer & Crowley, 1982).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.inference.paired_effects import Effect
from evenlight.data_schema.arrays import Array, Integers, Mask

NOT_REACHED = "not reached: no more than half were found"
NO_UPPER_END = "the interval has no upper end: perhaps half are never found within the time"
TOO_FEW = "too few for an interval"

LEVEL = 0.95  # of the intervals
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
    median : Effect
        Time until half are found, and its confidence interval [s]; None where it was not reached, or has no
        such end, as its flag says.
    """

    times: Array
    survival: Array
    low: Array
    high: Array
    median: Effect


def kaplan_meier(times: Array, found: Mask, people: Integers | None = None) -> SurvivalCurve:
    """Return the Kaplan-Meier curve of search times, with 95 % intervals.

    Parameters
    ----------
    times : array (n,)
        Until found, or until the search was given up [s]; n >= 1.
    found : array (n,) of bool
        Whether found.
    people : array (n,) of int, optional
        Whose, if a person has several: the standard error is then over people (Williams 1995, Biometrics 51,
        1363; Ying & Wei 1994), with Student's t.

    >>> half = kaplan_meier(np.array([2.0, 3.0, 30.0]), np.array([True, True, False]))
    >>> half.median.value, half.survival.round(3).tolist()
    (3.0, [0.667, 0.333])
    """
    from statsmodels.duration.survfunc import SurvfuncRight  # a second to import

    if not np.any(found):
        none = np.zeros(0)
        return SurvivalCurve(none, none, none, none, Effect(None, flag=NOT_REACHED))
    curve = SurvfuncRight(times, found.astype(int))  # with Greenwood's standard error
    event = curve.n_events > 0
    at, survival = curve.surv_times[event], curve.surv_prob[event]
    number, quantile, error = times.size, float(special.ndtri(0.5 + LEVEL / 2)), curve.surv_prob_se[event]
    if people is not None and (number := np.unique(people).size) > 1:
        at_risk, events = curve.n_risk[event], curve.n_events[event]
        error = survival * _error_over_people((times, found, people), at, at_risk, events)
        quantile = float(special.stdtrit(number - 1, 0.5 + LEVEL / 2))
    low, high = _log_log_interval(survival, quantile * error)
    # The median of an even number is the usual one: the middle of the time for which the curve is one half.
    # Where it stays there to the end, nobody knows when more than half would be found.
    first, below = _first(at, survival <= HALF), _first(at, survival < 1 - HALF)
    median = None if first is None or below is None else (first + below) / 2
    ends = _first(at, low <= HALF), _first(at, high <= HALF)
    flag = NOT_REACHED if median is None else NO_UPPER_END if ends[1] is None else ""
    if 2.0 ** (1 - number) > 1 - LEVEL:  # all could lie on one side of the median more often than that
        ends, flag = (None, None), flag or TOO_FEW
    return SurvivalCurve(at, survival, low, high, Effect(median, *ends, flag))


def _error_over_people(own: tuple[Array, Mask, Integers], at: Array, at_risk: Array, events: Array) -> Array:
    """Return the standard error of ln S over people: of the sums of what their searches add to it."""
    times, found, people = own
    every = np.unique(people)
    squares = np.zeros_like(at)
    for person in every:
        mine = people == person
        ended, sought = np.sort(times[mine & found]), np.sort(times[mine])
        found_by = np.searchsorted(ended, at, side="right") - np.searchsorted(ended, at, side="left")
        still = sought.size - np.searchsorted(sought, at, side="left")
        squares += np.cumsum((found_by - still * events / at_risk) / at_risk) ** 2
    return np.sqrt(squares * every.size / (every.size - 1))


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


def _log_log_interval(survival: Array, half: Array) -> tuple[Array, Array]:
    """Return the pointwise interval S^exp(±half / (S ln S)); where S is 0 there is none but 0 itself."""
    low, high = np.zeros_like(survival), np.zeros_like(survival)
    some = survival > 1e-12
    spread = half[some] / (survival[some] * np.log(survival[some]))  # below 0
    low[some] = survival[some] ** np.exp(-spread)
    high[some] = survival[some] ** np.exp(spread)
    return low, high


def _first(times: Array, reached: Mask) -> float | None:
    return float(times[np.argmax(reached)]) if np.any(reached) else None

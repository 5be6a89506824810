"""Which readings of a sweep cannot be right: what its repeats and the order of its levels leave no room for.

A lost digit or a flipped bit makes a number that looks like any other. A sweep reads each level several
times, and a brighter level is brighter: two readings *contradict* each other if they are of one level and
differ, or if the darker level reads brighter, in both cases by more than is tolerated of any meter and more
than this meter's noise explains. The reading that contradicts most of the others is suspect, and so on, until
no two are left.

Sweeps ask while they read, and fits ask afterwards (docs/decisions/sweeps.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from evenlight.data_schema.arrays import Array

CLEAR = (
    6.0  # standard deviations of a difference: 2e-9 of normal noise, 2e-4 if that is known to a third only
)
FEWEST_STEPS = (
    12  # differences of successive readings that tell the noise: those of six levels read three times
)
DARKEST = 6  # of them that tell it in the dark: those of three levels
NORMAL_DIFFERENCE = 0.9539  # median of |difference| of two normal readings, over their standard deviation
ROUNDS = 12  # of taking out the trend of a display that warms up by a third; a steady one takes two
SMALLEST_CHANGE = 1e-4  # share: of a trend that is found
STEADY = 9  # bright readings in a row that tell the trend: two bad ones among them do no harm
BRIGHT = 0.1  # of the brightest level; darker ones say little of the trend
FEWEST_DIGITS = 0.01  # last digit over a bright reading: no meter's 200 means 150 to 250
FINEST_DIGITS = 9  # significant digits beyond which a number was not rounded by any instrument
ROUNDED = 5e-10  # of the first digit: what is this near to fewer digits has them
NEAR = 256  # readings before and after each, by level, that it is compared with


@dataclass(frozen=True, slots=True)
class Tolerance:
    """By how much readings of a level may differ without a warning.

    Attributes
    ----------
    share, floor : float
        Of the value [1], and added to it, in the unit of the readings.
    """

    share: float
    floor: float

    def of(self, values: ArrayLike) -> Array:
        """Return what is tolerated at some values.

        >>> LUMINANCE_TOLERANCE.of([0.0, 100.0]).tolist()
        [0.02, 2.02]
        """
        return np.asarray(self.share * np.abs(np.asarray(values, dtype=np.float64)) + self.floor)


LUMINANCE_TOLERANCE = Tolerance(0.02, 0.02)  # [1, cd/m^2]: docs/decisions/display-fit.md
POWER_TOLERANCE = Tolerance(0.01, 0.0)  # [1, W]: docs/decisions/display-fit.md
TOLERANCES = {"cd/m^2": LUMINANCE_TOLERANCE, "W": POWER_TOLERANCE}


@dataclass(frozen=True, slots=True)
class Suspicion:
    """What is wrong with which readings.

    Attributes
    ----------
    left_out : array (n,) of bool
        Readings that contradict most of the others.
    out_of_order : array (n,) of bool
        Readings that agree with each other, of a level that reads darker than a darker level, or brighter
        than a brighter one: so the display may be, and they count.
    """

    left_out: NDArray[np.bool_]
    out_of_order: NDArray[np.bool_]


def suspect_readings(values: ArrayLike, levels: ArrayLike, tolerance: Tolerance) -> Suspicion:
    """Return which readings contradict the others.

    Parameters
    ----------
    values : array_like (n,)
        In the order in which they were read; nan of one that was too dark for the meter, which counts as the
        darkest level that was not.
    levels : array_like (n,)
        What was shown: values rise with it, or stay.
    tolerance : Tolerance
        What readings of one level may differ by in any case.

    >>> read = [1.0, 20.0, 63.4, 1.0, 20.1, 7.25, 1.0, 20.0, 63.5]
    >>> suspect_readings(read, [0.0, 0.5, 1.0] * 3, LUMINANCE_TOLERANCE).left_out.nonzero()[0].tolist()
    [5]
    """
    read, number = np.asarray(values, dtype=np.float64), np.unique(levels, return_inverse=True)[1]
    told = ~np.isnan(read)
    left_out, out_of_order = np.zeros((2, read.size), dtype=np.bool_)
    if not told.any():
        return Suspicion(left_out, out_of_order)
    read = np.where(told, read, ndimage.median(read[told], number[told], np.unique(number[told])).min())
    order = np.argsort(number, kind="stable")
    ranked, levels = read[order], number[order]
    if not _contradictions(np.stack([levels, ranked, 0 * ranked]), tolerance).any():
        return Suspicion(left_out, out_of_order)
    steady, digits = _without_trend(read, number)[order], last_digits(ranked)
    digits = np.minimum(digits, np.maximum(digits.min(), np.abs(ranked) * FEWEST_DIGITS))
    out, variance = left_out[order], digits**2 / 12
    for robust in (True, False):  # the second time by the readings that are left after the first
        noise = _noise(steady[~out], levels[~out], tolerance, robust=robust)
        variance = np.maximum(variance, noise.floor**2 + (noise.share * steady) ** 2 + digits**2 / 12)
        compared = np.stack([levels, steady, variance])
        out = _most_contradicted(_contradictions(compared, tolerance))
    unordered = np.zeros_like(out)
    for own in np.split(np.arange(out.size), np.flatnonzero(np.diff(levels)) + 1):
        if out[own].all():
            agree = ~_most_contradicted(_contradictions(compared[:, own], tolerance))
            if agree.sum() > 1:
                out[own], unordered[own] = ~agree, agree
    left_out[order], out_of_order[order] = out, unordered
    return Suspicion(left_out, out_of_order)


def _contradictions(readings: Array, tolerance: Tolerance) -> NDArray[np.bool_]:
    """Return whether each reading contradicts the one 1, 2, ... places after it, (n, at most NEAR).

    Readings (3, n) are level, value and variance of noise, by level and then by time. They contradict each
    other if they are further apart than they may be, of one level or in the wrong order.
    """
    n = readings.shape[1]
    wrong = np.zeros((n, min(NEAR, n - 1)), dtype=np.bool_)
    for place in range(wrong.shape[1]):
        one, other = readings[:, : n - place - 1], readings[:, place + 1 :]
        explained, less = CLEAR * np.sqrt(one[2] + other[2]), one[1] - other[1]
        apart = np.maximum(tolerance.of(np.maximum(one[1], other[1])), explained)
        wrong[: n - place - 1, place] = np.where(one[0] == other[0], np.abs(less), less) > apart
    return wrong


def _without_trend(values: Array, number: NDArray[np.intp]) -> Array:
    """Return readings without what all levels do alike, warming up or drifting: a median polish (Tukey 1977).

    The trend at a reading is the line of Theil and Sen through what each of the bright readings next to it in
    time has more than its level's median (a robust filter: Davies, Fried and Gather 2004).
    """
    steady, places, before = values, np.arange(values.size), np.zeros_like(values)
    for _ in range(ROUNDS):
        middle = ndimage.median(steady, number, np.arange(number.max() + 1))[number]
        bright = np.flatnonzero(middle > max(BRIGHT * float(middle.max()), 0.0))
        if bright.size < STEADY:
            break
        first = np.clip(np.searchsorted(bright, places) - STEADY // 2, 0, bright.size - STEADY)
        near = bright[first[:, None] + np.arange(STEADY)]
        more = values[near] / middle[near] - 1
        i, j = np.triu_indices(STEADY, 1)
        slope = np.median((more[:, j] - more[:, i]) / (near[:, j] - near[:, i]), axis=1)
        at = np.clip(places, near[:, 0], near[:, -1])  # not before the first of them, nor after the last
        trend = np.median(more - slope[:, None] * (near - at[:, None]), axis=1)
        steady = values / (1 + np.maximum(trend, -0.9))
        if np.abs(trend - before).max() < SMALLEST_CHANGE:
            break
        before = trend
    return steady


def _noise(values: Array, number: NDArray[np.intp], tolerance: Tolerance, *, robust: bool) -> Tolerance:
    """Return the standard deviation of readings, a share and a floor, from successive ones of each level.

    Bright levels tell the share, the darkest ones the floor. The robust way takes medians of differences, in
    which bad readings do not hide each other (as the estimators of Rousseeuw and Croux 1993, they need no
    centre); the other one mean squares, which know more of good readings. Half of what is tolerated stands
    for them while there are few.
    """
    same = np.diff(number) == 0
    steps, second = np.abs(np.diff(values))[same], values[1:][same]
    bright = (2 * number[1:][same] > number.max(initial=0)) & (second > 0)
    if steps.size < FEWEST_STEPS or not bright.any():
        return Tolerance(tolerance.share / 2, tolerance.floor / 2)
    typical, square = (np.median, NORMAL_DIFFERENCE**2) if robust else (np.mean, 2.0)
    share = float(typical((steps[bright] / second[bright]) ** 2)) / square
    dark, theirs = steps[:DARKEST] ** 2 / square, share * second[:DARKEST] ** 2
    floor = max(float(np.median(dark - theirs)), 0.0) if robust else float(np.mean(dark[:2]))
    return Tolerance(share**0.5, floor**0.5)


def _most_contradicted(contradicts: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which readings to leave out, so that no two contradict each other: the worst first."""
    n, near = contradicts.shape
    after = np.arange(1, near + 1)
    count = contradicts.sum(axis=1)
    np.add.at(count, (np.arange(n)[:, None] + after)[contradicts], 1)
    out = np.zeros(n, dtype=np.bool_)
    while count.any():
        for worst in np.flatnonzero(count == count.max()):
            before = worst - after[:worst]
            count[worst + after[contradicts[worst]]] -= 1
            count[before[contradicts[before, after[:worst] - 1]]] -= 1
            out[worst] = True
        count[out] = 0
    return out


def last_digits(values: ArrayLike) -> Array:
    """Return the last digit of each reading, as far as all readings together show it.

    A reading of 50.0 may have ended in its units or in its tenths; a meter's last digit does not get finer
    as its readings get larger, so one of 61.3 shows that it was in its tenths. 0 stands for numbers of more
    than nine digits, which nothing has rounded.

    >>> last_digits([0.02, 5.31, 50.0, 61.3, 200.0]).round(9).tolist()
    [0.01, 0.01, 0.1, 0.1, 100.0]
    """
    numbers = np.abs(np.asarray(values, dtype=np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):  # of 0: any digit fits
        exponents = np.floor(np.log10(numbers))
        parts = numbers / 10.0**exponents
    own = np.where(numbers > 0, 0.0, np.inf)
    for places in reversed(range(FINEST_DIGITS)):
        own = np.where(np.abs(parts - np.round(parts, places)) < ROUNDED, 10.0 ** (exponents - places), own)
    brightest = np.argsort(-np.asarray(values), kind="stable")
    own[brightest] = np.minimum.accumulate(own[brightest])
    return own

"""Shares of searches of the same people: rings found, over time as well, and gaps identified correctly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.inference.clustered_shares import clustered_interval
from evenlight.analysis.search.search_trials import BrightnessEffect, SearchTable
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.search import ORIENTATIONS

CHANCE = 1 / len(ORIENTATIONS)
STEPS = 45  # of time in the curves of the share found


@dataclass(frozen=True, slots=True)
class ClusteredShare:
    """A share of searches, with the interval of the share among people like these.

    Attributes
    ----------
    count, n : int
        How many, of how many.
    value : float or None
        Their ratio; None of nothing.
    ci_low, ci_high : float or None
        95 % confidence interval; None of nothing, or of one participant's alone.
    """

    count: int
    n: int
    value: float | None
    ci_low: float | None
    ci_high: float | None


@dataclass(frozen=True, slots=True)
class Orientation:
    """How often the gap of a ring that was found was identified correctly.

    Attributes
    ----------
    correct : ClusteredShare
        Right answers among the rings found.
    pressed_without_seeing : float or None
        Share of the rings "found" whose gap was then guessed among eight, if every ring seen was
        identified correctly: (1 - correct) / (7/8).
    above_chance : bool
        Whether the interval of the share lies above one in eight.
    """

    correct: ClusteredShare
    pressed_without_seeing: float | None
    above_chance: bool


def clustered_share(successes: NDArray[np.bool_], people: NDArray[np.int64]) -> ClusteredShare:
    """Return a share with an interval by people, whose trials are alike (`clustered_interval`).

    Parameters
    ----------
    successes : array (n,) of bool
        Of each trial.
    people : array (n,) of int
        Whose it was.
    """
    n, count = successes.size, int(np.count_nonzero(successes))
    if n == 0:
        return ClusteredShare(0, 0, None, None, None)
    groups = np.unique(people, return_inverse=True)[1]
    if groups.max() == 0:
        return ClusteredShare(count, n, count / n, None, None)
    low, high = clustered_interval(np.bincount(groups[successes], minlength=groups.max() + 1),
                                   np.bincount(groups))  # fmt: skip
    return ClusteredShare(count, n, count / n, low, high)


def detection_share(table: SearchTable, ours: bool) -> ClusteredShare:
    """Return the share of rings found in a version, over all locations."""
    own = table.ours == ours
    return clustered_share(table.found[own], table.participant[own])


def orientation(table: SearchTable, ours: bool) -> Orientation:
    """Return how often the gaps of rings found in a version were identified correctly."""
    own = (table.ours == ours) & table.found & table.gaps_known
    correct = clustered_share(table.correct[own], table.participant[own])
    guessed = None if correct.value is None else min((1 - correct.value) / (1 - CHANCE), 1.0)
    return Orientation(correct, guessed, correct.ci_low is not None and correct.ci_low > CHANCE)


@dataclass(frozen=True, slots=True)
class FoundOverTime:
    """Share of the rings found until a time, of one version on one side.

    Attributes
    ----------
    panel, version : str
        Which side, and which version.
    n : int
        How many searches.
    times, share : array (k,)
        Time [s], and the share found until then.
    low, high : array (k,)
        Pointwise 95 % confidence band over people; nan for one person.
    """

    panel: str
    version: str
    n: int
    times: Array
    share: Array
    low: Array
    high: Array


def found_over_time(table: SearchTable) -> tuple[FoundOverTime, ...]:
    """Return the shares found over time, up to the shortest limit: until then every search is watched.

    So there is nothing censored within, and one minus the Kaplan-Meier curve is the share itself, whose band
    can respect that a person's searches are alike.
    """
    sides = table.sides[table.location]
    curves = []
    for panel, side in (
        ("ours dims", BrightnessEffect.DIMMED),
        ("ours brightens", BrightnessEffect.BRIGHTENED),
    ):
        for version, ours in (("ours", True), ("baseline", False)):
            own = table.some((sides == side) & (table.ours == ours))
            if own.times.size:
                curves.append(_curve(own, panel, version, float(table.limits.min())))
    return tuple(curves)


def _curve(own: SearchTable, panel: str, version: str, limit: float) -> FoundOverTime:
    """Return one curve with its band."""
    times = np.linspace(0.0, limit, STEPS + 1)
    shares = [clustered_share(own.found & (own.times <= time), own.participant) for time in times]
    value, low, high = (
        np.array([np.nan if end is None else end for end in ends])
        for ends in zip(*((s.value, s.ci_low, s.ci_high) for s in shares), strict=True)
    )
    low[0], high[0] = low[0] * 0.0, high[0] * 0.0  # at time 0 nothing can be found; nan stays
    return FoundOverTime(panel, version, own.times.size, times, value, low, high)

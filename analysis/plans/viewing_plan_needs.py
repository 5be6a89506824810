"""How many participants a wanted power takes: counted where the power is exact, else by a line through it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from evenlight.data_schema.plan import MOST_PARTICIPANTS

NUMBERS = np.arange(2, MOST_PARTICIPANTS + 1)
INTERVAL = 1.96  # standard errors: 95 %
NEAR = 0.5  # share of the wanted power that some number tried must reach


@dataclass(frozen=True, slots=True)
class Needed:
    """How many participants are needed, and its 95 % interval; None beyond 1000 or what was tried."""

    participants: int | None
    low: int | None
    high: int | None


def exactly_needed(power: Callable[[ArrayLike], NDArray[np.float64]], wanted: float) -> Needed:
    """Return the number of participants from which on an exact power never falls below the wanted one."""
    lacking = np.flatnonzero(power(NUMBERS) < wanted)
    if lacking.size and lacking[-1] == NUMBERS.size - 1:
        return Needed(None, None, None)
    number = int(NUMBERS[lacking[-1] + 1]) if lacking.size else int(NUMBERS[0])
    return Needed(number, number, number)


def needed_by_line(participants: Sequence[int], power: Sequence[float], runs: int, wanted: float) -> Needed:
    """Return the number of participants at which simulated power reaches the wanted one.

    The power of a test of a mean is Φ(a + b √N): a probit regression on √N takes all numbers that were tried
    together, and its 95 % band gives the interval. Half an experiment is added to either side, so that powers
    of 0 and 1 stay finite. Far from the powers that were tried the line says nothing: if none reaches half
    of the wanted power there is no number; if all are halfway from it to 1, it is the fewest tried.

    Parameters
    ----------
    participants : sequence of int
        Numbers that were tried.
    power : sequence of float
        Share of experiments that found something.
    runs : int
        Experiments of each number.
    wanted : float
        Power.

    >>> numbers = [10, 20, 40]
    >>> power = special.ndtr(0.5 * np.sqrt(numbers) - 1.96)
    >>> needed_by_line(numbers, power, 10**6, 0.8).participants  # (2.80 / 0.5)²
    32
    """
    import statsmodels.genmod.api as models  # half a second, and only needed here

    hits = np.asarray(power) * runs
    counts = np.column_stack([hits + 0.5, runs - hits + 0.5])
    too_high = min(power, default=0.0) >= (1 + wanted) / 2
    if len(participants) < 2 or np.ptp(power) == 0 or too_high:
        return _of_one(participants, power, wanted)
    if max(power) < NEAR * wanted:
        return Needed(None, None, None)
    probit = models.families.Binomial(models.families.links.Probit())
    design = np.column_stack([np.ones(len(participants)), np.sqrt(participants)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of perfect separation: half an experiment keeps all finite
        fit = models.GLM(counts, design, family=probit).fit()
    at = np.column_stack([np.ones(NUMBERS.size), np.sqrt(NUMBERS)])
    line = at @ fit.params
    half = INTERVAL * np.sqrt(np.sum((at @ fit.cov_params()) * at, axis=1))
    return Needed(*(_first(edge >= special.ndtri(wanted)) for edge in (line, line + half, line - half)))


def _of_one(participants: Sequence[int], power: Sequence[float], wanted: float) -> Needed:
    """Return what powers say that give no line: the fewest that were tried, if they are enough."""
    if min(power, default=0.0) < wanted:
        return Needed(None, None, None)
    fewest = min(participants)
    return Needed(fewest, 2, fewest)


def _first(enough: NDArray[np.bool_]) -> int | None:
    """Return the first number that is enough."""
    found = np.flatnonzero(enough)
    return int(NUMBERS[found[0]]) if found.size else None

"""The paper's average of the times, beside what it leaves out: what becomes of rings that nobody found.

A mean over the rings that were found forgets the long searches; counting the undetected with the time limit
shortens them too. Both draw versions together that differ in how many rings stay undetected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.survival_curves import SurvivalCurve, kaplan_meier, restricted_mean
from evenlight.analysis.search.search_trials import SearchTable
from evenlight.data_schema.arrays import Array, Mask


@dataclass(frozen=True, slots=True)
class CellAverages:
    """The times of one version at one location, summarized in every way.

    Attributes
    ----------
    n, undetected : int
        Searches, and those without success.
    mean_found, sem_found : float or None
        Mean over the rings that were found, and its standard error (SD with n - 1) [s]: the paper's average.
    capped_mean : float
        Mean with the time limit for every undetected one [s].
    restricted_mean : float
        Mean of the time until found or until the shortest limit, by the Kaplan-Meier curve [s].
    model_mean : float or None
        Mean of a log-normal distribution fitted to the cell, censored times as such [s].
    curve : SurvivalCurve
        Kaplan-Meier.
    """

    n: int
    undetected: int
    mean_found: float | None
    sem_found: float | None
    capped_mean: float
    restricted_mean: float
    model_mean: float | None
    curve: SurvivalCurve


def cell_averages(table: SearchTable, location: int, ours: bool) -> CellAverages | None:
    """Return the averages of a version at a location; None where nobody searched in it.

    Parameters
    ----------
    table : SearchTable
        All trials.
    location : int
        Its number.
    ours : bool
        Which version.
    """
    own = (table.location == location) & (table.ours == ours)
    if not own.any():
        return None
    times, found = table.times[own], table.found[own]
    seen = times[found]
    curve = kaplan_meier(times, found)
    return CellAverages(
        n=times.size,
        undetected=int(np.count_nonzero(~found)),
        mean_found=float(seen.mean()) if seen.size else None,
        sem_found=float(seen.std(ddof=1)) / math.sqrt(seen.size) if seen.size > 1 else None,
        capped_mean=float(times.mean()),
        restricted_mean=restricted_mean(curve, float(table.limits[own].min())),
        model_mean=_log_normal_mean(table.model_times[own], found),
        curve=curve,
    )


def _log_normal_mean(times: Array, found: Mask) -> float | None:
    """Return the mean e^(μ + σ²/2) of a log-normal distribution fitted by maximum likelihood.

    None where fewer than half, or fewer than three, were found: it would be made of what nobody saw.
    """
    from scipy import stats

    logs = np.log(times)
    if np.count_nonzero(found) < max(3, times.size / 2) or np.ptp(logs[found]) == 0:
        return None
    if found.all():
        return float(np.exp(logs.mean() + logs.var() / 2))
    censored = stats.CensoredData.right_censored(logs, ~found)
    mu, sigma = stats.norm.fit(censored)
    return float(np.exp(mu + sigma**2 / 2))

"""Each location by itself, and the line over all of them.

A mean over the rings that were found (the paper's average) forgets the long searches; counting the undetected
ones with the time limit shortens them too. Both make versions look alike that differ in how many rings stay
undetected. Hence medians by Kaplan-Meier, and ratios by the model (`search_models`), beside those averages.

The effects of ours at the locations, each with its standard error, are values of a line over ln(brightness
ratio) with a scatter τ of their own, by restricted likelihood (`analysis.inference.mixed_model`; in
meta-analysis: random-effects meta-regression). So the slope holds for locations like these, and one odd
location ("Corridor" in the paper) makes it uncertain instead of certain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.inference.binomial_tests import mid_p_interval
from evenlight.analysis.inference.exact_tests import holm
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.mixed_model import GroupedEstimates, fit_mixed_model
from evenlight.analysis.inference.survival_curves import SurvivalCurve, kaplan_meier, restricted_mean
from evenlight.analysis.search.search_pairs import Detections, SearchPairs, detections
from evenlight.analysis.search.search_trials import Location, SearchTable
from evenlight.data_schema.arrays import Array, Mask

FEWEST = 4  # locations of a line with a scatter of its own
TOO_FEW = f"fewer than {FEWEST} locations with an effect of their own"
ALL_ALIKE = "all locations have the same ratio of brightness"


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


@dataclass(frozen=True, slots=True)
class LocationCell:
    """One version at one location.

    Attributes
    ----------
    averages : CellAverages
        Its times.
    share_found : float
        Share of the searches in which the ring was found.
    share_low, share_high : float
        95 % confidence interval of that share (mid-p).
    """

    averages: CellAverages
    share_found: float
    share_low: float
    share_high: float


@dataclass(frozen=True, slots=True)
class LocationResult:
    """What was found at one location.

    Attributes
    ----------
    location : Location
        Where.
    ours, baseline : LocationCell or None
        The versions; None for one in which nobody searched there.
    detections : Detections or None
        Comparison of the shares found, within people; None without anybody who searched in both.
    p_holm : float or None
        Its p value, adjusted for the number of locations (Holm, 1979).
    """

    location: Location
    ours: LocationCell | None
    baseline: LocationCell | None
    detections: Detections | None
    p_holm: float | None


def location_results(table: SearchTable, pairs: SearchPairs) -> tuple[LocationResult, ...]:
    """Return what was found at each location, in the table's order."""
    tests = [_detections(pairs, k) for k in range(len(table.locations))]
    adjusted = holm([None if test is None else test.p_value for test in tests])
    return tuple(
        LocationResult(
            location=place,
            ours=_cell(table, k, True),
            baseline=_cell(table, k, False),
            detections=test,
            p_holm=adjusted[k],
        )
        for k, (place, test) in enumerate(zip(table.locations, tests, strict=True))
    )


def _detections(pairs: SearchPairs, location: int) -> Detections | None:
    """Return the comparison of the shares found at a location."""
    own = pairs.at(pairs.location == location)
    return detections(own) if own.first.size else None


def _cell(table: SearchTable, location: int, ours: bool) -> LocationCell | None:
    """Return a version at a location."""
    averages = cell_averages(table, location, ours)
    if averages is None:
        return None
    found = averages.n - averages.undetected
    return LocationCell(averages, found / averages.n, *mid_p_interval(found, averages.n))


@dataclass(frozen=True, slots=True)
class LocationLine:
    """The effect of ours in ln(time) over x = ln(factor of ours / of the baseline).

    Attributes
    ----------
    intercept, slope : FixedEffect
        At equal brightness, and per unit of x.
    scatter : float
        τ: standard deviation of locations about the line.
    covariance : array (2, 2)
        Of intercept and slope.
    slope_error_without_scatter : float
        Standard error of the slope if locations did not scatter.
    locations : tuple of int
        Which have an effect of their own.
    shrunken : array
        Their effects, drawn to the line as far as they are uncertain.
    """

    intercept: FixedEffect
    slope: FixedEffect
    scatter: float
    covariance: Array
    slope_error_without_scatter: float
    locations: tuple[int, ...]
    shrunken: Array

    @property
    def df(self) -> int:
        """Degrees of freedom."""
        return len(self.locations) - 2

    def band(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the line, and the ends of its pointwise 95 % confidence band."""
        design = np.column_stack([np.ones_like(x), x])
        middle = design @ [self.intercept.estimate, self.slope.estimate]
        half = _quantile(self.df) * np.sqrt(np.einsum("ni,ij,nj->n", design, self.covariance, design))
        return middle, middle - half, middle + half


def line_over_locations(effects: Mapping[int, FixedEffect], ln_ratios: Array) -> LocationLine | str:
    """Return the line through the effects at the locations; words that say why there is none.

    Parameters
    ----------
    effects : mapping of int to FixedEffect
        Of ours, at each location; those without a number are left out.
    ln_ratios : array
        x of each location.
    """
    known = tuple(k for k, effect in effects.items() if effect.standard_error)
    if len(known) < FEWEST:
        return TOO_FEW
    x = ln_ratios[list(known)]
    if np.ptp(x) == 0:
        return ALL_ALIKE
    values = np.array([effects[k].estimate for k in known], dtype=np.float64)
    errors = np.array([effects[k].standard_error for k in known], dtype=np.float64)
    design = np.column_stack([np.ones_like(x), x])
    fit = fit_mixed_model(GroupedEstimates(values, errors, design, np.arange(x.size)))
    fixed = np.linalg.inv(design.T @ (design / errors[:, None] ** 2))
    on_line = design @ fit.coefficients
    kept = fit.group_sd**2 / (fit.group_sd**2 + errors**2)
    return LocationLine(
        intercept=_effect("at equal brightness", fit.coefficients[0], fit.covariance[0, 0], x.size - 2),
        slope=_effect("ln brightness ratio", fit.coefficients[1], fit.covariance[1, 1], x.size - 2),
        scatter=fit.group_sd,
        covariance=fit.covariance,
        slope_error_without_scatter=math.sqrt(fixed[1, 1]),
        locations=known,
        shrunken=on_line + kept * (values - on_line),
    )


def for_people_and_locations(people: FixedEffect, line: LocationLine, n_people: int) -> FixedEffect | None:
    """Return the slope with the uncertainty of people like these at locations like these.

    Of both analyses, one in which people and one in which locations are random, each holds the scatter of
    trials: Var = Var_people + Var_locations - Var_trials, as in the quasi-F (Clark, 1973; Judd, Westfall &
    Kenny, 2012); degrees of freedom by Satterthwaite.

    Parameters
    ----------
    people : FixedEffect
        The slope, over people.
    line : LocationLine
        The line, over locations.
    n_people : int
        How many people.
    """
    if people.estimate is None or people.standard_error is None or line.slope.standard_error is None:
        return None
    if n_people < 2:
        return None
    by_people, by_locations = people.standard_error**2, line.slope.standard_error**2
    variance = max(by_people + by_locations - line.slope_error_without_scatter**2, by_people, by_locations)
    df = variance**2 / (by_people**2 / (n_people - 1) + by_locations**2 / line.df)
    df = min(max(df, min(n_people - 1, line.df)), n_people + line.df)
    return _effect("ln brightness ratio", people.estimate, variance, df)


def _effect(name: str, estimate: float, variance: float, df: float) -> FixedEffect:
    """Return an estimate with Student's interval and test."""
    error = math.sqrt(variance)
    half = _quantile(df) * error
    p_value = float(2 * special.stdtr(df, -abs(estimate) / error))
    return FixedEffect(name, float(estimate), error, estimate - half, estimate + half, p_value, df)


def _quantile(df: float) -> float:
    """Return the 97.5 % point of Student's t."""
    return float(special.stdtrit(df, 0.975))

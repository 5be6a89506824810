"""The rows of single locations: every number that the table and the figure of the detection times show."""

from __future__ import annotations

import math
from dataclasses import replace

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.search.search_locations import Cell, LocationResult
from evenlight.analysis.search.search_results import SearchResults
from evenlight.data_schema.statistic import Origin, Statistic

LEVEL = 0.95
RATIO = "time ratio, ours / baseline"
MODEL = "log-normal times, undetected rings censored; n: searches in the model"
NOT_SEARCHED = "nobody searched there in this version"
NOT_BOTH = "nobody searched there in both versions"
NOBODY = "nobody found the ring"
ONE_FOUND = "one ring found: no standard error"
LITTLE_FOUND = "too few were found for a model of the rest"
NOT_IN_MODELS = "nobody found a ring there, or only one version was searched in"


def location_rows(found: SearchResults) -> tuple[Statistic, ...]:
    """Return the rows of all locations."""
    rows: list[Statistic] = []
    for result in found.locations:
        name = result.location.name
        for version, cell, factor in (
            ("ours", result.ours, result.location.ours),
            ("baseline", result.baseline, result.location.baseline),
        ):
            flag = "" if cell else NOT_SEARCHED
            rows.append(
                Statistic("locations", name, f"brightness factor, {version}", factor, "1", Origin.COMPUTED,
                          flag=flag)
            )  # fmt: skip
            if cell is not None:
                rows += _cell_rows(name, version, cell, found.origin)
        rows.append(_detection_row(result, found.origin))
    return (*rows, *_ratio_rows(found))


def _cell_rows(name: str, version: str, cell: Cell, origin: Origin) -> list[Statistic]:
    """Return the rows of one version at one location."""
    a = cell.averages
    n_found = a.n - a.undetected
    none = "" if a.mean_found is not None else NOBODY
    interval = a.curve.median_low is not None
    return [
        Statistic("locations", name, f"rings found, {version}", cell.share_found, "1", origin, cell.share_low,
                  cell.share_high, LEVEL, n=a.n, method="interval: mid-p"),
        Statistic("locations", name, f"undetected, {version}", float(a.undetected), "1", origin, n=a.n),
        Statistic("locations", name, f"median search time, {version}", a.curve.median, "s", origin,
                  a.curve.median_low, a.curve.median_high, LEVEL if interval else None, n=a.n,
                  method="Kaplan-Meier; interval: log-log (Brookmeyer and Crowley)", flag=a.curve.flag),
        Statistic("averages", name, f"mean of the rings found, {version}", a.mean_found, "s", origin,
                  n=n_found, method="the paper's; undetected rings are left out", flag=none),
        Statistic("averages", name, f"standard error of that mean, {version}", a.sem_found, "s", origin,
                  n=n_found, method="SD with n - 1",
                  flag="" if a.sem_found is not None else none or ONE_FOUND),
        Statistic("averages", name, f"mean, undetected at the limit, {version}", a.capped_mean, "s", origin,
                  n=a.n, method="undetected rings count with the time limit"),
        Statistic("averages", name, f"restricted mean, {version}", a.restricted_mean, "s", origin, n=a.n,
                  method="area under the Kaplan-Meier curve up to the shortest time limit"),
        Statistic("averages", name, f"mean by the model, {version}", a.model_mean, "s", origin, n=a.n,
                  method="log-normal distribution of this version here, undetected rings censored",
                  flag="" if a.model_mean is not None else none or LITTLE_FOUND),
    ]  # fmt: skip


def _detection_row(result: LocationResult, origin: Origin) -> Statistic:
    """Return the comparison of the shares found at a location."""
    test, what = result.detections, "rings found, ours - baseline"
    method = "within people; exact test of McNemar, Holm over locations; interval: Bonett and Price"
    if test is None:
        return Statistic("locations", result.location.name, what, None, "1", origin, flag=NOT_BOTH)
    return Statistic(
        "locations", result.location.name, what, test.difference, "1", origin, test.ci_low, test.ci_high,
        LEVEL, test.p_value, result.p_holm, test.n, method,
    )  # fmt: skip


def _ratio_rows(found: SearchResults) -> list[Statistic]:
    """Return the ratios of times at each location, by themselves and drawn to the line over all of them."""
    effects = found.models.by_location
    rows = []
    for k, place in enumerate(found.table.locations):
        n = found.models.n_by_location.get(k, 0)
        effect = effects.get(k, FixedEffect(place.name, None, None, None, None, None, flag=NOT_IN_MODELS))
        row = Statistic("locations", place.name, RATIO, None, "1", found.origin, n=n,
                        method=f"{MODEL}; p adjusted over locations (Holm)", flag="-")  # fmt: skip
        rows.append(ratio_row(row, effect, found.ratio_p.get(k)))
    if not isinstance(found.line, str):
        for k, value in zip(found.line.locations, found.line.shrunken, strict=True):
            rows.append(
                Statistic("locations", found.table.locations[k].name, "time ratio, drawn to the line",
                          math.exp(value), "1", found.origin, n=len(found.line.locations),
                          method="best linear prediction: between its own ratio and the line over brightness")
            )  # fmt: skip
    return rows


def ratio_row(row: Statistic, effect: FixedEffect, p_adjusted: float | None = None) -> Statistic:
    """Return a row with an effect on ln(time), as a ratio of times.

    Parameters
    ----------
    row : Statistic
        The row without its numbers: table, group, what, origin, n, method.
    effect : FixedEffect
        The effect.
    p_adjusted : float, optional
        Its p value, adjusted for the number of tests.
    """
    low, high = (None if end is None else math.exp(end) for end in (effect.ci_low, effect.ci_high))
    value = None if effect.estimate is None else math.exp(effect.estimate)
    flag = effect.flag or ("" if value is not None else "the data do not give it")
    interval = None if low is None and high is None else LEVEL
    return replace(
        row, value=value, ci_low=low, ci_high=high, interval=interval, p_value=effect.p_value,
        p_adjusted=p_adjusted, flag=flag,
    )  # fmt: skip

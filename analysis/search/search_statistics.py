"""The rows of the search: every number that its tables and figures show, and those behind them."""

from __future__ import annotations

import math
from dataclasses import replace

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.lognormal_times import TimesFit
from evenlight.analysis.search.search_locations import LocationCell, LocationResult
from evenlight.analysis.search.search_models import BRIGHTNESS, ORDER, VERSION, VISIT, SideEffect, effect_of
from evenlight.analysis.search.search_results import (
    EVERYWHERE,
    ONE_PERSON_ONLY,
    DetectionChange,
    FirstFound,
    SearchResults,
)
from evenlight.analysis.search.search_shares import ClusteredShare, Orientation
from evenlight.data_schema.analysis_results import Origin, Statistic

PRIMARY = "the primary test"
SECONDARY = "secondary, not adjusted"
NO_SPREAD = "at its lower end: no difference between participants is seen"
CLUSTERED = (
    "Clopper-Pearson interval at the effective number of searches (Korn & Graubard 1998), of all or nothing "
    "at the number of participants; n: searches"
)
EXCHANGED = f"exact p: the versions exchanged person by person; {SECONDARY}"
OVER_PEOPLE = (
    f"interval and p: Student's t over people, standard error at least that of independent pairs; {SECONDARY}"
)
NO_SD = 1e-4  # of ln(time): the likelihood is largest at 0, which a search for it nears
NOT_TOLD = "the data do not tell it from the scatter of searches"
SLOPE = "change of ln(time) per ln(brightness ratio)"
LIKE_LOCATIONS = "these people, at locations like these"
LIKE_PEOPLE = "people like these, at these locations"
LIKE_BOTH = "people and locations like these"
NO_COMBINATION = "the slope over people or over locations is missing"
# Columns of the model, and what their effects are.
ORDER_EFFECTS = {
    VISIT: "time ratio, second half / first half",
    ORDER: "time ratio, ten trials later in a half",
}
NOT_VARIED = "does not vary in these data, or is unknown"
LEVEL = 0.95
RATIO = "time ratio, ours / baseline"
MODEL = "log-normal times, undetected rings censored; n: searches in the model"
NOT_SEARCHED = "nobody searched there in this version"
UNKNOWN = "it is unknown"
NOT_BOTH = "nobody searched there in both versions"
NOBODY = "nobody found the ring"
ONE_FOUND = "one ring found: no standard error"
LITTLE_FOUND = "too few were found for a model of the rest"
NOT_IN_MODELS = "nobody found a ring there, or only one version was searched in"


def statistics_of(found: SearchResults) -> tuple[Statistic, ...]:
    """Return the rows of a search."""
    return (
        *_version_rows(found),
        *_brightness_rows(found),
        *_order_rows(found),
        *(row for name, first in found.first.items() for row in _first_rows(name, first, found.origin)),
        *(
            row
            for name, change in found.detection.items()
            for row in _detection_rows(name, change, found.origin)
        ),
        *_share_rows(found),
        *_bias_rows(found),
        *location_rows(found),
    )


def _version_rows(found: SearchResults) -> list[Statistic]:
    """Return the time ratios over all locations and on either side, with the slowing that is excluded."""
    models, origin = found.models, found.origin
    overall = models.overall
    rows = [_ratio("versions", EVERYWHERE, effect_of(overall, VERSION), overall.n, origin)]
    for side in models.sides:
        group = f"{side.side.value} ({side.locations} locations)"
        rows.append(_ratio("versions", group, side.effect, side.n, origin))
        rows.append(_slowing_row(group, side, found))
    return [*rows, *_spread_rows(overall, origin)]


def _spread_rows(fit: TimesFit, origin: Origin) -> list[Statistic]:
    """Return how searches and participants scatter about the model."""
    between_people = fit.n_groups > 1
    rows = []
    for what, sd, known in (
        ("SD of ln(time) between searches", fit.residual_sd, True),
        ("SD of ln(time) between participants", fit.group_sd, between_people),
        ("SD of the effect of ours on ln(time) between participants", fit.slope_sd, between_people),
    ):
        value = sd if known and sd is not None and math.isfinite(sd) else None
        if value is not None:
            flag = NO_SPREAD if value < NO_SD else ""
        else:
            flag = effect_of(fit, VERSION).flag if fit.log_likelihood is None else ""
            flag = flag or (NOT_TOLD if between_people else ONE_PERSON_ONLY)
        rows.append(
            Statistic("versions", EVERYWHERE, what, value, "1", origin, n=fit.n, method=MODEL, flag=flag)
        )
    return rows


def _ratio(
    table: str, group: str, effect: FixedEffect, n: int, origin: Origin, what: str = RATIO
) -> Statistic:
    """Return an effect on ln(time) as a row."""
    method = f"{MODEL}; {SECONDARY}"
    return ratio_row(Statistic(table, group, what, None, "1", origin, n=n, method=method, flag="-"), effect)


def _slowing_row(group: str, side: SideEffect, found: SearchResults) -> Statistic:
    """Return the largest slowing that is not excluded, and the test of the one that would be a loss."""
    largest = side.slowing_high
    return Statistic(
        "versions", group, "largest time ratio that is not excluded",
        None if largest is None else math.exp(largest), "1", found.origin,
        p_value=side.slowing_p, n=side.n,
        method=f"one-sided at 5 %, by the standard error; p: of a ratio of {1 + found.slowing:g} or more "
               f"(small: excluded); {SECONDARY}; n: searches",
        flag=side.effect.flag or ("" if largest is not None else "the data do not give it"),
    )  # fmt: skip


def _brightness_rows(found: SearchResults) -> list[Statistic]:
    """Return the interaction with brightness: for people, for locations, for both."""
    fit, line, origin = found.models.brightness, found.line, found.origin
    at_equal = effect_of(fit, VERSION)
    rows = [
        _slope_row(LIKE_PEOPLE, people_slope(fit), origin, fit.n_groups,
                   f"log-normal times; the slope differs between people; {PRIMARY}; n: participants"),
        _ratio("brightness", EVERYWHERE, at_equal, fit.n, origin,
               "time ratio at equal brightness (a check: 1)"),
    ]  # fmt: skip
    if isinstance(line, str):
        rows.append(Statistic("brightness", LIKE_LOCATIONS, SLOPE, None, "1", origin, flag=line))
        return rows
    n = len(line.locations)
    both = found.both or FixedEffect("", None, None, None, None, None, flag=NO_COMBINATION)
    return [
        *rows,
        _slope_row(LIKE_LOCATIONS, line.slope, origin, n,
                   "line through the ratios of the locations, which scatter about it (REML); "
                   f"{SECONDARY}; n: locations"),
        _slope_row(LIKE_BOTH, both, origin, n,
                   f"both scatters (quasi-F, Satterthwaite); {SECONDARY}; n: locations"),
        Statistic("brightness", EVERYWHERE, "SD of locations about the line, in ln(time)", line.scatter, "1",
                  origin, n=n, method="restricted maximum likelihood; n: locations"),
    ]  # fmt: skip


def people_slope(fit: TimesFit) -> FixedEffect:
    """Return the slope for people like these: of one participant's searches neither interval nor test."""
    effect = effect_of(fit, BRIGHTNESS)
    if fit.n_groups > 1:
        return effect
    flag = effect.flag if effect.estimate is None else ONE_PERSON_ONLY
    return replace(effect, ci_low=None, ci_high=None, p_value=None, flag=flag or ONE_PERSON_ONLY)


def _slope_row(group: str, effect: FixedEffect, origin: Origin, n: int, method: str) -> Statistic:
    """Return a slope of ln(time) over ln(factor) as a row."""
    flag = effect.flag or ("" if effect.estimate is not None else "the data do not give it")
    interval = None if effect.ci_low is None and effect.ci_high is None else LEVEL
    return Statistic(
        "brightness", group, SLOPE, effect.estimate, "1", origin, effect.ci_low, effect.ci_high, interval,
        effect.p_value, None, n, method, flag,
    )  # fmt: skip


def _order_rows(found: SearchResults) -> list[Statistic]:
    """Return what practice does."""
    fit = found.models.overall
    names = {effect.name for effect in fit.effects}
    return [
        _ratio("order", EVERYWHERE, effect_of(fit, name), fit.n, found.origin, what)
        if name in names
        else Statistic("order", EVERYWHERE, what, None, "1", found.origin, n=fit.n, flag=NOT_VARIED)
        for name, what in ORDER_EFFECTS.items()
    ]


def _first_rows(group: str, first: FirstFound, origin: Origin) -> list[Statistic]:
    """Return the hazard ratio and the pairs that it rests on."""
    hazard = first.hazard
    low, value, high = (
        None if x is None else math.exp(x) for x in (hazard.ci_low, hazard.ln_ratio, hazard.ci_high)
    )
    n = hazard.ours_first + hazard.baseline_first
    method = f"Cox, stratified by participant and location; {OVER_PEOPLE}; n: pairs"
    rows = [
        Statistic("first found", group, "hazard ratio, ours / baseline", value, "1", origin, low, high,
                  None if low is None else LEVEL, hazard.p_value, None, n, method, hazard.flag),
        Statistic("first found", group, "pairs, ours found first - baseline found first",
                  float(first.difference), "1", origin, p_value=first.p_value, n=n,
                  method=f"{EXCHANGED}; n: pairs", flag=ONE_PERSON_ONLY if first.p_value is None else ""),
    ]  # fmt: skip
    for what, count in (
        ("pairs, ours found first", hazard.ours_first),
        ("pairs, baseline found first", hazard.baseline_first),
        ("pairs, both after the same time (left out)", hazard.tied),
        ("pairs, neither known to be first (left out)", hazard.unknown),
    ):
        rows.append(Statistic("first found", group, what, float(count), "1", origin))
    return rows


def _detection_rows(group: str, change: DetectionChange, origin: Origin) -> list[Statistic]:
    """Return the difference of the shares found, and of the numbers."""
    return [
        Statistic("detections", group, "rings found, ours - baseline", change.difference, "1", origin,
                  change.ci_low, change.ci_high, None if change.ci_low is None else LEVEL, change.p_value,
                  None, change.n, f"within people and locations; {OVER_PEOPLE}; n: pairs", change.flag),
        Statistic("detections", group, "number of rings found, ours - baseline", float(change.more), "1",
                  origin, p_value=change.exact_p, n=change.n, method=f"{EXCHANGED}; n: pairs",
                  flag=ONE_PERSON_ONLY if change.exact_p is None else ""),
    ]  # fmt: skip


def _share_rows(found: SearchResults) -> list[Statistic]:
    """Return the shares found, and the gaps identified correctly, of either version."""
    rows = []
    for ours, version in ((True, "ours"), (False, "baseline")):
        rows.append(_share_row("detections", f"rings found, {version}", found.shares[ours], found.origin))
        told = found.orientation[ours]
        rows.append(
            _share_row("orientation", f"gaps identified correctly, {version}", told.correct, found.origin)
        )
        rows.append(_guessed_row(version, told, found.origin))
    if not found.table.gaps_known:
        rows = [replace(row, flag=UNKNOWN) if row.table == "orientation" else row for row in rows]
    return rows


def _share_row(table: str, what: str, share: ClusteredShare, origin: Origin) -> Statistic:
    """Return a share as a row."""
    flag = "nothing was found" if share.value is None else ONE_PERSON_ONLY if share.ci_low is None else ""
    return Statistic(
        table, EVERYWHERE, what, share.value, "1", origin, share.ci_low, share.ci_high,
        None if share.ci_low is None else LEVEL, n=share.n, method=CLUSTERED, flag=flag,
    )  # fmt: skip


def _guessed_row(version: str, told: Orientation, origin: Origin) -> Statistic:
    """Return how many of the rings found may have been none."""
    flag = "nothing was found" if told.pressed_without_seeing is None else ""
    if not flag and not told.above_chance:
        flag = "not shown to be above chance (1/8): the times may be of guesses"
    return Statistic(
        "orientation", EVERYWHERE, f"rings found without being seen, {version}", told.pressed_without_seeing,
        "1", origin, n=told.correct.n,
        method="(1 - share identified correctly) / (7/8): guesses hit one in eight",
        flag=flag,
    )  # fmt: skip


def _bias_rows(found: SearchResults) -> list[Statistic]:
    """Return the overall time ratio as it comes out if undetected rings are dealt with in other ways."""
    models = found.models
    return [
        _ratio("undetected", EVERYWHERE, effect_of(fit, VERSION), fit.n, found.origin, f"{RATIO}; {what}")
        for what, fit in (
            ("undetected rings censored", models.overall),
            ("undetected rings left out, as in the paper's average", models.dropped),
            ("undetected rings as found at the limit", models.capped),
            ("gaps identified wrongly count as undetected", models.wrong),
        )[: 4 if found.table.gaps_known else 3]
    ]


def location_rows(found: SearchResults) -> tuple[Statistic, ...]:
    """Return the rows of all locations."""
    rows: list[Statistic] = []
    for result in found.locations:
        name = result.location.name
        for version, cell, factor in (
            ("ours", result.ours, result.location.ours),
            ("baseline", result.baseline, result.location.baseline),
        ):
            flag = NOT_SEARCHED if cell is None else "" if factor is not None else UNKNOWN
            rows.append(
                Statistic("locations", name, f"brightness factor, {version}", factor, "1", Origin.COMPUTED,
                          flag=flag)
            )  # fmt: skip
            if cell is not None:
                rows += _cell_rows(name, version, cell, found.origin)
        rows.append(_detection_row(result, found.origin))
    return (*rows, *_ratio_rows(found))


def _cell_rows(name: str, version: str, cell: LocationCell, origin: Origin) -> list[Statistic]:
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
    method = (
        "within people; exact test of McNemar, Holm over locations; interval: what the test does not reject, "
        "joined with that of Bonett and Price"
    )
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

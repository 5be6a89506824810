"""Models of the search times: what ours does to them, in the dark and in the bright.

ln(time) is normal, with an effect of each place of a ring, of each person, of the half of the session and of
the order within it; undetected rings are censored at the time limit
(`analysis.inference.lognormal_times`). The version's effect differs between persons (a random slope), so that
it is tested between them: docs/decisions/search-inference.md. Where people searched a location several times
in a version, all standard errors are over people.

The effects of ours at the locations, each with its standard error, are values of a line over ln(brightness
ratio) with a scatter τ of their own, by restricted likelihood (`analysis.inference.mixed_model`; in
meta-analysis: random-effects meta-regression). So the slope holds for locations like these, and one odd
location ("Corridor" in the paper) makes it uncertain instead of certain.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from evenlight.analysis.inference.fixed_effects import FitFlag, FixedEffect, Flag, student_effect
from evenlight.analysis.inference.lognormal_times import (
    CensoredTimes,
    TimesFit,
    fit_lognormal_times,
    times_fit_without_numbers,
)
from evenlight.analysis.inference.mixed_model import GroupedEstimates, fit_mixed_model
from evenlight.analysis.search.search_pairs import SearchFlag
from evenlight.analysis.search.search_trials import BrightnessEffect, SearchTable
from evenlight.data_schema.arrays import Array

PEOPLE_FOR_SPOTS = 4  # over so many each place of a ring is seen in either version (viewing-orders.md)
LEAST_SCATTER = 0.005  # of ln(time): half a per cent, less than any clock of a participant
VERSION, BRIGHTNESS = "ours", "ln brightness ratio"
VISIT, ORDER = "second half", "ten trials later"
FEWEST = 4  # locations of a line with a scatter of its own
TOO_FEW = f"fewer than {FEWEST} locations with an effect of their own"
ALL_ALIKE = "all locations have the same ratio of brightness"
# What is done with undetected rings.
CENSORED = "undetected rings censored"
DROPPED = "undetected rings left out, as in the paper's average"
CAPPED = "undetected rings as found at the limit"
WRONG = "gaps identified wrongly count as undetected"
RIGHT = "right answers alone: searches that a wrong one ended are left out"


def version_fit(table: SearchTable, profiled: bool = True) -> TimesFit:
    """Return the model with one effect of ours on ln(time), `VERSION`, over all locations.

    Interval and test go by the profile of the likelihood, or by the standard error, which is quicker.
    """
    used = informative(table)
    return _fit(used, {VERSION: _ours(used)}, VERSION, profiled=profiled)


def treated_fits(table: SearchTable, overall: TimesFit) -> dict[str, TimesFit]:
    """Return the model by the treatment of undetected rings: that in which they are censored, and others.

    Intervals of the others are by the standard error.
    """
    found, wrong = table.found, table.found & ~table.correct
    dropped = capped = overall
    if not found.all():
        dropped = version_fit(table.some(found), False) if found.any() else overall
        capped = version_fit(replace(table, found=np.ones_like(found)), False)
    ways = {CENSORED: overall, DROPPED: dropped, CAPPED: capped}
    if table.gaps_known:
        ways[WRONG] = version_fit(table.without_wrong(), False) if wrong.any() else overall
    if table.wrong.any():
        ways[RIGHT] = version_fit(table.some(~table.wrong), False)
    return ways


def brightness_fit(table: SearchTable) -> TimesFit:
    """Return the model in which ours acts by its brightness: the slope of ln(time) over ln(factor).

    At equal brightness the versions are the same picture, so that the effect of ours beside it is a check of
    the model rather than a finding.
    """
    known = table.of_known_brightness
    if table.times.size and not known.times.size:
        return _without_numbers(known, (BRIGHTNESS, VERSION), (), (FitFlag.NONE, SearchFlag.FACTORS_UNKNOWN))
    ours = _ours(known)
    return _fit(known, {BRIGHTNESS: ours * known.ln_ratio, VERSION: ours}, BRIGHTNESS)


def effects_by_location(table: SearchTable, over_people: bool = True) -> dict[int, FixedEffect]:
    """Return the effect of ours at each location, of one model with one effect for each.

    Of repeated searches it is that for people like these, or else for these people.
    """
    places = np.unique(table.location).tolist()
    columns = {str(k): _ours(table) * (table.location == k) for k in places}
    fit = _fit(table, columns, None, over_people=over_people)
    return {k: effect_of(fit, str(k)) for k in places}


def effects_by_side(table: SearchTable) -> dict[BrightnessEffect, FixedEffect]:
    """Return the effect of ours where it brightens, hardly does either, and dims, of one model for all.

    The model has an effect of ours on the first side, and what is added to it on the others; the effect on
    each is a contrast, with the random slope of the version that its test needs. A side without a location
    is left out.
    """
    table = table.of_known_brightness
    sides = table.sides[table.location]
    masks = {side: sides == side for side in BrightnessEffect}
    present = {side: mask for side, mask in masks.items() if mask.any()}
    if not present:
        return {}
    added = {f"added where {side.value}": _ours(table) * mask for side, mask in list(present.items())[1:]}
    sums = {side.value: (VERSION, *list(added)[max(k - 1, 0) : k]) for k, side in enumerate(present)}
    fit = _fit(table, {VERSION: _ours(table), **added}, VERSION, sums)
    return dict(zip(present, fit.contrasts, strict=True))


def effect_of(fit: TimesFit, name: str) -> FixedEffect:
    """Return an effect of a fit by its name."""
    return next(effect for effect in fit.effects if effect.name == name)


def people_slope(fit: TimesFit) -> FixedEffect:
    """Return the slope for people like these: of one participant's searches neither interval nor test."""
    effect = effect_of(fit, BRIGHTNESS)
    if fit.n_groups > 1:
        return effect
    alone: tuple[Flag, ...] = (SearchFlag.ONE_PERSON_ONLY,)
    flags = alone if effect.estimate is not None else effect.flags or alone
    return replace(effect, ci_low=None, ci_high=None, p_value=None, flags=flags)


def informative(table: SearchTable) -> SearchTable:
    """Return the trials that can say something: at places where a participant found a ring, in both versions.

    Where nobody did, the effect of the place is infinite, and explains all of its trials: leaving them out is
    the maximum of the likelihood, not a choice. Where nobody found anything at all, all trials stay: they are
    what says so.
    """
    if not table.found.any():
        return table
    places = _places(table)
    found_at = np.bincount(places, weights=table.found) > 0
    both = [place.in_both for place in table.locations]
    return table.some(found_at[places] & np.array(both)[table.location])


def _places(table: SearchTable) -> np.ndarray:
    """Return what has an effect of its own: places of rings, or locations where few people searched.

    The two places of a ring at a location differ; with fewer than four people one of them may have been seen
    in one version alone, and its effect would take the version's for itself.
    """
    few = np.unique(table.participant).size < PEOPLE_FOR_SPOTS
    return np.unique(table.location if few else table.spot, return_inverse=True)[1]


def _fit(
    table: SearchTable,
    columns: Mapping[str, Array],
    slope: str | None,
    sums: Mapping[str, Sequence[str]] | None = None,
    profiled: bool = True,
    over_people: bool = True,
) -> TimesFit:
    """Return the model with some columns beside places, half and order.

    The column `slope` differs between people; its interval, or those of the sums, go by the profile, unless
    all are by the standard error, or by that over people, as those of repeated searches are. A sum is a
    contrast: names of columns whose effects are added.
    """
    places = _places(table)
    dummies = np.eye(int(places.max(initial=-1)) + 1)[places]
    nuisance = {VISIT: table.visit, ORDER: table.order}
    own = {**columns, **{name: value for name, value in nuisance.items() if np.unique(value).size > 1}}
    names = (*own, *(f"place {k}" for k in range(dummies.shape[1])))
    contrasts = {name: [float(column in added) for column in names] for name, added in (sums or {}).items()}
    design = np.column_stack([*own.values(), dummies])
    why = _unfit(table, design)
    if why is not None:
        return _without_numbers(table, names, sums or (), why)
    data = CensoredTimes(
        times=table.model_times,
        observed=table.found,
        design=design,
        names=names,
        groups=np.unique(table.participant, return_inverse=True)[1],
        slope_column=None if slope is None else names.index(slope),
    )
    wanted = tuple(sums or ()) or (() if slope is None else (slope,))
    clustered = over_people and table.repeated
    return with_flags(fit_lognormal_times(data, contrasts, wanted if profiled else (), clustered=clustered))


def with_flags(fit: TimesFit) -> TimesFit:
    """Return a fit whose effects have its flags as their own, so that no row or table goes without them.

    That an effect runs to infinity is said of all where it is one of places or order; one of the version says
    so itself, and hardly touches that at other locations.
    """
    more: list[Flag] = [SearchFlag.ONE_PERSON] if FitFlag.ONE_PARTICIPANT in fit.flags else []
    more += [FitFlag.NOT_CONVERGED] if FitFlag.NOT_CONVERGED in fit.flags else []
    every = (*fit.effects, *fit.contrasts)
    order = [e for e in every if e.name in (VISIT, ORDER) or e.name.startswith("place ")]
    runs = any(effect.endless for effect in order)
    more += [FitFlag.SEPARATED] if runs else []

    def flagged(effect: FixedEffect) -> FixedEffect:
        if effect.estimate is None and effect.ci_low is None and effect.ci_high is None:
            return effect  # its own flags say why
        return replace(effect, flags=(*effect.flags, *more))

    return replace(
        fit, effects=tuple(map(flagged, fit.effects)), contrasts=tuple(map(flagged, fit.contrasts))
    )


def _unfit(table: SearchTable, design: Array) -> tuple[FitFlag, Flag] | None:
    """Return why no model can be fitted, where that is plain to see: of the fit, and of its effects.

    A version in which nothing was found takes longer by any factor. Found times that the design gives
    exactly, as where all are equal, leave no scatter to judge by. In both cases a search for the largest
    likelihood would run on for long.
    """
    if not table.times.size:
        return FitFlag.NOT_ESTIMABLE, SearchFlag.NOT_BOTH
    if not table.found.any():
        return FitFlag.NOTHING_OBSERVED, FitFlag.NOTHING_OBSERVED
    if np.unique(table.ours[table.found]).size < np.unique(table.ours).size:
        return FitFlag.SEPARATED, FitFlag.SEPARATED
    logs, rows = np.log(table.model_times[table.found]), design[table.found]
    left = logs - rows @ np.linalg.lstsq(rows, logs, rcond=None)[0]
    more_rows = rows.shape[0] > np.linalg.matrix_rank(rows)
    none_left = more_rows and float(np.abs(left).max()) < LEAST_SCATTER
    return (FitFlag.NO_SCATTER, FitFlag.NO_SCATTER) if none_left else None


def _without_numbers(
    table: SearchTable, names: Sequence[str], sums: Iterable[str], why: tuple[FitFlag, Flag]
) -> TimesFit:
    n, people = table.times.size, np.unique(table.participant).size
    return times_fit_without_numbers((names, tuple(sums)), n, people, why[:1], why[1])


def _ours(table: SearchTable) -> Array:
    return table.ours.astype(np.float64)


def slowing(effect: FixedEffect, margin: float) -> tuple[float | None, float | None]:
    """Return the p of a slowing by the margin [ln] or more, and the largest that is not excluded at 5 %.

    >>> effect = FixedEffect("ours", 0.0, 0.1, None, None, None, df=1e9)
    >>> [round(x, 3) for x in slowing(effect, 0.196)]  # 1.96 standard errors below the margin
    [0.025, 0.164]
    """
    if effect.estimate is None or not effect.standard_error or effect.df is None:
        return None, None
    t = (effect.estimate - margin) / effect.standard_error
    largest = effect.estimate + float(special.stdtrit(effect.df, 0.95)) * effect.standard_error
    return float(special.stdtr(effect.df, t)), largest


# --- the line over locations --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LocationLine:
    """The effect of ours in ln(time) over x = ln(factor of ours / of the baseline).

    Attributes
    ----------
    coefficients, covariance : array (2,), array (2, 2)
        Effect at equal brightness and slope, and how uncertain they are.
    scatter : float
        τ: standard deviation of locations about the line.
    slope_error_without_scatter : float
        Standard error of the slope if locations did not scatter.
    locations : tuple of int
        Which have an effect of their own.
    shrunken : array
        Their effects, drawn to the line as far as they are uncertain.
    """

    coefficients: Array
    covariance: Array
    scatter: float
    slope_error_without_scatter: float
    locations: tuple[int, ...]
    shrunken: Array

    @property
    def slope_error(self) -> float:
        """Standard error of the slope."""
        return math.sqrt(self.covariance[1, 1])

    @property
    def slope(self) -> FixedEffect:
        """Its slope, with Student's interval and test over locations."""
        slope, df = float(self.coefficients[1]), len(self.locations) - 2
        return student_effect(BRIGHTNESS, slope, self.slope_error, df)

    def band(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the line, and the ends of its pointwise 95 % confidence band."""
        design = np.column_stack([np.ones_like(x), x])
        middle = design @ self.coefficients
        quantile = special.stdtrit(len(self.locations) - 2, 0.975)
        half = quantile * np.sqrt(np.einsum("ni,ij,nj->n", design, self.covariance, design))
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
        coefficients=fit.coefficients,
        covariance=fit.covariance,
        scatter=fit.group_sd,
        slope_error_without_scatter=math.sqrt(fixed[1, 1]),
        locations=known,
        shrunken=on_line + kept * (values - on_line),
    )


def for_people_and_locations(people: FixedEffect, line: LocationLine, n_people: int) -> FixedEffect | None:
    """Return the slope with the uncertainty of people like these at locations like these.

    Of both analyses, one in which people and one in which locations are random, each holds the scatter of
    trials: Var = Var_people + Var_locations - Var_trials, as in the quasi-F (Clark, 1973; Judd, Westfall &
    Kenny, 2012); degrees of freedom by Satterthwaite. `people` is the slope over people.
    """
    if people.estimate is None or people.standard_error is None or n_people < 2:
        return None
    by_people, by_locations = people.standard_error**2, line.slope_error**2
    variance = max(by_people + by_locations - line.slope_error_without_scatter**2, by_people, by_locations)
    over_people, over_locations = n_people - 1, len(line.locations) - 2
    df = variance**2 / (by_people**2 / over_people + by_locations**2 / over_locations)
    df = min(max(df, min(over_people, over_locations)), n_people + over_locations)
    return student_effect(BRIGHTNESS, people.estimate, math.sqrt(variance), df)

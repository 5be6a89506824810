"""Models of the search times: what ours does to them, in the dark and in the bright.

ln(time) is normal, with an effect of each place of a ring, of each person, of the half of the session and of
the order within it; undetected rings are censored at the time limit
(`analysis.inference.lognormal_times`). The version's effect differs between persons (a random slope), so that
it is tested between them: docs/decisions/search-inference.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from evenlight.analysis.inference.fixed_effects import FitFlag, FixedEffect, unknown_effect
from evenlight.analysis.inference.lognormal_times import (
    CensoredTimes,
    Contrast,
    TimesFit,
    fit_lognormal_times,
)
from evenlight.analysis.search.search_trials import BrightnessEffect, SearchTable
from evenlight.data_schema.arrays import Array

PEOPLE_FOR_SPOTS = 4  # over so many each place of a ring is seen in either version (viewing-orders.md)
LEAST_SCATTER = 0.005  # of ln(time): half a per cent, less than any clock of a participant
VERSION, BRIGHTNESS = "ours", "ln brightness ratio"
VISIT, ORDER = "second half", "ten trials later"
ONE_PERSON = "one participant: interval and p are for this person's searches alone"
FACTORS_UNKNOWN = "the brightness factors of the versions are unknown"
NOT_BOTH = "no location was searched in both versions: there is no ratio"


@dataclass(frozen=True, slots=True)
class SideEffect:
    """Effect of ours on ln(time) at the locations of one side.

    Attributes
    ----------
    side : BrightnessEffect
        Which.
    locations, n : int
        How many of them, and of searches there.
    effect : FixedEffect
        Of ours against the baseline.
    slowing_p : float or None
        Of the test that ours takes longer by the margin, or more: small where such a slowing is excluded.
    slowing_high : float or None
        Largest slowing that is not excluded at 5 %, in ln(time).
    """

    side: BrightnessEffect
    locations: int
    n: int
    effect: FixedEffect
    slowing_p: float | None
    slowing_high: float | None


@dataclass(frozen=True, slots=True)
class SearchModels:
    """Effects on ln(time); exponentiated they are ratios of times.

    Attributes
    ----------
    overall : TimesFit
        With one effect of the version, and those of order.
    sides : tuple of SideEffect
        Where ours is brighter, where it is about equal, and where it is dimmer.
    brightness : TimesFit
        With the slope of ln(time) over ln(factor), and what ours does at equal brightness.
    by_location : mapping of int to FixedEffect
        Effect of ours at each location by itself.
    n_by_location : mapping of int to int
        Searches that it rests on.
    dropped, capped, wrong : TimesFit
        As overall, if undetected rings are left out, counted as found at the time limit, or joined by
        those whose gap was identified wrongly; intervals by the standard error.
    n_left_out : int
        Searches at places where nobody ever found a ring, or only one version was shown: they say nothing.
    """

    overall: TimesFit
    sides: tuple[SideEffect, ...]
    brightness: TimesFit
    by_location: Mapping[int, FixedEffect]
    n_by_location: Mapping[int, int]
    dropped: TimesFit
    capped: TimesFit
    wrong: TimesFit
    n_left_out: int


def search_models(table: SearchTable, margin: float) -> SearchModels:
    """Fit the models of the search times.

    Parameters
    ----------
    table : SearchTable
        The trials, of both versions.
    margin : float
        Slowing that is to be excluded where ours is dimmer, as ln(ratio of times).
    """
    used = informative(table)
    overall = _fit(used, {VERSION: _ours(used)}, VERSION)
    found, wrong = table.found, table.found & ~table.correct
    return SearchModels(
        overall=overall,
        sides=_sides(used, margin),
        brightness=brightness_fit(used),
        by_location=effects_by_location(used),
        n_by_location={int(k): int((used.location == k).sum()) for k in np.unique(used.location)},
        dropped=overall if found.all() or not found.any() else version_fit(table.some(found), False),
        capped=overall if found.all() else version_fit(replace(table, found=np.ones_like(found)), False),
        wrong=version_fit(table.without_wrong(), False) if wrong.any() else overall,
        n_left_out=table.times.size - used.times.size,
    )


def version_effect(table: SearchTable, profiled: bool = True) -> FixedEffect:
    """Return the effect of ours on ln(time), over all locations.

    Parameters
    ----------
    table : SearchTable
        The trials.
    profiled : bool
        Whether interval and test go by the profile of the likelihood, or by the standard error, which is
        quicker.
    """
    return effect_of(version_fit(table, profiled), VERSION)


def version_fit(table: SearchTable, profiled: bool = True) -> TimesFit:
    """Return the model of which that effect is one."""
    used = informative(table)
    return _fit(used, {VERSION: _ours(used)}, VERSION, profiled=profiled)


def brightness_fit(table: SearchTable) -> TimesFit:
    """Return the model in which ours acts by its brightness: the slope of ln(time) over ln(factor).

    At equal brightness the versions are the same picture, so that the effect of ours beside it is a check of
    the model rather than a finding.
    """
    known = table.of_known_brightness
    if table.times.size and not known.times.size:
        return _without_numbers(known, (BRIGHTNESS, VERSION), (), FitFlag.NONE, FACTORS_UNKNOWN)
    ours = _ours(known)
    return _fit(known, {BRIGHTNESS: ours * known.ln_ratio, VERSION: ours}, BRIGHTNESS)


def effects_by_location(table: SearchTable) -> dict[int, FixedEffect]:
    """Return the effect of ours at each location, of one model with one effect for each."""
    places = np.unique(table.location).tolist()
    columns = {str(k): _ours(table) * (table.location == k) for k in places}
    fit = _fit(table, columns, None)
    return {k: effect_of(fit, str(k)) for k in places}


def effect_of(fit: TimesFit, name: str) -> FixedEffect:
    """Return an effect of a fit by its name."""
    return next(effect for effect in fit.effects if effect.name == name)


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
) -> TimesFit:
    """Return the model with some columns beside places, half and order.

    Parameters
    ----------
    table : SearchTable
        The trials.
    columns : mapping of str to array
        Columns of the design by name.
    slope : str or None
        Which of them differs between people; its interval, and those of the sums, go by the profile.
    sums : mapping of str to sequence of str, optional
        Contrasts wanted: names of the columns whose effects are added.
    profiled : bool
        False for intervals by the standard error throughout.
    """
    places = _places(table)
    dummies = np.eye(int(places.max(initial=-1)) + 1)[places]
    nuisance = {VISIT: table.visit, ORDER: table.order}
    own = {**columns, **{name: value for name, value in nuisance.items() if np.unique(value).size > 1}}
    names = (*own, *(f"place {k}" for k in range(dummies.shape[1])))
    contrasts = tuple(
        Contrast(name, tuple(float(column in added) for column in names))
        for name, added in (sums or {}).items()
    )
    design = np.column_stack([*own.values(), dummies])
    why = _unfit(table, design)
    if why is not None:
        return _without_numbers(table, names, tuple(contrast.name for contrast in contrasts), *why)
    data = CensoredTimes(
        times=table.model_times,
        observed=table.found,
        design=design,
        names=names,
        groups=np.unique(table.participant, return_inverse=True)[1],
        slope_column=None if slope is None else names.index(slope),
    )
    wanted = tuple(sums or ()) or (() if slope is None else (slope,))
    return with_flags(fit_lognormal_times(data, contrasts, wanted if profiled else ()))


def with_flags(fit: TimesFit) -> TimesFit:
    """Return a fit whose effects have its flags as their own, so that no row or table goes without them.

    That an effect runs to infinity is said of all where it is one of places or order; one of the version says
    so itself, and hardly touches that at other locations.
    """
    words = [ONE_PERSON] if FitFlag.ONE_PARTICIPANT in fit.flags else []
    words += [FitFlag.NOT_CONVERGED.value] if FitFlag.NOT_CONVERGED in fit.flags else []
    every = (*fit.effects, *fit.contrasts)
    order = [e for e in every if e.name in (VISIT, ORDER) or e.name.startswith("place ")]
    runs = any("infinity" in effect.flag for effect in order)
    words += [FitFlag.SEPARATED.value] if runs else []

    def flagged(effect: FixedEffect) -> FixedEffect:
        if effect.estimate is None and effect.ci_low is None and effect.ci_high is None:
            return effect  # its own flag says why
        return replace(effect, flag="; ".join(word for word in (effect.flag, *words) if word))

    return replace(
        fit, effects=tuple(map(flagged, fit.effects)), contrasts=tuple(map(flagged, fit.contrasts))
    )


def _unfit(table: SearchTable, design: Array) -> tuple[FitFlag, str] | None:
    """Return why no model can be fitted, where that is plain to see, and in words; None otherwise.

    A version in which nothing was found takes longer by any factor. Found times that the design gives
    exactly, as where all are equal, leave no scatter to judge by. In both cases a search for the largest
    likelihood would run on for long.
    """
    if not table.times.size:
        return FitFlag.NOT_ESTIMABLE, NOT_BOTH
    if not table.found.any():
        return FitFlag.NOTHING_OBSERVED, FitFlag.NOTHING_OBSERVED.value
    if np.unique(table.ours[table.found]).size < np.unique(table.ours).size:
        return FitFlag.SEPARATED, FitFlag.SEPARATED.value
    logs, rows = np.log(table.model_times[table.found]), design[table.found]
    left = logs - rows @ np.linalg.lstsq(rows, logs, rcond=None)[0]
    more_rows = rows.shape[0] > np.linalg.matrix_rank(rows)
    if more_rows and float(np.abs(left).max()) < LEAST_SCATTER:
        return FitFlag.NO_SCATTER, FitFlag.NO_SCATTER.value
    return None


def _without_numbers(
    table: SearchTable, names: Sequence[str], sums: Sequence[str], why: FitFlag, words: str
) -> TimesFit:
    """Return a fit that says why there is none."""
    return TimesFit(
        effects=tuple(replace(unknown_effect(name, why), flag=words) for name in names),
        contrasts=tuple(replace(unknown_effect(name, why), flag=words) for name in sums),
        residual_sd=math.nan,
        group_sd=math.nan,
        slope_sd=None,
        log_likelihood=None,
        n=table.times.size,
        n_observed=int(np.count_nonzero(table.found)),
        n_groups=int(np.unique(table.participant).size),
        flags=(why,),
    )


def _ours(table: SearchTable) -> Array:
    """Return 1 for ours and 0 for the baseline."""
    return table.ours.astype(np.float64)


def _sides(table: SearchTable, margin: float) -> tuple[SideEffect, ...]:
    """Return the effect of ours where it brightens, hardly does either, and dims, of one model for all.

    The model has an effect of ours on the first side, and what is added to it on the others; the effect on
    each is a contrast, with the random slope of the version that its test needs.
    """
    table = table.of_known_brightness
    sides = table.sides[table.location]
    masks = {side: sides == side for side in BrightnessEffect}
    present = {side: mask for side, mask in masks.items() if mask.any()}
    if not present:
        return ()
    added = {f"added where {side.value}": _ours(table) * mask for side, mask in list(present.items())[1:]}
    sums = {side.value: (VERSION, *list(added)[max(k - 1, 0) : k]) for k, side in enumerate(present)}
    fit = _fit(table, {VERSION: _ours(table), **added}, VERSION, sums)
    found = []
    for (side, mask), effect in zip(present.items(), fit.contrasts, strict=True):
        locations = int(np.unique(table.location[mask]).size)
        n = int(np.count_nonzero(mask))
        found.append(SideEffect(side, locations, n, effect, *slowing(effect, margin)))
    return tuple(found)


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

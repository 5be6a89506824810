"""All results of the search, computed once for tables and figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.inference.exact_tests import holm, sign_flip_test
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.search.search_locations import (
    LocationLine,
    LocationResult,
    for_people_and_locations,
    line_over_locations,
    location_results,
)
from evenlight.analysis.search.search_models import (
    BRIGHTNESS,
    FACTORS_UNKNOWN,
    SearchModels,
    effect_of,
    search_models,
)
from evenlight.analysis.search.search_pairs import (
    HazardRatio,
    SearchPairs,
    difference_error,
    hazard_ratio,
    matched_pairs,
)
from evenlight.analysis.search.search_shares import (
    ClusteredShare,
    FoundOverTime,
    Orientation,
    detection_share,
    found_over_time,
    orientation,
)
from evenlight.analysis.search.search_trials import (
    BrightnessEffect,
    SearchTable,
    first_sessions,
    search_table,
)
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.recordings.search import SearchTrial

SLOWING = 0.25  # more than that where ours dims would be a loss (choice; docs/decisions/search-inference.md)
EVERYWHERE = "all"
ONE_PERSON_ONLY = "one participant: nothing is said of other people"
NONE_DIFFERS = "in no pair was the ring found in one version alone: the data give no interval"


@dataclass(frozen=True, slots=True)
class FirstFound:
    """Which version was found first, in a group of locations.

    Attributes
    ----------
    hazard : HazardRatio
        Of the stratified Cox model.
    difference : int
        Pairs in which ours was first, less those in which the baseline was.
    p_value : float or None
        Of that difference: exact, by exchanging the versions person by person; None for one participant.
    """

    hazard: HazardRatio
    difference: int
    p_value: float | None


@dataclass(frozen=True, slots=True)
class DetectionChange:
    """How many more rings were found in ours than in the baseline, of the same people at the same locations.

    Attributes
    ----------
    n : int
        SearchPairs.
    difference : float
        Of the shares found.
    ci_low, ci_high, p_value : float or None
        95 % confidence interval, and two-sided p, over people (Student's t); None where `flag` says why.
    more : int
        Rings found in ours, less those in the baseline.
    exact_p : float or None
        Of `more`, by exchanging the versions person by person; None for one participant.
    flag : str
        What is to be said; empty for nothing.
    """

    n: int
    difference: float
    ci_low: float | None
    ci_high: float | None
    p_value: float | None
    more: int
    exact_p: float | None
    flag: str


@dataclass(frozen=True, slots=True)
class SearchResults:
    """All that the search shows.

    Attributes
    ----------
    table : SearchTable
        The trials.
    origin : Origin
        Simulated or recorded.
    slowing : float
        Share by which ours may take longer where it dims, without that being a loss.
    locations : tuple of LocationResult
        Each by itself.
    models : SearchModels
        Of ln(time).
    ratio_p : mapping of int to float or None
        p values of the locations' own time ratios, adjusted for their number (Holm); where there is one.
    line : LocationLine or str
        Effect over brightness, over locations; or why there is none.
    both : FixedEffect or None
        The slope for people and locations like these.
    first : mapping of str to FirstFound
        For all locations, and those of either side.
    detection : mapping of str to DetectionChange
        The same of detections.
    shares : mapping of bool to ClusteredShare
        Of rings found, for ours (True) and the baseline.
    orientation : mapping of bool to Orientation
        Of gaps identified correctly.
    curves : tuple of FoundOverTime
        Share found over time.
    unpaired : int
        Searches without their partner in the other version.
    """

    table: SearchTable
    origin: Origin
    slowing: float
    locations: tuple[LocationResult, ...]
    models: SearchModels
    ratio_p: Mapping[int, float | None]
    line: LocationLine | str
    both: FixedEffect | None
    first: Mapping[str, FirstFound]
    detection: Mapping[str, DetectionChange]
    shares: Mapping[bool, ClusteredShare]
    orientation: Mapping[bool, Orientation]
    curves: tuple[FoundOverTime, ...]
    unpaired: int

    @property
    def simulated(self) -> bool:
        """Whether simulated participants searched."""
        return self.origin is Origin.SIMULATED


def search_results(
    data: TaskData[SearchTrial], slowing: float = SLOWING
) -> tuple[SearchResults, tuple[str, ...]]:
    """Return all that a search shows, and what is to be said about its trials.

    Raises
    ------
    InputError
        If only one of the two versions was searched in.
    """
    table, warnings = search_table(data)
    pairs, once = matched_pairs(table), first_sessions(table)
    models = search_models(table, math.log1p(slowing))
    ln_ratios = np.array([place.ln_ratio for place in table.locations], dtype=np.float64)
    known = {k: effect for k, effect in models.by_location.items() if np.isfinite(ln_ratios[k])}
    line = line_over_locations(known, ln_ratios) if known else FACTORS_UNKNOWN
    slope = effect_of(models.brightness, BRIGHTNESS)
    people = int(np.unique(table.participant).size)
    groups = _groups(table, pairs)
    results = SearchResults(
        table=table,
        origin=Origin.SIMULATED if data.simulated else Origin.RECORDED,
        slowing=slowing,
        locations=location_results(once, matched_pairs(once)),
        models=models,
        ratio_p=_adjusted(models.by_location),
        line=line,
        both=None if isinstance(line, str) else for_people_and_locations(slope, line, people),
        first={name: first_found(own) for name, own in groups.items()},
        detection={name: detection_change(own) for name, own in groups.items()},
        shares={ours: detection_share(table, ours) for ours in (True, False)},
        orientation={ours: orientation(table, ours) for ours in (True, False)},
        curves=found_over_time(table),
        unpaired=pairs.unpaired,
    )
    return results, warnings


def _adjusted(effects: Mapping[int, FixedEffect]) -> dict[int, float | None]:
    """Return the p values of effects, adjusted for their number."""
    return dict(zip(effects, holm([effect.p_value for effect in effects.values()]), strict=True))


def _groups(table: SearchTable, pairs: SearchPairs) -> dict[str, SearchPairs]:
    """Return the pairs of all locations, and of those of either side; groups without a pair are left out."""
    sides = table.sides[pairs.location]
    chosen = {EVERYWHERE: np.ones(sides.size, bool)} | {
        side.value: sides == side for side in BrightnessEffect
    }
    return {name: pairs.at(mask) for name, mask in chosen.items() if mask.any()}


def first_found(pairs: SearchPairs) -> FirstFound:
    """Return which version was found first.

    The exact test sums for each person how much more often ours was first; if it does not matter which
    version is which, each person's sum is as likely to have the other sign. It is the permutation test of
    the stratified log-rank statistic, with whole persons exchanged.
    """
    return FirstFound(hazard_ratio(pairs), int(pairs.first.sum()), _exchanged(pairs, pairs.first))


def detection_change(pairs: SearchPairs) -> DetectionChange:
    """Return how many more rings were found in ours.

    The standard error is the larger one of that over people and that of independent pairs: few people, or few
    pairs that differ, scatter less by chance than they would again.
    """
    more = pairs.found_ours.astype(np.int64) - pairs.found_baseline.astype(np.int64)
    people = np.unique(pairs.participant, return_inverse=True)[1]
    n, difference = more.size, float(more.mean())
    count = int(people.max()) + 1
    flag = ONE_PERSON_ONLY if count == 1 else "" if more.any() else NONE_DIFFERS
    exact_p = _exchanged(pairs, more)
    if flag:
        return DetectionChange(n, difference, None, None, None, int(more.sum()), exact_p, flag)
    excess = np.bincount(people, weights=more - difference)
    over_people = math.sqrt(count / (count - 1) * float(excess @ excess)) / n
    error = max(over_people, difference_error(n, int((more > 0).sum()), int((more < 0).sum())))
    half = float(special.stdtrit(count - 1, 0.975)) * error
    low, high = max(difference - half, -1.0), min(difference + half, 1.0)
    p_value = float(2 * special.stdtr(count - 1, -abs(difference) / error))
    return DetectionChange(n, difference, low, high, p_value, int(more.sum()), exact_p, flag)


def _exchanged(pairs: SearchPairs, scores: np.ndarray) -> float | None:
    """Return the exact p of the persons' sums of scores; None for one person."""
    people = np.unique(pairs.participant, return_inverse=True)[1]
    if people.max() == 0:
        return None
    return sign_flip_test(np.bincount(people, weights=scores)).p_value

"""Each location by itself: who found the ring there, how soon, and whether the versions differ in it."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.analysis.inference.binomial_tests import mid_p_interval
from evenlight.analysis.inference.holm import holm
from evenlight.analysis.search.search_averages import CellAverages, cell_averages
from evenlight.analysis.search.search_pairs import Detections, Pairs, detections
from evenlight.analysis.search.search_trials import Location, SearchTable


@dataclass(frozen=True, slots=True)
class Cell:
    """One version at one location.

    Attributes
    ----------
    averages : CellAverages
        Its times.
    share_found : float
        Share of the searches in which the ring was found.
    share_low, share_high : float
        95 % interval of that share (mid-p).
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
    ours, baseline : Cell or None
        The versions; None for one in which nobody searched there.
    detections : Detections or None
        Comparison of the shares found, within people; None without anybody who searched in both.
    p_holm : float or None
        Its p value, adjusted for the number of locations (Holm, 1979).
    """

    location: Location
    ours: Cell | None
    baseline: Cell | None
    detections: Detections | None
    p_holm: float | None


def location_results(table: SearchTable, pairs: Pairs) -> tuple[LocationResult, ...]:
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


def _detections(pairs: Pairs, location: int) -> Detections | None:
    """Return the comparison of the shares found at a location."""
    own = pairs.at(pairs.location == location)
    return detections(own) if own.first.size else None


def _cell(table: SearchTable, location: int, ours: bool) -> Cell | None:
    """Return a version at a location."""
    averages = cell_averages(table, location, ours)
    if averages is None:
        return None
    found = averages.n - averages.undetected
    return Cell(averages, found / averages.n, *mid_p_interval(found, averages.n))

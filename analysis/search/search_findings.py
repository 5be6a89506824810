"""What the search found: rows, figures and words (Section 4.2 of the paper)."""

from __future__ import annotations

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.integrity.version_order import confounded_order
from evenlight.analysis.search.search_brightness_figure import (
    brightness_figure,
    brightness_points,
    curves_figure,
    curves_points,
)
from evenlight.analysis.search.search_results import SLOWING, SearchResults, search_results
from evenlight.analysis.search.search_sections import (
    averages_section,
    brightness_section,
    pairs_section,
    times_section,
)
from evenlight.analysis.search.search_statistics import statistics_of
from evenlight.analysis.search.search_times_figure import times_figure, times_points
from evenlight.analysis.search.search_words import lead_of, who
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import SearchTrial


def search_findings(data: TaskData[SearchTrial], seed: int = 1, slowing: float = SLOWING) -> Findings:
    """Return what a search found.

    Parameters
    ----------
    data : TaskData of SearchTrial
        The searches: one of each participant at each location in each version, as a rule.
    seed : int
        As of every analysis; nothing is drawn here: tests are exact, or have closed forms.
    slowing : float
        Share by which ours may take longer where it dims without that being a loss, above 0.

    Raises
    ------
    InputError
        If all searches are of one version, or there is no such share.
    """
    if not slowing > 0:
        raise InputError(f"the slowing to be excluded must be above 0, e.g. 0.25 for 25 %, got {slowing:g}")
    found, warnings = search_results(data, slowing)
    confound = confounded_order(data)
    times, brightness, curves = _times(found), _brightness(found), _curves(found)
    drawn = tuple(drawing for drawing in (times, brightness, curves) if drawing is not None)
    return Findings(
        name="search",
        lead=lead_of(found, confound),
        statistics=statistics_of(found),
        drawings=drawn,
        sections=(
            times_section(found, times.picture, confound),
            brightness_section(found, tuple(d.picture for d in (brightness, curves) if d is not None)),
            pairs_section(found),
            averages_section(found),
        ),
        warnings=(*data.warnings, *warnings),
    )


def _times(found: SearchResults) -> Drawing:
    """Return the figure of the detection times."""
    figure = times_figure(found.locations, float(found.table.limits.max()), found.simulated)
    return Drawing(
        "search_times",
        png_bytes(figure),
        "Search times at each location in both versions: medians with 95 % confidence intervals, means of "
        "the rings found, undetected rings, and brightness factors.",
        times_points(found.locations, found.origin),
    )


def _brightness(found: SearchResults) -> Drawing | None:
    """Return the figure of the interaction; None where no location has a ratio."""
    effects = found.models.by_location
    people = len(found.table.participants)
    points = brightness_points(found.table.locations, effects, found.line, people, found.origin)
    if not points:
        return None
    drawn = sum(point.series == "location" for point in points)
    words = [
        f"{'Simulated: ' if found.simulated else ''}{people} {who(found).split()[-1]}. Search time over "
        "brightness, ours against the baseline, at each location; named are those whose own interval "
        "excludes 1."
    ]
    if not isinstance(found.line, str):
        words.append("The line is for locations like these.")
    if drawn < len(found.table.locations):
        words.append(f"{len(found.table.locations) - drawn} locations have no ratio of their own.")
    heading = ("Does more light save time?", " ".join(words))
    figure = brightness_figure(found.table.locations, effects, found.line, heading)
    caption = (
        "Ratio of search times over ratio of brightness factors, ours to baseline, with 95 % confidence "
        "intervals; the line over locations with its pointwise 95 % confidence band, and the line of no "
        "difference."
    )
    return Drawing("search_brightness", png_bytes(figure), caption, points)


def _curves(found: SearchResults) -> Drawing | None:
    """Return the figure of the share found over time; None where ours neither brightens nor dims anywhere."""
    if not found.curves:
        return None
    people = len(found.table.participants)
    heading = (
        "How many rings are found, and when",
        f"{'Simulated: ' if found.simulated else ''}{people} {who(found).split()[-1]}. Bands: 95 %, over "
        "participants.",
    )
    return Drawing(
        "search_curves",
        png_bytes(curves_figure(found.curves, heading)),
        "Share of the rings found over time in both versions, where ours dims and where it brightens.",
        curves_points(found.curves, found.origin),
    )

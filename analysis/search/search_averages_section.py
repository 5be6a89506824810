"""The section of a report on the paper's average search times, beside what they leave out."""

from __future__ import annotations

from evenlight.analysis.report import Section, Table
from evenlight.analysis.search.search_locations import Cell as LocationCell
from evenlight.analysis.search.search_models import VERSION, effect_of
from evenlight.analysis.search.search_results import SearchResults
from evenlight.analysis.search.search_sections import COLUMNS, effect_cells, is_simulated, location_name


def averages_section(found: SearchResults) -> Section:
    """Return the paper's average, beside what it leaves out."""
    text = (
        "The paper reports the average time of each location with its standard error. An average of the "
        "rings "
        "found leaves out the longest searches, the more of them the harder the ring: both versions look "
        "alike "
        "that differ in how many are missed. To count the undetected with the time limit shortens them too. "
        "The model's mean takes them as what they are, longer than the limit.",
    )
    models = found.models
    rows = tuple(
        (what, fit.n, *effect_cells(effect_of(fit, VERSION)), effect_of(fit, VERSION).flag)
        for what, fit in (
            ("undetected rings censored", models.overall),
            ("left out, as in an average of those found", models.dropped),
            ("counted as found at the limit", models.capped),
            ("gaps told wrongly count as undetected too", models.wrong),
        )
    )
    ways = Table(
        "The same time ratio, ours to baseline, by what becomes of undetected rings.",
        ("", "searches", *COLUMNS, "remark"),
        rows,
    )
    title, tables = "What an average of the rings found leaves out", (ways, _average_table(found))
    return Section(title, text, tables, simulated=is_simulated(found))


def _average_table(found: SearchResults) -> Table:
    """Return the averages of all locations."""
    rows = [
        (location_name(result), *(cell for own in (result.ours, result.baseline) for cell in _averages(own)))
        for result in found.locations
    ]
    columns = tuple(f"{version}: {what}" for version in ("ours", "baseline")
                    for what in ("found ± SEM", "at the limit", "model"))  # fmt: skip
    return Table(
        "Average search times [s]: of the rings found with standard error (SD with n - 1), as in the paper; "
        "with the "
        "undetected at the time limit; by a log-normal distribution with them censored.",
        ("location", *columns),
        tuple(rows),
    )


def _averages(cell: LocationCell | None) -> tuple[str | None, ...]:
    """Return the averages of one version at one location."""
    if cell is None:
        return None, None, None
    a = cell.averages
    error = "–" if a.sem_found is None else f"{a.sem_found:.1f}"
    return (
        None if a.mean_found is None else f"{a.mean_found:.1f} ± {error}",
        f"{a.capped_mean:.1f}",
        None if a.model_mean is None else f"{a.model_mean:.1f}",
    )

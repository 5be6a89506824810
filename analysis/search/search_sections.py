"""The report on the search: how soon, gain and loss, what was found at all, and the paper's averages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.search.search_locations import LocationCell, LocationResult
from evenlight.analysis.search.search_models import ORDER, VERSION, VISIT, effect_of
from evenlight.analysis.search.search_results import DetectionChange, SearchResults
from evenlight.analysis.search.search_statistics import (
    LIKE_BOTH,
    LIKE_LOCATIONS,
    LIKE_PEOPLE,
    NO_COMBINATION,
    ORDER_EFFECTS,
    people_slope,
)
from evenlight.analysis.search.search_trials import ABOUT_EQUAL
from evenlight.analysis.search.search_words import ALPHA, design_of, lead_of, range_text
from evenlight.analysis.wording import p_text

COLUMNS = ("ratio", "95 % CI", "p")


def _section(
    found: SearchResults,
    name: str,
    tables: Sequence[Table],
    pictures: Sequence[Picture] = (),
    **values: Any,
) -> Section:
    """Return a section of the search's report from its template."""
    return replace(section(f"search_{name}", tables, pictures, **values), simulated=found.simulated)


def times_section(found: SearchResults, picture: Picture, confound: str = "") -> Section:
    """Return how soon the rings were found at each location, and whether it may be the order of versions."""
    flags = [(result.location.name, flag) for result in found.locations for flag in _cell_flags(result)]
    values = {
        "lead": lead_of(found, confound),
        "design": design_of(found.table),
        "flags": flags,
        "unpaired": found.unpaired,
    }
    return _section(found, "times", (_location_table(found),), (picture,), **values)


def _cell_flags(result: LocationResult) -> list[str]:
    """Return what to note about versions in which nobody searched, or found, anything."""
    flags = []
    for version, cell in (("ours", result.ours), ("the baseline", result.baseline)):
        if cell is None:
            flags.append(f"nobody searched in {version}")
        elif cell.averages.undetected == cell.averages.n:
            flags.append(f"nobody found the ring in {version}")
    return flags


def _location_table(found: SearchResults) -> Table:
    """Return undetected rings, medians and ratios of all locations."""
    rows: list[tuple[Cell, ...]] = []
    for k, result in enumerate(found.locations):
        effect, test, cells = (
            found.models.by_location.get(k),
            result.detections,
            (result.ours, result.baseline),
        )
        rows.append(
            (_name(result), *map(_lost, cells), p_text(test.p_value) if test else None, p_text(result.p_holm),
             *map(_median, cells), *(_effect_cells(effect)[:2] if effect else (None, None)),
             p_text(found.ratio_p.get(k)))
        )  # fmt: skip
    return Table(
        "Undetected rings (p: exact test of McNemar, by itself and adjusted for the number of locations "
        "by Holm), median search times with 95 % confidence interval (CI), and time ratios of ours to the "
        "baseline (p: adjusted too).",
        ("location", "undetected: ours", "baseline", "p", "p (Holm)", "median [s]: ours", "baseline", "ratio",
         "95 % CI", "p (Holm)"),
        tuple(rows),
    )  # fmt: skip


def _name(result: LocationResult) -> str:
    """Return what a location is called in a table."""
    return result.location.name.replace("_", " ").replace("/", ": ")


def _lost(cell: LocationCell | None) -> str | None:
    """Return how many rings were not found."""
    return None if cell is None else f"{cell.averages.undetected} of {cell.averages.n}"


def _median(cell: LocationCell | None) -> str | None:
    """Return a median with its interval."""
    if cell is None:
        return None
    curve = cell.averages.curve
    ends = range_text((curve.median_low, curve.median_high), digits=1)
    value = "not reached" if curve.median is None else f"{curve.median:.1f}"
    return f"{value} ({ends})" if ends else value


def _effect_cells(effect: FixedEffect) -> tuple[Cell, ...]:
    """Return the cells of a ratio: itself, its interval, p."""
    value = None if effect.estimate is None else f"{math.exp(effect.estimate):.2f}"
    return value, range_text((effect.ci_low, effect.ci_high), logarithms=True), p_text(effect.p_value)


def brightness_section(found: SearchResults, pictures: tuple[Picture, ...]) -> Section:
    """Return whether there is gain in the dark, and no loss in the bright."""
    models = found.models
    check = effect_of(models.brightness, VERSION)
    flags = dict.fromkeys(flag.value for fit in (models.overall, models.brightness) for flag in fit.flags)
    return _section(
        found,
        "brightness",
        (_side_table(found), _slope_table(found)),
        pictures,
        about_equal=ABOUT_EQUAL,
        slowing=found.slowing,
        n_left_out=models.n_left_out,
        check=check,
        check_ratio=math.exp(check.estimate or 0.0),
        alpha=ALPHA,
        flags=[flag for flag in flags if flag],
    )


def _side_table(found: SearchResults) -> Table:
    """Return the time ratios of all locations, and of either side."""
    every = effect_of(found.models.overall, VERSION)
    rows: list[tuple[Cell, ...]] = [
        ("all", len(found.locations), *_effect_cells(every), None, None, every.flag)
    ]
    for side in found.models.sides:
        largest = None if side.slowing_high is None else f"{math.exp(side.slowing_high):.2f}"
        rows.append(
            (side.side.value, side.locations, *_effect_cells(side.effect), largest, p_text(side.slowing_p),
             side.effect.flag)
        )  # fmt: skip
    return Table(
        "Time ratio, ours to baseline, with 95 % confidence interval (CI); below 1 ours is faster. About "
        f"equal: factors within {100 * ABOUT_EQUAL:.0f} %. Largest not excluded: one-sided at 5 %.",
        ("ours there is", "locations", *COLUMNS, "largest not excluded",
         f"p of {1 + found.slowing:g} or more", "remark"),
        tuple(rows),
    )  # fmt: skip


def _slope_table(found: SearchResults) -> Table:
    """Return the slopes of ln(time) over ln(factor)."""
    line, missing = found.line, FixedEffect("", None, None, None, None, None)
    over_locations = missing if isinstance(line, str) else line.slope
    rows = [
        (name, effect.estimate if effect.estimate is None else f"{effect.estimate:.2f}",
         range_text((effect.ci_low, effect.ci_high)), p_text(effect.p_value), flag or effect.flag)
        for name, effect, flag in (
            (f"{LIKE_PEOPLE} (primary)", people_slope(found.models.brightness), ""),
            (LIKE_LOCATIONS, over_locations, line if isinstance(line, str) else ""),
            (LIKE_BOTH, found.both or missing, "" if found.both else NO_COMBINATION),
        )
    ]  # fmt: skip
    return Table(
        "Change of ln(time) per unit of ln(brightness factor of ours / of the baseline), with 95 % "
        "confidence interval (CI); below 0: more light, less time.",
        ("for", "slope", "95 % CI", "p", "remark"),
        tuple(rows),
    )


def pairs_section(found: SearchResults) -> Section:
    """Return what needs no model of times: which was found first, which at all, which correctly; practice."""
    tables = (_first_table(found),) if found.first else ()
    return _section(
        found, "pairs", (*tables, _correct_table(found), _order_table(found)), paired=bool(found.first)
    )


def _first_table(found: SearchResults) -> Table:
    """Return hazard ratios and differences of detections."""
    rows: list[tuple[Cell, ...]] = []
    for group, first in found.first.items():
        hazard, change = first.hazard, found.detection[group]
        value = None if hazard.ln_ratio is None else f"{math.exp(hazard.ln_ratio):.2f}"
        remarks = "; ".join(dict.fromkeys(flag for flag in (hazard.flag, change.flag) if flag))
        rows.append(
            (group, hazard.ours_first, hazard.baseline_first, hazard.tied + hazard.unknown, value,
             range_text((hazard.ci_low, hazard.ci_high), logarithms=True), p_text(hazard.p_value),
             p_text(first.p_value), f"{100 * change.difference:+.1f} %", _percent_range(change),
             p_text(change.p_value), p_text(change.exact_p), remarks)
        )  # fmt: skip
    return Table(
        "Pairs by which ring was found first, hazard ratio (ours to baseline), and rings found, ours minus "
        "baseline. 95 % confidence interval (CI) and p: Student's t over people.",
        ("locations", "ours first", "baseline first", "not known", "hazard ratio", "95 % CI", "p", "exact p",
         "rings found", "95 % CI", "p", "exact p", "remark"),
        tuple(rows),
    )  # fmt: skip


def _percent_range(change: DetectionChange) -> str | None:
    """Return the interval of a difference of shares [%]."""
    if change.ci_low is None or change.ci_high is None:
        return None
    return f"{100 * change.ci_low:+.1f} to {100 * change.ci_high:+.1f} %"


def _correct_table(found: SearchResults) -> Table:
    """Return the shares found, and identified correctly among them."""
    rows: list[tuple[Cell, ...]] = []
    for ours, version in ((True, "ours"), (False, "baseline")):
        gaps = found.orientation[ours]
        cells = [(f"{s.count} of {s.n}" if s.n else None, range_text((s.ci_low, s.ci_high)))
                 for s in (found.shares[ours], gaps.correct)]  # fmt: skip
        guessed = gaps.pressed_without_seeing
        rows.append(
            (version, *cells[0], *cells[1], None if guessed is None else f"{100 * guessed:.1f} %",
             "the gaps' directions are unknown" if not found.table.gaps_known else
             "" if gaps.above_chance or guessed is None else "not shown to be above chance")
        )  # fmt: skip
    return Table(
        "Rings found, and gaps identified correctly among them, with 95 % confidence intervals (CI) of the "
        "shares (over people); pressed without seeing: if every ring seen was identified correctly.",
        ("version", "found", "95 % CI", "identified correctly", "95 % CI", "pressed without seeing",
         "remark"),
        tuple(rows),
    )  # fmt: skip


def _order_table(found: SearchResults) -> Table:
    """Return what practice does."""
    fit = found.models.overall
    names = {effect.name for effect in fit.effects}
    rows = tuple(
        (ORDER_EFFECTS[name].removeprefix("time ratio, "),
         *(_effect_cells(effect_of(fit, name)) if name in names else (None, None, None)))
        for name in (VISIT, ORDER)
    )  # fmt: skip
    return Table("Order of the trials: time ratios; below 1: faster with practice.", ("", *COLUMNS), rows)


def averages_section(found: SearchResults) -> Section:
    """Return the paper's average, beside what it leaves out."""
    models = found.models
    rows = tuple(
        (what, fit.n, *_effect_cells(effect_of(fit, VERSION)), effect_of(fit, VERSION).flag)
        for what, fit in (
            ("undetected rings censored", models.overall),
            ("left out, as in an average of those found", models.dropped),
            ("counted as found at the limit", models.capped),
            ("gaps identified wrongly count as undetected too", models.wrong),
        )[: 4 if found.table.gaps_known else 3]
    )
    ways = Table(
        "The same time ratio, ours to baseline, by the treatment of undetected rings.",
        ("", "searches", *COLUMNS, "remark"),
        rows,
    )
    return _section(found, "averages", (ways, _average_table(found)))


def _average_table(found: SearchResults) -> Table:
    """Return the averages of all locations."""
    rows = [
        (_name(result), *(cell for own in (result.ours, result.baseline) for cell in _averages(own)))
        for result in found.locations
    ]
    columns = tuple(f"{version}: {what}" for version in ("ours", "baseline")
                    for what in ("found ± SEM", "at the limit", "model"))  # fmt: skip
    return Table(
        "Average search times [s]: of the rings found with standard error (SD with n - 1), as in the paper; "
        "with the undetected at the time limit; by a log-normal distribution with them censored.",
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

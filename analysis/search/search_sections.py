"""The sections of a report on the search: how soon, gain and loss, and what was found at all."""

from __future__ import annotations

import math

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.search.search_locations import Cell as LocationCell
from evenlight.analysis.search.search_locations import LocationResult
from evenlight.analysis.search.search_models import ORDER, VERSION, VISIT, effect_of
from evenlight.analysis.search.search_results import DetectionChange, SearchResults
from evenlight.analysis.search.search_sides import ABOUT_EQUAL
from evenlight.analysis.search.search_statistics import (
    LIKE_BOTH,
    LIKE_LOCATIONS,
    LIKE_PEOPLE,
    NO_COMBINATION,
    ORDER_EFFECTS,
    people_slope,
)
from evenlight.analysis.search.search_words import flags_of, lead_of, range_text
from evenlight.analysis.wording import p_text
from evenlight.data_schema.statistic import Origin

COLUMNS = ("ratio", "95 % interval", "p")


def times_section(found: SearchResults, picture: Picture) -> Section:
    """Return how soon the rings were found at each location."""
    text = (
        lead_of(found),
        "Each person looked once for a ring at each location in each version. An undetected ring is one that "
        "takes longer than the time limit: its time is not left out, and not the limit either, but censored. "
        "Medians are those of Kaplan and Meier; “not reached” where no more than half of the rings were "
        "found. "
        "The time ratio of a location is of its own few searches; a p value among so many locations is "
        "adjusted for their number (Holm).",
    )
    notes = tuple(
        f"{result.location.name}: {flag}." for result in found.locations for flag in _cell_flags(result)
    )
    if found.unpaired:
        notes = (
            *notes,
            f"{found.unpaired} searches have no partner in the other version; pairs leave them out.",
        )
    return Section("Search times", text, (_location_table(found),), (picture,), notes, is_simulated(found))


def is_simulated(found: SearchResults) -> bool:
    """Return whether the searches are simulated."""
    return found.origin is Origin.SIMULATED


def _cell_flags(result: LocationResult) -> list[str]:
    """Return what is to be said about versions in which nobody searched, or found, anything."""
    flags = []
    for version, cell in (("ours", result.ours), ("the baseline", result.baseline)):
        if cell is None:
            flags.append(f"nobody searched in {version}")
        elif cell.averages.undetected == cell.averages.n:
            flags.append(f"nobody found the ring in {version}")
    return flags


def _location_table(found: SearchResults) -> Table:
    """Return undetected rings, medians and ratios of all locations."""
    effects = found.models.by_location
    rows: list[tuple[Cell, ...]] = []
    for k, result in enumerate(found.locations):
        effect = effects.get(k)
        test = result.detections
        rows.append(
            (
                location_name(result),
                *(_lost(cell) for cell in (result.ours, result.baseline)),
                p_text(test.p_value) if test else None,
                p_text(result.p_holm),
                *(_median(cell) for cell in (result.ours, result.baseline)),
                *(effect_cells(effect)[:2] if effect else (None, None)),
                p_text(found.ratio_p.get(k)),
            )
        )
    return Table(
        "Undetected rings (p: exact test of McNemar, by itself and adjusted for the number of locations "
        "by Holm), median search times with 95 % interval, and time ratios of ours to the baseline (p: "
        "adjusted too).",
        ("location", "undetected: ours", "baseline", "p", "p (Holm)", "median [s]: ours", "baseline", "ratio",
         "95 % interval", "p (Holm)"),
        tuple(rows),
    )  # fmt: skip


def location_name(result: LocationResult) -> str:
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


def effect_cells(effect: FixedEffect) -> tuple[Cell, ...]:
    """Return the cells of a ratio: itself, its interval, p."""
    value = None if effect.estimate is None else f"{math.exp(effect.estimate):.2f}"
    return value, range_text((effect.ci_low, effect.ci_high), logarithms=True), p_text(effect.p_value)


def brightness_section(found: SearchResults, pictures: tuple[Picture, ...]) -> Section:
    """Return whether there is gain in the dark, and no loss in the bright."""
    percent = f"{100 * found.slowing:.0f} %"
    text = (
        "The paper's claim is an interaction: faster where ours is brighter than constant dimming, no slower "
        "where it is dimmer. The primary test is that of the slope over people: by how much ln(time) changes "
        "per unit of ln(brightness ratio). A slope of -0.5 means that twice the brightness takes 1/√2 of the "
        "time. All other tests of this and the next sections stand beside it and are not adjusted for their "
        "number; those of single locations are (Holm).",
        "The sides are of a model of their own. Where the factors differ by at most "
        f"{100 * ABOUT_EQUAL:.0f} % (ratio "
        f"{1 - ABOUT_EQUAL:.2f} to {1 + ABOUT_EQUAL:.2f}) brightness is about equal: such locations are in "
        "neither side.",
        "That no difference is found does not show that nothing is lost. For that, a loss that would matter "
        "must be "
        "excluded: "
        f"where ours dims, a search that takes {percent} longer or more. The margin is a choice; the table "
        "says how large a slowing the data do not exclude.",
        "People and locations are both samples. The first slope is for people like these at these very "
        "locations, the second for these people at locations like these, the third for both.",
    )
    tables = (_side_table(found), _slope_table(found))
    return Section(
        "Gain in the dark, no loss in the bright?",
        text,
        tables,
        pictures,
        _brightness_notes(found),
        is_simulated(found),
    )


def _side_table(found: SearchResults) -> Table:
    """Return the time ratios of all locations, and of either side."""
    rows: list[tuple[Cell, ...]] = []
    every = effect_of(found.models.overall, VERSION)
    rows.append(("all", len(found.locations), *effect_cells(every), None, None, every.flag))
    for side in found.models.sides:
        largest = None if side.slowing_high is None else f"{math.exp(side.slowing_high):.2f}"
        rows.append(
            (
                side.side.value,
                side.locations,
                *effect_cells(side.effect),
                largest,
                p_text(side.slowing_p),
                side.effect.flag,
            )
        )
    return Table(
        "Time ratio, ours to baseline; below 1 ours is faster. About equal: factors within "
        f"{100 * ABOUT_EQUAL:.0f} %. Largest not excluded: one-sided at 5 %.",
        (
            "ours there is",
            "locations",
            *COLUMNS,
            "largest not excluded",
            f"p of {1 + found.slowing:g} or more",
            "remark",
        ),
        tuple(rows),
    )


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
        "Change of ln(time) per unit of ln(brightness factor of ours / of the baseline); below 0: more "
        "light, "
        "less time.",
        ("for", "slope", "95 % interval", "p", "remark"),
        tuple(rows),
    )


def _brightness_notes(found: SearchResults) -> tuple[str, ...]:
    """Return what to be warned of in the models."""
    notes = []
    if found.models.n_left_out:
        notes.append(
            f"{found.models.n_left_out} searches are of places where nobody found a ring, or of locations "
            "seen in "
            "one version alone: they say nothing about a ratio, and are in no model."
        )
    check = effect_of(found.models.brightness, VERSION)
    if check.p_value is not None and check.p_value <= 0.05:
        notes.append(
            "At equal brightness the versions are the same picture, yet ours takes "
            f"{math.exp(check.estimate or 0):.2f} "
            f"times as long there (p = {p_text(check.p_value)}): by chance, or brightness does not act in "
            "this form."
        )
    fits = (found.models.overall, found.models.brightness)
    flags = dict.fromkeys(flag.value for fit in fits for flag in fit.flags)
    return (*notes, *(f"{flag[0].upper()}{flag[1:]}." for flag in flags if flag))


def pairs_section(found: SearchResults) -> Section:
    """Return what needs no model of times: who was found first, who at all, told rightly; and practice."""
    text = (
        "Each person's two searches of a location are a pair. Which of the two rings was found first needs "
        "no "
        "model of the times: the hazard ratio is that of the Cox model stratified by person and location "
        "(above 1: ours is found more readily). Pairs in which neither is known to be first say nothing "
        "about it. "
        "Its interval and p, and those of the shares found, are over people (Student's t), and no narrower "
        "than those of independent pairs. The exact p exchanges the versions person by person: how often "
        "ours was first, more often than the baseline, and how many more rings were found.",
        "A gap told rightly shows that the ring was seen: guesses hit one in eight.",
    )
    tables = (_first_table(found), _told_table(found), _order_table(found))
    return Section("Found first, found at all, told rightly", text, tables, (), (), is_simulated(found))


def _first_table(found: SearchResults) -> Table:
    """Return hazard ratios and differences of detections."""
    rows: list[tuple[Cell, ...]] = []
    for group, first in found.first.items():
        hazard, change = first.hazard, found.detection[group]
        value = None if hazard.ln_ratio is None else f"{math.exp(hazard.ln_ratio):.2f}"
        rows.append(
            (group, hazard.ours_first, hazard.baseline_first, hazard.tied + hazard.unknown, value,
             range_text((hazard.ci_low, hazard.ci_high), logarithms=True), p_text(hazard.p_value),
             p_text(first.p_value), f"{100 * change.difference:+.1f} %", _percent_range(change),
             p_text(change.p_value), p_text(change.exact_p), flags_of((hazard.flag, change.flag)))
        )  # fmt: skip
    return Table(
        "Pairs by which ring was found first, hazard ratio (ours to baseline), and rings found, ours minus "
        "baseline. Interval and p: Student's t over people.",
        ("locations", "ours first", "baseline first", "not known", "hazard ratio", "95 % interval", "p",
         "exact p", "rings found", "95 % interval", "p", "exact p", "remark"),
        tuple(rows),
    )  # fmt: skip


def _percent_range(change: DetectionChange) -> str | None:
    """Return the interval of a difference of shares [%]."""
    if change.ci_low is None or change.ci_high is None:
        return None
    return f"{100 * change.ci_low:+.1f} to {100 * change.ci_high:+.1f} %"


def _told_table(found: SearchResults) -> Table:
    """Return shares found and told rightly."""
    rows: list[tuple[Cell, ...]] = []
    for ours, version in ((True, "ours"), (False, "baseline")):
        share, told = found.shares[ours], found.orientation[ours]
        guessed = told.pressed_without_seeing
        rows.append(
            (version, f"{share.count} of {share.n}", range_text((share.ci_low, share.ci_high)),
             f"{told.correct.count} of {told.correct.n}",
             range_text((told.correct.ci_low, told.correct.ci_high)),
             None if guessed is None else f"{100 * guessed:.1f} %",
             "" if told.above_chance or guessed is None else "not shown to be above chance")
        )  # fmt: skip
    return Table(
        "Rings found, and gaps told rightly among them, with 95 % intervals of the shares (over people); "
        "pressed "
        "without seeing: if every ring seen was told rightly.",
        ("version", "found", "95 % interval", "told rightly", "95 % interval", "pressed without seeing",
         "remark"),
        tuple(rows),
    )  # fmt: skip


def _order_table(found: SearchResults) -> Table:
    """Return what practice does."""
    names = {effect.name for effect in found.models.overall.effects}
    rows = tuple(
        (words.removeprefix("time ratio, "), *effect_cells(effect_of(found.models.overall, name)))
        if name in names
        else (words.removeprefix("time ratio, "), None, None, None)
        for name, words in ((key, ORDER_EFFECTS[key]) for key in (VISIT, ORDER))
    )
    return Table("Order of the trials: time ratios; below 1: faster with practice.", ("", *COLUMNS), rows)

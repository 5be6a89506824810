"""What a search shows (Section 4.2 of the paper): first lines, three figures, and four sections."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from evenlight.analysis.inference.fixed_effects import SEPARATING
from evenlight.analysis.integrity.gate import confounded_order
from evenlight.analysis.report import Cell, KeyFigure, Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import (
    count,
    flag,
    how_sure,
    interval,
    number,
    p,
    p_with_holm,
    table_of,
    with_interval,
)
from evenlight.analysis.search import search_numbers as of
from evenlight.analysis.search.search_brightness_figure import brightness_figure, curves_figure
from evenlight.analysis.search.search_numbers import EVERYWHERE, RATIO, SLOWING, VERSIONS, Study, study_of
from evenlight.analysis.search.search_pairs import SearchFlag
from evenlight.analysis.search.search_times_figure import times_figure
from evenlight.analysis.search.search_trials import ABOUT_EQUAL, BrightnessEffect
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import counted, of_track, p_in_words, percent
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import SearchTrial

MORE = 0.1  # light in the example of what the slope means
IF_WRONG = "wrong answers as searches cut short, or left out"
RATIO_NAMES = ("ratio", "95 % CI", "p")
UNDETECTED_NAMES = ("undetected: the track", "baseline", "p", "p (Holm)")
SEPARATED = (*SEPARATING, SearchFlag.OURS_FIRST, SearchFlag.BASELINE_FIRST)
PAIR_NAMES = ("the track first", "baseline first", "after the same time", "not known")


def search_findings(data: TaskData[SearchTrial], slowing: float = SLOWING) -> Analysis:
    """Return what a search found.

    Parameters
    ----------
    data : TaskData of SearchTrial
        The searches: one of each participant at each location in each version, as a rule.
    slowing : float
        Share by which ours may take longer where it dims without that being a loss, above 0.

    Raises
    ------
    InputError
        If all searches are of one version, or there is no such share.
    """
    if not slowing > 0:
        raise InputError(f"the slowing to be excluded must be above 0, e.g. 0.25 for 25 %, got {slowing:g}")
    study, warnings = study_of(data, slowing)
    confound = confounded_order(data)
    every = times_figure(study), brightness_figure(study), curves_figure(study)
    drawings = tuple(drawing for drawing in every if drawing)
    times, *interaction = (drawing.picture for drawing in drawings)
    sections = (
        replace(times_section(study), pictures=(times,)),
        replace(brightness_section(study), pictures=tuple(interaction)),
        pairs_section(study),
        averages_section(study),
    )
    return Analysis(
        name="search",
        lead=lead_of(study, confound),
        rows=tuple(study.rows),
        drawings=drawings,
        sections=tuple(replace(own, simulated=study.simulated) for own in sections),
        warnings=(*data.warnings, *warnings, *_separations(study)),
        key_figures=key_figures_of(study, confound),
    )


def _separations(study: Study) -> Iterator[str]:
    """Yield which effect has no bound, as one version was always found, or found first."""
    for table, what in (("versions", RATIO), ("first found", of.HAZARD)):
        row = study.rows.find(table, EVERYWHERE, what)
        if row and any(flag.value in row.flag for flag in SEPARATED):
            yield f"search: {of_track(what)}: {row.flag}"


# --- first lines --------------------------------------------------------------------------------------------


def lead_of(study: Study, confound: str = "") -> str:
    """Return what came out, in a few sentences, and whether it may be the order of the versions."""
    return prose("search_lead", confound=confound, **_results(study))[0]


def _results(study: Study) -> dict[str, Any]:
    table, find = study.table, study.rows.find
    groups = {side: study.group_of(side) for side in (BrightnessEffect.DIMMED, BrightnessEffect.BRIGHTENED)}
    sides = [
        (side.value, study.sides[side], find("versions", group, RATIO), find("versions", group, of.LARGEST))
        for side, group in groups.items()
    ]
    return {
        "people": study.people,
        "searches": table.times.size,
        "undetected": int(np.count_nonzero(~(table.found | table.wrong))),
        "wrong": int(np.count_nonzero(table.wrong)),
        "repeated": table.repeated,
        "locations": counted(len(table.locations), "location"),
        "right": study.right_alone,
        "wrong_shares": [percent(table.wrong[table.ours == ours].mean()) for ours in VERSIONS.values()],
        "overall": find("versions", EVERYWHERE, RATIO),
        "slope": find("brightness", of.LIKE_PEOPLE, of.SLOPE),
        "elsewhere": find("brightness", of.LIKE_BOTH, of.SLOPE),
        "sides": [side for side in sides if side[2]],
        "alike": study.sides[BrightnessEffect.ALIKE],
        "about_equal": ABOUT_EQUAL,
        "slowing": study.slowing,
        "more": MORE,
        "alpha": of.ALPHA,
        "ratio": partial(_ratio_in_words, study),
        "lighter": _lighter,
        "sure": partial(how_sure, most=study.most),
    }


def _ratio_in_words(study: Study, row: Statistic) -> str:
    value, held = study.ratio(row)
    return f"{value} (95 % CI {held})" if held else f"{value}"


def _lighter(slope: Statistic) -> Statistic:
    """Return the ratio of times that some more light makes, from a slope."""
    value, low, high = (
        None if x is None else math.exp(x * math.log1p(MORE))
        for x in (slope.value, slope.ci_low, slope.ci_high)
    )
    return replace(slope, value=value, ci_low=low, ci_high=high)


def key_figures_of(study: Study, confound: str = "") -> tuple[KeyFigure, ...]:
    """Return how long searches take, what light does, how many rings are found, and what is wrong."""
    find, sure = study.rows.find, partial(how_sure, most=study.most)
    ratio = find("versions", EVERYWHERE, RATIO)
    slope = find("brightness", of.LIKE_PEOPLE, of.SLOPE)
    figures = []
    if ratio and ratio.value is not None:
        value, words, held = study.ratio(ratio)[0], "search time, the track to baseline", sure(ratio)
        if right := study.right_alone:
            value, words = f"{value} or {study.ratio(right)[0]}", f"{words}: {IF_WRONG}"
            held = f"{held}, or {sure(right)}"
        figures.append(KeyFigure(f"{value}", words, held))
    if slope and slope.value is not None and slope.p_value is not None:
        lighter = _lighter(slope)
        words = f"of the time with {percent(MORE, 0)} more light"
        figures.append(KeyFigure(f"{lighter.value:.2f}", words, sure(lighter)))
    values = " and ".join(percent(row.value or 0.0, 0) for row in _shares_found(study) if row)
    change = find("detections", EVERYWHERE, of.CHANGE)
    beside = "" if change is None or change.p_value is None else f"difference: {p_in_words(change.p_value)}"
    figures.append(KeyFigure(values, "of rings found, the track and baseline", beside))
    if confound:
        figures.append(KeyFigure(confound, "order and version cannot be told apart", warns=True))
    elif len(study.table.participants) == 1:
        figures.append(KeyFigure("1 participant", "nothing is said of other people", warns=True))
    elif study.pairs.unpaired and not study.table.repeated:
        words = f"of {study.table.times.size} have no partner in the other version"
        figures.append(KeyFigure(counted(study.pairs.unpaired, "search", "searches"), words, warns=True))
    return tuple(figures)


def _shares_found(study: Study) -> list[Statistic | None]:
    return [study.rows.find("detections", EVERYWHERE, f"{of.FOUND}, {version}") for version in VERSIONS]


# --- sections -----------------------------------------------------------------------------------------------


def times_section(study: Study) -> Section:
    """Return how soon the rings were found at each location."""
    table, places, own = study.table, _places(study), "locations"
    wrong = "; a wrong answer is one" if table.wrong.any() else ""
    test = "Student's t over people" if table.repeated else "exact test of McNemar"
    median = partial(_median, digits=study.digits)
    listed = study.rows.view(
        f"Undetected rings{wrong} (p: {test}, by itself and adjusted for the number of locations "
        "by Holm), median search times with 95 % confidence interval (CI), and time ratios of the track to "
        "the baseline (p: adjusted too).",
        places,
        [
            *((own, f"{of.LOST}, {version}", _out_of) for version in VERSIONS),
            (own, of.CHANGE, p_with_holm),
            *((own, f"{of.MEDIAN}, {version}", median) for version in VERSIONS),
            (own, RATIO, study.ratio),
            (own, RATIO, lambda row: p_with_holm(row)[1:]),
        ],
        ["location", *UNDETECTED_NAMES, "median [s]: the track", "baseline", "ratio", "95 % CI", "p (Holm)"],
    )
    cells, whole = of.searches_of_cells(table).size, 2 * len(table.participants) * len(places)
    fewest, most = study.searches_each
    return section(
        "search_times",
        [listed],
        each=most if fewest == most and cells == whole else 0,
        fewest=fewest,
        most=most,
        in_ours=int(np.count_nonzero(table.ours)),
        in_both=sum(place.in_both for place in table.locations),
        flags=[(place, why) for place in places for why in _missing(study, place)],
        unpaired=study.pairs.unpaired,
        **_results(study),
    )


def _places(study: Study) -> dict[str, str]:
    return {place.name: place.in_words for place in study.table.locations}


def _missing(study: Study, place: str) -> Iterator[str]:
    """Yield what to note of versions in which nobody searched, or found, anything."""
    for version, words in (("ours", "the track"), ("baseline", "the baseline")):
        found = study.rows.find("locations", place, f"{of.FOUND}, {version}")
        if found is None:
            yield f"nobody searched in {words}"
        elif not found.value:
            yield f"nobody found the ring in {words}"


def _out_of(row: Statistic | None) -> tuple[Cell]:
    return (None if row is None or row.value is None else f"{row.value:.0f} of {row.n}",)


def _median(row: Statistic | None, digits: int) -> tuple[Cell]:
    if row is None:
        return (None,)
    value, held = "not reached" if row.value is None else f"{row.value:.{digits}f}", interval(row, digits)
    return (f"{value} ({held})" if held else value,)


def brightness_section(study: Study) -> Section:
    """Return whether there is gain in the dark, and no loss in the bright."""
    rows = study.rows
    places = f"all ({counted(len(study.table.locations), 'location')})"
    largest = ("largest not excluded", f"p of {1 + study.slowing:g} or more")
    versions = rows.view(
        "Time ratio, the track to baseline, with 95 % confidence interval (CI); below 1 the track is "
        f"faster. About equal: factors within {100 * ABOUT_EQUAL:.0f} %. Largest not excluded: "
        "one-sided at 5 %.",
        {row.group: places if row.group == EVERYWHERE else row.group for row in rows.of("versions", RATIO)},
        [
            *(("versions", RATIO, show) for show in (study.ratio, p)),
            *(("versions", of.LARGEST, show) for show in (number, p)),
            ("versions", RATIO, flag),
        ],
        ["the track there is", *RATIO_NAMES, *largest, "remark"],
    )
    slopes = table_of(
        "Change of ln(time) per unit of ln(brightness factor of the track / of the baseline), with 95 % "
        "confidence interval (CI); below 0: more light, less time. The first is the primary test.",
        [(row.group, row) for row in rows.of("brightness", of.SLOPE)],
        (with_interval, p, flag),
        ["for", "slope", "95 % CI", "p", "remark"],
    )
    flags = dict.fromkeys(own.value for fit in (study.overall, study.brightness) for own in fit.flags)
    return section(
        "search_brightness",
        [versions, slopes],
        check=rows.find("brightness", EVERYWHERE, of.CHECK),
        left_out=study.table.times.size - study.used.times.size,
        flags=[words for words in flags if words],
        **_results(study),
    )


def pairs_section(study: Study) -> Section:
    """Return what needs no model of times: which was found first, which at all, which correctly; practice."""
    rows, find, groups = study.rows, study.rows.find, {name: name for name in study.groups}
    kinds = [f"pairs, {kind}" for kind in study.pairs.counts]
    first = rows.view(
        "Pairs by which ring was found first, and the hazard ratio, the track to baseline, with 95 % "
        "confidence interval (CI) and p by Student's t over people.",
        groups,
        [
            *(("first found", kind, count) for kind in kinds),
            *(("first found", of.HAZARD, show) for show in (study.ratio, p)),
            ("first found", of.FIRST, p),
            ("first found", of.HAZARD, flag),
        ],
        ["locations", *PAIR_NAMES, "hazard ratio", "95 % CI", "p", "exact p", "remark"],
    )
    more = rows.view(
        "Rings found, the track minus baseline [percentage points], with 95 % confidence interval (CI) and "
        "p by Student's t over people.",
        groups,
        [
            *(("detections", of.CHANGE, show) for show in (_points, p)),
            ("detections", of.MORE_FOUND, p),
            ("detections", of.CHANGE, flag),
        ],
        ["locations", "more found", "95 % CI", "p", "exact p", "remark"],
    )
    names = {of.HALVES: "second half / first half", of.TRIALS_LATER: "ten trials later in a half"}
    practice = table_of(
        "Order of the trials: time ratios; below 1: faster with practice.",
        [(words, find("order", EVERYWHERE, what)) for what, words in names.items()],
        (study.ratio, p),
        ("", *RATIO_NAMES),
    )
    return section(
        "search_pairs",
        [*((first, more) if groups else ()), _correct_table(study), practice],
        paired=bool(groups),
        firsts=[find("first found", EVERYWHERE, kind) for kind in kinds],
        hazard=find("first found", EVERYWHERE, of.HAZARD),
        shares=_shares_found(study),
        ratio=partial(_ratio_in_words, study),
        repeated=study.table.repeated,
    )


def _points(row: Statistic | None) -> tuple[Cell, Cell]:
    """Return a difference of shares and its interval, in percentage points."""
    if row is None or row.value is None:
        return None, None
    value, low, high = (
        None if x is None else f"{100 * x:+.1f}" for x in (row.value, row.ci_low, row.ci_high)
    )
    return value, None if low is None else f"{low} to {high}"


def _correct_table(study: Study) -> Table:
    cells: list[tuple[Cell, ...]] = []
    for version, found in zip(VERSIONS, _shares_found(study), strict=True):
        correct, guessed = (
            study.rows.find("orientation", EVERYWHERE, f"{what}, {version}")
            for what in (of.CORRECT, of.GUESSED)
        )
        unseen = None if guessed is None or guessed.value is None else percent(guessed.value)
        cells.append((of_track(version), *_share(found), *_share(correct), unseen, *flag(guessed)))
    share = ("found", "95 % CI", "identified correctly", "95 % CI")
    return Table(
        "Rings found, and gaps identified correctly among them, with 95 % confidence intervals (CI) of the "
        "shares (over people); pressed without seeing: if every ring seen was identified correctly.",
        ("version", *share, "pressed without seeing", "remark"),
        tuple(cells),
    )


def _share(row: Statistic | None) -> tuple[Cell, Cell]:
    """Return how many of all a share is, and its interval."""
    if row is None or row.value is None or row.n is None:
        return None, None
    return f"{row.value * row.n:.0f} of {row.n}", interval(row)


def averages_section(study: Study) -> Section:
    """Return the paper's average, beside what it leaves out."""
    ways = table_of(
        "The same time ratio, the track to baseline, by the treatment of undetected rings.",
        [(of_track(row.what), row) for row in study.rows.of("undetected", f"{RATIO}; ")],
        (lambda row: (row.n if row else None,), study.ratio, p, flag),
        ("", "searches", *RATIO_NAMES, "remark"),
    )
    shown = {of.MEAN: "found", of.MEAN_ERROR: "SEM", of.MEAN_AT_LIMIT: "at the limit", of.MODEL_MEAN: "model"}
    own = {
        f"{what}, {version}": f"{of_track(version)}: {shown[what]}" for version in VERSIONS for what in shown
    }
    sem = "over people" if study.table.repeated else "SD with n - 1"
    averages = study.rows.view(
        f"Average search times [s]: of the rings found, with their standard error (SEM; {sem}), as in "
        "the paper; with the undetected at the time limit; by a log-normal distribution with them censored.",
        _places(study),
        [("averages", what, partial(number, digits=study.digits)) for what in own],
        ("location", *own.values()),
    )
    return section("search_averages", [ways, averages], wrong=study.table.wrong.any())

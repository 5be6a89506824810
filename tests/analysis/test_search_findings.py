"""Claims about what the search found: every number said and drawn, and hard cases with flags, not numbers."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from made_searches import SearchTruth, made_table, task_data, trials_of

from evenlight.analysis.inference.fixed_effects import FitFlag
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import Rows
from evenlight.analysis.search.search_brightness_figure import curves_figure
from evenlight.analysis.search.search_findings import (
    averages_section,
    brightness_section,
    key_figures_of,
    lead_of,
    pairs_section,
    search_findings,
    times_section,
)
from evenlight.analysis.search.search_numbers import Study, study_of
from evenlight.analysis.search.search_trials import search_table
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import SearchTrial
from evenlight.data_schema.recordings.viewing import Version
from evenlight.data_schema.storage.tables import read_rows

Trials = tuple[SearchTrial, ...]
RATIO = "time ratio, ours / baseline"
SLOPE = "change of ln(time) per ln(brightness ratio)"


@functools.cache
def searches(people: int = 5, locations: int = 4, seed: int = 1) -> Trials:
    truth = SearchTruth(participants=people, locations=locations)
    return trials_of(made_table(truth, np.random.default_rng(seed)))


def changed(keep: Callable[[SearchTrial], SearchTrial | None]) -> Trials:
    return tuple(new for trial in searches() if (new := keep(trial)) is not None)


def lost(trial: SearchTrial) -> SearchTrial:
    return dataclasses.replace(
        trial, found=False, search_time=trial.time_limit, reported_orientation=None, response_time=None
    )


def found_at(trial: SearchTrial, time: float) -> SearchTrial:
    return dataclasses.replace(
        trial, found=True, search_time=time, reported_orientation=trial.ring_orientation, response_time=1.0
    )


def results(trials: Iterable[SearchTrial]) -> tuple[Study, dict[tuple[str, str, str], Statistic]]:
    study, _ = study_of(task_data(tuple(trials)))
    rows = {(row.table, row.group, row.what): row for row in study.rows}
    for row in rows.values():
        for number in (row.value, row.ci_low, row.ci_high, row.p_value, row.p_adjusted):
            assert number is None or math.isfinite(number), row
    # The words and tables go through too, whatever is missing; a lead is short.
    assert 0 < len(lead_of(study).split()) <= 60
    assert key_figures_of(study)
    for section in (times_section, brightness_section, pairs_section, averages_section):
        assert section(study).paragraphs
    return study, rows


@functools.cache
def as_simulated() -> tuple[Study, dict[tuple[str, str, str], Statistic]]:
    return results(searches())


@pytest.fixture(scope="module")
def findings() -> Analysis:
    return search_findings(task_data(searches()))


def test_every_drawn_number_is_written_beside_its_figure(findings: Analysis, tmp_path: Path) -> None:
    findings.write(tmp_path)
    rows = read_rows(Statistic, tmp_path / "search_statistics.csv")
    assert len(rows) == len(findings.rows)
    assert [d.name for d in findings.drawings] == ["search_times", "search_brightness", "search_curves"]
    for drawing in findings.drawings:
        assert drawing.png.startswith(b"\x89PNG")
        assert (
            len(read_rows(PlottedPoint, tmp_path / f"{drawing.name}_points.csv")) == len(drawing.points) > 0
        )
        assert {point.origin for point in drawing.points} == {Origin.SIMULATED}


def test_simulated_searches_are_called_so_in_every_section(findings: Analysis) -> None:
    assert all(section.simulated for section in findings.sections)
    assert "5 simulated participants" in findings.lead
    words = "5 simulated participants looked for a ring 40 times, at 4 locations"
    assert findings.sections[0].paragraphs[0].startswith(words)


def test_the_same_searches_give_the_same_numbers_in_whatever_order_they_are_read() -> None:
    again = results(searches()[::-1])[1]
    for key, row in as_simulated()[1].items():
        # A standard deviation of 0 is found to about 1e-8.
        expected = None if row.value is None else pytest.approx(row.value, rel=1e-5, abs=1e-6)
        assert again[key].value == expected, key


def test_locations_come_by_sequence_from_the_most_brightened_on() -> None:
    table, _ = search_table(task_data(searches(3, 8)))
    names = [place.sequence for place in table.locations]
    assert list(dict.fromkeys(names)) == ["library", "gym", "living_room", "basement"]  # the design's order
    for name in set(names):
        ratios = [place.ln_ratio or 0.0 for place in table.locations if place.sequence == name]
        assert ratios == sorted(ratios, reverse=True)


def test_everything_undetected_gives_counts_and_no_times() -> None:
    found, rows = results(map(lost, searches()))
    assert rows["versions", "all", RATIO].value is None
    assert rows["versions", "all", RATIO].flag == "nothing was ever found"
    assert rows["detections", "all", "rings found, ours"].value == 0.0
    change = rows["detections", "all", "rings found, ours - baseline"]
    assert (change.value, change.ci_low, change.p_value) == (0.0, None, None)
    assert "in no pair" in change.flag
    for row in (row for (table, _, _), row in rows.items() if table in ("versions", "order", "undetected")):
        assert (row.value, row.n) == (None, 40 if row.group == "all" else 20), row
        capped = "as found at the limit" in row.what  # all times are then equal
        assert row.flag.startswith("the times leave no scatter" if capped else "nothing was ever found")
    assert rows["first found", "all", "hazard ratio, ours / baseline"].value is None
    assert rows["orientation", "all", "gaps identified correctly, ours"].flag == "nothing was found"
    assert rows["locations", "library/spot00", "median search time, ours"].flag.startswith("not reached")
    assert rows["averages", "library/spot00", "mean of the rings found, ours"].flag == "nobody found the ring"
    assert rows["averages", "library/spot00", "restricted mean, ours"].value == 30.0
    assert "cannot be given" in lead_of(found)


def test_a_location_that_nobody_found_is_flagged_and_leaves_the_others_alone() -> None:
    found, rows = results(changed(lambda t: lost(t) if t.keypoint == "spot01" else t))
    _, without = results(changed(lambda t: None if t.keypoint == "spot01" else t))
    row = rows["locations", "gym/spot01", RATIO]
    assert (row.value, row.flag) == (None, "nobody found a ring there, or only one version was searched in")
    assert rows["versions", "all", RATIO].value == pytest.approx(without["versions", "all", RATIO].value)
    assert found.table.times.size - found.used.times.size == 10


def test_a_version_that_nobody_found_at_a_location_has_a_ratio_without_upper_end() -> None:
    gone = changed(
        lambda t: (
            lost(t)
            if t.keypoint == "spot01" and t.version is Version.OURS
            else found_at(t, 5.0 + t.trial_index)
        )
    )
    row = results(gone)[1]["locations", "gym/spot01", RATIO]
    assert row.value is None
    assert row.ci_high is None
    assert "plus infinity" in row.flag
    assert "it has no upper end" in row.flag


def test_a_version_in_which_nothing_was_found_separates() -> None:
    _, rows = results(lost(t) if t.version is Version.OURS else t for t in searches(3))
    ratio = rows["versions", "all", RATIO]
    assert (ratio.value, ratio.flag) == (None, FitFlag.SEPARATED.value)
    hazard = rows["first found", "all", "hazard ratio, ours / baseline"]
    assert hazard.value is None
    assert hazard.flag.startswith("separated: the baseline was found first in all")
    assert hazard.p_value is None
    exact = rows["first found", "all", "pairs, ours found first - baseline found first"]
    assert exact.p_value == 2.0**-2  # three people, each with a negative sum
    warned = search_findings(
        task_data(tuple(lost(t) if t.version is Version.OURS else t for t in searches(3)))
    )
    assert [words.partition(": ")[2] for words in warned.warnings] == [
        f"time ratio, the track / baseline: {ratio.flag}",
        f"hazard ratio, the track / baseline: {hazard.flag}",
    ]


@pytest.mark.parametrize("time", [30.0, 5.0])
def test_times_that_are_all_equal_leave_no_scatter_to_judge_by(time: float) -> None:
    _, rows = results(changed(lambda t: found_at(t, time)))
    row = rows["versions", "all", RATIO]
    assert (row.value, row.ci_low, row.p_value) == (None, None, None)
    assert row.flag == "the times leave no scatter to judge by: nothing can be estimated"
    assert rows["first found", "all", "pairs, both after the same time (left out)"].value == 20.0
    assert rows["locations", "gym/spot01", "median search time, ours"].value == time


def test_a_ring_found_at_the_limit_is_found() -> None:
    _, rows = results(changed(lambda t: found_at(t, 30.0) if not t.found else t))
    assert rows["detections", "all", "rings found, ours"].value == 1.0
    assert rows["versions", "all", RATIO].value is not None


def test_ties_everywhere_are_counted_and_left_out_of_who_was_first() -> None:
    _, rows = results(changed(lambda t: found_at(t, 10.0 * math.ceil(t.search_time / 10.0))))
    group = "first found", "all"
    kinds = ("ours found first", "baseline found first", "both after the same time (left out)",
             "neither known to be first (left out)")  # fmt: skip
    counts = [rows[*group, f"pairs, {kind}"].value for kind in kinds]
    assert counts[2] is not None
    assert counts[2] > 0
    assert sum(c or 0.0 for c in counts) == 20.0
    assert rows["versions", "all", RATIO].value is not None


def test_one_participant_says_nothing_of_others() -> None:
    _, rows = results(t for t in searches() if t.participant_id == "01")
    change = rows["detections", "all", "rings found, ours - baseline"]
    assert (change.ci_low, change.flag) == (None, "one participant: nothing is said of other people")
    for what in (
        "SD of the effect of ours on ln(time) between participants",
        "SD of ln(time) between participants",
    ):
        assert rows["versions", "all", what].value is None
        assert rows["versions", "all", what].flag == change.flag
    ratio = rows["versions", "all", RATIO]
    assert "for this person's searches alone" in ratio.flag
    slope = rows["brightness", "people like these, at these locations", SLOPE]
    assert (slope.ci_low, slope.p_value) == (None, None)
    assert slope.flag
    exact = rows["first found", "all", "pairs, ours found first - baseline found first"]
    assert (exact.p_value, exact.flag) == (None, change.flag)
    assert rows["locations", "gym/spot01", "median search time, ours"].flag == "too few for an interval"


def test_a_participant_with_one_search_counts_where_it_can() -> None:
    first = next(t for t in searches() if t.participant_id == "01")
    few = (first, *(t for t in searches() if t.participant_id != "01"))
    found, rows = results(few)
    assert found.pairs.unpaired == 1
    assert rows["first found", "all", "hazard ratio, ours / baseline"].value is not None
    assert rows["versions", "all", RATIO].value is not None


def test_a_model_of_fewer_searches_says_so() -> None:
    found, rows = results(searches())
    without = rows["undetected", "all", f"{RATIO}; undetected rings left out, as in the paper's average"]
    assert without.n is not None
    assert without.n <= found.table.found.sum() < 40
    for side, locations in found.sides.items():
        if locations:  # five people, two versions
            assert rows["versions", f"{side.value} ({locations} locations)", RATIO].n == 10 * locations


def with_rows(study: Study, **changes: dict[str, object]) -> Study:
    """A study in which rows say something else: by the beginning of their group, in the table it names."""
    rows = Rows(study.rows.origin)
    for row in study.rows:
        new = next((own for group, own in changes.items() if row.group.startswith(group)), {})
        rows.append(dataclasses.replace(row, **new) if row.what in (RATIO, SLOPE) else row)
    return dataclasses.replace(study, rows=rows)


@pytest.mark.parametrize(
    ("slope", "p_value", "words"),
    [
        (-0.5, 0.0004, "More light saves time: with 10 % more light a search takes 0.95 of the time"),
        (0.5, 0.0004, "More light costs time: with 10 % more light a search takes 1.05 of the time"),
        (-0.5, 0.3, "That search times depend on brightness is not shown: with 10 % more light"),
    ],
)
def test_the_words_lead_with_brightness_and_its_direction(slope: float, p_value: float, words: str) -> None:
    # 1.1 ** -0.5 = 0.953, 1.1 ** 0.5 = 1.049; its interval 1.1 ** -0.7 = 0.935 to 1.1 ** -0.3 = 0.972
    number = {"value": slope, "ci_low": slope - 0.2, "ci_high": slope + 0.2, "p_value": p_value, "flag": ""}
    study = with_rows(as_simulated()[0], people=number)
    assert lead_of(study).startswith(words)
    if slope < 0:
        assert "0.95 (95 % CI 0.94 to 0.97)" in brightness_section(study).paragraphs[0]
        assert "0.94 to 0.97" in key_figures_of(study)[1].in_words


def test_hairline_differences_of_brightness_are_on_neither_side() -> None:
    near = changed(
        lambda t: dataclasses.replace(t, factor=0.5 if t.version is Version.OURS else 0.51)
        if t.keypoint == "spot01" else t
    )  # fmt: skip
    found, _ = results(near)
    assert {side.value: n for side, n in found.sides.items()} == {
        "brightened": 1, "about equal": 1, "dimmed": 2}  # fmt: skip
    drawn = curves_figure(found)
    assert drawn
    assert {point.n for point in drawn.points if point.panel == "ours brightens"} == {
        5
    }  # five people, one place
    words = "1 location of about equal brightness (within 5 %) is in neither side"
    assert words in brightness_section(found).paragraphs[0]


def test_of_several_sessions_a_location_takes_the_first_alone() -> None:
    again = tuple(dataclasses.replace(t, session_id="9", search_time=1.0) if t.found else
                  dataclasses.replace(t, session_id="9") for t in searches())  # fmt: skip
    _, rows = results((*again, *searches()))
    once = as_simulated()[1]
    for table in ("locations", "averages"):
        keys = [key for key in once if key[0] == table and "ratio" not in key[2]]
        assert keys
        for key in keys:
            both = rows[key], once[key]
            assert len({(row.value, row.n, row.p_value) for row in both}) == 1, key


def test_everything_found_leaves_nothing_censored() -> None:
    _, rows = results(changed(lambda t: found_at(t, min(t.search_time, 29.0))))
    ways = [row.value for (table, _, _), row in rows.items() if table == "undetected"]
    assert ways[0] == pytest.approx(ways[1])
    assert ways[0] == pytest.approx(ways[2])
    assert rows["averages", "gym/spot01", "mean of the rings found, ours"].value == pytest.approx(
        rows["averages", "gym/spot01", "restricted mean, ours"].value
    )


def test_a_version_that_is_missing_at_a_location_leaves_that_location_without_a_ratio() -> None:
    found, rows = results(
        changed(lambda t: None if t.keypoint == "spot02" and t.version is Version.OURS else t)
    )
    name = "living_room/spot02"
    assert rows["locations", name, "brightness factor, ours"].value is None
    assert rows["locations", name, "rings found, ours - baseline"].flag != ""
    assert rows["locations", name, RATIO].value is None
    assert rows["locations", name, "median search time, baseline"].value is not None
    assert found.pairs.unpaired == 5


def test_different_time_limits_are_said_and_each_taken_as_it_was() -> None:
    def shorter(t: SearchTrial) -> SearchTrial:
        if t.participant_id > "02":
            return t
        cut = dataclasses.replace(t, time_limit=10.0, search_time=min(t.search_time, 10.0))
        return cut if t.search_time <= 10 and t.found else lost_at(t, 10.0)

    found, warnings = study_of(task_data(changed(shorter)))
    assert any("time limits differ, 10 to 30 s" in words for words in warnings)
    short = found.table.limits == 10
    assert found.table.times[short].max() == 10.0
    drawn = curves_figure(found)
    assert drawn
    assert max(point.x for point in drawn.points) == 10.0  # until then every search is watched


def lost_at(trial: SearchTrial, limit: float) -> SearchTrial:
    return dataclasses.replace(
        trial, time_limit=limit, search_time=limit, found=False, reported_orientation=None, response_time=None
    )


def test_one_location_has_a_ratio_and_no_line() -> None:
    found, rows = results(searches(5, 1))
    assert isinstance(found.line, str)
    assert rows["versions", "all", RATIO].value is not None
    assert rows["brightness", "these people, at locations like these",
                "change of ln(time) per ln(brightness ratio)"].flag == found.line  # fmt: skip


def test_gaps_that_are_all_told_wrongly_make_the_times_doubtful() -> None:
    _, rows = results(changed(lambda t: dataclasses.replace(t, reported_orientation=45) if t.found else t))
    guessed = rows["orientation", "all", "rings found without being seen, ours"]
    assert guessed.value == 1.0
    assert "not shown to be above chance" in guessed.flag
    wrong = f"{RATIO}; gaps identified wrongly count as undetected"
    assert rows["undetected", "all", wrong].flag == "nothing was ever found"


def test_one_version_alone_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match="20 searches are of the version 'ours'; a comparison needs"):
        search_findings(task_data(changed(lambda t: t if t.version is Version.OURS else None)))


@pytest.mark.parametrize(
    ("ratio", "p_value", "words"),
    [(2.34, 0.01, "searches take longer: the time ratio is 2.34"),
     (0.43, 0.01, "searches take less time: the time ratio is 0.43"),
     (2.34, 0.06, "(2 locations) the time ratio is 2.34")],
)  # fmt: skip
def test_it_says_that_searches_take_longer_where_the_test_does(
    ratio: float, p_value: float, words: str
) -> None:
    number = {"value": ratio, "ci_low": ratio / 2, "ci_high": 2 * ratio, "p_value": p_value, "flag": ""}
    study = with_rows(as_simulated()[0], dimmed=number)
    assert words in brightness_section(study).paragraphs[0]


def test_an_end_beyond_what_searches_can_show_is_not_bounded() -> None:
    number = {"value": 1.2, "ci_low": 0.18, "ci_high": 261030938266.88, "p_value": 0.9, "flag": ""}
    study = with_rows(as_simulated()[0], all=number)
    section = brightness_section(study)
    assert "1.20 (95 % CI above 0.18, no upper bound)" in section.paragraphs[0]
    assert section.tables[0].rows[0][:3] == ("all (4 locations)", "1.20", "above 0.18, no upper bound")


def test_the_design_is_that_of_the_data() -> None:
    study = as_simulated()[0]
    once = "Each person looked once for a ring at each location in each version."
    assert once in times_section(study).paragraphs[0]
    one = study.table.locations[0]
    alone = changed(
        lambda t: None if (t.keypoint, t.version) == (one.keypoint, Version.OURS)
        and t.sequence == one.sequence else t
    )  # fmt: skip
    words = (
        "There are 15 searches with the track and 20 with the baseline; 3 of 4 locations were seen in both "
        "versions."
    )
    assert words in times_section(results(alone)[0]).paragraphs[0]


def test_without_pairs_there_is_a_sentence_and_no_empty_table() -> None:
    halves = ({"01", "02"}, Version.OURS), ({"03", "04", "05"}, Version.BASELINE)
    alone = changed(
        lambda t: t if any(t.participant_id in who and t.version is v for who, v in halves) else None
    )
    about = pairs_section(results(alone)[0])
    assert "there is no pair to compare" in about.paragraphs[0]
    assert all(table.rows for table in about.tables)


def test_a_slowing_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"must be above 0, e\.g\. 0\.25 for 25 %, got 0"):
        search_findings(task_data(searches()), slowing=0.0)


def test_a_search_of_the_same_ring_again_is_left_out_and_said() -> None:
    again = dataclasses.replace(searches()[0], trial_index=99, search_time=1.0)
    table, warnings = search_table(task_data((*searches(), again)))
    assert table.times.size == 40
    assert any("1 searches at a location and in a version" in words for words in warnings)


def test_factors_that_differ_between_sessions_are_said() -> None:
    other = changed(lambda t: dataclasses.replace(t, factor=0.9) if t.participant_id == "01" else t)
    _, warnings = search_table(task_data(other))
    assert any("brightness factors of a version differ" in words for words in warnings)


def test_times_that_nobody_can_need_are_said() -> None:
    table, warnings = search_table(
        task_data(changed(lambda t: found_at(t, 0.0) if t.trial_index == 0 else t))
    )
    assert any("5 times are shorter than 0.1 s" in words for words in warnings)
    assert table.model_times.min() == 0.1

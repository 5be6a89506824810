"""`evenlight reproduce`: every table and figure, each number with its origin, recorded data in their place.

The sequences are small patterns here; rendering has tests of its own.
"""

import json
import re
from contextlib import nullcontext
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import browser_session
from moving_patterns import pattern
from report_pages import faults_at

from evenlight import command as command_line
from evenlight.analysis import reproduce_command
from evenlight.analysis.reproduction import reproduction, reproduction_report
from evenlight.analysis.reproduction.published_beside import Dependence
from evenlight.analysis.reproduction.reproduction_report import ReproductionResult, reproduction_result
from evenlight.data_schema.analysis_results import AnalysisSummary, Origin, Statistic
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_writing import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.search import SearchDesign, SearchTrial
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import Version
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record, write_toml_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.experiments.simulate_command import simulate
from evenlight.method.preset_files import load_display

SEQUENCES = ("library", "gym", "living_room", "basement")
RECORDED = ("01", "02", "03", "04")


def searched(participant: str, index: int) -> SearchTrial:
    """A search of one of three locations, in one of the versions; every fifth is in vain."""
    version, place = tuple(Version)[index % 2], index // 2
    found = (index + int(participant)) % 5 > 0
    return SearchTrial(
        participant_id=participant, session_id="01", trial_index=index, sequence="library",
        keypoint=("door", "desk", "shelf")[place], version=version,
        factor=0.5 if version is Version.BASELINE else 0.4 + 0.1 * place, ring_place=index % 2 + 1,
        ring_azimuth=10.0, ring_altitude=0.0, ring_gap=10.0, ring_contrast=-0.15, shown_contrast=-0.15,
        ring_orientation=90, background_luminance=30.0, gap_pixels=6.0, time_limit=30.0, found=found,
        search_time=4.0 + index + int(participant) if found else 30.0,
        reported_orientation=90 if found else None, response_time=None, simulated=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def lab(tmp_path_factory) -> Path:
    """A recorded data set of the search alone."""
    folder = tmp_path_factory.mktemp("recorded") / "lab"
    with new_dataset(folder) as staging:
        write_description(staging, "search", False, Provenance())
        write_participants(staging, list(RECORDED), simulated=False)
        for order, participant in enumerate(RECORDED):
            trials = [searched(participant, index) for index in range(6)]
            manifest = SessionManifest(
                participant, "01", "search", False, SessionStatus.COMPLETE, len(trials),
                load_display("varjo-xr3"), SearchDesign(sequences=("library",)), Provenance(), order,
            )  # fmt: skip
            write_session(staging, manifest, trials)
    return folder


class ToldSteps(list[str]):
    """The steps that a command tells of its progress."""

    step = list.append


STEPS_TOLD = ToldSteps()
RESULTS: list[ReproductionResult] = []


def kept(made: reproduction.Reproduction) -> ReproductionResult:
    """Return a result as the command has it, and keep it for the tests."""
    RESULTS.append(reproduction_result(made))
    return RESULTS[-1]


def reproduced(lab: Path, out: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduction, "built_in_sequence", pattern)
        patch.setattr(reproduction_report, "reproduction_result", kept)
        patch.setattr(reproduce_command, "shown_progress", lambda quiet: nullcontext(STEPS_TOLD))
        with pytest.raises(SystemExit) as ended:
            command_line.main(["reproduce", "--quick", "--data", str(lab), "--out", str(out), "--quiet"])
    assert not ended.value.code


@pytest.fixture(scope="module")
def folder(lab, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("reproduced") / "out"
    reproduced(lab, out)
    return out


def rows_of(folder: Path, part: str) -> list[Statistic]:
    return read_rows(Statistic, folder / "tables" / f"{part}_statistics.csv")


def test_every_table_and_figure_of_the_paper_is_there(folder) -> None:
    for part in (
        "slope_over_luminance",
        "detail_quality",
        "search",
        "adaptation",
        "power",
        "online",
    ):
        assert rows_of(folder, part), part
    figures = {path.stem for path in (folder / "figures").glob("*.png")}
    assert figures >= {
        "rate_limit", "thresholded_contrast", "checkerboard", "sunrise", "brightness_and_contrast_loss",
        "search_times", "adaptation_histogram", "online_walk", "online_target",
    }  # fmt: skip
    for name in figures:
        assert (folder / "figures" / f"{name}_points.csv").is_file(), name


def test_what_is_wrong_with_recorded_searches_is_the_first_thing_said(folder) -> None:
    # Four people, three places: see `searched`.
    said = "in the searches the track was shown first in all 12 pairs"
    page = (folder / "report.html").read_text()
    assert page.split('<p class="lead">')[1].startswith(f"Caution: {said}")
    summary = read_json_record(AnalysisSummary, folder / "reproduction.json")
    assert any(words.startswith(said) for words in summary.warnings)


def test_the_report_begins_with_what_came_out_and_how_far_published_numbers_make_it(folder) -> None:
    page = (folder / "report.html").read_text()
    lead = page.split('<p class="lead">')[1].split("</p>")[0]
    assert len(lead.split()) <= 60
    cards = page.split('<ul class="key-figures">')[1].split("</ul>")[0]
    # Slopes 8, Table 1 4 + 4, Table 2 4, Table 3 12, Figure 10 1; of searches no number is printed.
    assert re.search(r"<b>\d+ of 33</b> published numbers met", cards)
    assert "<b>0 of 33</b> of these are independent" in cards
    assert "of 28 circular" in cards
    assert "of 5 partly determined" in cards


def test_each_number_beside_a_published_one_says_what_makes_it(folder) -> None:
    kinds = [kind.value for kind in Dependence]
    made = {
        (row.what, kind)
        for part in ("slope_over_luminance", "detail_quality", "adaptation", "power", "online")
        for row in rows_of(folder, part)
        for kind in kinds
        if row.flag.removeprefix("quick run; ").startswith(f"{kind}: ")
    }
    assert made == {
        ("rate limit", "circular"),
        ("mean difference, ours less baseline", "circular"),
        ("ours chosen", "circular"),
        ("lag of the cones, without a rate limit over within it", "partly determined"),
        ("average power, constant", "circular"),
        ("average power, ours", "circular"),
        ("average power, full brightness", "circular"),
        ("SD of the controller / SD of constant dimming", "partly determined"),
    }
    page = (folder / "report.html").read_text()
    for table in (
        "Ratings of details",
        "Fastest change",
        "Table 2",
        "Average power",
        "Contrast loss over time",
    ):
        own = page.partition(f"<caption>{table}")[2].partition("</table>")[0]
        assert re.search("<td>(circular|partly determined)</td>", own), table


def test_a_quick_run_says_so_on_every_page_and_in_every_table(folder) -> None:
    summary = read_json_record(AnalysisSummary, folder / "reproduction.json")
    assert summary.quick
    assert "no number here is a result" in summary.warnings[0]
    page = (folder / "report.html").read_text()
    assert '<p class="banner">Quick run' in page
    assert '@page { @top-center { content: "Quick run' in page
    for path in (folder / "tables").glob("*.csv"):
        assert all(row.flag.startswith("quick run") for row in read_rows(Statistic, path)), path


def test_every_step_is_told_with_its_number(folder) -> None:
    # Calibration, 6 tracks, walk, 3 tasks, tables.
    numbers = [f"step {k} of 12" for k in range(1, 12)]
    assert [words.partition(",")[0] for words in STEPS_TOLD] == [*numbers, "the last step"]


def test_published_numbers_stand_beside_ours_and_every_origin_is_told(folder) -> None:
    rows = rows_of(folder, "detail_quality")
    for name in SEQUENCES:
        origins = {row.origin for row in rows if row.group == name}
        assert origins == {Origin.PUBLISHED, Origin.SIMULATED}, name
    printed = {row.what: row.value for row in rows if (row.group, row.origin) == ("gym", Origin.PUBLISHED)}
    assert printed["mean rating, baseline"] == 3.23  # Table 1
    assert printed["ours chosen"] == pytest.approx(0.47)
    adaptation = {row.origin for row in rows_of(folder, "adaptation")}
    assert adaptation == {Origin.PUBLISHED, Origin.COMPUTED}


def test_recorded_searches_take_the_place_of_simulated_ones(folder) -> None:
    origins = {row.origin for row in rows_of(folder, "search")}
    assert Origin.RECORDED in origins
    assert Origin.SIMULATED not in origins
    summary = read_json_record(AnalysisSummary, folder / "reproduction.json")
    assert summary.simulated
    page = (folder / "report.html").read_text()
    assert "4 recorded participants for search" in page
    assert "17 simulated participants for rating" in page
    assert not (folder / "pipeline" / "data" / "search").exists()


def test_every_number_of_the_table_of_the_report_is_in_a_table_of_its_own(folder) -> None:
    rows = rows_of(folder, "power")
    page = (folder / "report.html").read_text()
    for row in rows:
        assert row.value is not None
        assert f">{row.value:.3g}<" in page, row


def test_from_python_a_reproduction_answers_as_every_analysis(folder) -> None:
    (result,) = RESULTS
    assert {path.stem for path in (folder / "figures").glob("*.png")} == set(result.figures)
    table = result.to_frame()
    for part in result.parts:
        assert (table["part"] == part.name).sum() == len(rows_of(folder, part.name))
    lead, cards = result.first_lines
    assert result.summary().startswith(lead)
    assert len(cards) == 4
    assert f"<h1>{escape(result.heading)}</h1>" in (folder / "report.html").read_text()


def test_sequences_are_analysed_at_a_headsets_field_of_view(folder) -> None:
    # 64 pixels over 90 degrees: the picture plane is 32 pixels away, and a degree 32 · π / 180 pixels there.
    for name in SEQUENCES:
        stimulus = folder / "pipeline" / "stimuli" / name
        display = read_loss_curves(stimulus / "loss_curves.npz").display
        assert display.pixels_per_degree == pytest.approx(32 * np.pi / 180)
        assert read_track(stimulus / "track.csv").header.pixels_per_degree == display.pixels_per_degree


def test_what_is_assumed_stands_beside_what_is_published_and_estimated(folder) -> None:
    rows = [row for row in rows_of(folder, "simulated_viewers") if row.group == "gym"]
    values = {row.what: row.value for row in rows if row.origin is Origin.SIMULATED}
    # Ratings and comparisons; searches were recorded.
    assert set(values) == {"mean rating, ours less baseline: assumed", "chance of choosing ours: assumed"}
    truth = json.loads((folder / "pipeline" / "data" / "rating" / "simulated_truth.json").read_text())
    (rated,) = [own["value"] for own in truth["assumed"] if own["group"] == "gym"]
    assert values["mean rating, ours less baseline: assumed"] == pytest.approx(rated)
    printed = {row.what: row.value for row in rows if row.origin is Origin.PUBLISHED}
    assert printed["mean rating, ours less baseline"] == pytest.approx(3.71 - 3.23)  # Table 1
    page = (folder / "report.html").read_text()
    for words in ("What the simulated viewers are assumed to show", "Assumed and estimated"):
        assert f">{words}" in page


def test_tables_and_figures_validate(folder, command) -> None:
    outcome = command("validate", folder)
    assert outcome.code == 0, outcome.out


def test_a_folder_with_data_of_others_is_left_alone(lab, command, tmp_path) -> None:
    (tmp_path / "pipeline").mkdir()
    (tmp_path / "pipeline" / "mine.txt").write_text("mine")
    outcome = command("reproduce", "--out", tmp_path)
    assert outcome.code == 2
    assert "other things than a result of `evenlight reproduce`: pipeline/mine.txt;" in outcome.err
    assert (tmp_path / "pipeline" / "mine.txt").read_text() == "mine"


def test_what_cannot_be_used_is_refused_in_one_line(lab, command, tmp_path) -> None:
    for arguments, said in (
        (("--data", tmp_path / "nowhere"), "no such folder"),
        (("--seed", "-1"), "seed must be 0 or more, got -1"),
        (("--display", "nowhere"), "nowhere"),
        (("--data", lab, "--out", lab / "inside"), "lies in the data set"),
    ):
        place = () if "--out" in arguments else ("--out", tmp_path / "out")
        outcome = command("reproduce", *arguments, *place)
        assert outcome.code == 2
        assert said in outcome.err
        assert len(outcome.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_simulated_participants_look_at_the_display_that_is_named(tmp_path, monkeypatch) -> None:
    desk = replace(load_display("varjo-xr3"), name="desk", peak_luminance=120.0)
    path = tmp_path / "desk.toml"
    write_toml_record(path, desk)
    asked: list[str] = []

    def calibrated(task: str, out: Path, people: int, seed: int, display: str, **more: Any) -> None:
        asked.append(display)
        simulate(task, out, people, seed, display, **more)
        raise KeyboardInterrupt  # the calibration is enough

    monkeypatch.setattr(reproduction, "simulate", calibrated)
    plan = reproduction.ReproductionPlan(display=str(path), calibrators=1)
    with pytest.raises(KeyboardInterrupt):
        reproduction.run_pipeline(plan, tmp_path / "pipeline")
    assert asked == [str(path)]
    (manifest,) = (tmp_path / "pipeline").rglob("manifest.json")
    assert read_json_record(SessionManifest, manifest).display == desk


def test_the_report_fits_the_screen(folder) -> None:
    with browser_session() as browser:
        browser.open(folder / "report.html")
        assert [fault for width in (1440, 1100, 760, 360) for fault in faults_at(browser, width)] == []
        assert browser.errors() == []

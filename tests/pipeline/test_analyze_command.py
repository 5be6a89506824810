"""`evenlight analyze`: what a data set holds is analysed, labelled and checked; what cannot be, is said."""

import json
import shutil
from pathlib import Path

import pytest

from evenlight import command as command_line
from evenlight.data_schema.analysis_results import AnalysisSummary, Origin, Statistic
from evenlight.data_schema.recordings.dataset_layout import MANIFEST, TRIALS
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record

SEQUENCES = ("library", "gym", "living_room", "basement")
SESSION_OF = {"ramp": "01", "rating": "02", "comparison": "03"}


def run(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        command_line.main([str(a) for a in arguments])
    assert not ended.value.code


def take_over(data: Path, task: str, dataset: Path) -> None:
    """Move the sessions of a task's data set into one that holds several tasks, as visits of their own."""
    for folder in sorted(data.glob("sub-*/ses-01")):
        target = dataset / folder.parent.name / f"ses-{SESSION_OF[task]}"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(folder, target)
        shutil.rmtree(target / "beh", ignore_errors=True)
        for name in (MANIFEST, TRIALS):
            text = (target / name).read_text()
            text = text.replace('"session_id": "01"', f'"session_id": "{SESSION_OF[task]}"')
            (target / name).write_text(text)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory, make_stimulus, short_ramps: Path) -> Path:
    """Ramps of 3, ratings and comparisons of 12 simulated participants, in one data set."""
    folder = tmp_path_factory.mktemp("analyzed")
    for place, name in enumerate(SEQUENCES):
        make_stimulus(folder / "stimuli" / name, [0.35 + 0.1 * place, 0.55 + 0.1 * place] * 5)
    out = folder / "lab"
    run("simulate", "ramp", "--participants", 3, "--design", short_ramps, "--out", folder / "ramp", "--quiet")
    take_over(folder / "ramp", "ramp", out)
    for task in ("rating", "comparison"):
        data = folder / task
        stimuli = ("--stimuli", folder / "stimuli")
        run("simulate", task, *stimuli, "--participants", 12, "--out", data, "--quiet")
        take_over(data, task, out)
    return out


@pytest.fixture(scope="module")
def results(dataset, blank_pictures, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("results") / "out"
    run("analyze", dataset, "--out", out, "--quiet")
    return out


def test_each_task_has_its_table_and_the_calibration_its_rate_limit(results) -> None:
    for task in ("ramp", "rating", "comparison"):
        assert read_rows(Statistic, results / f"{task}_statistics.csv")
    assert (results / "rate_limit.json").is_file()
    assert (results / "thresholds.csv").is_file()


def test_every_number_and_the_report_say_that_they_are_simulated(results) -> None:
    for table in results.glob("*_statistics.csv"):
        origins = {row.origin for row in read_rows(Statistic, table)}
        assert Origin.SIMULATED in origins
        assert origins <= {
            Origin.SIMULATED,
            Origin.COMPUTED,
        }  # what so many answers could show, whoever gave them
    summary = read_json_record(AnalysisSummary, results / "analysis.json")
    assert summary.simulated
    assert set(summary.provenance.inputs) == {"ramp", "rating", "comparison"}
    page = (results / "report.html").read_text()
    assert page.count('<span class="mark">simulated</span>') >= 3
    assert "nothing about people" in page


def test_every_figure_has_the_table_of_its_points(results) -> None:
    figures = sorted(path.stem for path in results.glob("*.png"))
    assert figures
    assert sorted(path.name.removesuffix("_points.csv") for path in results.glob("*_points.csv")) == figures


def test_the_results_validate(results, command) -> None:
    outcome = command("validate", results)
    assert outcome.code == 0, outcome.out


def test_the_same_seed_gives_the_same_numbers(dataset, results, command, tmp_path) -> None:
    assert command("analyze", dataset, "--task", "rating", "--out", tmp_path, "--quiet").code == 0
    for name in ("rating_statistics.csv",):
        assert (tmp_path / name).read_bytes() == (results / name).read_bytes()
    assert not (tmp_path / "comparison_statistics.csv").exists()


def test_a_task_that_cannot_be_analysed_spoils_no_other(dataset, command, tmp_path) -> None:
    shutil.copytree(dataset, tmp_path / "lab")
    for folder in (tmp_path / "lab").glob("sub-*/ses-03"):
        lines = (folder / TRIALS).read_text().splitlines()
        flagged = [json.dumps({**json.loads(line), "flag": "dropped_frames"}) for line in lines]
        (folder / TRIALS).write_text("\n".join(flagged) + "\n")
    outcome = command("analyze", tmp_path / "lab", "--task", "rating", "--task", "comparison",
                      "--out", tmp_path / "out")  # fmt: skip
    assert outcome.code == 0
    assert "comparison is left out" in outcome.err
    assert "all flagged" in outcome.err
    assert (tmp_path / "out" / "rating_statistics.csv").is_file()
    summary = read_json_record(AnalysisSummary, tmp_path / "out" / "analysis.json")
    assert set(summary.refused) == {"comparison"}


def test_what_is_not_there_is_refused_in_one_line_and_leaves_nothing(dataset, command, tmp_path) -> None:
    out = tmp_path / "out"
    for arguments, said in (
        ((tmp_path / "nowhere",), "no such folder"),
        ((tmp_path,), "holds no session"),
        ((dataset, "--task", "search"), "expected sessions of search; it holds ramp, rating, comparison"),
        ((dataset, "--task", "seeing"), "--task must be one of"),
        ((dataset, "--margin", "0.5"), "margin must lie between 0 and 0.5, got 0.5"),
        ((dataset, "--slowing", "0"), "slowing must lie above 0 and not above 9, got 0"),
        (
            (dataset.parent,),
            "holds data sets in folders of their own: comparison, ramp, rating; give one",
        ),
        ((dataset, "--seed", "-1"), "seed must be 0 or more, got -1"),
    ):
        outcome = command("analyze", *arguments, "--out", out)
        assert outcome.code == 2
        assert said in outcome.err
        assert len(outcome.err.splitlines()) == 1
    assert not out.exists()


def test_results_are_never_written_into_the_data_set(dataset, command) -> None:
    before = sorted(dataset.rglob("*"))
    for out in (dataset, dataset / "results"):
        outcome = command("analyze", dataset, "--out", out)
        assert outcome.code == 2
        assert "lies in the data set" in outcome.err
    assert sorted(dataset.rglob("*")) == before


def test_what_an_earlier_analysis_left_is_cleared(dataset, command, tmp_path) -> None:
    out = tmp_path / "out"
    assert command("analyze", dataset, "--task", "comparison", "--out", out, "--quiet").code == 0
    assert (out / "comparison_statistics.csv").is_file()
    assert command("analyze", dataset, "--task", "rating", "--out", out, "--quiet").code == 0
    assert not list(out.glob("comparison*"))
    assert (out / "rating_statistics.csv").is_file()

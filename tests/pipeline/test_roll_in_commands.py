"""The roll-call in `fit`, `analyze` and `validate`: a session that is not read is said, and stops nobody."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evenlight.data_schema.analysis_results import AnalysisSummary
from evenlight.data_schema.recordings.roll_call import SessionUse
from evenlight.data_schema.storage.text_files import read_json_record

Run = Callable[..., Any]
S = "sub-02/ses-01"
LINE = ("--form", "log_log", "--degree", "1")  # one curve is fitted, and none chosen among several


@pytest.fixture(scope="module")
def simulated(short_ramps: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ramps of three simulated participants, as the command makes them."""
    from typer.testing import CliRunner

    from evenlight import command as command_line

    out = tmp_path_factory.mktemp("simulated") / "d"
    words = ["simulate", "ramp", "--participants", "3", "--design", str(short_ramps), "--quiet"]
    assert CliRunner().invoke(command_line.app, [*words, "--out", str(out)]).exit_code == 0
    return out


@pytest.fixture
def dataset(simulated: Path, tmp_path: Path) -> Path:
    shutil.copytree(simulated, tmp_path / "d")
    return tmp_path / "d"


def empty(dataset: Path) -> None:
    (dataset / S / "trials.jsonl").write_text("")


def rename(dataset: Path) -> None:
    (dataset / "sub-02").rename(dataset / "Sub-02")


def capitals(dataset: Path) -> None:
    path = dataset / S / "manifest.json"
    path.write_text(path.read_text().replace('"task": "ramp"', '"task": "Ramp"'))


def remove(dataset: Path) -> None:
    shutil.rmtree(dataset / "sub-02")


def copy(dataset: Path) -> None:
    shutil.copytree(dataset / "sub-02", dataset / "sub-04")


def practice(dataset: Path) -> None:
    path = dataset / S / "trials.jsonl"
    text = path.read_text().replace('"practice": false', '"practice": true')
    path.write_text(re.sub('"block": [0-9]+', '"block": 0', text))


CASES = {
    empty: (2, f"{S} is left out: it has no trial (status: complete)"),
    rename: (2, "Sub-02 is left out: its name is not sub- with letters and digits after it"),
    capitals: (2, f"{S} is left out: manifest.json: task: expected 'ramp', got 'Ramp'"),
    remove: (2, "without a session, though participants.tsv lists them: sub-02"),
    copy: (3, f"sub-04/ses-01 is left out: its trials are those of {S}; a copy counts once"),
    practice: (2, f"{S} is left out: it has no trial that counts (150 of practice, 0 flagged"),
}


@pytest.mark.parametrize("damage", CASES, ids=lambda damage: damage.__name__)
def test_fit_reads_the_others_and_says_who_is_missing_on_the_terminal_in_the_summary_and_in_the_report(
    damage: Callable[[Path], None], dataset: Path, command: Run, tmp_path: Path, blank_pictures: None
) -> None:
    damage(dataset)
    people, said = CASES[damage]
    outcome = command("fit", dataset, *LINE, "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert f"warning: {said}" in outcome.err
    assert f"simulated participants: {people}" in outcome.out
    summary = json.loads((tmp_path / "out" / "fit_summary.json").read_text())
    assert summary["n_participants"] == people
    assert any(words.startswith(said) for words in summary["warnings"])
    assert summary["n_trials"] == 150 * people
    assert sum(entry["use"] == "read" for entry in summary["roll"]["sessions"]) == people
    page = (tmp_path / "out" / "report.html").read_text()
    assert f"those of {people} can be read" in page
    assert said.replace("'", "&#x27;") in page


@pytest.mark.parametrize("damage", [rename, capitals, copy], ids=lambda damage: damage.__name__)
def test_validate_finds_what_is_to_be_put_right(
    damage: Callable[[Path], None], dataset: Path, command: Run
) -> None:
    assert command("validate", dataset, "--quiet").code == 0
    damage(dataset)
    outcome = command("validate", dataset, "--quiet")
    assert outcome.code == 1
    assert CASES[damage][1].partition(": ")[2] in outcome.out


def test_analyze_has_the_roll_in_its_summary_and_its_report(
    dataset: Path, command: Run, tmp_path: Path, blank_pictures: None
) -> None:
    empty(dataset)
    outcome = command("analyze", dataset, "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert CASES[empty][1] in outcome.err
    summary = read_json_record(AnalysisSummary, tmp_path / "out" / "analysis.json")
    assert CASES[empty][1] in summary.warnings
    assert summary.roll is not None
    assert [entry.use for entry in summary.roll.sessions] == [
        SessionUse.READ, SessionUse.WRONG, SessionUse.READ,
    ]  # fmt: skip
    assert summary.roll.listed == ("01", "02", "03")
    page = (tmp_path / "out" / "report.html").read_text()
    assert (
        "The list of participants names 3; 3 participants have sessions, and those of 2 can be read" in page
    )
    lead = page.split('<p class="lead">')[1].split("</p>")[0]
    assert lead.startswith("Caution: 1 of 3 sessions is not read, as something is wrong with it. ")
    assert page.count("sessions is not read") == 1
    assert page.count(CASES[empty][1]) == 1


def test_someone_with_catch_trials_alone_is_named_and_stops_nobody(
    dataset: Path, command: Run, tmp_path: Path, blank_pictures: None
) -> None:
    path = dataset / S / "trials.jsonl"
    lines = [line for line in path.read_text().splitlines(keepends=True) if '"is_catch": true' in line]
    path.write_text("".join(lines))
    outcome = command("fit", dataset, *LINE, "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert "participant 02 has no threshold: catch trials only" in outcome.err


def test_a_data_set_without_a_session_that_can_be_read_says_why(
    dataset: Path, command: Run, tmp_path: Path
) -> None:
    for path in dataset.glob("sub-*/ses-01/manifest.json"):
        path.write_text(path.read_text().replace('"task": "ramp"', '"task": "Ramp"'))
    for words in (("fit", dataset), ("analyze", dataset)):
        outcome = command(*words, "--out", tmp_path / "out")
        assert (outcome.code, outcome.err.count("\n")) == (2, 1)
        assert "sub-01/ses-01 is left out: manifest.json: task: expected 'ramp', got 'Ramp'" in outcome.err
    assert not (tmp_path / "out").exists()

"""A task of someone else: one file declares it, and every command that goes by tasks knows it."""

import csv
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.analysis.dataset_findings import ANALYSES
from evenlight.data_schema.recordings.session import TASKS
from evenlight.experiments.experiment_kinds import EXPERIMENTS

FILE = Path(__file__).parents[2] / "examples" / "which_looks_better.py"
TASK = "which_looks_better"
NAMES = ("bright", "dark")


@pytest.fixture(autouse=True)
def forgotten_afterwards() -> Iterator[None]:
    """Tests of other files in this process know the tasks that come along, and no other."""
    yield
    for registry in (TASKS, EXPERIMENTS, ANALYSES):
        registry.pop(TASK, None)


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EVENLIGHT_TASKS", str(FILE))


def test_the_examples_use_names_that_stay() -> None:
    others = Path(FILE.parent / "evenlight-flicker" / "evenlight_flicker" / "task.py")
    for file in (FILE, others):
        modules = re.findall(r"^(?:from|import) (evenlight[.\w]*)", file.read_text(), re.MULTILINE)
        assert set(modules) <= {"evenlight", "evenlight.tasks"}


@pytest.fixture
def stimuli(tmp_path: Path, make_stimulus: Callable[..., None]) -> Path:
    for name in NAMES:
        make_stimulus(tmp_path / "stimuli" / name, np.full(10, 0.5))
    return tmp_path / "stimuli"


@pytest.fixture
def design(tmp_path: Path) -> Path:
    path = tmp_path / f"my.{TASK}.design.toml"
    path.write_text(f"sequences = {json.dumps(NAMES)}\nrepetitions = 3\n")
    return path


@pytest.fixture
def simulated(
    tmp_path: Path, registered: None, command: Callable[..., Any], stimuli: Path, design: Path
) -> Path:
    words = ("--participants", 12, "--seed", 4, "--stimuli", stimuli, "--design", design)
    outcome = command("simulate", TASK, *words, "--out", tmp_path / "pilot", "--quiet")
    assert outcome.code == 0, outcome.err
    return tmp_path / "pilot"


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.mark.usefixtures("registered")
def test_a_session_is_rehearsed_from_consent_to_thanks_and_its_data_set_validates_and_exports(
    command: Callable[..., Any], tmp_path: Path, stimuli: Path, design: Path
) -> None:
    lab = tmp_path / "lab"
    words = ("--participant", "01", "--session", "01", "--rig", "simulated", "--simulate", "data")
    outcome = command("run", TASK, *words, "--stimuli", stimuli, "--design", design, "--out", lab)
    assert outcome.code == 0, outcome.err
    assert "complete: 6 of 6 trials" in outcome.out
    session = lab / "sub-01/ses-01"
    trials = lines(session / "trials.jsonl")
    assert [trial["practice"] for trial in trials] == [True] + [False] * 6
    assert sorted(trial["sequence"] for trial in trials[1:]) == sorted(NAMES * 3)
    assert {trial["response"] for trial in trials} <= {"first", "second"}
    manifest = json.loads((session / "manifest.json").read_text())
    assert (manifest["task"], manifest["design"]["repetitions"]) == (TASK, 3)
    assert {f"instructions_{TASK}", f"question_{TASK}"} <= set(manifest["pages"])
    shown = [event["detail"] for event in lines(session / "events.jsonl") if event["kind"] == "page_shown"]
    assert shown == [
        "consent",
        *["key_test"] * 2,
        f"instructions_{TASK}",
        "practice_end",
        *["break"] * 2,
        "end",
    ]
    assert len(lines(session / "frames.jsonl")) == 2 * len(trials)
    checked = command("validate", lab)
    assert (checked.code, "no problem" in checked.out) == (0, True)
    assert "design" in command("validate", design).out
    assert command("export", lab, "--out", tmp_path / "shared").code == 0
    assert list((tmp_path / "shared").glob(f"data/*task-{TASK}_data.csv"))


@pytest.mark.usefixtures("registered")
def test_a_session_is_resumed_where_it_was_interrupted(
    command: Callable[..., Any], tmp_path: Path, stimuli: Path, design: Path
) -> None:
    lab = tmp_path / "lab"
    words = ("run", TASK, "--participant", "01", "--session", "01", "--rig", "simulated")
    words += ("--simulate", "data", "--stimuli", str(stimuli), "--design", str(design), "--out", str(lab))
    assert command(*words).code == 0
    manifest, trials = (lab / "sub-01/ses-01" / name for name in ("manifest.json", "trials.jsonl"))
    whole = trials.read_text()
    manifest.write_text(manifest.read_text().replace('"status": "complete"', '"status": "aborted"'))
    trials.write_text("".join(whole.splitlines(keepends=True)[:4]))
    assert command(*words, "--resume").code == 0
    answered = [
        [row["response"] for row in map(json.loads, text.splitlines())]
        for text in (whole, trials.read_text())
    ]
    assert answered[0] == answered[1]


def test_without_the_task_validate_leaves_its_sessions_unchecked_and_says_so(
    simulated: Path, command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("EVENLIGHT_TASKS")
    for registry in (TASKS, EXPERIMENTS, ANALYSES):
        registry.pop(TASK)
    for path in simulated.glob("**/manifest.json"):
        manifest = json.loads(path.read_text())
        manifest["design"]["flashes"] = [1, 2]  # which no task of ours has
        path.write_text(json.dumps(manifest))
    checked = command("validate", simulated)
    assert (checked.code, "flashes" in checked.out + checked.err) == (0, False), checked.err
    assert "is not registered (EVENLIGHT_TASKS)" in checked.out + checked.err


def test_simulated_participants_are_analysed_by_the_exact_test_of_the_file(
    simulated: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    assert command("validate", simulated).code == 0
    outcome = command("analyze", simulated, "--out", tmp_path / "results")
    assert outcome.code == 0, outcome.err
    said = re.search(r"which_looks_better: (\d+) of (\d+) participants preferred", outcome.out)
    assert said is not None
    ours = []  # by hand, from the files: people who chose the modulated version more often than not
    for path in sorted(simulated.glob("sub-*/ses-*/trials.jsonl")):
        rows = lines(path)
        chose = sum((row["response"] == "first") == (row["ours_interval"] == 1) for row in rows)
        if 2 * chose != len(rows):
            ours.append(2 * chose > len(rows))
    assert (int(said[1]), int(said[2])) == (sum(ours), len(ours))
    report = (tmp_path / "results/report.html").read_text()
    assert "Which looks better?" in report
    assert "simulated" in report.lower()
    table = (tmp_path / "results/which_looks_better_statistics.csv").read_text()
    row = next(csv.DictReader(table.splitlines()))
    assert float(row["value"]) == pytest.approx(sum(ours) / len(ours))
    named = command("analyze", simulated, "--task", TASK, "--out", tmp_path / "again")
    assert named.code == 0


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('"response": "', '"response": "no ', "response: expected one of"),
        ('"mean_factor": 0.5', '"mean_factor": 0.4', "mean_factor: expected 0.5"),
        ('"sequence": "dark"', '"sequence": "night"', "sequence: expected one of bright, dark"),
        ('"ours_interval": 1', '"ours_interval": 3', "ours_interval: expected at most 2"),
    ],
)
def test_a_trial_that_is_not_as_declared_is_found(
    simulated: Path, command: Callable[..., Any], before: str, after: str, words: str
) -> None:
    path = simulated / "sub-03/ses-01/trials.jsonl"
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))
    outcome = command("validate", simulated)
    assert outcome.code == 1
    assert re.search(rf"{re.escape(str(path))}, line \d+: {words}", outcome.out)


def test_a_design_that_is_not_as_declared_is_found_in_the_manifest(
    simulated: Path, command: Callable[..., Any]
) -> None:
    path = simulated / "sub-03/ses-01/manifest.json"
    path.write_text(path.read_text().replace('"repetitions": 3', '"repetitions": 0'))
    outcome = command("validate", simulated)
    assert outcome.code == 1
    assert "design.repetitions: expected at least 1, got 0" in outcome.out


def test_without_its_file_the_task_is_refused_in_one_line(
    simulated: Path,
    command: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    stimuli: Path,
) -> None:
    monkeypatch.delenv("EVENLIGHT_TASKS")
    for registry in (TASKS, EXPERIMENTS, ANALYSES):
        registry.pop(TASK)
    session = ("--participant", "01", "--session", "01", "--rig", "simulated")
    refused = {
        ("run", TASK, *session): f"task '{TASK}' cannot be run; there is 'ramp'",
        ("simulate", TASK, "--stimuli", stimuli): f"task '{TASK}' cannot be simulated; there is 'ramp'",
        ("plan", TASK): f"task '{TASK}' cannot be planned; there is 'ramp'",
        ("analyze", simulated): f"holds sessions of {TASK}, which is not registered",
        ("analyze", simulated, "--task", TASK): "--task must be one of ramp, rating, comparison, search",
    }
    for words, said in refused.items():
        outcome = command(*words, "--out", tmp_path / "none")
        assert (outcome.code, outcome.err.count("\n")) == (2, 1)
        assert said in outcome.err
        assert not (tmp_path / "none").exists()


def test_a_package_names_its_task_in_an_entry_point(
    command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, stimuli: Path, design: Path
) -> None:
    site = tmp_path / "site"
    installed = site / "my_lab-1.0.dist-info"
    installed.mkdir(parents=True)
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: my-lab\nVersion: 1.0\n")
    (installed / "entry_points.txt").write_text(f"[evenlight.tasks]\n{TASK} = my_lab_looks\n")
    (site / "my_lab_looks.py").write_text(FILE.read_text())
    monkeypatch.syspath_prepend(site)
    words = ("--participants", 2, "--stimuli", stimuli, "--design", design, "--out", tmp_path / "pilot")
    outcome = command("simulate", TASK, *words)
    assert (outcome.code, outcome.err) == (0, "")
    assert "2 simulated participants" in outcome.out


def test_a_file_that_cannot_be_loaded_is_refused_in_one_line(
    command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "task.py"
    for text, said in (
        (None, "no such file; expected a Python file with a task"),
        ("nonsense(", "SyntaxError"),
        (FILE.read_text().replace(f'name="{TASK}"', 'name="ramp"'), "none of ramp, rating"),
        (FILE.read_text().replace('"question":', '"query":'), "must be instructions and question"),
    ):
        if text is not None:
            path.write_text(text)
        monkeypatch.setenv("EVENLIGHT_TASKS", str(path))
        outcome = command("validate", tmp_path)
        assert (outcome.code, outcome.err.count("\n")) == (2, 1)
        assert said in outcome.err

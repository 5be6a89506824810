"""`evenlight run --resume`: a session that was killed or stopped goes on as if it had not been."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from blind_sessions import RIG, SMALL, arguments, rows, written
from warm_evenlight import Run

import evenlight
from evenlight.data_schema.recordings.dataset_layout import EVENTS, TRIALS
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign
from evenlight.data_schema.storage.text_files import write_toml_record

Command = Callable[..., Any]
PROGRAM = [sys.executable, "-m", "evenlight"]
ROOT = Path(evenlight.__file__).parents[1]
ADAPTIVE = RampDesign(
    procedure=Procedure.TWO_INTERVAL,
    placement=Placement.TARGETED,
    screens=("white",),
    factors=(0.4, 1.0),
    trials_per_level=20,
    practice_trials=2,
    trials_between_breaks=0,
)  # 40 trials at real durations: slow enough to be killed in the midst of it
# What an interruption may change: when a trial was shown, and how often.
CHANGES = {"onset_s", "attempt"}


def without_times(trials: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in trial.items() if key not in CHANGES} for trial in trials]


def killed(dataset: Path, design: Path, resume: bool, after: int) -> None:
    """Run a session and kill it with SIGKILL once some more lines are in its log of events."""
    path = dataset / "sub-01/ses-01" / EVENTS
    goal = (len(path.read_text().splitlines()) if path.exists() else 0) + after
    more = ["--resume"] if resume else []
    process = Run(arguments(dataset, design, *more), dict(os.environ))
    end = time.monotonic() + 200
    while process.poll() is None and time.monotonic() < end:
        if path.exists() and path.read_bytes().count(b"\n") >= goal:
            process.send_signal(signal.SIGKILL)
        time.sleep(0.002)
    process.communicate(timeout=200)
    assert process.returncode == -signal.SIGKILL


def test_a_session_killed_again_and_again_gives_the_trials_of_an_unbroken_one(
    command: Command, tmp_path: Path
) -> None:
    """Adaptive placement: every rate depends on all answers before, so a lost one would change the rest."""
    design = written(ADAPTIVE, tmp_path)
    assert command(*arguments(tmp_path / "whole", design)).code == 0
    whole = rows(tmp_path / "whole")
    assert len(whole) == 42
    broken = tmp_path / "broken"
    seed = int.from_bytes(os.urandom(4))
    print(f"the moments of the kills have the seed {seed}")  # pytest shows it where the test fails
    rng = np.random.default_rng(seed)
    seen: list[dict[str, Any]] = []
    for attempt in range(3):
        killed(broken, design, resume=attempt > 0, after=int(rng.integers(5, 15)))
        lines = (broken / "sub-01/ses-01" / TRIALS).read_text().split("\n")[:-1]
        recorded = [json.loads(line) for line in lines]
        assert recorded[: len(seen)] == seen  # no completed trial is lost
        seen = recorded
    assert command(*arguments(broken, design, "--resume")).code == 0
    assert without_times(rows(broken)) == without_times(whole)
    assert command("validate", broken).code == 0
    events = rows(broken, EVENTS)
    assert sum(e["kind"] == "resumed" for e in events) == 3
    interrupted = [e for e in events if e["kind"] == "trial_interrupted"]
    again = {t["trial_index"] for t in rows(broken) if t["attempt"] > 1}
    assert again == {e["trial_index"] for e in interrupted}


@pytest.fixture
def design(tmp_path: Path) -> Path:
    return written(SMALL, tmp_path)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ([], "this session is there already and data are never overwritten"),
        (["--resume"], "this session is complete; give another --session"),
    ],
)
def test_a_complete_session_is_neither_overwritten_nor_resumed(
    command: Command, tmp_path: Path, design: Path, more: list[str], message: str
) -> None:
    lab = tmp_path / "lab"
    command(*arguments(lab, design))
    before = {p: p.read_bytes() for p in lab.rglob("*") if p.is_file()}
    ended = command(*arguments(lab, design, *more))
    assert ended.code == 2
    assert message in ended.err
    assert {p: p.read_bytes() for p in lab.rglob("*") if p.is_file()} == before


def test_a_session_is_resumed_only_as_it_began(command: Command, tmp_path: Path) -> None:
    design = written(ADAPTIVE, tmp_path)
    killed(tmp_path / "lab", design, resume=False, after=20)
    other = tmp_path / "other.toml"
    write_toml_record(other, SMALL)
    ended = command(*arguments(tmp_path / "lab", other, "--resume"))
    assert (ended.code, "--design is not as it was when this session began" in ended.err) == (2, True)
    ended = command(*arguments(tmp_path / "lab", design, "--resume", "--seed", 5))
    assert (ended.code, "--seed is not as it was" in ended.err) == (2, True)


def test_another_rig_is_refused_but_another_language_and_keys_are_noted(
    command: Command, tmp_path: Path
) -> None:
    design = written(ADAPTIVE, tmp_path)
    killed(tmp_path / "lab", design, resume=False, after=20)
    other = tmp_path / "other.rig.toml"
    other.write_text(RIG.replace("60.0", "144.0"))
    words = arguments(tmp_path / "lab", design, "--resume")
    words[words.index("--rig") + 1] = str(other)
    ended = command(*words)
    assert (ended.code, "--rig is not as it was" in ended.err) == (2, True)
    assert command(*arguments(tmp_path / "lab", design, "--resume", "--language", "de")).code == 0
    changed = [e for e in rows(tmp_path / "lab", EVENTS) if e["kind"] == "changed"]
    assert len(changed) == 1
    assert "page consent" in json.loads(changed[0]["detail"])


def test_a_session_that_is_interrupted_says_that_it_can_be_resumed(tmp_path: Path) -> None:
    design = written(ADAPTIVE, tmp_path)
    path = tmp_path / "lab/sub-01/ses-01" / TRIALS
    process = subprocess.Popen(
        [*PROGRAM, *arguments(tmp_path / "lab", design)], cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    end = time.monotonic() + 200
    while not (path.exists() and path.read_bytes().count(b"\n") > 5) and time.monotonic() < end:
        time.sleep(0.002)
    process.send_signal(signal.SIGINT)
    err = process.communicate(timeout=200)[1]
    assert process.returncode == 130
    assert err.count("\n") == 1
    assert "all of them are safe, go on with --resume" in err
    assert rows(tmp_path / "lab", EVENTS)[-1]["kind"] == "stopped"

"""Designs take as long as their files and the guides say."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import evenlight
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.experiments.design_files import DESIGNS, design_names, load_task_design
from evenlight.experiments.experiment_kinds import EXPERIMENTS
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.stimulus_folder import as_searched, load_stimuli
from evenlight.method.preset_files import load_display
from evenlight.stimuli.scenes.content.catalogue import path_named

DOCS = Path(evenlight.__file__).parents[1] / "docs"
RAMPS = design_names()
VIEWING = [("rating", "paper"), ("comparison", "paper"), ("search", "paper")]
FRAMES_PER_SECOND = 5.0  # of the tracks made up here


def stated_in_file(task: str, name: str) -> float:
    """Return the minutes in the words before the first key of a design."""
    suffix = "" if task == "ramp" else f".{task}"
    text = (DESIGNS / f"{name}{suffix}.design.toml").read_text()
    return float(re.search(r"[Aa]bout (\d+) minutes", text)[1])


def minutes_of(task: str, name: str, stimuli: Path | None = None) -> float:
    """Return how long a session takes, by the sum that participants are told."""
    design = load_task_design(task, name)
    display = load_display("varjo-xr3")
    rig = Rig("bench", "bench.toml", viewing_distance=0.6, refresh_rate=60.0)
    loaded = load_stimuli(stimuli, design.sequences, display, with_video=False) if stimuli else ()
    manifest = SessionManifest(
        "01", "01", task, True, SessionStatus.RUNNING, 0, display, design, Provenance(seed=1), rig=rig,
        stimuli=tuple(each.stimulus for each in loaded),
    )  # fmt: skip
    shown = as_searched(loaded) if task == "search" else loaded
    return float(EXPERIMENTS[task].task(SessionSetting(manifest, rig, shown)).minutes)


def as_stated(minutes: float, stated: float) -> bool:
    """Within a twentieth, or half a minute of what is said in whole ones."""
    return abs(minutes - stated) <= max(0.5, 0.05 * stated)


@pytest.mark.parametrize("name", RAMPS)
def test_a_calibration_takes_what_its_file_says(name: str) -> None:
    assert as_stated(minutes_of("ramp", name), stated_in_file("ramp", name))


def test_the_guide_says_what_the_files_say() -> None:
    rows = re.findall(r"^\| `(\w+)`[^|]*\|[^|]*\|[^|]*\| (\d+) \|", (DOCS / "sessions.md").read_text(), re.M)
    assert {name: float(minutes) for name, minutes in rows} == {
        name: stated_in_file("ramp", name) for name in RAMPS
    }


def test_quick_is_five_minutes_by_hand() -> None:
    """Twelve trials and two of practice of 2 (0.3 + 1 + 0.2) + 3 x 0.2 + 1.5 + 0.2 = 5.3 s, a break of a
    minute, and three minutes before: 74.2 + 60 + 180 s.
    """
    assert minutes_of("ramp", "quick") == pytest.approx(314.2 / 60)


@pytest.mark.parametrize(("task", "name"), VIEWING)
def test_a_viewing_session_takes_what_its_file_and_the_guide_say(
    task: str, name: str, tmp_path: Path, make_stimulus: Callable[..., None]
) -> None:
    for sequence in load_task_design(task, name).sequences:
        n = round(path_named(sequence).duration * FRAMES_PER_SECOND)
        make_stimulus(tmp_path / sequence, np.full(n, 0.5), frames_per_second=FRAMES_PER_SECOND)
    stated = stated_in_file(task, name)
    assert as_stated(minutes_of(task, name, tmp_path), stated)
    assert f"bout {stated:g} minutes" in (DOCS / "viewing-experiments.md").read_text()

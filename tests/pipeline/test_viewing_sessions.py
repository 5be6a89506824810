"""Sessions of rating, comparison and search, whole, through the real window on a virtual screen."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES, MANIFEST
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.search import SearchDesign
from evenlight.data_schema.recordings.viewing import ComparisonDesign, RatingDesign
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.scenes.content.catalogue import path_named

NAMES = ("bright", "dark")
SIZE = (160, 96)
FRAMES_PER_SECOND = 10.0
KEYPOINTS = ("library/schoolyard", "library/reading hall")
SEED = 4  # with which the simulated participant finds one of the rings
DESIGNS: dict[str, Any] = {
    "rating": RatingDesign(NAMES, adaptation_duration=0.1, practice_trials=1, practice_duration=0.5),
    "comparison": ComparisonDesign(
        NAMES, repetitions=2, adaptation_duration=0.1, practice_trials=1, practice_duration=0.5
    ),
    # 60 arcmin are 3 pixels on the coarse display of the test; of rings so black some are found in time.
    "search": SearchDesign(
        ("library",), KEYPOINTS, ring_gap=60.0, ring_contrast=-0.9, time_limit=1.5, adaptation_duration=0.1,
        practice_trials=1, trials_between_breaks=3,
    ),
}  # fmt: skip
SCREENS = {
    "rating": {"clip", "question-how-good-and-how-clear-were"},
    "comparison": {"clip", "question-in-which-of-the-two-did"},
    "search": {"search-school", "question-where-is-the-gap-of-the"},
}
# What an interruption may change; a search that was interrupted is left out.
CHANGES = {"onset_s", "attempt", "flag"}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small window, and a display as coarse as it takes for rings to be seen on it."""
    folder = tmp_path_factory.mktemp("rig")
    display = dataclasses.replace(load_display("varjo-xr3"), name="coarse", pixels_per_degree=3.0)
    write_toml_record(folder / "coarse.display.toml", display)
    plain: Rig = load_rig("simulated")[0]
    # Pages need room for their text; the videos are smaller than the window.
    small = dataclasses.replace(
        plain, display="coarse.display.toml", window_size=(480, 300), full_screen=False, refresh_rate=20.0
    )
    write_toml_record(folder / "small.rig.toml", small)
    return folder / "small.rig.toml"


@pytest.fixture(scope="module")
def stimuli(
    tmp_path_factory: pytest.TempPathFactory,
    make_stimulus: Callable[..., None],
    make_video: Callable[..., None],
) -> Path:
    """Two short videos with their tracks, and a track as long as a camera path."""
    folder = tmp_path_factory.mktemp("stimuli")
    frames = np.arange(10)
    for name, level in zip(NAMES, (0.8, 0.3), strict=True):
        make_stimulus(folder / name, 0.5 + 0.2 * np.sin(frames / 3), frames_per_second=FRAMES_PER_SECOND)
        make_video(folder / name / "video.mkv", level * (1 + frames / 40), SIZE, FRAMES_PER_SECOND)
    walk = np.linspace(0.3, 0.7, round(path_named("library").duration * FRAMES_PER_SECOND))
    make_stimulus(folder / "library", walk, frames_per_second=FRAMES_PER_SECOND)
    return folder


@pytest.mark.parametrize("task", list(DESIGNS))
def test_a_session_runs_whole_and_killed_and_resumed_gives_the_same_trials(
    tmp_path: Path,
    task: str,
    rig: Path,
    stimuli: Path,
    laboratory: Callable[..., Any],
    virtual_screen: Callable[..., str],
    command: Callable[..., Any],
) -> None:
    options = ("--rig", rig, "--stimuli", stimuli, "--seed", SEED)
    lab = laboratory(tmp_path, task, DESIGNS[task], virtual_screen(), *options)
    shots = tmp_path / "screens"
    assert "complete" in lab.run("whole", "--screenshots", shots)
    lab.kill_in_the_midst("broken")
    # A search that was killed is left out of the analysis, and the experimenter is told.
    in_a_trial = lab.count("broken") > len(lab.rows("broken"))
    lab.run("broken", "--resume", told="1 flagged" if task == "search" and in_a_trial else "")
    whole, broken = lab.rows("whole"), lab.rows("broken")
    assert without_changes(broken) == without_changes(whole)
    again = {row["flag"] for row in broken if row["attempt"] > 1}
    assert again <= ({"seen_before"} if task == "search" else {""})
    for dataset in ("whole", "broken"):
        assert command("validate", tmp_path / dataset).code == 0
    manifest = json.loads((tmp_path / "whole/sub-01/ses-01" / MANIFEST).read_text())
    assert (manifest["task"], manifest["simulated"]) == (task, True)
    assert manifest["n_trials"] == sum(not row["practice"] for row in whole)
    assert SCREENS[task] <= {path.stem for path in shots.glob("*.png")}
    CHECKS[task](whole, lab.rows("whole", FRAMES), tmp_path, shots)
    interrupted = {e["trial_index"] for e in lab.rows("broken", EVENTS) if e["kind"] == "trial_interrupted"}
    assert interrupted == {row["trial_index"] for row in broken if row["attempt"] > 1}


def without_changes(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in row.items() if key not in CHANGES} for row in rows]


def check_rating(rows: list[dict[str, Any]], logs: list[dict[str, Any]], folder: Path, shots: Path) -> None:
    """Both versions of both sequences, each frame of the video shown once it was due, at its factor."""
    main = [row for row in rows if not row["practice"]]
    assert sorted((r["sequence"], r["version"]) for r in main) == sorted(
        (name, version) for name in NAMES for version in ("ours", "baseline")
    )
    assert all(1 <= row["rating"] <= 5 for row in rows)
    check_clips([log for log, row in zip(logs, rows, strict=True) if not row["practice"]])


def check_comparison(
    rows: list[dict[str, Any]], logs: list[dict[str, Any]], folder: Path, shots: Path
) -> None:
    """Each sequence twice, ours first and second; one of the two intervals had a constant factor."""
    main = [row for row in rows if not row["practice"]]
    for name in NAMES:
        assert sorted(row["ours_interval"] for row in main if row["sequence"] == name) == [1, 2]
    for row in main:
        pair = [log for log in logs if log["trial_index"] == row["trial_index"]]
        constant = [len(set(log["factors"])) == 1 for log in pair]
        assert constant == [row["ours_interval"] == 2, row["ours_interval"] == 1]
        check_clips(pair)


def check_clips(logs: list[dict[str, Any]]) -> None:
    for log in logs:
        assert sorted(set(log["video_frames"])) == list(range(10))
        for time, frame in zip(log["flip_times_s"], log["video_frames"], strict=True):
            assert frame == int(time * FRAMES_PER_SECOND + 1e-6)
        # What was read back is what frame and factor make; the noise of 160 x 96 pixels averages out.
        assert log["probe_luminance_cd_m2"] == pytest.approx(log["probe_intended_cd_m2"], abs=0.05)
        assert len(log["probe_refreshes"]) >= 5


def check_search(rows: list[dict[str, Any]], logs: list[dict[str, Any]], folder: Path, shots: Path) -> None:
    """Each keypoint once in each version; what was not found has the time limit as its time."""
    main = [row for row in rows if not row["practice"]]
    shown = [(row["keypoint"], row["version"]) for row in main]
    assert len(set(shown)) == len(shown) == 2 * len({row["keypoint"] for row in main})
    for row in rows:
        assert row["found"] == (row["reported_orientation_deg"] is not None)
        assert row["search_time_s"] <= 1.5
        assert row["gap_pixels"] == pytest.approx(3.0 * (2 if row["practice"] else 1))
        assert row["background_luminance_cd_m2"] > 0
        dimmed, black = row["factor"] * row["background_luminance_cd_m2"], 0.2
        ring = max((1 + row["ring_contrast"]) * dimmed, black)
        assert row["shown_contrast"] == pytest.approx(ring / max(dimmed, black) - 1)
    assert {log["trial_index"] for log in logs} == {row["trial_index"] for row in rows}
    scene = np.asarray(Image.open(shots / "search-school.png").convert("L"))
    assert scene.std() > 5  # a scene, not a plain field


CHECKS = {"rating": check_rating, "comparison": check_comparison, "search": check_search}

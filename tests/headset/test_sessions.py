"""Sessions with simulated participants in a simulated headset, through a real runtime and its compositor."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from laboratories import Laboratory

from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES, HEADSET
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.search import SearchDesign
from evenlight.data_schema.recordings.viewing import RatingDesign
from evenlight.stimuli.scenes.content.catalogue import path_named

NAMES = ("bright", "dark")
FRAMES_PER_SECOND = 10.0
DESIGNS: dict[str, Any] = {
    "ramp": RampDesign(
        screens=("white",), factors=(0.4, 0.9), relative_rates=(0.1, 0.4), repetitions=1, catch_share=0.2,
        adaptation_duration=0.05, ramp_durations=(0.25,), hold_duration=0.05, pause_duration=0.05,
        practice_trials=1, trials_between_breaks=3,
    ),  # 4 ramps, 1 without a change
    "rating": RatingDesign(NAMES, adaptation_duration=0.1, practice_trials=1, practice_duration=0.5),
    # The simulated headset has 3 pixels per degree: 60 arcmin are 3 pixels.
    "search": SearchDesign(
        ("library",), ("library/schoolyard",), ring_gap=60.0, ring_contrast=-0.9, time_limit=0.5,
        adaptation_duration=0.1, practice_trials=1, trials_between_breaks=3,
    ),
}  # fmt: skip
KILLED = "ramp"
# On a slow machine too it tells no progress.
QUIETLY = (
    "import math, sys; from evenlight import command, progress; progress.INTERVAL = math.inf; "
    "command.main(sys.argv[1:])"
)
REFRESH_RATE = (
    20.0  # [Hz] of Monado's compositor without a window; while drawing is slow its periods are longer
)
CHANGES = {"onset_s", "attempt"}  # what an interruption may change
RIG = """name = "headset"
display = "varjo-xr3"
viewing_distance_m = 1.0
refresh_rate_hz = 60.0
screen = "openxr"
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "headset.rig.toml"
    path.write_text(RIG)
    return path


@pytest.fixture(scope="module")
def stimuli(
    tmp_path_factory: pytest.TempPathFactory,
    make_stimulus: Callable[..., None],
    make_video: Callable[..., None],
) -> Path:
    """Two short videos with their tracks, and a track for the camera path of the search."""
    folder = tmp_path_factory.mktemp("stimuli")
    frames = np.arange(10)
    for name, level in zip(NAMES, (0.8, 0.3), strict=True):
        make_stimulus(folder / name, 0.5 + 0.2 * np.sin(frames / 3), frames_per_second=FRAMES_PER_SECOND)
        make_video(folder / name / "video.mkv", level * (1 + frames / 40), (160, 96), FRAMES_PER_SECOND)
    walk = np.linspace(0.3, 0.7, round(path_named("library").duration * FRAMES_PER_SECOND))
    make_stimulus(folder / "library", walk, frames_per_second=FRAMES_PER_SECOND)
    return folder


class HeadsetLaboratory(Laboratory):
    """One whose processes are no forks of one that has imported PsychoPy: EGL crashes in some of those."""

    def _process(self, words: list[str], environment: dict[str, str]) -> Any:
        return subprocess.Popen(
            [sys.executable, "-c", QUIETLY, *words],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )


@pytest.fixture
def conducted(tmp_path: Path, rig: Path, stimuli: Path) -> Callable[[str], Laboratory]:
    """A laboratory for one of the designs, in the headset."""

    def laboratory(task: str) -> Laboratory:
        more = ("--stimuli", stimuli) if task != "ramp" else ()
        return HeadsetLaboratory(
            tmp_path, task, DESIGNS[task], os.environ["DISPLAY"], "--rig", rig, "--seed", 4, *more
        )

    return laboratory


class Service:
    """A runtime beside that of the tree, which a test may end."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        for left in self._folder.glob("monado*"):
            left.unlink()
        self._process = subprocess.Popen(
            ["monado-service"],
            env=os.environ | {"XDG_RUNTIME_DIR": str(self._folder)},
            stdin=subprocess.PIPE,  # it ends where its input does
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        end = time.monotonic() + 30
        while not (self._folder / "monado_comp_ipc").exists() and time.monotonic() < end:
            time.sleep(0.02)

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    """Start a runtime of the test's own, to which all that is started connects."""
    folder = Path(tempfile.mkdtemp(prefix="runtime-"))  # of mode 0700, and short enough for a socket
    own = Service(folder)
    own.start()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    yield own
    own.kill()
    shutil.rmtree(folder)


def without_changes(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in row.items() if key not in CHANGES} for row in rows]


@pytest.mark.timeout(900)  # a school's light is baked where none is stored
@pytest.mark.parametrize("task", list(DESIGNS))
def test_a_session_runs_whole_or_killed_and_resumed_and_its_frames_are_logged(
    tmp_path: Path, task: str, conducted: Callable[[str], Laboratory], command: Callable[..., Any]
) -> None:
    lab = conducted(task)
    assert "complete" in lab.run("whole")
    rows = lab.rows("whole")
    manifest = json.loads((tmp_path / "whole/sub-01/ses-01/manifest.json").read_text())
    assert (manifest["task"], manifest["simulated"], manifest["status"]) == (task, True, "complete")
    assert manifest["n_trials"] == sum(not row["practice"] for row in rows) > 0
    assert command("validate", tmp_path / "whole").code == 0
    check_log(lab.rows("whole", HEADSET), lab.rows("whole", FRAMES))
    for log in lab.rows("whole", FRAMES) if task == "ramp" else []:
        read, intended = log["probe_luminance_cd_m2"], np.array(log["intended_luminance_cd_m2"])
        np.testing.assert_allclose(read, intended[log["probe_frames"]], atol=0.3)
        assert len(read) > 3
    if task == KILLED:
        lab.kill_in_the_midst("broken")
        lab.run("broken", "--resume")
        assert without_changes(lab.rows("broken")) == without_changes(rows)
        assert command("validate", tmp_path / "broken").code == 0


def check_log(logs: list[dict[str, Any]], frames: list[dict[str, Any]]) -> None:
    """A line for each interval, a frame for each flip; late frames as the display times have them."""
    keys = ("trial_index", "attempt", "interval")
    assert [[log[key] for key in keys] for log in logs] == [[log[key] for key in keys] for log in frames]
    for log, shown in zip(logs, frames, strict=True):
        times = np.array(log["display_times_s"])
        assert len(times) == len(shown["flip_times_s"]) > 0
        steps = np.diff(times) * REFRESH_RATE
        assert (steps > -0.5).all()  # a frame that is handed over late appears when the next would
        np.testing.assert_array_equal(log["late_frames"][1:], np.maximum(np.round(steps) - 1, 0))
        turned = np.column_stack([log[f"orientation_{axis}"] for axis in ("x", "y", "z", "real")])
        np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-4)
        assert all(log["focused"])
        assert all(log["tracked"])
    # The runtime's simulated head moves.
    assert len({tuple(log[f"head_{axis}_m"]) for log in logs for axis in ("right", "up", "back")}) > 3


def test_a_runtime_that_goes_away_ends_a_session_in_one_line_and_it_is_resumed(
    tmp_path: Path, service: Service, conducted: Callable[[str], Laboratory], command: Callable[..., Any]
) -> None:
    lab = conducted(KILLED)
    process = lab.start("lost")
    end = time.monotonic() + 100
    while lab.count("lost") < 3 and process.poll() is None and time.monotonic() < end:
        time.sleep(0.005)
    service.kill()
    _, err = process.communicate(timeout=60)
    assert (process.returncode, own_lines(err)) == (1, 1), err
    recorded = lab.rows("lost")
    assert len(recorded) >= 2
    service.start()
    lab.run("lost", "--resume")
    assert lab.rows("lost")[: len(recorded)] == recorded
    assert any(event["kind"] == "resumed" for event in lab.rows("lost", EVENTS))
    assert command("validate", tmp_path / "lost").code == 0


def own_lines(said: str) -> int:
    """How many lines on standard error are not the runtime's own, which its client library writes."""
    return sum(line.startswith("evenlight") or "Error" in line for line in said.splitlines())


def test_without_a_runtime_one_line_says_what_is_missing(
    tmp_path: Path, conducted: Callable[[str], Laboratory], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XR_RUNTIME_JSON", "/nonexistent/runtime.json")
    process = conducted("ramp").start("none")
    _, err = process.communicate(timeout=60)
    assert process.returncode in (1, 2)
    assert "runtime" in err.splitlines()[-1]
    assert own_lines(err) == 1, err
    assert not (tmp_path / "none").exists()


def test_what_the_runtime_says_of_its_headset_is_printed() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "evenlight", "measure", "headset", "--frames", "20"],
        capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    for words in ("Monado", "Simulated HMD", "320", "240", "42.5"):
        assert words in ended.stdout

"""`evenlight simulate rating|comparison|search`: the data sets that they write."""

import csv
import itertools
import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import SearchDesign
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.data_schema.recordings.viewing import ComparisonDesign, RatingDesign, Version
from evenlight.data_schema.storage.text_files import read_json_record, write_toml_record
from evenlight.experiments.sessions.search_stage import RingPicture
from evenlight.experiments.simulate_command import simulate
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing import ring_views, search_task
from evenlight.experiments.viewing.ring_views import ring_alone
from evenlight.experiments.viewing.search_schedule import SearchPoint
from evenlight.method.preset_files import load_display
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.ring_scene import KeypointRings
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.scene import Vector

XR3 = load_display("varjo-xr3")
NAMES = ("dark", "bright")
DESIGNS = {
    "rating": RatingDesign(sequences=NAMES, repetitions=2),
    "comparison": ComparisonDesign(sequences=NAMES, repetitions=2),
    "search": SearchDesign(sequences=NAMES),
}


@pytest.fixture(scope="module")
def stimuli(tmp_path_factory: pytest.TempPathFactory, make_stimulus: Callable[..., None]) -> Path:
    folder = tmp_path_factory.mktemp("stimuli")
    swing = 0.5 + 0.2 * np.sin(np.arange(100) / 8.0)
    make_stimulus(folder / "dark", swing, at_half=0.2)
    make_stimulus(folder / "bright", np.full(100, 0.5), at_half=0.02)
    return folder


@pytest.fixture(scope="module")
def design_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("designs")
    for task, design in DESIGNS.items():
        write_toml_record(folder / f"{task}.toml", design)
    return {task: str(folder / f"{task}.toml") for task in DESIGNS}


class UniformScenes:
    """Paints rings on uniform ground, brighter in one scene than in the other."""

    def __init__(self, display: Display) -> None:
        self.display = display

    def picture(self, scene: str, position: Vector, ring: Ring) -> RingPicture:
        ground = 30.0 if scene == "school" else 1.0
        return RingPicture(ring_alone(ring, ground, 64, self.display), ground)


@contextmanager
def uniform_painter(display: Display, side: int) -> Iterator[UniformScenes]:
    yield UniformScenes(display)


def points_by_hand(
    design: SearchDesign, stimuli: Sequence[LoadedStimulus], display: Display, actuator: Actuator
) -> tuple[SearchPoint, ...]:
    baseline = {stimulus.name: stimulus.stimulus.baseline_factor for stimulus in stimuli}
    return tuple(
        SearchPoint(
            sequence, keypoint, scene, Camera((float(k), 0.0, 1.65), 10.0),
            KeypointRings(keypoint, (-20.0, 15.0), (0.0, 5.0), (9.0, 9.0), -5.0, 12.0, 9.5),
            {Version.OURS: 0.8, Version.BASELINE: baseline[sequence]},
        )
        for sequence, scene in (("dark", "house"), ("bright", "school"))
        for k, keypoint in enumerate(("here", "there"))
    )  # fmt: skip


@pytest.fixture
def search_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring_views, "OffscreenPainter", uniform_painter)
    monkeypatch.setattr(search_task, "search_points", points_by_hand)
    monkeypatch.setattr(ring_views, "search_points", points_by_hand)


def run(task: str, out: Path, stimuli: Path, design_files: dict[str, str], n: int = 4, seed: int = 7) -> Path:
    simulate(task, out=out, participants=n, seed=seed, design=design_files[task], stimuli=stimuli, quiet=True)
    return out


def trials(dataset: Path, participant: str) -> list[dict[str, object]]:
    path = dataset / f"sub-{participant}/ses-01/trials.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()]


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.usefixtures("search_by_hand")
@pytest.mark.parametrize("task", DESIGNS)
def test_a_data_set_validates_and_says_everywhere_that_it_is_simulated(
    task: str, tmp_path: Path, stimuli: Path, design_files: dict[str, str]
) -> None:
    dataset = run(task, tmp_path / "out", stimuli, design_files)
    assert not [problem for checked in validate(dataset) for problem in checked.problems]
    manifest = read_json_record(SessionManifest, dataset / "sub-03/ses-01/manifest.json")
    rows = trials(dataset, "03")
    assert manifest.simulated
    assert manifest.task == task
    assert manifest.n_trials == len(rows) == {"rating": 8, "comparison": 4, "search": 8}[task]
    assert [stimulus.name for stimulus in manifest.stimuli] == list(NAMES)
    assert all(row["simulated"] for row in rows)
    assert not any(row["practice"] for row in rows)
    assert "simulated" in json.loads((dataset / "dataset_description.json").read_text())["Name"]
    truth = json.loads((dataset / "simulated_truth.json").read_text())
    assert truth["simulated"] is True
    assert [each["participant_id"] for each in truth["participants"]] == ["01", "02", "03", "04"]
    table = dataset / f"sub-03/ses-01/beh/sub-03_ses-01_task-{task}_beh.tsv"
    assert len(list(csv.DictReader(table.read_text().splitlines(), delimiter="\t"))) == len(rows)


@pytest.mark.usefixtures("search_by_hand")
@pytest.mark.parametrize("task", DESIGNS)
def test_the_seed_alone_decides_and_a_participant_is_the_same_however_many_there_are(
    task: str, tmp_path: Path, stimuli: Path, design_files: dict[str, str]
) -> None:
    once, again, other, alone = (
        run(task, tmp_path / name, stimuli, design_files, n, seed)
        for name, n, seed in (("a", 4, 7), ("b", 4, 7), ("c", 4, 8), ("d", 1, 7))
    )
    assert files(once) == files(again)
    assert [trials(once, f"0{k}") for k in range(1, 5)] != [trials(other, f"0{k}") for k in range(1, 5)]
    assert trials(alone, "01") == trials(once, "01")


def test_of_simulated_raters_the_version_that_loses_less_is_rated_higher(
    tmp_path: Path, stimuli: Path, design_files: dict[str, str]
) -> None:
    dataset = run("rating", tmp_path / "out", stimuli, design_files, n=40)
    ratings = defaultdict(list)
    for k in range(1, 41):
        for row in trials(dataset, f"{k:02d}"):
            ratings[row["sequence"]].append(row["rating"])
    # A loss of about 0.2 against one of 0.02.
    assert np.mean(ratings["bright"]) > np.mean(ratings["dark"]) + 1
    truth = json.loads((dataset / "simulated_truth.json").read_text())
    lost = {(row["sequence"], row["version"]): row["pooled_contrast_loss"] for row in truth["stimuli"]}
    # Linear in the factor: at 0.5 exactly the loss told; that of the swinging track is a Minkowski mean.
    assert lost["dark", "baseline"] == pytest.approx(0.2, rel=0.05)
    assert lost["dark", "ours"] > lost["dark", "baseline"]
    assert lost["bright", "ours"] == lost["bright", "baseline"] == pytest.approx(0.02)


def test_of_simulated_comparisons_a_track_that_does_not_move_is_chosen_by_chance(
    tmp_path: Path, stimuli: Path, design_files: dict[str, str]
) -> None:
    dataset = run("comparison", tmp_path / "out", stimuli, design_files, n=60)
    chosen = defaultdict(list)
    for k in range(1, 61):
        for row in trials(dataset, f"{k:02d}"):
            ours = row["response"] == ("first" if row["ours_interval"] == 1 else "second")
            chosen[row["sequence"]].append(ours)
    # 120 choices each; four standard errors are 0.18. The other swings by 40 % in 5 s.
    assert np.mean(chosen["bright"]) == pytest.approx(0.5, abs=0.18)
    assert np.mean(chosen["dark"]) > 0.8


@pytest.mark.usefixtures("search_by_hand")
def test_of_simulated_searches_rings_in_the_light_are_found_sooner_and_censored_ones_end_at_the_limit(
    tmp_path: Path, stimuli: Path, design_files: dict[str, str]
) -> None:
    dataset = run("search", tmp_path / "out", stimuli, design_files, n=40)
    rows = list(itertools.chain.from_iterable(trials(dataset, f"{k:02d}") for k in range(1, 41)))
    times = defaultdict(list)
    for row in rows:
        times[row["sequence"]].append(row["search_time_s"])
        assert row["found"] == (row["reported_orientation_deg"] is not None)
        assert row["search_time_s"] <= row["time_limit_s"] == 30.0
        assert row["background_luminance_cd_m2"] == (30.0 if row["sequence"] == "bright" else 1.0)
        # Even b = 0.5 of 0.85 cd/m^2 is brighter than the headset's black, 0.2: nothing is lost.
        assert row["shown_contrast"] == row["ring_contrast"]
    assert np.median(times["bright"]) < np.median(times["dark"])
    assert not all(row["found"] for row in rows)
    truth = json.loads((dataset / "simulated_truth.json").read_text())
    assert len(truth["stimuli"]) == 4 * 2 * 2  # keypoints, places of the ring, versions


def test_a_search_without_opengl_is_refused_in_one_line_and_leaves_nothing(
    tmp_path: Path, stimuli: Path, design_files: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(**_: object) -> None:
        raise RuntimeError("no display and no EGL here")

    monkeypatch.setattr("moderngl.create_context", refused)
    monkeypatch.setattr(search_task, "search_points", points_by_hand)
    monkeypatch.setattr(ring_views, "search_points", points_by_hand)
    with pytest.raises(InputError, match=r"need OpenGL 3\.3") as caught:
        run("search", tmp_path / "out", stimuli, design_files)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("task", "changed", "words"),
    [
        ("rating", {"stimuli": None}, "--stimuli goes with rating, comparison.*got the task rating without"),
        ("ramp", {}, "got the task ramp with it"),
        ("rating", {"stimuli": Path("nowhere")}, "nowhere: no such folder of stimuli; make one with"),
        ("jump", {}, "task 'jump' cannot be simulated; there is 'ramp', 'rating', 'comparison', 'search'"),
        ("rating", {"design": "papper"}, "papper: no such design; did you mean 'paper'"),
        ("search", {"display": "nowhere"}, "nowhere: no such"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_one_line(
    task: str, changed: dict[str, object], words: str, tmp_path: Path, stimuli: Path
) -> None:
    given = {"stimuli": stimuli, "out": tmp_path / "out", "participants": 2, "quiet": True, **changed}
    with pytest.raises(InputError, match=words) as caught:
        simulate(task, **given)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()

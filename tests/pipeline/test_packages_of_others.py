"""Tasks and designs of a package that is installed: the example's, and packages that are broken."""

import dataclasses
import importlib
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import evenlight
from evenlight.analysis.dataset_findings import ANALYSES
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS, TASKS
from evenlight.experiments.experiment_kinds import EXPERIMENTS

EXAMPLE = Path(evenlight.__file__).parents[1] / "examples" / "evenlight-flicker"
SESSION = ("--participant", "01", "--session", "01", "--rig", "simulated", "--simulate", "data")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example package, installed as pip installs it: from a copy, with nothing from any index."""
    copy, site = tmp_path_factory.mktemp("source") / "flicker", tmp_path_factory.mktemp("site")
    shutil.copytree(EXAMPLE, copy)
    words = ["--no-index", "--no-build-isolation", "--no-deps", "--quiet", "--target", str(site), str(copy)]
    done = subprocess.run(
        [sys.executable, "-m", "pip", "install", *words],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return site


@pytest.fixture(autouse=True)
def forgotten_afterwards() -> Iterator[None]:
    yield
    for registry in (TASKS, EXPERIMENTS, ANALYSES):
        for name in set(registry) - set(BUILT_IN_TASKS):
            registry.pop(name)


@pytest.fixture
def installed(site: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(site)
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "evenlight_flicker"]:
        del sys.modules[name]


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.mark.usefixtures("installed")
def test_a_task_of_its_own_is_run_validated_exported_and_simulated(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    lab = tmp_path / "lab"
    outcome = command("run", "flicker", *SESSION, "--design", "pilot", "--out", lab)
    assert (outcome.code, outcome.err) == (0, "")
    assert "complete: 8 of 8 trials" in outcome.out  # 3 depths and none, twice
    session = lab / "sub-01/ses-01"
    trials, frames = lines(session / "trials.jsonl"), lines(session / "frames.jsonl")
    depths = sorted(trial["depth"] for trial in trials if not trial["practice"])
    assert depths == [0.0, 0.0, 0.01, 0.01, 0.04, 0.04, 0.16, 0.16]
    for trial, log in zip(trials, frames, strict=True):
        # 0.5 s at 60 Hz; 12 frames a period of 5 Hz: the sine is 1 in the 4th frame, and -1 in the 10th
        assert len(log["factors"]) == 30
        assert log["factors"][3] == pytest.approx(0.5 * (1 + trial["depth"]))
        assert log["factors"][9] == pytest.approx(0.5 * (1 - trial["depth"]))
    assert command("validate", lab).code == 0
    assert command("export", lab, "--out", tmp_path / "shared").code == 0
    assert list((tmp_path / "shared").glob("data/*task-flicker_data.csv"))
    pilot = tmp_path / "pilot"
    assert command("simulate", "flicker", "--participants", 2, "--out", pilot, "--quiet").code == 0
    assert command("validate", pilot).code == 0
    analysed = command("analyze", pilot, "--out", tmp_path / "results")
    assert analysed.code == 2
    assert "there is no analysis of the task 'flicker' here" in analysed.err


@pytest.mark.usefixtures("installed")
def test_its_designs_are_presets_of_their_tasks(command: Callable[..., Any], tmp_path: Path) -> None:
    outcome = command("run", "ramp", *SESSION, "--design", "slow_ramps", "--out", tmp_path / "lab")
    assert (outcome.code, outcome.err) == (0, "")
    manifest = json.loads((tmp_path / "lab/sub-01/ses-01/manifest.json").read_text())
    assert manifest["design"]["ramp_durations_s"] == [10.0]
    for task, name, presets in (
        ("ramp", "slow_ramp", "did you mean 'slow_ramps'? give a preset (durations_and_directions, paper,"),
        ("flicker", "paper", "give a preset (pilot) or a toml file"),
    ):
        refused = command("run", task, *SESSION, "--design", name, "--out", tmp_path / "none")
        assert (refused.code, refused.err.count("\n")) == (2, 1)
        assert presets in refused.err
    assert not (tmp_path / "none").exists()


@pytest.mark.usefixtures("installed")
def test_a_task_without_an_observer_or_without_rows_is_not_simulated(
    command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    example = importlib.import_module("evenlight_flicker.task")
    bare = {name: getattr(example.FLICKER, name) for name in ("title", "design", "trial", "task", "pages")}
    evenlight.register_task(evenlight.TaskDeclaration(name="unwatched", **bare))
    refused = command("run", "unwatched", *SESSION, "--out", tmp_path / "none")
    assert (refused.code, "declares no simulated observer" in refused.err) == (2, True)
    refused = command("simulate", "unwatched", "--out", tmp_path / "none")
    assert (refused.code, "declares no simulated observer" in refused.err) == (2, True)
    monkeypatch.delattr(example.FlickerTask, "row")
    refused = command("simulate", "flicker", "--out", tmp_path / "none")
    assert (refused.code, "has no method row" in refused.err) == (2, True)
    assert not (tmp_path / "none").exists()


TASK, DESIGNS = "[evenlight.tasks]\nrings = ", "[evenlight.designs]\nrings = "
BROKEN = {  # entry points, modules, what is said
    "no module": (f"{TASK}gone.task:RINGS\n", {}, "No module named 'gone'"),
    "an error": (f"{TASK}broken_rings\n", {"broken_rings.py": "1 / 0"}, "ZeroDivisionError"),
    "no task": (f"{TASK}empty_rings\n", {"empty_rings.py": ""}, "is no TaskDeclaration of that name"),
    "no designs": (f"{DESIGNS}plain_rings\n", {"plain_rings/__init__.py": ""}, "holds no file *.design.toml"),
    "no package": (f"{DESIGNS}gone.designs\n", {}, "No module named 'gone'"),
    "a preset of ours": (
        f"{DESIGNS}paper_rings\n",
        {"paper_rings/__init__.py": "", "paper_rings/quick.design.toml": ""},
        "has the name of",
    ),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_package_that_is_broken_is_named_in_one_line_and_stops_nothing_else(
    what: str, command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    entry_points, modules, said = BROKEN[what]
    site = tmp_path / "site"
    for name, text in {
        "lab_rings-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: lab-rings\nVersion: 1.0\n",
        "lab_rings-1.0.dist-info/entry_points.txt": entry_points,
        **modules,
    }.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_text(text)
    monkeypatch.syspath_prepend(site)
    done = command("run", "ramp", *SESSION, "--design", "quick", "--out", tmp_path / "lab")
    assert (done.code, done.err.count("\n")) == (0, 1)
    assert done.err.startswith("evenlight: note: the installed package lab-rings")
    assert "rings" in done.err
    assert said in done.err
    refused = command("run", "rings", *SESSION, "--out", tmp_path / "none")
    assert (refused.code, "task 'rings' cannot be run; there is" in refused.err) == (2, True)


def test_designs_may_lie_in_a_folder_without_a_module(
    command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "site/lab_rings-1.0.dist-info").mkdir(parents=True)
    (tmp_path / "site/lab_rings-1.0.dist-info/entry_points.txt").write_text(f"{DESIGNS}bare_rings\n")
    # Some other packages, Dask's among them, read this where Python itself does without.
    metadata = "Metadata-Version: 2.1\nName: lab-rings\nVersion: 1.0\n"
    (tmp_path / "site/lab_rings-1.0.dist-info/METADATA").write_text(metadata)
    (tmp_path / "site/bare_rings").mkdir()
    (tmp_path / "site/bare_rings/short.design.toml").write_text("repetitions = 2\n")
    monkeypatch.syspath_prepend(tmp_path / "site")
    done = command("run", "ramp", *SESSION, "--design", "short", "--out", tmp_path / "lab")
    assert (done.code, done.err) == (0, "")


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("part", "lacking", "said"),
    [
        ("trial", "onset", "the trial of the task 'bare' lacks onset"),
        ("frames", "interval", "lacks interval"),
    ],
)
def test_a_record_that_a_session_could_not_use_is_refused_when_it_is_declared(
    part: str, lacking: str, said: str
) -> None:
    flicker = importlib.import_module("evenlight_flicker.task").FLICKER
    fields = [field.name for field in dataclasses.fields(getattr(flicker, part)) if field.name != lacking]
    bare = dataclasses.make_dataclass("Bare", fields)
    with pytest.raises(evenlight.InputError, match=said):
        dataclasses.replace(flicker, name="bare", **{part: bare})


def test_the_earlier_name_of_the_declaration_still_serves() -> None:
    assert evenlight.ViewingTaskDeclaration is evenlight.TaskDeclaration

"""An export is read like the data set it came from: the same statistics, byte by byte, by both standards.

Its tables alone differ, in how they name participants and in empty cells: see `test_exports.py`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evenlight import command as command_line
from evenlight.data_schema.recordings.roll_call import call_roll

Run = Callable[..., Any]
STANDARDS = ("bids", "psych-ds")


def run(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        command_line.main([str(a) for a in arguments])
    assert not ended.value.code


@pytest.fixture(scope="module")
def ramps(short_ramps: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ramps of three participants and a sweep of the display, and their exports beside them."""
    folder = tmp_path_factory.mktemp("ramps")
    people = ("--participants", 3, "--design", short_ramps)
    run("simulate", "ramp", *people, "--out", folder / "lab", "--quiet")
    sweep = ("luminance-sweep", "--session", "01", "--rig", "simulated", "--simulate", "data")
    run("run", *sweep, "--design", "quick", "--out", folder / "lab", "--quiet")
    for to in STANDARDS:
        run("export", folder / "lab", "--to", to, "--out", folder / to, "--quiet")
    return folder


@pytest.fixture(scope="module")
def ratings(tmp_path_factory: pytest.TempPathFactory, make_stimulus: Callable[..., Any]) -> Path:
    """Ratings of twelve participants, and their exports."""
    folder = tmp_path_factory.mktemp("ratings")
    for place, name in enumerate(("library", "gym", "living_room", "basement")):
        make_stimulus(folder / "stimuli" / name, [0.35 + 0.1 * place, 0.55 + 0.1 * place] * 5)
    made = ("--stimuli", folder / "stimuli", "--participants", 12, "--out", folder / "lab", "--quiet")
    run("simulate", "rating", *made)
    for to in STANDARDS:
        run("export", folder / "lab", "--to", to, "--out", folder / to, "--quiet")
    return folder


@pytest.fixture
def results(ramps: Path, ratings: Path, blank_pictures: None) -> Path:
    """What a fit of the ramps and the sweep, and an analysis of the ratings give; made by the first test."""
    out = ramps / "results"
    if not out.exists():
        run("fit", ramps / "lab", "--out", out / "fit", "--quiet")
        run("analyze", ratings / "lab", "--out", out / "analyze", "--quiet")
    return out


def test_a_fit_of_the_export_is_that_of_the_data_set(ramps: Path, results: Path, tmp_path: Path) -> None:
    """Of that of Psych-DS; that of BIDS holds the same files, as is shown below."""
    run("fit", ramps / "psych-ds", "--out", tmp_path, "--quiet")
    tables = [path.relative_to(results / "fit") for path in (results / "fit").rglob("*.csv")]
    assert Path("thresholds.csv") in tables
    assert len(tables) > 1  # those of the sweep
    for table in tables:
        assert (tmp_path / table).read_bytes() == (results / "fit" / table).read_bytes(), table


def test_the_statistics_of_the_export_are_those_of_the_data_set(
    ratings: Path, results: Path, tmp_path: Path
) -> None:
    run("analyze", ratings / "bids", "--out", tmp_path, "--quiet")
    name = "rating_statistics.csv"
    assert (tmp_path / name).read_bytes() == (results / "analyze" / name).read_bytes()


@pytest.mark.parametrize("to", STANDARDS)
def test_an_export_has_the_same_roll_and_no_problem(
    ramps: Path, ratings: Path, to: str, command: Run
) -> None:
    for folder in (ramps, ratings):
        assert command("validate", folder / to, "--quiet").code == 0
        own, theirs = call_roll(folder / "lab"), call_roll(folder / to)
        assert (own.sessions, own.listed, own.warnings) == (theirs.sessions, theirs.listed, theirs.warnings)
        assert own.read


@pytest.mark.parametrize("to", STANDARDS)
def test_every_file_that_a_session_writes_comes_out_byte_by_byte(ramps: Path, to: str) -> None:
    recorded = {"manifest.json", "trials.jsonl", "sweep.json", "readings.jsonl", "events.jsonl"}
    files = [path.relative_to(ramps / "lab") for path in (ramps / "lab").rglob("*")]
    inside = [path for path in files if path.name in recorded]
    assert {path.name for path in inside} == recorded
    for path in inside:
        assert (ramps / to / path).read_bytes() == (ramps / "lab" / path).read_bytes()

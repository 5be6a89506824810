"""The page of the Python interface and the examples: true as long as they run."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import evenlight

ROOT = Path(evenlight.__file__).parents[1]


def test_the_pages_that_are_made_are_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("make_api", ROOT / "docs" / "make_api.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    assert (ROOT / "docs" / "api.md").read_text() == made.page(), "run `python docs/make_api.py`"
    assert made.REQUESTS.read_text() == made.requests_page(), "run `python docs/make_api.py`"


def run(name: str, folder: Path, *arguments: object) -> str:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / name), *map(str, arguments)],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=200,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_example_of_a_track(tmp_path: Path, make_video) -> None:
    make_video(tmp_path / "film.mkv", 0.5 + 0.4 * np.cos(np.arange(30) / 5), (48, 32), 5.0)
    said = run("track_of_a_video.py", tmp_path, "film.mkv", "film-track")
    assert "film saves " in said
    assert (tmp_path / "film-track" / "track.csv").exists()


@pytest.mark.slow
def test_the_example_of_a_loop_of_ones_own(tmp_path: Path) -> None:
    assert run("controller_in_a_loop.py", tmp_path).count("contrast loss") == 6


@pytest.mark.slow
def test_the_example_of_somebody_elses_trials(tmp_path: Path) -> None:
    said = run("rate_limit_from_a_table.py", tmp_path)
    assert "threshold_cd_m2_s" in said
    assert "checkerboard saves " in said

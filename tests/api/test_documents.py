"""The page of the Python interface and the examples: true as long as they run."""

import importlib.util
import runpy
import sys
from collections.abc import Callable
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


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., str]:
    """Run a script as somebody does in a folder of theirs, and return what it prints."""

    def run(name: str, *arguments: str) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        runpy.run_path(str(ROOT / "examples" / name), run_name="__main__")
        return capsys.readouterr().out

    return run


@pytest.mark.slow
def test_the_example_of_a_track(tmp_path: Path, run: Callable[..., str], make_video) -> None:
    make_video(tmp_path / "film.mkv", 0.5 + 0.4 * np.cos(np.arange(30) / 5), (48, 32), 5.0)
    said = run("track_of_a_video.py", "film.mkv", "film-track")
    assert "power saved: " in said
    assert (tmp_path / "film-track" / "track.csv").exists()


@pytest.mark.slow
def test_the_example_of_a_loop_of_ones_own(run: Callable[..., str]) -> None:
    assert run("controller_in_a_loop.py").count("contrast loss") == 6


@pytest.mark.slow
def test_the_example_of_somebody_elses_trials(run: Callable[..., str]) -> None:
    said = run("rate_limit_from_a_table.py")
    assert "threshold_cd_m2_s" in said
    assert "power saved: " in said

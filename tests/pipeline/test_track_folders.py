"""What stays in a folder of results when another track is made into it, and what is refused beforehand."""

from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("blank_pictures")

FILES = ("track.csv", "track.json", "loss_curves.npz", "summary.json")
TRACK = {*FILES, "contrast_map.png", "player.html", "track.png"}
ASKED = TRACK | {"request.toml"}


@pytest.fixture
def film(tmp_path, make_video) -> Path:
    path = tmp_path / "film.mkv"
    make_video(path, 0.5 + 0.4 * np.sin(np.arange(12) / 3), (48, 32), 2.0)
    return path


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_nothing_of_an_earlier_track_stays_beside_a_new_one_and_what_is_not_ours_does(
    command, film, tmp_path
) -> None:
    out = tmp_path / "out"
    assert command("control", film, "--target-loss", "0.03", "--out", out).code == 0
    assert names(out) == ASKED
    (out / "notes.txt").write_text("mine")
    (out / "control.json").touch()  # of an earlier version: the summary has what it said
    curves = ("--curves", out / "loss_curves.npz")
    assert command("control", film, "--target-loss", "0.03", *curves, "--out", out).code == 0
    assert names(out) == ASKED | {"notes.txt"}
    optimize = ("optimize", film, "--budget", "0.5", *curves, "--out", out)
    assert command(*optimize).code == 0
    assert names(out) == ASKED | {"notes.txt"}
    assert command(*optimize, "--no-player").code == 0
    assert names(out) == (ASKED | {"notes.txt"}) - {"player.html"}


def test_the_folders_of_clips_that_no_longer_share_the_budget_go(command, film, tmp_path) -> None:
    out = tmp_path / "out"
    assert command("optimize", film, "--budget", "0.5", "--with", film, "--out", out).code == 0
    assert {path.name for path in out.iterdir() if path.is_dir()} == {"01-film", "02-film"}
    assert names(out / "01-film") == names(out / "02-film") == TRACK
    assert not (out / "player.html").exists()
    (out / "02-film" / "notes.txt").write_text("mine")
    assert command("optimize", film, "--budget", "0.5", "--out", out).code == 0
    assert names(out) == ASKED | {"02-film/notes.txt"}
    assert not (out / "01-film").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--start", "nope"), "--start nope: no such file; give a track.csv"),
        (
            ("--weights", "nope.csv"),
            "--weights nope.csv: no such file; give a csv table start_s,end_s,weight",
        ),
        (("--allowances", "nope.csv"), "--allowances nope.csv: no such file"),
    ],
)
def test_a_file_that_is_missing_is_told_before_the_video_is_read(command, tmp_path, options, words) -> None:
    refused = command("optimize", "no.mp4", "--budget", "0.5", *options, "--out", tmp_path / "out")
    assert refused.code == 2
    assert words in refused.err


@pytest.mark.parametrize("option", [("--horizon", "5"), ("--budget-unit", "watt")])
def test_an_option_of_the_budget_without_a_budget_is_refused(command, tmp_path, option) -> None:
    refused = command("control", "sunrise", "--target-loss", "0.03", *option, "--out", tmp_path / "out")
    assert refused.code == 2
    assert "is for --budget" in refused.err

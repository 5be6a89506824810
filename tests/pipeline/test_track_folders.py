"""What stays in a folder of results when another track is made into it, and what is refused beforehand."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import evenlight
from evenlight.data_schema.errors import InputError

pytestmark = pytest.mark.usefixtures("blank_pictures")

FILES = ("track.csv", "track.json", "loss_curves.npz", "summary.json")
TRACK = {*FILES, "contrast_map.png", "player.html", "track.png"}
PRICE = {"price.png", "price_points.csv"}  # of `optimize`
ASKED = TRACK | PRICE | {"request.toml", "SHA256SUMS"}


@pytest.fixture
def film(tmp_path, make_video) -> Path:
    path = tmp_path / "film.mkv"
    make_video(path, 0.5 + 0.4 * np.sin(np.arange(12) / 3), (48, 32), 2.0)
    return path


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_nothing_of_an_earlier_track_stays_beside_a_new_one(command, film, tmp_path) -> None:
    out = tmp_path / "out"
    optimize = ("optimize", film, "--budget", "0.5", "--out", out)
    assert command(*optimize).code == 0
    assert names(out) == ASKED
    assert command(*optimize, "--curves", out / "loss_curves.npz", "--no-player").code == 0
    assert names(out) == ASKED - {"player.html"}
    refused = command("control", film, "--target-loss", "0.03", "--out", out)
    assert (refused.code, "than a result of `evenlight control`" in refused.err) == (2, True)
    forced = command("control", film, "--target-loss", "0.03", "--out", out, "--force", "--quiet")
    assert (forced.code, forced.err.startswith(f"evenlight: note: {out}: removed contrast_map.png, ")) == (
        0,
        True,
    )
    assert names(out) == ASKED - PRICE


def test_the_folders_of_clips_that_no_longer_share_the_budget_go(command, film, tmp_path) -> None:
    out = tmp_path / "out"
    made = command("optimize", film, "--budget", "0.5", "--with", film, "--out", out)
    assert made.out.endswith(f"{out / '01-film' / 'player.html'} and its like show them in a browser\n")
    assert {path.name for path in out.iterdir() if path.is_dir()} == {"01-film", "02-film"}
    assert names(out / "01-film") == names(out / "02-film") == TRACK
    assert not (out / "player.html").exists()
    assert command("optimize", film, "--budget", "0.5", "--out", out).code == 0
    assert names(out) == ASKED


def test_a_film_may_lie_in_the_folder_of_its_track(command, film, tmp_path) -> None:
    """As the stimuli of an experiment do; it stays there, whatever else goes."""
    out = tmp_path / "stimuli" / "library"
    out.mkdir(parents=True)
    video = film.rename(out / "video.mkv")
    before = video.read_bytes()
    words = ("optimize", video, "--budget", "0.5", "--no-player", "--quiet", "--out", out)
    for _ in range(2):
        assert command(*words).code == 0
        assert names(out) == ASKED - {"player.html"} | {"video.mkv"}
    (out / "notes.txt").write_text("mine")
    assert "other things than a result of `evenlight optimize`: notes.txt;" in command(*words).err
    assert command(*words, "--force").code == 0
    assert names(out) == ASKED - {"player.html"} | {"video.mkv"}
    assert video.read_bytes() == before


def test_a_mixture_of_two_tracks_is_refused_by_who_reads_it(command, film, tmp_path) -> None:
    """A table or a summary of one result beside the header of another."""
    for name, budget in (("one", "0.5"), ("two", "0.7")):
        made = command("optimize", film, "--budget", budget, "--no-player", "--out", tmp_path / name)
        assert made.code == 0
    told = "is not the file that track.json beside it was written with: of another result, or changed since"
    for file in ("track.csv", "summary.json"):
        mixed = shutil.copytree(tmp_path / "one", tmp_path / f"mixed-{file}")
        shutil.copy(tmp_path / "two" / file, mixed / file)
        with pytest.raises(InputError, match=f"{file}: {told}"):
            evenlight.load(mixed)
    dimmed = tmp_path / "dimmed.mkv"
    refused = command("apply", film, tmp_path / "mixed-track.csv", "--out", dimmed)
    assert (refused.code, told in refused.err, dimmed.exists()) == (2, True, False)


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

"""What `evenlight optimize` refuses: exit code 2, one line that says why, and nothing left behind."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from optimized_videos import limit_file, optimized, refused, texture, video

from evenlight.method.optimizer.splitting import SplittingSolver

pytestmark = pytest.mark.usefixtures("blank_pictures")


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    return video(tmp_path_factory.mktemp("clip") / "clip.mkv", [texture(k) for k in range(8)])


FILES = {
    "notes.mp4": "nothing to see",
    "broken.toml": "name = \n",
    "same-name.toml": """name = "varjo-xr3"
peak_luminance_cd_m2 = 300
black_level_cd_m2 = 0.3
gamma = 2.2
pixels_per_degree = 40
""",
}
CURVES = "--jobs and --device are for computing loss curves, which --curves gives"
ASKED = [  # words after the video, or the video itself with them; what is said
    ("--budget 0.1", "factors from 0.2 to 1 use 0.2 to 1; to dim further, lower --min-factor, now 0.2"),
    ("--budget 50", "factors from 0.2 to 1 use 0.2 to 1; 50 % are 0.5"),
    ("--budget 50%", "Invalid value for '--budget': 50% is written 0.5; see"),
    ("--budget -1", "cannot be met"),
    ("--budget 1e308", "cannot be met"),
    *((f"--min-factor {f}", f"--min-factor must lie in 0.001 to 0.99, got {f}")
      for f in ("0", "-0.5", "0.0009", "0.999999999999999", "1")),
    ("--jobs -1", "--jobs must be a whole number from 0 on, got -1"),
    ("--curves loss_curves.npz --jobs 3", CURVES),
    ("--curves loss_curves.npz --device gpu", CURVES),
    ("--seed -1 --solver splitting", "--seed must be a whole number from 0 on, got -1"),
    ("--seed -1 --solver slsqp", "--seed must be a whole number from 0 on, got -1"),
    *((f"--field-of-view {v}", "--field-of-view must lie in 0.1 to 175, got")
      for v in ("0.05", "-1", "179.9999999", "180")),
    ("--display varjo-xr4", "varjo-xr4: no such display; did you mean 'varjo-xr3'?"),
    ("--display broken.toml", "broken.toml: not valid TOML"),
    ("--display same-name.toml", "the display 'varjo-xr3' of other photometry"),
    ("gone.mp4 --budget 0.5", "no video 'gone.mp4'"),
    ("notes.mp4 --budget 0.5", "notes.mp4"),
    ("gone.mp4 --budget 1.5", "the budget 1.5 (factor) cannot be met"),  # before the video is read
    ("'' --budget 0.5", "an argument is empty"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "said"), ASKED, ids=[words for words, _ in ASKED])
def test_what_cannot_be_is_said(command, tmp_path, clip, monkeypatch, words: str, said: str) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    video = [] if words[0] != "-" else [clip]
    budget = [] if "--budget" in words else ["--budget", "0.5"]
    assert said in refused(command, tmp_path, *video, *shlex.split(words), *budget)


def test_a_truncated_video(command, tmp_path, clip) -> None:
    whole = clip.read_bytes()
    cut = tmp_path / "cut.mkv"
    cut.write_bytes(whole[: len(whole) * 6 // 10])
    assert "cut.mkv" in refused(command, tmp_path, cut, "--budget", 0.5)


def test_nan_in_an_image_folder(command, tmp_path) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    good = np.repeat(texture(1)[..., None], 3, axis=2)
    bad = good.copy()
    bad[3, 4, 1] = np.nan
    np.save(folder / "a.npy", good)
    np.save(folder / "b.npy", bad)
    assert "b.npy" in refused(command, tmp_path, folder, "--budget", 0.5)


def test_a_video_damaged_in_its_middle_is_told_alike_for_any_number_of_jobs(command, tmp_path, clip) -> None:
    content = bytearray(clip.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 200] = bytes(200)
    damaged = tmp_path / "damaged.mkv"
    damaged.write_bytes(content)
    lines = {refused(command, tmp_path, damaged, "--budget", 0.5, "--jobs", jobs) for jobs in (1, 2, 0)}
    assert len(lines) == 1
    assert "damaged.mkv is damaged at frame" in lines.pop()


@pytest.mark.parametrize("form", ["ln_rate", "log_log", "rate"])
def test_a_rate_limit_beyond_all_numbers(command, tmp_path, clip, form) -> None:
    content = json.loads(limit_file(tmp_path / "limit.json", 1.0).read_text())
    content |= {"form": form, "coefficients": [1e300]}
    (tmp_path / "limit.json").write_text(json.dumps(content))
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--rate-limit", tmp_path / "limit.json")
    assert "limit.json: coefficients give" in line


def test_a_rate_limit_fitted_on_another_display(command, tmp_path, clip) -> None:
    toml = 'name = "desk"\npeak_luminance_cd_m2 = 300\nblack_level_cd_m2 = 0.3\ngamma = 2.2\n'
    (tmp_path / "d.toml").write_text(toml + "pixels_per_degree = 40\n")
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--display", tmp_path / "d.toml")
    assert "'surace2025' was fitted on the display 'varjo-xr3', not on 'desk'" in line
    other = ["--display", tmp_path / "d.toml", "--other-display-ok", "--power-model", "surace2025"]
    optimized(command, tmp_path, clip, 0.5, *other)


def test_a_folder_that_cannot_be_written(command, tmp_path, clip) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    result = command("optimize", clip, "--budget", 0.5, "--out", blocked / "out", "--quiet")
    assert result.code == 2
    assert str(blocked / "out") in result.err
    assert result.err.count("\n") == 1


def test_loss_curves_of_another_video(command, tmp_path, clip) -> None:
    other = video(tmp_path / "other.mkv", [texture(20 + k) for k in range(8)])
    optimized(command, tmp_path, other)
    curves = tmp_path / "out" / "loss_curves.npz"
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--curves", curves)
    assert "made of another video than clip" in line


def test_an_interruption_leaves_nothing(command, tmp_path, clip, monkeypatch) -> None:

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(SplittingSolver, "solve", interrupt)
    result = command("optimize", clip, "--budget", 0.5, "--out", tmp_path / "results", "--quiet")
    assert result.code == 130
    assert not (tmp_path / "results").exists()


def test_a_misspelt_option_ends_with_one_line(command) -> None:
    result = command("optimize", "x", "--buget", "0.5")
    assert result.code == 2
    assert result.err.count("\n") == 1

"""What `evenlight optimize` refuses: exit code 2, one line that says why, and nothing left behind."""

import json
from pathlib import Path

import numpy as np
import pytest
from optimized_videos import limit_file, optimized, refused, texture, video

from evenlight.method.optimizer.splitting import SplittingSolver

pytestmark = pytest.mark.usefixtures("blank_pictures")


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    return video(tmp_path_factory.mktemp("clip") / "clip.mkv", [texture(k) for k in range(8)])


def test_no_such_file(command, tmp_path) -> None:
    assert "no video 'gone.mp4'" in refused(command, tmp_path, "gone.mp4", "--budget", 0.5)


def test_not_a_video(command, tmp_path) -> None:
    (tmp_path / "notes.mp4").write_text("nothing to see")
    assert "notes.mp4" in refused(command, tmp_path, tmp_path / "notes.mp4", "--budget", 0.5)


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


def test_an_impossible_budget(command, tmp_path, clip) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.1)
    assert "the budget 0.1 (factor) cannot be met: factors from 0.2 to 1 use 0.2 to 1" in line


@pytest.mark.parametrize("budget", ["-1", "1e308"])
def test_a_budget_that_is_no_amount(command, tmp_path, clip, budget) -> None:
    assert "cannot be met" in refused(command, tmp_path, clip, "--budget", budget)


@pytest.mark.parametrize("factor", ["0", "-0.5", "0.0009", "0.999999999999999", "1"])
def test_a_lowest_factor_that_is_none(command, tmp_path, clip, factor) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--min-factor", factor)
    assert f"--min-factor must lie in 0.001 to 0.99, got {factor}" in line


def test_a_negative_number_of_jobs(command, tmp_path, clip) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--jobs", -1)
    assert "--jobs must be a whole number from 0 on, got -1" in line


@pytest.mark.parametrize("option", [("--jobs", 3), ("--device", "gpu")])
def test_options_of_computing_curves_that_are_given(command, tmp_path, clip, option) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--curves", "loss_curves.npz", *option)
    assert "--jobs and --device are for computing loss curves, which --curves gives" in line


def test_a_video_damaged_in_its_middle_is_told_alike_for_any_number_of_jobs(command, tmp_path, clip) -> None:
    content = bytearray(clip.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 200] = bytes(200)
    damaged = tmp_path / "damaged.mkv"
    damaged.write_bytes(content)
    lines = {refused(command, tmp_path, damaged, "--budget", 0.5, "--jobs", jobs) for jobs in (1, 2, 0)}
    assert len(lines) == 1
    assert "damaged.mkv is damaged at frame" in lines.pop()


@pytest.mark.parametrize("solver", ["splitting", "slsqp"])
def test_a_negative_seed(command, tmp_path, clip, solver) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--seed", -1, "--solver", solver)
    assert "--seed must be a whole number from 0 on, got -1" in line


@pytest.mark.parametrize("degrees", ["0", "-1", "179.9999999", "180"])
def test_a_field_of_view_that_no_flat_screen_has(command, tmp_path, clip, degrees) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--field-of-view", degrees)
    assert "--field-of-view must lie in 0.1 to 175, got" in line


@pytest.mark.parametrize("form", ["ln_rate", "log_log", "rate"])
def test_a_rate_limit_beyond_all_numbers(command, tmp_path, clip, form) -> None:
    content = json.loads(limit_file(tmp_path / "limit.json", 1.0).read_text())
    content |= {"form": form, "coefficients": [1e300]}
    (tmp_path / "limit.json").write_text(json.dumps(content))
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--rate-limit", tmp_path / "limit.json")
    assert "limit.json: coefficients give" in line


def test_an_unknown_preset_is_told_the_known_ones(command, tmp_path, clip) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--display", "varjo-xr4")
    assert "varjo-xr4: no such display; did you mean 'varjo-xr3'?" in line


def test_a_broken_toml(command, tmp_path, clip) -> None:
    (tmp_path / "d.toml").write_text("name = \n")
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--display", tmp_path / "d.toml")
    assert "d.toml: not valid TOML" in line


def test_a_rate_limit_fitted_on_another_display(command, tmp_path, clip) -> None:
    toml = 'name = "desk"\npeak_luminance_cd_m2 = 300\nblack_level_cd_m2 = 0.3\ngamma = 2.2\n'
    (tmp_path / "d.toml").write_text(toml + "pixels_per_degree = 40\n")
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--display", tmp_path / "d.toml")
    assert "'surace2025' was fitted on the display 'varjo-xr3', not on 'desk'" in line
    other = ["--display", tmp_path / "d.toml", "--other-display-ok"]
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


def test_an_impossible_budget_is_told_before_the_video_is_read(command, tmp_path) -> None:
    line = refused(command, tmp_path, "no-such-video.mp4", "--budget", 1.5)
    assert "the budget 1.5 (factor) cannot be met" in line


def test_an_empty_name_is_not_this_folder(command, tmp_path) -> None:
    assert "an argument is empty" in refused(command, tmp_path, "", "--budget", 0.5)


def test_displays_of_one_name_and_other_photometry_are_identifiable(command, tmp_path, clip) -> None:
    toml = 'name = "varjo-xr3"\npeak_luminance_cd_m2 = 300\nblack_level_cd_m2 = 0.3\ngamma = 2.2\n'
    (tmp_path / "d.toml").write_text(toml + "pixels_per_degree = 40\n")
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--display", tmp_path / "d.toml")
    assert "the display 'varjo-xr3' of other photometry" in line

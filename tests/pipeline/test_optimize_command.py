"""`evenlight optimize`, from a video file to its results: content in, track out."""

import json
from pathlib import Path

import numpy as np
import pytest

from data_schema.brightness_track import read_track
from data_schema.loss_curves import read_loss_curves
from data_schema.rate_limit import RateLimit, RateLimitForm
from data_schema.text_files import write_json_record
from method.loss_curves import analyze_frames
from method.preset_files import load_display
from stimuli.coarser_frames import coarser
from stimuli.video_source import open_video
from stimuli.video_writer import write_video

pytestmark = pytest.mark.usefixtures("coarse_pictures")


def texture(seed, height=36, width=48):
    """A picture with detail at every scale, pixel values in [0, 1]."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :])
    spectrum = np.fft.rfft2(rng.standard_normal((height, width))) / np.maximum(frequency, 1 / width)
    picture = np.fft.irfft2(spectrum, (height, width))
    return np.clip(0.5 + 0.2 * picture / picture.std(), 0, 1)


def frames_of(gray_frames, bits=8):
    top, kind = (255, np.uint8) if bits == 8 else (65535, np.uint16)
    return [np.repeat(np.round(g * top).astype(kind)[..., None], 3, axis=2) for g in gray_frames]


def video(path: Path, gray_frames, fps=5.0, bits=8) -> Path:
    write_video(path, frames_of(gray_frames, bits), fps, bits)
    return path


def optimized(command, tmp_path, source, budget=0.5, *more):
    """Run the command; return its track and summary, and check what must hold for every run."""
    out = tmp_path / "out"
    result = command("optimize", source, "--budget", budget, "--out", out, "--quiet", *more)
    assert result.code == 0, result.err
    assert result.err == ""
    track, summary = read_track(out / "track.csv"), json.loads((out / "summary.json").read_text())
    assert summary["achieved"] == pytest.approx(budget, abs=1e-6)
    assert summary["max_rate_ratio"] <= 1 + 1e-6
    assert (np.abs(track.rate) <= track.rate_limit * (1 + 1e-6)).all()
    assert summary["objective"] <= summary["objective_baseline"]
    assert summary["mean_power_w"] == pytest.approx(summary["baseline_power_w"], rel=1e-6)
    assert len(track.times) == summary["frames"]
    return track, summary


# --- content decides


def test_a_checkerboard_that_fades_to_gray_gets_rising_brightness(command, tmp_path) -> None:
    # The paper's Figure: white tiles fade to black, and the factor makes up for the contrast that goes.
    tiles = np.kron(np.indices((6, 8)).sum(axis=0) % 2, np.ones((6, 6)))
    fade = [tiles * level for level in np.linspace(1.0, 0.08, 60)]
    track, _ = optimized(command, tmp_path, video(tmp_path / "board.mkv", fade, fps=1.0))
    smooth = np.convolve(track.factors, np.ones(5) / 5, "valid")
    assert np.polyfit(track.times, track.factors, 1)[0] > 0
    assert smooth[-10:].mean() > smooth[:10].mean() + 0.1


def test_a_static_clip_gets_a_constant_track(command, tmp_path) -> None:
    track, summary = optimized(command, tmp_path, video(tmp_path / "static.mkv", [texture(1)] * 25))
    np.testing.assert_allclose(track.factors, 0.5, atol=1e-12)
    assert summary["objective"] == 0


def test_a_fade_to_black_and_back_is_brightest_where_the_content_is_darkest(command, tmp_path) -> None:
    # The paper's sunrise: "during the darker intervals brightness is high".
    level = 0.12 + 0.88 * np.abs(np.linspace(-1, 1, 60))
    fade = [texture(2) * s for s in level]
    track, _ = optimized(command, tmp_path, video(tmp_path / "fade.mkv", fade, fps=0.5))
    # Few pixels make the loss flicker; the track is compared over ten frames each.
    darkest = track.factors[25:35].mean()
    assert darkest > track.factors[:10].mean() + 0.02
    assert darkest > track.factors[-10:].mean() + 0.02


def test_a_video_whose_frames_lose_nothing_keeps_constant_dimming(command, tmp_path) -> None:
    flat = [np.full((16, 16), level) for level in np.linspace(0.2, 0.9, 12)]
    track, summary = optimized(command, tmp_path, video(tmp_path / "flat.mkv", flat))
    assert summary["frames_without_contrast"] == 12
    assert summary["objective"] == 0
    np.testing.assert_allclose(track.factors, 0.5, atol=1e-12)


# --- hard cases


@pytest.mark.parametrize("frames", [1, 2])
def test_the_shortest_videos(command, tmp_path, frames) -> None:
    _, summary = optimized(command, tmp_path, video(tmp_path / "v.mkv", [texture(k) for k in range(frames)]))
    assert summary["frames"] == frames


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_all_black_and_all_white(command, tmp_path, level) -> None:
    optimized(command, tmp_path, video(tmp_path / "v.mkv", [np.full((16, 16), level)] * 8))


def test_a_cut_between_black_and_white_keeps_the_rate_limit(command, tmp_path) -> None:
    cut = [np.zeros((24, 24))] * 10 + [texture(3, 24, 24)] * 10 + [np.ones((24, 24))] * 10
    optimized(command, tmp_path, video(tmp_path / "v.mkv", cut))


@pytest.mark.parametrize("budget", [0.2, 1.0])
def test_a_budget_at_an_end_of_the_factors_leaves_only_that_end(command, tmp_path, budget) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 12)])
    track, _ = optimized(command, tmp_path, clip, budget)
    np.testing.assert_allclose(track.factors, budget, atol=1e-9)


@pytest.mark.parametrize("size", [(8, 8), (9, 13), (8, 31), (17, 8)])
def test_odd_sizes_down_to_eight_pixels(command, tmp_path, size) -> None:
    clip = [texture(k, *size) for k in range(6)]
    optimized(command, tmp_path, video(tmp_path / "v.mkv", clip))


def test_ten_bit_input_tells_levels_apart_that_eight_bits_cannot(command, tmp_path) -> None:
    board = np.kron(np.indices((4, 4)).sum(axis=0) % 2, np.ones((6, 6)))
    faint = [(400 + board) / 1023] * 3  # one 10-bit code of contrast
    optimized(command, tmp_path, video(tmp_path / "v.mkv", faint, bits=10))
    curves = read_loss_curves(tmp_path / "out" / "loss_curves.npz")
    lighter = (401 / 1023) ** 1.95 * (104.4 - 0.2) + 0.2
    darker = (400 / 1023) ** 1.95 * (104.4 - 0.2) + 0.2
    # Half a 16-bit code of 25 625 is 2e-5, times the gamma 4e-5; the nearest 8-bit code is off by 3e-3.
    np.testing.assert_allclose(curves.mean_luminance, (lighter + darker) / 2, rtol=4e-5)


def limit_file(path: Path, rate: float) -> Path:
    panel = load_display("varjo-xr3")
    limit = RateLimit("made", panel.name, panel.fingerprint, RateLimitForm.RATE, (rate,), (0.01, 0.02))
    write_json_record(path, limit)
    return path


def test_a_limit_so_tight_that_only_a_constant_fits(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 20)])
    tight = limit_file(tmp_path / "limit.json", 0.0)
    track, summary = optimized(command, tmp_path, clip, 0.5, "--rate-limit", tight)
    np.testing.assert_allclose(track.factors, 0.5, atol=1e-12)
    assert summary["objective"] == pytest.approx(summary["objective_baseline"], rel=1e-12)


def test_a_limit_so_loose_that_it_never_binds_equalizes_the_loss(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.3, 1, 20)])
    loose = limit_file(tmp_path / "limit.json", 1e6)
    track, summary = optimized(command, tmp_path, clip, 0.6, "--rate-limit", loose)
    assert summary["max_rate_ratio"] < 0.01
    inside = (track.factors > 0.2 + 1e-6) & (track.factors < 1 - 1e-6)
    assert np.ptp(track.contrast_loss[inside]) < 1e-3
    assert summary["objective"] < 0.2 * summary["objective_baseline"]


@pytest.mark.parametrize("unit", ["power", "watt"])
def test_budgets_of_power_are_met_in_their_unit(command, tmp_path, unit) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 12)])
    track, summary = optimized(command, tmp_path, clip, 0.6, "--budget-unit", unit)
    achieved = track.power.mean() if unit == "watt" else track.power.mean() / summary["full_power_w"]
    assert achieved == pytest.approx(0.6, abs=1e-6)


def test_the_papers_solver_gives_a_track_as_good(command, tmp_path) -> None:
    # Curves of so few pixels are stairs with many local optima: either solver may end slightly better.
    clip = video(tmp_path / "v.mkv", [texture(1, 72, 96) * s for s in np.linspace(0.2, 1, 30)], fps=1.0)
    _, ours = optimized(command, tmp_path, clip)
    _, paper = optimized(command, tmp_path, clip, 0.5, "--solver", "slsqp")
    assert ours["objective"] <= 1.01 * paper["objective"]
    assert paper["seed"] == 1


def test_loss_curves_of_an_earlier_run_give_the_same_track(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 12)])
    first, _ = optimized(command, tmp_path, clip)
    kept = (tmp_path / "out" / "loss_curves.npz").rename(tmp_path / "kept.npz")
    again, _ = optimized(command, tmp_path, clip, 0.5, "--curves", kept)
    np.testing.assert_array_equal(first.factors, again.factors)


def test_a_contrast_model_of_ones_own_is_used_and_remembered(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 6)])
    optimized(command, tmp_path, clip)
    default = read_loss_curves(tmp_path / "out" / "loss_curves.npz")
    optimized(command, tmp_path, clip, 0.5, "--contrast-model", "as-printed")
    kept = tmp_path / "out" / "loss_curves.npz"
    printed = read_loss_curves(kept)
    # Bright detail alone is less than bright and dark detail.
    assert (printed.visible_contrast < default.visible_contrast).all()
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--curves", kept)
    assert "made with another contrast model" in line


def test_a_wider_field_of_view_makes_the_detail_coarser(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 6)])
    optimized(command, tmp_path, clip, 0.5, "--field-of-view", 2)
    curves = read_loss_curves(tmp_path / "out" / "loss_curves.npz")
    # 48 pixels over 2 degrees: 24 to the degree, in the middle of a flat picture slightly fewer.
    assert curves.display.pixels_per_degree == pytest.approx(24, rel=1e-3)


def test_more_pixels_than_the_display_shows_in_its_field_are_averaged_to_as_many(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 4)])
    out = tmp_path / "out"
    told = command("optimize", clip, "--budget", 0.5, "--field-of-view", 0.32, "--out", out)
    # 48 pixels in 0.32 degrees are 150 to the degree, where the headset shows 72.28: room for 23.
    assert told.code == 0
    assert "48 x 36 pixels are more than 'varjo-xr3' shows in 0.32 degrees; averaged to 23 x 17" in told.err
    curves, display = read_loss_curves(out / "loss_curves.npz"), load_display("varjo-xr3")
    assert curves.display.pixels_per_degree == pytest.approx(150 * 23 / 48, rel=1e-4)
    frames = coarser(open_video(str(clip)).frames(), (17, 23), display.gamma)
    same = analyze_frames(frames, "v", curves.display, factors=curves.factors)
    np.testing.assert_allclose(curves.loss, same.loss, atol=1e-12)


def test_the_results_validate(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 6)])
    optimized(command, tmp_path, clip)
    assert command("validate", tmp_path / "out").code == 0


# --- bad input: exit code 2, one line, nothing left


def refused(command, tmp_path, *arguments):
    """The line that the command ends with; the output folder must not exist."""
    out = tmp_path / "results"
    result = command("optimize", *arguments, "--out", out, "--quiet")
    assert result.code == 2
    assert result.err.count("\n") == 1
    assert "Traceback" not in result.err
    assert not out.exists()
    return result.err


@pytest.fixture
def clip(tmp_path) -> Path:
    return video(tmp_path / "clip.mkv", [texture(k) for k in range(8)])


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
    assert "--budget 0.1 (factor) cannot be met: factors from 0.2 to 1 use 0.2 to 1" in line


@pytest.mark.parametrize("budget", ["nan", "-1", "inf"])
def test_a_budget_that_is_no_amount(command, tmp_path, clip, budget) -> None:
    assert "cannot be met" in refused(command, tmp_path, clip, "--budget", budget)


@pytest.mark.parametrize("factor", ["0", "-0.5", "0.0009", "0.999999999999999", "1", "nan"])
def test_a_lowest_factor_that_is_none(command, tmp_path, clip, factor) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--min-factor", factor)
    assert f"--min-factor must lie in 0.001 to 0.99, got {factor}" in line


@pytest.mark.parametrize("tolerance", ["-0.001", "1", "nan", "inf"])
def test_a_tolerance_that_is_none(command, tmp_path, clip, tolerance) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--tolerance", tolerance)
    assert f"--tolerance must lie in 0 (count all of every frame) to below 1, got {tolerance}" in line


def test_a_negative_number_of_jobs(command, tmp_path, clip) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--jobs", -1)
    assert "--jobs must be 0 (all cores) or more, got -1" in line


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
    assert "--seed must be 0 or more, got -1" in line


@pytest.mark.parametrize("degrees", ["0", "-1", "179.9999999", "180", "inf", "nan"])
def test_a_field_of_view_that_no_flat_screen_has(command, tmp_path, clip, degrees) -> None:
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--field-of-view", degrees)
    assert "--field-of-view must lie above 0 and not above 175 degrees" in line


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


def test_loss_curves_that_err_more_than_is_asked_for(command, tmp_path, clip) -> None:
    optimized(command, tmp_path, clip, 0.5, "--tolerance", 0.01)
    curves = tmp_path / "out" / "loss_curves.npz"
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--curves", curves)
    assert "made to a tolerance of 0.01, asked is --tolerance 0.001" in line


def test_fine_detail_of_a_pan_is_not_counted_in_every_frame(command, tmp_path) -> None:
    still = np.clip(0.5 + 0.1 * np.random.default_rng(0).standard_normal((270, 384)), 0, 1)
    source = video(tmp_path / "pan.mkv", [np.roll(still, 2 * k, axis=1) for k in range(12)])
    _, summary = optimized(command, tmp_path, source, 0.5, "--jobs", 2)
    assert summary["curves_tolerance"] == 0.001
    assert 0 < summary["counted"] < 0.9


def test_an_interruption_leaves_nothing(command, tmp_path, clip, monkeypatch) -> None:
    import method.splitting

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(method.splitting.SplittingSolver, "solve", interrupt)
    result = command("optimize", clip, "--budget", 0.5, "--out", tmp_path / "results", "--quiet")
    assert result.code == 130
    assert not (tmp_path / "results").exists()


def test_a_misspelt_option_ends_with_one_line(command) -> None:
    result = command("optimize", "x", "--buget", "0.5")
    assert result.code == 2
    assert result.err.count("\n") == 1


def test_an_impossible_budget_is_told_before_the_video_is_read(command, tmp_path) -> None:
    line = refused(command, tmp_path, "no-such-video.mp4", "--budget", 1.5)
    assert "--budget 1.5 (factor) cannot be met" in line


def test_an_empty_name_is_not_this_folder(command, tmp_path) -> None:
    assert "the video has an empty name" in refused(command, tmp_path, "", "--budget", 0.5)


def test_the_summary_says_how_the_track_was_made(command, tmp_path) -> None:
    clip = video(tmp_path / "v.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 6)])
    options = [
        "--limit-curve",
        "safe",
        "--modulated",
        "white_field",
        "--min-factor",
        0.3,
        "--field-of-view",
        2,
    ]
    _, summary = optimized(command, tmp_path, clip, 0.5, *options, "--contrast-model", "as-printed")
    made = ("limit_curve", "modulated", "lowest_factor", "contrast_model", "simulated")
    assert [summary[key] for key in made] == ["safe", "white_field", 0.3, "as-printed", False]
    assert summary["pixels_per_degree"] == pytest.approx(24, rel=1e-3)


def test_displays_of_one_name_and_other_photometry_are_told_apart(command, tmp_path, clip) -> None:
    toml = 'name = "varjo-xr3"\npeak_luminance_cd_m2 = 300\nblack_level_cd_m2 = 0.3\ngamma = 2.2\n'
    (tmp_path / "d.toml").write_text(toml + "pixels_per_degree = 40\n")
    line = refused(command, tmp_path, clip, "--budget", 0.5, "--display", tmp_path / "d.toml")
    assert "the display 'varjo-xr3' of other photometry" in line

"""`evenlight judge`: what it writes of a track, and what it refuses."""

import json
import tomllib

import numpy as np
import pytest
from optimized_videos import frames_of, texture, video

from benchmarks.validity import losses_of
from evenlight.command import main
from evenlight.data_schema.contrast_model import ContrastModel, SensitivityModel
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loaded_track import load_track
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.preset_files import load_display

DARK_TO_BRIGHT = [0.1 + 0.9 * texture(1) * k / 5 for k in range(6)]


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    """Return a clip that gets brighter, and the folder of its track."""
    folder = tmp_path_factory.mktemp("judged")
    clip = video(folder / "clip.mkv", DARK_TO_BRIGHT)
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "optimize",
                str(clip),
                *["--budget", "0.5", "--no-player", "--quiet", "--out"],
                str(folder / "track"),
            ]
        )
    assert not ended.value.code
    return clip, folder / "track"


def told(folder):
    return json.loads((folder / "judgement.json").read_text())


def refused(command, tmp_path, *arguments):
    """The line that the command ends with; the folder of results must not exist."""
    result = command("judge", *arguments, "--out", tmp_path / "never", "--quiet")
    assert (result.code, result.err.count("\n")) == (2, 1)
    assert not (tmp_path / "never").exists()
    return result.err


def test_the_default_measure_says_what_the_optimizer_said(command, tmp_path, judged) -> None:
    clip, track = judged
    measures = ("--measures", "relative, castle")
    result = command("judge", clip, track, "--out", tmp_path / "out", "--no-modulation", *measures)
    assert result.code == 0, result.err
    summary = json.loads((track / "summary.json").read_text())
    relative, castle = told(tmp_path / "out")["measured"]
    asked = tomllib.loads((tmp_path / "out" / "request.toml").read_text())["asked"]
    assert (asked["measures"], asked["modulation"], asked["jobs"]) == ("relative, castle", False, 0)
    assert relative["spread"] == pytest.approx(summary["objective"], rel=1e-9)
    assert relative["spread_constant"] == pytest.approx(summary["objective_baseline"], rel=1e-9)
    assert relative["mean_loss"] == pytest.approx(summary["mean_contrast_loss"], rel=1e-9)
    factors, panel = read_track(track / "track.csv").factors, load_display("varjo-xr3")
    by_definition = ContrastModel(sensitivity=SensitivityModel.CASTLE)
    defined = [
        contrast_loss(emitted_luminance(pixels, panel), b, panel, by_definition)
        for pixels, b in zip(frames_of(DARK_TO_BRIGHT), factors, strict=True)
    ]
    # Between knots the curve is a straight line: a frame of 48 x 36 pixels loses one of them at a time.
    assert castle["mean_loss"] == pytest.approx(np.mean(defined), abs=2e-3)
    assert command("validate", tmp_path / "out").code == 0
    assert "docs/validity.md" in (tmp_path / "out" / "report.html").read_text()


def test_all_measures_are_asked_unless_some_are_named(command, tmp_path, judged) -> None:
    clip, track = judged
    result = command("judge", clip, track / "track.csv", "--out", tmp_path / "out", "--no-modulation")
    assert result.code == 0, result.err
    found = told(tmp_path / "out")
    names = [one["measure"] for one in found["measured"]]
    assert names == ["relative", "soft", "castle", "absolute", "suprathreshold"]
    assert len(found["agreements"]) == 5 * 4 / 2
    assert found["modulation_note"] == "Left out by --no-modulation"


def test_curves_that_were_kept_are_used_unless_the_track_goes_below_them(
    command, tmp_path, judged, monkeypatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", "100")
    clip, track = judged
    low = tmp_path / "low"
    budget = ("--budget", "0.15", "--min-factor", "0.1")
    assert command("optimize", "--no-player", clip, *budget, "--out", low, "--no-cache", "--quiet").code == 0
    said = [
        command(
            "judge", clip, of, "--out", tmp_path / f"out{k}", "--no-modulation", "--measures", "relative"
        ).err
        for k, of in enumerate([track, track, low])
    ]
    assert ["loss curves of an earlier run" in words for words in said] == [False, True, False]
    [found], summary = told(tmp_path / "out2")["measured"], json.loads((low / "summary.json").read_text())
    assert found["spread"] == pytest.approx(summary["objective"], abs=2e-3)


def test_the_script_of_the_validity_page_evaluates_single_frames(judged) -> None:
    """By definition, frame by frame; the one-factor form in single precision is 1e-3 off at most here."""
    clip, track = judged
    panel, loaded = load_display("varjo-xr3"), load_track(track)
    _, of_track, of_constant = next(losses_of(str(clip), track, samples=6))
    frames = [emitted_luminance(pixels, panel) for pixels in frames_of(DARK_TO_BRIGHT)]
    evenly = [contrast_loss(frame, loaded.baseline, panel) for frame in frames]
    ours = [contrast_loss(*of, panel) for of in zip(frames, loaded.track.factors, strict=True)]
    np.testing.assert_allclose([of_constant, of_track], [evenly, ours], atol=1e-3)


def test_what_does_not_go_together_is_refused(command, tmp_path, judged) -> None:
    clip, track = judged
    other = video(tmp_path / "other.mkv", DARK_TO_BRIGHT[:4])
    assert "has 4 frames, and its brightness track 6" in refused(command, tmp_path, other, track)
    lab = tmp_path / "lab.display.toml"
    lab.write_text(
        'name = "lab"\npeak_luminance_cd_m2 = 90.0\nblack_level_cd_m2 = 0.1\ngamma = 2.2\n'
        "pixels_per_degree = 30.0\n"
    )
    line = refused(command, tmp_path, clip, track, "--display", lab)
    assert "was made for the display 'varjo-xr3', and here is 'lab'" in line
    lab.write_text(lab.read_text().replace('"lab"', '"varjo-xr3"'))
    line = refused(command, tmp_path, clip, track, "--display", lab)
    assert "here is 'varjo-xr3' in another calibration" in line
    assert "--measures must be one of relative, soft," in refused(
        command, tmp_path, clip, track, "--measures", "quality"
    )
    assert "no such brightness track" in refused(command, tmp_path, clip, tmp_path / "none")
    assert "no video 'gone.mkv'" in refused(command, tmp_path, "gone.mkv", track)

"""`evenlight play`: on a window under a virtual screen, and what it refuses before there is one."""

import csv
import json
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_tracks import example_track, header_of
from PIL import Image
from warm_evenlight import said_by

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import Provenance, sha256_of_file
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import (
    read_track,
    write_track,
)
from evenlight.data_schema.tracks.loaded_track import mean_factor
from evenlight.experiments.playback.track_refusals import floor_note
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.video_writer import write_video

N, RATE = 30, 25.0
FACTORS = np.linspace(0.9, 0.5, N)


def write_a_track(folder: Path, n: int = N, rate: float = RATE, **header: Any) -> Path:
    """Write a track of factors that fall from 0.9 to 0.5; only times, factors and display matter here."""
    display = load_display("varjo-xr3")
    fits = header_of(display, video="8", power_model="surace2025", rate_limit="surace2025", budget=0.7)
    track = example_track(np.linspace(0.9, 0.5, n), rate, replace(fits, **header))
    folder.mkdir(exist_ok=True)
    write_track(folder / "track.csv", track)
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Videos of 8 and 10 bits, 120 x 90, and their track."""
    folder = tmp_path_factory.mktemp("made")
    rng = np.random.default_rng(3)
    for bits in (8, 10):
        scale = 1 if bits == 8 else 257
        kind = np.uint8 if bits == 8 else np.uint16
        frames = (
            Frame(k / RATE, 1 / RATE, (rng.integers(0, 200, (90, 120, 3)) + k).astype(kind) * kind(scale))
            for k in range(N)
        )
        write_video(folder / f"{bits}.mkv", frames, RATE, bits=bits)
    write_a_track(folder / "track")
    return folder


@pytest.fixture(scope="module")
def played(made: Path, virtual_screen: Callable[[], str]) -> dict[str, Any]:
    """What a process on a virtual screen says of it all."""
    video, track = str(made / "8.mkv"), str(made / "track")
    short = str(write_a_track(made / "short", n=5))
    small = ["--rig", "simulated", "--simulate"]
    commands = [
        [
            "play",
            video,
            track,
            "--simulate",
            "--log",
            str(made / "log.csv"),
            "--screenshots",
            str(made / "shots"),
        ],
        [
            "play",
            str(made / "10.mkv"),
            track,
            "--version",
            "both",
            "--label",
            "--log",
            str(made / "log.jsonl"),
            *small,
        ],
        ["play", "checkerboard", short, "--size", "700x480", *small, "--log", str(made / "board.csv")],
        ["play", "checkerboard", track, "--size", "64x48", "--version", "full", "--simulate", "--quiet"],
        ["play", video, track, "--version", "baseline"],
    ]
    script = Path(__file__).with_name("play_on_window.py")
    return said_by(script, [str(made), json.dumps(commands)], os.environ | {"DISPLAY": virtual_screen()})


@pytest.mark.parametrize("video", ["8.mkv", "10.mkv"])
def test_every_pixel_of_every_refresh_is_what_the_definition_says(played: dict[str, Any], video: str) -> None:
    stage = played["stage"][video]
    assert stage["differing"] == [0] * 72  # 1.2 s at 60 Hz
    times = np.arange(72) / 60
    assert stage["video_frames"] == np.floor(times * 25 + 1e-6).astype(int).tolist()


@pytest.mark.parametrize("video", ["8.mkv", "10.mkv"])
def test_the_stage_reads_back_the_luminance_that_was_to_be(played: dict[str, Any], video: str) -> None:
    """Noise leaves at most half a step, 0.43 cd/m^2, over the root of 120 x 90 pixels: 0.0041; 4 of them."""
    errors = np.array(played["stage"][video]["errors"])
    assert len(errors) == 12
    assert 0 < np.abs(errors).max() < 4 * 0.43 / np.sqrt(120 * 90)


def test_a_field_after_a_video_is_drawn_right(played: dict[str, Any]) -> None:
    """20 cd/m^2 with 0.5 reflected and a black of 0.2: code 255 (19.3 / 99.8)^(1 / 2.2) = 120.8."""
    code = 255 * ((20 - 0.5 - 0.2) / 99.8) ** (1 / 2.2)
    for stage in played["stage"].values():
        assert stage["after"] == pytest.approx([code] * len(stage["after"]), abs=0.05)


def test_the_log_says_of_each_refresh_what_it_showed(played: dict[str, Any], made: Path) -> None:
    assert played["commands"][0]["code"] == 0
    with (made / "log.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 72
    assert {row["version"] for row in rows} == {"ours"}
    frames = [int(row["video_frame"]) for row in rows]
    assert frames == np.floor(np.arange(72) / 60 * 25 + 1e-6).astype(int).tolist()
    np.testing.assert_allclose([float(row["factor"]) for row in rows], FACTORS[frames])
    np.testing.assert_allclose([float(row["flip_time_s"]) for row in rows], np.arange(72) / 60, atol=1e-8)
    assert {row["refreshes_dropped"] for row in rows} == {"0"}
    said = played["commands"][0]["out"]
    assert "8, ours: 30 of 30 frames in 72 refreshes at 60 Hz, not timed in this rehearsal; luminance" in said
    assert "read back 12 times" in said


def test_without_a_rig_the_window_is_as_large_as_the_video(played: dict[str, Any], made: Path) -> None:
    with Image.open(made / "shots/clip.png") as picture:
        assert picture.size == (120, 90)
        assert np.ptp(np.asarray(picture)) > 100


def test_both_versions_come_one_after_the_other(played: dict[str, Any], made: Path) -> None:
    """Without a summary the baseline is the mean factor: 0.7, of frames of equal length."""
    rows = [json.loads(line) for line in (made / "log.jsonl").read_text().splitlines()]
    assert [row["version"] for row in rows] == ["ours"] * 72 + ["baseline"] * 72
    assert [row["factor"] for row in rows[72:]] == pytest.approx([0.7] * 72)
    assert [row["pass"] for row in rows] == [1] * 72 + [2] * 72
    assert "baseline: constant factor 0.7, the track's mean, for there is no" in played["commands"][1]["out"]


def test_a_sequence_is_rendered_at_the_tracks_rate_and_length(played: dict[str, Any]) -> None:
    done = played["commands"][3]
    assert (done["code"], done["out"], done["err"]) == (0, "", "")


def test_a_sequence_is_seen_at_its_true_size_the_middle_that_fits(played: dict[str, Any], made: Path) -> None:
    """72.28 pixels per degree are 4141 from the eye; 350 there are 90 degrees: 11.8 times as large.

    Of them 640 fit, and 480 upright: 2 atan(320 / 4141) = 8.84 degrees, 2 atan(240 / 4141) = 6.63.
    """
    done = played["commands"][2]
    assert (done["code"], done["err"]) == (0, "")
    shown = (
        "checkerboard: 90° wide; the window shows the middle 8.84° × 6.63° at true size, scaled 11.8 times"
    )
    assert shown in done["out"]
    assert re.search(r"read back 12 times, off by 0\.00\d+ cd", done["out"])
    with (made / "board.csv").open(newline="") as file:
        degrees = {row["pixels_per_degree"] for row in csv.DictReader(file)}
    assert float(degrees.pop()) == pytest.approx(350 * np.radians(1))
    assert not degrees


def test_without_a_rig_it_is_said_to_be_a_look_only(played: dict[str, Any], made: Path) -> None:
    assert "8: a look only, at no known angle; a --rig or --display" in played["commands"][0]["out"]
    with (made / "log.csv").open(newline="") as file:
        assert {row["pixels_per_degree"] for row in csv.DictReader(file)} == {""}
    assert "10: pixel for pixel, 72.3 pixels per degree" in played["commands"][1]["out"]


def test_in_real_time_it_takes_its_time(played: dict[str, Any]) -> None:
    """A virtual screen refreshes nothing: flips come as they will, and frames are due by the clock."""
    said = played["commands"][4]
    assert said["code"] == 0
    frames = re.search(r"(\d+) of 30 frames in (\d+) refreshes", said["out"])
    assert frames
    assert 1 < int(frames[1]) <= 30  # a busy machine leaves some out
    assert int(frames[1]) <= int(frames[2])
    assert said["seconds"] > 29 / RATE


def test_keys_are_held_from_their_press_to_their_release(played: dict[str, Any]) -> None:
    assert played["held"] == [
        ["w"],
        ["lshift", "w"],
        ["left", "lshift", "w"],
        ["left", "lshift"],
        ["left"],
        [],
        [],  # who has closed hears no more
    ]


def test_the_baseline_of_frames_of_unequal_length_weighs_them_by_time() -> None:
    """1, 1, 2 and (as most) 1 s with factors 0.2, 0.2, 0.8, 0.2: (0.2 + 0.2 + 1.6 + 0.2) / 5 = 0.44."""
    track = example_track([0.2, 0.2, 0.8, 0.2], times=np.array([0.0, 1, 2, 4]))
    assert mean_factor(track) == pytest.approx(0.44)


def test_what_does_not_fit_is_refused_before_a_window_opens(made: Path, tmp_path: Path, command: Any) -> None:
    video, track = made / "8.mkv", made / "track"
    few = write_a_track(tmp_path / "few", n=29)
    fast = write_a_track(tmp_path / "fast", rate=30.0)
    other = write_a_track(tmp_path / "other", display_name="desk", display_fingerprint="0" * 16)
    fine = write_a_track(tmp_path / "fine", pixels_per_degree=38.0)
    cut = tmp_path / "cut.mkv"
    cut.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    there, way = tmp_path / "there.csv", tmp_path / "way.json"
    there.touch()
    way.touch()
    for arguments, says in [
        ((video, few), "the video '8' has 30 frames, and its brightness track 29"),
        (
            (video, fast),
            "frame 1 of the video '8' appears at 0.0400 s, and its brightness track says 0.0333 s",
        ),
        ((video, other), "give the display as --display, a file"),
        ((video, other, "--display", "varjo-xr3"), "made for the display 'desk', and here is 'varjo-xr3'"),
        ((cut, track), "cut.mkv is cut off"),
        ((video, tmp_path / "gone"), "no such brightness track"),
        ((video, tmp_path), "holds the tracks of fast, few, fine, other; give the folder of one, "),
        ((video, track, "--size", "64x48"), "--size is for built-in sequences"),
        ((video, track, "--log", "log.txt"), "give a file that ends in .csv or .jsonl"),
        ((video, track, "--log", there), "there.csv: is there already; give another name"),
        ((video, track, "--loop", "--simulate"), "--loop goes on until someone presses escape"),
        (("nothing", track), "no video 'nothing'"),
        (
            (video, fine, "--rig", "simulated"),
            "seen at 38 pixels per degree, and 'varjo-xr3' shows it at 72.3, pixel for pixel: make the track",
        ),
        (
            ("sunrise", fine, "--rig", "simulated"),
            "make the track again with --field-of-view 90, or accept that with --other-geometry-ok",
        ),
    ]:
        outcome = command("play", *arguments)
        assert outcome.code == 2, says
        assert says in outcome.err
        assert outcome.err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--record", "way.json"), "way.json: is there already; give another name"),
        (("--log", "there.csv"), "there.csv: is there already; give another name"),
        (("--field-of-view", 0.05), "--field-of-view must lie in 0.1 to 175 degrees, got 0.05"),
        (("--out", "log"), "--out keeps what a controller did: give --target-loss or --budget with it"),
        (("--device", "cpu"), "--device is for walks that are dimmed live"),
        (("--other-display-ok",), "--other-display-ok is for walks that are dimmed live"),
        (("--target-loss", 2), "--target-loss must lie in 0 to 1, got 2"),
        (("--target-loss", 0.1, "--horizon", 9), "--horizon is for --budget, which is not given"),
        (("--simulate",), "a walk ends with escape, which no one presses with --simulate: give --seconds"),
    ],
)
def test_what_a_walk_refuses(
    command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: Any, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("way.json", "there.csv"):
        Path(name).touch()
    outcome = command("walk", "house", *words)
    assert (outcome.code, says in outcome.err, outcome.err.count("\n")) == (2, True, 1), outcome.err


def test_the_spelling_of_before_is_told_the_new_one(command: Callable[..., Any]) -> None:
    """An option of walks may stand before --walk."""
    for words in (("house", "--walk"), ("house", "--target-loss", 0.1, "--walk", "--out", "walk")):
        outcome = command("play", *words)
        assert (outcome.code, "`evenlight walk SCENE`" in outcome.err) == (2, True), outcome.err


def test_a_track_for_a_backlight_says_on_pixels_what_it_may_be_off(tmp_path: Path) -> None:
    """0.0234 more is lost where pixels dim; nothing is said of a backlight, nor where next to nothing is."""
    rig, _ = load_rig("simulated")
    off = read_track(write_a_track(tmp_path / "off", loss_added_by_pixels=0.0234) / "track.csv")
    assert "in some frames at least 0.023 more of the visible contrast is lost" in floor_note(off, rig)
    assert floor_note(off, replace(rig, actuator=Actuator.BACKLIGHT, backlight="simulated")) == ""
    for little in (0.0004, None):
        track = read_track(write_a_track(tmp_path / "good", loss_added_by_pixels=little) / "track.csv")
        assert floor_note(track, rig) == ""


def test_without_a_screen_one_line_says_so(made: Path, command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    outcome = command("play", made / "8.mkv", made / "track", "--log", made / "none.csv")
    assert outcome.code == 2
    assert "no display: the environment variable DISPLAY is not set" in outcome.err
    assert not (made / "none.csv").exists()


def test_a_track_of_another_film_is_told_of(
    made: Path, tmp_path: Path, command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames and times fit, the content is another: as of a film that was encoded again."""
    monkeypatch.delenv("DISPLAY", raising=False)
    note = "note: the track was made of '8', and '10' has other content: right if it is the same film"
    own = Provenance(inputs={"video": sha256_of_file(made / "8.mkv")})
    track = write_a_track(tmp_path / "own", provenance=own)
    assert note in command("play", made / "10.mkv", track).out
    assert "note" not in command("play", made / "8.mkv", track).out
    assert "note" not in command("play", made / "10.mkv", track, "--quiet").out
    assert "note" not in command("play", made / "10.mkv", made / "track").out  # which does not tell
